"""The system: bodies, points, and members drawn by how much of them there is."""

from typing import Any

import numpy as np

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.body_shapes import Shape, followed, planar_shapes
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.member_lines import draw_members, legend_title
from mdstopo.plots.scenery import edge_at, ends_at, own_points, start_state
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.space_layout import draw_space
from mdstopo.plots.style import MOST_NAMED, WIDTH, colour, ink
from mdstopo.plots.symbol_marks import draw_glyph, draw_symbols, legend_handles
from mdstopo.plots.symbols import symbols
from mdstopo.plots.thickness import Thickness, families, thickness
from mdstopo.scene.point_positions import points_at

#: how many times larger than the design a scene may be before its far ends (of contacts, say) are left out of the view
FAR, MARGIN = 2.0, 0.12
#: columns of a legend
COLUMNS = 3
#: points of ground that have its symbol, at most
MOST_GROUND = 60


def draw(
    module: Any, source: Source, load_case: str | None = None, times: tuple[float, ...] = (), overlay: bool = False
) -> Any:
    """Draw the scene in one panel for each time (s), at the start where no time is given.

    overlay: draw all times into one panel, earlier ones fainter.
    """
    case = source.case
    panels: list[tuple[float | None, Floats]] = [(None, start_state(case))]
    if times:
        name = load_case or source.load_cases[0]
        motion = source.motion(name, np.array(times))
        panels = list(zip(times, motion.q, strict=True))
    thick = thickness(source)
    if overlay:
        return _overlaid(module, source, panels, thick, load_case)
    if case.dimension > 2:
        return draw_space(module, source, panels, thick, load_case)
    rows = -(-legend_entries(case) // COLUMNS)
    figure = module.Figure(figsize=(WIDTH, min(0.3 + 0.16 * rows + 2.8 * len(panels), 10.0)))
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axis, (t, q) in zip(axes, panels, strict=True):
        draw_state(axis, source, q, thick, (load_case, t))
        if t is not None:
            axis.set_title(f"t = {t:g} s", loc="left")
    add_legend(figure, axes[0], case, thick)
    return figure


def _overlaid(
    module: Any, source: Source, panels: list[tuple[float | None, Floats]], thick: Thickness, load_case: str | None
) -> Any:
    """States in one drawing, the last in full colours with its members, the others fainter without."""
    from mdstopo.plots.stage import Stage

    case = source.case
    stage = Stage(source, np.array([q for _, q in panels]))
    figure = module.Figure(figsize=(WIDTH, 0.4 + 0.16 * -(-legend_entries(case) // COLUMNS) + 2.8))
    (axis,) = figure.subplots(1, 1, squeeze=False)[0]
    t, q = panels[-1]
    stage.draw(axis, q, thick, (load_case, t))
    for k, (_, earlier) in enumerate(panels[:-1]):
        stage.draw_bodies(axis, earlier, 0.25 + 0.35 * k / max(1, len(panels) - 2))
    for k in range(len(case.bodies)):
        size = 3 if case.dimension == 2 else 7
        places = np.array([state[size * k : size * k + case.dimension] for _, state in panels])
        axis.plot(*stage.seen(places).T, ":", color=ink("middle"), linewidth=0.7, zorder=1.7)
    told = ", ".join(f"{at:.3g}" for at, _ in panels if at is not None)
    axis.set_title(f"t = {told} s", loc="left")
    add_legend(figure, axis, case, thick)
    return figure


def draw_state(
    axis: Any, source: Source, q: Floats, thick: Thickness, shown: tuple[str | None, float | None], faint: float = 1.0
) -> None:
    """Everything at a state q (3 n_bodies,).

    axis: where it is drawn.
    source: the result.
    q: the state.
    thick: how thick members are.
    shown: the load case whose loads are drawn, and the time of them.
    faint: how much of the colours of bodies is left, for overlays.
    """
    case = source.case
    draw_bodies(axis, case, q, faint)
    _contacts(axis, case, q)
    draw_members(axis, source, q, lambda places: places, thick)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("x, m")
    axis.set_ylabel("y, m")
    axis.margins(0.08)
    _look_at_design(axis, source, q)
    draw_symbols(axis, case, symbols(case, *shown), q, lambda places: places)
    gravity = np.array(case.load_cases[0].gravity if shown[0] is None else case.load_case(shown[0]).gravity)
    if np.any(gravity):
        draw_gravity(axis, gravity)


def legend_entries(case: Case) -> int:
    """About how many entries the legend will have."""
    named = len(set(families(case)))
    kinds = {symbol.kind for symbol in symbols(case)}
    return len(case.bodies) + (named if named <= MOST_NAMED else 0) + len(kinds) + bool(case.contacts)


def add_legend(figure: Any, axis: Any, case: Case, thick: Thickness) -> None:
    """Add a legend of what is drawn, above the picture."""
    handles, labels = legend_handles(axis)
    title = legend_title(case, thick)
    figure.legend(handles, labels, loc="outside upper left", ncols=COLUMNS, title=title, alignment="left")


def draw_gravity(axis: Any, gravity: Floats) -> None:
    """Draw the direction of gravity as an arrow in the upper right corner."""
    angle = float(np.arctan2(gravity[1], gravity[0]))
    corner = axis.inset_axes((0.93, 0.86, 0.07, 0.14))
    corner.set_axis_off()
    corner.set_xlim(-1.0, 1.0)
    corner.set_ylim(-1.0, 1.0)
    draw_glyph(corner, glyphs()["gravity"], np.array([0.0, 0.6]), angle)
    for line in corner.lines:
        line.set_clip_on(False)
    corner.annotate("g", (0.0, 0.6), xytext=(4, -9), textcoords="offset points", fontsize=7, color=ink())


def draw_bodies(axis: Any, case: Case, q: Floats, faint: float = 1.0) -> None:
    """Bodies with their points at a state q, ground last. faint: how much of their colours is left."""
    for k, name in enumerate([*(body.name for body in case.bodies), GROUND]):
        own = ink("middle") if name == GROUND else colour(k + 2)
        for shape in planar_shapes(case, name):
            _shape(axis, case, name, shape, q, own, faint)
        points = [grid.local for grid in case.points.values() if grid.body == name]
        if points:
            places = points_at(case, name, np.concatenate(points), q[None])[0]
            axis.plot(*places.T, ".", color=own, markersize=2, alpha=faint, zorder=2.6)
        if name == GROUND and faint == 1.0:
            _ground(axis, case)
        if name != GROUND:
            label = name if faint == 1.0 else None
            axis.plot(q[3 * k], q[3 * k + 1], "+", color=own, markersize=6, label=label, alpha=faint, zorder=2.6)


def _ground(axis: Any, case: Case) -> None:
    """The symbol of ground at its points that are on no line, where they are few; below that of a joint or bushing."""
    ties: list[Any] = [*case.joints, *case.bushings]
    tied = {
        tuple(float(x) for x in at)
        for tie in ties
        for body, at in zip(tie.bodies, (tie.at_first, tie.at_second), strict=True)
        if body == GROUND
    }
    lines = [line for grid in case.points.values() if grid.body == GROUND for line in followed(grid.local)]
    drawn = {tuple(point) for line in lines for point in line.tolist()}
    loose = [point for point in np.unique(own_points(case, GROUND), axis=0) if tuple(point.tolist()) not in drawn]
    for place in loose if len(loose) <= MOST_GROUND else ():
        draw_glyph(axis, glyphs()["ground below" if tuple(place.tolist()) in tied else "ground"], place)


def _shape(axis: Any, case: Case, name: str, shape: Shape, q: Floats, own: str, faint: float) -> None:
    """Areas, lines, arms.

    axis: where they are drawn.
    case, name: whose body it is.
    shape: of the body.
    q: the state.
    own: the colour.
    faint: how much of it is left.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    def at(points: Floats) -> Floats:
        return np.asarray(points_at(case, name, points, q[None])[0])

    if shape.areas:
        loops = [np.concatenate([at(area), at(area[:1])]) for area in shape.areas]
        path = Path.make_compound_path(*(Path(_wound(loop, k), closed=True) for k, loop in enumerate(loops)))
        axis.add_patch(PathPatch(path, facecolor=own, alpha=0.14 * faint, linewidth=0))
        for loop in loops:
            axis.plot(*loop.T, "-", color=own, linewidth=0.8, alpha=faint, zorder=1.8)
    for line in shape.lines:
        axis.plot(*at(line).T, "-", color=own, linewidth=1.6, alpha=0.8 * faint, solid_capstyle="round", zorder=1.8)
    for arm in shape.arms:
        style = {"linewidth": 0.8, "linestyle": (0, (4, 2))} if shape.lines else {"linewidth": 2.2}
        axis.plot(*at(arm).T, color=own, alpha=0.7 * faint, solid_capstyle="round", zorder=1.8, **style)
    if shape.border is not None:
        border = at(np.concatenate([shape.border, shape.border[:1]]))
        axis.plot(*border.T, color=own, linewidth=0.7, linestyle=(0, (4, 3)), alpha=faint, zorder=1.8)


def _wound(loop: Floats, number: int) -> Floats:
    """The first area counterclockwise and the others the other way: where they lie in the first they are holes."""
    x, y = loop.T
    is_left = float(x[:-1] @ y[1:] - y[:-1] @ x[1:]) > 0.0
    return loop if is_left == (number == 0) else loop[::-1]


def _contacts(axis: Any, case: Case, q: Floats) -> None:
    """Edges as lines with hatches inside, the points that may come against them as rings."""
    for contact in case.contacts:
        label = "contact" if contact is case.contacts[0] else None
        ends = edge_at(case, contact, q)
        axis.plot(*ends.T, "-", color=ink(), linewidth=1.4, alpha=0.7, label=label, zorder=1.9)
        places = points_at(case, contact.body, contact.points, q[None])[0]
        axis.plot(*places.T, "o", color=ink(), markersize=3, markerfacecolor="none", markeredgewidth=0.6, zorder=2.7)


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
