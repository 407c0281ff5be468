"""The pictures there are. A new one is a line here and a file `NAME_plot.py` beside this one."""

from dataclasses import dataclass
from importlib import import_module

import numpy as np

from mdstopo.store.result_reader import ResultView


@dataclass(frozen=True)
class Plot:
    """A kind of picture. place: module and function that draw it; what: a sentence; options: of the command that it
    understands."""

    place: tuple[str, str]
    what: str
    options: tuple[str, ...] = ()

    @property
    def draw(self):  # type: ignore[no-untyped-def]
        """The function that draws the picture."""
        return getattr(import_module(f"mdstopo.plots.{self.place[0]}_plot"), self.place[1])


PLOTS: dict[str, Plot] = {
    "layout": Plot(
        ("layout", "draw"), "bodies and members, at the start or at --time", ("load_case", "times", "overlay")
    ),
    "designs": Plot(("designs", "draw"), "start and final design beside each other"),
    "convergence": Plot(("convergence", "draw"), "objectives over the iterations"),
    "design": Plot(("design", "draw"), "alpha of every member"),
    "sensitivities": Plot(("sensitivities", "draw"), "dG/dalpha of every member", ("members",)),
    "histories": Plot(("histories", "draw"), "the responses of objectives, over time", ("load_case",)),
    "sensitivity-histories": Plot(
        ("histories", "draw_sensitivities"), "dg/dalpha over time, from `gradient --history`", ("members",)
    ),
    "fit": Plot(("fit", "draw"), "of a fit: measured and fitted series, and what is left"),
    "correlation": Plot(("fit", "draw_correlation"), "of a fit: how estimates vary together"),
    "profiles": Plot(("fit", "draw_profiles"), "of a fit: how it gets worse as one estimate is held elsewhere"),
    "front": Plot(("front", "draw"), "the front and every design visited", ("marked",)),
}


def fitting(view: ResultView) -> list[str]:
    """The pictures that a result file has the content for."""
    paths = view.arrays.keys()
    found = []
    if "pareto/objectives" in paths:
        found.append("front")
    alphas = bool(np.any(view.arrays.get("members/design", True)))
    motions = view.kind in ("run", "pareto") or "design/alpha" in paths
    if motions:
        found += ["layout", "design"] if alphas else ["layout"]
        if alphas and view.kind == "run":
            found.append("designs")
    if "iterations/combined" in paths:
        found.insert(0, "convergence")
    if alphas and any(path.startswith("sensitivities/") and "/history/" not in path for path in paths):
        found.append("sensitivities")
    if alphas and any("/history/" in path for path in paths):
        found.append("sensitivity-histories")
    if view.kind == "fit":
        return [*_of_fit(view), "layout"]
    if motions and view.lines("objectives"):
        found.append("histories")
    return found


def _of_fit(view: ResultView) -> list[str]:
    """The pictures of a fit that there is enough known for."""
    found = ["fit"] if "fit/value" in view.arrays else []
    if "fit/correlation" in view.arrays:
        found.append("correlation")
    return [*found, "profiles"] if view.under("fit/profiles") else found
