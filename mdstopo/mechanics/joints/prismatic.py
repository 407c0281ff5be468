"""The prismatic joint: the second body slides along an axis that the first one carries, and does not turn against it.

Phi = (n . D, psi_B - psi_A - theta_0) with the normal n = R_A n_0, D = x_B + c - x_A - p, p = R_A s_A, c = R_B s_B.
n . p is constant, so with E = x_B + c - x_A and m = n turned by a right angle

    Phi'_1 = n . E' + omega_A m . E,     Phi''_1 = n . E'' + 2 omega_A m . E' + omega_A' m . E - omega_A^2 n . E

Parameters: s_A (2), s_B (2), n_0 (2), -, -, n . D at home. theta_0 is the angle at home.
"""

from mdstopo.case.joints import PrismaticJoint
from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.joints.joint_kernels import AtHome, JointKernels
from mdstopo.mechanics.joints.revolute import apart_since, arms


@kernel
def _frame(par, w):
    """n, E, c: normal, second point from the first centre of mass, its arm; global axes."""
    _, _, cx, cy = arms(par, w)
    ca = w[6]
    sa = w[7]
    nx = ca * par[4] - sa * par[5]
    ny = sa * par[4] + ca * par[5]
    return nx, ny, w[3] + cx - w[0], w[4] + cy - w[1], cx, cy


@kernel
def prismatic_rows(par, w, phi, jac):
    """The two Phi of a prismatic joint, and their slopes Phi_q."""
    nx, ny, ex, ey, cx, cy = _frame(par, w)
    # n . D less n_h . D_h at home, in what n and D have changed by
    px, py, _, _ = arms(par, w)
    dx, dy = apart_since(par, w)
    turned_x = w[14] * par[4] - w[15] * par[5]
    turned_y = w[15] * par[4] + w[14] * par[5]
    phi[0] = par[8] + (nx * dx + ny * dy) + (turned_x * (ex - px - dx) + turned_y * (ey - py - dy))
    phi[1] = w[5] - w[2]
    jac[0, 0] = -nx
    jac[0, 1] = -ny
    jac[0, 2] = nx * ey - ny * ex
    jac[0, 3] = nx
    jac[0, 4] = ny
    jac[0, 5] = ny * cx - nx * cy
    for i in range(6):
        jac[1, i] = 0.0
    jac[1, 2] = -1.0
    jac[1, 5] = 1.0


@kernel
def prismatic_gamma(par, w, wd, gamma):
    """gamma of Phi_q a + gamma = 0: what velocities add to the second derivative of Phi."""
    nx, ny, ex, ey, cx, cy = _frame(par, w)
    dx = wd[3] - wd[0] - wd[5] * cy
    dy = wd[4] - wd[1] + wd[5] * cx
    gamma[0] = 2.0 * wd[2] * (nx * dy - ny * dx) - wd[5] ** 2 * (nx * cx + ny * cy) - wd[2] ** 2 * (nx * ex + ny * ey)
    gamma[1] = 0.0


@kernel
def prismatic_velocity_slope(par, w, wd, out):
    """Slopes of the rate of Phi by coordinates: d(Phi_q v)/dq."""
    nx, ny, ex, ey, cx, cy = _frame(par, w)
    dx = wd[3] - wd[0] - wd[5] * cy
    dy = wd[4] - wd[1] + wd[5] * cx
    wa = wd[2]
    out[0, 0] = wa * ny
    out[0, 1] = -wa * nx
    out[0, 2] = nx * dy - ny * dx - wa * (nx * ex + ny * ey)
    out[0, 3] = -wa * ny
    out[0, 4] = wa * nx
    out[0, 5] = (wa - wd[5]) * (nx * cx + ny * cy)
    for i in range(6):
        out[1, i] = 0.0


@kernel
def prismatic_acceleration_slopes(par, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma at fixed a; the angle's rows are zero.

    In:
      par (WIDTH,): parameters of the joint.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      wd, wdd (6,): their velocities and accelerations (m/s, rad/s; m/s^2, rad/s^2).
    Out:
      by_q (2 or more, 6): d(Phi_q a + gamma)/dq.
      by_v (2 or more, 6): d(gamma)/dv.
    """
    nx, ny, ex, ey, cx, cy = _frame(par, w)
    wa = wd[2]
    wb = wd[5]
    dx = wd[3] - wd[0] - wb * cy
    dy = wd[4] - wd[1] + wb * cx
    ddx = wdd[3] - wdd[0] - wdd[5] * cy - wb * wb * cx
    ddy = wdd[4] - wdd[1] + wdd[5] * cx - wb * wb * cy
    gx = -wdd[2] * ny - wa * wa * nx
    gy = wdd[2] * nx - wa * wa * ny
    along = nx * ex + ny * ey
    arm = nx * cx + ny * cy
    across = ny * cx - nx * cy  # n . (c turned)
    by_q[0, 0] = -gx
    by_q[0, 1] = -gy
    by_q[0, 2] = (nx * ddy - ny * ddx) - 2.0 * wa * (nx * dx + ny * dy) - wdd[2] * along - wa * wa * (nx * ey - ny * ex)
    by_q[0, 3] = gx
    by_q[0, 4] = gy
    by_q[0, 5] = -wdd[5] * arm - wb * wb * across + 2.0 * wa * wb * across + wdd[2] * arm - wa * wa * across
    by_v[0, 0] = 2.0 * wa * ny
    by_v[0, 1] = -2.0 * wa * nx
    by_v[0, 2] = 2.0 * (nx * dy - ny * dx) - 2.0 * wa * along
    by_v[0, 3] = -2.0 * wa * ny
    by_v[0, 4] = 2.0 * wa * nx
    by_v[0, 5] = 2.0 * (wa - wb) * arm
    for i in range(6):
        by_q[1, i] = 0.0
        by_v[1, i] = 0.0


@kernel
def prismatic_stiffness(par, w, lam, k):
    """Add the slopes of the joint's forces, d(Phi_q^T lam)/dq, to k."""
    nx, ny, ex, ey, cx, cy = _frame(par, w)
    f = lam[0]
    k[0, 2] += f * ny
    k[2, 0] += f * ny
    k[1, 2] -= f * nx
    k[2, 1] -= f * nx
    k[3, 2] -= f * ny
    k[2, 3] -= f * ny
    k[4, 2] += f * nx
    k[2, 4] += f * nx
    arm = f * (nx * cx + ny * cy)
    k[2, 2] -= f * (nx * ex + ny * ey)
    k[2, 5] += arm
    k[5, 2] += arm
    k[5, 5] -= arm


@kernel
def prismatic_moment(par, w, lam, by_lam, by_q):
    """The moment lam_2 - lam_1 m . D about the first body's joint point, and its slopes."""
    nx, ny, ex, ey, cx, cy = _frame(par, w)
    px, py, _, _ = arms(par, w)
    lever = nx * (ey - py) - ny * (ex - px)
    by_lam[0] = -lever
    by_lam[1] = 1.0
    by_q[0] = -lam[0] * ny
    by_q[1] = lam[0] * nx
    by_q[2] = lam[0] * (nx * ex + ny * ey)
    by_q[3] = lam[0] * ny
    by_q[4] = -lam[0] * nx
    by_q[5] = -lam[0] * (nx * cx + ny * cy)
    return lam[1] - lam[0] * lever


def prismatic_at_home(joint: PrismaticJoint, home: AtHome) -> dict[int, float]:
    """How far the second point is off the axis at home (m), by its place in the parameters."""
    nx, ny = -joint.axis[1], joint.axis[0]
    return {8: (home.c * nx - home.s * ny) * home.x + (home.s * nx + home.c * ny) * home.y}


KERNELS = JointKernels(
    at_home=prismatic_at_home,
    steady=((), ()),
    phi=prismatic_rows,
    gamma=prismatic_gamma,
    velocity_slope=prismatic_velocity_slope,
    acceleration_slopes=prismatic_acceleration_slopes,
    stiffness=prismatic_stiffness,
    force_rows=1,
    moment=prismatic_moment,
)
