"""Bodies in space: the second kinematics, and what the interface asks of it (`kinematics_interface`).

Coordinates of a body are by how much its centre of mass has moved since home, and the unit quaternion of its turn
since home; velocities are that of the centre of mass, in global axes, and the turning rate in the body's principal
axes, so that inertia is a diagonal. The parts stand beside: `vectors` and `rotations`, `spatial_poses`,
`spatial_forces`, `spatial_scales`, `spatial_steps`, `spatial_windows`, `spatial_drives`, `spatial_members`,
`spatial_lines`, `spatial_joints`, `spatial_contacts`, `spatial_points`.
"""

from typing import Any, cast

import numpy as np

from mdstopo.compiler.fields import FloatArray
from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.kernel import Kernel
from mdstopo.mechanics.kinematics import (
    spatial_bushings,
    spatial_contacts,
    spatial_drives,
    spatial_forces,
    spatial_joints,
    spatial_members,
    spatial_points,
    spatial_poses,
    spatial_reactions,
    spatial_scales,
    spatial_steps,
    spatial_windows,
)
from mdstopo.mechanics.kinematics.kinematics_interface import Headings, Kinematics
from mdstopo.mechanics.kinematics.spatial_poses import ATTITUDE, COORDINATES, FREEDOMS, POSE, ROTATIONS, fill_attitude

#: w^2 + s^2 of a turn about an axis across the one that headings are about is taken to be at least this; at half such a
#: turn, where it is 0, there is no heading
LEAST_HEADING = 1e-12


@part
def coordinates(model):
    """x, y, z and a unit quaternion."""
    return COORDINATES


@part
def freedoms(model):
    """Velocity and turning rate."""
    return FREEDOMS


@part
def rotations(model):
    """Three components of a turning rate."""
    return ROTATIONS


@part
def load_slopes(model):
    """Loads change with the turn of their body, gyroscopic moments with its turning rate."""
    return 2 * ROTATIONS


@part
def attitude(model):
    """See `spatial_poses`."""
    return ATTITUDE


@part
def most_rows(model):
    """A fixed joint has six rows."""
    return spatial_joints.ROWS


@part
def pose_size(model):
    """See `spatial_poses`."""
    return POSE


@part
def joint_places(model):
    """See `spatial_joints`."""
    return spatial_joints.PLACES


@kernel
def relative_pose(model, q, v, rel):
    """See `spatial_poses.fill_pose`."""
    room = np.empty((2, ATTITUDE))
    one = room[0]
    two = room[1]
    for p in range(model.pair.shape[0]):
        fill_attitude(model.home, model.pair[p, 0], q, one, 0)
        fill_attitude(model.home, model.pair[p, 1], q, two, 0)
        spatial_poses.fill_pose(model, p, one, two, q, v, rel[p])


_KERNELS = (
    coordinates, freedoms, rotations, load_slopes, attitude, most_rows, pose_size, joint_places,
    spatial_steps.retract, spatial_steps.difference, spatial_steps.retract_vjp, spatial_steps.retract_jvp,
    spatial_steps.shift_size, spatial_steps.shift_tangents, spatial_steps.slope_by_shift,
    spatial_steps.turn_slope_by_shift, spatial_steps.add_shift,
    spatial_steps.add_shift_curvature, spatial_steps.turn_back, spatial_steps.shift_further,
    spatial_steps.advance_coordinates, spatial_scales.moved_most,
    spatial_steps.stage_state, spatial_steps.end_state, spatial_steps.stage_vjp, spatial_steps.start_vjp,
    spatial_steps.stage_jvp, spatial_steps.end_jvp, spatial_steps.cubic, spatial_steps.cubic_vjp,
    spatial_steps.cubic_jvp, spatial_steps.quintic,
    spatial_windows.window_state, spatial_windows.window_accelerations,
    spatial_windows.window_rates, spatial_windows.window_size,
    spatial_windows.window_maps, spatial_windows.window_rates_with_maps, spatial_windows.window_jvp,
    spatial_windows.window_vjp, spatial_windows.window_turn,
    spatial_windows.window_start_jvp, spatial_windows.window_start_vjp,
    spatial_windows.window_slopes,
    spatial_drives.drive_state, spatial_drives.drive_acceleration,
    spatial_poses.turn_bodies, spatial_members.turn_of, relative_pose, spatial_poses.turned_pose,
    spatial_poses.pose_acceleration, spatial_poses.pair_displacement, spatial_poses.add_pair_force,
    spatial_forces.pair_tangent, spatial_forces.pair_matrix_vjp, spatial_forces.pair_pose_vjp,
    spatial_forces.pair_stiffness,
    spatial_scales.turning_rate, spatial_forces.add_loads, spatial_forces.load_tangent,
    spatial_forces.loads_vjp,
    spatial_scales.home_extent, spatial_scales.deflection, spatial_scales.largest_turn, spatial_scales.motion_weights,
    spatial_scales.noise_of, spatial_scales.arm_of, spatial_scales.gross_loads, spatial_scales.add_gross_force,
    spatial_scales.rounding_of_pairs,
    spatial_members.stretch_of, spatial_members.member_motion, spatial_members.motion_of_ends,
    spatial_members.member_work, spatial_members.second_rate, spatial_members.stretch_between,
    spatial_members.member_rows, spatial_members.end_slopes, spatial_members.inerter_row,
    spatial_members.add_inerter_tangents,
    spatial_members.keep_apart, spatial_members.ends_meet, spatial_members.member_sums, spatial_members.spring_sums,
    spatial_members.spring_sums_at_poses, spatial_members.member_works,
    spatial_members.member_designs, spatial_members.spring_designs, spatial_members.has_spring_energies,
    spatial_members.spring_energies, spatial_members.spring_designs_of_rows,
    spatial_members.member_designs_of_rows,
    spatial_joints.place_joint, spatial_joints.place_joint_alone, spatial_joints.joint_rows,
    spatial_joints.joint_gamma, spatial_joints.joint_velocity_slope, spatial_joints.joint_acceleration_slopes,
    spatial_joints.joint_stiffness, spatial_joints.joint_is_point, spatial_joints.places_points,
    spatial_joints.point_joint_vjp,
    spatial_bushings.add_bushings, spatial_contacts.contact_directions, spatial_contacts.contact_seen,
    spatial_contacts.contact_second_rise, spatial_contacts.contact_distance, spatial_contacts.contact_ends,
    spatial_contacts.contact_drag, spatial_contacts.add_contact,
    spatial_reactions.transmitted, spatial_points.point_motion, spatial_points.turn_motion, spatial_points.tilt_motion,
)  # fmt: skip


class SpatialKinematics(Kinematics):
    """`Kinematics` of bodies in space, whose coordinates are not added to as numbers in Python either."""

    def retract(self, q: FloatArray, shift: FloatArray) -> FloatArray:
        """Coordinates (n_q,) from others and a shift (n,)."""
        out = q.reshape(-1, COORDINATES).copy()
        by_body = shift.reshape(-1, FREEDOMS)
        out[:, :3] += by_body[:, :3]
        out[:, 3:] = (_turns(out[:, 3:]) * _rotation().from_rotvec(by_body[:, 3:])).as_quat()[:, [3, 0, 1, 2]]
        return out.ravel()

    def differences(self, after: FloatArray, before: FloatArray) -> FloatArray:
        """The shifts (T, n) that lead from coordinates (n_q,) to others (T, n_q)."""
        one = np.tile(before, len(after)).reshape(-1, COORDINATES)
        two = after.reshape(-1, COORDINATES)
        turn = (_turns(one[:, 3:]).inv() * _turns(two[:, 3:])).as_rotvec()
        return np.hstack([two[:, :3] - one[:, :3], turn]).reshape(len(after), -1)

    def headings(self, home: FloatArray, vertical: FloatArray, q: FloatArray, stated: FloatArray) -> Headings:
        """How far bodies have turned about a direction u since others: the twist of the turn (w, x) between them.

        That is 2 atan(s / w) with s = x . u; the rest of the turn is about an axis across u. A small turn d in global
        axes changes it by d . (w^2 u + w x times u + s x) / (w^2 + s^2), and d = u leaves the rest as it is.
        """
        size = float(np.linalg.norm(vertical))
        # at home the body's principal axes stand as `home` has them: all turns are seen from there
        now, before = (_turns(each.reshape(-1, COORDINATES)[:, 3:]) for each in (q, stated))
        axes = home[: len(now), spatial_poses.HOME_TURN : spatial_poses.HOME_AXES].reshape(-1, 3, 3)
        u = np.einsum("bij,i->bj", axes, vertical / size if size > 0.0 else vertical)
        turn = (now * before.inv()).as_quat(canonical=True)
        x, w = turn[:, :3], turn[:, 3:]
        s = np.sum(x * u, axis=1, keepdims=True)
        slope = (w * w * u + w * np.cross(x, u) + s * x) / np.maximum(w * w + s * s, LEAST_HEADING)
        return Headings(2.0 * np.arctan2(s, w)[:, 0], now.inv().apply(u), now.inv().apply(slope))


def _rotation() -> Any:
    from scipy.spatial.transform import Rotation  # few scenes are in space

    return Rotation


def _turns(quaternions: FloatArray) -> Any:
    """Turns of quaternions (n, 4), w first."""
    return _rotation().from_quat(quaternions[:, [1, 2, 3, 0]])


#: how bodies in space move
SPATIAL = SpatialKinematics(
    coordinates=COORDINATES,
    freedoms=FREEDOMS,
    rotations=ROTATIONS,
    attitude=ATTITUDE,
    rows=spatial_joints.ROWS,
    at_home=(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    entries="mdstopo.mechanics.kinematics.spatial_joints",
    ends=spatial_poses.ends,
    kernels={each.__name__: cast(Kernel, each) for each in _KERNELS},
)
