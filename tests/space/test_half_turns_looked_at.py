"""Rotations that are looked at beyond half a turn, where their vector jumps; and what memory holds of long motions."""

from math import pi

import numpy as np
import pytest

import mdstopo
from mdstopo.status import Status

from .support import CASES, load


def spun(over_time, component="z", **response):
    """The body on springs of these tests, spun about z by more than half a turn."""
    keys = {"body": "hull", "component": component, **response}
    overrides = {
        "bodies.hull.angular_velocity": [0, 0, 30],
        "objectives": {"turn": {"response": {"rotation": keys}, "over_time": over_time}},
        "solver.integrator": "runge_kutta",
    }
    return mdstopo.load_case(CASES / "springs.yaml", overrides=overrides)


@pytest.mark.parametrize("component", ["z", "norm"])
@pytest.mark.parametrize("over_time", ["max", "mean"])
def test_a_rotation_that_jumps_on_the_way_is_refused_by_name(over_time, component) -> None:
    found = mdstopo.evaluate(spun(over_time, component))
    assert found.status is Status.ROTATION_JUMP
    assert found.message.startswith("rotation of hull, at t = 0.1")
    assert "final" in found.message


def test_a_rotation_at_the_end_and_the_motion_itself_go_on_beyond_half_a_turn() -> None:
    case = spun("final", "norm")
    found = mdstopo.evaluate(case, method="direct")
    assert found.status is Status.OK
    motion = mdstopo.simulate(case)
    w = motion.at(np.linspace(motion.t[0], motion.t[-1], 401)).q[:, 3:7]
    turned = 2.0 * np.arccos(np.clip(np.abs(w @ w[0]), 0.0, 1.0))
    assert turned.max() > 0.99 * pi
    assert found.objectives["turn"] == pytest.approx(turned[-1], abs=1e-7)
    step = 1e-4
    sides = [mdstopo.evaluate(case, case.initial + sign * step, gradient=False) for sign in (1.0, -1.0)]
    slope = (sides[0].objectives["turn"] - sides[1].objectives["turn"]) / (2.0 * step)
    assert found.gradients["turn"].sum() == pytest.approx(slope, rel=1e-6)


def test_what_fills_the_memory_is_told_with_what_helps(monkeypatch) -> None:
    monkeypatch.setattr("mdstopo.case.memory.most_floats", lambda: 0)
    case = mdstopo.load_case(CASES / "springs.yaml", overrides={"time.end": 20})
    found = mdstopo.evaluate(case, gradient=False)
    assert found.status is Status.STEP_LIMIT
    assert "GB that one run may take" in found.message
    assert "time.end" in found.message


def test_room_grows_as_far_as_memory_goes(monkeypatch) -> None:
    """Not by doubling alone, which leaves up to half of what is allowed unused."""
    from mdstopo.evaluators import evaluator_of

    driver = evaluator_of(load("springs")).driver("default")
    before = len(driver.room)
    monkeypatch.setattr("mdstopo.case.memory.most_floats", lambda: int(1.5 * before))
    assert driver._grow(True)
    assert 1.4 * before < len(driver.room) <= 1.5 * before
    assert not driver._grow(True)


def test_a_motion_without_gradients_needs_no_room_for_what_only_these_need(monkeypatch) -> None:
    from mdstopo.engine import Evaluator

    case = mdstopo.load_case(CASES / "springs.yaml", overrides={"time.end": 20, "solver.integrator": "runge_kutta"})
    ample = Evaluator(case).evaluate(case.initial)
    evaluator = Evaluator(case)
    driver = evaluator.driver("default")
    most = 10 * len(driver.room)
    monkeypatch.setattr("mdstopo.case.memory.most_floats", lambda: most)
    monkeypatch.setattr("mdstopo.general.driver.general_driver.LARGE_HISTORY", 0)
    assert evaluator.evaluate(case.initial).status is Status.STEP_LIMIT
    alone = evaluator.evaluate(case.initial, gradient=False)
    assert alone.objectives == ample.objectives
    assert len(driver.room) <= most
    assert evaluator.evaluate(case.initial).status is Status.STEP_LIMIT
    monkeypatch.undo()
    again = evaluator.evaluate(case.initial)
    assert again.objectives == ample.objectives
    assert np.array_equal(again.gradients["sway"], ample.gradients["sway"])


def test_a_method_without_an_error_estimate_says_why_and_the_others_are_shown(monkeypatch) -> None:
    from mdstopo.cli.gradient import _all_methods
    from mdstopo.evaluators import evaluator_of

    def failed(self, alpha, found, sensitivity):
        return found._replace(status=Status.STEP_LIMIT, message="at t = 0.1 s")

    monkeypatch.setattr("mdstopo.error_estimate.Estimator._finer", failed)
    case = load("springs")
    results, failure = _all_methods(evaluator_of(case), case.initial, ("adjoint", "direct"), True)
    assert list(results) == ["adjoint", "direct"]
    why = f"adjoint: no error estimate, because the finer motion failed: {Status.STEP_LIMIT.value} (at t = 0.1 s)"
    assert failure == f"{why}; {why.replace('adjoint', 'direct')}"
