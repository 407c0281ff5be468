"""Built-in laws written as formulas beside these laws: values, gradients, and what formulas cost."""

from collections.abc import Iterator
from functools import partial
from statistics import median

import numpy as np

from benchmarks.scenes import CASES
from mdstopo.bench.tables import Table, spread, verdict
from mdstopo.bench.timing import interleaved
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Evaluation

#: most that a formula may take, in times of the built-in law; and what values and gradients may be apart, relative
AT_MOST, APART = 1.3, 1e-12
#: built in, and as a formula
LAWS = {
    "spring": (
        "{type: spring, stiffness: 225, damping: 2}",
        '{type: expression, force: "k*x + c*xd", energy: "k*x^2/2", parameters: {k: 225, c: 2}}',
    ),
    "cubic": (
        "{type: cubic, stiffness: 225, cubic: 300}",
        '{type: expression, energy: "k*x^2/2 + b*x^4/4", parameters: {k: 225, b: 300}}',
    ),
    "gap": (
        "{type: gap, stiffness: 800, damping: 2, gap: 0.002}",
        '{type: expression, force: "if(x >= g, k*(x - g) + c*xd, 0)", energy: "if(x >= g, k*(x - g)^2/2, 0)",'
        " parameters: {k: 800, c: 2, g: 0.002}}",
    ),
    "actuator": (
        "{type: actuator, proportional: 225, derivative: 2, target: 0.01, limit: 12}",
        '{type: expression, force: "clip(p*(x - a) + d*xd, -f, f)", parameters: {p: 225, d: 2, a: 0.01, f: 12}}',
    ),
}
#: laws that switch, of which fewer members are taken: each switch of each member ends a step
SWITCHING = ("gap", "actuator")
_LAW, _COUNT = "{type: spring, stiffness: 225}", "count: 20"
_SETTINGS = {"solver.integrator": "runge_kutta", "solver.tolerance": "1e-6"}
_SETTINGS |= {"objectives.G.response": "{velocity: {body: torso, component: x}}", "objectives.G.over_time": "final"}


def formulas() -> Iterator[Table]:
    """One table: many members of each law and of its formula."""
    whole = (CASES / "fig6.yaml").read_text(encoding="utf-8")
    assert _LAW in whole
    assert _COUNT in whole
    rows = []
    for name, pair in LAWS.items():
        text = whole.replace(_COUNT, "count: 4") if name in SWITCHING else whole
        engines = [Evaluator(read_case(text.replace(_LAW, law), overrides=_SETTINGS)) for law in pair]
        found = [engine.evaluate(engine.case.start) for engine in engines]
        calls = {
            (i, gradient): partial(engine.evaluate, engine.case.start, gradient=gradient)
            for gradient in (True, False)
            for i, engine in enumerate(engines)
        }
        times = interleaved(calls, rounds=15, seconds=0.1)
        ratios = [
            median(b / a for a, b in zip(times[0, gradient], times[1, gradient], strict=True))
            for gradient in (True, False)
        ]
        apart = max(_apart(*found))
        cells = [spread([1e3 * each for each in times[i, True]]) for i in range(2)]
        rows.append(
            [name, f"{engines[0].case.n_members:,}", *cells, *(f"{each:.2f}" for each in ratios), f"{apart:.0e}",
             verdict(max(ratios) <= AT_MOST and apart <= APART)]
        )  # fmt: skip
    yield Table(
        "Members by a built-in law and by its formula: objective and exact gradient, ms",
        ("law", "members", "built in", "formula", "formula to built in", "objective alone", "apart, relative", "holds"),
        rows,
        (
            "The scene of fig6 by `runge_kutta` with a tolerance of 1e-6, the last velocity of the torso, calls "
            f"in turns. It holds where ratios are at most {AT_MOST:g}, and values and gradients within {APART:.0e}. "
            "A gap that is open is left out of all sums, built in or by its formula.",
        ),
    )


def _apart(one: Evaluation, other: Evaluation) -> tuple[float, float]:
    """By how much value and gradient differ, relative."""
    value = abs(other.objectives["G"] / one.objectives["G"] - 1.0)
    a, b = one.gradients["G"], other.gradients["G"]
    return value, float(np.abs(b - a).max() / np.abs(a).max())
