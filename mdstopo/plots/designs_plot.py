"""Two designs side by side: start and final of a result, or those of two results with what differs."""

from typing import Any

import numpy as np

from mdstopo.plots.member_lines import NARROWEST, widest_of
from mdstopo.plots.scenery import start_state
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import WIDTH, ink
from mdstopo.plots.thickness import FAINT, thickness

#: of the largest: a difference that is drawn
LEAST = 0.05
FIRST, SECOND = "#D55E00", "#0072B2"


def draw(module: Any, source: Source) -> Any:
    """The design that the optimiser began with, and that of the file, at the start of the motion."""
    case, q = source.stated, start_state(source.case)
    figure = module.Figure(figsize=(2.0 * WIDTH, 3.1))
    # points that are design variables began elsewhere; both pictures have one scale
    pair = (source.as_stated(), source)
    stages = [Stage(each, q[None]) for each in pair]
    window = np.concatenate([stage.cloud for stage in stages])
    axes, designs = figure.subplots(1, 2), (np.asarray(case.initial), source.alpha)
    for axis, shown, stage, design, title in zip(axes, pair, stages, designs, ("start", "design"), strict=True):
        stage.cloud = window
        thick = thickness(shown, design)
        stage.draw(axis, q, thick, (None, None))
        axis.set_title(f"{title}; width: {thick.what}" if thick.what else title, loc="left")
    return figure


def draw_pair(module: Any, first: Source, second: Source, titles: tuple[str, str]) -> Any:
    """Both designs, and below them the members of which there is more in the one or in the other."""
    figure = module.Figure(figsize=(2.0 * WIDTH, 6.2))
    axes = figure.subplots(2, 2)
    for axis, source, title in zip(axes[0], (first, second), titles, strict=True):
        q = start_state(source.case)
        Stage(source, q[None]).draw(axis, q, thickness(source), (None, None))
        axis.set_title(title, loc="left")
    for axis, source, other, colour, title in (
        (axes[1, 0], first, second, FIRST, "more in the first"),
        (axes[1, 1], second, first, SECOND, "more in the second"),
    ):
        _more(axis, source, other, colour)
        axis.set_title(title, loc="left")
    return figure


def _more(axis: Any, source: Source, other: Source, colour: str) -> None:
    """What members of a result have more of than those of another; all others are thin."""
    from matplotlib.collections import LineCollection

    q = start_state(source.case)
    stage = Stage(source, q[None])
    shares = thickness(source).shares
    blank = type(thickness(source))(tuple(np.zeros_like(share) for share in shares), "")
    stage.draw(axis, q, blank, (None, None), faint=0.5)
    known: dict[tuple[Any, ...], float] = {}
    for key, share in _by_ends(other):  # of members beside each other the thickest
        known[key] = max(share, known.get(key, 0.0))
    lines, widths = [], []
    for (key, share), end in zip(_by_ends(source), _all_ends(source, stage, q), strict=True):
        more = share - known.get(key, 0.0)
        if more > LEAST:
            lines.append(end)
            widths.append(more)
        elif share > FAINT:
            axis.plot(*end.T, "-", color=ink("faint"), linewidth=NARROWEST, zorder=2.0)
    widest = widest_of(len(lines))
    axis.add_collection(
        LineCollection(lines, colors=colour, linewidths=NARROWEST + widest * np.array(widths), zorder=2.4),
        autolim=False,
    )


def _by_ends(source: Source) -> list[tuple[tuple[Any, ...], float]]:
    found = []
    for group, share in zip(source.case.members, thickness(source).shares, strict=True):
        ends = np.concatenate([group.from_world[group.from_index], group.to_world[group.to_index]], axis=1)
        found += [
            ((group.body_from, group.body_to, *np.round(end, 9).tolist()), float(s))
            for end, s in zip(ends, share, strict=True)
        ]
    return found


def _all_ends(source: Source, stage: Stage, q: Floats) -> list[Floats]:
    ends = stage.ends(q)
    return [end for group in source.case.members for end in ends(group)]
