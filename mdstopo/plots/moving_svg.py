"""A motion as one SVG whose lines and symbols move by themselves (SMIL), without a script."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from html import escape

import numpy as np

from mdstopo.case.model import GROUND
from mdstopo.plots.acting import DOTS, IDLE, acting
from mdstopo.plots.beside import FREE, side_places, sideways
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.glyphs import Glyph, glyphs
from mdstopo.plots.member_lines import MOST_DRAWN, NARROWEST, widest_of
from mdstopo.plots.panels import fitted
from mdstopo.plots.scenery import Floats, edge_at
from mdstopo.plots.slack import CORNERS, DASHES, THIN, belt_lengths, member_lines
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import colour, ink, paper
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.symbol_marks import Mark
from mdstopo.plots.symbols import every_symbol
from mdstopo.plots.thickness import Thickness, families, strongest
from mdstopo.plots.window import scale_of
from mdstopo.scene.point_positions import points_at

#: pixels of a point (1/72 inch) of other pictures, and of the picture at most across and up
POINT, MOST_PIXELS = 1.4, np.array([720.0, 720.0])
#: pixels: what the line below the picture needs across and up, and the arrow of gravity to the right of it
WORDS, LINE, GRAVITY = 300.0, 24.0, 26.0
#: dashes in pixels: of arms that are less than the rest of a body, and around points that show no shape
ARM, BORDER = "6 3", "5 4"
#: pixels: the radius of a ring around a point that may come against something
RING = 2.1


@dataclass(frozen=True)
class Timing:
    """How a motion plays. load_case: whose; times (T,): of its states; seconds: how long it takes in the picture."""

    load_case: str
    times: Floats
    seconds: float


def moving_svg(stage: Stage, thick: Thickness, states: Floats, timing: Timing | None = None) -> str:
    """The SVG of a motion, or of one state.

    stage: what draws the scene. thick: how thick members are. states (T, n): of the motion. timing: how it plays; None
    where there is one state, with loads at their largest.
    """
    frame = _Frame(stage, timing)
    width, height = frame.size
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}">',
        f"<title>{escape(stage.source.title)}</title>",
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="{paper()}"/>',
    ]
    seconds = 1.0 if timing is None else timing.seconds
    shown = [(None, None)] if timing is None else [(timing.load_case, t) for t in timing.times.tolist()]
    parts += [_drawn(line, frame, seconds) for line in _lines(stage, thick, states, [t for _, t in shown])]
    parts += [*_rings(stage, frame, states, seconds), *_centres(stage, frame, states, seconds)]
    marks = [
        stage.marks(q, every_symbol(stage.case, *each), frame.points) for q, each in zip(states, shown, strict=True)
    ]
    for same in zip(*marks, strict=True):
        parts += _symbol(list(same), frame, seconds)
    if frame.gravity is not None:
        parts += _gravity(frame.gravity, width - 0.5 * GRAVITY)
    if timing is not None:
        parts.append(_pace(timing, height))
    return "\n".join([*parts, "</svg>\n"])


class _Frame:
    """The part of the paper that is seen: size (2,) of the picture in pixels; points: of other pictures in a metre;
    gravity (2,): its direction in a plane, or None."""

    def __init__(self, stage: Stage, timing: Timing | None) -> None:
        most = MOST_PIXELS / (72.0 * POINT)
        low, high = stage.window(most)
        self.points = scale_of(low, high, most)
        inner = 72.0 * POINT * fitted((low, high), most)
        inner[0] = max(inner[0], WORDS)
        self._middle, self._centre = 0.5 * inner, 0.5 * (low + high)
        chosen = stage.case.load_cases[0] if timing is None else stage.case.load_case(timing.load_case)
        gravity = np.array(chosen.gravity, dtype=np.float64)
        self.gravity = gravity / np.linalg.norm(gravity) if len(gravity) == 2 and np.any(gravity) else None
        self.size = inner + np.array([0.0 if self.gravity is None else GRAVITY, LINE])

    def pixels(self, places: Floats) -> Floats:
        """(..., 2) to the right and down, of places (..., 2) on the paper."""
        return np.asarray(self._middle + POINT * self.points * (places - self._centre) * np.array([1.0, -1.0]))


@dataclass(frozen=True)
class _Line:
    """A line that moves. style: its attributes; places (T, n, 2): its corners on the paper; beside: pixels (T, 1, 2)
    by which it is shifted to the right and up; dashes, widths, colours: of each state, where these change; ends:
    numbers of the corners at which a loop ends, where it is an area of several."""

    style: str
    places: Floats
    beside: Floats | float = 0.0
    dashes: list[str] = field(default_factory=list)
    widths: list[str] = field(default_factory=list)
    colours: list[str] = field(default_factory=list)
    ends: tuple[int, ...] = ()


def _drawn(line: _Line, frame: _Frame, seconds: float) -> str:
    flat = frame.pixels(line.places) + line.beside * np.array([1.0, -1.0])
    frames = [[f"{x:.1f},{y:.1f}" for x, y in each] for each in flat.tolist()]
    if line.ends:
        loops = list(zip((0, *line.ends), line.ends, strict=False))
        words = ["".join(f"M{' '.join(each[a:b])}Z" for a, b in loops) for each in frames]
        return f'<path d="{words[0]}" {line.style}>{_animated("d", words, seconds)}</path>'
    words = [" ".join(each) for each in frames]
    move, style = _animated("points", words, seconds), line.style
    changing = (("stroke", line.colours), ("stroke-dasharray", line.dashes), ("stroke-width", line.widths))
    for name, values in changing:
        style += f' {name}="{values[0]}"' if values else ""
        move += _animated(name, values, seconds, "discrete")
    return f'<polyline points="{words[0]}" {style}>{move}</polyline>'


def _animated(name: str, values: list[str], seconds: float, mode: str = "linear") -> str:
    """An animation of an attribute, where its values change."""
    if len(set(values)) < 2:
        return ""
    every = ";".join(values)
    how = "" if mode == "linear" else f' calcMode="{mode}"'
    return f'<animate attributeName="{name}" dur="{seconds:g}s" repeatCount="indefinite"{how} values="{every}"/>'


def _transformed(kind: str, values: list[str], seconds: float, content: str) -> str:
    """What is moved (translate) or turned (rotate) by values that change."""
    move = ""
    if len(set(values)) > 1:
        move = (
            f'<animateTransform attributeName="transform" type="{kind}" dur="{seconds:g}s" repeatCount="indefinite" '
            f'values="{";".join(values)}"/>'
        )
    return f'<g transform="{kind}({values[0]})">{move}{content}</g>'


def _placed(places: Floats, seconds: float, content: str) -> str:
    """What is at places (T, 2) in pixels."""
    return _transformed("translate", [f"{x:.1f},{y:.1f}" for x, y in places.tolist()], seconds, content)


def _symbol(marks: list[Mark], frame: _Frame, seconds: float) -> Iterator[str]:
    """The same symbol at each state, with the line to its other end where it has one; none where it never acts."""
    if not any(mark.scale for mark in marks):
        return
    places = frame.pixels(np.array([mark.place for mark in marks]))
    places[:, 1] += POINT * np.array([mark.below for mark in marks])
    turned = np.degrees(np.unwrap([mark.angle for mark in marks]))
    strokes = "".join(part for glyph in _kinds(marks) for part in _strokes(glyph, marks, seconds))
    drawn = _transformed("rotate", [f"{-angle + 0.0:.1f}" for angle in turned.tolist()], seconds, strokes)
    ends = np.array([mark.end for mark in marks if mark.end is not None])
    if len(ends):
        both = np.stack([np.array([mark.place for mark in marks]), ends], axis=1)
        yield _drawn(_Line(f'fill="none" stroke="{ink()}" stroke-width="1.7"', both), frame, seconds)
        yield _placed(frame.pixels(ends), seconds, drawn)
    yield _placed(places, seconds, drawn)


def _kinds(marks: list[Mark]) -> list[Glyph]:
    """What one symbol looks like: a dot while it is seen end on."""
    return list({mark.glyph.words: mark.glyph for mark in marks}.values())


def _strokes(glyph: Glyph, marks: list[Mark], seconds: float) -> Iterator[str]:
    """The lines of a symbol along its direction, of no size while it looks otherwise."""
    sizes = [mark.scale if mark.glyph.words == glyph.words else 0.0 for mark in marks]
    flips = [-1.0 if mark.mirrored else 1.0 for mark in marks]
    for stroke in glyph.strokes:
        is_closed = bool(np.array_equal(stroke[0], stroke[-1]))
        fill = {"paper": paper(), "ink": ink()}.get(glyph.fill, "none") if is_closed else "none"
        words = [
            " ".join(f"{x + 0.0:.1f},{y + 0.0:.1f}" for x, y in (POINT * size * stroke * [1.0, -flip]).tolist())
            for size, flip in zip(sizes, flips, strict=True)
        ]
        move = _animated("points", words, seconds)
        yield f'<polyline points="{words[0]}" fill="{fill}" stroke="{ink()}" stroke-width="1.1">{move}</polyline>'


def _rings(stage: Stage, frame: _Frame, states: Floats, seconds: float) -> Iterator[str]:
    """Points of a plane that may come against an edge."""
    ring = f'<circle r="{RING}" fill="none" stroke="{ink()}" stroke-width="0.9"/>'
    for contact in stage.case.contacts if stage.case.dimension == 2 else ():
        places = frame.pixels(points_at(stage.case, contact.body, contact.points, states))
        for each in places.transpose(1, 0, 2):
            yield _placed(each, seconds, ring)


def _centres(stage: Stage, frame: _Frame, states: Floats, seconds: float) -> Iterator[str]:
    """Crosses at the centres of mass of bodies, which may have no other shape."""
    for k, body in enumerate(stage.case.bodies):
        middle = points_at(stage.case, body.name, np.zeros((1, stage.case.dimension)), states)[:, 0]
        cross = f'<path d="M-4 0H4M0-4V4" stroke="{colour(k + 2)}" stroke-width="1.4"/>'
        yield _placed(frame.pixels(stage.seen(middle)), seconds, cross)


def _gravity(way: Floats, x: float) -> Iterator[str]:
    """The direction of gravity, around a place near the upper edge."""
    mark = Mark(glyphs()["gravity"], np.zeros(2), angle=float(np.arctan2(way[1], way[0])))
    cloud = POINT * np.concatenate(mark.strokes) * [1.0, -1.0]
    middle = np.array([x, 18.0]) - 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    turned = f"{-np.degrees(mark.angle) + 0.0:.1f}"
    yield _placed(middle[None], 1.0, _transformed("rotate", [turned], 1.0, "".join(_strokes(mark.glyph, [mark], 1.0))))
    yield (
        f'<text x="{x:.0f}" y="46" text-anchor="middle" font-family="sans-serif" font-size="12" fill="{ink()}">g</text>'
    )


def _pace(timing: Timing, height: float) -> str:
    times = timing.times
    slower = timing.seconds / max(times[-1] - times[0], 1e-300)
    pace = f"{slower:.3g} times slower" if slower >= 1.0 else f"{1.0 / slower:.3g} times faster"
    return (
        f'<text x="8" y="{height - 8:.0f}" font-family="sans-serif" font-size="13" fill="{ink()}">'
        f"{times[0]:.4g} s to {times[-1]:.4g} s, {pace}</text>"
    )


def _lines(stage: Stage, thick: Thickness, states: Floats, times: list[float | None]) -> Iterator[_Line]:
    """Everything that is drawn but symbols. times: of the states, None where no time is shown."""
    yield from _touched(stage, states)
    for k, name in enumerate(stage.names):
        yield from _body(stage, name, ink("middle") if name == GROUND else colour(k + 2), states)
    yield from _members(stage, thick, states, times)


def _members(stage: Stage, thick: Thickness, states: Floats, times: list[float | None]) -> Iterator[_Line]:
    """Lines of members: solid, dashed and thin while they are slack, dotted in grey while they do not act."""
    case = stage.case
    chosen, named = strongest(thick.shares, MOST_DRAWN), families(case)
    order, widest = list(dict.fromkeys(named)), POINT * widest_of(sum(len(each) for each in chosen))
    looks = [("none", 1.0), (" ".join(map(str, DASHES)), THIN), (" ".join(map(str, DOTS)), 1.0)]
    every = zip(case.members, thick.shares, chosen, side_places(case, chosen), named, strict=True)
    for group, share, some, side, family in every:
        acts = np.array([acting(stage.source, group, t) for t in times])
        drawn = [member_lines(case, group, q, stage.seen, some, own) for q, own in zip(states, acts, strict=True)]
        ends = slice(None) if belt_lengths(case, group) is not None else slice(None, None, CORNERS - 1)
        places, slack = np.array([line for line, _ in drawn])[:, :, ends], np.array([hangs for _, hangs in drawn])
        own_colour = colour(order.index(family))
        for i, member in enumerate(some.tolist()):
            width = NARROWEST + (widest - NARROWEST) * float(share[member])
            idle = ~acts[:, member]
            look = np.where(idle, 2, slack[:, i]).tolist()  # which of `looks` it has
            widths = [f"{min(POINT * IDLE, widest) if k == 2 else looks[k][1] * width:.2f}" for k in look]
            beside = (widest + FREE) * sideways(places[:, i], np.full(len(states), side[i]))[:, None]
            dashes = [looks[k][0] for k in look] if any(look) else []
            colours = [ink("middle") if k == 2 else own_colour for k in look] if idle.any() else []
            style = 'fill="none"' if colours else f'fill="none" stroke="{own_colour}"'
            yield _Line(style, places[:, i], beside, dashes, widths, colours)


def _touched(stage: Stage, states: Floats) -> Iterator[_Line]:
    """Edges and surfaces that points may come against."""
    case = stage.case
    wide = 1.4 if case.dimension == 2 else 0.6
    style = f'fill="none" stroke="{ink("middle")}" stroke-width="{wide}"'
    if case.dimension == 2:
        for contact in case.contacts:
            yield _Line(style, np.array([edge_at(case, contact, q) for q in states]))
        return
    for each in surfaces_of(case):
        for line in each.lines:
            yield _Line(style, _flat(stage, each.body, line, states))


def _flat(stage: Stage, body: str, corners: Floats, states: Floats) -> Floats:
    """Places (T, n, 2) on the paper of corners (n, d) of a body."""
    return np.asarray(stage.seen(points_at(stage.case, body, corners, states)))


def _body(stage: Stage, name: str, own: str, states: Floats) -> Iterator[_Line]:
    """Lines and areas of a body in a colour."""

    def line(corners: Floats, wide: float, fill: str, dashes: str = "") -> _Line:
        style = f'{fill} stroke="{own}" stroke-width="{wide}" stroke-linejoin="round"'
        return _Line(style, _flat(stage, name, corners, states), dashes=[dashes] * bool(dashes))

    plain, filled = 'fill="none"', f'fill="{own}" fill-opacity="0.13"'
    if stage.case.dimension == 3:
        solid = stage.solids[name]
        for edge in solid.edges:
            yield line(solid.corners[list(edge)], 1.0 if solid.faces else 2.0, plain)
        return
    for shape in planar_shapes(stage.case, name):
        loops = [np.concatenate([area, area[:1]]) for area in shape.areas]
        if len(loops) > 1:  # an area within another is a hole
            ends = tuple(np.cumsum([len(loop) for loop in loops]).tolist())
            corners = _flat(stage, name, np.concatenate(loops), states)
            yield _Line(f'{filled} fill-rule="evenodd"', corners, ends=ends)
        for loop in loops:
            yield line(loop, 1.0, filled if len(loops) == 1 else plain)
        for each in shape.lines:
            yield line(each, 2.0, plain)
        for arm in shape.arms:
            yield line(arm, 1.0, plain, ARM) if shape.thin_arms else line(arm, 2.6, plain)
        if shape.border is not None:
            yield line(np.concatenate([shape.border, shape.border[:1]]), 1.0, plain, BORDER)
