"""Tables of the page: objectives and constraints, members as parts, peaks of responses."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.design.stages import stage_count
from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import Case
from mdstopo.case.responses.response_units import constrained, unit_of_bound, unit_of_value
from mdstopo.limiting.compare import kept_iterates, of_last_stage, violations
from mdstopo.plots.member_forces import Chosen, forces_of
from mdstopo.plots.scenery import Floats
from mdstopo.plots.source import Source
from mdstopo.starts.constraint_columns import exceeded
from mdstopo.store.result_reader import ResultView

#: samples between the neighbours of the largest sample, to find a peak; members that are listed
FINE, LISTED = 41, 300
#: of a bound: what is nearer to it is on it
ON_BOUND = 1e-12


def best_iterate(source: Source) -> int | None:
    """Which iterate of a run is the design of the file: the best that keeps the limits, else the one that breaks them
    least.

    None where it is no iterate: of a run that was stopped while sizes were chosen.
    """
    view, case = source.view, source.case
    if view.kind != "run" or "iterations/combined" not in view.arrays or _among_sizes(case, view):
        return None
    combined = np.asarray(view.array("iterations/combined"), dtype=np.float64)
    kept = kept_iterates(case, view)
    usable = kept & np.isfinite(combined)
    if usable.any():
        return int(np.where(usable, combined, np.inf).argmin())
    broken = np.where(of_last_stage(case, view) & np.isfinite(combined), violations(case, view), np.nan)
    if np.isfinite(broken).any():
        return int(np.nanargmin(broken))
    return len(combined) - 1 if len(combined) else None


def _among_sizes(case: Case, view: ResultView) -> bool:
    """Whether a file has the best sizes so far of a choice that has not come to its end."""
    best = view.arrays.get("catalogue/search/x")
    if best is None or not np.isfinite(best).all():
        return False
    return int(view.array("iterations/stage").max()) < stage_count(case)


def objective_rows(source: Source) -> list[dict[str, Any]]:
    """Start and best value of every objective of a run; empty for other files."""
    best = best_iterate(source)
    if best is None:
        return []
    values = np.asarray(source.view.array("iterations/objectives"), dtype=np.float64)
    objectives = {each.name: each for each in source.case.objectives}
    return [
        {"name": name, "unit": unit_of_value(objectives[name]), "start": float(values[0, i]),
         "best": float(values[best, i]), "sense": objectives[name].sense}
        for i, name in enumerate(source.names)
    ]  # fmt: skip


def constraint_rows(source: Source) -> list[dict[str, Any]]:
    """Every constraint of a run: what, its bound, the values at the start and of the design, and the margin.

    margin: how far the value may still go, positive where the constraint is kept with room, in its own unit.
    """
    best = best_iterate(source)
    if best is None or not source.case.constraints:
        return []
    excess = np.asarray(source.view.array("iterations/constraints"), dtype=np.float64)
    found = []
    for i, row in enumerate(source.case.constraints):
        start, end = float(excess[0, i]), float(excess[best, i])
        if abs(end) <= ON_BOUND * abs(row.bound):
            end = 0.0
        margin = -float(exceeded(row.sense, np.array(end)))
        found.append(
            {"what": constrained(source.case, row), "sense": row.sense, "bound": float(row.bound),
             "unit": unit_of_bound(row), "start": start + row.bound, "best": end + row.bound, "margin": margin}
        )  # fmt: skip
    return found


def peak_of(
    over_time: str, times: Floats, values: Floats, at: Callable[[Floats], Floats]
) -> tuple[float, float] | None:
    """(time, value) of the peak of a response; None of what is not that of a moment.

    over_time: how it becomes a number.
    times, values (T,): samples.
    at (t,): the response at other times.
    """
    reduction = REDUCTIONS[over_time]
    if reduction.at_end:
        return float(times[-1]), float(values[-1])
    if not reduction.signs or not np.isfinite(values).all():
        return None
    signs = np.array(reduction.signs)[:, None]
    k = int((signs * values).max(axis=0).argmax())
    fine = np.linspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], FINE)
    there = at(fine)
    j = int((signs * there).max(axis=0).argmax())
    return float(fine[j]), float(there[j])


def member_peaks(source: Source, design: Floats, kept: Chosen, motions: dict[str, Any]) -> list[dict[str, Any]] | None:
    """Of the chosen members (K,): the largest |f*|, with its sign, time and load case.

    motions: of each load case times (T,) and the states there.

    None where forces cannot be told from states.
    """
    count = sum(len(chosen) for _, chosen in kept)
    force, time, case_of = np.zeros(count), np.zeros(count), np.zeros(count, dtype=int)
    names = list(motions)
    for number, name in enumerate(names):
        times, states = motions[name]
        found = forces_of(source.case, design, kept, states.q, states.v)
        if found is None or not len(found):
            return None
        k = np.abs(found).argmax(axis=0)
        own = found[k, np.arange(count)]
        larger = np.abs(own) > np.abs(force)
        force, time = np.where(larger, own, force), np.where(larger, times[k], time)
        case_of = np.where(larger, number, case_of)
    return [
        {"force": float(f), "time": float(t), "load_case": names[n]}
        for f, t, n in zip(force, time, case_of.tolist(), strict=True)
    ]


def parts(source: Source, design: Floats, kept: Chosen, peaks: list[dict[str, Any]] | None) -> list[dict[str, Any]]:
    """Members as a list of parts, the largest force first, or the largest design value; at most LISTED."""
    case, found = source.case, []
    slices = case.group_slices
    k = 0
    for group, chosen in kept:
        alpha = design[slices[group.name]][chosen] if group.design else np.ones(len(chosen))
        for i, size in zip(chosen.tolist(), alpha.tolist(), strict=True):
            p, q = group.from_index[i], group.to_index[i]
            found.append(
                {"group": group.name, "member": i, "from": group.body_from, "p": group.from_world[p].tolist(),
                 "to": group.body_to, "q": group.to_world[q].tolist(), "length": float(group.length[i]),
                 "size": size if group.design else None, **(peaks[k] if peaks is not None else {})}
            )  # fmt: skip
            k += 1
    found.sort(key=lambda part: -abs(part.get("force", part["size"] or 0.0)))
    return found[:LISTED]
