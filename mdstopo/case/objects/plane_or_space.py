"""What is different in the plane and in space for the reader of cases: one record for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from mdstopo.case.arrays import Components, FloatArray
from mdstopo.case.geometry.rigid_bodies import AnyBody
from mdstopo.case.objects.parts import AnyContact, Load
from mdstopo.case.text.reading import Fields, Reading

if TYPE_CHECKING:
    from mdstopo.case.joints.joint import Joint
    from mdstopo.case.keys.records import Record


class Geometry(NamedTuple):
    """What differs between a plane and space where a case is read.

    number: 2 or 3; format: the keys of a case. ground: the fixed body.
    coordinates: those that motions prescribe, each with its place in a body's position; None for the angle.
    to_local, to_world (body, points (n, number)): the points in the other coordinates.
    build_body (name, keys, path, prescribed angle or None, reading): the body, None where it cannot be made.
    least: the smallest of a body's mass and moments of inertia, in kg and kg m^2.
    grid_count, grid_points (kind, keys), check_grid (kind, keys, reading): of point grids. build_load (keys, body, its
    point in body coordinates or BAD, reading): the load, None where it cannot be made. build_contact (fields that all
    contacts have, keys of what is touched, `Frames`, reading): the contact, None where it cannot be made.
    joints: by their words. default_at (first, second body): where a fixed joint is that does not say it.
    """

    number: int
    format: Record
    ground: AnyBody
    coordinates: tuple[tuple[str, int | None], ...]
    to_local: Callable[[AnyBody, FloatArray], FloatArray]
    to_world: Callable[[AnyBody, FloatArray], FloatArray]
    build_body: Callable[[str, Any, str, float | None, Reading], AnyBody | None]
    least: Callable[[AnyBody], float]
    grid_count: Callable[[str, Any], int]
    grid_points: Callable[[str, Any], FloatArray]
    check_grid: Callable[[str, Any, Reading], bool]
    build_load: Callable[[Fields, AnyBody, Components, Reading], Load | None]
    build_contact: Callable[[dict[str, Any], Fields, Any, Reading], AnyContact | None]
    joints: Mapping[str, type[Joint]]
    default_at: Callable[[AnyBody, AnyBody], Components]
