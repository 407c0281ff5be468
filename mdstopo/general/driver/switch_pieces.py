"""Expressions of responses with kinks and jumps: where in time their switches change, and what that does to peaks.

Between two changes an expression is smooth. A peak where a switch with the margin m changes sides, at the time t_s,
varies with it, whether the expression has a kink there or jumps:

    dG = dg + g' dt_s,     dt_s = -dm / m',

with g on the side of the peak. So does an integral of what jumps there: it changes by (g- - g+) dt_s.
"""

from typing import TYPE_CHECKING

import numpy as np

from mdstopo.general.driver.leading_members import Lead, apart
from mdstopo.general.model.expressions import MARGINS
from mdstopo.general.responses.extremes import FRACTION, FRACTIONS, OTHER, RATE, SHARE, STEP, VALUE, WHO
from mdstopo.general.responses.general_responses import switches_of
from mdstopo.general.responses.sampled_roots import may_vanish, roots_between
from mdstopo.scene.springs_model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver
    from mdstopo.general.driver.minima import Pieces

#: a jump that is smaller than this, relative to the values beside it, is none
SAME = 1e-9


def switch_leads(driver: "GeneralDriver", j: int, t: FloatArray) -> list[Lead]:
    """The times between which the switches of expression j keep their sides, in order; t (m + 1,): the steps' times."""
    count = len(t) - 1
    fractions = np.array(FRACTIONS)
    places = np.column_stack([np.repeat(np.arange(count), len(fractions)), np.tile(fractions, count)]).astype(float)
    cuts = _cuts(driver, j, t, places)
    middle = np.column_stack([np.arange(count), np.full(count, 0.5)])
    sides = driver.sample_response(j, middle, False, count, rates=False)[2][:, 2]
    found: list[Lead] = []
    for w in range(count):
        ends = [*apart([0.0, *sorted(cuts.get(w, []))]), 1.0]
        who = [int(sides[w])]
        if len(ends) > 2:
            middles = 0.5 * (np.array(ends[:-1]) + np.array(ends[1:]))
            inside = np.column_stack([np.full(len(middles), float(w)), middles])
            seen = driver.sample_response(j, inside, True, count, rates=False)[2][:, 2]
            who = [int(each) for each in seen]
        for low, high, mode in zip(ends[:-1], ends[1:], who, strict=True):
            if found and found[-1].step == w and found[-1].member == mode:
                found[-1] = found[-1]._replace(high=high)
            else:
                found.append(Lead(w, low, high, mode))
    return found


def _cuts(driver: "GeneralDriver", j: int, t: FloatArray, places: FloatArray) -> dict[int, list[float]]:
    """By step, the fractions at which a margin vanishes. places (m K, 2): the FRACTIONS of all steps."""
    count, samples = len(t) - 1, len(FRACTIONS)
    cuts: dict[int, list[float]] = {}
    for switch in range(switches_of(driver.scene.model, j)):
        seen = driver.sample_response(j, places, False, count, who=-2 - switch)[2].reshape(count, samples, -1)
        margin, rate = seen[:, :, 0], seen[:, :, 1] * (np.diff(t) / (samples - 1))[:, None]
        for w, k in np.argwhere(may_vanish(margin, rate)).tolist():

            def exact(c: FloatArray, w: int = w, who: int = -2 - switch) -> FloatArray:
                at = np.column_stack([np.full(len(c), float(w)), c])
                value: FloatArray = driver.sample_response(j, at, True, count, who=who, rates=False)[2][:, 0]
                return value

            span = FRACTIONS[k], FRACTIONS[k + 1]
            values = float(margin[w, k]), float(margin[w, k + 1])
            rates = float(rate[w, k]), float(rate[w, k + 1])
            cuts.setdefault(w, []).extend(roots_between(span, values, rates, exact))
    return cuts


def switched_peaks(
    driver: "GeneralDriver", j: int, pieces: "Pieces", signs: tuple[float, ...], window: float
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
            if (c <= 0.0 or c >= 1.0) and 0 < between < len(pieces.leads) and not pieces.is_stated(between):
                row[VALUE], row[RATE], _ = pieces.one_sided_limits(between)[0 if c >= 1.0 else 1]
                speed, margin = _passed(driver, j, pieces, between)
                if margin:
                    row[OTHER], row[SHARE] = margin, -row[RATE] / speed
            rows.append(row)
    return rows


def switched_integral(
    driver: "GeneralDriver", j: int, pieces: "Pieces", square: bool, slope: float
) -> list[tuple[float, FloatArray]]:
    """How jumps of expression j at times that vary change its integral over time: rows whose derivatives are added,
    with their factors.

    driver: with a finished run. j: the response.
    pieces: its pieces.
    square: whether the integral is that of its square. slope: the derivative by it, of the value that it becomes.
    """
    found = []
    largest = float(np.abs(pieces.samples[:, :, 0]).max())
    for b in range(1, len(pieces.leads)):
        if pieces.leads[b].member == pieces.leads[b - 1].member or pieces.is_stated(b):
            continue
        before, behind = (float(seen[0]) for seen in pieces.one_sided_limits(b))
        drop = before * before - behind * behind if square else before - behind
        if abs(drop) <= SAME * largest * (largest if square else 1.0):
            continue
        speed, margin = _passed(driver, j, pieces, b)
        if margin:
            row = pieces.row_before(b)
            row[WHO], row[RATE], row[VALUE] = margin, speed, 0.0
            found.append((-slope * drop / speed, row))
    return found


def _passed(driver: "GeneralDriver", j: int, pieces: "Pieces", b: int) -> tuple[float, int]:
    """The margin that vanishes in front of piece b: its rate (per s), and the `who` that stands for it; 0: none.

    Of several it is the one that is nearest to zero in time.
    """
    old, new = pieces.leads[b - 1].member, pieces.leads[b].member
    best = (0.0, 0)
    nearest = np.inf
    for switch in range(switches_of(driver.scene.model, j)):
        if (old ^ new) >> switch & 1:
            who = old + (switch + 1) * MARGINS
            value, rate, _ = driver.evaluate_one(j, pieces.count, pieces.place_before(b), who=who).tolist()
            if rate != 0.0 and abs(value / rate) < nearest:
                nearest, best = abs(value / rate), (rate, who)
    return best
