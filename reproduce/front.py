"""Figures 7 and 8: the front by weights with every design visited, by direct and by iterative; the 0.5/0.5 design."""

from pathlib import Path

import numpy as np

from benchmarks.scenes import BEST_KNOWN, IDEAL, NADIR
from mdstopo import load_case
from mdstopo.front.directions import weights_of_first
from mdstopo.front.run_front import Ask, run_front
from mdstopo.plan.front_measures import REFERENCE, dominated, hypervolume, scaled
from mdstopo.plots import design_plot, front_plot, layout_plot
from mdstopo.plots.source import Source
from mdstopo.plots.style import save, styled
from reproduce.desk import CASES, Desk, Numbers

WEIGHTS = 21
ITERATIONS = 100
STEPS = 100
MIDDLE = WEIGHTS // 2
METHODS = ("direct", "iterative")


def figure_7(desk: Desk) -> Numbers:
    """The front, twice; what was interrupted goes on."""
    numbers: Numbers = {}
    found = {}
    for name in METHODS:
        path = desk.path(f"fig7-{name}.h5")
        found[name] = points = _front(desk, name, path)
        good = points[~dominated(points)]
        volume = hypervolume(scaled(good, IDEAL, NADIR), np.full(2, REFERENCE)) / BEST_KNOWN
        numbers[name] = {"hypervolume": volume, "middle": points[MIDDLE].tolist(), "on the front": len(good)}
        with styled() as module:
            save(front_plot.draw(module, Source(path), marked=MIDDLE), desk.path(f"fig7-{name}.png"))
    numbers["apart"] = float(np.abs(found["direct"] / found["iterative"] - 1.0).max())
    return numbers


def _front(desk: Desk, method: str, path: Path) -> np.ndarray:  # type: ignore[type-arg]
    overrides = {
        "solver.sensitivity": method, "solver.integrator": "generalized_alpha", "solver.step": 0.2 / STEPS,
        "optimizer.max_iterations": ITERATIONS,
    }  # fmt: skip
    case = load_case(CASES / "fig7.yaml", overrides=overrides)
    ask = Ask(weights_of_first(np.linspace(0.0, 1.0, WEIGHTS).tolist()))
    told = [0]

    def progress(snapshot: object) -> None:
        done = int(snapshot.done)  # type: ignore[attr-defined]
        if done >= told[0] + 10:
            told[0] = done
            desk.say(f"  {method}: {done} solves, {len(snapshot.best)} of {WEIGHTS} points")  # type: ignore[attr-defined]

    resume = path.exists() and Source(path).view.status in ("running", "interrupted")
    outcome = run_front(case, ask, path=path, resume=resume, overwrite=not resume, on_progress=progress)
    assert outcome.front is not None, outcome.reason
    return np.array([point.objectives for point in outcome.front.points if point is not None])


def figure_8(desk: Desk) -> Numbers:
    """The design of weights 0.5 and 0.5: its variables, and what it looks like."""
    source = Source(desk.path("fig7-direct.h5"), MIDDLE)
    with styled() as module:
        save(design_plot.draw(module, source), desk.path("fig8.png"))
        save(layout_plot.draw(module, source), desk.path("fig8-layout.png"))
    alpha = source.alpha
    return {
        "volume": float(alpha.sum()),
        "present": int((alpha > 0.9).sum()),
        "grey": int(((alpha > 0.1) & (alpha <= 0.9)).sum()),
        "members": len(alpha),
    }
