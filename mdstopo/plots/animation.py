"""A motion as moving pictures: GIF and MP4 from drawings, SVG whose lines move by themselves."""

import shutil
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.laws.gap_law import GapLaw
from mdstopo.case.model import MemberGroup
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.member_lines import MOST, NARROWEST, widest_of
from mdstopo.plots.scenery import Floats, start_state
from mdstopo.plots.slack import member_lines
from mdstopo.plots.source import Source
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import WIDTH, colour, ink, paper
from mdstopo.plots.thickness import Thickness, families, strongest, thickness
from mdstopo.scene.point_positions import points_at
from mdstopo.store.store_errors import StoreError

FORMATS = (".gif", ".mp4", ".svg")
#: dots per inch of a frame, pixels of an SVG across, frames in a second at most
DPI, PIXELS, RATE = 150, 720, 25


def write_motion(module: Any, source: Source, path: Path, load_case: str, frames: int, seconds: float) -> None:
    """The motion of the design in a load case.

    module: matplotlib's figure module, with the style on.
    source: the result.
    path: where to; its ending says what it is.
    load_case: whose motion.
    frames: pictures, at least 2.
    seconds: how long it plays.
    Raises StoreError for another ending, where ffmpeg is missing for .mp4, and where the file cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise StoreError(f"{path}: a moving picture ends in {', '.join(FORMATS)}")
    if ending == ".mp4" and shutil.which("ffmpeg") is None:
        raise StoreError(f"{path}: .mp4 needs the program ffmpeg, which is not installed; .gif and .svg do not")
    span = source.case.load_case(load_case)
    whole = source.motion(load_case)
    times = np.linspace(whole.t[0], min(float(whole.t[-1]), span.end), frames)
    motion = source.motion(load_case, times)
    stage, thick = Stage(source, motion.q), thickness(source)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if ending == ".svg":
            path.write_text(_svg(stage, thick, times, motion.q, seconds), encoding="utf-8")
        else:
            _film(module, stage, thick, (load_case, times, motion.q), (path, seconds))
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error


def still(source: Source) -> str:
    """The design of a result at the start of its motion, as SVG. Raises StoreError where the file has none."""
    states = start_state(source.case)[None]
    return _svg(Stage(source, states), thickness(source), None, states, 1.0)


def _film(
    module: Any, stage: Stage, thick: Thickness, shown: tuple[str, Floats, Floats], out: tuple[Path, float]
) -> None:
    from matplotlib.animation import FFMpegWriter, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    (load_case, times, states), (path, seconds) = shown, out
    figure = module.Figure(figsize=(1.3 * WIDTH, WIDTH))
    FigureCanvasAgg(figure)
    (axis,) = figure.subplots(1, 1, squeeze=False)[0]
    rate = max(1, min(RATE, round(len(times) / seconds)))
    kind = FFMpegWriter if path.suffix.lower() == ".mp4" else PillowWriter
    writer = kind(fps=rate)
    with writer.saving(figure, str(path), DPI):
        for t, q in zip(times.tolist(), states, strict=True):
            axis.clear()
            axis.child_axes.clear()
            stage.draw(axis, q, thick, (load_case, t))
            axis.set_title(f"t = {t:.4g} s", loc="left")
            writer.grab_frame()


def _svg(stage: Stage, thick: Thickness, times: Floats | None, states: Floats, seconds: float) -> str:
    """Lines whose corners are animated (SMIL), without a script."""
    lines = _lines(stage, thick, states)
    every = np.concatenate([line.reshape(-1, 2) for _, line in lines])
    low, high = every.min(axis=0), every.max(axis=0)
    room = 0.06 * max(float((high - low).max()), 1e-9)
    size = high - low + 2.0 * room
    scale = PIXELS / float(size[0])
    height = scale * float(size[1]) + 24.0
    shift = np.array([room - low[0], room + high[1]])
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {PIXELS} {height:.0f}">',
        f"<title>{escape(stage.source.title)}</title>",
        f'<rect width="{PIXELS}" height="{height:.0f}" fill="{paper()}"/>',
    ]
    for style, line in lines:
        flat = np.stack([line[..., 0] + shift[0], shift[1] - line[..., 1]], axis=-1) * scale
        words = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in flat.tolist()]
        move = ""
        if len(set(words)) > 1:
            values = ";".join(words)
            move = f'<animate attributeName="points" dur="{seconds:g}s" repeatCount="indefinite" values="{values}"/>'
        parts.append(f'<polyline points="{words[0]}" {style}>{move}</polyline>')
    if times is None:
        return "\n".join([*parts, "</svg>\n"])
    ends = f"{times[0]:.4g} s to {times[-1]:.4g} s, {seconds / max(times[-1] - times[0], 1e-300):.3g} times slower"
    parts.append(
        f'<text x="8" y="{height - 8:.0f}" font-family="sans-serif" font-size="13" fill="{ink()}">{ends}</text>'
    )
    return "\n".join([*parts, "</svg>\n"])


def _lines(stage: Stage, thick: Thickness, states: Floats) -> list[tuple[str, Floats]]:
    """Style and places (T, n, 2) of everything that is drawn."""
    case, found = stage.case, []
    for k, name in enumerate(stage.names):
        own = ink("middle") if name == stage.names[-1] else colour(k + 2)
        for corners, closed, wide in _body_lines(stage, name):
            places = points_at(case, name, corners, states)
            flat = stage.view.seen(places) if case.dimension == 3 else places
            fill = f'fill="{own}" fill-opacity="0.13"' if closed else 'fill="none"'
            found.append((f'{fill} stroke="{own}" stroke-width="{wide}" stroke-linejoin="round"', np.asarray(flat)))
    chosen, named = strongest(thick.shares, MOST), families(case)
    order, widest = list(dict.fromkeys(named)), 1.4 * widest_of(sum(len(each) for each in chosen))
    for group, share, some, family in zip(case.members, thick.shares, chosen, named, strict=True):
        ends = np.stack([_shown(stage, group, q, some) for q in states])
        for i, member in enumerate(some.tolist()):
            width = NARROWEST + (widest - NARROWEST) * float(share[member])
            own = colour(order.index(family))
            found.append((f'fill="none" stroke="{own}" stroke-width="{width:.2f}"', ends[:, i]))
    return found


def _shown(stage: Stage, group: MemberGroup, q: Floats, some: NDArray[np.int64]) -> Floats:
    """Lines (K, n, 2) of some (K,) members of a group at a state q: two ends, more of belts, which may hang through."""
    if any(law.type == GapLaw.type for law in group.laws):
        return member_lines(stage.case, group, q, stage.seen, some)[0]
    return np.asarray(stage.ends(q)(group)[some])


def _body_lines(stage: Stage, name: str) -> list[tuple[Floats, bool, float]]:
    """Lines (n, d) of a body, whether their area is filled, and how wide they are."""
    if stage.case.dimension == 3:
        shape = stage.solids[name]
        return [(shape.corners[list(edge)], False, 1.0 if shape.faces else 2.0) for edge in shape.edges]
    found: list[tuple[Floats, bool, float]] = []
    for shape2 in planar_shapes(stage.case, name):
        found += [(np.concatenate([area, area[:1]]), True, 1.0) for area in shape2.areas]
        found += [(line, False, 2.0) for line in shape2.lines]
        found += [(arm, False, 1.0 if shape2.lines else 2.6) for arm in shape2.arms]
    return found
