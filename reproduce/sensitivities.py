"""Figures 4 and 5: the methods beside each other at the initial design, at t_n and over time."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo import evaluate, load_case
from mdstopo.engine import Evaluator
from mdstopo.plots.style import COLOURS, MARKERS, WIDTH, new_figure, save, styled
from reproduce.desk import CASES, Desk, Numbers

Floats = NDArray[np.float64]

#: the paper's name of each exact method
NAMES = {
    "adjoint": "adjoint (the paper's AVM)",
    "direct": "direct (time integration incorporated)",
    "iterative": "iterative",
}
#: fixed steps of generalized_alpha on [0, 0.2 s]
STEPS = 200
FIRST, HISTORY = 51, 8
#: times at which adjoint and iterative gradients are computed anew
TIMES = 20


def _case(**overrides: object) -> Any:
    settings = {"solver.integrator": "generalized_alpha", "solver.step": 0.2 / STEPS}
    return load_case(
        CASES / "fig6.yaml", overrides={**settings, **{k.replace("__", "."): v for k, v in overrides.items()}}
    )


def figure_4(desk: Desk) -> Numbers:
    """dG/dalpha of the first 51 members, relative to the largest."""
    case = _case()
    gradients = {name: evaluate(case, method=name).gradients["G"] for name in NAMES}
    exact = evaluate(load_case(CASES / "fig6.yaml", overrides={"solver.tolerance": 1e-12})).gradients["G"]
    scale = float(np.abs(exact).max())
    with styled() as module:
        figure, (axis,) = new_figure(module)
        for k, (name, gradient) in enumerate(gradients.items()):
            axis.plot(
                np.arange(1, FIRST + 1), gradient[:FIRST] / np.abs(gradient).max(), linestyle="-" if k == 0 else "none",
                color=COLOURS[k], marker=MARKERS[k], markersize=6.5 - 2.0 * k, fillstyle="none", linewidth=0.6,
                label=NAMES[name],
            )  # fmt: skip
        axis.set_xlabel("member")
        axis.set_ylabel("dG/dalpha, relative to the largest")
        axis.set_ylim(top=1.15)
        axis.legend(loc="upper left")
        save(figure, desk.path("fig4.png"))
    return {
        "steps": STEPS,
        "between methods": _widest(list(gradients.values()), scale),
        "from the exact motion": float(np.abs(gradients["adjoint"] - exact).max()) / scale,
    }


def figure_5(desk: Desk) -> Numbers:
    """dg(t)/dalpha of the first eight members: direct at every step, the others anew at some times."""
    engine = Evaluator(_case(objectives__G__over_time="final"))
    status, t, direct = engine.histories(engine.case.initial, "G")
    assert status.ok, status.value
    places = np.linspace(0, STEPS, TIMES + 1).round().astype(int)[1:]
    others: dict[str, Floats] = {}
    for name in ("adjoint", "iterative"):
        rows = []
        for k in places.tolist():
            case = _case(objectives__G__over_time="final", time__end=0.2 * k / STEPS)
            rows.append(evaluate(case, method=name).gradients["G"])
        others[name] = np.array(rows)
    scale = float(np.abs(direct).max())
    with styled() as module:
        figure = module.Figure(figsize=(2.0 * WIDTH, 4.0))
        axes = figure.subplots(2, 4, sharex=True).ravel()
        for i, axis in enumerate(axes[:HISTORY]):
            axis.plot(t, direct[:, i], color=COLOURS[0], label="direct")
            for k, (name, rows) in enumerate(others.items(), start=1):
                axis.plot(
                    t[places], rows[:, i], linestyle="none", color=COLOURS[k], marker=MARKERS[k],
                    markersize=5.5 - 2.5 * (k - 1), fillstyle="none", label=name,
                )  # fmt: skip
            axis.set_title(f"member {i + 1}", loc="left")
            if i >= 4:
                axis.set_xlabel("time, s")
            if i % 4 == 0:
                axis.set_ylabel("dg/dalpha, J")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        save(figure, desk.path("fig5.png"))
    return {
        "times": TIMES,
        "between methods": _widest([direct[places], *others.values()], scale),
    }


def _widest(arrays: list[Floats], scale: float) -> float:
    return max(float(np.abs(a - b).max()) / scale for a in arrays for b in arrays)
