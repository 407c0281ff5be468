"""Symbols of joints, loads and motions in pictures."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.glyphs import Glyph, glyphs
from mdstopo.plots.scenery import Floats
from mdstopo.plots.style import ink, paper
from mdstopo.plots.symbols import Symbol, placed

#: arrows of small loads are not shorter than this share of that of the largest
SHORTEST = 0.45
#: below this share of its length a direction points to the eye, or away
END_ON = 0.2


def draw_symbols(axis: Any, case: Case, found: list[Symbol], q: Floats, seen: Callable[[Floats], Floats]) -> None:
    """Symbols at a state q. seen: places (n, d) on the paper (n, 2)."""
    named: set[str] = set()
    size = float(np.ptp(np.concatenate([axis.get_xlim(), axis.get_ylim()]))) or 1.0
    for symbol in found:
        at, way, end = placed(case, symbol, q)
        glyph = glyphs()[symbol.kind]
        label = glyph if glyph.words not in named else None
        named.add(glyph.words)
        here = seen(at[None])[0]
        if end is not None:
            there = seen(end[None])[0]
            axis.plot(*np.array([here, there]).T, "-", color=ink(), linewidth=1.2, zorder=3.0)
            draw_glyph(axis, glyph, there)
        angle, scale, turned = 0.0, 1.0, symbol.size < 0.0
        if way is not None:
            ends = seen(np.array([at, at + 0.01 * size * way]))
            flat = (ends[1] - ends[0]) / (0.01 * size)
            length = float(np.hypot(*flat))
            if length < END_ON and symbol.kind in ("load", "motion", "held"):
                glyph = glyphs()["distance"]  # end on: a dot
            angle = float(np.arctan2(flat[1], flat[0]))
        if symbol.kind == "load":
            scale = max(SHORTEST, abs(symbol.size))
        elif symbol.kind in ("motion", "turning"):
            scale = 0.8
        draw_glyph(axis, glyph, here, angle, scale, turned, label)


def draw_glyph(
    axis: Any,
    glyph: Glyph,
    place: Floats,
    angle: float = 0.0,
    scale: float = 1.0,
    mirrored: bool = False,
    label: Glyph | None = None,
) -> None:
    """One symbol in points, whatever the scale of the picture.

    axis: of the picture.
    glyph: its lines.
    place: where it stands, in data.
    angle: of its direction, rad.
    scale: its size.
    mirrored: whether what turns counterclockwise turns clockwise.
    label: what the legend names it by, which may be seen end on here; None has no entry.
    """
    from matplotlib.path import Path

    c, s = scale * np.cos(angle), scale * np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    for stroke in glyph.strokes:
        flat = (stroke * np.array([1.0, -1.0 if mirrored else 1.0])) @ turn
        is_closed = bool(np.array_equal(stroke[0], stroke[-1]))
        fill = {"paper": paper(), "ink": ink()}.get(glyph.fill, "none") if is_closed else "none"
        axis.plot(
            *place[:, None], marker=Path(flat), markersize=2.0 * float(np.abs(flat).max()), color=ink(),
            markerfacecolor=fill, markeredgecolor=ink(), markeredgewidth=0.8, linestyle="none",
            zorder=3.2,
        )  # fmt: skip
    if label is not None:
        axis.plot([], [], marker=_all_of(label), markersize=9.0, color=ink(), markeredgewidth=0.7,
                  markerfacecolor="none", linestyle="none", label=label.words)  # fmt: skip


def _all_of(glyph: Glyph) -> Any:
    """All lines of a symbol around its middle, for a legend."""
    from matplotlib.path import Path

    cloud = np.concatenate(glyph.strokes)
    middle = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    return Path.make_compound_path(*(Path(stroke - middle) for stroke in glyph.strokes))


def legend_handles(axis: Any) -> tuple[list[Any], list[str]]:
    """The entries of a legend, those of symbols last."""
    handles, labels = axis.get_legend_handles_labels()
    symbols = {glyph.words for glyph in glyphs().values()}
    order = sorted(range(len(labels)), key=lambda k: labels[k] in symbols)
    return [handles[k] for k in order], [labels[k] for k in order]
