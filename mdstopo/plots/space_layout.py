"""The system in space: front, top, side, all to one scale, and perspective."""

from typing import Any

import numpy as np

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.member_lines import draw_members, legend_title
from mdstopo.plots.scenery import Floats, ends_at, hull, points_of
from mdstopo.plots.solids import Solid, solid
from mdstopo.plots.source import Source
from mdstopo.plots.style import MOST_NAMED, WIDTH, colour, ink
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.symbol_marks import draw_symbols, legend_handles
from mdstopo.plots.symbols import symbols
from mdstopo.plots.thickness import Thickness, families
from mdstopo.plots.views import View, views
from mdstopo.scene.point_positions import points_at

#: inches: a page's width, its greatest height; left of a panel, below it, above it; a line of the legend, its title
PAGE, TALL = 2.0 * WIDTH, 9.0
LEFT, BELOW, ABOVE, LINE, HEAD = 0.55, 0.42, 0.22, 0.14, 0.22
#: inches: a name in the legend has so much beside its letters, and so much for each
BESIDE, LETTER = 0.55, 0.062
#: share of the scene's size that is left free around it; the least of a panel's sides, in the longest one's
MARGIN, LEAST = 0.07, 0.55
#: inches: the axes' directions in the corner of the perspective
ARROW = 0.17
#: how many times larger than the design a scene may be before what is far off is left out of the view
FAR = 2.0
_AXES = ("#B22222", "#2E7D32", "#1F4FA3")


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
    cloud = scene_cloud(case, [q for _, q in panels], solids)
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    middle = 0.5 * (low + high)
    seen = views(case, middle, max(0.5 * float(np.linalg.norm(high - low)), 1e-12))
    extent = np.maximum(high - low, LEAST * max(float((high - low).max()), 1e-9)) * (1.0 + 2.0 * MARGIN)
    sizes = [float(extent @ np.abs(row)) for row in (seen["front"].across, seen["top"].along, seen["front"].along)]
    columns, lines = _legend(case, load_case)
    places, inches, scale = _arrange(sizes, len(panels), HEAD + LINE * lines)
    figure = module.Figure(figsize=inches)
    figure.set_layout_engine("none")  # the panels' places give all views one scale
    for k, (t, q) in enumerate(panels):
        for name, view in seen.items():
            x, y, width, height = places[k][name]
            axis = figure.add_axes((x / inches[0], y / inches[1], width / inches[0], height / inches[1]))
            draw_frame(axis, view, np.array([width, height]) / scale, cloud)
            draw_scene(axis, source, view, q, solids)
            draw_members(axis, source, q, view.seen, thick)
            draw_symbols(axis, case, symbols(case, load_case, t), q, view.seen)
            words = name if t is None or name != "front" else f"{name}, t = {t:g} s"
            axis.set_title(words, loc="left")
    handles, labels = legend_handles(figure.axes[0])
    title = legend_title(case, thick)
    figure.legend(handles, labels, loc="upper left", ncols=columns, title=title, alignment="left", borderaxespad=0.3)
    return figure


_Places = list[dict[str, tuple[float, float, float, float]]]


def _legend(case: Case, load_case: str | None) -> tuple[int, int]:
    """How many columns and lines the names in the legend take, at most six columns."""
    groups = dict.fromkeys(families(case))
    names = [*(body.name for body in case.bodies), GROUND, *["contact"] * bool(surfaces_of(case))]
    names += {glyphs()[each.kind].words: None for each in symbols(case, load_case)}
    names += groups if len(groups) <= MOST_NAMED else []
    wide = BESIDE + LETTER * max(map(len, names))
    columns = min(6, max(1, int((PAGE - 0.2) / wide)), len(names))
    return columns, -(-len(names) // columns)


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
    scale = min((PAGE - len(columns) * LEFT - 0.1) / sum(columns), max(free, 1.0) / sum(rows))
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


def scene_cloud(case: Case, states: list[Floats], solids: dict[str, Solid]) -> Floats:
    """(n, 3) places between which everything is that is drawn, without what lies far outside of the design."""
    own = {name: np.concatenate([points_of(case, name), shape.corners]) for name, shape in solids.items()}
    for each in surfaces_of(case):
        if not each.endless:
            own[each.body] = np.concatenate([own[each.body], *each.lines])
    every = np.concatenate([points_at(case, name, own[name], np.array(states)).reshape(-1, 3) for name in own])
    designed = [ends_at(case, group, q).reshape(-1, 3) for q in states for group in case.design_groups]
    if case.design_groups:
        inner = np.concatenate([*designed, *(q.reshape(-1, 7)[:, :3] for q in states)])
        if float(np.ptp(every, axis=0).max()) > FAR * float(np.ptp(inner, axis=0).max()) > 0.0:
            return inner
    return every


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
            axis.plot(*view.seen(q[7 * k : 7 * k + 3]), "+", color=own, markersize=6, label=name)


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
    width = 0.8 if shape.faces else 1.6
    near = [flat[list(edge)] for edge in shape.edges if (min(edge), max(edge)) in front or not shape.faces]
    far = [flat[list(edge)] for edge in shape.edges if (min(edge), max(edge)) not in front and shape.faces]
    for lines, alpha, order in ((near, 1.0, 2.1), (far, 0.3, 1.5)):
        axis.add_collection(
            LineCollection(lines, colors=own, linewidths=width, alpha=alpha, zorder=order), autolim=False
        )


def _faces(axis: Any, view: View, flat: Floats, shape: Solid, own: str) -> None:
    """The faces that look to the eye, each as one area without a border."""
    from matplotlib.collections import PolyCollection

    turn = np.array([_sign(view.across), _sign(view.along)])
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
        flat = view.seen(corners[list(face)]) * np.array([_sign(view.across), _sign(view.along)])
        x, y = flat.T
        if float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) > 0.0:
            found |= {(min(a, b), max(a, b)) for a, b in zip(face, (*face[1:], face[0]), strict=True)}
    return found


def _sign(direction: Floats) -> float:
    """-1 of an axis of the case that a view shows backwards."""
    return -1.0 if direction.min() == -1.0 else 1.0


def draw_frame(axis: Any, view: View, size: Floats, cloud: Floats) -> None:
    """The window and the axes. size: of the window in m; cloud (n, 3): what is to be seen."""
    axis.set_aspect("equal", adjustable="box")
    if np.isfinite(view.eye):
        _corner(axis, view, size, cloud)
        return
    for k, way in enumerate((view.across, view.along)):
        number = int(np.argmax(np.abs(way)))
        centre = 0.5 * float(cloud[:, number].min() + cloud[:, number].max())
        ends = centre - 0.5 * _sign(way) * size[k], centre + 0.5 * _sign(way) * size[k]
        (axis.set_xlim if k == 0 else axis.set_ylim)(*ends)
        (axis.set_xlabel if k == 0 else axis.set_ylabel)(f"{'xyz'[number]}, m")


def _corner(axis: Any, view: View, size: Floats, cloud: Floats) -> None:
    """Perspective: a window around everything, without a scale but with the axes' directions in a corner."""
    seen = view.seen(cloud)
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    wide = max(float((np.ptp(seen, axis=0) / size).max()), 1e-12) * (1.0 + 2.0 * MARGIN) * size
    axis.set_xlim(middle[0] - 0.5 * wide[0], middle[0] + 0.5 * wide[0])
    axis.set_ylim(middle[1] - 0.5 * wide[1], middle[1] + 0.5 * wide[1])
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_visible(False)
    inches = float(axis.get_position().width * axis.figure.get_figwidth())
    foot = middle + np.array([-0.42, -0.42]) * wide
    for k, own in enumerate(_AXES):
        way = ARROW * wide[0] / inches * np.array([view.across[k], view.along[k]])
        axis.plot(*np.array([foot, foot + way]).T, "-", color=own, linewidth=1.2, clip_on=False)
        axis.text(*(foot + 1.35 * way), "xyz"[k], color=own, ha="center", va="center", fontsize=8)
