"""Springs between free bodies by their own kernels and by those of general scenes: values, gradients, times.

Gradients are those of `adjoint`, the one method that both have.
"""

from collections.abc import Iterator
from functools import partial
from statistics import median

import numpy as np

from benchmarks.scenes import CASES
from mdstopo.bench.tables import Table, spread, verdict
from mdstopo.bench.timing import interleaved
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

#: most that the general kernels may take, in times of the springs' own, where these could go; and what values and
#: gradients may be apart, relative, in tolerances
AT_MOST, APART = 1.05, 1.0
#: how many points of the torso are joined with 51 of the frame, integrator
WAYS = [(points, name) for points in (4, 20, 320) for name in ("gauss", "runge_kutta", "generalized_alpha")]
TOLERANCE = 1e-6
_COUNT, _VOLUME = "count: 20", "equals: 102"


def chains() -> Iterator[Table]:
    """One table: the scene of fig6 with few and with many members."""
    text = (CASES / "fig6.yaml").read_text(encoding="utf-8")
    assert _COUNT in text
    assert _VOLUME in text
    rows = []
    for points, integrator in WAYS:
        settings = {"solver.tolerance": str(TOLERANCE), "solver.integrator": integrator}
        if integrator == "generalized_alpha":
            settings["solver.step"] = "0.002"
        scene = text.replace(_COUNT, f"count: {points}").replace(_VOLUME, "fraction: 0.1")
        case = read_case(scene, overrides=settings)
        alpha = np.random.default_rng(2).uniform(0.01, 1.0, case.n_design)
        engines = [Evaluator(case), Evaluator(case, beyond="a comparison")]
        own, general = (engine.evaluate(alpha) for engine in engines)
        calls = {i: partial(engine.evaluate, alpha) for i, engine in enumerate(engines)}
        times = interleaved(calls, rounds=15, seconds=0.1)
        ratio = median(b / a for a, b in zip(times[0], times[1], strict=True))
        value = abs(general.objectives["G"] / own.objectives["G"] - 1.0)
        gradient = float(np.abs(general.gradients["G"] - own.gradients["G"]).max() / np.abs(own.gradients["G"]).max())
        cells = [spread([1e3 * each for each in times[i]]) for i in range(2)]
        rows.append(
            [f"{case.n_members:,}", integrator, *cells, f"{ratio:.2f}", f"{value:.0e}", f"{gradient:.0e}",
             verdict(ratio <= AT_MOST and max(value, gradient) <= APART * TOLERANCE)]
        )  # fmt: skip
    yield Table(
        "Springs between free bodies by their own kernels and by those of general scenes, ms",
        ("members", "integrator", "own", "general", "ratio", "value apart", "gradient apart", "holds"),
        rows,
        (
            f"The scene of fig6 at a random design, tolerance {TOLERANCE:g}, steps of `generalized_alpha` of 2 ms; "
            f"objective and gradient, calls in turns. It holds where the ratio is at most {AT_MOST:g} and "
            "both differ by no more than the tolerance.",
        ),
    )
