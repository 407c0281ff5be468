"""Symbols of pictures and pages as lines, in points (1/72 inch); x is along the symbol's direction."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from mdstopo.case.joints import JOINTS
from mdstopo.case.joints.joints_in_space import SPATIAL_JOINTS
from mdstopo.plots.scenery import Floats


@dataclass(frozen=True)
class Glyph:
    """The shape of a symbol. strokes: lines (n, 2); closed: whether their areas are filled, with paper or with ink;
    words: in a legend."""

    strokes: tuple[Floats, ...]
    fill: str
    words: str


def _circle(radius: float, x: float = 0.0) -> Floats:
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    return np.stack([x + radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _box(wide: float, high: float, lean: float = 0.0) -> Floats:
    return np.array(
        [[-wide - lean, -high], [wide - lean, -high], [wide + lean, high], [-wide + lean, high], [-wide - lean, -high]]
    )


def _line(*places: tuple[float, float]) -> Floats:
    return np.array(places, dtype=np.float64)


def _turn(radius: float) -> tuple[Floats, Floats]:
    """Three quarters of a turn, counterclockwise, and its head."""
    angle = np.linspace(-0.3 * np.pi, 1.2 * np.pi, 25)
    arc = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    way, out = np.array([-np.sin(angle[-1]), np.cos(angle[-1])]), arc[-1] / radius
    return arc, np.array([arc[-1] + 4.5 * way, arc[-1] + 2.2 * out, arc[-1] - 2.2 * out, arc[-1] + 4.5 * way])


_HATCH = tuple(_line((x, 0.0), (x - 2.5, -3.0)) for x in (-3.0, 0.0, 3.0, 6.0))
_DIAMOND = _line((-4, 0), (0, -4), (4, 0), (0, 4), (-4, 0))
_CROSS = (_line((-3.6, 0), (3.6, 0)), _line((0, -3.6), (0, 3.6)))
_BLOCK_ARROW = _line((0, 1.5), (15, 1.5), (15, 4.5), (23, 0), (15, -4.5), (15, -1.5), (0, -1.5), (0, 1.5))
_ZIGZAG = _line((-7, 0), (-5, 0), (-4, 3), (-2, -3), (0, 3), (2, -3), (4, 3), (5, 0), (7, 0))


#: with room between for the symbols of a rotation, a joint or a load at the same place
_STOPS = (
    _line((-13, -4), (-13, 4)), _line((-13, 0), (-10, 0)), _line((13, -4), (13, 4)), _line((13, 0), (10, 0))
)  # fmt: skip
_DIAGONALS = (_line((-3.4, -3.4), (3.4, 3.4)), _line((-3.4, 3.4), (3.4, -3.4)))


@cache
def glyphs() -> dict[str, Glyph]:
    """By kind: those of joints have the joint's word. A joint that has no symbol of its own is a diamond."""
    arc, head = _turn(8.0)
    driven, driven_head = _turn(11.0)
    known = {
        "revolute": Glyph((_circle(3.2),), "paper", "revolute joint"),
        "spherical": Glyph((_circle(3.6), _circle(1.4)), "paper", "spherical joint"),
        "universal": Glyph((_circle(3.6), *_CROSS), "paper", "universal joint"),
        "prismatic": Glyph((_box(5.0, 2.8), _line((-9, 0), (9, 0))), "paper", "prismatic joint"),
        "cylindrical": Glyph((_box(5.0, 2.8), _line((-9, 0), (9, 0)), _circle(1.6)), "paper", "cylindrical joint"),
        "planar": Glyph((_box(5.0, 2.5, 2.0),), "paper", "planar joint"),
        "fixed": Glyph((_box(2.6, 2.6),), "ink", "fixed joint"),
        "distance": Glyph((_circle(2.0),), "ink", "distance joint"),
        "bushing": Glyph((_ZIGZAG,), "", "bushing"),
        "load": Glyph((_line((0, 0), (20, 0)), _line((26, 0), (19, 2.8), (19, -2.8), (26, 0))), "ink", "load"),
        "moment": Glyph((arc, head), "ink", "moment"),
        "motion": Glyph((_BLOCK_ARROW,), "paper", "prescribed motion"),
        "turning": Glyph((driven, _circle(1.2), driven_head), "paper", "prescribed rotation"),
        "held": Glyph(_STOPS, "", "held coordinate"),
        "unturned": Glyph((_box(3.4, 3.4), *_DIAGONALS), "paper", "held rotation"),
        "gravity": Glyph((_line((0, 0), (14, 0)), _line((18, 0), (13, 2.2), (13, -2.2), (18, 0))), "ink", "gravity"),
        "ground": Glyph((_line((-5, 0), (6, 0)), *_HATCH), "", "ground"),
    }  # fmt: skip
    others = {word: Glyph((_DIAMOND,), "paper", f"{word} joint") for word in (*JOINTS, *SPATIAL_JOINTS)}
    return others | known
