"""Parameters of laws that are design variables: the values that a design gives them, and laws with these values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.design.volume import ROUNDING
from mdstopo.case.model import Case, Law, MemberGroup, VolumeRow

#: place of the law in its group -> parameter -> value
Given = Mapping[int, Mapping[str, float]]


@dataclass(frozen=True)
class Parameter:
    """A value of a variable that a member kept has, before and now, in its unit.

    member: the place of the member in its group; None where all members have one value.
    """

    name: str
    member: int | None
    unit: str
    before: float
    value: float


def changed_parameters(case: Case, places: IndexArray, before: FloatArray, values: FloatArray) -> list[Parameter]:
    """Parameters by their names and members.

    places (V,): of the values among all (P,) of the case. before, values (V,): the values before and now.
    """
    found: list[Parameter] = []
    rows = list(zip(places.tolist(), before.tolist(), values.tolist(), strict=True))
    first = 0
    for each in case.variables:
        found += [
            Parameter(each.name, place - first if each.each == "member" else None, each.unit, old, new)
            for place, old, new in rows
            if first <= place < first + each.count
        ]
        first += each.count
    return found


def differ(case: Case, group: MemberGroup) -> bool:
    """Whether members of a group have values of their own."""
    return len(group) > 1 and any(each.each == "member" and group.name in each.groups for each in case.variables)


def given(case: Case, group: MemberGroup, i: int, values: FloatArray) -> Given:
    """The values that the variables of a case, at values (P,), give to the law of member `i` of a group."""
    found: dict[int, dict[str, float]] = {}
    first = 0
    for each in case.variables:
        for name, place in zip(each.groups, each.laws, strict=True):
            if name == group.name:
                value = float(values[first + (i if each.each == "member" else 0)])
                found.setdefault(place, {})[each.parameter] = value
        first += each.count
    return found


def with_values(laws: tuple[Law, ...], values: Given) -> list[Law]:
    """The laws with these parameters."""
    return [replace(law, **values.get(place, {})) for place, law in enumerate(laws)]


def with_valid_times(stated: dict[str, Any], case: Case) -> dict[str, Any]:
    """A law as the file states it, with times that the reader takes.

    A law whose `active_until` is not after its `active_from` never acts; it is stated to begin after the end of the
    motion.
    """
    begin, until = stated.get("active_from"), stated.get("active_until")
    if begin is None or until is None or isinstance(begin, str) or isinstance(until, str) or begin < until:
        return stated
    after = max(begin, *(each.end for each in case.load_cases))
    return {key: value for key, value in (stated | {"active_from": after}).items() if key != "active_until"}


def bound_of(row: VolumeRow, n: int, design: FloatArray) -> float:
    """The bound of a volume row on alpha (n,) alone, where the variables behind alpha have become numbers: the bound
    less what these cost."""
    if not len(row.prices):
        return row.bound
    left = row.bound - float(row.prices @ design[n:])
    own = float(row.coefficients @ design[:n])
    # a row that was met with equality, up to rounding, stays so: beside a small rest that rounding may be large
    return own if abs(own - left) <= ROUNDING * max(abs(row.bound), abs(own)) else left
