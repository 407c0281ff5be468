"""A finished front as parts of a result file, and how good it is."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.design_problem import sign_of
from mdstopo.plan.front_measures import REFERENCE, dominated, hypervolume, neighbour_gaps, repeated, scaled, spacing
from mdstopo.plan.front_plan import TOLERATED, Front
from mdstopo.plan.solve_task import Found
from mdstopo.status import RunStatus
from mdstopo.store.contents import Datasets

Floats = NDArray[np.float64]


def front_part(case: Case, directions: Floats, front: Front, tasks: Iterable[Found]) -> Datasets:
    """The datasets below `pareto/` of a finished front, by their paths."""
    w, m = directions.shape
    signs = np.array([sign_of(objective) for objective in case.objectives])
    objectives = np.full((w, m), np.nan)
    space = case.space
    designs = np.full((w, space.length), np.nan)
    numbers = {name: np.full(w, np.nan) for name in ("kkt", "violation", "seconds")}
    status, reason = ["running"] * w, ["not solved yet"] * w
    visited: dict[int, list[Floats]] = {}
    count = np.zeros(w, dtype=np.int64)
    # a point that asks for one objective alone is that objective's own optimum
    alone = {int(np.argmax(row)): j for j, row in enumerate(directions) if np.count_nonzero(row) == 1}
    for each in tasks:
        j = each.point if each.point >= 0 else alone.get(-1 - each.point, -1)
        if j >= 0:
            visited.setdefault(j, []).append(each.visited)
            count[j] += each.evaluations
    for j, point in enumerate(front.points):
        if point is None:
            continue
        status[j], reason[j] = point.status.value, point.reason
        objectives[j], designs[j] = point.objectives, space.expand(point.alpha)
        for name, column in numbers.items():
            column[j] = getattr(point, name)
        visited.setdefault(j, [point.visited])
    part: Datasets = {
        "weights": directions,
        "objectives": objectives,
        "alpha": designs[:, : space.n_alpha],
        "status": status,
        "reason": reason,
        "evaluations": count,
        "utopia": np.tile(front.utopia, (w, 1)),
        "maxima": np.tile(front.maxima, (w, 1)),
        "ends": np.array([end.objectives for end in front.ends]),
        "ends_alpha": np.array([space.expand(end.alpha)[: space.n_alpha] for end in front.ends]),
    }
    part |= {f"variables/{name}": values for name, values in space.named(designs).items()}
    part |= numbers
    part |= _further_part(case, front.further)
    beaten = _dominated(
        signs * np.concatenate([objectives, *(each.objectives[None] for each in front.further)]),
        np.concatenate([numbers["violation"], [each.violation for each in front.further]]),
        [*status, *[RunStatus.VISITED.value] * len(front.further)],
    )
    part["dominated"] = beaten[:w]
    if front.further:
        part["further/dominated"] = beaten[w:]
    part |= {f"visited/{j}": np.concatenate(rows) for j, rows in sorted(visited.items())}
    return {f"pareto/{name}": value for name, value in part.items()}


def _further_part(case: Case, further: Sequence[Found]) -> Datasets:
    """Designs that were visited and belong to the front, a row each; nothing where there are none."""
    if not further:
        return {}
    space = case.space
    designs = np.array([space.expand(each.alpha) for each in further])
    part: Datasets = {
        "objectives": np.array([each.objectives for each in further]),
        "alpha": designs[:, : space.n_alpha],
        "violation": np.array([each.violation for each in further]),
        "point": np.array([each.point for each in further], dtype=np.int64),
        "iterate": np.array([each.iterate for each in further], dtype=np.int64),
    }
    part |= {f"variables/{name}": values for name, values in space.named(designs).items()}
    return {f"further/{name}": value for name, value in part.items()}


def _dominated(signed: Floats, violation: Floats, status: list[str]) -> NDArray[np.bool_]:
    """What is beaten by another point that keeps the constraints, or keeps them not itself; not what is still open."""
    feasible = violation <= TOLERATED
    beaten = dominated(np.where(feasible[:, None], signed, np.nan))
    return np.asarray(beaten & (np.array(status) != "running"))


@dataclass(frozen=True)
class Quality:
    """How good a front is, in objectives scaled so that its best values are 0 and its worst are 1.

    ideal, nadir (m,): these values, raw; reference: the point up to which the hypervolume counts, scaled.
    """

    hypervolume: float
    spacing: float
    largest_gap: float
    ideal: Floats
    nadir: Floats
    reference: float = REFERENCE

    def numbers(self) -> dict[str, float]:
        """Those measures of the front that are single numbers, by their names."""
        return {"hypervolume": self.hypervolume, "spacing": self.spacing, "largest_gap": self.largest_gap}


def quality(case: Case, front: Front) -> Quality:
    """Of the front's points, further ones too, that keep the constraints and are not dominated, of the same ones the
    first."""
    signs = np.array([sign_of(objective) for objective in case.objectives])
    every = [*front.points, *front.further]
    good = [each for each in every if each is not None and each.usable and each.violation <= TOLERATED]
    points = signs * np.array([each.objectives for each in good]).reshape(len(good), len(signs))
    kept = points[~(dominated(points) | repeated(points))]
    if not len(kept):
        nothing = np.full(len(signs), np.nan)
        return Quality(0.0, 0.0, 0.0, nothing, nothing)
    ideal, nadir = kept.min(axis=0), kept.max(axis=0)
    inside = scaled(kept, ideal, nadir)
    volume = hypervolume(inside, np.full(len(signs), REFERENCE))
    gaps = neighbour_gaps(inside)
    return Quality(volume, spacing(inside), float(gaps.max(initial=0.0)), signs * ideal, signs * nadir)
