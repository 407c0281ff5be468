"""Bodies in a plane: the first kinematics, and what the interface asks of it (`kinematics_interface`).

Coordinates are x, y, psi of each body, by how much they have changed since home; velocities are their derivatives. So
coordinates may be added as numbers. The parts stand beside: `planar_poses`, `planar_forces`, `planar_scales`,
`planar_steps`, `planar_windows`, `planar_drives`, `planar_members`, `planar_inerters`, `planar_bushings`,
`planar_contacts`, `planar_points`.
"""

from typing import cast

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.kernel import Kernel
from mdstopo.mechanics.joints.joint_table import joint_acceleration_slopes as acceleration_slopes_by_code
from mdstopo.mechanics.joints.joint_table import joint_gamma as gamma_by_code
from mdstopo.mechanics.joints.joint_table import joint_is_point as is_point_by_code
from mdstopo.mechanics.joints.joint_table import joint_rows as rows_by_code
from mdstopo.mechanics.joints.joint_table import joint_stiffness as stiffness_by_code
from mdstopo.mechanics.joints.joint_table import joint_transmitted
from mdstopo.mechanics.joints.joint_table import joint_velocity_slope as velocity_slope_by_code
from mdstopo.mechanics.joints.revolute import PLACES, place_turned, revolute_vjp
from mdstopo.mechanics.joints.revolute import place_joint as place_joint_of_bodies
from mdstopo.mechanics.kinematics import (
    planar_bushings,
    planar_contacts,
    planar_drives,
    planar_inerters,
    planar_members,
    planar_points,
    planar_steps,
    planar_windows,
)
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.mechanics.kinematics.planar_forces import add_loads as add_applied_loads
from mdstopo.mechanics.kinematics.planar_forces import add_timed_loads, add_timed_tangent
from mdstopo.mechanics.kinematics.planar_forces import load_tangent as tangent_of_loads
from mdstopo.mechanics.kinematics.planar_forces import pair_tangent as tangent_of_pair
from mdstopo.mechanics.kinematics.planar_poses import (
    COS_A,
    DX,
    DY,
    OMEGA_A,
    POSE,
    SIN_A,
    VT,
    VX,
    VY,
    ends,
    fill_pose,
    small_turn,
    turned_from,
)
from mdstopo.mechanics.kinematics.planar_poses import (
    add_pair_force as add_force_of_pair,
)
from mdstopo.mechanics.kinematics.planar_poses import (
    pair_displacement as displacement_of_pair,
)
from mdstopo.mechanics.kinematics.planar_poses import (
    relative_pose as poses_of_pairs,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    add_gross_force as add_gross,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    add_gross_timed_loads,
    rounding_of_pairs,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    deflection as deflection_of_pair,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    gross_loads as gross_steady_loads,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    largest_turn as turn_of_pairs,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    motion_weights as weights_of_motion,
)
from mdstopo.mechanics.kinematics.planar_scales import (
    noise_of as noise_of_pair,
)
from mdstopo.scene.springs_model import HOME_X, HOME_Y

COORDINATES = FREEDOMS = ROWS = 3
ROTATIONS = 1
#: cos - 1 and sin of the angle by which a body has turned since home
ATTITUDE = 2
#: columns of sums over members: K by the shift along x, and along y (`passes.SUMS`)
K_XX, K_YY = 7, 11


@part
def coordinates(model):
    """Three coordinates a body: x, y, psi."""
    return COORDINATES


@part
def freedoms(model):
    """Three freedoms a body: the rates of x, y, psi."""
    return FREEDOMS


@part
def rotations(model):
    """One of the freedoms of a body is a rotation."""
    return ROTATIONS


@part
def load_slopes(model):
    """One slope of its loads a body: loads that are fixed to a body turn with its angle."""
    return ROTATIONS


@part
def attitude(model):
    """Two numbers a body: cos - 1 and sin of its angle."""
    return ATTITUDE


@part
def most_rows(model):
    """The largest number of equations of a joint: a fixed joint has three."""
    return ROWS


@part
def pose_size(model):
    """How many numbers a relative pose has; see `planar_poses`."""
    return POSE


@part
def joint_places(model):
    """Size of what `place_joint` tells of two bodies; see `joints.revolute`."""
    return PLACES


@part
def retract(model, q, shift, out):
    """Move bodies by a shift: in a plane it is added to their coordinates."""
    for d in range(shift.shape[0]):
        out[d] = q[d] + shift[d]


@part
def difference(model, after, before, out):
    """The change between two coordinates: in a plane they are subtracted as they are."""
    for d in range(out.shape[0]):
        out[d] = after[d] - before[d]


@part
def retract_vjp(model, q, moved, bar, bar_q, bar_shift):
    """The derivatives of a sum; see `kinematics_interface.retract_vjp`."""
    for d in range(bar.shape[0]):
        bar_q[d] = bar[d]
        bar_shift[d] = bar[d]


@part
def retract_jvp(model, q, moved, dq, dshift, out):
    """The derivatives of a sum; see `kinematics_interface.retract_jvp`."""
    for d in range(dq.shape[0]):
        out[d] = dq[d] + dshift[d]


@part
def moved_most(model, q, size):
    """How far bodies have moved since home (m): the largest of all |x|, |y| and |psi| times size."""
    moved = 0.0
    for body in range(model.home.shape[0]):
        b = COORDINATES * body
        moved = max(moved, abs(q[b]), abs(q[b + 1]), min(abs(q[b + 2]), 1.0) * size)
    return moved


@part
def turn_bodies(model, q, turned):
    """The attitudes of all bodies: cos - 1 and sin of the angle that each has turned by since home."""
    for b in range(turned.shape[0]):
        turned[b, 0], turned[b, 1] = small_turn(q[COORDINATES * b + 2])


@part
def relative_pose(model, q, v, rel):
    """The relative poses of all pairs at one state; see `planar_poses.relative_pose`."""
    poses_of_pairs(model.pair, model.home, q, v, rel)


@part
def turned_pose(model, p, turned, q, v, rel):
    """The relative pose of one pair of bodies whose attitudes are known; see `kinematics_interface.turned_pose`."""
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    fill_pose(model.pair, p, model.home, q, v, turned[one, 0], turned[one, 1], turned[two, 0], turned[two, 1], rel)


@kernel
def pose_acceleration(model, rel, p, a, out):
    """Second derivative of the relative pose: d'' = R^T D'' + omega' (dy, -dx) + 2 omega (vy, -vx) + omega^2 d, theta''
    = psi_B'' - psi_A''."""
    i = FREEDOMS * model.pair[p, 0]
    j = FREEDOMS * model.pair[p, 1]
    r = rel[p]
    ca = r[COS_A]
    sa = r[SIN_A]
    omega = r[OMEGA_A]
    x = a[j] - a[i]
    y = a[j + 1] - a[i + 1]
    turn = a[i + 2]
    out[0] = ca * x + sa * y + turn * r[DY] + 2.0 * omega * r[VY] + omega * omega * r[DX]
    out[1] = ca * y - sa * x - turn * r[DX] - 2.0 * omega * r[VX] + omega * omega * r[DY]
    out[2] = a[j + 2] - turn


@part
def pair_displacement(model, rel, p, dq, out):
    """The change of a relative pose under a change of coordinates; see `planar_poses.pair_displacement`."""
    displacement_of_pair(model.pair, rel, p, dq, out)


@part
def add_pair_force(model, rel, p, force, first, out):
    """Add a force on a relative pose to the forces on its bodies; see `kinematics_interface.add_pair_force`."""
    add_force_of_pair(model.pair, rel, p, force[first], force[first + 1], force[first + 2], out)


@part
def pair_tangent(model, p, rel, sums, damped, k_out, c_out):
    """The tangents of a pair in the freedoms of its bodies; see `kinematics_interface.pair_tangent`."""
    tangent_of_pair(p, rel, sums, damped, k_out, c_out)


@part
def pair_pose_vjp(model, p, rel, sums, z, bar):
    """K has six rows here, so it is formed; see `kinematics_interface.pair_pose_vjp`."""
    k = np.empty((rel.shape[0], 2 * FREEDOMS, 2 * FREEDOMS))
    pair_tangent(model, p, rel, sums, np.bool_(False), k, k)
    pair_matrix_vjp(model, p, k[p], z, bar)


@part
def pair_matrix_vjp(model, p, m, z, bar):
    """Six numbers of z, which are read once."""
    one = FREEDOMS * model.pair[p, 0]
    two = FREEDOMS * model.pair[p, 1]
    z0 = z[one]
    z1 = z[one + 1]
    z2 = z[one + 2]
    z3 = z[two]
    z4 = z[two + 1]
    z5 = z[two + 2]
    for j in range(2 * FREEDOMS):
        d = one + j if j < FREEDOMS else two + j - FREEDOMS
        bar[d] -= (m[0, j] * z0 + m[1, j] * z1 + m[2, j] * z2) + (m[3, j] * z3 + m[4, j] * z4 + m[5, j] * z5)


@part
def pair_stiffness(model, sums, p):
    """A measure of the stiffness of a pair against displacements (N/m): the trace of the matrix."""
    return sums[p, K_XX] + sums[p, K_YY]


@part
def turning_rate(model, rel, p):
    """The magnitude of the rate of pair p's relative angle (rad/s)."""
    return abs(rel[p, VT])


@part
def add_loads(model, segment, t, q, v, f):
    """Add the applied loads; inertia adds none in a plane; see `kinematics_interface.add_loads`."""
    add_applied_loads(model, segment, t, q, f)
    if model.timed_load.shape[0] > 0:
        add_timed_loads(model, segment, t, q, f)


@part
def load_tangent(model, segment, t, q, v, turn):
    """Slopes of the applied loads by the angle of their body; see `kinematics_interface.load_tangent`."""
    tangent_of_loads(model, segment, t, q, turn.reshape(turn.size))
    if model.timed_load.shape[0] > 0:
        add_timed_tangent(model, segment, t, q, turn.reshape(turn.size))


@part
def loads_vjp(model, segment, t, q, v, z, bar_q, bar_v):
    """One slope a freedom, so they are formed; see `kinematics_interface.loads_vjp`."""
    turn = np.zeros((z.shape[0], 1))
    load_tangent(model, segment, t, q, v, turn)
    for d in range(z.shape[0]):
        bar_q[d - d % FREEDOMS + FREEDOMS - 1] += turn[d, 0] * z[d]


@part
def gross_loads(model, out):
    """The largest sizes of the applied loads; see `planar_scales.gross_loads`."""
    gross_steady_loads(model, out)
    if model.timed_load.shape[0] > 0:
        add_gross_timed_loads(model, out)


@part
def home_extent(model):
    """The extent of the scene at home (m): the largest of all |x| and |y|."""
    extent = 0.0
    for b in range(model.home.shape[0]):
        extent = max(extent, abs(model.home[b, HOME_X]), abs(model.home[b, HOME_Y]))
    return extent


@part
def deflection(model, rel, rel0, p):
    """How far the points of a pair have moved between two poses (m); see `planar_scales.deflection`."""
    return deflection_of_pair(rel, rel0, model.reach, p)


@part
def largest_turn(model, before, after, h, v_before, v_after):
    """The largest relative rotation of a pair, which angles tell; see `kinematics_interface.largest_turn`."""
    return turn_of_pairs(model.pair, before, after)


@part
def motion_weights(model, rel, scale, weight):
    """Weights by which changes of coordinates become relative displacements; see `planar_scales.motion_weights`."""
    weights_of_motion(model.pair, rel, model.reach, scale, weight)


@part
def noise_of(model, noise, rel, q, p):
    """By how much a pair's displacement is uncertain because of rounding (m); see `planar_scales.noise_of`."""
    return noise_of_pair(model.pair, noise, rel, model.reach, q, p)


@part
def arm_of(model, rel, p):
    """The distance of both bodies of a pair, plus the reach of the points of the second (m)."""
    return np.sqrt(rel[p, DX] * rel[p, DX] + rel[p, DY] * rel[p, DY]) + model.reach[p]


@part
def add_gross_force(model, rel, p, force, out):
    """Add the sizes of a force between two bodies, and of its moments; see `planar_scales.add_gross_force`."""
    add_gross(model.pair, rel, model.reach, p, force, out)


@part
def place_joint(model, j, q, turned, w):
    """Where both bodies of a joint are; see `kinematics_interface.place_joint`."""
    one = model.joint[j, 1]
    two = model.joint[j, 2]
    turns_one = turned_from(model.home, one, turned[one, 0], turned[one, 1])
    place_turned(model.home, one, two, q, turns_one, turned_from(model.home, two, turned[two, 0], turned[two, 1]), w)


@part
def place_joint_alone(model, j, q, w):
    """Where both bodies of a joint are; see `joints.revolute.place_joint`."""
    place_joint_of_bodies(model.home, model.joint[j, 1], model.joint[j, 2], q, w)


@part
def joint_rows(model, j, w, phi, jac):
    """Phi of a joint and its slopes Phi_q; see `kinematics_interface.joint_rows`."""
    rows_by_code(model.joint[j, 0], model.joint_par[j], w, phi, jac)


@part
def joint_gamma(model, j, w, wd, gamma):
    """gamma of Phi_q a + gamma = 0 of a joint; see `kinematics_interface.joint_gamma`."""
    gamma_by_code(model.joint[j, 0], model.joint_par[j], w, wd, gamma)


@part
def joint_velocity_slope(model, j, w, wd, out):
    """Slopes of the rate of a joint's Phi by coordinates; see `kinematics_interface.joint_velocity_slope`."""
    velocity_slope_by_code(model.joint[j, 0], model.joint_par[j], w, wd, out)


@part
def joint_acceleration_slopes(model, j, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma; see `kinematics_interface.joint_acceleration_slopes`."""
    acceleration_slopes_by_code(model.joint[j, 0], model.joint_par[j], w, wd, wdd, by_q, by_v)


@part
def joint_stiffness(model, j, w, lam, k):
    """Add the slopes of a joint's forces; see `kinematics_interface.joint_stiffness`."""
    stiffness_by_code(model.joint[j, 0], model.joint_par[j], w, lam, k)


@part
def joint_is_point(model, j):
    """Whether a joint only holds two points together; see `kinematics_interface.joint_is_point`."""
    return is_point_by_code(model.joint[j, 0])


@part
def places_points(model):
    """See `kinematics_interface.places_points`."""
    return True


@part
def point_joint_vjp(model, j, own, turned, v, a, lam, z, y, bar_q, bar_v):
    """The angles' part; see `kinematics_interface.point_joint_vjp`. Rows behind the first two have constant slopes."""
    row = model.row
    one = FREEDOMS * model.joint[j, 1] + 2
    two = FREEDOMS * model.joint[j, 2] + 2
    y0 = y[row[j, 0]] if row[j, 0] >= 0 else 0.0
    y1 = y[row[j, 1]] if row[j, 1] >= 0 else 0.0
    first, second, rate_first, rate_second = revolute_vjp(
        model.joint_par[j], own[0], own[1], own[2], own[3], y0, y1, z[one], z[two]
    )
    bar_q[one] -= first
    bar_q[two] -= second
    bar_v[one] -= rate_first
    bar_v[two] -= rate_second


@part
def transmitted(model, j, which, q, lam, by_lam, by_q):
    """Norm of the force or moment that a joint transmits; see `kinematics_interface.transmitted`."""
    w = np.empty(PLACES)
    place_joint_of_bodies(model.home, model.joint[j, 1], model.joint[j, 2], q, w)
    return joint_transmitted(model.joint[j, 0], model.joint_par[j], w, lam, which, by_lam, by_q)


_KERNELS = (
    coordinates, freedoms, rotations, load_slopes, attitude, most_rows, pose_size, joint_places,
    retract, difference, retract_vjp, retract_jvp, planar_steps.shift_size, planar_steps.shift_tangents,
    planar_steps.slope_by_shift, planar_steps.turn_slope_by_shift, planar_steps.add_shift,
    planar_steps.add_shift_curvature, planar_steps.turn_back, planar_steps.shift_further,
    planar_steps.advance_coordinates, moved_most,
    planar_steps.stage_state, planar_steps.end_state, planar_steps.stage_vjp, planar_steps.start_vjp,
    planar_steps.stage_jvp, planar_steps.end_jvp, planar_steps.cubic, planar_steps.cubic_vjp, planar_steps.cubic_jvp,
    planar_windows.window_state, planar_windows.window_accelerations,
    planar_windows.window_rates, planar_windows.window_size,
    planar_windows.window_maps, planar_windows.window_rates_with_maps, planar_windows.window_jvp,
    planar_windows.window_vjp, planar_windows.window_turn,
    planar_windows.window_start_jvp, planar_windows.window_start_vjp,
    planar_windows.window_slopes,
    planar_steps.quintic, planar_drives.drive_state, planar_drives.drive_acceleration,
    turn_bodies, planar_members.turn_of, relative_pose, turned_pose, pose_acceleration, pair_displacement,
    add_pair_force, pair_tangent, pair_matrix_vjp, pair_pose_vjp, pair_stiffness, turning_rate, add_loads, load_tangent,
    loads_vjp,
    home_extent, deflection, largest_turn, motion_weights, noise_of, arm_of, gross_loads, add_gross_force,
    rounding_of_pairs,
    planar_members.stretch_of, planar_members.member_motion, planar_members.motion_of_ends, planar_members.member_work,
    planar_members.second_rate, planar_members.stretch_between, planar_members.member_rows,
    planar_members.end_slopes, planar_inerters.inerter_row, planar_inerters.add_inerter_tangents,
    planar_members.keep_apart,
    planar_members.ends_meet, planar_members.member_sums, planar_members.spring_sums,
    planar_members.spring_sums_at_poses, planar_members.member_works, planar_members.member_designs,
    planar_members.spring_designs, planar_members.has_spring_energies,
    planar_members.spring_energies, planar_members.spring_designs_of_rows, planar_members.member_designs_of_rows,
    place_joint, place_joint_alone, joint_rows, joint_gamma, joint_velocity_slope, joint_acceleration_slopes,
    joint_stiffness, joint_is_point, places_points, point_joint_vjp, transmitted, planar_bushings.add_bushings,
    planar_contacts.contact_directions, planar_contacts.contact_seen, planar_contacts.contact_second_rise,
    planar_contacts.contact_distance, planar_contacts.contact_ends, planar_contacts.contact_drag,
    planar_contacts.add_contact, planar_points.point_motion,
    planar_points.angle_motion,
)  # fmt: skip

#: how bodies in a plane move
PLANAR = Kinematics(
    coordinates=COORDINATES,
    freedoms=FREEDOMS,
    rotations=ROTATIONS,
    attitude=ATTITUDE,
    rows=ROWS,
    at_home=(0.0,) * COORDINATES,
    entries="mdstopo.mechanics.kinematics.planar_entry",
    ends=ends,
    kernels={each.__name__: cast(Kernel, each) for each in _KERNELS},
)
