"""Forces and tangents of the bodies, at several states in one pass over the members (`passes`), and their products.

One pass returns a few numbers a pair of bodies and pose (`SUMS`); everything here works on those.
"""

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.planar_forces import add_loads, load_tangent, pair_tangents
from mdstopo.mechanics.kinematics.planar_poses import add_pair_force, relative_pose
from mdstopo.mechanics.passes import member_sums, springs_of


@kernel
def subtract_products(pair, k, x, out, count):
    """out[i] -= K[i] x[i] for i < count: k (count, n_pair, 6, 6), x and out (count, n)."""
    for i in range(count):
        for p in range(pair.shape[0]):
            a = 3 * pair[p, 0]
            b = 3 * pair[p, 1]
            x0 = x[i, a]
            x1 = x[i, a + 1]
            x2 = x[i, a + 2]
            x3 = x[i, b]
            x4 = x[i, b + 1]
            x5 = x[i, b + 2]
            for r in range(6):
                d = a + r if r < 3 else b + r - 3
                out[i, d] -= (
                    k[i, p, r, 0] * x0
                    + k[i, p, r, 1] * x1
                    + k[i, p, r, 2] * x2
                    + k[i, p, r, 3] * x3
                    + k[i, p, r, 4] * x4
                    + k[i, p, r, 5] * x5
                )


@kernel
def subtract_transposed(pair, k, x, out, count):
    """out[i] -= K[i]^T x[i] for i < count: k (count, n_pair, 6, 6), x and out (count, n)."""
    for i in range(count):
        for p in range(pair.shape[0]):
            a = 3 * pair[p, 0]
            b = 3 * pair[p, 1]
            x0 = x[i, a]
            x1 = x[i, a + 1]
            x2 = x[i, a + 2]
            x3 = x[i, b]
            x4 = x[i, b + 1]
            x5 = x[i, b + 2]
            for r in range(6):
                d = a + r if r < 3 else b + r - 3
                out[i, d] -= (
                    k[i, p, 0, r] * x0
                    + k[i, p, 1, r] * x1
                    + k[i, p, 2, r] * x2
                    + k[i, p, 3, r] * x3
                    + k[i, p, 4, r] * x4
                    + k[i, p, 5, r] * x5
                )


@kernel
def add_turning(turn, x, out, count):
    """out[i] += (load tangent) x[i] for i < count: each body's load changes with its own angle; turn (count, n)."""
    for i in range(count):
        for b in range(0, turn.shape[1], 3):
            for d in range(b, b + 3):
                out[i, d] += turn[i, d] * x[i, b + 2]


@kernel
def add_turning_transposed(turn, x, out, count):
    """out[i] += (load tangent)^T x[i] for i < count."""
    for i in range(count):
        for b in range(0, turn.shape[1], 3):
            for d in range(b, b + 3):
                out[i, b + 2] += turn[i, d] * x[i, d]


@part
def forces(model, strength, segment, m, t, q, v, tangent, damped, rel, sums, f, k_out, c_out, turn):
    """Generalised forces on the bodies, and on demand their tangents, at m states in one pass over the members.

    Constant:
      model: the compiled scene.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      segment: of the loads, for all m times.
      m: how many states.
      t (m or more,): times (s).
      q, v (m or more, n): coordinates and velocities (m, rad; m/s, rad/s).
      tangent: whether tangents are wanted.
      damped: whether any force depends on velocity.
    Out:
      rel (m or more, n_pair, POSE): relative poses.
      sums (m or more, n_pair, SUMS): of the members.
      f (m or more, n): forces and moments on the coordinates (N, N m).
      k_out (m or more, n_pair, 6, 6): -dF/dq of each pair, with tangents.
      c_out (m or more, n_pair, 6, 6): -dF/dv of each pair, with tangents and if damped.
      turn (m or more, n): derivative of the loads by the angle of their body, with tangents and if loads turn.
    """
    place_bodies(model.pair, model.home, q, v, m, rel)
    member_sums(springs_of(model), strength, rel, m, tangent, sums)
    sum_bodies(model, segment, m, t, q, tangent, damped, rel, sums, f, k_out, c_out, turn)


@part
def place_bodies(pair, home, q, v, m, rel):
    """Find the relative poses of all pairs at m states.

    In:
      pair (n_pair, 2): the bodies of each pair.
      home (n_body, HOME): where bodies are when q is zero.
      q, v (m or more, n): coordinates and velocities (m, rad; m/s, rad/s).
      m: how many states.
    Out:
      rel (m or more, n_pair, POSE): the first m are overwritten.
    """
    for j in range(m):
        relative_pose(pair, home, q[j], v[j], rel[j])


@part
def sum_bodies(model, segment, m, t, q, tangent, damped, rel, sums, f, k_out, c_out, turn):
    """Forces and tangents of the bodies (`forces`) from sums over the members that are known.

    Constant:
      model: the compiled scene.
    In:
      segment: of the loads, for all m times.
      m: how many states.
      t (m or more,): times (s).
      q (m or more, n): coordinates (m, rad).
      tangent: whether tangents are wanted.
      damped: whether any force depends on velocity.
      rel (m or more, n_pair, POSE): relative poses.
      sums (m or more, n_pair, SUMS): of the members at these poses.
    Out:
      f (m or more, n): forces and moments on the coordinates (N, N m).
      k_out (m or more, n_pair, 6, 6): -dF/dq of each pair, with tangents.
      c_out (m or more, n_pair, 6, 6): -dF/dv of each pair, with tangents and if damped.
      turn (m or more, n): derivative of the loads by the angle of their body, with tangents and if loads turn.
    """
    pair = model.pair
    turning = model.load_body.shape[0] > 0
    for j in range(m):
        out = f[j]
        out[:] = 0.0
        add_loads(model, segment, t[j], q[j], out)
        for p in range(pair.shape[0]):
            add_pair_force(pair, rel[j], p, sums[j, p, 0], sums[j, p, 1], sums[j, p, 2], out)
        if tangent:
            pair_tangents(pair, rel[j], sums[j], damped, k_out[j], c_out[j if damped else 0])
            if turning:
                load_tangent(model, segment, t[j], q[j], turn[j])
