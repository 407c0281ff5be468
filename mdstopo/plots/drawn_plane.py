"""What is drawn of a scene in the plane at one state: bodies, points, contacts, members, symbols."""

from typing import Any

import numpy as np

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.body_shapes import Shape, followed, planar_shapes
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.legend import name_in_legend
from mdstopo.plots.member_lines import draw_members
from mdstopo.plots.scenery import edge_at, own_points
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.style import colour, ink
from mdstopo.plots.symbol_marks import Mark, draw_mark, draw_marks, ground_marks, marks_at
from mdstopo.plots.symbols import Symbol
from mdstopo.plots.thickness import Thickness
from mdstopo.scene.point_positions import points_at

#: points of ground that have its symbol, at most
MOST_GROUND = 60
#: points from the upper right corner of a picture to the middle of the arrow of gravity
GRAVITY = np.array([12.0, -10.0])


def draw_state(
    axis: Any,
    source: Source,
    q: Floats,
    thick: Thickness,
    marks: list[Mark],
    gravity: Floats,
    faint: float = 1.0,
    t: float | None = None,
) -> None:
    """Everything at a state q (3 n_bodies,).

    axis: where it is drawn; its limits are set.
    source: the result.
    q: the state.
    thick: how thick members are.
    marks: the symbols.
    gravity (2,): whose direction is shown.
    faint: how much of the colours of bodies is left, for overlays.
    t: the time that is shown, s, or None.
    """
    draw_bodies(axis, source.case, q, faint)
    _contacts(axis, source.case, q)
    draw_members(axis, source, q, lambda places: places, thick, t)
    draw_marks(axis, marks)
    if np.any(gravity):
        draw_gravity(axis, gravity)


def marks_of(case: Case, q: Floats, found: list[Symbol], scale: float) -> list[Mark]:
    """These symbols at a state, and those of ground, which are last. scale: points in a metre."""
    own = marks_at(case, found, q, lambda places: places, 1.0)
    return [*own, *ground_marks(_on_ground(case), own, scale)]


def draw_gravity(axis: Any, gravity: Floats) -> None:
    """Draw the direction of gravity as an arrow, to the right of the upper end of the picture."""
    from matplotlib.transforms import ScaledTranslation

    way = gravity / float(np.linalg.norm(gravity))
    glyph = glyphs()["gravity"]
    length = max(float(stroke[:, 0].max()) for stroke in glyph.strokes)
    foot = GRAVITY - 0.5 * length * way
    corner = axis.transAxes + ScaledTranslation(
        float(foot[0]) / 72.0, float(foot[1]) / 72.0, axis.figure.dpi_scale_trans
    )
    mark = Mark(glyph, np.ones(2), angle=float(np.arctan2(way[1], way[0])))
    draw_mark(axis, mark, transform=corner, clip_on=False)
    place = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "center", "va": "top"}
    axis.annotate(
        "g", (1.0, 1.0), xytext=GRAVITY - np.array([0.0, 0.5 * length + 1.0]), fontsize=7, color=ink(), **place
    )


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
        if name != GROUND:
            label = name_in_legend("body", name, case) if faint == 1.0 else None
            axis.plot(q[3 * k], q[3 * k + 1], "+", color=own, markersize=6, label=label, alpha=faint, zorder=2.6)


def _on_ground(case: Case) -> Floats:
    """(n, 2) the points of ground that are on no line, where they are few."""
    lines = [line for grid in case.points.values() if grid.body == GROUND for line in followed(grid.local)]
    drawn = {tuple(point) for line in lines for point in line.tolist()}
    loose = [point for point in np.unique(own_points(case, GROUND), axis=0) if tuple(point.tolist()) not in drawn]
    return np.array(loose if len(loose) <= MOST_GROUND else []).reshape(-1, 2)


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
        style = {"linewidth": 0.8, "linestyle": (0, (4, 2))} if shape.thin_arms else {"linewidth": 2.2}
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
