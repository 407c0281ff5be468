"""Table 1 and the times of Section IV.A: one iteration by each method, beside the paper's."""

import platform
import time
from statistics import median

from mdstopo import evaluate, load_case
from mdstopo.starts.single_start import make_optimizer
from reproduce.desk import CASES, Desk, Numbers

#: seconds an iteration that the paper reports (3.2 GHz Xeon, 8 GB)
PAPER = {"adjoint": 102.1, "direct": 54.8, "iterative": 49.7, "constant_load": None}
STEPS = 100
REPEATS = 7


def timing(desk: Desk) -> Numbers:
    """Median seconds of an evaluation with its gradient, and of a whole iteration, by method."""
    rows: Numbers = {}
    for name, paper in PAPER.items():
        case = load_case(
            CASES / "fig6.yaml",
            overrides={
                "solver.sensitivity": name,
                "solver.integrator": "generalized_alpha",
                "solver.step": 0.2 / STEPS,
            },
        )
        rows[name] = {"paper": paper, **_times(case)}
    rows["adjoint, our default integrator"] = {"paper": None, **_times(load_case(CASES / "fig6.yaml"))}
    desk.path("timing.txt").write_text(
        "\n".join(f"{name}: {1e3 * row['iteration']:.3g} ms an iteration" for name, row in rows.items()) + "\n"
    )
    return {
        "rows": rows,
        "steps": STEPS,
        "machine": f"{platform.processor() or platform.machine()}, {platform.system()}",
    }


def _times(case: object) -> Numbers:
    from mdstopo.case.model import Case
    from mdstopo.engine import Evaluator

    assert isinstance(case, Case)
    engine = Evaluator(case)
    problem = engine.problem()
    optimizer = make_optimizer(case, problem)
    state = optimizer.start()
    evaluate(case)
    evaluations, iterations = [], []
    for _ in range(REPEATS):
        began = time.perf_counter()
        engine.evaluate(case.initial)
        evaluations.append(time.perf_counter() - began)
        began = time.perf_counter()
        optimizer.step(state)
        iterations.append(time.perf_counter() - began)
    return {"evaluation": median(evaluations), "iteration": median(iterations)}
