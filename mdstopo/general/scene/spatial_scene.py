"""A case in space as arrays of a general scene: what is spatial about them (`dimension`).

Arrays have points and axes of a body in its principal axes: there the masses are a diagonal. At home these stand as
R_home = R P, with the body's own axes R and the principal ones P among them (`scene.quaternions.principal`).
"""

from collections.abc import Iterator
from typing import Any, NamedTuple, cast

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import GROUND, Case, Joint, Load, LoadCase, Response, Signal
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.compiler.kernel import Kernel
from mdstopo.general.scene.contact_compile import surface_rows
from mdstopo.general.scene.dimension import Dimension, Frames, Pairs, in_frame
from mdstopo.general.scene.timed_loads import TimedPart
from mdstopo.mechanics.joints.joint_kernels import FITTED
from mdstopo.mechanics.kinematics import spatial_bushings
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.mechanics.kinematics.spatial_bushings import WIDTH as BUSHING
from mdstopo.mechanics.kinematics.spatial_contacts import POINT, SHAPE
from mdstopo.mechanics.kinematics.spatial_forces import ACCELERATES, FOLLOWS, GLOBAL
from mdstopo.mechanics.kinematics.spatial_half_turns import half_turn
from mdstopo.mechanics.kinematics.spatial_joints import (
    ACROSS,
    CYLINDRICAL,
    DISTANCE,
    FIRST_AXES,
    FIRST_POINT,
    FIXED,
    LENGTH,
    PLANAR,
    PRISMATIC,
    REVOLUTE,
    ROWS_OF,
    SECOND_AXES,
    SECOND_POINT,
    SPHERICAL,
    UNIVERSAL,
    WIDTH,
    row_of_joint,
)
from mdstopo.mechanics.kinematics.spatial_joints import APART as APART_FIRST
from mdstopo.mechanics.kinematics.spatial_joints import AT as MEETS
from mdstopo.mechanics.kinematics.spatial_poses import HOME, HOME_AXES, HOME_PLACE, HOME_TURN
from mdstopo.mechanics.kinematics.timed import MOMENT, PUSH
from mdstopo.scene.loads import Loads
from mdstopo.scene.quaternions import principal
from mdstopo.scene.signal_segments import segment_values
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: columns of `GeneralModel.home`: a body's place, then R_home by rows, then P by rows
PLACE, TURN, AXES = slice(HOME_PLACE, HOME_TURN), slice(HOME_TURN, HOME_AXES), slice(HOME_AXES, HOME)
#: columns of `GeneralModel.response_par`: the point, then a response's own numbers
AT, NUMBERS, RESPONSE_PAR = slice(0, 3), slice(3, 8), 8
#: columns of `GeneralModel.joint_par`: the points on both bodies, the axes on both by rows, the vector from the first
#: point to the second at home (global), of a distance joint its length
AT_FIRST, AT_SECOND = slice(FIRST_POINT, SECOND_POINT), slice(SECOND_POINT, FIRST_AXES)
AXES_FIRST, AXES_SECOND = slice(FIRST_AXES, SECOND_AXES), slice(SECOND_AXES, APART_FIRST)
APART = slice(APART_FIRST, LENGTH)
#: columns of `GeneralModel.bushing`: the points on both bodies, the stretch at home along the first body's principal
#: axes, stiffness and damping
AT_A = slice(spatial_bushings.FIRST, spatial_bushings.SECOND)
AT_B = slice(spatial_bushings.SECOND, spatial_bushings.APART)
STRETCH = slice(spatial_bushings.APART, spatial_bushings.STIFFNESS)
ELASTIC = slice(spatial_bushings.STIFFNESS, BUSHING)
#: the codes of joints by their words
JOINTS = {
    "spherical": SPHERICAL,
    "revolute": REVOLUTE,
    "universal": UNIVERSAL,
    "prismatic": PRISMATIC,
    "cylindrical": CYLINDRICAL,
    "planar": PLANAR,
    "fixed": FIXED,
    "distance": DISTANCE,
}


def _home(load_case: LoadCase, count: int) -> FloatArray:
    home = np.zeros((count, HOME))
    home[:, TURN] = home[:, AXES] = np.eye(3).ravel()
    for row, body in zip(home, load_case.bodies, strict=False):
        axes = principal(np.asarray(body.inertia))[1]
        row[PLACE], row[AXES] = body.position, axes.ravel()
        row[TURN] = (np.asarray(body.rotation) @ axes).ravel()
    return home


def _frames(load_case: LoadCase) -> Frames:
    return {body.name: principal(np.asarray(body.inertia))[1] for body in load_case.bodies}


def _masses(body: Any) -> list[float]:
    moments: list[float] = principal(np.asarray(body.inertia))[0].tolist()
    return [body.mass, body.mass, body.mass, *moments]


def _velocities(body: Any, home: FloatArray) -> list[float]:
    """Of the centre of mass, global, and the angular one in principal axes."""
    return [*body.velocity, *(home[TURN].reshape(3, 3).T @ np.array(body.angular_velocity)).tolist()]


def _stated(home: FloatArray) -> FloatArray:
    """x, y, z of all bodies; turns count from home."""
    out = np.zeros((len(home), SPATIAL.freedoms))
    out[:, PLACE] = home[:, PLACE]
    return out.ravel()


def _places(home: FloatArray, body: int, points: FloatArray) -> FloatArray:
    return np.asarray(home[body, PLACE] + points @ home[body, TURN].reshape(3, 3).T)


def _three(given: Any, times: FloatArray) -> FloatArray:
    """(n_seg, 3, 2): value and slope of three signals in segments of time; of nothing zeros."""
    if not isinstance(given, tuple):
        return np.zeros((len(times) - 1, 3, 2))
    signals: tuple[Signal, ...] = given
    return np.stack([segment_values(signal, times) for signal in signals], axis=1)


def _loads(load_case: LoadCase, index: dict[str, int], times: FloatArray, frames: Frames, keep: bool = False) -> Loads:
    """Gravity and forces through centres of mass by freedoms; apart from them what depends on a body's turn.

    Moments are components in principal axes by freedoms, which a global one has not while the body turns. keep: as of
    `generalised_loads`.
    """
    force = np.zeros((len(times) - 1, len(index), SPATIAL.freedoms, 2))
    for i, body in enumerate(load_case.bodies):
        force[:, i, PLACE, 0] += body.mass * np.array(load_case.gravity)
    turning: list[tuple[Load, int, FloatArray]] = []
    for load in load_case.loads:
        if load.body == GROUND:
            continue
        b = index[load.body]
        own, moment = _three(load.force, times), _three(load.moment, times)
        turned = in_frame(frames, load.body, np.eye(3))
        if load.frame == "body":
            # (P^T f) of each segment's values and slopes
            own, moment = (np.einsum("ji,sjk->sik", turned, each) for each in (own, moment))
            force[:, b, 3:] += moment
            if keep or np.any(own):
                turning.append((load, FOLLOWS, np.concatenate([own, np.zeros_like(moment)], axis=1)))
            continue
        if not any(load.at_local) and not keep:
            force[:, b, PLACE] += own
            own = np.zeros_like(own)
        for follows, part, couple in (
            (GLOBAL, own, moment),
            (ACCELERATES, np.zeros_like(own), _three(load.angular_acceleration, times)),
        ):
            if keep or np.any(part) or np.any(couple):
                turning.append((load, follows, np.concatenate([part, couple], axis=1)))
    arms = [in_frame(frames, load.body, np.array(load.at_local, dtype=np.float64)) for load, _, _ in turning]
    values = [value for _, _, value in turning]
    return Loads(
        force.reshape(len(times) - 1, -1, 2),
        np.array([index[load.body] for load, _, _ in turning], dtype=np.int64),
        np.array([follows for _, follows, _ in turning], dtype=np.int64),
        np.array(arms, dtype=np.float64).reshape(-1, 3),
        np.stack(values, axis=1) if values else np.zeros((len(times) - 1, 0, SPATIAL.freedoms, 2)),
    )


def _timed(load: Load, frames: Frames) -> Iterator[TimedPart]:
    """Components of force, moment and angular acceleration that are formulas of time."""
    arm = tuple(in_frame(frames, load.body, np.array(load.at_local, dtype=np.float64)).tolist())
    axes = in_frame(frames, load.body, np.eye(3)) if load.frame == "body" else np.eye(3)
    follows = FOLLOWS if load.frame == "body" else GLOBAL
    for given, kind, how in (
        (load.force, PUSH, follows),
        (load.moment, MOMENT, follows),
        (load.angular_acceleration, MOMENT, ACCELERATES),
    ):
        for signal, direction in zip(given if isinstance(given, tuple) else (), axes.tolist(), strict=False):
            if isinstance(signal, TimeFormula):
                yield TimedPart(signal, kind, how, tuple(direction), arm)


def _bushings(case: Case, index: dict[str, int], pairs: Pairs, home: FloatArray) -> tuple[IndexArray, FloatArray]:
    """The pair (n_bushing,) and the parameters (n_bushing, WIDTH) of each bushing (`spatial_bushings`)."""
    where = np.zeros(len(case.bushings), dtype=np.int64)
    rows = np.zeros((len(case.bushings), BUSHING))
    for k, (bushing, row) in enumerate(zip(case.bushings, rows, strict=True)):
        pair = index[bushing.bodies[0]], index[bushing.bodies[1]]
        where[k] = pairs.setdefault(pair, len(pairs))
        for body, columns, at in zip(pair, (AT_A, AT_B), (bushing.at_first, bushing.at_second), strict=True):
            row[columns] = np.array(at) @ home[body, AXES].reshape(3, 3)
        apart = _apart(home, pair, (row[AT_A], row[AT_B]))
        row[STRETCH] = apart @ home[pair[0], TURN].reshape(3, 3)
        row[ELASTIC] = *bushing.stiffness, *bushing.damping
    return where, rows


def _apart(home: FloatArray, pair: tuple[int, int], points: tuple[FloatArray, FloatArray]) -> FloatArray:
    """(3,) from a point of a body to one of another at home, global; what only rounding has left of it is zero."""
    ends = [_places(home, body, point) for body, point in zip(pair, points, strict=True)]
    size = sum(
        float(np.abs(point).sum() + np.abs(home[body, PLACE]).sum()) for body, point in zip(pair, points, strict=True)
    )
    apart = ends[1] - ends[0]
    return np.where(np.abs(apart) > FITTED * size, apart, 0.0)


def _reaches(contact: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(contact[:, POINT:SHAPE], axis=1))


class JointRows(NamedTuple):
    """What the compiler of a case needs to know of a joint (`dimension.JointRecord`)."""

    rows: int
    steady: tuple[tuple[int, ...], ...]


def _joint_kernels(joint: type[Joint]) -> JointRows:
    """Rows that put points together have constant slopes by shifts, and such that hold directions have none."""
    code = JOINTS[joint.type]
    kind_of_row = cast(Kernel, row_of_joint).py_func
    kinds = [kind_of_row(code, r)[0] for r in range(ROWS_OF[code])]
    shifts = tuple(range(SPATIAL.freedoms - SPATIAL.rotations))
    return JointRows(len(kinds), tuple(shifts if kind in (MEETS, ACROSS) else () for kind in kinds))


def _joint_row(joint: Any, home: FloatArray, first: int, second: int, frames: Frames) -> list[float]:
    """See `spatial_joints.WIDTH`."""
    row = np.zeros(WIDTH)
    for name, at, axes, point, own in (
        (joint.bodies[0], AT_FIRST, AXES_FIRST, joint.at_first, joint.axes_first),
        (joint.bodies[1], AT_SECOND, AXES_SECOND, joint.at_second, joint.axes_second),
    ):
        row[at] = in_frame(frames, name, np.array(point, dtype=np.float64))
        row[axes] = in_frame(frames, name, np.asarray(own)).ravel()
    row[APART] = _apart(home, (first, second), (row[AT_FIRST], row[AT_SECOND]))
    row[LENGTH] = getattr(joint, "length", 0.0)
    return [float(value) for value in row]


def _response_row(response: Response, frames: Frames) -> list[float]:
    """The point, zeros where it has none, then the response's own numbers; of a tilt these are an axis."""
    row, body = np.zeros(RESPONSE_PAR), response.body or GROUND
    if response.at_local is not None:
        row[AT] = in_frame(frames, body, np.array(response.at_local, dtype=np.float64))
    numbers = np.array(response.numbers, dtype=np.float64)
    if kind_of(response).of_axis:
        numbers = in_frame(frames, body, numbers)
    row[NUMBERS][: len(numbers)] = numbers
    return [float(value) for value in row]


SPACE = Dimension(
    kinematics=SPATIAL,
    point=3,
    axes=("x", "y", "z"),
    components={"x": 0, "y": 1, "norm": 2, "z": 4},
    response_par=RESPONSE_PAR,
    home=_home,
    frames=_frames,
    masses=_masses,
    velocities=_velocities,
    stated=_stated,
    places=_places,
    loads=_loads,
    timed=_timed,
    bushings=_bushings,
    half_turn=half_turn,
    contacts=surface_rows,
    reaches=_reaches,
    joint_code=lambda kind: JOINTS[kind.type],
    joint_kernels=_joint_kernels,
    has_norm=lambda kind: True,
    joint_row=_joint_row,
    response_row=_response_row,
)
