"""From where a scene in space is drawn: three views along the axes, and perspective."""

from dataclasses import dataclass

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.scenery import Floats

#: where the eye of the perspective is: degrees to the right of the front, and above the horizon
TURN, RISE = 32.0, 24.0
#: distance of the eye from the middle, in radii of the scene
EYE_DISTANCE = 4.0


@dataclass(frozen=True)
class View:
    """A projection of the scene: coordinates are the products with `across` and `along`; `toward` is the direction
    to the eye.

    With an eye (at that distance from the middle of the scene) it is perspective: what is nearer is larger.
    """

    name: str
    across: Floats
    along: Floats
    toward: Floats
    middle: Floats
    eye: float = np.inf

    def seen(self, places: Floats) -> Floats:
        """Coordinates (..., 2) in this view of places (..., 3)."""
        if not np.isfinite(self.eye):
            return np.stack([places @ np.abs(self.across), places @ np.abs(self.along)], axis=-1)
        away = places - self.middle
        closer = 1.0 - (away @ self.toward) / self.eye
        return np.stack([away @ self.across, away @ self.along], axis=-1) / closer[..., None]

    @property
    def signs(self) -> Floats:
        """(2,) -1 where an axis of the case runs to the left, or down, on the paper: its limits are turned round."""
        if np.isfinite(self.eye):
            return np.ones(2)
        return np.array([-1.0 if way.min() == -1.0 else 1.0 for way in (self.across, self.along)])

    def depth(self, places: Floats) -> Floats:
        """(...) how near to the eye places (..., 3) are."""
        near: Floats = places @ self.toward
        return near


def upright(case: Case) -> Floats:
    """(3, 3) by rows: to the right, away and up as the front view sees them, each along an axis of the case.

    Up is the axis against gravity, z where there is none.
    """
    gravity = np.array(case.load_cases[0].gravity, dtype=np.float64)
    k = int(np.argmax(np.abs(gravity))) if np.any(gravity) else 2
    up = np.zeros(3)
    up[k] = 1.0 if gravity[k] <= 0.0 else -1.0
    right = np.eye(3)[0 if k else 1]
    return np.array([right, np.cross(up, right), up])


def views(case: Case, middle: Floats, radius: float) -> dict[str, View]:
    """The views of a scene, from the front, from above, from the side and in perspective, around a middle, as large as
    a radius."""
    right, away, up = upright(case)
    turn, rise = np.radians(TURN), np.radians(RISE)
    level = np.cos(turn) * away - np.sin(turn) * right  # the way of the look, seen from above
    across = np.cos(turn) * right + np.sin(turn) * away
    toward = np.sin(rise) * up - np.cos(rise) * level
    return {
        "front": View("front", right, up, -away, middle),
        "top": View("top", right, away, up, middle),
        "side": View("side", away, up, right, middle),
        "perspective": View("perspective", across, np.cross(toward, across), toward, middle, EYE_DISTANCE * radius),
    }
