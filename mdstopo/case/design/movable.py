"""Points whose coordinates are design variables: read from a case, and where a design has them.

Along the axes of its region a point has a value each. In body coordinates it is base + sum of value times axis, so that
what it does to a scene is differentiated along the axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mdstopo.case.arrays import FloatArray, FrozenDict
from mdstopo.case.design.volume import prices
from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.geometry.spatial_point_grids import check_grid
from mdstopo.case.geometry.start_rotations import frame_with, unit
from mdstopo.case.model import GROUND, AnyBody, Case, MemberGroup, MovablePoints, PointGrid, Variable, VolumeRow
from mdstopo.case.objects.frames import Frames
from mdstopo.case.scene.candidates import coefficients_of, lengths_between
from mdstopo.case.scene.dimensions import frames_of
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text

#: how far from its region a point may be at first, relative to the size of the coordinates
OUTSIDE = 1e-9


class _Region(NamedTuple):
    """In the frame of the grid: base (n or 1, d), axes (k, d) with their names, and bounds (k,) of the values."""

    base: FloatArray
    axes: FloatArray
    names: tuple[str, ...]
    lower: FloatArray
    upper: FloatArray


def build_movable(
    top: Fields,
    points: dict[str, PointGrid],
    groups: dict[str, MemberGroup] | None,
    frames: Frames,
    reading: Reading,
) -> tuple[tuple[MovablePoints, ...], tuple[Variable, ...]]:
    """The points that may move, and the variables that their coordinates are; mistakes are noted."""
    sections = top["points"] if isinstance(top["points"], dict) else {}
    moving: list[MovablePoints] = []
    variables: list[Variable] = []
    for name, fields in sections.items():
        if fields is BAD or name not in points or fields["movable"] in (None, BAD):
            continue
        grid, path = points[name], inside(fields.path, "movable")
        stated = grid.world if fields["frame"] == "global" else grid.local
        region = _region(fields["movable"], stated, reading)
        if region is None:
            continue
        values = _values(name, stated, region, path, reading)
        if values is None or not is_of_use(name, path, top, groups, reading):
            continue
        body, base, axes = grid.body, region.base, region.axes
        if fields["frame"] == "global":
            base, axes = frames.to_local(body, base), turned(frames, body, axes)
        names = tuple(f"{name}.{axis}" for axis in region.names)
        moving.append(MovablePoints(name, body, base, axes, names))
        variables += [
            Variable(
                names[a], (), (), region.names[a], "point", len(values), values[:, a], float(region.lower[a]),
                float(region.upper[a]), unit="m", points=name,
            )
            for a in range(len(names))
        ]  # fmt: skip
    if moving and isinstance(top["objectives"], dict) and "variables" in top["objectives"]:
        message = "this name is taken where points are movable: results keep the derivatives by variables under it"
        reading.mistake("objectives.variables", message)
    return tuple(moving), tuple(variables)


def turned(frames: Frames, body: str, vectors: FloatArray) -> FloatArray:
    """Vectors (n, d), stated in global axes, in the axes of a body at the start."""
    if body == GROUND:
        return vectors
    return frames.geometry.to_local(_at_origin(frames.bodies[body]), vectors)


def turned_out(frames: Frames, body: str, vectors: FloatArray) -> FloatArray:
    """Vectors (n, d), stated in the axes of a body at the start, in global axes."""
    if body == GROUND:
        return vectors
    return frames.geometry.to_world(_at_origin(frames.bodies[body]), vectors)


def _at_origin(body: AnyBody) -> AnyBody:
    return replace(body, position=(0.0,) * len(body.position))


def _region(fields: Fields, points: FloatArray, reading: Reading) -> _Region | None:
    """Where points that begin at (n, d) may be; None where that cannot be read, which is noted."""
    within = fields["within"]
    if within is BAD:
        return None
    stated = [kind for kind in within.stated if within[kind] is not BAD]
    if len(stated) != 1:
        return None
    kind, region = stated[0], within[stated[0]]
    dimension = points.shape[1]
    names = ("x", "y", "z")[:dimension]
    if kind == "around":
        away = np.full(dimension, float(region))
        return _Region(points, np.eye(dimension), tuple(f"d{name}" for name in names), -away, away)
    if not region.good():
        return None
    for key in ("from", "to", "center"):
        if key in region and not in_range(np.array(region[key]), inside(region.path, key), reading):
            return None
    if kind == "line":
        first, last = np.array(region["from"], dtype=np.float64), np.array(region["to"], dtype=np.float64)
        length = float(np.linalg.norm(last - first))
        if not length > 0.0:
            reading.mistake(inside(region.path, "to"), "is where the line begins, allowed is another point")
            return None
        return _Region(first[None], ((last - first) / length)[None], ("along",), np.zeros(1), np.array([length]))
    if kind == "box":
        low, high = np.array(region["from"], dtype=np.float64), np.array(region["to"], dtype=np.float64)
        if np.any(low > high):
            reading.mistake(inside(region.path, "to"), "no coordinate may be smaller than that of `from`")
            return None
        return _Region(np.zeros((1, 3)), np.eye(3), names, low, high)
    center, half = np.array(region["center"], dtype=np.float64), 0.5 * np.array(region["size"])
    if dimension == 2:
        return _Region(np.zeros((1, 2)), np.eye(2), names, center - half, center + half)
    if not check_grid(kind, region, reading):
        return None
    axes = frame_with(*(unit(axis) for axis in region["axes"]))[:2]
    return _Region(center[None], axes, ("u", "v"), -half, half)


def _values(name: str, points: FloatArray, region: _Region, path: str, reading: Reading) -> FloatArray | None:
    """(n, k) the values of the points (n, d) of a grid; None where one is not in the region, which is noted."""
    seen = points - region.base
    values: FloatArray = seen @ region.axes.T
    allowed = np.clip(values, region.lower, region.upper)
    away = np.abs(seen - allowed @ region.axes).max(axis=1)
    size = max(float(np.abs(points).max()), float(np.abs(region.upper - region.lower).max()))
    outside = np.flatnonzero(away > OUTSIDE * size)
    if not len(outside):
        return allowed
    at = ", ".join(number_text(value) for value in points[outside[0]].tolist())
    message = (
        f"point {outside[0]} of {name!r} is at [{at}], {number_text(float(away[outside[0]]))} m outside; a point "
        "begins in the region that it may move in"
    )
    reading.mistake(inside(path, "within"), message)
    return None


def is_of_use(name: str, path: str, top: Fields, groups: dict[str, MemberGroup] | None, reading: Reading) -> bool:
    """Whether members end at the points of a grid, and nothing else that could not follow them is tied to these; notes
    what is."""
    contacts = top["contacts"] if isinstance(top["contacts"], (list, tuple)) else ()
    touching = [i for i, each in enumerate(contacts) if each is not BAD and each["points"] == name]
    if touching:
        reading.mistake(path, f"contacts[{touching[0]}] is of these points; points that touch something cannot move")
        return False
    if groups is None:
        return False
    ending = [group for group in groups.values() if name in (group.from_points, group.to_points)]
    priced = [group.name for group in ending if group.candidates is not None]
    if priced:
        reading.mistake(
            path, f"the candidates of {priced[0]!r} are priced; ends of members that are not built cannot move"
        )
    elif not ending:
        reading.mistake(path, "no member begins or ends at these points; without one there is nothing to design")
    return bool(ending) and not priced


def points_at(case: Case, values: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """By name of the grid: body coordinates (n, d) of the points that may move, from the values of variables."""
    return {
        each.grid: each.base + np.stack([values[name] for name in each.variables], axis=1) @ each.axes
        for each in case.movable
    }


def placed(case: Case, design: FloatArray) -> Case:
    """The case with movable points where a design (N + P,) has them, which is where its variables then begin."""
    if not case.movable:
        return case
    frames = frames_of(case)
    values = case.space.named(design)
    local = points_at(case, values)
    world = {each.grid: frames.to_world(each.body, local[each.grid]) for each in case.movable}
    points: dict[str, Any] = {
        name: replace(grid, local=local[name], world=world[name]) if name in local else grid
        for name, grid in case.points.items()
    }
    variables = tuple(replace(each, initial=values[each.name]) if each.points else each for each in case.variables)
    members = tuple(_placed_group(group, local, world) for group in case.members)
    design_groups = tuple(group for group in members if group.design)
    rows = tuple(
        replace(row, coefficients=coefficients_of(design_groups, row.groups)) if isinstance(row, VolumeRow) else row
        for row in case.constraints
    )
    return replace(case, points=FrozenDict(points), variables=variables, members=members, constraints=rows)


def with_points_fixed(case: Case, design: FloatArray) -> tuple[Case, FloatArray]:
    """The case with movable points where a design (N + P,) has them and no variables for them any more; and the design
    without them."""
    if not case.movable:
        return case, design
    there = placed(case, design)
    variables = tuple(each for each in case.variables if not each.points)
    rows = tuple(
        replace(row, prices=prices(variables, row.groups)) if isinstance(row, VolumeRow) and len(row.prices) else row
        for row in there.constraints
    )
    count = case.n_design + sum(each.count for each in variables)
    return replace(there, variables=variables, movable=(), constraints=rows), design[:count]


def _placed_group(group: MemberGroup, local: Mapping[str, FloatArray], world: Mapping[str, FloatArray]) -> MemberGroup:
    """A group with its ends at points that have moved, and with lengths and costs that follow."""
    moved: dict[str, Any] = {}
    for side in ("from", "to"):
        name = getattr(group, f"{side}_points")
        if name in local:
            moved |= {f"{side}_local": local[name], f"{side}_world": world[name]}
    if not moved:
        return group
    there = replace(group, **moved)
    length = lengths_between(there.p_world, there.q_world)
    return replace(there, length=length, cost=length if group.cost_by_length else group.cost)
