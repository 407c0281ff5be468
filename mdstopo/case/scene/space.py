"""Cases in space: x, y, z and an orientation."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, Triple, VectorSignal
from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.geometry.outlines import build_outlines
from mdstopo.case.geometry.spatial_outlines import SPATIAL
from mdstopo.case.geometry.spatial_point_grids import check_grid, grid_count, grid_points
from mdstopo.case.geometry.start_rotations import about_axis, of_quaternion, orthonormal
from mdstopo.case.joints.joints_in_space import SPATIAL_JOINTS
from mdstopo.case.keys.signals import UnaddedSignalsError, combined
from mdstopo.case.model import GROUND, Load, SpatialBody
from mdstopo.case.objects.plane_or_space import Geometry
from mdstopo.case.scene.load_cases import scaled
from mdstopo.case.scene.prescribed import size_of
from mdstopo.case.scene.surfaces import surface_contact
from mdstopo.case.schema.schema_space import SPACE_FORMAT, ZERO
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, listed, number_text

UNIT = 1e-6
"""How far quaternions and matrices may be from norm 1; they are normalised."""
ROD = 1e-9
"""By which share of the others' sum a principal moment may be above it: that of a rod is equal to it."""
SYMMETRIC = 1e-9
"""By which share of its largest number a tensor may differ from its transpose."""


def _to_local(body: SpatialBody, world: FloatArray) -> FloatArray:
    return _turned(world - np.array(body.position), body.rotation)


def _to_world(body: SpatialBody, local: FloatArray) -> FloatArray:
    return np.asarray(_turned(local, body.rotation.T) + np.array(body.position))


def _turned(points: FloatArray, axes: FloatArray) -> FloatArray:
    """points (n, 3) @ axes (3, 3), each row by itself: a point has the same bits whatever stands beside it."""
    x, y, z = points[:, :1], points[:, 1:2], points[:, 2:]
    turned: FloatArray = x * axes[0] + y * axes[1] + z * axes[2]
    return turned


def _build_body(name: str, fields: Any, path: str, angle: float | None, reading: Reading) -> SpatialBody | None:
    """The body at the start, or None where it cannot be read. angle: never prescribed."""
    del angle
    if fields is BAD or not fields.good():
        return None
    mass = fields["mass"]
    good = _computable(mass, inside(path, "mass"), reading)
    inertia = _inertia(fields["inertia"], inside(path, "inertia"), reading)
    rotation = _rotation(fields["orientation"], inside(path, "orientation"), reading)
    for key in ("position", "velocity", "angular_velocity"):
        good &= in_range(np.array(fields[key]), inside(path, key), reading)
    if not good or inertia is None or rotation is None:
        return None
    stated = fields.stated & {"orientation", "velocity", "angular_velocity"}
    velocity, turn = fields["velocity"], fields["angular_velocity"]
    body = SpatialBody(name, mass, inertia, fields["position"], rotation, velocity, turn, stated)
    outline = build_outlines(fields, body, SPATIAL, _to_local, reading)
    return None if outline is None else replace(body, outline=outline)


def _computable(value: float, path: str, reading: Reading) -> bool:
    if math.isfinite(1.0 / value) and value * value > 0.0 and math.isfinite(value * value):
        return True
    reading.mistake(path, f"found {number_text(value)}, too extreme to compute with")
    return False


def _inertia(stated: Any, path: str, reading: Reading) -> FloatArray | None:
    """The tensor (3, 3); None where no body can have it: the mistake is noted."""
    tensor = np.array(stated, dtype=np.float64)
    if tensor.ndim == 1:
        tensor = np.diag(tensor)
    size = float(np.abs(tensor).max())
    if not (size > 0.0 and _computable(size, path, reading)):
        if not size > 0.0:
            reading.mistake(path, "all moments are zero, allowed are principal moments > 0")
        return None
    if float(np.abs(tensor - tensor.T).max()) > SYMMETRIC * size:
        reading.mistake(path, "the tensor is not symmetric")
        return None
    tensor = 0.5 * (tensor + tensor.T)
    diagonal = not np.any(tensor - np.diag(np.diag(tensor)))
    moments = np.sort(np.diag(tensor)) if diagonal else np.linalg.eigvalsh(tensor / size) * size
    words = f"found the principal moments {listed(number_text(float(value)) for value in moments)}"
    if not moments[0] > 0.0:
        reading.mistake(path, f"{words}, allowed are such > 0")
        return None
    if moments[2] > (moments[0] + moments[1]) * (1.0 + ROD):
        reading.mistake(path, f"{words}: no body has one that is above the sum of the others")
        return None
    return tensor if _computable(float(moments[0]), path, reading) else None


def _rotation(stated: Any, path: str, reading: Reading) -> FloatArray | None:
    """The matrix (3, 3) whose columns are the body axes; None where it is none, which is noted."""
    if stated is None:
        return np.eye(3)
    if isinstance(stated, list):
        turned = np.eye(3)
        for turn in stated:
            turned = about_axis(turn["axis"], turn["angle"]) @ turned
        return orthonormal(turned)
    if "quaternion" in stated.stated:
        norm = math.hypot(*stated["quaternion"])
        if not abs(norm - 1.0) <= UNIT:
            words = f"found a quaternion of norm {number_text(norm)}, allowed is one of norm 1"
            reading.mistake(inside(path, "quaternion"), words)
            return None
        return of_quaternion(stated["quaternion"])
    if "matrix" in stated.stated:
        matrix = np.array(stated["matrix"])
        with np.errstate(over="ignore", invalid="ignore"):
            wrong = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
        if not wrong <= 2.0 * UNIT:  # of columns of norm 1 + UNIT
            reading.mistake(inside(path, "matrix"), "the columns are not perpendicular unit vectors")
            return None
        if np.linalg.det(matrix) < 0.0:
            reading.mistake(inside(path, "matrix"), "the columns are left-handed, allowed is a rotation")
            return None
        return orthonormal(matrix)
    if stated["angle"] is None:  # an axis alone, which is noted
        return None
    return about_axis(stated["axis"], stated["angle"])


def _build_load(fields: Fields, body: SpatialBody, at: Any, reading: Reading) -> Load | None:
    force: Any = fields["force"] or ZERO
    moment: Any = fields["moment"] or ZERO
    turning: Any = None
    if fields["acceleration"] is not None:
        force = scaled(fields["acceleration"], body.mass, inside(fields.path, "acceleration"), reading)
    if fields["angular_acceleration"] is not None:
        turning = fields["angular_acceleration"]
        path = inside(fields.path, "angular_acceleration")
        moment = _weighed(turning, body.inertia, fields["frame"], path, reading)
    if at is BAD or force is BAD or moment is BAD:
        return None
    arm = max(1.0, *(abs(value) for value in at))
    share = arm / min(1.0, _least(body))
    if not all(math.isfinite(size_of(part) * share) for part in (*force, *moment)):
        reading.mistake(fields.path, "the load is too large to compute with")
        return None
    if turning is not None and fields["frame"] == "global":
        return Load(body.name, force, at, ZERO, "global", turning)  # J of global axes is that of the time
    return Load(body.name, force, at, moment, fields["frame"])


def _weighed(signals: VectorSignal, tensor: FloatArray, frame: str, path: str, reading: Reading) -> Any:
    """The products of a tensor with three signals, in body axes; BAD where they overflow or cannot be added.

    Of signals along global axes nothing is added here: those that cannot be stay as they are.
    """
    if not all(math.isfinite(size_of(signal) * float(np.abs(tensor).max()) * 3.0) for signal in signals):
        reading.mistake(path, "times the moments of inertia it is too large for a number")
        return BAD
    try:
        return combined(tensor, signals)
    except UnaddedSignalsError as error:
        if frame == "global":
            return signals
        reading.mistake(path, f"its products of inertia would add {error}")
        return BAD


def _least(body: SpatialBody) -> float:
    """A bound below mass and moments, exact where the tensor is diagonal."""
    if not np.any(body.inertia - np.diag(np.diag(body.inertia))):
        return min(body.mass, float(np.diag(body.inertia).min()))
    return min(body.mass, float(np.linalg.eigvalsh(body.inertia)[0]))


def _default_at(first: SpatialBody, second: SpatialBody) -> Triple:
    """The second body's centre of mass, the first's where the second is ground."""
    return first.position if second.name == GROUND else second.position


SPACE = Geometry(
    number=3,
    format=SPACE_FORMAT,
    ground=SpatialBody(GROUND, 1.0, np.eye(3), ZERO, np.eye(3)),
    coordinates=(("x", 0), ("y", 1), ("z", 2)),
    to_local=_to_local,
    to_world=_to_world,
    build_body=_build_body,
    least=_least,
    grid_count=grid_count,
    grid_points=grid_points,
    check_grid=check_grid,
    build_load=_build_load,
    build_contact=surface_contact,
    joints=SPATIAL_JOINTS,
    default_at=_default_at,
)
