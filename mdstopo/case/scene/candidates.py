"""Candidates that are priced instead of built, and cases in which some of them have become members.

A group with `candidates: priced` knows its points and which lengths its members may have. Its members are those that
have been built: a coarse subset to start with, later those whose price says so. A case whose groups have other members
is a case of its own, with volume rows of their costs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.objects.problem_parts import VolumeRow

if TYPE_CHECKING:
    from mdstopo.case.model import Case, MemberGroup
    from mdstopo.case.objects.parts import Candidates

ROUNDING = 1e-12
"""Lengths are compared up to this share of the coordinates they come from: 0.3 includes 0.1 + 0.2."""
START_SET = 1000
"""About as many members a priced group begins with."""
SPARE = 2.0
"""Whole members of the start set cost at least so many times what a volume row asks for."""
MOST_STARTED = 10**5
"""Members that a start set may have."""
_CHUNK = 1 << 10

Pairs = tuple[IndexArray, IndexArray]


def lengths_between(p: FloatArray, q: FloatArray) -> FloatArray:
    """Distances (n,) of points p from points q, (n, d) each."""
    lengths: FloatArray = reduce(np.hypot, (q - p).T)
    return lengths


def allowed_lengths(low: float, high: float | None, scale: float) -> tuple[float, float]:
    """The shortest and the longest length that filters let pass, with their rounding; scale: the largest coordinate."""
    shortest = low - ROUNDING * max(low, scale) if low > 0.0 else 0.0
    return shortest, math.inf if high is None else high + ROUNDING * max(high, scale)


def coincident(first: FloatArray, second: FloatArray, tolerance: float) -> tuple[int, tuple[int, int]]:
    """How many points of the one grid are within the tolerance of one of the other, and the first such pair.

    first, second: (n, d). Only points that lie alike along one skew direction are compared.
    """
    skew = np.sqrt(np.arange(1.0, first.shape[1] + 1.0))
    order = np.argsort(second @ skew, kind="stable")
    along = (second @ skew)[order]
    reach = 2.0 * tolerance * float(np.linalg.norm(skew))
    count, found = 0, (0, 0)
    for start in range(0, len(first), _CHUNK):
        own = first[start : start + _CHUNK] @ skew
        begin, end = np.searchsorted(along, own - reach), np.searchsorted(along, own + reach, side="right")
        i = np.repeat(np.arange(len(own)), end - begin)
        j = order[np.arange(len(i)) - np.repeat(np.cumsum(end - begin) - end, end - begin)]
        near = np.flatnonzero(lengths_between(first[start + i], second[j]) <= tolerance)
        if len(near) and not count:
            at = min(near, key=lambda k: (i[k], j[k]))
            found = (start + int(i[at]), int(j[at]))
        count += len(near)
    return count, found


def most_cost(group: MemberGroup) -> float:
    """What a member of a priced group costs at most: its cost, or the diagonal of all points for a length."""
    assert group.candidates is not None
    if group.candidates.cost is not None:
        return group.candidates.cost
    return float(np.linalg.norm(np.ptp(np.concatenate([group.from_world, group.to_world]), axis=0)))


def coefficients_of(design: Sequence[MemberGroup], names: Sequence[str]) -> FloatArray:
    """(N,) the cost V_i of the members in the groups `names`, 0 of all others."""
    pieces = [group.cost if group.name in names else np.zeros(len(group)) for group in design]
    return np.concatenate(pieces) if pieces else np.zeros(0)


def with_members(case: Case, pairs: Mapping[str, Pairs]) -> Case:
    """The case with other members of priced groups, by name: their points P and Q, in the order of the product."""
    members = tuple(_built(each, *pairs[each.name]) if each.name in pairs else each for each in case.members)
    design = [group for group in members if group.design]
    return replace(
        case,
        members=members,
        constraints=tuple(
            replace(row, coefficients=coefficients_of(design, row.groups)) if isinstance(row, VolumeRow) else row
            for row in case.constraints
        ),
    )


def mirrored_groups(case: Case) -> list[tuple[MemberGroup, ...]]:
    """The priced groups of a case: those whose members k have one alpha (`design.mirrored`) together, in its order."""
    sets = {group.name: [group.name] for group in case.priced_groups}
    for names in case.mirrored:
        together = sorted({each for name in names if name in sets for each in sets[name]})
        sets |= dict.fromkeys(together, together)
    by_name = {group.name: group for group in case.priced_groups}
    found: dict[str, tuple[MemberGroup, ...]] = {}
    for group in case.priced_groups:
        own = sets[group.name]
        found.setdefault(own[0], tuple(by_name[name] for name in by_name if name in own))
    return list(found.values())


def unlike(first: MemberGroup, second: MemberGroup) -> str:
    """Why two mirrored groups cannot have their candidates priced together, in words; empty where they can.

    A candidate and its mirror image enter together. So both have to be there, and to cost the same.
    """
    if first.candidates is None or second.candidates is None:
        return "the candidates of one are priced, and those of the other are not"
    for side in ("from_local", "to_local"):
        n, m = len(getattr(first, side)), len(getattr(second, side))
        if n != m:
            return f"{side.removesuffix('_local')} has {n:,} points in one and {m:,} in the other"
    if (first.body_to == "ground") != (second.body_to == "ground"):
        return "one ends on the ground and the other does not"
    if first.candidates != second.candidates:
        return "costs, min_length and max_length have to be the same"
    needed = first.candidates.cost is None or first.candidates.filtered
    if needed and not _congruent(*(np.concatenate([each.from_world, each.to_world]) for each in (first, second))):
        return "their points are no mirror images, turned or moved: lengths differ, and with them which there are"
    return ""


def _congruent(first: FloatArray, second: FloatArray) -> bool:
    """Whether points (n, d) come to others by a motion and a mirror, to rounding."""
    own, other = first - first.mean(axis=0), second - second.mean(axis=0)
    left, _, right = np.linalg.svd(own.T @ other)
    off = float(np.abs(own @ (left @ right) - other).max())
    return off <= 1e3 * ROUNDING * float(max(np.abs(first).max(), np.abs(second).max()))


def pairs_of(case: Case) -> dict[str, Pairs]:
    """The members that priced groups have, by name."""
    return {group.name: (group.from_index, group.to_index) for group in case.priced_groups}


def _built(group: MemberGroup, i: IndexArray, j: IndexArray) -> MemberGroup:
    assert group.candidates is not None
    length = lengths_between(group.from_world[i], group.to_world[j])
    cost = group.candidates.cost
    return replace(
        group, from_index=i, to_index=j, length=length, cost=length if cost is None else np.full(len(i), cost)
    )


def some_candidates(own: Candidates, first: FloatArray, second: FloatArray, count: int) -> Pairs:
    """Candidates between evenly spread points of two grids (n, d), of about `count` pairs of these.

    Where limits on lengths leave none of the pairs, more points of the grids are taken, until there are some or
    MOST_STARTED pairs have been looked at.
    """
    while True:
        p, q = spread(len(first), len(second), count)
        i, j = np.repeat(p, len(q)), np.tile(q, len(p))
        there = are_there(own, lengths_between(first[i], second[j]))
        if there.any() or len(i) >= min(own.count, MOST_STARTED):
            return i[there], j[there]
        count *= 4


def are_there(own: Candidates, length: FloatArray) -> NDArray[np.bool_]:
    """Which pairs of points at these distances are candidates: not of no length, and within the limits."""
    there: NDArray[np.bool_] = (length >= own.shortest) & (length <= own.longest) & (length > 0.0)
    return there


def with_start_set(case: Case) -> Case:
    """The case with a coarse subset of the candidates of its priced groups, enough of them for its volume rows."""
    count = START_SET
    while True:
        pairs: dict[str, Pairs] = {}
        for groups in mirrored_groups(case):
            pairs |= dict.fromkeys((each.name for each in groups), _coarse(groups[0], count))
        begun = with_members(case, pairs)
        lacking = [row for row in begun.constraints if isinstance(row, VolumeRow) and not _suffices(begun, row)]
        if not lacking or count >= min(MOST_STARTED, max(_count(group) for group in case.priced_groups)):
            return begun
        count *= 2


def _count(group: MemberGroup) -> int:
    return group.candidates.count if group.candidates is not None else 0


def _suffices(case: Case, row: VolumeRow) -> bool:
    return row.sense == "limit" or float(row.coefficients @ case.upper) >= SPARE * row.bound


def spread(n_p: int, n_q: int, count: int | None) -> tuple[IndexArray, IndexArray]:
    """Evenly spread points of two grids of n_p and n_q, which make about `count` pairs; all points where that is fewer,
    or None."""
    share = 1.0 if count is None else min(1.0, math.sqrt(count / (n_p * n_q)))
    many_p, many_q = (min(n, math.ceil(share * n)) for n in (n_p, n_q))
    return np.arange(many_p) * n_p // many_p, np.arange(many_q) * n_q // many_q


def _coarse(group: MemberGroup, count: int) -> Pairs:
    """About so many candidates of every part of both grids, or all of fewer."""
    assert group.candidates is not None
    return some_candidates(group.candidates, group.from_world, group.to_world, count)
