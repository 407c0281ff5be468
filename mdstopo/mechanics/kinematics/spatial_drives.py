"""Prescribed motions in space: x, y, z of centres of mass, and whole rotations.

Each driven coordinate of a centre of mass is a cubic of time within a segment, or a formula. A driven rotation is a
turn Q since the start in axes of its own, which a frame H at home leads to: R(t) = R_home E with

    E = H^T Q H,    v = H^T Q^T omega,    a = H^T Q^T omega'      (omega, omega' in the drive's axes)

because the rate of v is that of omega as the body sees it: omega x omega is nothing. Either Q = Q_z Q_y Q_x of three
angles that are cubics or formulas of time, or omega is linear in time within a segment. Then Q goes on from a row of a
table by the exponential of Magnus' series (S. Blanes, F. Casas, J. Ros, BIT 40, 2000; here of vectors), with
a = h omega(middle), b = h^2 omega' and c = a x b

    Omega = a - c/12 + a x (a x c)/720 + c x b/240 - c x (a x c)/14400,

which is of sixth order, and exact where omega keeps its direction.
"""

import math

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.rotations import exponential, inverse, product
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, FREEDOMS
from mdstopo.mechanics.kinematics.timed import driven_coordinate
from mdstopo.mechanics.kinematics.vectors import cross, plus, put, times, turned_back

#: columns of `GeneralModel.drive_frame`: H by rows, the first row of `drive_turn`, the one behind the last: the same
#: where angles are given
FIRST, BEHIND, FRAME = 9, 10, 11
#: columns of `GeneralModel.drive_turn`: time (s), unit quaternion Q
TIME, TURNED, ROW = 0, 1, 5


@part
def linear_turn(middle, slope):
    """The quaternion of the turn over a time h, of Magnus' series: a = h omega(middle) and b = h^2 omega'."""
    c = cross(middle, slope)
    back = cross(middle, c)
    second = times(-1.0 / 12.0, c)
    third = plus(times(1.0 / 240.0, cross(c, slope)), times(-1.0 / 14400.0, cross(c, back)))
    # from the smallest to the largest
    return exponential(plus(middle, plus(second, plus(times(1.0 / 720.0, cross(middle, back)), third))))


@part
def _turned_by(e, a):
    """A vector that a quaternion turns."""
    x = product(product(e, (0.0, a[0], a[1], a[2])), inverse(e))
    return x[1], x[2], x[3]


@part
def _turn_of_angles(model, segment, t, i):
    """Q, omega, omega' of roll, pitch and yaw: the driven coordinates i, i + 1 and i + 2."""
    roll = driven_coordinate(model, segment, t, i)
    pitch = driven_coordinate(model, segment, t, i + 1)
    yaw = driven_coordinate(model, segment, t, i + 2)
    about_z = (math.cos(0.5 * yaw[0]), 0.0, 0.0, math.sin(0.5 * yaw[0]))
    about_y = (math.cos(0.5 * pitch[0]), 0.0, math.sin(0.5 * pitch[0]), 0.0)
    about_x = (math.cos(0.5 * roll[0]), math.sin(0.5 * roll[0]), 0.0, 0.0)
    outer = product(about_z, about_y)
    y = _turned_by(about_z, (0.0, 1.0, 0.0))
    x = _turned_by(outer, (1.0, 0.0, 0.0))
    yawing = (0.0, 0.0, yaw[1])
    carried = plus(yawing, times(pitch[1], y))
    omega = plus(carried, times(roll[1], x))
    alpha = plus((0.0, 0.0, yaw[2]), plus(times(pitch[2], y), times(roll[2], x)))
    turning = plus(times(pitch[1], cross(yawing, y)), times(roll[1], cross(carried, x)))
    return product(outer, about_x), omega, plus(alpha, turning)


@part
def _turn_of_rates(model, segment, t, i, k):
    """Q, omega, omega' of an angular velocity.

    model, segment, t: the compiled scene, the segment, the time. i, k: the first of its rows in `drive`, and its row in
    `drive_frame`.
    """
    start = model.times[segment]
    low = int(model.drive_frame[k, FIRST])
    high = int(model.drive_frame[k, BEHIND])
    # the last row before t, but none of another segment: where the rate jumps, each of the two has its own
    while high - low > 1:
        middle = (low + high) // 2
        if model.drive_turn[middle, TIME] < t or model.drive_turn[middle, TIME] <= start:
            low = middle
        else:
            high = middle
    row = model.drive_turn[low]
    drive = model.drive[segment]
    rate = (drive[i, 1], drive[i + 1, 1], drive[i + 2, 1])
    slope = (2.0 * drive[i, 2], 2.0 * drive[i + 1, 2], 2.0 * drive[i + 2, 2])
    h = t - row[TIME]
    middle_rate = plus(rate, times(row[TIME] - start + 0.5 * h, slope))
    step = linear_turn(times(h, middle_rate), times(h * h, slope))
    before = (row[TURNED], row[TURNED + 1], row[TURNED + 2], row[TURNED + 3])
    return product(step, before), plus(rate, times(t - start, slope)), slope


@part
def _turn(model, segment, t, i, k):
    """Q, omega, omega' of a driven rotation; as `_turn_of_rates`."""
    if model.drive_frame[k, FIRST] == model.drive_frame[k, BEHIND]:
        return _turn_of_angles(model, segment, t, i)
    return _turn_of_rates(model, segment, t, i, k)


@kernel
def drive_state(model, segment, t, q, v):
    """The driven part of a state; see `kinematics_interface.drive_state`."""
    k = 0
    for i in range(model.driven.shape[0]):
        d = model.driven[i]
        place = COORDINATES * (d // FREEDOMS) + d % FREEDOMS
        if d % FREEDOMS < 3:
            q[place], v[d], _ = driven_coordinate(model, segment, t, i)
        elif d % FREEDOMS == 3:
            e, omega, _ = _turn(model, segment, t, i, k)
            frame = model.drive_frame[k]
            q[place] = e[0]
            put(q, place + 1, turned_back(frame, 0, (e[1], e[2], e[3])))
            put(v, d, turned_back(frame, 0, _turned_by(inverse(e), omega)))
            k += 1


@kernel
def drive_acceleration(model, segment, t, a):
    """The driven accelerations; see `kinematics_interface.drive_acceleration`."""
    k = 0
    for i in range(model.driven.shape[0]):
        d = model.driven[i]
        if d % FREEDOMS < 3:
            _, _, a[d] = driven_coordinate(model, segment, t, i)
        elif d % FREEDOMS == 3:
            e, _, alpha = _turn(model, segment, t, i, k)
            put(a, d, turned_back(model.drive_frame[k], 0, _turned_by(inverse(e), alpha)))
            k += 1
