"""Cases in the plane: x, y and the rotation about z."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.geometry.outlines import PLANAR, build_outlines
from mdstopo.case.geometry.point_grids import grid_count, grid_points
from mdstopo.case.joints import JOINTS
from mdstopo.case.model import GROUND, Body, Load, Pair
from mdstopo.case.objects.plane_or_space import Geometry
from mdstopo.case.scene.contacts import edge_contact
from mdstopo.case.scene.load_cases import scaled
from mdstopo.case.scene.prescribed import size_of
from mdstopo.case.schema.schema_case import FORMAT
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text


def _to_local(body: Body, world: FloatArray) -> FloatArray:
    d: FloatArray = world - np.array(body.position)
    c, s = math.cos(body.angle), math.sin(body.angle)
    if body.angle == 0.0:
        return d
    return np.stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0]], axis=1)


def _to_world(body: Body, local: FloatArray) -> FloatArray:
    c, s = math.cos(body.angle), math.sin(body.angle)
    x, y = local[:, 0], local[:, 1]
    turned = local if body.angle == 0.0 else np.stack([c * x - s * y, s * x + c * y], axis=1)
    moved: FloatArray = turned + np.array(body.position)
    return moved


def _build_body(name: str, fields: Any, path: str, angle: float | None, reading: Reading) -> Body | None:
    """The body at the start, or None where it cannot be read. angle: what a motion prescribes, else None."""
    if fields is BAD or not fields.good():
        return None
    mass, inertia = fields["mass"], fields["inertia"]
    good = True
    for key, value in (("mass", mass), ("inertia", inertia)):
        if not (math.isfinite(1.0 / value) and value * value > 0.0 and math.isfinite(value * value)):
            reading.mistake(inside(path, key), f"found {number_text(value)}, too extreme to compute with")
            good = False
    good &= in_range(np.array(fields["position"]), inside(path, "position"), reading)
    for key in ("velocity", "angular_velocity"):
        good &= in_range(np.array(fields[key]), inside(path, key), reading)
    if not good:
        return None
    body = Body(
        name,
        mass,
        inertia,
        fields["position"],
        fields["angle"] if angle is None else angle,
        fields["velocity"],
        fields["angular_velocity"],
        fields.stated & {"angle", "velocity", "angular_velocity"},
    )
    outline = build_outlines(fields, body, PLANAR, _to_local, reading)
    return None if outline is None else replace(body, outline=outline)


def _build_load(fields: Fields, body: Body, at: Any, reading: Reading) -> Load | None:
    force: Any = fields["force"] or (0.0, 0.0)
    moment: Any = fields["moment"] or (0.0,)
    if fields["acceleration"] is not None:
        force = scaled(fields["acceleration"], body.mass, inside(fields.path, "acceleration"), reading)
    if fields["angular_acceleration"] is not None:
        path = inside(fields.path, "angular_acceleration")
        moment = scaled(fields["angular_acceleration"], body.inertia, path, reading)
    if at is BAD or force is BAD or moment is BAD:
        return None
    arm = max(1.0, abs(at[0]), abs(at[1]))
    share = arm / min(1.0, body.mass, body.inertia)
    if not all(math.isfinite(size_of(part) * share) for part in (*force, *moment)):
        reading.mistake(fields.path, "the load is too large to compute with")
        return None
    return Load(body.name, force, at, moment[0], fields["frame"])


def _default_at(first: Body, second: Body) -> Pair:
    """The second body's centre of mass; that of ground is the origin."""
    del first
    return second.position


PLANE = Geometry(
    number=2,
    format=FORMAT,
    ground=Body(GROUND, 1.0, 1.0, (0.0, 0.0)),
    coordinates=(("x", 0), ("y", 1), ("angle", None)),
    to_local=_to_local,
    to_world=_to_world,
    build_body=_build_body,
    least=lambda body: min(body.mass, body.inertia),
    grid_count=grid_count,
    grid_points=grid_points,
    check_grid=lambda kind, grid, reading: True,
    build_load=_build_load,
    build_contact=edge_contact,
    joints=JOINTS,
    default_at=_default_at,
)
