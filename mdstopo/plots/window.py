"""What part of the paper a picture shows: all that is drawn, with room for symbols, whose size is in points."""

from collections.abc import Sequence

import numpy as np

from mdstopo.plots.scenery import Floats
from mdstopo.plots.symbol_marks import Mark

#: points (1/72 inch) that are free around everything, for lines and the marks of bodies, and around symbols
FREE, AROUND = 7.0, 1.5
#: share of the size of what is seen by which a symbol may stand outside: one farther off is out of the view
OUTSIDE = 0.5
#: sizes of a picture by which the window reaches beyond what is seen, for symbols: in a picture that is hardly larger
#: than they are no window shows them whole, and without an end it would grow with each round
MOST_BEYOND = 1.5
#: times that the window is adapted to the scale it has
ADAPTATIONS = 12


def scale_of(low: Floats, high: Floats, inches: Floats) -> float:
    """Points in a metre, where a window from `low` (2,) to `high` (2,) is drawn as large as it fits into `inches`."""
    size = high - low
    return float((72.0 * inches / np.maximum(size, 1e-9 * float(size.max()))).min())


def window(cloud: Floats, marks: Sequence[Mark], inches: Floats) -> tuple[Floats, Floats]:
    """Lower left and upper right corner (2,) of what is shown of the paper, which has the same scale both ways.

    cloud (n, 2): places that are seen. marks: symbols that are seen whole. inches (2,): the size of the picture.
    """
    low, high = np.asarray(cloud.min(axis=0)), np.asarray(cloud.max(axis=0))
    if not np.any(high > low):  # a single place
        low, high = low - 1e-3, high + 1e-3
    places, reaches = places_and_reaches(marks)
    near = OUTSIDE * float((high - low).max())
    some = ((places > low - near) & (places < high + near)).all(axis=1)
    places, reaches = places[some], reaches[some]
    first, last = low, high
    beyond = MOST_BEYOND * 72.0 * inches / scale_of(low, high, inches)
    for _ in range(ADAPTATIONS):
        room = 1.0 / scale_of(first, last, inches)
        ends = places[:, None] + room * (reaches + AROUND * np.array([[-1.0], [1.0]]))
        first = np.minimum(low - FREE * room, ends[:, 0].min(axis=0, initial=np.inf))
        last = np.maximum(high + FREE * room, ends[:, 1].max(axis=0, initial=-np.inf))
        first, last = np.maximum(first, low - beyond), np.minimum(last, high + beyond)
    return first, last


def places_and_reaches(marks: Sequence[Mark]) -> tuple[Floats, Floats]:
    """(K, 2) places of symbols, and of their other ends; (K, 2, 2) points from there to their lower left and upper
    right corners."""
    both = [(place, mark.reach) for mark in marks for place in (mark.place, mark.end) if place is not None]
    if not both:
        return np.zeros((0, 2)), np.zeros((0, 2, 2))
    places, reaches = zip(*both, strict=True)
    return np.array(places), np.array(reaches)
