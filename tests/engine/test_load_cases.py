"""Load cases on threads of their own: the same to the bit as one after the other, and the same errors."""

from pathlib import Path

import numpy as np
import pytest

from mdstopo import engine
from mdstopo.case.reader import load_case
from mdstopo.compiler.threads import VARIABLE
from mdstopo.engine import Evaluator

CASE = Path(__file__).resolve().parents[2] / "cases" / "restraint.yaml"


@pytest.fixture
def together(monkeypatch):
    """An evaluator that takes a thread for each load case, and the calls that it has made side by side."""
    made = []

    def noted(calls, threads):
        made.append((len(calls), threads))
        return side_by_side(calls, threads)

    side_by_side = engine.side_by_side
    monkeypatch.setattr(engine, "side_by_side", noted)
    monkeypatch.setattr(engine, "WORTH_A_THREAD", 0.0)
    monkeypatch.setenv(VARIABLE, "2")
    return Evaluator(load_case(CASE)), made


def test_evaluations_are_the_same_to_the_bit_side_by_side(together, monkeypatch):
    evaluator, made = together
    monkeypatch.setenv(VARIABLE, "1")
    alone = Evaluator(evaluator.case)
    rng = np.random.default_rng(2)
    for gradient in (True, False):
        for design in rng.uniform(0.02, 0.3, (3, evaluator.case.n_design)):
            one, two = (each.evaluate(design, gradient) for each in (alone, evaluator))
            assert one.status.ok
            assert (two.status, two.objectives, two.work) == (one.status, one.objectives, one.work)
            np.testing.assert_array_equal(two.constraints, one.constraints)
            for name, slopes in one.gradients.items():
                np.testing.assert_array_equal(two.gradients[name], slopes)
            np.testing.assert_array_equal(two.constraint_gradients, one.constraint_gradients)
    # the first of each kind may have to compile
    assert made == [(2, 2)] * 4


def test_the_first_load_case_that_fails_is_told(together, monkeypatch):
    evaluator, made = together
    start = evaluator.case.start
    evaluator.evaluate(start)

    def fail(name):
        def evaluate(*_given):
            raise ValueError(name)

        return evaluate

    for name in ("down", "forward"):
        monkeypatch.setattr(evaluator.driver(name), "evaluate", fail(name))
        with pytest.raises(ValueError, match=name):
            evaluator.evaluate(start)
    assert len(made) == 2


def test_short_load_cases_and_springs_take_no_threads(together, monkeypatch):
    evaluator, made = together
    monkeypatch.setattr(engine, "WORTH_A_THREAD", 1e3)
    for _ in range(2):
        assert evaluator.evaluate(evaluator.case.start).status.ok
    springs = Evaluator(load_case(CASE.with_name("fig6.yaml")))
    assert springs.threads == 1
    assert made == []
