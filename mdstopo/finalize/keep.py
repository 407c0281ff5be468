"""Which members are worth having, and the same case with only these."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.design.volume import ROUNDING, prices
from mdstopo.case.model import Case, Variable, VolumeRow
from mdstopo.case.objects.design_space import slots_of
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.words import count_text, number_text, shown
from mdstopo.finalize.apart import part, with_own


def chosen(alpha: FloatArray, keep: int | None, threshold: float | None, slots: IndexArray | None = None) -> IndexArray:
    """Places (K,), rising, of the `keep` largest alphas (N,), of equal ones the first; or of all >= `threshold`.

    slots (N,): which alphas are one; all members of one are kept, or none. There may be more than `keep` then.
    """
    if keep is None:
        reaching = alpha >= (0.0 if threshold is None else threshold)
        return np.flatnonzero(reaching if slots is None else np.isin(slots, slots[reaching]))
    order = np.argsort(-alpha, kind="stable")
    if slots is None:
        return np.sort(order[:keep])
    # slots in the order of their first members, until there are enough
    found, first = np.unique(slots[order], return_index=True)
    ranked = found[np.argsort(first)]
    before = np.concatenate([[0], np.cumsum(np.bincount(slots)[ranked])[:-1]]) if len(ranked) else ranked
    return np.flatnonzero(np.isin(slots, ranked[before < keep]))


def one_alpha(case: Case) -> IndexArray | None:
    """(N,) a number for each alpha, the same where alphas are one variable (`shared`, `mirrored`); None where none
    are."""
    return slots_of({group.name: len(group) for group in case.design_groups}, case.shared, case.mirrored)


def restricted(case: Case, kept: IndexArray, design: FloatArray) -> Case:
    """The case with only the design members at `kept` (K,), rising; groups that lose all of theirs are gone.

    design (N,) or (N + P,); each group's initial alpha is the mean of those that it keeps, and each variable's initial
    value that of its values, because a case that settles has to settle with its initial design. Alphas that are one,
    and members of several groups that have one value, have to be kept together (`chosen`, `apart`).
    Variables of which no group is left are gone. Bounds of volume rows stay the numbers that they are. It has one
    start, and of several powers the last. No candidates are priced: other pairs of the points kept are none.
    """
    design = case.whole(design)
    groups = []
    for group, own in with_own(case, kept):
        if not group.design:
            groups.append(group)
        elif len(own):
            initial = float(design[case.group_slices[group.name]][own].mean())
            groups.append(replace(part(group, own), powers=(), initial=initial, candidates=None))
    names = {group.name for group in groups}
    variables = tuple(_variable(each, places, design[case.n_design :]) for each, places in _values(case, kept))
    rows = tuple(
        _row(row, kept, tuple(n for n in row.groups if n in names), variables) if isinstance(row, VolumeRow) else row
        for row in case.constraints
    )
    mirrored = [tuple(name for name in pair if name in names) for pair in case.mirrored]
    return replace(
        case,
        members=tuple(groups),
        constraints=rows,
        optimizer=replace(case.optimizer, starts=1),
        shared=tuple(name for name in case.shared if name in names),
        mirrored=tuple(pair for pair in mirrored if len(pair) > 1),
        variables=variables,
    )


def kept_values(case: Case, kept: IndexArray) -> IndexArray:
    """Places among the values (P,) of variables, rising, of those that some member kept has; as `restricted`."""
    found = [places for _, places in _values(case, kept)]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.intp)


def _values(case: Case, kept: IndexArray) -> Iterator[tuple[Variable, IndexArray]]:
    """Each variable that has a group left, with only such groups, and the places of its values among all (P,)."""
    own = {group.name: places for group, places in with_own(case, kept)}
    first = 0
    for each in case.variables:
        left = [(name, law) for name, law in zip(each.groups, each.laws, strict=True) if len(own[name])]
        if left:
            places = own[left[0][0]] if each.each == "member" else np.zeros(1, dtype=np.intp)
            assert each.each != "member" or all(np.array_equal(own[name], places) for name, _ in left)
            names, laws = zip(*left, strict=True)
            yield replace(each, groups=names, laws=laws, count=len(places)), first + places
        first += each.count


def _variable(variable: Variable, places: IndexArray, values: FloatArray) -> Variable:
    mean = float(values[places].mean())
    return replace(variable, initial=min(max(mean, variable.lower), variable.upper))


def _row(row: VolumeRow, kept: IndexArray, groups: tuple[str, ...], variables: tuple[Variable, ...]) -> VolumeRow:
    own = prices(variables, groups) if len(row.prices) else row.prices
    return replace(row, groups=groups, coefficients=row.coefficients[kept], prices=own)


def places(case: Case, kept: IndexArray) -> list[tuple[str, int]]:
    """Of each design member at `kept`: the name of its group, and its place in it from 0."""
    return [(group.name, int(i)) for group, own in with_own(case, kept) if group.design for i in own]


def check(case: Case) -> None:
    """Refuse a case that has no one design. Raises CaseError."""
    if case.uncertainty is not None:
        _raise(case, [case.marks.mistake("uncertainty", "a case with uncertainty cannot be finalized")])


def check_restricted(case: Case, whole: Case, split: Iterable[str] = ()) -> None:
    """Refuse what the members kept cannot do. Raises CaseError with every reason.

    whole: the case with all its members; split: groups that were taken apart.
    """
    _raise(case, [case.marks.mistake(path, message) for path, message in _undone(case, whole, set(split))])


def _undone(case: Case, whole: Case, split: set[str]) -> Iterator[tuple[str, str]]:
    names = {group.name for group in case.members}

    def lost(group: str | None) -> str:
        if group in split:
            joined = [each.groups for each in whole.variables if each.each == "member" and group in each.groups]
            mirrored = f", with --set design.mirrored=[[{', '.join(joined[0])}]]" if joined else ""
            return (
                f"it looks at the members of {shown(str(group))}, of which others are kept than of the groups whose "
                f"values (`each: member`) they have: keep the same{mirrored}, or give these groups variables of their "
                "own and run again"
            )
        return "" if group in (None, *names) else _nobody(str(group))

    for objective in case.objectives:
        if message := next(filter(None, (lost(part.group) for part in objective.response.parts)), ""):
            yield f"objectives.{objective.name}", message
    upper = np.concatenate([case.upper, *(np.full(each.count, each.upper) for each in case.variables)])
    for i, row in enumerate(case.constraints):
        if not isinstance(row, VolumeRow):
            if message := next(filter(None, (lost(part.group) for part in row.response.parts)), ""):
                yield f"constraints[{i}]", message
            continue
        most = row.spent(upper)
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
