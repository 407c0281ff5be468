"""Volume rows (Eq. 14): what variables add to them, and whether they can be met within the bounds."""

from __future__ import annotations

import math

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.model import MemberGroup, Variable, VolumeRow
from mdstopo.case.scene.candidates import most_cost
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import listed, number_text

ROUNDING = 1e-12
"""Sums are compared up to this share of them: 1020 x 0.001 may be spent exactly."""


def prices(variables: tuple[Variable, ...], groups: tuple[str, ...]) -> FloatArray:
    """(P,) what the values of variables add to a volume row over some groups; none where there are no variables."""
    pieces = [np.full(v.count, v.cost if {*v.groups, *v.reached} & set(groups) else 0.0) for v in variables]
    return np.concatenate(pieces) if pieces else np.zeros(0)


def check_feasible(
    rows: list[tuple[str, VolumeRow]], design: list[MemberGroup], variables: tuple[Variable, ...], reading: Reading
) -> None:
    """Note volume rows that no design within the bounds keeps, alone or together with one other row.

    The sum over a group can be anything between those at its bounds, whatever other groups do: so a row, and
    a pair of rows, can be judged from the groups' sums alone. What variables cost counts as a group of its own.
    """
    low = {g.name: _sum(g, g.lower) if g.candidates is None else 0.0 for g in design}
    high = {g.name: _sum(g, g.upper) for g in design}
    priced = [each for each in variables if each.cost > 0.0]
    for each in priced:  # no group has a name with a blank
        low[f"variable {each.name}"] = each.cost * each.lower * each.count
        high[f"variable {each.name}"] = each.cost * each.upper * each.count
    covered = {path: _covered(row, low, priced) for path, row in rows}
    alone: set[str] = set()
    for path, row in rows:
        least, most = _total(low, covered[path]), _total(high, covered[path])
        slack = ROUNDING * max(abs(least), abs(most), abs(row.bound))
        if row.sense != "at_least" and row.bound < least - slack:
            why = f"at the lower bounds the sum is {number_text(least)} already"
            reading.mistake(path, f"found the bound {number_text(row.bound)}; {why}")
            alone.add(path)
        elif row.sense != "limit" and row.bound > most + slack:
            why = f"at the upper bounds the sum is only {number_text(most)}"
            reading.mistake(path, f"found the bound {number_text(row.bound)}; {why}")
            alone.add(path)
    for path, row in rows:
        for other_path, other in rows:
            if row is other or row.sense == "at_least" or other.sense == "limit":
                continue
            if path in alone or other_path in alone:
                continue
            most = _most_beside(row.bound, covered[path], covered[other_path], low, high)
            if other.bound > most + ROUNDING * max(abs(most), abs(other.bound), abs(row.bound)):
                reading.mistake(
                    other_path,
                    f"found the bound {number_text(other.bound)}; with the row at {path} the sum over "
                    f"{listed(other.groups)} reaches only {number_text(most)}",
                )
                alone.add(other_path)


def _sum(group: MemberGroup, value: float) -> float:
    if group.candidates is not None:  # at most: how many of them the lengths leave is not known yet
        return value * group.candidates.count * most_cost(group)
    return value * math.fsum(group.cost.tolist()) if len(group) <= 10**5 else value * float(group.cost.sum())


def _total(sums: dict[str, float], names: tuple[str, ...]) -> float:
    return math.fsum(sums[name] for name in names)


def _covered(row: VolumeRow, known: dict[str, float], priced: list[Variable]) -> tuple[str, ...]:
    """The groups and variables that a row sums up."""
    groups = [name for name in row.groups if name in known]
    return (*groups, *(f"variable {each.name}" for each in priced if {*each.groups, *each.reached} & set(row.groups)))


def _most_beside(
    bound: float, own: tuple[str, ...], others: tuple[str, ...], low: dict[str, float], high: dict[str, float]
) -> float:
    """The largest sum over `others` while that over `own` is at most its bound."""
    both = tuple(name for name in others if name in own)
    rest = tuple(name for name in others if name not in own)
    beside = tuple(name for name in own if name not in others)
    return min(_total(high, both), bound - _total(low, beside)) + _total(high, rest)
