"""Volume rows (Eq. 14) over members that cost their length, and whose ends are design variables.

    sum alpha_i L_i,   d/d(alpha_i) = L_i,   d/dp = sum alpha_i e_i . dr_i/dp

with the direction e_i of a member at the start and r_i from its first end to its second. Such a row is no line in the
design, so the optimiser gets it as it gets a constraint on a response.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.design.movable import points_at, turned_out
from mdstopo.case.model import Case, MemberGroup, ResponseRow, VolumeRow
from mdstopo.case.scene.dimensions import frames_of
from mdstopo.scene.bodies import distances
from mdstopo.scene.design_map import DesignMap


def moves(case: Case, group: MemberGroup) -> bool:
    """Whether the members of a group cost their length, and that varies."""
    names = {each.grid for each in case.movable}.union(*(each.moved for each in case.variables))
    return group.design and group.cost_varies(names)


def moving_volumes(case: Case) -> dict[int, MovingVolume | VolumeThrough]:
    """By number of the constraint: volume rows whose coefficients vary."""
    groups = [group.name for group in case.members if moves(case, group)] if case.variables else []
    return {
        i: _volume(case, row)
        for i, row in enumerate(case.constraints)
        if isinstance(row, VolumeRow) and set(row.groups) & set(groups)
    }


def spent(case: Case, row: VolumeRow | ResponseRow, design: FloatArray) -> float:
    """The sum of a volume row with a design (N + P,), members as long as it makes them."""
    assert isinstance(row, VolumeRow)
    moving = any(moves(case, group) for group in case.members if group.name in row.groups)
    return _volume(case, row).at(design)[0] if moving else row.spent(design)


def _volume(case: Case, row: VolumeRow) -> MovingVolume | VolumeThrough:
    return MovingVolume(case, row) if case.follows is None else VolumeThrough(case, row)


class VolumeThrough:
    """The sum of one volume row where points follow from defined names, and its derivative."""

    def __init__(self, case: Case, row: VolumeRow) -> None:
        self._prices = row.prices if len(row.prices) else np.zeros(case.space.length - case.n_design)
        self._design_map = DesignMap(case)
        self._of_points = MovingVolume(self._design_map.case, replace(row, prices=np.zeros(0)))

    def at(self, design: FloatArray) -> tuple[float, FloatArray]:
        """The sum at a design (N + P,), and its derivative (N + P,)."""
        total, slope = self._of_points.at(self._design_map.design(design))
        pulled = self._design_map.pull_back(slope)
        n = len(design) - len(self._prices)
        pulled[n:] += self._prices
        return total + float(self._prices @ design[n:]), pulled


class MovingVolume:
    """The sum of one volume row, and its derivative."""

    def __init__(self, case: Case, row: VolumeRow) -> None:
        self._case, self._row = case, row
        self._frames = frames_of(case)
        self._parts = case.group_slices
        self._groups = [group for group in case.design_groups if group.name in row.groups and moves(case, group)]
        self._movable = {each.grid: each for each in case.movable}

    def at(self, design: FloatArray) -> tuple[float, FloatArray]:
        """The sum at a design (N + P,), and its derivative (N + P,)."""
        n, space = self._case.n_design, self._case.space
        local = points_at(self._case, space.named(design))
        slope = np.zeros(space.length)
        slope[:n] = self._row.coefficients
        slope[n:] = self._row.prices if len(self._row.prices) else 0.0
        by_ends = np.zeros(space.length)
        for group in self._groups:
            part = self._parts[group.name]
            first = self._ends(group.body_from, local.get(group.from_points, group.from_local))[group.from_index]
            second = self._ends(group.body_to, local.get(group.to_points, group.to_local))[group.to_index]
            apart = second - first
            length = distances(apart)
            slope[part] = length
            size = length[:, None]
            pull = np.divide(design[part][:, None] * apart, size, out=np.zeros_like(apart), where=size > 0.0)
            self._add(group.from_points, -pull, group.from_index, by_ends)
            self._add(group.to_points, pull, group.to_index, by_ends)
        return float(slope @ design), slope + by_ends

    def _ends(self, body: str, points: FloatArray) -> FloatArray:
        return self._frames.to_world(body, points)

    def _add(self, points: str, pull: FloatArray, index: IndexArray, out: FloatArray) -> None:
        """Add what moving the points of a grid does; pull (M, d): alpha e of the members that end there."""
        grid = self._movable.get(points)
        if grid is None:
            return
        axes = turned_out(self._frames, grid.body, grid.axes)
        for name, axis in zip(grid.variables, axes, strict=True):
            part = self._case.space.parts[name]
            out[part] += np.bincount(index, pull @ axis, part.stop - part.start)
