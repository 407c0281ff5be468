"""Fronts: how good for how much work, a genetic algorithm beside it, and what a second process is worth."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.genetic import POPULATION, genetic
from benchmarks.scenes import BEST_KNOWN, CASES, IDEAL, NADIR
from mdstopo import Case, load_case
from mdstopo.bench.tables import Table, significant, verdict
from mdstopo.front.directions import weights_of_first
from mdstopo.front.run_front import Ask, FrontOutcome, run_front
from mdstopo.plan.front_measures import REFERENCE, dominated, hypervolume, neighbour_gaps, scaled

Floats = NDArray[np.float64]

POINTS = 21
#: seconds that the genetic algorithm is given
GENETIC = 60.0
#: members joining this many points with as many; of a front that takes long enough to be shared
LARGE, LARGE_POINTS, RATIO = 316, 9, 0.6
#: Eq. 23 and the two methods that spread points evenly: least share, most evaluations, largest gap
BARS = {
    "weighted_exponential": (0.95, POINTS * 60, None),
    "nbi": (0.985, POINTS * 40, 0.12),
    "nc": (None, None, None),
}


@dataclass(frozen=True)
class Scale:
    """How hypervolume is measured on a scene."""

    ideal: Floats
    nadir: Floats
    whole: float

    def share(self, points: Floats) -> float:
        """Of the best front's hypervolume."""
        return hypervolume(scaled(points, self.ideal, self.nadir), np.full(2, REFERENCE)) / self.whole

    def gap(self, points: Floats) -> float:
        """The largest between neighbours on the front."""
        placed = scaled(points, self.ideal, self.nadir)
        gaps = neighbour_gaps(placed[~dominated(placed)])
        return float(gaps.max()) if len(gaps) else float("nan")


def fronts() -> Iterator[Table]:
    """Two tables."""
    case = load_case(CASES / "fig7.yaml")
    stiff = load_case(CASES / "fig7.yaml", overrides=_stiff())
    yield Table(
        f"Fronts of cases/fig7.yaml, {POINTS} points",
        ("scene", "front", "evaluations", "seconds", "hypervolume", "largest gap", "violation", "bar", "met"),
        [*_rows("volume spent", case, Scale(IDEAL, NADIR, BEST_KNOWN)), *_rows("stiff", stiff, _own_scale(stiff))],
        (
            f"Hypervolume is relative to the best front known ({BEST_KNOWN} of {REFERENCE**2:.2f}; objectives scaled "
            f"to {tuple(IDEAL.tolist())} and {tuple(NADIR.tolist())}, reference point {REFERENCE}); of the stiff "
            "variant (ten times the stiffness, volume at most 102) to that of nbi with 41 points and 4 starts, scaled "
            "to its ideal and the nadir of nbi with 21. "
            "Designs that were visited and belong to the front count. "
            f"NSGA-II of pymoo has {POPULATION} designs, is moved onto the volume row, and computes no gradients. "
            "One process, from a cold start.",
        ),
    )
    large = load_case(CASES / "fig7.yaml", overrides=_large())
    yield Table(
        "A second process",
        ("front", "members", "evaluations", "one process, s", "two, s", "ratio", "bar", "met"),
        [_shared("large", large, LARGE_POINTS, RATIO), _shared("cases/fig7.yaml", case, POINTS, None)],
        (
            "`two`: two processes are allowed, and started where the work is worth it. The large front stops every "
            "solve after 12 iterations.",
        ),
    )


def _stiff() -> dict[str, object]:
    return {"members.belts.law.stiffness": 2250, "constraints": [{"volume": "all", "limit": 102}]}


def _large() -> dict[str, object]:
    """The bodies of the case joined by 1e5 members that are as stiff together."""
    count = LARGE
    return {
        "points.torso_edge.grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], "count": count}},
        "points.frame_edge.grid": {"line": {"from": [-0.8, -1], "to": [0.8, -1], "count": count}},
        "members.belts.law.stiffness": 225 * 1020 / count**2,
        "constraints": [{"volume": "all", "equals": round(0.1 * count**2)}],
        "optimizer.max_iterations": 12,
    }


def _rows(scene: str, case: Case, scale: Scale) -> Iterator[list[str]]:
    for method, (least, most, gap) in BARS.items():
        outcome = run_front(case, Ask(_even(POINTS), method), workers=1)
        points = _points(outcome)
        share, widest = scale.share(points), scale.gap(points)
        bars, met = [], True
        if scene == "volume spent" and least is not None and most is not None:
            bars = [f"{100 * least:g} % within {most}"]
            met = share >= least and outcome.evaluations <= most
            if gap is not None:
                bars.append(f"gap {gap:g}")
                met = met and widest <= gap
        assert outcome.front is not None
        violation = max(point.violation for point in outcome.front.points if point is not None)
        yield [
            scene,
            method,
            str(outcome.evaluations),
            significant(outcome.seconds),
            f"{100 * share:.2f} %",
            f"{widest:.3f}",
            f"{violation:.0e}",
            ", ".join(bars),
            verdict(met) if bars else "",
        ]
    values, evaluations = genetic(case, GENETIC)
    yield [
        scene, "NSGA-II", str(evaluations), significant(GENETIC), f"{100 * scale.share(values):.2f} %",
        f"{scale.gap(values):.3f}", "", "", "",
    ]  # fmt: skip


def _own_scale(case: Case) -> Scale:
    """From the best front that much work finds, and the ends that a cold start finds."""
    best = _points(run_front(case, Ask(_even(41), "nbi", 4)))
    cold = _points(run_front(case, Ask(_even(POINTS), "nbi")))
    ideal, nadir = best.min(axis=0), cold[~dominated(cold)].max(axis=0)
    return Scale(ideal, nadir, hypervolume(scaled(best, ideal, nadir), np.full(2, REFERENCE)))


def _shared(name: str, case: Case, points: int, bar: float | None) -> list[str]:
    seconds = []
    evaluations = 0
    for workers in (1, 2):
        began = time.perf_counter()
        evaluations = run_front(case, Ask(_even(points), "nbi"), workers=workers).evaluations
        seconds.append(time.perf_counter() - began)
    ratio = seconds[1] / seconds[0]
    return [
        name, str(case.n_design), str(evaluations), significant(seconds[0]), significant(seconds[1]), f"{ratio:.2f}",
        f"at most {bar}" if bar is not None else "about 1", verdict(ratio <= (bar or 1.1)),
    ]  # fmt: skip


def _even(count: int) -> Floats:
    return weights_of_first(np.linspace(0.0, 1.0, count).tolist())


def _points(outcome: FrontOutcome) -> Floats:
    assert outcome.front is not None, outcome.reason
    points = [point.objectives for point in outcome.front.points if point is not None]
    return np.array([*points, *(each.objectives for each in outcome.front.further)])
