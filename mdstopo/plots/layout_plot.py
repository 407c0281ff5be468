"""The system: bodies, points, and members drawn by how much of them there is."""

from functools import partial
from typing import Any

import numpy as np

from mdstopo.case.model import GROUND
from mdstopo.plots.member_lines import draw_members
from mdstopo.plots.scenery import edge_at, ends_at, outline, start_state
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.space_layout import draw_space
from mdstopo.plots.style import COLOURS, WIDTH
from mdstopo.scene.points import points_at

#: how many times larger than the design a scene may be before its far ends (of contacts, say) are left out of the view
FAR, MARGIN = 2.0, 0.12
_CONTACT = "#222222"


def draw(module: Any, source: Source, load_case: str | None = None, times: tuple[float, ...] = ()) -> Any:
    """One panel a time, the start where none is given."""
    case = source.case
    panels: list[tuple[float | None, Floats]] = [(None, start_state(case))]
    if times:
        name = load_case or source.load_cases[0]
        motion = source.motion(name, np.array(times))
        panels = list(zip(times, motion.q, strict=True))
    if case.dimension > 2:
        return draw_space(module, source, panels)
    figure = module.Figure(figsize=(WIDTH, min(0.4 + 2.9 * len(panels), 9.0)))
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axis, (t, q) in zip(axes, panels, strict=True):
        _bodies(axis, source, q)
        _contacts(axis, source, q)
        draw_members(axis, source, partial(ends_at, case, q=q))
        axis.set_aspect("equal", adjustable="datalim")
        axis.set_xlabel("x, m")
        axis.set_ylabel("y, m")
        axis.margins(0.08)
        _look_at_design(axis, source, q)
        if t is not None:
            axis.set_title(f"t = {t:g} s", loc="left")
    handles, labels = axes[0].get_legend_handles_labels()
    title = "width of a line: alpha" if case.n_design else None
    figure.legend(handles, labels, loc="outside upper left", ncols=3, title=title, alignment="left")
    return figure


def _bodies(axis: Any, source: Source, q: Floats) -> None:
    case = source.case
    for k, name in enumerate([*(body.name for body in case.bodies), GROUND]):
        corners = outline(case, name)
        if not len(corners):
            continue
        colour = "#555555" if name == GROUND else COLOURS[(k + 2) % len(COLOURS)]
        if len(corners) > 2:
            placed = points_at(case, name, corners, q[None])[0]
            axis.fill(*placed.T, facecolor=colour, alpha=0.12, linewidth=0)
            axis.fill(*placed.T, facecolor="none", edgecolor=colour, linewidth=0.7)
        points = [grid.local for grid in case.points.values() if grid.body == name]
        if points:
            axis.plot(*points_at(case, name, np.concatenate(points), q[None])[0].T, ".", color=colour, markersize=2)
        if name != GROUND:
            axis.plot(q[3 * k], q[3 * k + 1], "+", color=colour, markersize=6, label=name)


def _contacts(axis: Any, source: Source, q: Floats) -> None:
    """Edges as lines, the points that may come against them as rings."""
    case = source.case
    for contact in case.contacts:
        label = "contact" if contact is case.contacts[0] else None
        axis.plot(*edge_at(case, contact, q).T, "-", color=_CONTACT, linewidth=1.8, alpha=0.6, label=label)
        places = points_at(case, contact.body, contact.points, q[None])[0]
        axis.plot(*places.T, "o", color=_CONTACT, markersize=3, markerfacecolor="none", markeredgewidth=0.6)


def _look_at_design(axis: Any, source: Source, q: Floats) -> None:
    """Leave out of view what lies far outside of the design: contacts keep their direction by an end far off."""
    case = source.case
    if not case.design_groups:
        return
    places = [q.reshape(-1, 3)[:, :2], *(ends_at(case, group, q).reshape(-1, 2) for group in case.design_groups)]
    low, high = np.concatenate(places).min(axis=0), np.concatenate(places).max(axis=0)
    width = float((high - low).max())
    everything = [ends_at(case, group, q).reshape(-1, 2) for group in case.members]
    everything += [edge_at(case, contact, q) for contact in case.contacts]
    if width > 0.0 and float(np.ptp(np.concatenate(everything), axis=0).max()) > FAR * width:
        axis.set_aspect("equal", adjustable="box")
        axis.set_xlim(low[0] - MARGIN * width, high[0] + MARGIN * width)
        axis.set_ylim(low[1] - MARGIN * width, high[1] + MARGIN * width)
