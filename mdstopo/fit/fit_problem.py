"""The fit as a problem of least squares: estimates x, residuals, their exact derivatives.

r_k = (g(t_k - delay; numbers) + offset - y_k) / deviation_k
"""

import copy
import itertools
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.model import Case
from mdstopo.case.objects.fitting import Estimate
from mdstopo.case.sections.measurements import Measured, read_measured
from mdstopo.fit.numbers import EXACT, Numbers
from mdstopo.fit.predictions import Predictions


class FitProblem:
    """Estimates x: the numbers of the case, then offsets and delays that are not known. Raises CaseError.

    names, derivatives: of each estimate; lower, upper, initial (p,).
    """

    def __init__(self, case: Case, measured: Sequence[Measured] | None = None) -> None:
        assert case.fit is not None
        self.case = case
        self.fit = case.fit
        self.measured = list(read_measured(case) if measured is None else measured)
        self.numbers = Numbers(case, case.fit.numbers)
        self.predictions = Predictions(case, self.measured, self.numbers)
        shifts: list[tuple[str, Estimate]] = []
        #: of each series, where among the estimates its offset and its delay are; -1: known
        self.offsets: list[int] = []
        self.delays: list[int] = []
        for each in case.fit.series:
            for places, name, shift in ((self.offsets, "offset", each.offset), (self.delays, "delay", each.delay)):
                places.append(len(self.numbers.keys) + len(shifts) if shift.is_free else -1)
                if shift.is_free:
                    shifts.append((f"{name} of {each.name}", shift))
        self.names = (*self.numbers.keys, *(name for name, _ in shifts))
        self.derivatives = (*self.numbers.derivatives, *(EXACT for _ in shifts))
        self.lower = np.concatenate([self.numbers.lower, [each.lower for _, each in shifts]])
        self.upper = np.concatenate([self.numbers.upper, [each.upper for _, each in shifts]])
        self.initial = np.concatenate([self.numbers.initial, [each.initial for _, each in shifts]])
        #: where the last misfit was, and the rates of what was predicted there
        self._at: FloatArray | None = None
        self._rates: list[FloatArray] = []

    def with_values(self, values: Sequence[FloatArray]) -> "FitProblem":
        """The same fit of other measured values (n,) of each series; what is compiled and known of the scene is
        shared."""
        other = copy.copy(self)
        other.measured = [each._replace(y=y) for each, y in zip(self.measured, values, strict=True)]
        return other

    @cached_property
    def parts(self) -> list[slice]:
        """The slice of the residuals that each series has."""
        ends = np.cumsum([0, *(len(each.t) for each in self.measured)]).tolist()
        return [slice(first, last) for first, last in itertools.pairwise(ends)]

    @property
    def count(self) -> int:
        """How many values were measured."""
        return sum(len(each.t) for each in self.measured)

    @property
    def simulations(self) -> int:
        """How many motions have been computed so far."""
        return self.predictions.simulations

    def misfit(self, x: FloatArray) -> tuple[str, FloatArray]:
        """Why there is none, or (n,) what is predicted less what was measured, in the units of the responses."""
        predicted = self.predictions.predict(x[: len(self.numbers.keys)], self._delays(x))
        if predicted.trouble:
            return predicted.trouble, np.full(self.count, np.inf)
        self._rates, self._at = predicted.rates, x.copy()
        pieces = [
            value + self._shift(x, s, self.offsets, self.fit.series[s].offset) - each.y
            for s, (value, each) in enumerate(zip(predicted.values, self.measured, strict=True))
        ]
        return "", np.concatenate(pieces)

    def slopes(self, x: FloatArray) -> FloatArray:
        """(n, p): the derivatives of `misfit` at x. MotionError where a motion beside it cannot be computed."""
        if self._at is None or not np.array_equal(self._at, x):
            self.misfit(x)
        out = np.zeros((self.count, len(x)))
        numbers = len(self.numbers.keys)
        by_numbers = self.predictions.slopes(x[:numbers], self._delays(x))
        for s, part in enumerate(self.parts):
            out[part, :numbers] = by_numbers[s]
            if self.offsets[s] >= 0:
                out[part, self.offsets[s]] = 1.0
            if self.delays[s] >= 0:
                out[part, self.delays[s]] = -self._rates[s]
        return out

    def root_mean_squares(self, misfit: FloatArray) -> FloatArray:
        """(S,) the root mean square of a misfit (n,) in each series, in the unit of its response."""
        return np.array([float(np.sqrt(np.mean(misfit[part] ** 2))) for part in self.parts])

    def predicted(self, x: FloatArray) -> list[FloatArray]:
        """Of each series, what should have been measured."""
        _, misfit = self.misfit(x)
        return [misfit[part] + each.y for part, each in zip(self.parts, self.measured, strict=True)]

    def _delays(self, x: FloatArray) -> FloatArray:
        return np.array([self._shift(x, s, self.delays, each.delay) for s, each in enumerate(self.fit.series)])

    @staticmethod
    def _shift(x: FloatArray, s: int, places: Sequence[int], stated: Estimate) -> float:
        return float(x[places[s]]) if places[s] >= 0 else stated.initial
