"""Orders of convergence with fixed steps, agreement of the sensitivity methods, drift over a thousand periods."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.drift import drift
from benchmarks.reference import Reference, solution
from benchmarks.scenes import design, scene
from mdstopo import evaluate
from mdstopo.bench.tables import Table, verdict

#: errors outside of this are those of rounding, or not yet of the leading order
WINDOW = (1e-11, 1e-4)


@dataclass(frozen=True)
class Order:
    """What is fitted. steps: how many fixed ones; window: errors that count; low, high: the bar."""

    integrator: str
    scene: str
    design: str
    steps: Sequence[int]
    low: float
    high: float
    window: tuple[float, float] = (0.0, np.inf)


# With every member whole the motion is three times as fast, so that more step sizes fall into the window; the highest
# peak is then inside the interval, and the energy at the end has no peak to be found.
ORDERS = (
    Order("generalized_alpha", "fig6", "uniform", (50, 100, 200, 400, 800), 1.95, 2.05),
    Order("runge_kutta", "end", "ones", (1, 2, 3, 4, 5, 6, 7, 8), 11.5, np.inf, WINDOW),
)


def orders() -> Iterator[Table]:
    """Tables of orders, of the agreement, and of drifts."""
    yield from map(_order, ORDERS)
    yield _agreement()
    yield from drift()


def _order(wanted: Order) -> Table:
    case = scene(wanted.scene, integrator="gauss", tolerance=1e-13)
    alpha = design(wanted.design, case.n_design)
    truth = Reference(*solution(case, alpha))
    span = case.load_cases[0].end - case.load_cases[0].start
    errors = np.array(
        [
            truth.errors(*solution(scene(wanted.scene, integrator=wanted.integrator, step=span / count), alpha))
            for count in wanted.steps
        ]
    )
    rows = [[str(count), f"{g:.2e}", f"{s:.2e}"] for count, (g, s) in zip(wanted.steps, errors, strict=True)]
    fits = [_fit(np.array(wanted.steps), column, wanted.window) for column in errors.T]
    rows.append(["order", *(f"{order:.3f}, fitted to {count} steps" for order, count in fits)])
    bar = f"at least {wanted.low:g}" if np.isinf(wanted.high) else f"{wanted.low:g} to {wanted.high:g}"
    rows.append([f"bar: {bar}", *(verdict(wanted.low <= order <= wanted.high and count > 3) for order, count in fits)])
    notes = ["Errors are relative to collocation at tolerance 1e-13."]
    if np.isfinite(wanted.window[1]):
        notes.append(f"Fitted to errors between {wanted.window[0]:.0e} and {wanted.window[1]:.0e}.")
    where = "fig6, energy at the end" if wanted.scene == "end" else wanted.scene
    return Table(
        f"Order of {wanted.integrator} on {where}, {wanted.design} design",
        ("fixed steps", "error of G", "error of dG/dalpha"),
        rows,
        notes,
    )


def _fit(steps: NDArray[np.int64], errors: NDArray[np.float64], window: tuple[float, float]) -> tuple[float, int]:
    inside = (errors >= window[0]) & (errors <= window[1])
    if inside.sum() < 2:
        return float("nan"), int(inside.sum())
    return -float(np.polyfit(np.log(steps[inside]), np.log(errors[inside]), 1)[0]), int(inside.sum())


def _agreement() -> Table:
    case = scene("fig6", integrator="generalized_alpha", step=1e-3)
    gradients = {name: evaluate(case, method=name).gradients["G"] for name in ("adjoint", "direct", "iterative")}
    largest = np.max(np.abs(gradients["adjoint"]))
    rows = []
    for one, two in (("direct", "adjoint"), ("iterative", "adjoint"), ("iterative", "direct")):
        difference = float(np.max(np.abs(gradients[one] - gradients[two])) / largest)
        rows.append([f"{one} - {two}", f"{difference:.1e}", "at most 1e-9", verdict(difference <= 1e-9)])
    return Table(
        "Agreement of the exact methods on fig6, generalized_alpha, 200 steps",
        ("gradients", "largest difference, relative", "bar", "met"),
        rows,
    )
