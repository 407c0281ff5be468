"""Which members are worth having, and the same case with only these."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.errors import CaseError, Mistake
from mdstopo.case.model import Case, MemberGroup, VolumeRow
from mdstopo.case.volume import ROUNDING
from mdstopo.case.words import count_text, number_text, shown


def chosen(alpha: FloatArray, keep: int | None, threshold: float | None) -> IndexArray:
    """Places (K,), rising, of the `keep` largest alphas (N,), of equal ones the first; or of all >= `threshold`."""
    if keep is not None:
        return np.sort(np.argsort(-alpha, kind="stable")[:keep])
    return np.flatnonzero(alpha >= (0.0 if threshold is None else threshold))


def restricted(case: Case, kept: IndexArray, alpha: FloatArray) -> Case:
    """The case with only the design members at `kept` (K,), rising; groups that lose all of theirs are gone.

    alpha (N,): the design; each group's initial one is the mean of those that it keeps, because a case that settles has
    to settle with its initial design. Bounds of volume rows stay the numbers that they are. It has one start, and of
    several powers the last.
    """
    groups = []
    for group, own in _with_own(case, kept):
        if not group.design:
            groups.append(group)
        elif len(own):
            groups.append(replace(_part(group, own), powers=(), initial=float(_own(case, group, alpha)[own].mean())))
    names = {group.name for group in groups}
    rows = tuple(
        replace(row, groups=tuple(n for n in row.groups if n in names), coefficients=row.coefficients[kept])
        if isinstance(row, VolumeRow)
        else row
        for row in case.constraints
    )
    return replace(case, members=tuple(groups), constraints=rows, optimizer=replace(case.optimizer, starts=1))


def _own(case: Case, group: MemberGroup, alpha: FloatArray) -> FloatArray:
    return alpha[case.group_slices[group.name]]


def places(case: Case, kept: IndexArray) -> list[tuple[str, int]]:
    """Of each design member at `kept`: the name of its group, and its place in it from 0."""
    return [(group.name, int(i)) for group, own in _with_own(case, kept) if group.design for i in own]


def check(case: Case) -> None:
    """Refuse a case whose alphas cannot be taken member by member. Raises CaseError with every reason."""
    wrong = {
        "uncertainty": case.uncertainty is not None,
        "design.shared": bool(case.shared),
        "design.mirrored": bool(case.mirrored),
        "design.variables": bool(case.variables),
    }
    mistakes = [
        case.marks.mistake(path, f"a case with {path} cannot be finalized") for path, found in wrong.items() if found
    ]
    _raise(case, mistakes)


def check_restricted(case: Case) -> None:
    """Refuse what the members kept cannot do. Raises CaseError with every reason."""
    _raise(case, [case.marks.mistake(path, message) for path, message in _undone(case)])


def _undone(case: Case) -> Iterator[tuple[str, str]]:
    names = {group.name for group in case.members}
    for objective in case.objectives:
        if objective.response.group not in (None, *names):
            yield f"objectives.{objective.name}", _nobody(str(objective.response.group))
    upper = case.upper
    for i, row in enumerate(case.constraints):
        if not isinstance(row, VolumeRow):
            if row.response.group not in (None, *names):
                yield f"constraints[{i}]", _nobody(str(row.response.group))
            continue
        most = float(row.coefficients @ upper)
        if row.sense != "limit" and row.bound > most + ROUNDING * max(most, abs(row.bound)):
            yield (
                f"constraints[{i}].{row.sense}",
                f"found the bound {number_text(row.bound)}; the {count_text(case.n_design)} members kept reach only "
                f"{number_text(most)} at their upper bounds: keep more, or state what they may have, "
                f"--set constraints[{i}].{row.sense}={number_text(most)} at most",
            )


def _nobody(group: str) -> str:
    return f"it looks at the members of {shown(group)}, none of which is kept"


def _raise(case: Case, mistakes: list[Mistake]) -> None:
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))


def _with_own(case: Case, kept: IndexArray) -> Iterator[tuple[MemberGroup, IndexArray]]:
    """Each group with the places in it of those of its members that are kept; none of groups without design."""
    first = 0
    for group in case.members:
        count = len(group) if group.design else 0
        yield group, kept[(kept >= first) & (kept < first + count)] - first
        first += count


def _part(group: MemberGroup, own: IndexArray) -> MemberGroup:
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
