"""In which mode all members of a part of a tile are, from bounds of what any of them does.

The first points of a tile, and the second ones of each of its parts, lie near lines: at m + s h, -1 <= s <= 1, and no
further than a bulge beside it. With the vector d = d_0 + S q - p between the ends at a relative pose, of length L and
direction e in the middle of both lines, any other vector d + w has the length

    |d + w| = L + e . w + |w_across|^2 / (2 L)    +- 0.2 |w|^3 / (L - |w|)^2

(a sixth of the third derivative of |d| by a vector w at an angle a to it, -3 |w|^3 cos(a) sin(a)^2 / |d|^2, is at most
0.1925 |w|^3 / |d|^2), and its direction differs from e + w_across / L by less than 0.6 |w|^2 / (L - |w|)^2 (half the
second derivative of d / |d|, which is at most 2 / sqrt(3)), and from e by |w| / (L - |w|) at most. The rate of its
length is that direction times its velocity, which is v = d_0' + S' q in the middle, and v + S' h where the second point
is off by h. With a reach r that neither |w| nor |h| exceeds, the rate is

    e . v + e . S' h + w_across . v / L    +- (0.6 |v| r^2 / (L - r)^2 + |S'| r^2 / (L - r)).

So the elongation, less a free length that is a distance itself, is a polynomial of the second degree in the s of both
points, and the rate is linear in these, but for remainders. Each term is largest and least at an end of its range. A
bulge b adds b to the length, and b (|v| / L + |S'|) to the rate. Bounds of a margin follow where it is the least of
linear functions of elongation and rate: at the corners.

Of a single member the s of its points are known, so that its own bounds are as narrow as the remainder
(`sorted_by_lines`). For these the first points are on two lines: where they are a row of a surface, a tile may have the
end of one row and the beginning of the next.
"""

import math
from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.priced_candidates import (
    CODE,
    FIRST_NODE,
    FIRST_STAGE,
    FIRST_STEP,
    KIND,
    NODE,
    NODES,
    POINT,
    SCENE,
)
from mdstopo.mechanics.kinematics.kinematics_interface import freedoms, rotations
from mdstopo.mechanics.laws.law_table import (
    law_first_set,
    law_makes_set,
    law_margin,
    law_margin_slopes,
    law_next,
    law_remembers,
    law_start,
)
from mdstopo.sensitivity.tile_interpolation import BROAD, LEVELS, TALL

#: how often a tile is halved for bounds, and one more; columns of the smallest parts
BOUND_LEVELS = LEVELS + 2
NARROW = BROAD >> (BOUND_LEVELS - 1)
#: parts of a tile of all levels, of which those of a level begin at 2^level - 1; the place of its rows behind them
BOUND_PARTS = 2**BOUND_LEVELS - 1
ROWS_OF_ALL = BOUND_PARTS
#: points in body frames, and where their case has them; the middle of their line, and half of it
LOCAL, STATED = range(2)
MIDDLE, HALF = range(2)
#: the third-order remainder of a length is at most so many times |w|^3 / (L - |w|)^2
THIRD = 0.2
#: of a part: the series of the free length in the places of both points on their lines, s of the second and q of the
#: first: the terms of 1, s, q, s^2, s q, q^2; how far it may be off; how far the part's vectors differ from that in the
#: middle, and how far points are from lines (m)
PART_NUMBERS = 9
FREE, FREE_S, FREE_Q, FREE_SS, FREE_SQ, FREE_QQ, FREE_OFF, REACH, BULGE = range(PART_NUMBERS)
#: bounds of elongations and rates
LOW, HIGH, SLOWEST, FASTEST = range(4)
#: the series of elongation and rate in these places, and how far both may be off
SERIES_NUMBERS = 11
X, X_S, X_Q, X_SS, X_SQ, X_QQ, X_OFF, V, V_S, V_Q, V_OFF = range(SERIES_NUMBERS)
#: lines of a tile's first points by which single members are told; level of the largest parts for these, and where
#: they begin among the parts of all levels
ROW_LINES = 2
LINED_LEVEL = 2
LINED_FIRST = 2**LINED_LEVEL - 1
#: parts of the levels from that one to the last that has lists, and how many there are of the last one
LINED_PARTS = 2**LEVELS - 2**LINED_LEVEL
LINED_AT_ONCE = 2 ** (LEVELS - 1)
#: bounds are so much wider, relative to lengths and speeds, than they need be: no member is at a switch by rounding
BOUNDS_WIDER = 1e-11
#: what may be known of the modes of all members of a part in a step: nothing; a mode of which none leaves (0 and more);
#: or that all leave it (-2 less its number), between the same two nodes and for the same one
UNSURE = -1
LEAVES = -2


#: the arrays of `Spans`
SPANS = (
    "line", "number", "w", "bound", "series", "row_line", "row_number", "row_place", "column_place", "split",
)  # fmt: skip


class Spans:
    """Where the points of a tile's parts are, inside kernels, and scratch for bounds of what their members do.

    line (BOUND_PARTS + 1, LOCAL or STATED, MIDDLE or HALF, axes): of the second points of each part, and last of all
    first points. number (BOUND_PARTS, PART_NUMBERS): of the parts. w (4, axes), bound (4,), series (SERIES_NUMBERS,):
    scratch. For single members: row_line (ROW_LINES, 2, 2, axes): the lines of first points. row_number (ROW_LINES,
    LINED_PARTS, PART_NUMBERS): of parts with each of these. row_place (TALL,), column_place (levels, BROAD): where
    points are on their lines, from -1 to 1. split (1,): the first row of the second line.
    """

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Spans, SPANS)


@kernel
def make_spans(axes):
    """A `Spans`."""
    return Spans(
        np.zeros((BOUND_PARTS + 1, 2, 2, axes)),
        np.zeros((BOUND_PARTS, PART_NUMBERS)),
        np.zeros((4, axes)),
        np.zeros(4),
        np.zeros(SERIES_NUMBERS),
        np.zeros((ROW_LINES, 2, 2, axes)),
        np.zeros((ROW_LINES, LINED_PARTS, PART_NUMBERS)),
        np.zeros(TALL),
        np.zeros((LEVELS - LINED_LEVEL, BROAD)),
        np.zeros(1, np.int64),
    )


@kernel
def fill_spans(candidates, k, i, j, spans):
    """The lines of a tile's points, and what all bounds of its parts need.

    In:
      candidates, k: a `PricedCandidates`, and the number of the run.
      i, j: the tile.
    Out:
      spans: a `Spans`.
    """
    line, number, w, split = spans.line, spans.number, spans.w, spans.split
    row_line, row_number, row_place, column_place = (
        spans.row_line, spans.row_number, spans.row_place, spans.column_place,
    )  # fmt: skip
    scene = candidates.run[k, SCENE]
    grids = (candidates.first[scene], candidates.first_stated[scene])
    others = (candidates.second[scene], candidates.second_stated[scene])
    height = min(TALL, grids[0].shape[1] - i * TALL)
    width = min(BROAD, others[0].shape[1] - j * BROAD)
    bulge = 0.0
    for which in range(2):
        bulge = max(bulge, _fill_line(grids[which], i * TALL, height, line[ROWS_OF_ALL, which]))
    split[0] = _second_line(grids[LOCAL], i * TALL, height)
    beside = np.zeros(ROW_LINES)
    for n in range(ROW_LINES):
        begin, behind = rows_of_line(n, height, split)
        if begin == behind:
            continue
        for which in range(2):
            off = _fill_line(grids[which], i * TALL + begin, behind - begin, row_line[n, which])
            beside[n] = max(beside[n], off)
        _fill_places(grids[LOCAL], i * TALL + begin, row_line[n, LOCAL], row_place[begin:behind])
    for level in range(BOUND_LEVELS):
        size = BROAD >> level
        for at in range(1 << level):
            if (at + 1) * size > width:
                break
            own = line[(1 << level) - 1 + at]
            off = 0.0
            for which in range(2):
                off = max(off, _fill_line(others[which], j * BROAD + at * size, size, own[which]))
            _fill_part(candidates.rest[k], own, line[ROWS_OF_ALL], bulge + off, number[(1 << level) - 1 + at], w)
            if level < LINED_LEVEL or level >= LEVELS:
                continue
            part = (1 << level) - 1 + at - LINED_FIRST
            for n in range(ROW_LINES):
                _fill_part(candidates.rest[k], own, row_line[n], beside[n] + off, row_number[n, part], w)
            place = column_place[level - LINED_LEVEL, at * size : (at + 1) * size]
            _fill_places(others[LOCAL], j * BROAD + at * size, own[LOCAL], place)


@part
def rows_of_line(n, height, split):
    """The first row of line n, and the one behind its last.

    n, height: the line, and rows of the tile. split (1,): of `Spans`.
    """
    if n == 0:
        return np.int64(0), np.int64(split[0])
    return np.int64(split[0]), np.int64(height)


@kernel
def _second_line(points, first, size):
    """At which of some points a second line begins: behind the longest way from one to the next where it is twice the
    shortest, else in the middle.

    points (axes, n), first, size: as of `_fill_line`.
    """
    longest = 0.0
    shortest = np.inf
    at = np.int64((size + 1) // 2)
    begins = at
    for n in range(1, size):
        square = 0.0
        for d in range(points.shape[0]):
            square += (points[d, first + n] - points[d, first + n - 1]) ** 2
        if square > longest:
            longest = square
            begins = np.int64(n)
        shortest = min(shortest, square)
    return begins if longest > 4.0 * shortest else at


@kernel
def _fill_places(points, first, line, place):
    """Where some points are on their line, from -1 to 1.

    points (axes, n), first: as of `_fill_line`. line (2, axes): their line. place (size,): set.
    """
    square = 0.0
    for d in range(points.shape[0]):
        square += line[HALF, d] * line[HALF, d]
    for n in range(place.shape[0]):
        along = 0.0
        for d in range(points.shape[0]):
            along += (points[d, first + n] - line[MIDDLE, d]) * line[HALF, d]
        place[n] = min(max(along / square, -1.0), 1.0) if square > 0.0 else 0.0


@kernel
def _fill_line(points, first, size, line):
    """The line of some points.

    In:
      points (axes, n): of a grid.
      first, size: number of the first one, and how many there are.
    Out:
      line (2, axes): its middle and its half.

    Returns how far points are from it at most (m).
    """
    square = 0.0
    for d in range(points.shape[0]):
        line[MIDDLE, d] = 0.5 * (points[d, first] + points[d, first + size - 1])
        line[HALF, d] = 0.5 * (points[d, first + size - 1] - points[d, first])
        square += line[HALF, d] * line[HALF, d]
    worst = 0.0
    for n in range(first, first + size):
        along = 0.0
        for d in range(points.shape[0]):
            along += (points[d, n] - line[MIDDLE, d]) * line[HALF, d]
        along = min(max(along / square, -1.0), 1.0) if square > 0.0 else 0.0
        off = 0.0
        for d in range(points.shape[0]):
            off += (points[d, n] - line[MIDDLE, d] - along * line[HALF, d]) ** 2
        worst = max(worst, off)
    return math.sqrt(worst)


@kernel
def _fill_part(rest, line, rows, bulge, number, w):
    """What all bounds of a part need.

    In:
      rest: the free length of all members (m); negative: the distance of their ends as stated.
      line, rows (2, 2, axes): of the second points and of the first.
      bulge: how far points are from these at most, together (m).
    Out:
      number (PART_NUMBERS,): set.
      w (4, axes): scratch.
    """
    second = 0.0
    first = 0.0
    square = 0.0
    for d in range(line.shape[2]):
        w[0, d] = line[STATED, MIDDLE, d] - rows[STATED, MIDDLE, d]
        square += w[0, d] * w[0, d]
        second += line[STATED, HALF, d] ** 2
        first += rows[STATED, HALF, d] ** 2
    number[REACH] = math.sqrt(second) + math.sqrt(first) + bulge
    number[BULGE] = bulge
    number[FREE:REACH] = 0.0
    number[FREE] = rest
    if rest >= 0.0:
        return
    length = math.sqrt(square)
    if not length > number[REACH]:
        number[REACH] = np.inf
        return
    by_second = 0.0
    by_first = 0.0
    both = 0.0
    for d in range(line.shape[2]):
        by_second += w[0, d] * line[STATED, HALF, d] / length
        by_first += w[0, d] * rows[STATED, HALF, d] / length
        both += line[STATED, HALF, d] * rows[STATED, HALF, d]
    number[FREE] = length
    number[FREE_S] = by_second
    number[FREE_Q] = -by_first
    number[FREE_SS] = 0.5 * (second - by_second * by_second) / length
    number[FREE_SQ] = (by_second * by_first - both) / length
    number[FREE_QQ] = 0.5 * (first - by_first * by_first) / length
    number[FREE_OFF] = _third_order(number[REACH], length)


@part
def _third_order(reach, length):
    """How far a length may be from its series to the second order.

    reach, length: how far vectors are from the one in the middle at most, and its length, which is larger (m).
    """
    return THIRD * reach * reach * reach / ((length - reach) * (length - reach))


@part
def _fill_bounds(axes, frame, at_row, line, rows, number, w, series, bound):
    """Bounds of elongations (m) and rates (m/s) of all members of a part at a relative pose.

    axes, frame, at_row, line, rows, number: as of `fill_series`.
    bound (4,): set. w (4, axes), series (SERIES_NUMBERS,): scratch.

    Returns whether there are any: not where ends may meet.
    """
    if not fill_series(axes, frame, at_row, line, rows, number, w, series):
        return False
    fill_bound(series, bound)
    return True


@part
def fill_bound(series, bound):
    """Bounds of elongations and rates with some series, wherever both points are on their lines.

    series (SERIES_NUMBERS,): of `fill_series`.
    bound (4,): set.
    """
    spread = abs(series[X_S]) + abs(series[X_Q]) + abs(series[X_SQ]) + series[X_OFF]
    bound[LOW] = series[X] - spread + min(series[X_SS], 0.0) + min(series[X_QQ], 0.0)
    bound[HIGH] = series[X] + spread + max(series[X_SS], 0.0) + max(series[X_QQ], 0.0)
    spread = abs(series[V_S]) + abs(series[V_Q]) + series[V_OFF]
    bound[SLOWEST] = series[V] - spread
    bound[FASTEST] = series[V] + spread


@part
def _fill_middles(axes, frame, at_row, line, rows, w):
    """What joins the middles of two lines at a relative pose, and what that becomes along the second.

    axes, frame, at_row, line, rows: as of `fill_series`.
    w (4, axes): out: the vector between them, its change along half the second line, and the rates of both.

    Returns the distance (m).
    """
    turn = axes
    speed_at = axes + axes * axes
    spin_at = speed_at + axes
    square = 0.0
    for d in range(axes):
        at = frame[at_row, d] - rows[LOCAL, MIDDLE, d]
        along = 0.0
        rate = frame[at_row, speed_at + d]
        swing = 0.0
        for m in range(axes):
            middle = line[LOCAL, MIDDLE, m]
            half = line[LOCAL, HALF, m]
            at += frame[at_row, turn + d * axes + m] * middle
            along += frame[at_row, turn + d * axes + m] * half
            rate += frame[at_row, spin_at + d * axes + m] * middle
            swing += frame[at_row, spin_at + d * axes + m] * half
        w[0, d] = at
        w[1, d] = along
        w[2, d] = rate
        w[3, d] = swing
        square += at * at
    return math.sqrt(square)


@part
def fill_series(axes, frame, at_row, line, rows, number, w, series):
    """Elongations (m) and rates (m/s) of all members of a part at a relative pose, as series in the places of their
    points on the lines, and how far they may be from these.

    Constant:
      axes: 2 in a plane, 3 in space.
    In:
      frame (any, n_frame), at_row: how ends move, of `priced_candidates.PricedCandidates`, and in which row.
      line, rows (2, 2, axes): lines of the part's second points and of the first.
      number (PART_NUMBERS,): of the part.
    Out:
      series (SERIES_NUMBERS,): set.
      w (4, axes): scratch.

    Returns whether there are any: not where ends may meet.
    """
    spin_at = 2 * axes + axes * axes
    length = _fill_middles(axes, frame, at_row, line, rows, w)
    reach = number[REACH]
    shortest = length - reach
    if not shortest > 0.0:
        return False
    inverse = 1.0 / length
    second = 0.0
    first = 0.0
    rate = 0.0
    swing = 0.0
    second_square = 0.0
    first_square = 0.0
    both = 0.0
    second_rate = 0.0
    first_rate = 0.0
    speed = 0.0
    for d in range(axes):
        half = rows[LOCAL, HALF, d]
        second += w[0, d] * w[1, d]
        first += w[0, d] * half
        rate += w[0, d] * w[2, d]
        swing += w[0, d] * w[3, d]
        second_square += w[1, d] * w[1, d]
        first_square += half * half
        both += w[1, d] * half
        second_rate += w[1, d] * w[2, d]
        first_rate += half * w[2, d]
        speed += w[2, d] * w[2, d]
    speed = math.sqrt(speed)
    second *= inverse
    first *= inverse
    rate *= inverse
    bulge = number[BULGE]
    off = 2.0 * bulge + BOUNDS_WIDER * (1.0 + length)
    series[X] = length - number[FREE]
    series[X_S] = second - number[FREE_S]
    series[X_Q] = -first - number[FREE_Q]
    series[X_SS] = 0.5 * (second_square - second * second) * inverse - number[FREE_SS]
    series[X_SQ] = (second * first - both) * inverse - number[FREE_SQ]
    series[X_QQ] = 0.5 * (first_square - first * first) * inverse - number[FREE_QQ]
    series[X_OFF] = off + _third_order(reach, length) + number[FREE_OFF]
    turning = frame[at_row, spin_at + axes * axes]
    near = reach / shortest
    series[V] = rate
    series[V_S] = (swing + second_rate - second * rate) * inverse
    series[V_Q] = (first * rate - first_rate) * inverse
    off = 0.6 * near * near * speed + near * turning * reach + bulge * (speed * inverse + turning)
    series[V_OFF] = off + BOUNDS_WIDER * (1.0 + speed)
    return True


@part
def _holds(code, p, curves, rest, t, mode, low, high, bound):
    """Whether a mode holds for all members with elongations and rates within bounds.

    code, p (8,), curves, rest: the law, numbers of all laws, and the free length (m).
    t: time (s).
    mode: the mode.
    low, high: the least and the largest permanent set (m).
    bound (4,): of `_fill_bounds`.
    """
    for corner in range(4):
        x = bound[LOW] - high if corner < 2 else bound[HIGH] - low
        rate = bound[SLOWEST] if corner % 2 == 0 else bound[FASTEST]
        if not law_margin(code, p, x, rate, mode, t, curves, rest) > 0.0:
            return False
    return True


@part
def _all_begin(code, p, curves, rest, t, mode, bound):
    """Whether all members of a law that remembers begin in a mode, and none with a permanent set.

    Margins do not tell: crushing ends by its rate, at any elongation, but begins at the plateau.

    code, p, curves, rest, t, mode, bound: as of `_holds`.
    """
    for corner in range(4):
        x = bound[LOW] if corner < 2 else bound[HIGH]
        rate = bound[SLOWEST] if corner % 2 == 0 else bound[FASTEST]
        begun = np.int64(law_start(code, p, x, rate, 0.0, t, curves, rest))
        if begun != mode or law_first_set(code, p, x, mode) != 0.0:
            return False
    return True


@part
def _is_over(code, p, curves, rest, t, mode, low, high, bound):
    """Whether a mode has ended for all of them: a margin is not above its tangent.

    code, p, curves, rest, t, mode, low, high, bound: as of `_holds`.
    """
    x = 0.5 * (bound[LOW] - high + bound[HIGH] - low)
    rate = 0.5 * (bound[SLOWEST] + bound[FASTEST])
    by_x, by_rate = law_margin_slopes(code, p, x, rate, mode, t, curves, rest)
    most = abs(by_x) * (bound[HIGH] - low - x) + abs(by_rate) * (bound[FASTEST] - rate)
    return law_margin(code, p, x, rate, mode, t, curves, rest) + most < 0.0


@kernel
def modes_at_nodes(model, candidates, k, s, which, spans, mode):
    """In which mode all members of a part are at each node of a step, by a law that does not remember.

    In:
      model: with the numbers of the laws.
      candidates, k: a `PricedCandidates`, and the number of the run.
      s: number of the step.
      which: number of the part.
    Out:
      mode (NODES,): of all, or UNSURE where bounds do not tell.
      spans: a `Spans`, of which the bounds are overwritten.
    """
    code = candidates.run[k, CODE]
    p = candidates.law[k]
    curves = model.curves
    line, number, w, bound, series = spans.line, spans.number, spans.w, spans.bound, spans.series
    rest = number[which, FREE]
    axes = freedoms(model) - rotations(model)
    for m in range(NODES):
        mode[m] = UNSURE
        o = candidates.step[s, FIRST_NODE] + m
        t = candidates.step_time[s, 0] + NODE[m] * candidates.step_time[s, 1]
        rows = line[ROWS_OF_ALL]
        if not _fill_bounds(axes, candidates.node_frame, o, line[which], rows, number[which], w, series, bound):
            continue
        x = 0.5 * (bound[LOW] + bound[HIGH])
        rate = 0.5 * (bound[SLOWEST] + bound[FASTEST])
        now = np.int64(law_start(code, p, x, rate, 0.0, t, curves, rest))
        if _holds(code, p, curves, rest, t, now, 0.0, 0.0, bound):
            mode[m] = now


@kernel
def modes_in_step(model, candidates, k, u, which, mode, low, high, spans):
    """What is known of the modes of all members of a part in a step by a law that remembers, or at a state alone.

    In:
      model: with the numbers of the laws.
      candidates, k: a `PricedCandidates`, and the number of the run.
      u: number of the step among those of the run.
      which: number of the part.
      mode: that all begin in; negative where it is to be found: the law does not remember, or has not begun.
      low, high: the least and the largest of their permanent sets (m).
    Out:
      spans: a `Spans`, of which the bounds are overwritten.

    Returns UNSURE, a mode of which none leaves, or LEAVES less the mode that all leave; and the mode that all end in.
    """
    run = candidates.run[k]
    code = run[CODE]
    p = candidates.law[k]
    curves = model.curves
    line, number, w, bound, series = spans.line, spans.number, spans.w, spans.bound, spans.series
    rows = line[ROWS_OF_ALL]
    line = line[which]
    number = number[which]
    rest = number[FREE]
    s = run[FIRST_STEP] + u
    o = candidates.step[s, FIRST_STAGE]
    at_state = candidates.step[s, KIND] == POINT
    frame = candidates.frame if at_state else candidates.node_frame
    first = o if at_state else candidates.step[s, FIRST_NODE]
    begin = candidates.when[o] if at_state else candidates.step_time[s, 0]
    long = 0.0 if at_state else candidates.step_time[s, 1]
    remembers = law_remembers(code)
    axes = freedoms(model) - rotations(model)
    begins = mode
    now = mode
    sign = 0.0
    for m in range(1 if at_state else NODES):
        t = begin + NODE[m] * long
        if not _fill_bounds(axes, frame, first + m, line, rows, number, w, series, bound):
            return UNSURE, UNSURE
        before = sign
        sign = 1.0 if bound[SLOWEST] > 0.0 else -1.0 if bound[FASTEST] < 0.0 else 0.0
        x = 0.5 * (bound[LOW] - high + bound[HIGH] - low)
        rate = 0.5 * (bound[SLOWEST] + bound[FASTEST])
        if now < 0:
            now = np.int64(law_start(code, p, x, rate, 0.0, t, curves, rest))
            begins = now
            if remembers and not _all_begin(code, p, curves, rest, t, now, bound):
                return UNSURE, UNSURE
        if _holds(code, p, curves, rest, t, now, low, high, bound):
            continue
        if m == 0 or now != begins or low != high or sign == 0.0 or sign != before:
            return UNSURE, UNSURE
        if not _is_over(code, p, curves, rest, t, now, low, high, bound):
            return UNSURE, UNSURE
        new = np.int64(law_next(code, p, x, rate, 0.0, now, t, curves, rest))
        if new == now or law_makes_set(code, now, new):
            return UNSURE, UNSURE
        if not _holds(code, p, curves, rest, t, new, low, high, bound):
            return UNSURE, UNSURE
        now = new
    return (begins if now == begins else LEAVES - begins), now
