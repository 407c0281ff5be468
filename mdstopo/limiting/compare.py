"""Bounds beside the best that a result file holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.arrays import FloatArray
from mdstopo.case.design.stages import stage_count
from mdstopo.case.model import Case
from mdstopo.limiting.bounds import Bound, bounds
from mdstopo.starts.constraint_columns import relative_violations
from mdstopo.store.store_errors import StoreError
from mdstopo.store.whole_front import whole_front

if TYPE_CHECKING:
    from mdstopo.store.result_reader import ResultView

#: excess over a limit, relative to it, up to which a design counts as keeping it
TOLERATED = 1e-6


@dataclass(frozen=True)
class Compared:
    """The bound of an objective beside the best value that a run has reached.

    best: the best value among the designs in a result that keep all limits, None where there is none. gap: how far it
    is from the bound, as a share of it; 0 at the bound; None where either is missing.
    """

    bound: float | None
    why: str
    best: float | None = None
    gap: float | None = None


def compared(
    case: Case, view: ResultView | None = None, found: Mapping[str, Bound] | None = None
) -> dict[str, Compared]:
    """The bounds of a case's objectives by name, beside a result's best. found: the bounds, where they are known.

    Raises StoreError where the result has other objectives, or is of no optimisation.
    """
    found = bounds(case) if found is None else found
    if view is None:
        return {name: Compared(each.value, each.why) for name, each in found.items()}
    best = _best(case, view)
    signs = {each.name: -1.0 if each.sense == "maximize" else 1.0 for each in case.objectives}
    return {
        name: Compared(each.value, each.why, best[name], gap(each.value, best[name], signs[name]))
        for name, each in found.items()
    }


def gap(bound: float | None, best: float | None, sign: float = 1.0) -> float | None:
    """(best - bound) / |best|, of a largest value (sign -1) with the signs turned."""
    if bound is None or best is None:
        return None
    if best == bound:
        return 0.0
    return sign * (best - bound) / abs(best) if best != 0.0 else None


def _best(case: Case, view: ResultView) -> dict[str, float | None]:
    """The best value of every objective among the designs of a run or a front that keep the limits."""
    names = tuple(each.name for each in case.objectives)
    if view.lines("objectives") != names:
        there = ", ".join(view.lines("objectives")) or "none"
        raise StoreError(f"{view.path}: its objectives are {there}; the case has {', '.join(names) or 'none'}")
    if "iterations/objectives" in view.arrays:
        values, good = view.array("iterations/objectives"), kept_iterates(case, view)
    elif "pareto/objectives" in view.arrays:
        front = whole_front(view)
        values = front["objectives"]
        good = np.asarray(front["violation"], dtype=np.float64) <= TOLERATED
        good &= np.array([word != "failed" for word in front["status"]], dtype=np.bool_)
    else:
        raise StoreError(f"{view.path}: was made by `{view.kind}`; bounds are compared with a run or a front")
    table = np.asarray(values, dtype=np.float64)
    result: dict[str, float | None] = {}
    for i, objective in enumerate(case.objectives):
        own = table[good, i]
        own = own[np.isfinite(own)]
        most = objective.sense == "maximize"
        result[objective.name] = None if not len(own) else float(own.max() if most else own.min())
    return result


def violations(case: Case, view: ResultView) -> FloatArray:
    """(K + 1,) by how much each iterate exceeds the limit that it breaks most, relative to the bound; at most 0 where
    it keeps all."""
    values = np.asarray(view.array("iterations/constraints"), dtype=np.float64)
    return np.asarray(relative_violations(case, values).max(axis=1, initial=-np.inf))


def of_last_stage(case: Case, view: ResultView) -> NDArray[np.bool_]:
    """(K + 1,) which iterates have the powers of the last stage, or the sizes chosen."""
    if "iterations/stage" not in view.arrays:
        return np.ones(len(view.array("iterations/constraints")), dtype=np.bool_)
    stage = np.asarray(view.array("iterations/stage"))
    found: NDArray[np.bool_] = stage == max(stage_count(case) - 1, stage.max(initial=0))
    return found


def kept_iterates(case: Case, view: ResultView) -> NDArray[np.bool_]:
    """(K + 1,) which iterates keep all limits, with the powers of the last stage, or with the sizes chosen."""
    return of_last_stage(case, view) & (violations(case, view) <= TOLERATED)
