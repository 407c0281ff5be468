"""Minima over time of what has kinks: the largest of several forces, an absolute value, a norm.

The minimum of the largest force may stand where it passes from one member to another: there f_a falls and f_b rises,
both have the value, and so does the minimum of a design nearby, where the time t of the crossing is another one:

    dG = df_a + f_a' dt = df_b + f_b' dt,   so   dG = (f_b' df_a - f_a' df_b) / (f_b' - f_a'),

a mean of both derivatives; where b stays as it is, held at an actuator's limit, that of b alone. A norm that passes
zero has its minimum there and keeps it: dG = 0. Where it only comes near zero it turns round so sharply that its time
has to be found better than from rates by differences: from its square, which is smooth.
"""

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.over_time.pieces import Pieces
from mdstopo.general.responses.extremes import FRACTION, OTHER, SHARE, STEP, VALUE, WHO, ZERO
from mdstopo.general.responses.general_responses import has_kinks
from mdstopo.integrators.driver import CLOSENESS
from mdstopo.scene.springs_model import FloatArray

#: a minimum below this share of the highest value may be a zero, or nearly one
LOW_MINIMUM = 0.05
#: distances, in steps, of the places whose squares tell where a value turns round
BESIDE_MINIMUM = (1e-2, 1e-3)
#: a minimum is a zero if, at the rate beside it, the value would reach zero within this share of a step
ZERO_WITHIN = 1e-9
#: how near to zero a value is that has a kink where a step was made to end at its zero, relative to the highest
LANDED = 1e-6


def minima(driver: DriverWithRun, j: int, t: FloatArray) -> FloatArray:
    """The minima of response j that come near the lowest, as rows of `extremes`; t (m + 1,): the steps' times."""
    pieces = Pieces(driver, j, t)
    rows = pieces.minima(CLOSENESS)
    highest = float(np.abs(pieces.samples[:, :, 0]).max())
    bent = bool(has_kinks(driver.scene.model, j))
    for row in rows:
        k, c = int(row[STEP]), float(row[FRACTION])
        between = k if c <= 0.0 else k + 1  # the number of the boundary, if the place is one
        pieces.settle(row, k, float(pieces.fraction(np.array([k]), np.array([c]))[0]))
        if c <= 0.0 or c >= 1.0:
            if 0 < between < len(pieces):
                _at_boundary(row, pieces, between, highest, pieces.is_stated(between))
        elif bent and abs(row[VALUE]) <= LOW_MINIMUM * highest:
            _turned_round(row, pieces, k)
    return rows


def _at_boundary(row: FloatArray, pieces: Pieces, b: int, highest: float, stated: bool) -> None:
    """Complete a row at the boundary in front of piece b, where a value that falls may begin to rise.

    stated: whether the time is given, or an event's: then it varies as that does.
    """
    before, behind = pieces.one_sided_limits(b)
    row[VALUE] = (before if row[FRACTION] == pieces[b - 1].high else behind)[0]
    (falls, first), (rises, second) = before[1:].tolist(), behind[1:].tolist()
    if not falls <= 0.0 <= rises or falls == rises:
        return
    if first == second:
        if falls < 0.0 < rises and abs(row[VALUE]) <= LANDED * highest:
            row[VALUE], row[OTHER] = 0.0, ZERO
    elif not stated:
        row[WHO], row[OTHER], row[SHARE] = first, second, -falls / (rises - falls)


def _turned_round(row: FloatArray, pieces: Pieces, k: int) -> None:
    """Complete a row inside piece k whose value is low: where exactly its square is lowest, and whether it is zero."""
    c = float(row[FRACTION])
    least = slope = 0.0
    for d in BESIDE_MINIMUM:
        nodes = min(max(c - 2.0 * d, 0.0), 1.0 - 4.0 * d) + d * np.arange(5.0)
        u = (nodes - c) / d
        by_power = np.linalg.solve(np.vander(u, increasing=True), pieces.value(k, nodes) ** 2)
        square = np.polynomial.Polynomial(by_power)
        rate, bend = square.deriv(), square.deriv(2)
        x = 0.0
        for _ in range(8):
            if not bend(x) > 0.0:
                return
            x = float(np.clip(x - rate(x) / bend(x), u[0], u[-1]))
        c += d * x
        least, slope = float(square(x)), 0.5 * float(bend(x)) / d**2
    if least <= ZERO_WITHIN**2 * slope:
        row[VALUE], row[OTHER] = 0.0, ZERO
    else:
        row[VALUE] = pieces.value(k, np.array([c]))[0]
    pieces.settle(row, k, c)
