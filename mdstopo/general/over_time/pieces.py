"""The steps of a motion, cut so that a response is smooth on every piece."""

from functools import cached_property

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.over_time.leading_members import is_led, pieces_by_member
from mdstopo.general.over_time.piece import Piece
from mdstopo.general.over_time.switch_changes import pieces_by_sides
from mdstopo.general.responses.extremes import FRACTION, STEP, TIME, row_of, sample
from mdstopo.general.responses.general_responses import switches_of
from mdstopo.general.steps.step_history import EVENTS
from mdstopo.scene.springs_model import FloatArray, IndexArray


class Pieces:
    """The steps of a motion, cut where another member carries the largest force, or a switch of an expression
    changes its side.

    On each, response j is smooth.

    t (P + 1,): their times. changes: those of them that are within steps. With `evaluate_at` pieces are evaluated as
    steps are.
    """

    def __init__(self, driver: DriverWithRun, j: int, t: FloatArray) -> None:
        self._driver, self._j, self.count = driver, j, len(t) - 1
        if is_led(driver, j):
            self._pieces = pieces_by_member(driver, j, t)
        elif switches_of(driver.scene.model, j):
            self._pieces = pieces_by_sides(driver, j, t)
        else:
            self._pieces = [Piece(w, 0.0, 1.0, -1) for w in range(self.count)]
        self._step = np.array([piece.step for piece in self._pieces])
        self._low = np.array([piece.low for piece in self._pieces])
        self._high = np.array([piece.high for piece in self._pieces])
        self._who = np.array([piece.who for piece in self._pieces])
        self.t: FloatArray = np.append(t[self._step] + self._low * (t[self._step + 1] - t[self._step]), t[-1])
        self.changes: list[float] = self.t[:-1][self._low > 0.0].tolist()

    def __len__(self) -> int:
        return len(self._pieces)

    def __getitem__(self, k: int) -> Piece:
        return self._pieces[k]

    @cached_property
    def samples(self) -> FloatArray:
        """Value, rate and member (P, SAMPLES, 3) in all pieces."""
        return sample(len(self), self.evaluate_at)

    def minima(self, window: float) -> FloatArray:
        """The minima that come near the lowest, as rows (K, COLUMNS) whose places are pieces and fractions of them."""
        return self.peaks(-1.0, window)

    def peaks(self, sign: float, window: float) -> FloatArray:
        """The peaks of sign times g that come near the highest, as `minima` has them."""
        pieces = np.column_stack([self._step, self._low, self._high, self._who]).astype(np.float64)
        return self._driver.peaks_of_pieces(self._j, self.count, self.t, self.samples, sign, window, pieces)

    def evaluate_at(self, places: FloatArray, exact: bool) -> FloatArray:
        """(K, 3) value, rate, member at places (K, 2): pieces and fractions of them."""
        k = places[:, 0].astype(np.int64)
        real = np.column_stack([self._step[k], self.fraction(k, places[:, 1])])
        out = np.empty((len(k), 3))
        for who in np.unique(self._who[k]).tolist():
            own = self._who[k] == who
            out[own] = self._driver.sample_response(self._j, real[own], exact, self.count, who=who)[2]
        return out

    def fraction(self, k: IndexArray, c: FloatArray) -> FloatArray:
        """The fractions of steps that are fractions c of pieces k."""
        low, high = self._low[k], self._high[k]
        return np.asarray(np.where(c >= 1.0, high, low + c * (high - low)))

    def value(self, k: int, fractions: FloatArray) -> FloatArray:
        """Values at fractions of the step that piece k lies in, as the response is formed in this piece."""
        real = np.column_stack([np.full(len(fractions), float(self._step[k])), fractions])
        seen = self._driver.sample_response(self._j, real, True, self.count, who=int(self._who[k]), rates=False)[2]
        value: FloatArray = seen[:, 0]
        return value

    def place_before(self, b: int) -> FloatArray:
        """(2,) step and fraction at which the piece before piece b ends."""
        return np.array([float(self[b - 1].step), self[b - 1].high])

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
        piece = self[b]
        if piece.low > 0.0:
            return False
        events = self._driver.index_of_steps()[:, EVENTS]
        happened = int(events[piece.step]) - int(events[piece.step - 1])
        return happened > 0 or bool(np.any(self._driver.times == self.t[b]))

    def settle(self, row: FloatArray, k: int, c: float) -> None:
        """Set the place in a row of piece k: fraction c of its step, and the time."""
        piece = self[k]
        row[STEP], row[FRACTION] = piece.step, c
        row[TIME] = self.t[k] + (c - piece.low) / (piece.high - piece.low) * (self.t[k + 1] - self.t[k])
