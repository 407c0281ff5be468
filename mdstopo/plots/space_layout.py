"""The system in space: front, top, side, all to one scale, and perspective."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mdstopo.case.model import GROUND
from mdstopo.plots.acting import acting
from mdstopo.plots.cloud import scene_cloud
from mdstopo.plots.legend import SETTING, columns_of, height_of, legend_handles, legend_names, name_in_legend
from mdstopo.plots.member_lines import draw_members, legend_title
from mdstopo.plots.panels import ABOVE, BELOW, LEFT
from mdstopo.plots.scenery import Floats, hull
from mdstopo.plots.solids import Solid, solid
from mdstopo.plots.source import Source
from mdstopo.plots.style import WIDTH, colour, ink, is_dark
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.symbol_marks import Mark, draw_marks, marks_at
from mdstopo.plots.symbols import symbols
from mdstopo.plots.thickness import Thickness
from mdstopo.plots.views import View, views
from mdstopo.plots.window import AROUND, FREE, MOST_BEYOND, places_and_reaches, window
from mdstopo.scene.point_positions import points_at

#: inches: a page's width, its greatest height; its right margin
PAGE, TALL, MARGIN = 2.0 * WIDTH, 9.0, 0.1
#: columns of a legend, at most
COLUMNS = 6
#: the least of a panel's sides, in the longest one's
LEAST_SIDE = 0.4
#: times that the panels are adapted to the scale they have
ADAPTATIONS = 4
#: inches: the axes' directions in the corner of the perspective
ARROW = 0.17
#: colours of the axes x, y, z on a light and on a dark ground
_AXES, _AXES_ON_DARK = ("#B22222", "#2E7D32", "#1F4FA3"), ("#FF7A7A", "#6CC070", "#7FB0FF")


def draw_space(
    module: Any,
    source: Source,
    panels: list[tuple[float | None, Floats]],
    thick: Thickness,
    load_case: str | None = None,
) -> Any:
    """The four views of each state; one below the other where there are several times, each in a row."""
    case = source.case
    solids = {name: solid(case, name) for name in [*(body.name for body in case.bodies), GROUND]}
    cloud = scene_cloud(
        case, np.array([q for _, q in panels]), solids, lambda group, k: acting(source, group, panels[k][0])
    )
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    radius = max(0.5 * float(np.linalg.norm(high - low)), 1e-12)
    seen = views(case, 0.5 * (low + high), radius)
    marks = {
        name: [marks_at(case, symbols(case, load_case, t), q, view.seen, radius, view.signs) for t, q in panels]
        for name, view in seen.items()
    }
    names = legend_names(case, load_case, panels[0][0] is not None)
    columns = columns_of(names, PAGE - MARGIN, COLUMNS)
    (places, inches), box, scale = _adapted(
        seen, (low, high), marks, len(panels), height_of(len(names), columns, legend_title(case, thick))
    )
    figure = module.Figure(figsize=inches)
    figure.set_layout_engine("none")  # the panels' places give all views one scale
    for k, (t, q) in enumerate(panels):
        for name, view in seen.items():
            x, y, width, height = places[k][name]
            axis = figure.add_axes((x / inches[0], y / inches[1], width / inches[0], height / inches[1]))
            size = np.array([width, height])
            if np.isfinite(view.eye):
                every = [mark for some in marks[name] for mark in some]
                draw_perspective(axis, view, window(view.seen(cloud), every, size), size)
            else:
                _draw_frame(axis, view, size / scale, box)
            draw_scene(axis, source, view, q, solids)
            draw_members(axis, source, q, view.seen, thick, t)
            draw_marks(axis, marks[name][k])
            words = name if t is None or name != "front" else f"{name}, t = {t:g} s"
            axis.set_title(words, loc="left")
    handles, labels = legend_handles(*figure.axes[:: len(seen)])
    title = legend_title(case, thick)
    figure.legend(handles, labels, loc="upper left", ncols=columns, title=title, **SETTING)
    return figure


_Places = list[dict[str, tuple[float, float, float, float]]]


def _adapted(
    seen: Mapping[str, View],
    box: tuple[Floats, Floats],
    marks: Mapping[str, list[list[Mark]]],
    count: int,
    legend: float,
) -> tuple[tuple[_Places, tuple[float, float]], tuple[Floats, Floats], float]:
    """Where panels are and the picture's size, between which places (3,) everything is seen, inches in a metre.

    seen: the views.
    box: lowest and highest coordinates (3,) of what is drawn.
    marks: of each view and state the symbols, which are seen whole.
    count: states.
    legend: its height in inches.
    """
    low, high = box
    first, last = box
    beyond = MOST_BEYOND * max(float((high - low).max()), 1e-9)
    for _ in range(ADAPTATIONS):
        least = LEAST_SIDE * max(float((last - first).max()), 1e-9)
        extent = np.maximum(last - first, least)
        sizes = [float(extent @ np.abs(row)) for row in (seen["front"].across, seen["top"].along, seen["front"].along)]
        places, inches, scale = _arrange(sizes, count, legend)
        room = 1.0 / (72.0 * scale)
        first, last = low - FREE * room, high + FREE * room
        for name in ("front", "top", "side"):
            view = seen[name]
            at, reach = places_and_reaches([mark for some in marks[name] for mark in some])
            for k, way in enumerate((view.across, view.along)):
                number = int(np.argmax(np.abs(way)))
                ends = np.sort(view.signs[k] * (reach[..., k] + AROUND * np.array([-1.0, 1.0])), axis=1) * room
                first[number] = min(first[number], float((at[:, k] + ends[:, 0]).min(initial=np.inf)))
                last[number] = max(last[number], float((at[:, k] + ends[:, 1]).max(initial=-np.inf)))
        first, last = np.maximum(first, low - beyond), np.minimum(last, high + beyond)
    return (places, inches), (first, last), scale


def _arrange(sizes: list[float], count: int, legend: float) -> tuple[_Places, tuple[float, float], float]:
    """Where the panels of each state are (x, y, width, height in inches), the picture's size, and inches in a metre.

    sizes: how much there is to be seen across, away and up. legend: its height in inches. One state has two rows, the
    top view above the front view and the side view to the right of it, as on a drawing; of several states each has a
    row.
    """
    across, away, up = sizes
    if count == 1:
        columns, rows = [across, away], [away, up]
        where = {"front": (0, 1), "top": (0, 0), "side": (1, 1), "perspective": (1, 0)}
    else:
        columns, rows = [across, across, away, max(across, away)], [max(away, up)] * count
        where = {"front": (0, 0), "top": (1, 0), "side": (2, 0), "perspective": (3, 0)}
    free = TALL - legend - len(rows) * (BELOW + ABOVE)
    scale = min((PAGE - len(columns) * LEFT - MARGIN) / sum(columns), max(free, 1.0) / sum(rows))
    height = legend + len(rows) * (BELOW + ABOVE) + scale * sum(rows)
    places = []
    for k in range(count):
        own = {}
        for name, (column, row) in where.items():
            x = LEFT * (column + 1) + scale * sum(columns[:column])
            y = height - legend - (row + k + 1) * (BELOW + ABOVE) - scale * sum(rows[: row + k + 1]) + BELOW
            own[name] = (x, y, scale * columns[column], scale * rows[row + k])
        places.append(own)
    return places, (PAGE, height), scale


def draw_scene(axis: Any, source: Source, view: View, q: Floats, solids: dict[str, Solid]) -> None:
    """Surfaces, bodies, members between their nearer and their farther edges, joints."""
    case, state = source.case, q[None]
    for number, surface in enumerate(surfaces_of(case)):
        for k, line in enumerate(surface.lines):
            label = "contact" if number == k == 0 else None
            flat = view.seen(points_at(case, surface.body, line, state)[0])
            axis.plot(*flat.T, "-", color=ink("middle"), linewidth=0.5, alpha=0.8, zorder=1.4, label=label)
    for k, (name, shape) in enumerate(solids.items()):
        own = ink("middle") if name == GROUND else colour(k + 2)
        if len(shape.corners):
            _outline(axis, view, points_at(case, name, shape.corners, state)[0], shape, own)
        points = [grid.local for grid in case.points.values() if grid.body == name]
        if points:
            axis.plot(*view.seen(points_at(case, name, np.concatenate(points), state)[0]).T, ".", color=own, ms=2)
        if name != GROUND:
            axis.plot(
                *view.seen(q[7 * k : 7 * k + 3]), "+", color=own, markersize=6, label=name_in_legend("body", name, case)
            )


def _outline(axis: Any, view: View, corners: Floats, shape: Solid, own: str) -> None:
    """The area that a body covers, its edges, and fainter those behind it."""
    from matplotlib.collections import LineCollection

    flat = view.seen(corners)
    if len(shape.faces) and shape.convex:
        area = hull(flat)
        if len(area) > 2:
            axis.fill(*area.T, facecolor=own, alpha=0.12, linewidth=0)
    elif len(shape.faces):
        _faces(axis, view, flat, shape, own)
    front = _in_front(view, corners, shape)
    width, full = (0.8, 1.0) if shape.faces else (1.1, 0.6)  # lines alone are fainter than members
    near = [flat[list(edge)] for edge in shape.edges if (min(edge), max(edge)) in front or not shape.faces]
    far = [flat[list(edge)] for edge in shape.edges if (min(edge), max(edge)) not in front and shape.faces]
    for lines, alpha, order in ((near, full, 2.1), (far, 0.3, 1.5)):
        axis.add_collection(
            LineCollection(lines, colors=own, linewidths=width, alpha=alpha, zorder=order), autolim=False
        )


def _faces(axis: Any, view: View, flat: Floats, shape: Solid, own: str) -> None:
    """The faces that look to the eye, each as one area without a border."""
    from matplotlib.collections import PolyCollection

    turn = view.signs
    some = []
    for face in shape.faces:
        x, y = (flat[list(face)] * turn).T
        if len(shape.faces) == 1 or float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0.0:
            some.append(flat[list(face)])
    axis.add_collection(
        PolyCollection(some, facecolors=own, alpha=0.14, linewidths=0, antialiaseds=False), autolim=False
    )


def _in_front(view: View, corners: Floats, shape: Solid) -> set[tuple[int, int]]:
    """The edges of faces that look to the eye; all where there is no inside."""
    if len(shape.faces) < 2:
        return set(shape.edges)
    found = set()
    for face in shape.faces:
        flat = view.seen(corners[list(face)]) * view.signs
        x, y = flat.T
        if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0.0:
            found |= {(min(a, b), max(a, b)) for a, b in zip(face, (*face[1:], face[0]), strict=True)}
    return found


def _draw_frame(axis: Any, view: View, size: Floats, box: tuple[Floats, Floats]) -> None:
    """The window and the axes. size: of the window in m; box: lowest and highest coordinates (3,) that are seen."""
    axis.set_aspect("equal", adjustable="box")
    for k, way in enumerate((view.across, view.along)):
        number = int(np.argmax(np.abs(way)))
        centre = 0.5 * float(box[0][number] + box[1][number])
        ends = centre - 0.5 * view.signs[k] * size[k], centre + 0.5 * view.signs[k] * size[k]
        (axis.set_xlim if k == 0 else axis.set_ylim)(*ends)
        (axis.set_xlabel if k == 0 else axis.set_ylabel)(f"{'xyz'[number]}, m")


def draw_perspective(axis: Any, view: View, box: tuple[Floats, Floats], inches: Floats) -> None:
    """A window without a scale but with the axes' directions in a corner.

    box: lower left and upper right corner (2,) of what is seen. inches (2,): the size of the window.
    """
    axis.set_aspect("equal", adjustable="box")
    low, high = box
    wide = inches * float(((high - low) / inches).max())
    middle = 0.5 * (low + high)
    axis.set_xlim(middle[0] - 0.5 * wide[0], middle[0] + 0.5 * wide[0])
    axis.set_ylim(middle[1] - 0.5 * wide[1], middle[1] + 0.5 * wide[1])
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_visible(False)
    foot = middle + np.array([-0.42, -0.42]) * wide
    for k, own in enumerate(_AXES_ON_DARK if is_dark() else _AXES):
        way = ARROW * wide[0] / inches[0] * np.array([view.across[k], view.along[k]])
        axis.plot(*np.array([foot, foot + way]).T, "-", color=own, linewidth=1.2, clip_on=False)
        axis.text(*(foot + 1.35 * way), "xyz"[k], color=own, ha="center", va="center", fontsize=8)
