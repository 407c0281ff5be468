"""Two designs side by side: start and final of a result, or those of two results with what differs."""

from typing import Any

import numpy as np

from mdstopo.plots.beside import side_places
from mdstopo.plots.layout_plot import COLUMNS
from mdstopo.plots.legend import SETTING, columns_of, height_of, legend_handles, legend_names
from mdstopo.plots.member_lines import NARROWEST, add_lines, legend_title, widest_of
from mdstopo.plots.panels import ABOVE, BELOW, LEFT, RIGHT, add_panel, fitted
from mdstopo.plots.same_members import same_members
from mdstopo.plots.scenery import start_state
from mdstopo.plots.slack import member_lines
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import WIDTH, difference, ink
from mdstopo.plots.thickness import FAINT, Thickness, alike, thickness

#: of the largest: a difference that is drawn
DRAWN_DIFFERENCE = 0.05
#: inches: how high a drawing is at most
MOST_HEIGHT = 2.5


def draw(module: Any, source: Source) -> Any:
    """The design that the optimiser began with, and that of the file, at the start of the motion."""
    case, q = source.stated, start_state(source.case)
    # points that are design variables began elsewhere; both pictures show the same part of the paper
    pair = (source.as_stated(), source)
    stages = [Stage(each, q[None]) for each in pair]
    Stage.show_alike(stages)
    figure, ((left, right),), inches = _panels(module, stages, 1)
    axes, designs = (left, right), (np.asarray(case.initial), source.alpha)
    for axis, shown, stage, design, title in zip(axes, pair, stages, designs, ("start", "design"), strict=True):
        thick = thickness(shown, design)
        stage.draw(axis, q, thick, (None, None), inches)
        axis.set_title(f"{title}; width: {thick.what}" if thick.what else title, loc="left")
    return figure


def draw_pair(module: Any, first: Source, second: Source, titles: tuple[str, str]) -> Any:
    """Both designs, and below them the members of which there is more in the one or in the other.

    Widths are relative to the largest of both designs, where they show the same of both. A legend stands above each
    design; one is enough where both have the same groups.
    """
    stages = [Stage(source, start_state(source.case)[None]) for source in (first, second)]
    if first.case.dimension == second.case.dimension:  # what is compared has one scale
        Stage.show_alike(stages)
    thick = alike(first, second)
    names = [legend_names(stage.case) for stage in stages]
    titled = [legend_title(stage.case, own) for stage, own in zip(stages, thick, strict=True)]
    heights = [
        height_of(len(own), columns_of(own, WIDTH, COLUMNS), told) for own, told in zip(names, titled, strict=True)
    ]
    figure, axes, inches = _panels(module, stages, 2, max(heights))
    for axis, stage, own, title in zip(axes[0], stages, thick, titles, strict=True):
        stage.draw(axis, start_state(stage.case), own, (None, None), inches)
        axis.set_title(title, loc="left")
    pairs = np.array(same_members(first.case, second.case), dtype=np.intp).reshape(-1, 2)
    one, other = (np.concatenate([*each.shares, np.zeros(0)]) for each in thick)
    more, less = one.copy(), other.copy()
    more[pairs[:, 0]] -= other[pairs[:, 1]]
    less[pairs[:, 1]] -= one[pairs[:, 0]]
    for axis, stage, own, rise, title in (
        (axes[1][0], stages[0], thick[0], more, "more in the first"),
        (axes[1][1], stages[1], thick[1], less, "more in the second"),
    ):
        _more(axis, stage, own, rise, inches)
        axis.set_title(title, loc="left")
    _add_legends(figure, axes[0], titled, names[0] == names[1] and titled[0] == titled[1])
    return figure


def _add_legends(figure: Any, axes: list[Any], titles: list[str | None], same: bool) -> None:
    """Add what the colours of two drawings mean, above each, or above the first where it is the same of both.

    axes: the drawings. titles: of their legends.
    """
    for k, (axis, title) in enumerate(zip(axes[: 1 if same else 2], titles, strict=False)):
        handles, labels = legend_handles(axis)
        columns = columns_of(labels, WIDTH, COLUMNS)
        beside = {"loc": "upper left", "bbox_to_anchor": (0.5 * k, 1.0), "ncols": columns, "title": title}
        figure.legend(handles, labels, **beside, **SETTING)


def _panels(module: Any, stages: list[Stage], rows: int, above: float = 0.0) -> tuple[Any, list[list[Any]], Floats]:
    """A figure, rows of two drawings as high as what is seen needs, and their size in inches (2,).

    above: inches that are free above all of them.
    """
    most = np.array([WIDTH - LEFT - RIGHT, MOST_HEIGHT])
    inches = np.max([fitted(stage.window(most), most) for stage in stages], axis=0)
    high = float(inches[1]) + BELOW + ABOVE
    figure = module.Figure(figsize=(2.0 * WIDTH, rows * high + above))
    places = [[(k * WIDTH + LEFT, (rows - 1 - row) * high + BELOW) for k in range(2)] for row in range(rows)]
    return figure, [[add_panel(figure, x, y, inches) for x, y in row] for row in places], inches


def _more(axis: Any, stage: Stage, thick: Thickness, every: Floats, inches: Floats) -> None:
    """What members of a result have more of than those of another; all others are thin.

    axis: where they are drawn.
    stage: what draws the result.
    thick: how thick its members are.
    every (K,): how much more there is of each, as a share.
    inches (2,): the size of the drawing.
    """
    case, q = stage.case, start_state(stage.case)
    blank = Thickness(tuple(np.zeros_like(share) for share in thick.shares), "")
    stage.draw(axis, q, blank, (None, None), inches, faint=0.5)
    more = np.split(every, np.cumsum([len(group) for group in case.members]))[:-1]
    drawn = [
        np.flatnonzero((rise > DRAWN_DIFFERENCE) | (share > FAINT))
        for rise, share in zip(more, thick.shares, strict=True)
    ]
    widest = widest_of(int((every > DRAWN_DIFFERENCE).sum()))
    for group, some, side, rise in zip(case.members, drawn, side_places(case, drawn), more, strict=True):
        lines, _ = member_lines(case, group, q, stage.seen, some)
        is_more = rise[some] > DRAWN_DIFFERENCE
        add_lines(axis, lines[~is_more], side[~is_more], widest, colors=ink("faint"), linewidths=NARROWEST, zorder=2.0)
        widths = NARROWEST + widest * rise[some][is_more]
        add_lines(axis, lines[is_more], side[is_more], widest, colors=difference(), linewidths=widths, zorder=2.4)
