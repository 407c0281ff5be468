"""Peaks of an expression that stand where the norm of a vector in it passes zero.

There the norm b has a kink, and with it the expression g; the time t of the kink is that of b = 0. Just before
it both are smooth, with b' < 0, and a design nearby has its peak at another zero of b:

    dG = dg + g' dt,     dt = -db / b'.

At the zero itself the norm's direction is rounding, so all this is read a little before it.
"""

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.expressions import FIRST_PART, MARGINS
from mdstopo.general.over_time.kinks import DISTANCES, sharpened
from mdstopo.general.responses.extremes import FRACTION, NOBODY, OTHER, RATE, SHARE, SIGN, STEP, TIME, VALUE, WHO
from mdstopo.general.responses.general_responses import RATE_SHIFT, norms_in, switches_of
from mdstopo.general.steps.step_history import EVENTS
from mdstopo.scene.springs_model import FloatArray

#: how far before a zero values are read, as fractions of the step: the second where rates are differences (`RATE_SHIFT`
#: to both sides), which at the first would reach beyond the zero
READ_BEFORE_ZERO = (DISTANCES[-1], 4.0 * RATE_SHIFT)
#: a norm may pass zero at a peak if its value there is less than half of the value by this share of the step before
LOOK_BACK = 1e-3
#: it passes zero if its rate, from a place before the zero on, would leave less than this share of the value there
LEFT_AT_ZERO = 0.3


def complete_at_zeros(driver: DriverWithRun, j: int, count: int, rows: FloatArray) -> None:
    """Complete those of the peaks of response j that stand where a norm in it passes zero.

    driver: with a finished run of `count` steps. j: the response. rows (K, COLUMNS): of `extremes`, changed in place.
    """
    parts = [part - int(driver.scene.model.response[j, FIRST_PART]) for part in norms_in(driver.scene.model, j)]
    for row in rows if parts else []:
        for part in parts:
            if row[OTHER] == NOBODY:
                _complete(driver, j, part, count, row)


def _complete(driver: DriverWithRun, j: int, part: int, count: int, row: FloatArray) -> None:
    """Complete a row if the norm that is number `part` of what expression j is of passes zero there."""
    t, norm = driver.states()[0], int(driver.scene.model.response[j, FIRST_PART]) + part
    k, c = int(row[STEP]), float(row[FRACTION])
    if c <= READ_BEFORE_ZERO[0] and k > 0:
        k, c = k - 1, 1.0
    length = float(t[k + 1] - t[k])
    value = driver.evaluate_one(norm, count, np.array([k, c])).item(0)
    before = driver.evaluate_one(norm, count, np.array([k, max(c - LOOK_BACK, 0.0)])).item(0)
    if value > 0.5 * before or (c >= 1.0 - READ_BEFORE_ZERO[0] and not _may_move(driver, k)):
        return

    def norm_at(places: FloatArray, exact: bool) -> FloatArray:
        return driver.sample_response(norm, places, exact, count, rates=False)[2]

    c = sharpened(k, c, norm_at)
    switch, who = switches_of(driver.scene.model, j) + part, int(row[WHO])
    for d in READ_BEFORE_ZERO:
        place, behind = np.array([k, c - d]), np.array([k, c + d] if c + d <= 1.0 else [k + 1.0, d])
        if c <= d or behind[0] >= count:
            return
        value, rate, _ = driver.evaluate_one(norm, count, place).tolist()
        rises = driver.evaluate_one(j, count, place, who=who).item(1)
        falls = driver.evaluate_one(j, count, behind, who=who).item(1)
        if (
            rate < 0.0
            and abs(value + rate * d * length) <= LEFT_AT_ZERO * value
            and row[SIGN] * rises >= 0.0 >= row[SIGN] * falls
        ):
            row[VALUE] = driver.evaluate_one(j, count, np.array([k, c]), who=who).item(0)
            row[TIME], row[STEP], row[FRACTION], row[RATE] = t[k] + c * length, k, c - d, rises
            row[OTHER], row[SHARE] = max(who, 0) + (switch + 1) * MARGINS, -rises / rate
            return


def _may_move(driver: DriverWithRun, k: int) -> bool:
    """Whether step k ends neither at an event nor at a time that the case gives."""
    events = driver.index_of_steps()[k : k + 2, EVENTS]
    return bool(events[0] == events[1]) and not np.any(driver.times == driver.states()[0][k + 1])
