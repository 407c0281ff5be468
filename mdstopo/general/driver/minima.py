"""Minima over time of what has kinks: the largest of several forces, an absolute value, a norm.

The minimum of the largest force may stand where two members change hands: there f_a falls and f_b rises, both have the
value, and so does the minimum of a design nearby, where the time t of the crossing is another one:

    dG = df_a + f_a' dt = df_b + f_b' dt,   so   dG = (f_b' df_a - f_a' df_b) / (f_b' - f_a'),

a mean of both derivatives; where b stays as it is, held at an actuator's limit, that of b alone. A norm that passes
zero has its minimum there and keeps it: dG = 0. Where it only comes near zero it turns round so sharply that its time
has to be found better than from rates by differences: from its square, which is smooth.
"""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mdstopo.general.driver.leading_members import Lead, changes, is_led, leads
from mdstopo.general.driver.switch_pieces import switch_leads
from mdstopo.general.responses.extremes import (
    FRACTION,
    OTHER,
    SHARE,
    STEP,
    TIME,
    VALUE,
    WHO,
    ZERO,
    row_of,
    sample,
)
from mdstopo.general.responses.general_responses import has_kinks, switches_of
from mdstopo.integrators.driver import CLOSENESS
from mdstopo.scene.springs_model import FloatArray, IndexArray

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver

#: a minimum below this share of the highest value may be a zero, or nearly one
LOW = 0.05
#: distances, in steps, of the places whose squares tell where a value turns round
APART = (1e-2, 1e-3)
#: a minimum is a zero if, at the rate beside it, the value would reach zero within this share of a step
NOUGHT = 1e-9
#: how near to zero a value is that has a kink where a step was made to end at its zero, relative to the highest
LANDED = 1e-6


class Pieces:
    """The steps of a motion, cut where another member carries the largest force, or a switch of an expression
    changes its side.

    On each, response j is smooth.

    t (P + 1,): their times. With `evaluate_at` they are evaluated as steps are.
    """

    def __init__(self, driver: "GeneralDriver", j: int, t: FloatArray) -> None:
        self._driver, self._j, self.count = driver, j, len(t) - 1
        if is_led(driver, j):
            self.leads = leads(driver, j, t)
        elif switches_of(driver.scene.model, j):
            self.leads = switch_leads(driver, j, t)
        else:
            self.leads = [Lead(w, 0.0, 1.0, -1) for w in range(len(t) - 1)]
        self._step = np.array([lead.step for lead in self.leads])
        self._low = np.array([lead.low for lead in self.leads])
        self._high = np.array([lead.high for lead in self.leads])
        self._member = np.array([lead.member for lead in self.leads])
        self.t: FloatArray = np.append(t[self._step] + self._low * (t[self._step + 1] - t[self._step]), t[-1])
        self.changes = changes(self.leads, t)

    @cached_property
    def samples(self) -> FloatArray:
        """Value, rate and member (P, SAMPLES, 3) in all pieces."""
        return sample(len(self.leads), self.evaluate_at)

    def minima(self, window: float) -> FloatArray:
        """The minima that come near the lowest, as rows (K, COLUMNS) whose places are pieces and fractions of them."""
        return self.peaks(-1.0, window)

    def peaks(self, sign: float, window: float) -> FloatArray:
        """The peaks of sign times g that come near the highest, as `minima` has them."""
        pieces = np.column_stack([self._step, self._low, self._high, self._member]).astype(np.float64)
        return self._driver.peaks_of_pieces(self._j, self.count, self.t, self.samples, sign, window, pieces)

    def evaluate_at(self, places: FloatArray, exact: bool) -> FloatArray:
        """(K, 3) value, rate, member at places (K, 2): pieces and fractions of them."""
        k = places[:, 0].astype(np.int64)
        real = np.column_stack([self._step[k], self.fraction(k, places[:, 1])])
        out = np.empty((len(k), 3))
        for member in np.unique(self._member[k]).tolist():
            own = self._member[k] == member
            out[own] = self._driver.sample_response(self._j, real[own], exact, self.count, who=member)[2]
        return out

    def fraction(self, k: IndexArray, c: FloatArray) -> FloatArray:
        """The fractions of steps that are fractions c of pieces k."""
        low, high = self._low[k], self._high[k]
        return np.asarray(np.where(c >= 1.0, high, low + c * (high - low)))

    def value(self, k: int, fractions: FloatArray) -> FloatArray:
        """Values at fractions of the step that piece k lies in, of the member that carries the largest force in this
        piece."""
        real = np.column_stack([np.full(len(fractions), float(self._step[k])), fractions])
        seen = self._driver.sample_response(self._j, real, True, self.count, who=int(self._member[k]), rates=False)[2]
        value: FloatArray = seen[:, 0]
        return value

    def place_before(self, b: int) -> FloatArray:
        """(2,) step and fraction at which the piece before piece b ends."""
        return np.array([float(self.leads[b - 1].step), self.leads[b - 1].high])

    def row_before(self, b: int) -> FloatArray:
        """A row of `extremes` there, of no value and no member."""
        step, fraction = self.place_before(b).tolist()
        return row_of(float(self.t[b]), 0.0, step, fraction, 0.0, 1.0, -1.0)

    def one_sided_limits(self, b: int) -> tuple[FloatArray, FloatArray]:
        """Value, rate and member (3,) at the end of the piece before piece b, and at the beginning of piece b."""
        before, behind = self.evaluate_at(np.array([[b - 1.0, 1.0], [b, 0.0]]), True)
        return before, behind

    def is_stated(self, b: int) -> bool:
        """Whether the time between piece b and the one before it is given by the case, or is an event's."""
        lead = self.leads[b]
        if lead.low > 0.0:
            return False
        driver = self._driver
        index = driver.room_ints[: 4 * (int(driver.limits[1]) + 1)].reshape(-1, 4)
        happened = int(index[lead.step, 3]) - int(index[lead.step - 1, 3])
        return happened > 0 or bool(np.any(driver.times == self.t[b]))

    def settle(self, row: FloatArray, k: int, c: float) -> None:
        """Set the place in a row of piece k: fraction c of its step, and the time."""
        lead = self.leads[k]
        row[STEP], row[FRACTION] = lead.step, c
        row[TIME] = self.t[k] + (c - lead.low) / (lead.high - lead.low) * (self.t[k + 1] - self.t[k])


def minima(driver: "GeneralDriver", j: int, t: FloatArray) -> FloatArray:
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
            if 0 < between < len(pieces.leads):
                _at_boundary(row, pieces, between, highest, pieces.is_stated(between))
        elif bent and row[VALUE] <= LOW * highest:
            _turned_round(row, pieces, k)
    return rows


def _at_boundary(row: FloatArray, pieces: Pieces, b: int, highest: float, stated: bool) -> None:
    """Complete a row at the boundary in front of piece b, where a value that falls may begin to rise.

    stated: whether the time is given, or an event's: then it varies as that does.
    """
    before, behind = pieces.one_sided_limits(b)
    row[VALUE] = (before if row[FRACTION] == pieces.leads[b - 1].high else behind)[0]
    (falls, first), (rises, second) = before[1:].tolist(), behind[1:].tolist()
    if not falls <= 0.0 <= rises or falls == rises:
        return
    if first == second:
        if falls < 0.0 < rises and row[VALUE] <= LANDED * highest:
            row[VALUE], row[OTHER] = 0.0, ZERO
    elif not stated:
        row[WHO], row[OTHER], row[SHARE] = first, second, -falls / (rises - falls)


def _turned_round(row: FloatArray, pieces: Pieces, k: int) -> None:
    """Complete a row inside piece k whose value is low: where exactly its square is lowest, and whether it is zero."""
    c = float(row[FRACTION])
    least = slope = 0.0
    for d in APART:
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
    if least <= NOUGHT**2 * slope:
        row[VALUE], row[OTHER] = 0.0, ZERO
    else:
        row[VALUE] = pieces.value(k, np.array([c]))[0]
    pieces.settle(row, k, c)
