"""Which members of two cases are the same: of the same group, between the same points."""

import re
from collections import defaultdict
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mdstopo.case.model import Case

#: of the size of both scenes: points that are nearer to each other than that are the same
SAME_POINT = 1e-9


class _Member(NamedTuple):
    """A member: its group, and its ends in either order, each a body and a place at the start."""

    group: str
    ends: tuple[tuple[object, ...], ...]


def same_members(first: Case, second: Case) -> list[tuple[int, int]]:
    """Pairs of numbers of members that are the same, counted through all groups of each case, by rising first number.

    Members of one group are the same where both ends are on the same bodies at the same places, whatever their numbers
    are: `finalize` numbers those that it keeps by their places among the candidates. The group of such a member is its
    name without that number, as far as there is no group of the whole name. Groups whose name the other case has not
    are compared with each other by the ends of their members alone.
    """
    size = SAME_POINT * max(*(_size(case) for case in (first, second)), 1e-300)
    both = [_members(case, size) for case in (first, second)]
    known = [{name for member in own for name in (member.group, family(member.group))} for own in both]
    common = known[0] & known[1]

    def whole(member: _Member) -> str:
        return member.group

    def without_number(member: _Member) -> str:
        return family(member.group)

    def unknown(member: _Member) -> str | None:
        return None if member.group in common or family(member.group) in common else ""

    found: dict[int, int] = {}
    rules: list[tuple[Callable[[_Member], str | None], Callable[[_Member], str | None]]] = [
        (whole, whole), (whole, without_number), (without_number, whole), (without_number, without_number),
        (unknown, unknown),
    ]  # fmt: skip
    for one, other in rules:
        taken, waiting = set(found.values()), defaultdict(list)
        for k, member in enumerate(both[1]):
            if k not in taken:
                waiting[other(member), member.ends].append(k)
        for k, member in enumerate(both[0]):
            name = one(member)
            if k not in found and name is not None and waiting[name, member.ends]:
                found[k] = waiting[name, member.ends].pop(0)
    return sorted(found.items())


def family(name: str) -> str:
    """The name of a group without the number that one of a final design has, whose groups are single members."""
    return re.sub(r"_\d+$", "", name)


def _size(case: Case) -> float:
    ends = [np.abs(each).max(initial=0.0) for group in case.members for each in (group.from_world, group.to_world)]
    return float(max(ends, default=0.0))


def _members(case: Case, size: float) -> list[_Member]:
    """All members, with places in steps of a size in m."""
    found = []
    for group in case.members:
        ends = [
            [(body, *place) for place in np.round(world[index] / size).tolist()]
            for body, world, index in (
                (group.body_from, group.from_world, group.from_index),
                (group.body_to, group.to_world, group.to_index),
            )
        ]
        found += [_Member(group.name, tuple(sorted(pair))) for pair in zip(*ends, strict=True)]
    return found
