"""What differs between two results: case, objectives, constraints, design."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.model import Case
from mdstopo.case.text.words import inside
from mdstopo.finalize.document import content_of
from mdstopo.plots.scenery import Floats
from mdstopo.plots.source import Source
from mdstopo.report.report_tables import constraint_rows, objective_rows
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
    only_second: how many the other case has not.

    largest: the largest change of alpha, and whose it is.
    """

    common: int = 0
    changed: int = 0
    appeared: int = 0
    vanished: int = 0
    only_first: int = 0
    only_second: int = 0
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
    return Difference(
        _keys(first.case, second.case),
        _outcome(first, second),
        _values(_objectives(first), _objectives(second)),
        _values(_constraints(first), _constraints(second)),
        _designs(first, second),
    )


def _keys(first: Case, second: Case) -> list[Pair]:
    """Keys whose values differ, in the order of the files; included files by their hashes."""
    one, other = (content_of(replace(case, files=FrozenDict())) for case in (first, second))
    found = _unlike(one, other, "")
    files = dict.fromkeys([*first.files, *second.files])
    pairs = [Pair(f"file {name}", first.files.get(name), second.files.get(name)) for name in files]
    return found + [pair for pair in pairs if pair.first != pair.second]


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
        own |= {key: value for key, value in view.settings.items() if not key.startswith("set ")}
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


def members_of(source: Source) -> dict[tuple[Any, ...], tuple[float, float, str]]:
    """Design members by bodies, ends and their number there: alpha, its share of the range, and what it is called."""
    case = source.case
    found: dict[tuple[Any, ...], tuple[float, float, str]] = {}
    times: Counter[tuple[Any, ...]] = Counter()
    design = source.alpha
    for group in case.design_groups:
        part = design[case.group_slices[group.name]]
        width = group.upper - group.lower
        for i, (p, q) in enumerate(zip(group.from_index.tolist(), group.to_index.tolist(), strict=True)):
            ends = (group.body_from, group.body_to, *_near(group.from_world[p]), *_near(group.to_world[q]))
            key = (*ends, times[ends])
            times[ends] += 1
            share = (part[i] - group.lower) / width if width > 0.0 else 1.0
            found[key] = (float(part[i]), float(share), f"{group.name} {i}")
    return found


def _near(place: Floats) -> tuple[float, ...]:
    return tuple(float(f"{value:.9g}") for value in place.tolist())


def _designs(first: Source, second: Source) -> Designs | None:
    try:
        one, other = members_of(first), members_of(second)
    except StoreError:
        return None  # a file without a design
    common = [key for key in one if key in other]
    changes = np.array([other[key][0] - one[key][0] for key in common])
    k = int(np.abs(changes).argmax()) if len(changes) else 0
    return Designs(
        common=len(common),
        changed=int((np.abs(changes) > CHANGED).sum()),
        appeared=sum(one[key][1] <= ABSENT and other[key][1] >= THERE for key in common),
        vanished=sum(one[key][1] >= THERE and other[key][1] <= ABSENT for key in common),
        only_first=len(one) - len(common),
        only_second=len(other) - len(common),
        largest=(float(changes[k]), one[common[k]][2]) if len(changes) else None,
    )
