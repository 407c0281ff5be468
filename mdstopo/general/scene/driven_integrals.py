"""Prescribed motions whose rate or acceleration is a formula of time: what they have come to at the ends of segments.

Kernels integrate the formula from the start of a segment by a quadrature of 16 points (`kinematics.timed`). So segments
end where it needs them to, beside its kinks and jumps.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import Case, LoadCase
from mdstopo.case.scene.prescribed import KINDS
from mdstopo.case.text.errors import CaseError
from mdstopo.compiler.formulas import FormulaCalls
from mdstopo.formula.time_formulas import VALUE
from mdstopo.general.scene.timed_loads import mistake_of, modes, row_of_formula
from mdstopo.mechanics.kinematics.timed import (
    ACCELERATION,
    ADDRESS,
    COORDINATE,
    DERIVED,
    NODES,
    OFFSET,
    RATE,
    SCALE,
    WEIGHTS,
)
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: which derivative of a coordinate is prescribed
DERIVATIVES = dict(zip(KINDS, (ACCELERATION, RATE, COORDINATE), strict=True))
#: by how much an integral over a segment may differ from that of both halves, relative to the largest so far
CONVERGED = 4e-15
#: cuts for one formula at most
MOST_CUTS = 1000


class Integrals(NamedTuple):
    """Integrals of a formula f over a time h: of f, and of f times the time that is left until the end."""

    once: float
    twice: float

    def and_then(self, other: Integrals, length: float) -> Integrals:
        """The integrals over this stretch of time and the one behind it, which lasts `length` (s)."""
        return Integrals(self.once + other.once, self.twice + length * self.once + other.twice)

    def or_larger(self, other: Integrals) -> Integrals:
        """The larger of each integral and another one's by its magnitude."""
        return Integrals(max(self.once, abs(other.once)), max(self.twice, abs(other.twice)))


class CalledFormula:
    """A formula of time, called from Python, and its integrals. row (WIDTH,): as of `GeneralModel.driven_par`."""

    def __init__(self, row: FloatArray) -> None:
        self.row = row
        self._calls = FormulaCalls(row[ADDRESS], row)

    def at(self, time: float, mode: int) -> tuple[float, float]:
        """Value and rate at a time (s); mode: bits of its switches."""
        value, rate, *_ = self._calls.numbers(0.0, 0.0, time, 0.0, mode, VALUE)
        return self.row[SCALE] * value + self.row[OFFSET], self.row[SCALE] * rate

    def over(self, start: float, length: float, mode: int) -> Integrals:
        """The integrals over the time `length` from `start` on (s); mode: bits of its switches."""
        once = twice = 0.0
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            value, _ = self.at(start + node * length, mode)
            once += weight * value
            twice += weight * (1.0 - node) * value
        return Integrals(length * once, length * length * twice)


def row_of_motion(formula: TimeFormula, kind: str) -> FloatArray:
    """(WIDTH,) the numbers of a formula that prescribes a coordinate, its velocity or its acceleration."""
    row = row_of_formula(formula)
    row[DERIVED] = float(DERIVATIVES[kind])
    return row


def integrated_ends(row: FloatArray, sides: IndexArray, times: FloatArray, position: float, rate: float) -> FloatArray:
    """(n_seg, 2, 2): the coordinate and its rate at both ends of segments, on their side.

    row (WIDTH,): of a formula of its rate or its acceleration.
    sides (n_seg,): bits of the formula's switches.
    times (n_seg + 1,): ends of the segments (s).
    position, rate: at the start, the rate of an acceleration.
    """
    formula = CalledFormula(row)
    out = np.empty((len(times) - 1, 2, 2))
    for k, mode in enumerate(sides.tolist()):
        start, end = float(times[k]), float(times[k + 1])
        found = formula.over(start, end - start, mode)
        if row[DERIVED] == RATE:
            out[k] = (position, formula.at(start, mode)[0]), (position + found.once, formula.at(end, mode)[0])
        else:
            out[k] = (position, rate), (position + (end - start) * rate + found.twice, rate + found.once)
        position, rate = out[k, 1]
    return out


def integration_times(case: Case, load_case: LoadCase, kinks: list[float]) -> list[float]:
    """Times at which segments have to end, beside kinks, for integrals of formulas to be right to rounding.

    Raises CaseError where a formula changes too fast.
    """
    found: list[float] = []
    inside = [time for time in kinks if load_case.start < time < load_case.end]
    ends = np.array([load_case.start, *sorted(inside), load_case.end])
    for formula in _of_motions(load_case):
        cuts = _cuts(CalledFormula(row_of_formula(formula)), ends, modes(formula, ends))
        if len(cuts) > MOST_CUTS:
            message = (
                f"the expression {formula.text} changes too fast at t = {cuts[-1]:.6g} s to be integrated: {MOST_CUTS} "
                "pieces of time are not enough"
            )
            raise CaseError([mistake_of(case, load_case, "motions", message)], str(case.path or case.name))
        found += cuts
    return found


def _cuts(formula: CalledFormula, ends: FloatArray, sides: IndexArray) -> list[float]:
    """Where segments have to be cut for the integrals of a formula over the pieces; one more than MOST_CUTS: too often.

    ends (n_seg + 1,): of segments (s); sides (n_seg,): bits of the formula's switches in them.
    """
    cuts: list[float] = []
    largest = Integrals(0.0, 0.0)
    for start, end, mode in zip(ends[:-1].tolist(), ends[1:].tolist(), sides.tolist(), strict=True):
        whole = formula.over(start, end - start, mode)
        largest = largest.or_larger(whole)
        # the longest pieces first: what a pulse comes to is known before its tails are cut for nothing
        waiting = deque([(start, end, whole)])
        while waiting:
            low, high, whole = waiting.popleft()
            middle = 0.5 * (low + high)
            first, last = formula.over(low, middle - low, mode), formula.over(middle, high - middle, mode)
            largest = largest.or_larger(first).or_larger(last)
            if _are_alike(whole, first.and_then(last, high - middle), largest) or not low < middle < high:
                continue
            cuts.append(middle)
            if len(cuts) > MOST_CUTS:
                return cuts
            waiting += [(low, middle, first), (middle, high, last)]
    return cuts


def _are_alike(whole: Integrals, halves: Integrals, largest: Integrals) -> bool:
    """Whether integrals over a stretch of time are those over its halves; largest: what rounding is relative to."""
    pairs = zip(whole, halves, largest, strict=True)
    return all(abs(a - b) <= CONVERGED * max(most, abs(b)) for a, b, most in pairs)


def _of_motions(load_case: LoadCase) -> Iterator[TimeFormula]:
    """Formulas of velocities and accelerations."""
    for motion in load_case.motions:
        parts = [motion.x, motion.y, motion.z, motion.angle, *(motion.rotation.angles if motion.rotation else ())]
        for part in parts:
            if part is not None and part.kind != "position" and isinstance(part.signal, TimeFormula):
                yield part.signal
