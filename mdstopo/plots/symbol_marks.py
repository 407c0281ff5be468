"""Symbols of joints, loads and motions in pictures, and of ground."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.glyphs import Glyph, glyphs
from mdstopo.plots.scenery import Floats
from mdstopo.plots.style import ink, paper
from mdstopo.plots.symbols import Symbol, placed

#: arrows of small loads are not shorter than this share of that of the largest
SHORTEST_ARROW = 0.45
#: below this share of its length a direction points to the eye, or away
END_ON = 0.2
#: points between a symbol and that of the ground below it
BELOW = 0.8
#: points: how large a symbol is in a legend, and how high, at most
MOST_SIZE, MOST_HEIGHT = 13.0, 10.0
#: coordinates on the paper that run to the right and up
AHEAD = np.ones(2)


@dataclass(frozen=True)
class Mark:
    """A symbol on the paper: where it stands (2,), the place of its other end (2,), the angle of its direction, its
    size, whether it turns clockwise, what the legend names it by where it may be seen end on here.

    is_tie: whether it is that of a joint or a bushing; below: points by which it is moved down the paper.
    """

    glyph: Glyph
    place: Floats
    end: Floats | None = None
    angle: float = 0.0
    scale: float = 1.0
    mirrored: bool = False
    label: Glyph | None = None
    is_tie: bool = False
    below: float = 0.0

    @property
    def strokes(self) -> list[Floats]:
        """Its lines (n, 2) in points around its place."""
        c, s = self.scale * np.cos(self.angle), self.scale * np.sin(self.angle)
        turn, flip = np.array([[c, s], [-s, c]]), np.array([1.0, -1.0 if self.mirrored else 1.0])
        return [(stroke * flip) @ turn - np.array([0.0, self.below]) for stroke in self.glyph.strokes]

    @property
    def reach(self) -> Floats:
        """(2, 2) points from its place to its lower left and its upper right corner."""
        cloud = np.concatenate(self.strokes)
        return np.array([cloud.min(axis=0), cloud.max(axis=0)])


def marks_at(
    case: Case, found: list[Symbol], q: Floats, seen: Callable[[Floats], Floats], size: float, signs: Floats = AHEAD
) -> list[Mark]:
    """Symbols at a state.

    case: whose.
    found: which.
    q: the state.
    seen: places (n, d) on the paper (n, 2).
    size: of the scene, m.
    signs (2,): -1 where coordinates on the paper run backwards.
    """
    marks = []
    for symbol in found:
        at, way, end = placed(case, symbol, q)
        named = glyph = glyphs()[symbol.kind]
        angle, scale = 0.0, 1.0
        if way is not None:
            ends = seen(np.array([at, at + 0.01 * size * way]))
            flat = signs * (ends[1] - ends[0]) / (0.01 * size)
            if float(np.hypot(*flat)) < END_ON and symbol.kind in ("load", "motion", "held"):
                glyph = glyphs()["distance"]  # end on: a dot
            angle = float(np.arctan2(flat[1], flat[0]))
        if symbol.kind == "load":
            scale = max(SHORTEST_ARROW, abs(symbol.size))
        elif symbol.kind in ("motion", "turning"):
            scale = 0.8
        if symbol.size == 0.0:
            scale = 0.0
        there = None if end is None else seen(end[None])[0]
        place = seen(at[None])[0]
        marks.append(Mark(glyph, place, there, angle, scale, symbol.size < 0.0, named, symbol.is_tie))
    return marks


def ground_marks(places: Floats, others: list[Mark], scale: float) -> list[Mark]:
    """The symbol of ground at places (n, 2) on the paper, each below the joints and bushings that it would lie over.

    others: all other symbols. scale: points (1/72 inch) in a metre.
    """
    glyph = glyphs()["ground"]
    found = []
    for place in places:
        mark = Mark(glyph, place)
        for other in others:
            for end in (other.place, other.place if other.end is None else other.end) if other.is_tie else ():
                own, its = mark.reach, other.reach + scale * (end - place)
                if (own[0] < its[1]).all() and (its[0] < own[1]).all():
                    mark = replace(mark, below=max(mark.below, BELOW - float(its[0, 1])))
        found.append(mark)
    return found


def draw_marks(axis: Any, marks: list[Mark]) -> None:
    """Symbols, each kind with an entry in the legend."""
    named: set[str] = set()
    for mark in marks:
        if mark.end is not None:
            axis.plot(*np.array([mark.place, mark.end]).T, "-", color=ink(), linewidth=1.2, zorder=3.0)
            draw_mark(axis, replace(mark, place=mark.end))
        draw_mark(axis, mark)
        if mark.label is not None and mark.label.words not in named:
            named.add(mark.label.words)
            path = _all_of(mark.label)
            size = 2.0 * float(np.abs(path.vertices).max())
            size *= min(1.0, MOST_SIZE / size, MOST_HEIGHT / float(np.ptp(path.vertices[:, 1])))
            axis.plot([], [], marker=path, markersize=size, color=ink(), markeredgewidth=0.7,
                      markerfacecolor="none", linestyle="none", label=mark.label.words)  # fmt: skip


def draw_mark(axis: Any, mark: Mark, **how: Any) -> None:
    """One symbol in points, whatever the scale of the picture. how: other settings of its lines."""
    from matplotlib.path import Path

    for stroke, flat in zip(mark.glyph.strokes, mark.strokes, strict=True):
        is_closed = bool(np.array_equal(stroke[0], stroke[-1]))
        fill = {"paper": paper(), "ink": ink()}.get(mark.glyph.fill, "none") if is_closed else "none"
        settings = {"markeredgecolor": ink(), "markeredgewidth": 0.8, "linestyle": "none", "zorder": 3.2, **how}
        axis.plot(
            *mark.place[:, None], marker=Path(flat), markersize=2.0 * float(np.abs(flat).max()), color=ink(),
            markerfacecolor=fill, **settings,
        )  # fmt: skip


def _all_of(glyph: Glyph) -> Any:
    """All lines of a symbol around its middle, for a legend."""
    from matplotlib.path import Path

    cloud = np.concatenate(glyph.strokes)
    middle = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    return Path.make_compound_path(*(Path(stroke - middle) for stroke in glyph.strokes))
