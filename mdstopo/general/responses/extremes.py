"""The extremes of a response over time, in continuous time, of a general scene.

Every step is sampled at its start, its end and in between (on the quintic through both ends), each with the rate of the
response and on the step's own side: where a response jumps or has a kink, at a given time or at an event, both limits
are there. In a step, changes of sign of the rate are refined on the method's own motion. At the boundary of two steps a
rise into it or a fall out of it is a peak there: stationary, at a given time, or at an event, whose time varies. The
search itself is compiled (`peak_search`).
"""

from collections.abc import Callable

import numpy as np

from mdstopo.general.model.expressions import MARGINS
from mdstopo.scene.springs_model import FloatArray

#: columns of a row: time, value, step, fraction of it, rate on this side, sign of what is largest, member; and where
#: the lead passes to another member there (`minima`), that one and its share of the derivative
TIME, VALUE, STEP, FRACTION, RATE, SIGN, WHO, OTHER, SHARE = range(9)
COLUMNS = 9
#: in column OTHER in place of a member: there is none; the value is a zero, and stays one for designs nearby. One from
#: MARGINS on (`expressions`) is the margin of a switch that changes there, or a norm that passes zero; its derivative
#: is added
NOBODY, ZERO = -1.0, -2.0
#: how many numbers are seen of a response at a place: value, rate, member
SEEN = 3
#: samples of every step
FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
SAMPLES = len(FRACTIONS)
LAST = SAMPLES - 1
#: places (K, 2), exact -> (K, 3) value, rate, member
EvaluateAt = Callable[[FloatArray, bool], FloatArray]


def sample(count: int, evaluate_at: EvaluateAt) -> FloatArray:
    """Value, rate and member (count, SAMPLES, 3) of a response in every step, or piece of one, at FRACTIONS."""
    places = np.empty((count, SAMPLES, 2))
    places[:, :, 0] = np.arange(count)[:, None]
    places[:, :, 1] = FRACTIONS
    return evaluate_at(places.reshape(-1, 2), False).reshape(count, SAMPLES, SEEN)


def row_of(time: float, value: float, step: float, fraction: float, rate: float, sign: float, who: float) -> FloatArray:
    """A row (COLUMNS,) of one member, or of a response that has none.

    time (s), value, rate (per s): of the response.
    step, fraction: where on the motion.
    sign: 1 for a peak of g, -1 for one of -g.
    who: the member, or -1.
    """
    return np.array([time, value, step, fraction, rate, sign, who, NOBODY, 0.0])


def parts(row: FloatArray) -> list[tuple[float, FloatArray]]:
    """What a row's derivative is put together from: shares, and rows of one member each; nothing where it is zero."""
    who = row.item(OTHER)
    if who == ZERO:
        return []
    if who == NOBODY:
        return [(1.0, row)]
    other, share = row.copy(), row.item(SHARE)
    other[WHO], other[OTHER] = who, NOBODY
    return [(1.0 if who >= MARGINS else 1.0 - share, row), (share, other)]
