"""How many peaks an evaluation of the optimiser is asked for: as many as are near the largest."""

from types import SimpleNamespace

import numpy as np
import pytest

from mdstopo.design_problem import GROWTH, MOST_ROWS, PEAKS_OF_RESPONSE, DesignProblem
from mdstopo.evaluation import Rows
from mdstopo.status import Status

FEW = PEAKS_OF_RESPONSE[1]


class Peaks:
    """An evaluator of one response with so many peaks near the largest as the design says, and 500 far below."""

    def __init__(self):
        self.asked = []

    def evaluate(self, design, gradient, rows):
        self.asked.append(rows.most)
        values = [*np.linspace(1.0, 0.95, int(design[0])), *np.linspace(0.8, 0.7, 500)][: rows.most]
        peaks = tuple(SimpleNamespace(value=value) for value in values)
        return SimpleNamespace(all_compete=False, status=Status.OK, peaks={"G": peaks}, constraint_peaks={})


def problem():
    made = DesignProblem.__new__(DesignProblem)
    made.rows, made._enough, made.initial = Rows(*PEAKS_OF_RESPONSE), None, np.zeros(3)
    made._evaluator = Peaks()
    return made


def told(one, near):
    return len(one._with_all_that_compete(np.array([float(near)]), True).peaks["G"])


def test_a_design_whose_peaks_tie_is_asked_for_more_until_one_is_not_near() -> None:
    one = problem()
    assert told(one, 30) == FEW * GROWTH
    assert one._evaluator.asked == [FEW, FEW * GROWTH]


def test_the_next_design_is_asked_at_once_for_what_the_last_one_needed() -> None:
    one = problem()
    for _ in range(3):
        told(one, 30)
    assert one._evaluator.asked == [FEW, *[FEW * GROWTH] * 3]


@pytest.mark.parametrize("near", [1, FEW - 1, FEW, 30, FEW * GROWTH, 150, 700, 10**4])
@pytest.mark.parametrize("before", [2, 30, 150, 700])
def test_what_is_told_does_not_depend_on_designs_before(near, before) -> None:
    fresh, later = problem(), problem()
    told(later, before)
    assert told(later, near) == told(fresh, near) <= MOST_ROWS
    assert later._enough == fresh._enough


def test_values_without_gradients_ask_for_no_more_than_usual() -> None:
    one = problem()
    told(one, 30)
    one._with_all_that_compete(np.array([30.0]), False)
    assert one._evaluator.asked[-1] == FEW
