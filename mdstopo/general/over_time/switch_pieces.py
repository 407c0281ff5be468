"""Expressions of responses with kinks and jumps: what changes of their switches do to peaks and integrals over time.

Between two changes an expression is smooth. A peak where a switch with the margin m changes sides, at the time t_s,
varies with it, whether the expression has a kink there or jumps:

    dG = dg + g' dt_s,     dt_s = -dm / m',

with g on the side of the peak. So does an integral of what jumps there: it changes by (g- - g+) dt_s.
"""

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.expressions import MARGINS
from mdstopo.general.over_time.pieces import Pieces
from mdstopo.general.responses.extremes import FRACTION, OTHER, RATE, SHARE, STEP, VALUE, WHO
from mdstopo.general.responses.general_responses import switches_of
from mdstopo.scene.springs_model import FloatArray

#: a jump that is smaller than this, relative to the values beside it, is none
NO_JUMP = 1e-9


def switched_peaks(
    driver: DriverWithRun, j: int, pieces: Pieces, signs: tuple[float, ...], window: float
) -> list[FloatArray]:
    """The peaks of expression j, and where asked for of -g, as rows of `extremes`.

    driver: with a finished run. j: the response.
    pieces: its pieces. signs: 1 for peaks of g, -1 for those of -g.
    window: how far below the highest a peak may be, relative to it.
    """
    rows: list[FloatArray] = []
    for sign in signs:
        for row in pieces.peaks(sign, window):
            k, c = int(row[STEP]), float(row[FRACTION])
            between = k if c <= 0.0 else k + 1  # the number of the boundary, if the place is one
            pieces.settle(row, k, float(pieces.fraction(np.array([k]), np.array([c]))[0]))
            if (c <= 0.0 or c >= 1.0) and 0 < between < len(pieces) and not pieces.is_stated(between):
                row[VALUE], row[RATE], _ = pieces.one_sided_limits(between)[0 if c >= 1.0 else 1]
                speed, margin = _passed(driver, j, pieces, between)
                if margin:
                    row[OTHER], row[SHARE] = margin, -row[RATE] / speed
            rows.append(row)
    return rows


def switched_integral(
    driver: DriverWithRun, j: int, pieces: Pieces, square: bool, slope: float
) -> list[tuple[float, FloatArray]]:
    """How jumps of expression j at times that vary change its integral over time: rows whose derivatives are added,
    with their factors.

    driver: with a finished run. j: the response.
    pieces: its pieces.
    square: whether the integral is that of its square. slope: the derivative by it, of the value that it becomes.
    """
    found = []
    changes = [b for b in range(1, len(pieces)) if pieces[b].who != pieces[b - 1].who and not pieces.is_stated(b)]
    largest = float(np.abs(pieces.samples[:, :, 0]).max()) if changes else 0.0
    for b in changes:
        before, behind = (float(seen[0]) for seen in pieces.one_sided_limits(b))
        drop = before * before - behind * behind if square else before - behind
        if abs(drop) <= NO_JUMP * largest * (largest if square else 1.0):
            continue
        speed, margin = _passed(driver, j, pieces, b)
        if margin:
            row = pieces.row_before(b)
            row[WHO], row[RATE], row[VALUE] = margin, speed, 0.0
            found.append((-slope * drop / speed, row))
    return found


def _passed(driver: DriverWithRun, j: int, pieces: Pieces, b: int) -> tuple[float, int]:
    """The margin that vanishes in front of piece b: its rate (per s), and the `who` that stands for it; 0: none.

    Of several it is the one that is nearest to zero in time.
    """
    old, new = pieces[b - 1].who, pieces[b].who
    best = (0.0, 0)
    nearest = np.inf
    for switch in range(switches_of(driver.scene.model, j)):
        if (old ^ new) >> switch & 1:
            who = old + (switch + 1) * MARGINS
            value, rate, _ = driver.evaluate_one(j, pieces.count, pieces.place_before(b), who=who).tolist()
            if rate != 0.0 and abs(value / rate) < nearest:
                nearest, best = abs(value / rate), (rate, who)
    return best
