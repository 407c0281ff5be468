"""What differs between two results: case, objectives, constraints, design."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.model import Case
from mdstopo.case.text.words import inside
from mdstopo.finalize.document import content_of
from mdstopo.plots.same_members import family, same_members
from mdstopo.plots.scenery import Floats
from mdstopo.plots.source import Source
from mdstopo.report.report_tables import constraint_rows, objective_rows
from mdstopo.store.set_keys import without_set_keys
from mdstopo.store.store_errors import StoreError

#: change of alpha that counts; shares of the range from which on a member is there, and below which it is not
CHANGED, THERE, ABSENT = 1e-6, 0.9, 0.1


@dataclass(frozen=True)
class Pair:
    """A value in both results; None where one has it not."""

    name: str
    first: Any
    second: Any


@dataclass(frozen=True)
class Designs:
    """Two designs, member by member: how many both have, how many of these changed, appeared, vanished; only_first,
    only_second: how many the other case has not; members_first, members_second: which these are, in words.

    largest: the largest change of alpha, and whose it is.
    """

    common: int = 0
    changed: int = 0
    appeared: int = 0
    vanished: int = 0
    only_first: int = 0
    only_second: int = 0
    members_first: list[str] = field(default_factory=list)
    members_second: list[str] = field(default_factory=list)
    largest: tuple[float, str] | None = None


@dataclass(frozen=True)
class Difference:
    """How two results differ. case: keys that differ; outcome: status and such; objectives, constraints: values;
    designs: None without any."""

    case: list[Pair] = field(default_factory=list)
    outcome: list[Pair] = field(default_factory=list)
    objectives: list[Pair] = field(default_factory=list)
    constraints: list[Pair] = field(default_factory=list)
    designs: Designs | None = None

    @property
    def is_none(self) -> bool:
        """Whether the two results do not differ in anything."""
        same = all(
            pair.first == pair.second for pair in (*self.case, *self.outcome, *self.objectives, *self.constraints)
        )
        own = self.designs
        return same and (own is None or not (own.changed or own.only_first or own.only_second))


def difference(first: Source, second: Source) -> Difference:
    """The differences between two results."""
    same = same_members(first.case, second.case)
    return Difference(
        _keys(first.case, second.case, same),
        _outcome(first, second),
        _values(_objectives(first), _objectives(second)),
        _values(_constraints(first), _constraints(second)),
        _designs(first, second, same),
    )


def _keys(first: Case, second: Case, same: list[tuple[int, int]]) -> list[Pair]:
    """Keys whose values differ, in the order of the files; included files by their hashes.

    same: which members are the same. Single members of final designs go by the names that they have in the first.
    """
    one, other = (content_of(replace(case, files=FrozenDict())) for case in (first, second))
    found = _unlike(one, _renamed(other, _names_in_first(first, second, same)), "")
    files = dict.fromkeys([*first.files, *second.files])
    pairs = [Pair(f"file {name}", first.files.get(name), second.files.get(name)) for name in files]
    return found + [pair for pair in pairs if pair.first != pair.second]


def _names_in_first(first: Case, second: Case, same: list[tuple[int, int]]) -> dict[str, str]:
    """By name in the second case what each single member of a final design is called in the first; where it is not
    there and its name is that of another member, that name and words that tell them apart."""
    singles = [_singles(case) for case in (first, second)]
    partners = {singles[1][k]: singles[0][i] for i, k in same if i in singles[0] and k in singles[1]}
    own = set(singles[0].values())
    clashing = {name: f"{name} of the second" for name in singles[1].values() if name in own}
    return clashing | partners


def _singles(case: Case) -> dict[int, str]:
    """Names of groups that are single members of a final design, by the numbers of these among all members."""
    firsts = np.cumsum([0, *(len(group) for group in case.members)]).tolist()
    every = zip(firsts, case.members, strict=False)
    return {k: group.name for k, group in every if len(group) == 1 and family(group.name) != group.name}


def _renamed(content: Any, names: Mapping[str, str]) -> Any:
    """Plain values with these names as others, where they are keys or values."""
    if isinstance(content, Mapping):
        return {names.get(key, key): _renamed(value, names) for key, value in content.items()}
    if isinstance(content, list):
        return [_renamed(each, names) for each in content]
    return names.get(content, content) if isinstance(content, str) else content


def _unlike(first: Any, second: Any, path: str) -> list[Pair]:
    """Where two documents differ; what only one has is told once, at its top."""
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        found = []
        for key in dict.fromkeys([*first, *second]):
            here = inside(path, str(key)) if path else str(key)
            if key in first and key in second:
                found += _unlike(first[key], second[key], here)
            else:
                found.append(Pair(here, first.get(key), second.get(key)))
        return found
    nested = all(isinstance(each, list) and any(isinstance(part, Mapping) for part in each) for each in (first, second))
    if nested and len(first) == len(second):
        both = enumerate(zip(first, second, strict=True))
        return [pair for k, (one, other) in both for pair in _unlike(one, other, f"{path}[{k}]")]
    return [] if first == second else [Pair(path, first, second)]


def _outcome(first: Source, second: Source) -> list[Pair]:
    """Command, status, iterations, settings and versions that differ."""
    told = []
    for source in (first, second):
        view = source.view
        rows = view.arrays.get("iterations/combined")
        own: dict[str, Any] = {"made by": view.kind, "status": view.status}
        own |= {} if rows is None else {"iterations": len(rows) - 1}
        own |= without_set_keys(view.settings)
        own |= {key: view.provenance.get(key) for key in ("mdstopo", "numpy", "numba", "platform")}
        told.append(own)
    names = list(dict.fromkeys([*told[0], *told[1]]))
    pairs = [Pair(name, told[0].get(name), told[1].get(name)) for name in names]
    return [pair for pair in pairs if pair.first != pair.second]


def _objectives(source: Source) -> dict[str, float]:
    rows = {f"{row['name']}, {row['unit']}": float(row["best"]) for row in objective_rows(source)}
    return rows


def _constraints(source: Source) -> dict[str, float]:
    return {row["what"]: float(row["best"]) for row in constraint_rows(source)}


def _values(first: dict[str, float], second: dict[str, float]) -> list[Pair]:
    return [Pair(name, first.get(name), second.get(name)) for name in dict.fromkeys([*first, *second])]


def _designs(first: Source, second: Source, same: list[tuple[int, int]]) -> Designs | None:
    try:
        one, other = _members(first), _members(second)
    except StoreError:
        return None  # a file without a design
    common = [(i, k) for i, k in same if i in one and k in other]
    changes = np.array([other[k].alpha - one[i].alpha for i, k in common])
    most = int(np.abs(changes).argmax()) if len(changes) else 0
    firsts, seconds = {i for i, _ in common}, {k for _, k in common}
    alone = [member.words for i, member in one.items() if i not in firsts]
    others = [member.words for k, member in other.items() if k not in seconds]
    return Designs(
        common=len(common),
        changed=int((np.abs(changes) > CHANGED).sum()),
        appeared=sum(one[i].share <= ABSENT and other[k].share >= THERE for i, k in common),
        vanished=sum(one[i].share >= THERE and other[k].share <= ABSENT for i, k in common),
        only_first=len(alone),
        only_second=len(others),
        members_first=alone,
        members_second=others,
        largest=(float(changes[most]), one[common[most][0]].name) if len(changes) else None,
    )


class _Member(NamedTuple):
    """A design member: alpha, its share of the range, what it is called, and where it is."""

    alpha: float
    share: float
    name: str
    where: str

    @property
    def words(self) -> str:
        return f"{self.name}: {self.where}"


def _members(source: Source) -> dict[int, _Member]:
    """Design members by their numbers among all members."""
    case, design = source.case, source.alpha
    found: dict[int, _Member] = {}
    first = 0
    for group in case.members:
        part = design[case.group_slices[group.name]] if group.design else np.zeros(0)
        width = group.upper - group.lower
        for i, alpha in enumerate(part.tolist()):
            share = (alpha - group.lower) / width if width > 0.0 else 1.0
            ends = (
                _end(group.body_from, group.from_world[group.from_index[i]]),
                _end(group.body_to, group.to_world[group.to_index[i]]),
            )
            name = group.name if len(group) == 1 else f"{group.name} {i}"
            found[first + i] = _Member(alpha, share, name, " to ".join(ends))
        first += len(group)
    return found


def _end(body: str, place: Floats) -> str:
    return f"{body} ({', '.join(f'{value + 0.0:.4g}' for value in place.tolist())})"
