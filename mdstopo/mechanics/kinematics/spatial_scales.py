"""How far bodies in space have moved or turned, and what an error of their coordinates means in metres."""

import numpy as np

from mdstopo.compiler.jit import part
from mdstopo.mechanics.kinematics.rotations import quaternion_at, turn_between
from mdstopo.mechanics.kinematics.spatial_forces import ACCELERATES
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, FREEDOMS, HOME_PLACE, D, W, deflection_of
from mdstopo.mechanics.kinematics.timed import ARM, BODY, KIND, PUSH, TURNS, most_of_load
from mdstopo.mechanics.kinematics.vectors import norm, vector_at

#: rad, below half a turn: from this angle on velocities tell how far a body turns in a step
WHOLE_TURNS = 3.0


@part
def turned_since(q, body):
    """By what angle a body has turned since home (rad), for small ones; above 1 the larger the more."""
    i = COORDINATES * body + 4
    return 2.0 * norm(vector_at(q, i))


@part
def moved_most(model, q, size):
    """The largest of all |x|, |y|, |z| and angles times size."""
    moved = 0.0
    for body in range(model.home.shape[0]):
        b = COORDINATES * body
        moved = max(moved, abs(q[b]), abs(q[b + 1]), abs(q[b + 2]), min(turned_since(q, body), 1.0) * size)
    return moved


@part
def turning_rate(model, rel, p):
    """The size of w."""
    return norm(vector_at(rel[p], W))


@part
def home_extent(model):
    """The largest of all |x|, |y| and |z|."""
    extent = 0.0
    for b in range(model.home.shape[0]):
        for axis in range(3):
            extent = max(extent, abs(model.home[b, HOME_PLACE + axis]))
    return extent


@part
def deflection(model, rel, rel0, p):
    """See `spatial_poses.deflection_of`; see `kinematics_interface.deflection`."""
    return deflection_of(rel[p], rel0[p], model.reach[p])


@part
def largest_turn(model, before, after, h, v_before, v_after):
    """The largest angle by which a body turns between two states, rad: rotation vectors of a step stay short.

    Quaternions do not tell whole turns, and twenty would look like none: where a body is fast enough for half a turn,
    its velocities tell; see `kinematics_interface.largest_turn`.
    """
    largest = 0.0
    for body in range(model.home.shape[0]):
        i = COORDINATES * body + 3
        j = FREEDOMS * body + 3
        largest = max(largest, norm(turn_between(quaternion_at(before, i), quaternion_at(after, i))))
        by_rates = 0.5 * h * (norm(vector_at(v_before, j)) + norm(vector_at(v_after, j)))
        if by_rates > WHOLE_TURNS:
            largest = max(largest, by_rates)
    return largest


@part
def arm_of(model, rel, p):
    """The distance of both bodies, and the reach of the points of the second."""
    return norm(vector_at(rel[p], D)) + model.reach[p]


@part
def motion_weights(model, rel, scale, weight):
    """See `kinematics_interface.motion_weights`.

    A turn of a body moves the points of its pairs by at most the distance of the bodies plus their reach.
    """
    weight[:] = 0.0
    for p in range(model.pair.shape[0]):
        arm = arm_of(model, rel, p)
        for side in range(2):
            b = FREEDOMS * model.pair[p, side]
            turn = (arm if side == 0 else model.reach[p]) / scale[p]
            for axis in range(3):
                weight[b + axis] = max(weight[b + axis], 1.0 / scale[p])
                weight[b + 3 + axis] = max(weight[b + 3 + axis], turn)


@part
def noise_of(model, noise, rel, q, p):
    """See `kinematics_interface.noise_of`; what both bodies have moved together is rounded, too."""
    moved = 0.0
    turned = 0.0
    for side in range(2):
        body = model.pair[p, side]
        i = COORDINATES * body
        moved += max(abs(q[i]), abs(q[i + 1]), abs(q[i + 2]))
        turned += min(turned_since(q, body), 1.0)
    return noise[p] + 1e-15 * (moved + turned * arm_of(model, rel, p))


@part
def gross_loads(model, out):
    """See `kinematics_interface.gross_loads`."""
    out[:] = 0.0
    for segment in range(model.times.shape[0] - 1):
        length = model.times[segment + 1] - model.times[segment]
        for d in range(out.shape[0]):
            start = model.force[segment, d, 0]
            out[d] = max(out[d], abs(start), abs(start + length * model.force[segment, d, 1]))
    for k in range(model.load_body.shape[0]):
        b = FREEDOMS * model.load_body[k]
        most = 0.0
        couple = 0.0
        for segment in range(model.times.shape[0] - 1):
            length = model.times[segment + 1] - model.times[segment]
            for axis in range(2 * 3):
                start = model.load_force[segment, k, axis, 0]
                size = max(abs(start), abs(start + length * model.load_force[segment, k, axis, 1]))
                if axis < 3:
                    most = max(most, size)
                elif model.load_follows[k] == ACCELERATES:
                    couple = max(couple, size * max(model.mass[b + 3], model.mass[b + 4], model.mass[b + 5]))
                else:
                    couple = max(couple, size)
        arm = norm(vector_at(model.load_arm[k], 0))
        for axis in range(3):
            out[b + axis] += most
            out[b + 3 + axis] += most * arm + couple
    for k in range(model.timed_load.shape[0]):
        b = FREEDOMS * model.timed_load[k, BODY]
        most = most_of_load(model, k)
        if model.timed_load[k, TURNS] == ACCELERATES:
            most *= max(model.mass[b + 3], model.mass[b + 4], model.mass[b + 5])
        arm = norm(vector_at(model.timed_arm[k], ARM))
        push = 1.0 if model.timed_load[k, KIND] == PUSH else 0.0
        for axis in range(3):
            out[b + axis] += push * most
            out[b + 3 + axis] += most * (push * arm + 1.0 - push)


@part
def add_gross_force(model, rel, p, force, out):
    """See `kinematics_interface.add_gross_force`."""
    arm = arm_of(model, rel, p)
    for side in range(2):
        b = FREEDOMS * model.pair[p, side]
        for axis in range(3):
            out[b + axis] += force
            out[b + 3 + axis] += arm * force


@part
def rounding_of_pairs(model, inverse, rel, v, load, stiffness, strain, noise):
    """As `planar_scales.rounding_of_pairs`; see `kinematics_interface.rounding_of_pairs`."""
    span = model.times[model.times.shape[0] - 1] - model.times[0]
    for p in range(model.pair.shape[0]):
        arm = arm_of(model, rel, p)
        mobility = 0.0
        speed = 0.0
        push = 0.0
        for side in range(2):
            b = FREEDOMS * model.pair[p, side]
            mobility += inverse[b]
            for axis in range(3):
                speed += abs(v[b + axis]) + arm * abs(v[b + 3 + axis])
                push += inverse[b] * load[b + axis] + arm * inverse[b + 3 + axis] * load[b + 3 + axis]
        rate = np.sqrt(stiffness[p] * mobility) if stiffness[p] > 0.0 else 0.0
        time = span if rate * span <= 1.0 else 1.0 / rate
        moved = strain[p] + time * (speed + time * push)
        noise[p] = 1e-15 * min(moved, arm) + 1e-24 * arm + 1e-300
