"""Which members of a part of a tile stay in a mode in a step, from where their points are on lines.

Elongation and rate of a member are polynomials in these places, but for a remainder that has a bound (`certain_modes`).
So a margin that is the least of linear functions is above others that are such polynomials, and where these are above
zero at all nodes of the step the member stays in the mode: a few sums and products for each, in vectors, while what it
does is not computed. Only members near a switch are left to be looked at.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, larger, load, negative, zero
from mdstopo.general.design.followed_member import CLOSE_MARGIN
from mdstopo.general.model.priced_candidates import CODE, FIRST_NODE, NODES
from mdstopo.general.pricing.certain_modes import (
    FASTEST,
    HIGH,
    LINED_AT_ONCE,
    LINED_FIRST,
    LINED_LEVEL,
    LOW,
    ROW_LINES,
    SERIES_NUMBERS,
    SLOWEST,
    V_OFF,
    V_Q,
    V_S,
    X_OFF,
    X_Q,
    X_QQ,
    X_S,
    X_SQ,
    X_SS,
    V,
    X,
    fill_bound,
    fill_series,
    rows_of_line,
)
from mdstopo.general.pricing.sorted_members import (
    AT_ZERO,
    BY_ELONGATION,
    BY_RATE,
    CORNERS,
    COUNT,
    SURE,
    UNSORTED,
    fill_tangents,
    join_class,
    try_mode,
)
from mdstopo.general.pricing.switching_prices import NO_REST
from mdstopo.mechanics.kinematics.kinematics_interface import freedoms, rotations
from mdstopo.mechanics.laws.law_table import law_start
from mdstopo.sensitivity.tile_interpolation import BROAD

#: functions below the margin of a mode at all nodes: polynomials in the places s and q of both points, the terms of
#: 1, s, q, s^2, s q, q^2
BELOW_NUMBERS = 6
BY_1, BY_S, BY_Q, BY_SS, BY_SQ, BY_QQ = range(BELOW_NUMBERS)
MOST_BELOW = NODES * CORNERS


@kernel
def sort_by_lines(model, candidates, k, s, level, first, height, spans, sorting):
    """Sort those members of a part whose bounds tell that they stay in a mode, by a law that `is_quick` and does not
    remember.

    In:
      model: with the numbers of the laws.
      candidates, k, s: a `PricedCandidates`, and the numbers of the run and of the step.
      level, first, height: of the part, its first column, and how many rows it has.
      spans: the tile's `Spans`.
    In place:
      sorting: a `Sorting`: classes of these members are set, UNSORTED for all others, and added to those that
        there are; the modes that were tried are set, and the tangents of their margins in a range that all are in.

    Returns how many modes were tried; -1 where ends may meet, and no range is known.
    """
    kind, classes, tried, tangent = sorting.kind, sorting.classes, sorting.tried, sorting.tangent
    code = candidates.run[k, CODE]
    p = candidates.law[k]
    inner = max(level, np.int64(LINED_LEVEL))
    size = BROAD >> inner
    parts = (BROAD >> level) // size
    series = np.empty((LINED_AT_ONCE, ROW_LINES, NODES, SERIES_NUMBERS))
    box = np.array([np.inf, -np.inf, np.inf, -np.inf])
    for at in range(parts):
        which = (1 << inner) - 1 + first // size + at
        for n in range(ROW_LINES):
            begin, behind = rows_of_line(n, height, spans.split)
            if begin < behind and not _fill_nodes(model, candidates, s, which, n, spans, series[at, n], box):
                return np.int64(-1)
    count = _modes_to_try(code, p, model.curves, candidates.step_time[s, 0], box, series[:parts], tried)
    fill_tangents(code, p, model.curves, candidates.step_time[s, 0], box, count, tried, tangent)
    for a in range(height):
        kind[a * BROAD + first : a * BROAD + first + parts * size] = UNSORTED
    below = np.empty((MOST_BELOW, BELOW_NUMBERS))
    for mode in range(count):
        own = join_class(tried[mode], tried[mode], 1, classes)
        if own == UNSORTED:
            continue
        classes[own, COUNT] -= 1  # members are counted below; a class that stays empty is the next mode's
        for at in range(parts):
            begins = first + at * size
            place = spans.column_place[inner - LINED_LEVEL, begins : begins + size]
            for n in range(ROW_LINES):
                begin, behind = rows_of_line(n, height, spans.split)
                if begin < behind:
                    functions = _fill_below(tangent[mode], series[at, n], below)
                    classes[own, COUNT] += _sort_rows(
                        own, begin, behind, begins, functions, below, place, spans.row_place, kind
                    )
    return count


@kernel
def _fill_nodes(model, candidates, s, which, n, spans, series, box):
    """Elongations and rates at the nodes of a step as series.

    In:
      model: of which the kind counts.
      candidates, s: a `PricedCandidates`, and the number of the step.
      which, n: numbers of the part and of the line of rows.
    In place:
      box (4,): the least and the largest elongation (m), and the least and the largest rate (m/s): widened to these.
    Out:
      series (NODES, SERIES_NUMBERS): set.
      spans: a `Spans`, of which vectors and bounds are overwritten.

    Returns whether there are any: not where ends may meet.
    """
    line, w, row_line, number, bound = spans.line, spans.w, spans.row_line, spans.row_number, spans.bound
    axes = freedoms(model) - rotations(model)
    for m in range(NODES):
        own = series[m]
        if not fill_series(
            axes, candidates.node_frame, candidates.step[s, FIRST_NODE] + m, line[which], row_line[n],
            number[n, which - LINED_FIRST], w, own,
        ):  # fmt: skip
            return False
        fill_bound(own, bound)
        box[LOW] = min(box[LOW], bound[LOW])
        box[HIGH] = max(box[HIGH], bound[HIGH])
        box[SLOWEST] = min(box[SLOWEST], bound[SLOWEST])
        box[FASTEST] = max(box[FASTEST], bound[FASTEST])
    return True


@part
def _modes_to_try(code, p, curves, t, box, series, tried):
    """Modes in which some members may be: at the corners of the range, and in the middle of every part.

    In:
      code, p (8,), curves, t: the law, numbers of all laws, and any time (s), on which the law does not depend.
      box (4,): of `_fill_nodes`.
      series (parts, ROW_LINES, NODES, SERIES_NUMBERS): of the parts, of which the first line counts.
    Out:
      tried (TRIED,): the modes.

    Returns how many there are.
    """
    count = np.int64(0)
    for i in range(CORNERS + series.shape[0] * NODES):
        x = box[i // 2 % 2]
        rate = box[2 + i % 2]
        if i >= CORNERS:
            own = series[(i - CORNERS) // NODES, 0, (i - CORNERS) % NODES]
            x = own[X]
            rate = own[V]
        now = np.int64(law_start(code, p, x, rate, 0.0, t, curves, NO_REST))
        count = try_mode(now, count, tried)
    return count


@part
def _fill_below(tangent, series, below):
    """Polynomials in the places of points that are below the margin of a mode, less what rounding may be, at all nodes.

    In:
      tangent (CORNERS, TANGENT_NUMBERS): of the margin.
      series (NODES, SERIES_NUMBERS): of `_fill_nodes`.
    Out:
      below (MOST_BELOW, BELOW_NUMBERS): set.

    Returns how many there are.
    """
    count = np.int64(0)
    for corner in range(CORNERS):
        own = tangent[corner]
        by_x = own[BY_ELONGATION]
        by_rate = own[BY_RATE]
        known = False
        for other in range(corner):
            before = tangent[other]
            alike = before[BY_ELONGATION] == by_x and before[BY_RATE] == by_rate
            known = known or (alike and before[AT_ZERO] <= own[AT_ZERO])
        for m in range(0 if known else NODES):
            x = series[m]
            value = own[AT_ZERO] + by_x * x[X] + by_rate * x[V] - abs(by_x) * x[X_OFF] - abs(by_rate) * x[V_OFF]
            below[count, BY_1] = value - (CLOSE_MARGIN if m == 0 else SURE)
            below[count, BY_S] = by_x * x[X_S] + by_rate * x[V_S]
            below[count, BY_Q] = by_x * x[X_Q] + by_rate * x[V_Q]
            below[count, BY_SS] = by_x * x[X_SS]
            below[count, BY_SQ] = by_x * x[X_SQ]
            below[count, BY_QQ] = by_x * x[X_QQ]
            count += 1
    return count


@kernel
def _sort_rows(own, begin, behind, first, functions, below, place, row_place, kind):
    """Sort the members of some columns in some rows whose functions are all above zero, and that are not sorted.

    In:
      own: the class into which they go.
      begin, behind: the first row, and the one behind the last.
      first: the first column.
      functions, below: of `_fill_below`.
      place (columns,), row_place (TALL,): where points are on their lines.
    In place:
      kind (PLACES,): the class of each member.

    Returns how many these are.
    """
    count = np.int64(0)
    for a in range(begin, behind):
        at = a * BROAD + first
        least = np.inf
        most = np.inf
        for f in range(functions):
            value, slope, square = _along_row(below[f], row_place[a])
            least = min(least, value - abs(slope) + min(square, 0.0))
            most = min(most, value + abs(slope) + max(square, 0.0))
        if not most > 0.0:
            continue
        for b in range(0, place.shape[0], lanes()):
            bits = (1 << lanes()) - 1
            if not least > 0.0:
                at_column = load(place, b)
                over = zero() - np.inf
                for f in range(functions):
                    value, slope, square = _along_row(below[f], row_place[a])
                    over = larger(over, zero() - ((square * at_column + slope) * at_column + value))
                bits = negative(over)
            for lane in range(lanes() if bits != 0 else 0):
                if (bits >> lane) & 1 == 1 and kind[at + b + lane] == UNSORTED:
                    kind[at + b + lane] = own
                    count += 1
    return count


@part
def _along_row(below, q):
    """A polynomial in the places of both points, for a row at the place q: the terms of 1, s and s^2.

    below (BELOW_NUMBERS,): the polynomial.
    """
    value = below[BY_1] + (below[BY_Q] + below[BY_QQ] * q) * q
    return value, below[BY_S] + below[BY_SQ] * q, below[BY_SS]
