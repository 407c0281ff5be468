"""What the optimiser reaches, and within how many evaluations.

An evaluation is one design at which the objectives are computed: the first one and rejected ones count.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from statistics import fmean

import numpy as np

from benchmarks.scenes import CASES
from mdstopo import Result, load_case, optimize
from mdstopo.bench.tables import Table, verdict


@dataclass(frozen=True)
class Bar:
    """One problem. value: to be reached within so many evaluations (None: at the end)."""

    case: str
    value: float
    evaluations: int | None
    starts: int = 1
    overrides: dict[str, object] = field(default_factory=dict)


REACH = (
    Bar("fig6", 6.95, 50),
    Bar("fig7-g1", 16.65, 40),
    Bar("fig7-g2", 39.9, 40),
    Bar("fig6-stiff", 5.08, 150),
    Bar("fig7-g1-stiff", 11.28, 30),
    Bar("fig7-g2-stiff", 10.90, 20),
    Bar("fig6", 5.98, None, starts=8),
    Bar("fig7-g2", 35.7, None, starts=8),
)

_OC = {"optimizer.preset": "oc", "optimizer.max_iterations": 50}
PRESETS = (
    ("exact gradients", 35.0, dict(_OC)),
    ("`constant_load`", 38.9, {**_OC, "solver.sensitivity": "constant_load"}),
)


def bars() -> Iterator[Table]:
    """Two tables: values to be reached, and the optimality-criteria preset against known values."""
    yield Table(
        "What the optimiser reaches",
        ("case", "starts", "from", "to", "evaluations", "bar", "within", "reached after", "met"),
        [_row(bar) for bar in REACH],
        (
            "`to` is the best value at the end, of all starts; `reached after` counts evaluations until the bar "
            "was met. With several starts the count is that of all of them.",
        ),
    )
    rows = []
    for name, known, overrides in PRESETS:
        result = optimize(load_case(CASES / "fig6.yaml", overrides=overrides))
        values = result.history["objectives"][:, 0]
        (best,) = result.objectives.values()
        rows.append(
            [
                name,
                f"{values[-1]:.3f}",
                f"{best:.3f}",
                f"{fmean(values[-5:]):.3f}",
                str(result.iterations),
                f"about {known}",
                verdict(abs(best - known) <= 0.02 * known),
            ]
        )
    yield Table(
        "fig6 with the `oc` preset, 50 iterations",
        ("gradients", "last", "best", "mean of the last 5", "iterations", "known", "within 2 %"),
        rows,
    )


def _row(bar: Bar) -> list[str]:
    overrides = {"optimizer.max_iterations": (bar.evaluations or 100) + 1, **bar.overrides}
    case = load_case(CASES / f"{bar.case}.yaml", overrides=overrides)
    result = optimize(case, starts=bar.starts, workers=2 if bar.starts > 1 else 1)
    (first,), (best,) = result.initial_objectives.values(), result.objectives.values()
    reached = _reached(result, bar.value) if bar.starts == 1 else None
    met = best <= bar.value and (bar.evaluations is None or (reached is not None and reached <= bar.evaluations))
    return [
        bar.case,
        str(bar.starts),
        f"{first:.6f}",
        f"{best:.6f}",
        str(result.evaluations),
        f"{bar.value:g}",
        "" if bar.evaluations is None else str(bar.evaluations),
        "" if bar.starts > 1 else str(reached or "not reached"),
        verdict(met),
    ]


def _reached(result: Result, value: float) -> int | None:
    """Evaluations until an iterate was at most `value`; None where none was."""
    low = np.flatnonzero(result.history["objectives"][:, 0] <= value)
    return int(result.history["evaluations"][low[0]]) if len(low) else None
