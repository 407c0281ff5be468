"""What a body in space costs beside one in a plane: the same scene, once as it is and once lifted."""

from collections.abc import Iterator
from functools import partial
from statistics import median

from benchmarks.scenes import CASES, DESIGNS, design
from mdstopo import evaluate, load_case
from mdstopo.bench.tables import Table, spread
from mdstopo.bench.timing import interleaved
from mdstopo.case.reader import read_case
from mdstopo.finalize.lift import lifted

TOLERANCE = "1e-8"
#: most that space may take, in times of the plane
AT_MOST = 3.0


def space() -> Iterator[Table]:
    """One table: planar and spatial evaluations in turns."""
    settings = {"solver.integrator": "runge_kutta", "solver.tolerance": TOLERANCE}
    planar = load_case(CASES / "fig6.yaml", overrides=settings)
    spatial = read_case(lifted(planar))
    rows = []
    for name in DESIGNS:
        alpha = design(name, planar.n_design)
        cases = {"plane": planar, "space": spatial}
        times = interleaved({key: partial(evaluate, case, alpha) for key, case in cases.items()}, seconds=0.1)
        found = {key: evaluate(case, alpha).objectives["G"] for key, case in cases.items()}
        ratio = median(times["space"]) / median(times["plane"])
        apart = abs(found["space"] / found["plane"] - 1.0)
        spreads = [spread([1e3 * each for each in times[key]]) for key in cases]
        rows.append([name, *spreads, f"{ratio:.2f}", f"{apart:.0e}"])
    yield Table(
        "Objective and exact gradient of fig6, in the plane and lifted into space, ms",
        ["design", "plane", "space", f"ratio (at most {AT_MOST:g})", "values apart, relative"],
        rows,
        [f"{planar.n_design} springs; `runge_kutta` at a tolerance of {TOLERANCE}, planar and spatial calls in turns."],
    )
