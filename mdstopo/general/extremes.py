"""The extremes of a response over time, in continuous time, of a general scene.

Every step is sampled at its start, its end and in between (on the quintic through both ends), each with the rate of the
response and on the step's own side: where a response jumps or has a kink, at a given time or at an event, both limits
are there. In a step, changes of sign of the rate are refined on the method's own motion. At the boundary of two steps a
rise into it or a fall out of it is a peak there: stationary, at a given time, or at an event, whose time varies.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mdstopo.scene.model import FloatArray

#: columns of a row: time, value, step, fraction of it, rate on this side, sign of what is largest, member; and where
#: two members change hands there (`minima`), the other one and its share of the derivative
TIME, VALUE, STEP, FRACTION, RATE, SIGN, WHO, OTHER, SHARE = range(9)
COLUMNS = 9
#: in column OTHER in place of a member: there is none; the value is a zero, and stays one for designs nearby
NOBODY, ZERO = -1.0, -2.0
#: samples of every step
FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
LAST = len(FRACTIONS) - 1
#: values or rates that differ by less than this, relative to the largest, differ by rounding
ROUNDING = 1e-13
#: a rate below this, relative to the largest, is that of a plateau, which only rounding tilts
FLAT = 1e-9
#: peaks nearer to each other than this in time (relative to what was simulated) and value are one
RIPPLE_TIME, RIPPLE = 1e-3, 1e-9

#: places (K, 2), exact -> (K, 3) value, rate, member
EvaluateAt = Callable[[FloatArray, bool], FloatArray]


@dataclass(frozen=True)
class Samples:
    """value, rate, who (m, 5) of a response in every step, at FRACTIONS; t (m + 1,): the steps' times."""

    t: FloatArray
    value: FloatArray
    rate: FloatArray
    who: FloatArray


def sample(t: FloatArray, evaluate_at: EvaluateAt) -> Samples:
    """Look at all steps between the times t (m + 1,)."""
    m = len(t) - 1
    places = np.empty((m, len(FRACTIONS), 2))
    places[:, :, 0] = np.arange(m)[:, None]
    places[:, :, 1] = FRACTIONS
    seen = evaluate_at(places.reshape(-1, 2), False).reshape(m, len(FRACTIONS), 3)
    return Samples(t, seen[:, :, 0], seen[:, :, 1], seen[:, :, 2])


def peaks(samples: Samples, evaluate_at: EvaluateAt, sign: float, closeness: float) -> list[FloatArray]:
    """The peaks of sign g that come within `closeness` (relative) of the highest sample, as rows (COLUMNS,)."""
    g, d = sign * samples.value, sign * samples.rate
    highest = float(g.max())
    limit = highest - closeness * abs(highest)
    found = _inside(samples, g, d, limit, evaluate_at, sign) + _boundaries(samples, g, d, limit, sign)
    if not found:  # constant
        w, i = np.unravel_index(int(g.argmax()), g.shape)
        found.append(_row(samples, int(w), FRACTIONS[i], samples.value[w, i], 0.0, sign, samples.who[w, i]))
    return found


def ranked(rows: list[FloatArray], closeness: float, most: int, span: float) -> list[FloatArray]:
    """Those within `closeness` of the highest, highest first, the earlier first where equal; at most so many.

    Peaks that are one in truth, and more only by what the method leaves of ripple over a small part of the simulated
    time `span`, count as one.
    """
    order = sorted(rows, key=lambda row: (-row[SIGN] * row[VALUE], row[TIME]))
    best = order[0][SIGN] * order[0][VALUE]
    kept: list[FloatArray] = []
    alike: dict[tuple[float, float], list[FloatArray]] = {}
    for row in order:
        if row[SIGN] * row[VALUE] < best - closeness * abs(best) or len(kept) == most:
            break
        others = alike.setdefault((float(row[WHO]), float(row[SIGN])), [])
        if not any(
            abs(row[TIME] - other[TIME]) <= RIPPLE_TIME * span and abs(row[VALUE] - other[VALUE]) <= RIPPLE * abs(best)
            for other in others
        ):
            kept.append(row)
            others.append(row)
    return kept


def _row(samples: Samples, w: int, c: float, value: float, rate: float, sign: float, who: float) -> FloatArray:
    """A row (COLUMNS,) at a place of the samples.

    samples: of the response. w, c: step, and fraction of it. value, rate: of g there.
    sign: 1 for a peak of g, -1 for one of -g. who: the member, or -1.
    """
    time = samples.t[w + 1] if c >= 1.0 else samples.t[w] + c * (samples.t[w + 1] - samples.t[w])
    return row_of(float(time), value, w, c, rate, sign, who)


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
    if row[OTHER] == ZERO:
        return []
    if row[OTHER] == NOBODY:
        return [(1.0, row)]
    other = row.copy()
    other[WHO], other[OTHER] = row[OTHER], NOBODY
    return [(1.0 - row[SHARE], row), (float(row[SHARE]), other)]


def _inside(
    samples: Samples, g: FloatArray, d: FloatArray, limit: float, evaluate_at: EvaluateAt, sign: float
) -> list[FloatArray]:
    """Peaks within steps, as rows: roots of the rate between two samples where it falls through zero.

    samples: of the response. g, d (m, 5): sign times its values and rates.
    limit: value of g below which no peak is wanted.
    evaluate_at: response and rate at places of the motion. sign: 1, or -1 for peaks of -g.
    """
    width = (np.diff(samples.t) / LAST)[:, None]
    da, db = d[:, :-1], d[:, 1:]
    bound = np.maximum(g[:, :-1] + np.maximum(da, 0.0) * width, g[:, 1:] + np.maximum(-db, 0.0) * width)
    crossing = (da > 0.0) & (db < 0.0)
    # both rates of one sign, and yet the cubic through them turns twice
    slope = np.diff(g, axis=1) / width
    half, square = 3.0 * slope - 2.0 * da - db, 3.0 * (da + db - 2.0 * slope)
    turning = (da * db > 0.0) & (half * half > square * da) & (square != 0.0)
    with np.errstate(all="ignore"):
        split = np.where(turning, -half / square, -1.0)
    turning &= (split > 0.0) & (split < 1.0)
    found = []
    for w, i in np.argwhere((bound >= limit) & (crossing | turning)).tolist():
        low, high = FRACTIONS[i], FRACTIONS[i + 1]
        rise, fall = float(da[w, i]), float(db[w, i])
        if turning[w, i]:
            middle = low + float(split[w, i]) * (high - low)
            rate = sign * float(evaluate_at(np.array([[w, middle]]), True)[0, 1])
            if rise > 0.0 > rate:
                high, fall = middle, rate
            elif rate > 0.0 > fall:
                low, rise = middle, rate
            else:
                continue
        c, value, rate, who = _refine(w, low, high, rise, fall, evaluate_at, sign)
        found.append(_row(samples, w, c, value, rate, sign, who))
    return found


def _refine(
    w: int, low: float, high: float, rise: float, fall: float, evaluate_at: EvaluateAt, sign: float
) -> tuple[float, float, float, float]:
    """Fraction, value, rate and member where the rate vanishes, by Illinois' rule on the method's own motion.

    w: the step. low, high: fractions between which the rate falls through zero.
    rise, fall: sign times the rate at them, above and below zero.
    evaluate_at: response and rate at places of the motion. sign: 1, or -1 for peaks of -g.
    """
    size, side = max(rise, -fall), 0
    c = last = np.nan
    seen = np.full(3, np.nan)
    for _ in range(60):
        c = (low * fall - high * rise) / (fall - rise)
        if not low < c < high:
            c = 0.5 * (low + high)
        seen = evaluate_at(np.array([[w, c]]), True)[0]
        rate = sign * float(seen[1])
        if abs(rate) <= ROUNDING * size or high - low <= 1e-14 or abs(c - last) <= 1e-13:
            break
        last = c
        if rate > 0.0:
            low, rise = c, rate
            fall = 0.5 * fall if side == -1 else fall
            side = -1
        else:
            high, fall = c, rate
            rise = 0.5 * rise if side == 1 else rise
            side = 1
    value, rate, who = (float(x) for x in seen)
    return c, value, rate, who


def _boundaries(samples: Samples, g: FloatArray, d: FloatArray, limit: float, sign: float) -> list[FloatArray]:
    """Peaks at the ends of steps: a rise into one, or a fall out of it."""
    m = len(g)
    g_left = np.concatenate([[-np.inf], g[:, LAST]])
    d_left = np.concatenate([[1.0], d[:, LAST]])
    g_right = np.concatenate([g[:, 0], [-np.inf]])
    d_right = np.concatenate([d[:, 0], [-1.0]])
    size = float(np.abs(g).max())
    if d_right[0] == 0.0:  # from rest: the first sample that differs by more than rounding tells
        moved = np.flatnonzero(np.abs(g.ravel() - g[0, 0]) > ROUNDING * size)
        d_right[0] = -1.0 if moved.size == 0 or g.ravel()[moved[0]] < g[0, 0] else 1.0
    jump = np.abs(g_left - g_right) > 1e-9 * size
    jump[[0, -1]] = False
    ends = np.zeros(m + 1, dtype=bool)
    ends[-1] = True
    starts = np.zeros(m + 1, dtype=bool)
    starts[0] = True
    flat = FLAT * float(np.abs(d).max())
    level_right, level_left = (d_left > flat) & (d_right <= flat), (d_right < -flat) & (d_left >= -flat)
    from_left = (
        (g_left >= limit) & (d_left > 0.0) & (ends | (d_right <= 0.0) | level_right | (jump & (g_right < g_left)))
    )
    from_left[0] = False
    from_right = (
        (g_right >= limit) & (d_right < 0.0) & (starts | (d_left >= 0.0) | level_left | (jump & (g_left < g_right)))
    )
    from_right[-1] = False
    # where both sides have one peak in common, it is one
    from_right &= ~(from_left & ~(jump & (g_right > g_left)))
    from_left &= ~(from_right & jump)
    found = [
        _row(samples, w - 1, 1.0, sign * g[w - 1, LAST], sign * d[w - 1, LAST], sign, samples.who[w - 1, LAST])
        for w in np.flatnonzero(from_left).tolist()
    ]
    found += [
        _row(samples, w, 0.0, sign * g[w, 0], sign * d[w, 0], sign, samples.who[w, 0])
        for w in np.flatnonzero(from_right).tolist()
    ]
    return found
