"""Where the ends of members are that end at movable points, in the arrays of a general scene.

A coordinate of a point is a value p, as a parameter of a law is. For each member that ends there, and for each of its
laws, there is an entry of `GeneralModel.varied` (FIRST_END or SECOND_END in the place of the parameter) and a row of
`along`: the direction in which the end moves, and what its free length grows by where that is the length at the start.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mdstopo.case.design.movable import points_at, turned_out
from mdstopo.case.model import GROUND, Case, LoadCase, MemberGroup, MovablePoints
from mdstopo.case.scene.dimensions import frames_of
from mdstopo.general.model.general_model import (
    COUNT,
    FIRST_END,
    MEMBER_EXCESS,
    MEMBER_FREE_LENGTH,
    SECOND_END,
    START,
    VARIED_COLUMNS,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
    GeneralModel,
)
from mdstopo.general.scene.dimension import dimension_of, in_frame
from mdstopo.scene.bodies import distances, stands_as
from mdstopo.scene.origin import ends_of
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: columns of `GeneralModel.along`: a direction, in the plane of two components and a zero, and a free length's growth
WIDTH = 4

#: the blocks of each group and place of a law in it, in the order of members
Blocks = Mapping[tuple[str, int], Sequence[int]]


class _Ends(NamedTuple):
    """The ends (M,) of a group's members, under one law, that move along one axis: rows of `varied`.

    grid, axis: of the points; law: the place of the law. at_to: whether they are the `to` of members.
    """

    group: MemberGroup
    law: int
    grid: MovablePoints
    axis: int
    at_to: bool
    rows: IndexArray


def _places(group: MemberGroup, law: int, blocks: Blocks, block: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Of each member (M,) of a group: its block under a law, and its number (padded)."""
    own = blocks[group.name, law]
    k = np.repeat(own, block[own, COUNT])
    places = np.concatenate([np.arange(block[b, START], block[b, START] + block[b, COUNT]) for b in own])
    return k, places


def _parts(case: Case) -> dict[str, slice]:
    """By name of a variable: where its values stand among all (P,)."""
    n = case.n_design
    return {name: slice(part.start - n, part.stop - n) for name, part in case.space.parts.items()}


def _ends(case: Case, blocks: Blocks, block: IndexArray) -> Iterator[_Ends]:
    parts = _parts(case)
    for grid in case.movable:
        for axis, name in enumerate(grid.variables):
            for group in case.members:
                for at_to in (False, True):
                    if (group.to_points if at_to else group.from_points) != grid.grid:
                        continue
                    index = group.to_index if at_to else group.from_index
                    second = at_to == (ends_of(group)[0] == group.body_from)
                    side = SECOND_END if second else FIRST_END
                    for law in range(len(group.laws)):
                        k, at = _places(group, law, blocks, block)
                        rows = np.stack(
                            [k, np.full(len(k), side), parts[name].start + index, np.zeros(len(k)), at, at + 1], axis=1
                        )
                        yield _Ends(group, law, grid, axis, at_to, rows.astype(np.int64))


def rows_of_ends(case: Case, blocks: Blocks, block: IndexArray) -> IndexArray:
    """(n, 6) the entries of `GeneralModel.varied` of all ends that move, rising by value."""
    none = np.zeros((0, VARIED_COLUMNS), dtype=np.int64)
    rows = np.concatenate([none, *(each.rows for each in _ends(case, blocks, block))])
    # a value that no member has is told all the same: with no members
    parts = _parts(case)
    values = [np.arange(parts[name].start, parts[name].stop) for grid in case.movable for name in grid.variables]
    unused = np.setdiff1d(np.concatenate([np.zeros(0, dtype=np.int64), *values]), rows[:, VARIED_VALUE])
    empty = np.zeros((len(unused), none.shape[1]), dtype=np.int64)
    empty[:, VARIED_PLACE], empty[:, VARIED_VALUE] = FIRST_END, unused
    rows = np.concatenate([rows, empty])
    return rows[_order(rows)]


def _order(rows: IndexArray) -> IndexArray:
    return np.argsort(rows[:, VARIED_VALUE], kind="stable")


class MovedEnds:
    """Moves the ends of members to where the values of variables have them, in the arrays of a model."""

    def __init__(self, case: Case, load_case: LoadCase, model: GeneralModel, blocks: Blocks) -> None:
        self._case = case
        self._dimension = dimension_of(case)
        self._frames = self._dimension.frames(load_case)
        self._stated = frames_of(case)
        self._home = None if stands_as(case, load_case) else model.home
        self._number = {body.name: i for i, body in enumerate(case.bodies)} | {GROUND: len(case.bodies)}
        self._blocks = blocks
        self._ends = list(_ends(case, blocks, model.block))
        rows = [each.rows for each in self._ends]
        #: in which order the entries of ends stand in `varied`, and where
        self._order = _order(np.concatenate(rows))
        ends = (model.varied[:, VARIED_PLACE] < 0) & (model.varied[:, VARIED_STOP] > model.varied[:, VARIED_FIRST])
        self._used = np.flatnonzero(ends)
        varied = {(name, law) for each in case.variables if each.parameter == "free_length"
                  for name, law in zip(each.groups, each.laws, strict=True)}  # fmt: skip
        #: groups and places of laws whose free length is the length at the start
        self._measured = {
            (group.name, law)
            for group in case.members
            for law, record in enumerate(group.laws)
            if getattr(record, "free_length", None) is None and (group.name, law) not in varied
        }
        self._parts = _parts(case)

    def at(self, model: GeneralModel, values: FloatArray) -> GeneralModel:
        """The arrays with ends as the values (P,) of all variables have them; free lengths that are stated stay."""
        local = points_at(self._case, {name: values[part] for name, part in self._parts.items()})
        member = model.member.copy()
        directions: dict[str, FloatArray] = {}
        for group in self._case.members:
            if group.from_points in local or group.to_points in local:
                moved = replace(
                    group,
                    from_local=local.get(group.from_points, group.from_local),
                    to_local=local.get(group.to_points, group.to_local),
                )
                directions[group.name] = self._place(model, moved, member)
        along = model.along.copy()
        slopes = np.concatenate([self._slopes(each, directions[each.group.name]) for each in self._ends])
        along[self._used] = slopes[self._order]
        return model._replace(member=member, along=along)

    def _place(self, model: GeneralModel, group: MemberGroup, member: FloatArray) -> FloatArray:
        """Put the ends of a group into the members' columns; (M, d) its members' directions where it is measured."""
        frames = self._stated
        d = self._dimension.point
        first_body, second_body, p, q = ends_of(group)
        apart = frames.to_world(second_body, q) - frames.to_world(first_body, p)
        measured = distances(apart)
        p, q = in_frame(self._frames, first_body, p), in_frame(self._frames, second_body, q)
        length = measured
        if self._home is not None:
            places = self._dimension.places
            first = places(self._home, self._number[first_body], p)
            length = distances(places(self._home, self._number[second_body], q) - first)
        for law in range(len(group.laws)):
            _, at = _places(group, law, self._blocks, model.block)
            member[:d, at], member[d : 2 * d, at] = p.T, q.T
            if getattr(group.laws[law], "free_length", None) is None:
                member[MEMBER_FREE_LENGTH, at] = measured
            free = member[MEMBER_FREE_LENGTH, at]
            member[MEMBER_EXCESS, at] = (length - free) * (length + free)
        outward = 1.0 if first_body == group.body_from else -1.0
        size = measured[:, None]
        return np.divide(outward * apart, size, out=np.zeros_like(apart), where=size > 0.0)

    def _slopes(self, ends: _Ends, direction: FloatArray) -> FloatArray:
        """(M, WIDTH) the rows of `along`; direction (M, d): from the members' points `from` to their points `to`."""
        axis = ends.grid.axes[ends.axis][None]
        out = np.zeros((len(ends.rows), WIDTH))
        own = in_frame(self._frames, ends.grid.body, axis)[0]
        out[:, : len(own)] = own
        if (ends.group.name, ends.law) in self._measured:
            sign = 1.0 if ends.at_to else -1.0
            out[:, -1] = sign * direction @ turned_out(self._stated, ends.grid.body, axis)[0]
        return out
