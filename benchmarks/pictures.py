"""The pictures of the documentation: `python -m benchmarks.pictures [NAME ...] [--fronts]` draws them.

NAME is an application, `limits`: how a run with limits on responses goes, or `moving`: the README's picture. Designs
are those of `cases/designs`; fronts are computed, which takes minutes each, only with `--fronts`.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.applications import APPLICATIONS
from benchmarks.moving import draw_moving
from benchmarks.optimum import problems
from benchmarks.scenes import CASES
from mdstopo import optimize
from mdstopo.plots.style import COLOURS, new_figure, save, styled, use_log_scale

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"

#: pictures of the motion: application, load case, time in s, end of the name
MOMENTS = {
    "restraint": ("forward", 0.13, "far"),
    "lander": ("level", 0.206, "deep"),
    "touchdown": ("corner", 0.377, "deep"),
    "cargo": ("rolling", 4.2, "leaning"),
    "occupant": ("left", 0.094, "far"),
}
#: the problem whose run is drawn, and what is drawn of an excess at least
LIMITS, LEAST = "four-bar very tight", 1e-9
#: points of a front and iterations of each of its solves
FRONTS = {"restraint": (3, 40), "tiedown": (5, 40), "mooring": (3, 60), "lander": (5, 40)}


def commands(name: str, folder: Path, fronts: bool) -> Iterator[list[str]]:
    """The command lines, without `mdstopo`, that draw the pictures of an application."""
    case, still = str(CASES / f"{name}.yaml"), "optimizer.max_iterations=0"
    design = ["--alpha", str(CASES / "designs" / f"{name}.txt")]
    for end, start in (("candidates", []), ("design", design)):
        result = str(folder / f"{end}.h5")
        yield ["run", case, *start, "--set", still, "--set", "combine.normalize=false", "--out", result, "--quiet"]
        yield ["plot", result, "layout", "--out", str(IMAGES / f"{name}-{end}.svg")]
    if name in MOMENTS:
        load_case, time, end = MOMENTS[name]
        where = ["--load-case", load_case, "--time", f"{time:g}"]
        yield ["plot", str(folder / "design.h5"), "layout", *where, "--out", str(IMAGES / f"{name}-{end}.svg")]
    if fronts and name in FRONTS:
        points, iterations = FRONTS[name]
        result, limit = str(folder / "front.h5"), f"optimizer.max_iterations={iterations}"
        yield ["pareto", case, "--points", str(points), "--method", "nbi", "--set", limit, "--out", result]
        yield ["plot", result, "front", "--out", str(IMAGES / f"{name}-front.svg")]


def draw_limits() -> None:
    """A run of a driven four-bar with limits on two joint forces: objective, violation and residual."""
    (problem,) = problems.named([LIMITS])
    result = optimize(problem.case())
    history = {name: np.asarray(column) for name, column in result.history.items()}
    bounds = np.array([abs(row.bound) for row in result.case.constraints])
    excess = np.maximum(history["constraints"] / bounds, 0.0).max(axis=1)
    taken, count = history["accepted"].astype(bool), history["evaluations"]
    panels = (
        ("force in D, N", history["objectives"][:, 0]),
        ("largest excess\nover a limit", np.maximum(excess, LEAST)),
        ("KKT residual", history["kkt"]),
    )
    with styled() as module:
        figure, axes = new_figure(module, len(panels))
        for axis, colour, (label, series) in zip(axes, COLOURS, panels, strict=False):
            axis.plot(count[taken], series[taken], color=colour, marker="o", label="accepted")
            if label != "KKT residual":
                axis.plot(count[~taken], series[~taken], "x", color="#555555", label="rejected")
            use_log_scale(axis)
            axis.set_ylabel(label)
        if problem.exact is not None:
            axes[0].axhline(problem.exact, color="black", linewidth=0.6, linestyle="--", label="exact optimum")
        axes[0].set_yticks([20, 50, 100, 200], ["20", "50", "100", "200"])
        axes[0].minorticks_off()
        axes[0].legend(loc="upper right")
        axes[-1].axhline(result.case.optimizer.tolerance, color="black", linewidth=0.6, linestyle="--")
        axes[-1].set_xlabel("evaluations")
        axes[-1].xaxis.get_major_locator().set_params(integer=True)
        save(figure, IMAGES / "limits.svg")
    print(f"{LIMITS}: {result.status} after {result.evaluations} evaluations, {result.reason}")


def main(asked: list[str]) -> None:
    """Draw them; an unknown name is a KeyError."""
    names = [name for name in asked if name != "--fronts"] or [*APPLICATIONS, "limits", "moving"]
    for name in names:
        if name == "moving":
            draw_moving(IMAGES / "moving.svg")
            continue
        if name == "limits":
            draw_limits()
            continue
        with TemporaryDirectory() as folder:
            for line in commands(name, Path(folder), "--fronts" in asked):
                # a start that passes a limit ends `run` with an exit code, and is drawn all the same
                run([sys.executable, "-m", "mdstopo", *line], check=line[0] != "run")


if __name__ == "__main__":
    main(sys.argv[1:])
