"""A motion as moving pictures: GIF and MP4 from drawings, SVG whose lines move by themselves."""

import shutil
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.plots.beside import FREE, side_places, sideways
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.member_lines import MOST, NARROWEST, widest_of
from mdstopo.plots.panels import ABOVE, BELOW, LEFT, RIGHT, add_panel
from mdstopo.plots.scenery import Floats, edge_at, start_state
from mdstopo.plots.slack import CORNERS, DASHES, belt_lengths, member_lines
from mdstopo.plots.source import Source
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import WIDTH, colour, ink, paper
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.thickness import Thickness, families, strongest, thickness
from mdstopo.scene.point_positions import points_at
from mdstopo.store.store_errors import StoreError

FORMATS = (".gif", ".mp4", ".svg")
#: dots per inch of a frame, pixels of an SVG across, frames in a second at most
DPI, PIXELS, RATE = 150, 720, 25
#: inches: a frame, and the drawing in it
FRAME = np.array([1.3 * WIDTH, WIDTH])
FILM = FRAME - np.array([LEFT + RIGHT, BELOW + ABOVE])


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
    stage, thick = Stage(source, motion.q, load_case, times.tolist()), thickness(source)
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
    figure = module.Figure(figsize=tuple(FRAME))
    FigureCanvasAgg(figure)
    axis = add_panel(figure, LEFT, BELOW, FILM)
    rate = max(1, min(RATE, round(len(times) / seconds)))
    kind = FFMpegWriter if path.suffix.lower() == ".mp4" else PillowWriter
    writer = kind(fps=rate)
    with writer.saving(figure, str(path), DPI):
        for t, q in zip(times.tolist(), states, strict=True):
            axis.clear()
            axis.child_axes.clear()
            stage.draw(axis, q, thick, (load_case, t), FILM)
            axis.set_title(f"t = {t:.4g} s", loc="left")
            writer.grab_frame()


def _svg(stage: Stage, thick: Thickness, times: Floats | None, states: Floats, seconds: float) -> str:
    """Lines whose corners are animated (SMIL), without a script."""
    low, high = stage.cloud.min(axis=0), stage.cloud.max(axis=0)
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
    for each in _lines(stage, thick, states):
        flat = np.stack([each.places[..., 0] + shift[0], shift[1] - each.places[..., 1]], axis=-1) * scale
        flat += each.beside * np.array([1.0, -1.0])
        words = [" ".join(f"{x:.1f},{y:.1f}" for x, y in frame) for frame in flat.tolist()]
        move = _animated("points", words, seconds) + _animated("stroke-dasharray", each.dashes, seconds, "discrete")
        dashes = f' stroke-dasharray="{each.dashes[0]}"' if each.dashes else ""
        parts.append(f'<polyline points="{words[0]}" {each.style}{dashes}>{move}</polyline>')
    if times is None:
        return "\n".join([*parts, "</svg>\n"])
    slower = seconds / max(times[-1] - times[0], 1e-300)
    pace = f"{slower:.3g} times slower" if slower >= 1.0 else f"{1.0 / slower:.3g} times faster"
    parts.append(
        f'<text x="8" y="{height - 8:.0f}" font-family="sans-serif" font-size="13" fill="{ink()}">'
        f"{times[0]:.4g} s to {times[-1]:.4g} s, {pace}</text>"
    )
    return "\n".join([*parts, "</svg>\n"])


def _animated(name: str, values: list[str], seconds: float, mode: str = "linear") -> str:
    """An animation of an attribute, where its values change."""
    if len(set(values)) < 2:
        return ""
    every = ";".join(values)
    how = "" if mode == "linear" else f' calcMode="{mode}"'
    return f'<animate attributeName="{name}" dur="{seconds:g}s" repeatCount="indefinite"{how} values="{every}"/>'


@dataclass(frozen=True)
class _Line:
    """A line that moves. style: its attributes; places (T, n, 2): its corners on the paper; beside: pixels (T, 1, 2)
    by which it is shifted to the right and up; dashes: of each state, where some are dashed."""

    style: str
    places: Floats
    beside: Floats | float = 0.0
    dashes: list[str] = field(default_factory=list)


def _lines(stage: Stage, thick: Thickness, states: Floats) -> list[_Line]:
    """Everything that is drawn."""
    case, found = stage.case, _touched(stage, states)
    for k, name in enumerate(stage.names):
        own = ink("middle") if name == stage.names[-1] else colour(k + 2)
        for corners, closed, wide in _body_lines(stage, name):
            flat = _flat(stage, name, corners, states)
            fill = f'fill="{own}" fill-opacity="0.13"' if closed else 'fill="none"'
            found.append(_Line(f'{fill} stroke="{own}" stroke-width="{wide}" stroke-linejoin="round"', flat))
    chosen, named = strongest(thick.shares, MOST), families(case)
    dashed = " ".join(map(str, DASHES))
    order, widest = list(dict.fromkeys(named)), 1.4 * widest_of(sum(len(each) for each in chosen))
    every = zip(case.members, thick.shares, chosen, side_places(case, chosen), named, strict=True)
    for group, share, some, side, family in every:
        drawn = [member_lines(case, group, q, stage.seen, some) for q in states]
        ends = slice(None) if belt_lengths(case, group) is not None else slice(None, None, CORNERS - 1)
        places, slack = np.array([line for line, _ in drawn])[:, :, ends], np.array([hangs for _, hangs in drawn])
        for i, member in enumerate(some.tolist()):
            width = NARROWEST + (widest - NARROWEST) * float(share[member])
            style = f'fill="none" stroke="{colour(order.index(family))}" stroke-width="{width:.2f}"'
            beside = (widest + FREE) * sideways(places[:, i], np.full(len(states), side[i]))[:, None]
            dashes = [dashed if hangs else "none" for hangs in slack[:, i]] if slack[:, i].any() else []
            found.append(_Line(style, places[:, i], beside, dashes))
    return found


def _touched(stage: Stage, states: Floats) -> list[_Line]:
    """Edges and surfaces that points may come against."""
    case = stage.case
    if case.dimension == 2:
        edges = [np.array([edge_at(case, contact, q) for q in states]) for contact in case.contacts]
    else:
        edges = [_flat(stage, each.body, line, states) for each in surfaces_of(case) for line in each.lines]
    wide = 1.4 if case.dimension == 2 else 0.6
    return [_Line(f'fill="none" stroke="{ink("middle")}" stroke-width="{wide}"', edge) for edge in edges]


def _flat(stage: Stage, body: str, corners: Floats, states: Floats) -> Floats:
    """Places (T, n, 2) on the paper of corners (n, d) of a body."""
    return np.asarray(stage.seen(points_at(stage.case, body, corners, states)))


def _body_lines(stage: Stage, name: str) -> list[tuple[Floats, bool, float]]:
    """Lines (n, d) of a body, whether their area is filled, and how wide they are."""
    if stage.case.dimension == 3:
        shape = stage.solids[name]
        return [(shape.corners[list(edge)], False, 1.0 if shape.faces else 2.0) for edge in shape.edges]
    found: list[tuple[Floats, bool, float]] = []
    for shape2 in planar_shapes(stage.case, name):
        found += [(np.concatenate([area, area[:1]]), True, 1.0) for area in shape2.areas]
        found += [(line, False, 2.0) for line in shape2.lines]
        found += [(arm, False, 1.0 if shape2.thin_arms else 2.6) for arm in shape2.arms]
    return found
