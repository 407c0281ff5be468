"""Rows of one response with their gradients in one call, against the calls that find them one after the other."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.general.driver.general_driver import GeneralDriver

CASE = """
format: 1
gravity: [0, -9.8]
time: {end: END}
bodies: {rod: {mass: 1, inertia: 0.1, position: [0.5, 0]}}
joints:
  - {type: revolute, bodies: [ground, rod], at: [0, 0]}
members:
  spring: {from: {body: ground, at: [1, 1]}, to: {body: rod, at: [1, 0]}, law: {type: spring, stiffness: 50}}
  stay: {from: {body: ground, at: [0, 1]}, to: {body: rod, at: [0.5, 0]}, law: {type: spring, stiffness: 30}}
objectives:
  speed: {response: {velocity: {body: rod, component: y}}, over_time: max_abs}
"""


@pytest.mark.parametrize(
    ("reduction", "end", "least"),
    [("max", "0.1", 1), ("max", "6", 3), ("max_abs", "0.1", 1), ("max_abs", "6", 3), ("final", "6", 1)],
)
def test_they_are_the_same_to_the_bit(monkeypatch: pytest.MonkeyPatch, reduction: str, end: str, least: int) -> None:
    case = read_case(CASE.replace("END", end).replace("max_abs", reduction))
    together = Evaluator(case).evaluate(case.start)
    monkeypatch.setattr(GeneralDriver, "_plain_rows", False)
    apart = Evaluator(case).evaluate(case.start)
    assert together.work == apart.work
    assert len(together.peaks["speed"]) >= least
    assert len(together.peaks["speed"]) == len(apart.peaks["speed"])
    for one, other in zip(together.peaks["speed"], apart.peaks["speed"], strict=True):
        assert one[:2] == other[:2]
        assert one.gradient is not None
        assert other.gradient is not None
        assert np.array_equal(one.gradient, other.gradient)
