"""Edges of a case: no slope at zero, table rows that differ by rounding, methods without their integrator."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.scene.signal_segments import breakpoints
from mdstopo.status import Status

SCENE = """
format: 1
time: {{end: 0.5}}
bodies: {{mass: {{mass: 2, inertia: 1, position: [0, 1]}}}}
members:
  left: {{from: {{body: ground, at: [-1, 0]}}, to: {{body: mass, at: [0, 1]}}, law: {{type: spring, stiffness: 50}}}}
  right: {{from: {{body: ground, at: [1, 0]}}, to: {{body: mass, at: [0, 1]}}, law: {{type: spring, stiffness: 50}}}}
loads:
  - {{body: mass, force: {{table: [[0, 1, 0], [0.3, 2, 0], [0.5, 0, 0]]}}}}
  - {{body: mass, moment: {{table: [[0, 0], [{second}, 1], [0.5, 0]]}}}}
design: {{power: {power}}}
objectives: {{G: {{response: energy}}}}
"""


def test_no_slope_at_zero_is_said_and_the_value_kept():
    case = read_case(SCENE.format(second=0.3, power=0.5))
    found = mdstopo.evaluate(case, [0.0, 0.5])
    assert found.status is Status.NO_GRADIENT
    assert "left" in found.message
    assert not found.gradients
    assert found.objectives["G"] == mdstopo.evaluate(case, [0.0, 0.5], gradient=False).objectives["G"] > 0.0
    assert mdstopo.evaluate(case, [0.1, 0.5]).status is Status.OK


@pytest.mark.parametrize("second", ["0.30000000000000004", "0.29999999999999993"])
def test_table_rows_that_differ_by_rounding_are_one_kink(second):
    case, same = (read_case(SCENE.format(second=row, power=1)) for row in (second, "0.3"))
    assert len(breakpoints(case.load_cases[0])) == 3
    found, expected = mdstopo.evaluate(case), mdstopo.evaluate(same)
    assert found.status is Status.OK
    assert found.objectives["G"] == pytest.approx(expected.objectives["G"], rel=1e-12)


def test_the_iterative_method_finds_its_integrator():
    case = read_case(SCENE.format(second=0.3, power=1), overrides={"solver.tolerance": 1e-6})
    exact, iterated = mdstopo.evaluate(case), mdstopo.evaluate(case, method="iterative")
    scale = np.abs(exact.gradients["G"]).max()
    assert np.abs(iterated.gradients["G"] - exact.gradients["G"]).max() <= 1e-5 * scale
