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
INTEGRATORS = ("gauss", "runge_kutta")
#: most that space may take, in times of the plane
AT_MOST = 3.0


def space() -> Iterator[Table]:
    """One table: planar and spatial evaluations by each integrator, all in turns."""
    rows = []
    for name in DESIGNS:
        calls = {}
        found = {}
        for integrator in INTEGRATORS:
            settings = {"solver.integrator": integrator, "solver.tolerance": TOLERANCE}
            planar = load_case(CASES / "fig6.yaml", overrides=settings)
            alpha = design(name, planar.n_design)
            for where, case in (("plane", planar), ("space", read_case(lifted(planar)))):
                calls[integrator, where] = partial(evaluate, case, alpha)
                found[integrator, where] = evaluate(case, alpha).objectives["G"]
        times = interleaved({" ".join(key): call for key, call in calls.items()}, seconds=0.1)
        for integrator in INTEGRATORS:
            plane, in_space = (times[f"{integrator} {where}"] for where in ("plane", "space"))
            apart = abs(found[integrator, "space"] / found[integrator, "plane"] - 1.0)
            own = median(in_space) / median(plane)
            explicit = median(in_space) / median(times["runge_kutta plane"])
            spreads = [spread([1e3 * each for each in seconds]) for seconds in (plane, in_space)]
            rows.append([name, integrator, *spreads, f"{own:.2f}", f"{explicit:.2f}", f"{apart:.0e}"])
    yield Table(
        "Objective and exact gradient of fig6, in the plane and lifted into space, ms",
        [
            *("design", "integrator", "plane", "space", f"space to plane (at most {AT_MOST:g})"),
            *("space to runge_kutta in the plane", "values apart, relative"),
        ],
        rows,
        [f"1,020 springs; a tolerance of {TOLERANCE}, all calls in turns."],
    )
