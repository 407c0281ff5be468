"""The revolute joint: two points coincide. Phi = x_B + c - x_A - p with arms p = R_A s_A, c = R_B s_B (global axes).

Parameters: s_A (2), s_B (2), -, -, -, -, Phi at home (2). Used by the fixed joint too, which adds a row of its own.
"""

from mdstopo.compiler.jit import part
from mdstopo.mechanics.joints.joint_kernels import AtHome, JointKernels
from mdstopo.mechanics.kinematics.planar_poses import turned_body
from mdstopo.scene.springs_model import HOME_X, HOME_Y

#: places of w: x, y of a body and by what angle it has turned since home, for both; cos and sin of both angles psi;
#: then what has changed since home: x and y of both, cos and sin of both
PLACES = 18


@part
def place_turned(home, a, b, q, turns_a, turns_b, w):
    """Fill w (PLACES,) with where the bodies of a joint are, their rotations being given.

    In:
      home (n_body, HOME): where bodies are when q is zero.
      a, b: numbers of the first and the second body.
      q (n,): coordinates (m, rad).
      turns_a, turns_b (4 numbers): what `turned_body` gives of them.
    Out:
      w (PLACES,): overwritten.
    """
    for side in range(2):
        body = a if side == 0 else b
        c, s, c_since, s_since = turns_a if side == 0 else turns_b
        w[3 * side] = home[body, HOME_X] + q[3 * body]
        w[3 * side + 1] = home[body, HOME_Y] + q[3 * body + 1]
        w[3 * side + 2] = q[3 * body + 2]
        w[6 + 2 * side] = c
        w[7 + 2 * side] = s
        w[10 + 2 * side] = q[3 * body]
        w[11 + 2 * side] = q[3 * body + 1]
        w[14 + 2 * side] = c_since
        w[15 + 2 * side] = s_since


@part
def place_joint(home, a, b, q, w):
    """Fill w (PLACES,) with where bodies a and b of a joint are, at coordinates q (n,)."""
    place_turned(home, a, b, q, turned_body(home, a, q[3 * a + 2]), turned_body(home, b, q[3 * b + 2]), w)


@part
def apart_since(par, w):
    """By how much the vector between the two points of the joint, x_B + c - x_A - p, has changed since home."""
    return (
        w[12] - w[10] + (w[16] * par[2] - w[17] * par[3]) - (w[14] * par[0] - w[15] * par[1]),
        w[13] - w[11] + (w[17] * par[2] + w[16] * par[3]) - (w[15] * par[0] + w[14] * par[1]),
    )


@part
def arms(par, w):
    """Vectors from the centres of mass to the joint's points, in global axes: px, py, cx, cy."""
    ca = w[6]
    sa = w[7]
    cb = w[8]
    sb = w[9]
    return (
        ca * par[0] - sa * par[1],
        sa * par[0] + ca * par[1],
        cb * par[2] - sb * par[3],
        sb * par[2] + cb * par[3],
    )


@part
def revolute_rows(par, w, phi, jac):
    """The two Phi of a revolute joint, and their slopes Phi_q."""
    px, py, cx, cy = arms(par, w)
    x, y = apart_since(par, w)
    phi[0] = par[8] + x
    phi[1] = par[9] + y
    for r in range(2):
        for i in range(6):
            jac[r, i] = 0.0
        jac[r, r] = -1.0
        jac[r, 3 + r] = 1.0
    jac[0, 2] = py
    jac[0, 5] = -cy
    jac[1, 2] = -px
    jac[1, 5] = cx


@part
def revolute_gamma(par, w, wd, gamma):
    """gamma of Phi_q a + gamma = 0: the centripetal accelerations of the joint's points."""
    px, py, cx, cy = arms(par, w)
    gamma[0] = wd[2] * wd[2] * px - wd[5] * wd[5] * cx
    gamma[1] = wd[2] * wd[2] * py - wd[5] * wd[5] * cy


@part
def revolute_velocity_slope(par, w, wd, out):
    """Slopes of the rate of Phi by coordinates, d(Phi_q v)/dq: only the arms turn."""
    px, py, cx, cy = arms(par, w)
    for r in range(2):
        for i in range(6):
            out[r, i] = 0.0
    out[0, 2] = wd[2] * px
    out[0, 5] = -wd[5] * cx
    out[1, 2] = wd[2] * py
    out[1, 5] = -wd[5] * cy


@part
def revolute_acceleration_slopes(par, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma at fixed a.

    In:
      par (WIDTH,): parameters of the joint.
      w (PLACES,): where both bodies are (`place_joint`).
      wd, wdd (6,): their velocities and accelerations (m/s, rad/s; m/s^2, rad/s^2).
    Out:
      by_q (2 or more, 6): d(Phi_q a + gamma)/dq.
      by_v (2 or more, 6): d(gamma)/dv.
    """
    px, py, cx, cy = arms(par, w)
    for r in range(2):
        for i in range(6):
            by_q[r, i] = 0.0
            by_v[r, i] = 0.0
    wa = wd[2]
    wb = wd[5]
    by_q[0, 2] = wdd[2] * px - wa * wa * py
    by_q[0, 5] = -wdd[5] * cx + wb * wb * cy
    by_q[1, 2] = wdd[2] * py + wa * wa * px
    by_q[1, 5] = -wdd[5] * cy - wb * wb * cx
    by_v[0, 2] = 2.0 * wa * px
    by_v[0, 5] = -2.0 * wb * cx
    by_v[1, 2] = 2.0 * wa * py
    by_v[1, 5] = -2.0 * wb * cy


@part
def revolute_vjp(par, w, wd, wdd, lam, y0, y1, z_first, z_second):
    """What `revolute_acceleration_slopes` and `revolute_stiffness` give, transposed, times two vectors.

    (d(Phi_q a + gamma)/dq)^T y + (d(Phi_q^T lam)/dq)^T z and (d(gamma)/dv)^T y, of which only those by the angles are
    not zero.

    par (WIDTH,): parameters of the joint.
    w (PLACES,): where both bodies are (`place_joint`).
    wd, wdd (6,): their velocities and accelerations (m/s, rad/s; m/s^2, rad/s^2).
    lam (2 or more,): multipliers (N).
    y0, y1: y, one number for each row.
    z_first, z_second: the virtual displacement z of the angle of the first body and of the second (rad).

    Returns four numbers: by the angle of the first body, by that of the second, then by their rates.
    """
    px, py, cx, cy = arms(par, w)
    wa = wd[2]
    wb = wd[5]
    along_p = y0 * px + y1 * py
    along_c = y0 * cx + y1 * cy
    return (
        wdd[2] * along_p + wa * wa * (y1 * px - y0 * py) + (lam[0] * px + lam[1] * py) * z_first,
        wb * wb * (y0 * cy - y1 * cx) - wdd[5] * along_c - (lam[0] * cx + lam[1] * cy) * z_second,
        2.0 * wa * along_p,
        -2.0 * wb * along_c,
    )


@part
def revolute_stiffness(par, w, lam, k):
    """Add the slopes of the joint's forces, d(Phi_q^T lam)/dq, to k."""
    px, py, cx, cy = arms(par, w)
    k[2, 2] += lam[0] * px + lam[1] * py
    k[5, 5] -= lam[0] * cx + lam[1] * cy


def point_at_home(_: object, home: AtHome) -> dict[int, float]:
    """Phi of the two points at home, by the place of its entries in the parameters."""
    return {8: home.x, 9: home.y}


KERNELS = JointKernels(
    at_home=point_at_home,
    steady=((0, 1), (0, 1)),
    phi=revolute_rows,
    gamma=revolute_gamma,
    velocity_slope=revolute_velocity_slope,
    acceleration_slopes=revolute_acceleration_slopes,
    stiffness=revolute_stiffness,
    force_rows=2,
    is_point=True,
)
