"""Responses at the times of the measurements, and their derivatives by the numbers that are fitted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, cast

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.model import Case
from mdstopo.case.sections.measurements import Measured
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.fit.numbers import DIFFERENCES, SHIFT_OF_MOTIONS, Numbers
from mdstopo.general.driver.general_driver import GeneralDriver
from mdstopo.general.driver.observed import Observed, observe, slopes
from mdstopo.general.model.general_model import GeneralModel
from mdstopo.status import Status

#: tolerance of motions that are differenced, relative to that of the case, and at most
TIGHTER, TIGHT = 1e-2, 1e-10
LEAST_TOLERANCE = 1e-12
#: by how much arrays may deviate from a linear function of the numbers, relative
STRAIGHT = 1e-11
#: the arrays by which the equations of motion are differentiated
EQUATION_ARRAYS = ("mass", "force", "load_force", "load_arm", "v0")

#: the arrays of all load cases with a larger and with a smaller number, and by how much the numbers differ
Pair = tuple[dict[str, GeneralModel], dict[str, GeneralModel], float]


@dataclass(frozen=True)
class Predicted:
    """What is predicted for all series; trouble: why it is not, or empty.

    values: of each series (n,), in its order; rates: their derivatives by time.
    """

    trouble: str
    values: list[FloatArray]
    rates: list[FloatArray]


class _Last(NamedTuple):
    """The last prediction: where it was, with which evaluator, and what was observed."""

    x: FloatArray
    delays: FloatArray
    evaluator: Evaluator
    seen: dict[str, Observed]


class Predictions:
    """The scene of a case at any values of its fitted numbers.

    simulations: how many motions have been computed, one for each load case.
    """

    def __init__(self, case: Case, measured: Sequence[Measured], numbers: Numbers) -> None:
        self.case = case
        self.numbers = numbers
        self.simulations = 0
        self._measured = measured
        #: load case -> its series, in the order of its responses
        self._by_load_case: dict[str, list[int]] = {}
        for number, each in enumerate(measured):
            self._by_load_case.setdefault(each.series.load_case, []).append(number)
        #: scenes by which the balance is differentiated wherever it is; none where that depends on where
        self._anywhere: list[Pair] | None = None
        self._delayed = any(each.series.delay.is_free for each in measured)
        #: the evaluator that serves all x where numbers change parameters of laws alone, else that of the last x
        self._kept: tuple[bytes, Evaluator] | None = None
        self._last: _Last | None = None

    def predict(self, x: FloatArray, delays: FloatArray) -> Predicted:
        """All series at numbers x (n,) and delays (S,)."""
        try:
            evaluator = self._evaluator(x)
            predicted, seen = self._observed(evaluator, x, delays, self._delayed)
        except CaseError as error:  # joints that do not fit at the start, for instance
            return Predicted(str(error), [], [])
        self._last = _Last(x.copy(), delays.copy(), evaluator, seen) if not predicted.trouble else None
        return predicted

    def slopes(self, x: FloatArray, delays: FloatArray) -> list[FloatArray]:
        """Of each series its derivatives (n, numbers) at x (n,) and delays (S,)."""
        if not self._is_last(x, delays):
            predicted = self.predict(x, delays)
            assert not predicted.trouble, predicted.trouble
        assert self._last is not None
        evaluator, seen = self._last.evaluator, self._last.seen
        count = len(self.numbers.keys)
        out = [np.zeros((len(each.t), count)) for each in self._measured]
        exact = [i for i in range(count) if self.numbers.derivatives[i] != DIFFERENCES]
        if exact:
            self._exact(x, delays, evaluator, seen, exact, out)
        for i in set(range(count)) - set(exact):
            columns = self._differences(i, x, delays)
            for own, column in zip(out, columns, strict=True):
                own[:, i] = column
        return out

    # -- how

    def _is_last(self, x: FloatArray, delays: FloatArray) -> bool:
        last = self._last
        return last is not None and np.array_equal(last.x, x) and np.array_equal(last.delays, delays)

    def _evaluator(self, x: FloatArray) -> Evaluator:
        key = b"" if self.numbers.laws_alone else x.tobytes()
        if self._kept is None or self._kept[0] != key:
            at = self.numbers.initial if self.numbers.laws_alone else x
            there = self.numbers.case_at(at)
            solver = replace(there.solver, integrator=self._integrator)
            self._kept = key, Evaluator(replace(there, solver=solver), in_background=False)
        return self._kept[1]

    @cached_property
    def _integrator(self) -> str:
        """The integrator that suits the numbers as stated, for all x. If `auto` chose anew for each x, motions of two
        integrators could be differenced."""
        try:
            return Evaluator(self.numbers.case_at(self.numbers.initial), in_background=False).integrator
        except CaseError:  # the first motion says why
            return self.case.solver.integrator

    def _times(self, load_case: str, delays: FloatArray) -> tuple[FloatArray, list[IndexArray]]:
        """Times (K,) of all measurements of one load case, and the places of each series' times among them."""
        window = self.case.load_case(load_case)
        own = [
            np.clip(self._measured[s].t - delays[s], window.start, window.end) for s in self._by_load_case[load_case]
        ]
        times = np.unique(np.concatenate(own))
        return times, [np.searchsorted(times, each) for each in own]

    def _observed(
        self, evaluator: Evaluator, x: FloatArray, delays: FloatArray, rates: bool
    ) -> tuple[Predicted, dict[str, Observed]]:
        values: list[FloatArray] = [np.zeros(0) for _ in self._measured]
        speeds: list[FloatArray] = [np.zeros(0) for _ in self._measured]
        seen: dict[str, Observed] = {}
        design = self._design(evaluator, x)
        for name, members in self._by_load_case.items():
            times, places = self._times(name, delays)
            self.simulations += 1
            driver = _driver(evaluator, name)
            found = seen[name] = observe(driver, design, times, rates)
            if trouble := _trouble(driver, found):
                return Predicted(f"load case {name}: {trouble}", [], []), {}
            for j, (series, place) in enumerate(zip(members, places, strict=True)):
                values[series], speeds[series] = found.values[j, place], found.rates[j, place]
        return Predicted("", values, speeds), seen

    def _design(self, evaluator: Evaluator, x: FloatArray) -> FloatArray:
        """The whole design of an evaluator: alpha, then the parameters of laws at x."""
        design = evaluator.case.start.copy()
        if self.numbers.places and self.numbers.laws_alone:
            design[evaluator.case.n_design :] = self.numbers.values_at(x)
        return design

    def _exact(
        self,
        x: FloatArray,
        delays: FloatArray,
        evaluator: Evaluator,
        seen: dict[str, Observed],
        exact: list[int],
        out: list[FloatArray],
    ) -> None:
        """Fill the columns of numbers that are differentiated exactly.

        x (n,), delays (S,): where.
        evaluator, seen: of the last prediction, which was there.
        exact: the numbers that are meant.
        out: of each series (n, numbers).
        """
        chain = self.numbers.chain(x)
        balanced = [i for i in exact if self.numbers.effects[i] == "balance"]
        shifted = self._pairs(balanced, x) if balanced else []
        for name, members in self._by_load_case.items():
            _, places = self._times(name, delays)
            pairs = [(one[name], other[name], apart) for one, other, apart in shifted]
            found = slopes(_driver(evaluator, name), seen[name], pairs)
            by_laws = found[..., : chain.shape[0]] @ chain
            for j, (series, place) in enumerate(zip(members, places, strict=True)):
                out[series][:, exact] = by_laws[j, place][:, exact]
                for b, i in enumerate(balanced):
                    out[series][:, i] += found[j, place, chain.shape[0] + b]

    def _pair(self, i: int, x: FloatArray) -> Pair:
        """The scenes of all load cases with number i larger and smaller than at x, and by how much they differ."""
        one, other, apart = self.numbers.shifted(i, x)
        return _models(one), _models(other), apart

    def _pairs(self, balanced: list[int], x: FloatArray) -> list[Pair]:
        """The scenes with each of some numbers larger and smaller, about x.

        About the middle of the bounds where masses, loads and velocities are linear functions of the numbers: slopes
        are the same everywhere then.
        """
        if self._anywhere is None:
            middle = 0.5 * (self.numbers.lower + self.numbers.upper)
            pairs = [self._pair(i, middle) for i in balanced]
            self._anywhere = pairs if self._is_straight(balanced, middle, pairs) else []
        return self._anywhere or [self._pair(i, x) for i in balanced]

    def _is_straight(self, balanced: list[int], middle: FloatArray, pairs: list[Pair]) -> bool:
        """Whether masses, loads and velocities are linear functions of all numbers between their bounds."""
        base = _models(self.numbers.case_at(middle))
        random = np.random.default_rng(0)
        for _ in range(3):
            x = random.uniform(self.numbers.lower, self.numbers.upper)
            try:
                found = _models(self.numbers.case_at(x))
            except CaseError:  # not all that is between the bounds goes together
                return False
            for name, key in product(base, EQUATION_ARRAYS):
                expected = getattr(base[name], key).copy()
                for (one, other, apart), i in zip(pairs, balanced, strict=True):
                    change = getattr(one[name], key) - getattr(other[name], key)
                    expected += change / apart * (x[i] - middle[i])
                size = 1.0 + np.abs(expected).max(initial=0.0)
                if np.abs(expected - getattr(found[name], key)).max(initial=0.0) > STRAIGHT * size:
                    return False
        return True

    def _differences(self, i: int, x: FloatArray, delays: FloatArray) -> list[FloatArray]:
        """Of each series its derivative (n,) by number i, by differences of motions of a smaller tolerance."""
        tolerance = max(min(self.case.solver.tolerance * TIGHTER, TIGHT), LEAST_TOLERANCE)

        def at(moved: FloatArray) -> FloatArray:
            case = self.numbers.case_at(moved)
            tight = replace(case, solver=replace(case.solver, tolerance=tolerance))
            predicted, _ = self._observed(Evaluator(tight, in_background=False), moved, delays, False)
            if predicted.trouble:
                raise MotionError(f"{self.numbers.keys[i]} beside {x[i]:.10g}: {predicted.trouble}")
            return np.concatenate(predicted.values)

        column = self.numbers.slope(i, x, at, SHIFT_OF_MOTIONS)
        return list(np.split(column, np.cumsum([len(each.t) for each in self._measured])[:-1]))


class MotionError(Exception):
    """A motion that is needed cannot be computed."""


def _models(case: Case) -> dict[str, GeneralModel]:
    """The arrays of each load case."""
    return {name: cast(GeneralModel, each.model) for name, each in Evaluator(case, in_background=False).scenes.items()}


def _trouble(driver: GeneralDriver, found: Observed) -> str:
    """Why what was observed last cannot be trusted, or nothing."""
    if not found.status.ok:
        return f"{found.status.value}: {found.message}"
    meeting = driver.met(found.count)
    if meeting >= 0:
        return f"{Status.ZERO_LENGTH.value}: {driver.member(meeting)}"
    jump = driver.rotation_jump(found.count)
    return f"{Status.ROTATION_JUMP.value}: {jump}" if jump else ""


def _driver(evaluator: Evaluator, load_case: str) -> GeneralDriver:
    driver = evaluator.driver(load_case)
    assert isinstance(driver, GeneralDriver)
    return driver
