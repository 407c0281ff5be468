"""What a body in space costs beside one in a plane: the same scene, once as it is and once lifted."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from statistics import median

from benchmarks.scenes import CASES, DESIGNS, design
from mdstopo import evaluate, load_case
from mdstopo.bench.scenes import plate
from mdstopo.bench.tables import Table, spread, verdict
from mdstopo.bench.timing import interleaved
from mdstopo.case.reader import read_case
from mdstopo.finalize.lift_case import lifted

TOLERANCE = "1e-8"
INTEGRATORS = ("gauss", "runge_kutta")
#: most that space may take, in times of the plane; with a million members
AT_MOST, AT_MOST_OF_MANY = 3.0, 2.5
MILLION = 1_000_000
ROUNDS = 7


def space() -> Iterator[Table]:
    """Two tables: a thousand members by each integrator, and a million; all in turns."""
    yield _thousand()
    yield _million()


def _thousand() -> Table:
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
    return Table(
        "Objective and exact gradient of fig6, in the plane and lifted into space, ms",
        [
            *("design", "integrator", "plane", "space", f"space to plane (at most {AT_MOST:g})"),
            *("space to runge_kutta in the plane", "values apart, relative"),
        ],
        rows,
        [f"1,020 springs; a tolerance of {TOLERANCE}, all calls in turns."],
    )


def _million() -> Table:
    planar = read_case(plate(MILLION), overrides={"solver.integrator": "gauss"})
    cases = {"plane": planar, "space": read_case(lifted(planar))}
    calls = {where: partial(evaluate, case, case.initial) for where, case in cases.items()}
    values = {where: call().objectives["G"] for where, call in calls.items()}
    found: dict[str, list[tuple[float, float]]] = {where: [] for where in calls}
    for _ in range(ROUNDS):
        for where, call in calls.items():
            found[where].append(_times(call))
    own, of_processor = (
        median(each[k] for each in found["space"]) / median(each[k] for each in found["plane"]) for k in range(2)
    )
    rows = [
        [where, *(spread([1e3 * each[k] for each in seconds]) for k in range(2))] for where, seconds in found.items()
    ]
    apart = abs(values["space"] / values["plane"] - 1.0)
    met = own <= AT_MOST_OF_MANY
    return Table(
        f"Objective and exact gradient of {planar.n_design:,} springs by gauss",
        ("scene", "ms", "ms of all processors"),
        [*rows, ["space to plane", f"{own:.2f}", f"{of_processor:.2f}"]],
        [f"At most {AT_MOST_OF_MANY:g} times: {verdict(met)}. Calls in turns; values {apart:.0e} apart, relative."],
    )


def _times(call: Callable[[], object]) -> tuple[float, float]:
    """Seconds of a call, and those that it had of all processors."""
    began, before = time.perf_counter(), time.process_time()
    call()
    return time.perf_counter() - began, time.process_time() - before
