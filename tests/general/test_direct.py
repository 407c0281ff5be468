"""Sensitivities carried forward: the map of a step, and many rows in one sweep."""

from dataclasses import replace

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

from .support import design_of, load
from .test_against_springs import CASE as TWO_BODIES

#: the scene on which the two families of kernels check each other, with two objectives
CASE = TWO_BODIES.replace("design: false", "design: TIES").replace(
    "objectives: {G: {response: energy, over_time: max}}",
    "objectives: {G: {response: energy, over_time: max}, M: {response: energy, over_time: mean}}\n"
    "combine: {weights: {G: 1, M: 1}}",
)
#: what is pushed through a step: forces on the one pair with design members (3, fewer than 6 freedoms), or on bodies
UNITS = {"of pairs": "false", "of bodies": "true"}


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize("units", UNITS)
def test_general_kernels_have_the_gradients_of_those_of_springs(units, integrator):
    case = read_case(CASE.replace("TIES", UNITS[units]), overrides={"solver.integrator": integrator})
    if integrator == "generalized_alpha":
        case = replace(case, solver=replace(case.solver, step=0.005))
    else:
        case = replace(case, solver=replace(case.solver, tolerance=1e-11))
    springs, general = (Evaluator(case, beyond=beyond) for beyond in ("", "a comparison"))
    own, found = springs.evaluate(case.initial), general.evaluate(case.initial, sensitivity="direct")
    assert springs.beyond == ""
    peak = general.with_objectives(["G"]).evaluate(case.initial, sensitivity="direct")
    assert peak.work["design_states"] > peak.work["steps"]  # those of every step, not of the peak alone
    adjoint = general.evaluate(case.initial)
    for name, gradient in own.gradients.items():
        size = np.abs(gradient).max()
        assert found.objectives[name] == pytest.approx(own.objectives[name], rel=1e-9)
        assert np.abs(found.gradients[name] - gradient).max() <= 1e-8 * size, name
        assert np.abs(found.gradients[name] - adjoint.gradients[name]).max() <= 1e-12 * size, name


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_rows_that_are_carried_together_have_the_gradients_of_each_alone(integrator):
    step = {"step": 0.005} if integrator == "generalized_alpha" else {}
    case = load("loaded_pendulum", integrator=integrator, **step)
    alpha = design_of(case)
    together = mdstopo.evaluate(case, alpha, method="direct")
    assert len(together.gradients) > 3
    whole = Evaluator(case)
    for name, gradient in together.gradients.items():
        alone = whole.with_objectives([name]).evaluate(alpha, sensitivity="direct")
        assert np.abs(alone.gradients[name] - gradient).max() <= 1e-11 * np.abs(gradient).max(), name
