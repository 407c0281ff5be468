"""Groups taken apart, each member a group of its own, where values join members of which only some are kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mdstopo.case.arrays import IndexArray
from mdstopo.case.model import Case, MemberGroup, Variable, VolumeRow


def part(group: MemberGroup, own: IndexArray) -> MemberGroup:
    """The group with the members at `own`, and the points that they need."""
    p, p_index = np.unique(group.from_index[own], return_inverse=True)
    q, q_index = np.unique(group.to_index[own], return_inverse=True)
    return replace(
        group,
        from_local=group.from_local[p],
        from_world=group.from_world[p],
        to_local=group.to_local[q],
        to_world=group.to_world[q],
        from_index=p_index,
        to_index=q_index,
        length=group.length[own],
        cost=group.cost[own],
    )


def with_own(case: Case, kept: IndexArray) -> Iterator[tuple[MemberGroup, IndexArray]]:
    """Each group with the places in it of those of its members that are kept: all where it is no design group."""
    first = 0
    for group in case.members:
        if not group.design:
            yield group, np.arange(len(group))
            continue
        yield group, kept[(kept >= first) & (kept < first + len(group))] - first
        first += len(group)


def free_name(whole: str, place: int, taken: set[str]) -> str:
    """<whole>_<place>, or longer where that is taken; then it is taken too."""
    name = f"{whole}_{place}"
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def unlike(case: Case, kept: IndexArray) -> set[str]:
    """The groups that have to be taken apart, each member a group of its own.

    These are groups that have the values of a variable in common, member k of each one the same value (`each: member`),
    of which different members are kept; and groups that are joined to such a group by a further variable of this kind
    or by `mirrored`.
    """
    own = {group.name: places for group, places in with_own(case, kept)}
    found: set[str] = set()
    joined = [set(each.groups) for each in case.variables if each.each == "member"]
    for names in joined:
        left = {own[name].tobytes() for name in names if len(own[name])}
        if len(left) > 1:
            found |= names
    joined += [set(names) for names in case.mirrored]
    while more := [names for names in joined if names & found and not names <= found]:
        found = found.union(*more)
    return found


def apart(case: Case, names: Iterable[str]) -> Case:
    """The same case with each member of these groups a group of its own: the same designs, in the same order.

    names: as `unlike` gives them. A value for each member becomes a variable for each. Responses still name the groups.
    """
    split = set(names)
    if not split:
        return case
    taken = {group.name for group in case.members}
    single = {
        group.name: [free_name(group.name, i, taken) for i in range(len(group))]
        for group in case.members
        if group.name in split
    }
    members: list[MemberGroup] = []
    for group in case.members:
        if group.name in split:
            members += [replace(part(group, np.array([i])), name=name) for i, name in enumerate(single[group.name])]
        else:
            members.append(group)
    mirrored = [tuple(single[name]) for name in case.shared if name in split]
    for pair in case.mirrored:
        mirrored += zip(*(single[name] for name in pair), strict=True) if pair[0] in split else [pair]
    return replace(
        case,
        members=tuple(members),
        shared=tuple(name for name in case.shared if name not in split),
        mirrored=tuple(mirrored),
        variables=tuple(_variables(case.variables, single)),
        constraints=tuple(
            replace(row, groups=_flat(row.groups, single)) if isinstance(row, VolumeRow) else row
            for row in case.constraints
        ),
    )


def _variables(variables: Sequence[Variable], single: Mapping[str, list[str]]) -> Iterator[Variable]:
    taken = {each.name for each in variables}
    for each in variables:
        if each.each == "member" and each.groups[0] in single:
            for k in range(each.count):
                groups = tuple(single[name][k] for name in each.groups)
                yield replace(each, name=free_name(each.name, k, taken), groups=groups, each="group", count=1)
            continue
        laws = [
            law for name, law in zip(each.groups, each.laws, strict=True) for _ in range(len(single.get(name, [name])))
        ]
        yield replace(each, groups=_flat(each.groups, single), laws=tuple(laws))


def _flat(names: Iterable[str], single: Mapping[str, list[str]]) -> tuple[str, ...]:
    return tuple(each for name in names for each in single.get(name, [name]))
