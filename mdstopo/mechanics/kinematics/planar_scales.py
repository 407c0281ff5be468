"""How far bodies in a plane have moved or turned, and what an error of their coordinates means in metres."""

import numpy as np

from mdstopo.compiler.jit import part
from mdstopo.mechanics.kinematics.planar_poses import DX, DY, UC, US, UX, UY
from mdstopo.mechanics.kinematics.timed import ARM, BODY, KIND, MOMENT, most_of_load


@part
def deflection(rel, rel0, reach, p):
    """How far the pair p has moved from its pose at the start, at its attachment points, m (angle within a turn)."""
    x = rel[p, UX] - rel0[p, UX]
    y = rel[p, UY] - rel0[p, UY]
    c = rel[p, UC] - rel0[p, UC]
    s = rel[p, US] - rel0[p, US]
    return np.sqrt(x * x + y * y) + reach[p] * np.sqrt(c * c + s * s)


@part
def gross_loads(model, out):
    """out (n,) = the largest size of the applied loads of each coordinate, without regard to their signs."""
    out[:] = 0.0
    for segment in range(model.times.shape[0] - 1):
        length = model.times[segment + 1] - model.times[segment]
        for d in range(out.shape[0]):
            start = model.force[segment, d, 0]
            out[d] = max(out[d], abs(start), abs(start + length * model.force[segment, d, 1]))
    for k in range(model.load_body.shape[0]):
        most = 0.0
        for segment in range(model.times.shape[0] - 1):
            length = model.times[segment + 1] - model.times[segment]
            for axis in range(2):
                start = model.load_force[segment, k, axis, 0]
                most = max(most, abs(start), abs(start + length * model.load_force[segment, k, axis, 1]))
        b = 3 * model.load_body[k]
        out[b] += most
        out[b + 1] += most
        out[b + 2] += most * (abs(model.load_arm[k, 0]) + abs(model.load_arm[k, 1]))


@part
def add_gross_timed_loads(model, out):
    """Add to out (n,) the largest sizes of loads that are formulas of time, of a general scene."""
    for k in range(model.timed_load.shape[0]):
        most = most_of_load(model, k)
        b = 3 * model.timed_load[k, BODY]
        if model.timed_load[k, KIND] == MOMENT:
            out[b + 2] += most
            continue
        out[b] += most
        out[b + 1] += most
        out[b + 2] += most * (abs(model.timed_arm[k, ARM]) + abs(model.timed_arm[k, ARM + 1]))


@part
def add_gross_force(pair, rel, reach, p, force, out):
    """Add a force of any direction between the bodies of a pair, and its moments, without regard to signs.

    In:
      pair (n_pair, 2): the bodies of each pair.
      rel (n_pair, POSE): relative poses.
      reach (n_pair,): largest distance of an attachment point from its centre of mass (m).
      p: number of the pair.
      force: its size (N).
    Out:
      out (n or more,): added to (N, N m).
    """
    arm = np.sqrt(rel[p, DX] * rel[p, DX] + rel[p, DY] * rel[p, DY]) + reach[p]
    for side in range(2):
        b = 3 * pair[p, side]
        out[b] += force
        out[b + 1] += force
        out[b + 2] += arm * force


@part
def rounding_of_pairs(model, inverse, rel, v, load, stiffness, strain, noise):
    """Estimate what rounding leaves uncertain of how far each pair has moved.

    Displacements are summed since the start, so it is a share of what forces move bodies by, not of where these are:
    of the strain at the start, and of what the loads and velocities do until members hold against them.

    Constant:
      model: the compiled scene.
    In:
      inverse (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      rel (n_pair, POSE): relative poses at the start.
      v (n or more,): velocities at the start (m/s, rad/s).
      load (n or more,): largest loads (N, N m), of `gross_loads`.
      stiffness (n_pair,): of all members of a pair (N/m).
      strain (n_pair,): at the start (m).
    Out:
      noise (n_pair,): what is uncertain (m).
    """
    span = model.times[model.times.shape[0] - 1] - model.times[0]
    for p in range(model.pair.shape[0]):
        arm = np.sqrt(rel[p, DX] * rel[p, DX] + rel[p, DY] * rel[p, DY]) + model.reach[p]
        mobility = 0.0
        speed = 0.0
        push = 0.0
        for side in range(2):
            b = 3 * model.pair[p, side]
            mobility += inverse[b]
            speed += abs(v[b]) + abs(v[b + 1]) + arm * abs(v[b + 2])
            push += inverse[b] * (load[b] + load[b + 1]) + arm * inverse[b + 2] * load[b + 2]
        rate = np.sqrt(stiffness[p] * mobility) if stiffness[p] > 0.0 else 0.0
        time = span if rate * span <= 1.0 else 1.0 / rate
        moved = strain[p] + time * (speed + time * push)
        noise[p] = 1e-15 * min(moved, arm) + 1e-24 * arm + 1e-300


@part
def noise_of(pair, noise, rel, reach, q, p):
    """What rounding leaves uncertain of how far a pair has moved, in a state (m).

    What both bodies have moved together is rounded, too.

    pair (n_pair, 2): the bodies of each pair.
    noise (n_pair,): of `rounding_of_pairs` (m).
    rel (n_pair, POSE): relative poses.
    reach (n_pair,): largest distance of an attachment point from its centre of mass (m).
    q (n or more,): coordinates (m, rad).
    p: number of the pair.
    """
    a = 3 * pair[p, 0]
    b = 3 * pair[p, 1]
    moved = max(abs(q[a]), abs(q[a + 1])) + max(abs(q[b]), abs(q[b + 1]))
    turned = min(abs(q[a + 2]), 1.0) + min(abs(q[b + 2]), 1.0)
    if turned > 0.0:
        moved += turned * (np.sqrt(rel[p, DX] * rel[p, DX] + rel[p, DY] * rel[p, DY]) + reach[p])
    return noise[p] + 1e-15 * moved


@part
def largest_turn(pair, before, after):
    """How far the bodies of a pair turn against each other between two states (n,), rad, at most."""
    largest = 0.0
    for p in range(pair.shape[0]):
        a = 3 * pair[p, 0] + 2
        b = 3 * pair[p, 1] + 2
        largest = max(largest, abs(after[b] - before[b] - after[a] + before[a]))
    return largest


@part
def motion_weights(pair, rel, reach, scale, weight):
    """weight (n,): change of each coordinate times its weight is at least the displacement relative to the scale.

    A turn of a body moves the points of its pairs by at most the distance of the bodies plus their reach.
    """
    weight[:] = 0.0
    for p in range(pair.shape[0]):
        arm = np.sqrt(rel[p, DX] * rel[p, DX] + rel[p, DY] * rel[p, DY]) + reach[p]
        for side in range(2):
            b = 3 * pair[p, side]
            turn = (arm if side == 0 else reach[p]) / scale[p]
            weight[b] = max(weight[b], 1.0 / scale[p])
            weight[b + 1] = max(weight[b + 1], 1.0 / scale[p])
            weight[b + 2] = max(weight[b + 2], turn)
