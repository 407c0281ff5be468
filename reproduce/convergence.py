"""Figure 6: all four methods with the optimality criteria of the paper's iteration, and our default beside them."""

import numpy as np

from mdstopo import load_case, optimize
from mdstopo.plots.style import COLOURS, DASHES, MARKERS, new_figure, save, styled
from reproduce.desk import CASES, Desk, Numbers
from reproduce.sensitivities import NAMES

ITERATIONS = 50
METHODS = ("constant_load", "adjoint", "direct", "iterative")
#: fixed steps of generalized_alpha
STEPS = 100


def figure_6(desk: Desk) -> Numbers:
    """G over the iterations."""
    runs = {}
    for name in METHODS:
        overrides = {
            "optimizer.preset": "oc", "optimizer.max_iterations": ITERATIONS, "solver.sensitivity": name,
            "solver.integrator": "generalized_alpha", "solver.step": 0.2 / STEPS,
        }  # fmt: skip
        desk.say(f"  oc preset, {name}")
        case = load_case(CASES / "fig6.yaml", overrides=overrides)
        runs[name] = optimize(case, path=desk.path(f"fig6-oc-{name}.h5"), overwrite=True)
    desk.say("  default preset")
    case = load_case(CASES / "fig6.yaml", overrides={"optimizer.max_iterations": ITERATIONS})
    runs["default"] = optimize(case, path=desk.path("fig6.h5"), overwrite=True)
    with styled() as module:
        figure, (axis,) = new_figure(module, height=3.0)
        for k, (name, run) in enumerate(runs.items()):
            label = "our default, exact" if name == "default" else f"oc, {NAMES.get(name, name).partition(' (')[0]}"
            series = run.history["objectives"][:, 0]
            axis.plot(
                np.arange(len(series)), series, linestyle=DASHES[k], color=COLOURS[k],
                marker=MARKERS[k], markevery=(2 * k, 10), fillstyle="none", label=label.replace("_", " "),
            )  # fmt: skip
        axis.set_yscale("log")
        axis.set_yticks([5, 10, 20, 40, 80], ["5", "10", "20", "40", "80"])
        axis.minorticks_off()
        axis.set_xlabel("iteration")
        axis.set_ylabel("G, J")
        axis.legend(loc="upper right")
        save(figure, desk.path("fig6.png"))
    last = {name: float(run.history["objectives"][-1, 0]) for name, run in runs.items()}
    exact = [last[name] for name in METHODS if name != "constant_load"]
    return {
        "start": float(runs["adjoint"].history["objectives"][0, 0]),
        "last": last,
        "exact methods apart": (max(exact) - min(exact)) / min(exact),
        "constant_load apart": last["constant_load"] / last["adjoint"] - 1.0,
        "default iterations": runs["default"].iterations,
    }
