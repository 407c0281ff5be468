"""The system: bodies, points, and members drawn by how much of them there is."""

from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.legend import SETTING, columns_of, height_of, legend_handles, legend_names
from mdstopo.plots.member_lines import legend_title
from mdstopo.plots.panels import ABOVE, BELOW, LEFT, RIGHT, add_panel, fitted
from mdstopo.plots.scenery import start_state
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.space_layout import draw_space
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import WIDTH, ink
from mdstopo.plots.thickness import Thickness, thickness

#: columns of a legend, at most
COLUMNS = 3
#: inches: how high a drawing is at most, and a picture; how much a perspective, which has no scale, leaves beside it
MOST_HEIGHT, MOST_PAGE_HEIGHT, MARGINS = 2.4, 10.0, 0.2


def draw(
    module: Any, source: Source, load_case: str | None = None, times: tuple[float, ...] = (), overlay: bool = False
) -> Any:
    """Draw the scene in one panel for each time (s), at the start where no time is given.

    At a time, members of which no law acts then (`active_from`, `active_until`) are drawn as not acting. Without one
    it is the design that is shown, with all its members as if they acted: also those that begin later.

    overlay: draw all times into one panel, earlier ones fainter.
    """
    case = source.case
    panels: list[tuple[float | None, Floats]] = [(None, start_state(case))]
    if times:
        name = load_case or source.load_cases[0]
        motion = source.motion(name, np.array(times))
        panels = list(zip(times, motion.q, strict=True))
    thick = thickness(source)
    if case.dimension > 2 and not overlay:
        return draw_space(module, source, panels, thick, load_case)
    stage = Stage(source, np.array([q for _, q in panels]), load_case, [t for t, _ in panels])
    count = 1 if overlay else len(panels)
    inches = _panel(stage, count)
    names = legend_names(case, load_case, bool(times))
    above = height_of(len(names), columns_of(names, WIDTH, COLUMNS), legend_title(case, thick))
    high = float(inches[1]) + BELOW + ABOVE
    figure = module.Figure(figsize=(WIDTH, above + count * high))
    x = 0.5 * (WIDTH - float(inches[0]) + (LEFT - RIGHT if case.dimension == 2 else 0.0))
    axes = [add_panel(figure, x, (count - 1 - k) * high + BELOW, inches) for k in range(count)]
    if overlay:
        _overlay(axes[0], stage, panels, thick, (load_case, inches))
    for axis, (t, q) in zip(axes, panels, strict=True) if not overlay else ():
        stage.draw(axis, q, thick, (load_case, t), inches)
        if t is not None:
            axis.set_title(f"t = {t:g} s", loc="left")
    add_legend(figure, axes, case, thick)
    return figure


def _panel(stage: Stage, count: int) -> Floats:
    """Inches (2,) that each of so many drawings has: as high as what is seen needs."""
    beside = LEFT + RIGHT if stage.case.dimension == 2 else MARGINS
    most = np.array([WIDTH - beside, min(MOST_HEIGHT, MOST_PAGE_HEIGHT / count - BELOW - ABOVE)])
    return fitted(stage.window(most), most)


def _overlay(
    axis: Any,
    stage: Stage,
    panels: list[tuple[float | None, Floats]],
    thick: Thickness,
    shown: tuple[str | None, Floats],
) -> None:
    """States in one drawing, the last in full colours with its members, the others fainter without.

    axis: where they are drawn.
    stage: what draws them.
    panels: times and states.
    thick: how thick members are.
    shown: the load case, and the size in inches.
    """
    case = stage.case
    t, q = panels[-1]
    stage.draw(axis, q, thick, (shown[0], t), shown[1])
    for k, (_, earlier) in enumerate(panels[:-1]):
        stage.draw_bodies(axis, earlier, 0.25 + 0.35 * k / max(1, len(panels) - 2))
    for k in range(len(case.bodies)):
        size = 3 if case.dimension == 2 else 7
        places = np.array([state[size * k : size * k + case.dimension] for _, state in panels])
        axis.plot(*stage.seen(places).T, ":", color=ink("middle"), linewidth=0.7, zorder=1.7)
    told = ", ".join(f"{at:.3g}" for at, _ in panels if at is not None)
    axis.set_title(f"t = {told} s", loc="left")


def add_legend(figure: Any, axes: list[Any], case: Case, thick: Thickness) -> None:
    """Add a legend of what is drawn, above the picture."""
    handles, labels = legend_handles(*axes)
    title = legend_title(case, thick)
    columns = columns_of(labels, WIDTH, COLUMNS)
    figure.legend(handles, labels, loc="upper left", ncols=columns, title=title, **SETTING)
