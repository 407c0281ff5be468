"""What is said of a run that stalled: the residual, what holds it, what to try; and where nothing is to be said."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo import optimize
from mdstopo.case.reader import read_case
from mdstopo.session import shortfall
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus
from tests.fakes import FakeEngineWithEvaluations, hand_made_case

CASE = """
format: 1
time: {end: 0.4}
bodies: {mass: {mass: 2, inertia: 1, position: [0, 1], velocity: [0, 1]}}
points:
  floor: {body: ground, grid: {line: {from: [-1, 0], to: [1, 0], count: 3}}}
  load: {body: mass, grid: {line: {from: [0, 1], to: [0, 1.1], count: 2}}}
members:
  springs:
    from: floor
    to: load
    law: {type: spring, stiffness: 40, damping: 1}
objectives: {A: {response: {acceleration: {body: mass}}}}
constraints:
  - {volume: all, limit: 2}
  - {response: {displacement: {body: mass}}, over_time: max, limit: 0.15}
optimizer: {max_iterations: 4}
"""


@pytest.fixture(scope="module")
def done():
    return optimize(read_case(CASE))


def stalled(state, **changes):
    return replace(state, **({"status": RunStatus.STALLED, "kkt": 3e-4, "best_violation": 0.0} | changes))


def test_a_stalled_run_is_told_with_its_residual_what_holds_it_and_what_to_try(done) -> None:
    (told,) = shortfall.stalled_run(done.case, stalled(done.states[0]))
    assert "stalled at a KKT residual of 0.0003 where optimizer.tolerance asks for 1e-06" in told
    assert "the objective" in told
    for advice in ("--starts", "solver.tolerance", "optimizer.tolerance"):
        assert advice in told


def test_a_stalled_run_that_settles_is_told_where_objectives_jump(done) -> None:
    settles = replace(done.case, solver=replace(done.case.solver, settle=True))
    (told,) = shortfall.stalled_run(settles, stalled(done.states[0]))
    assert "comes to rest at another place" in told
    (told,) = shortfall.stalled_run(done.case, stalled(done.states[0]))
    assert "comes to rest at another place" not in told


def test_the_constraint_that_carries_a_multiplier_is_named_and_others_are_not(done) -> None:
    state = done.states[0]
    groups = state.bundle.group
    assert set(groups.tolist()) == {0, 1}
    held = shortfall.holders(done.case, replace(state, multipliers=np.where(groups == 1, 1.0, 0.5)))
    assert held[0].startswith("the objective")
    assert held[1:] == ["constraints[1] (max displacement of mass)"]
    assert shortfall.holders(done.case, replace(state, multipliers=np.where(groups == 1, 0.0, 1.0)))[1:] == []


def test_only_a_stalled_run_whose_limits_hold_is_told(done) -> None:
    state = done.states[0]
    for status in (RunStatus.CONVERGED, RunStatus.MAX_ITERATIONS, RunStatus.FAILED):
        assert shortfall.stalled_run(done.case, stalled(state, status=status)) == ()
    assert shortfall.stalled_run(done.case, stalled(state, best_violation=0.1)) == ()


def test_what_holds_a_run_is_not_known_of_the_separable_model(done) -> None:
    (told,) = shortfall.stalled_run(done.case, stalled(done.states[0], uses_bundle=False))
    assert "held by" not in told


def test_several_runs_are_told_together_with_the_largest_residual() -> None:
    ends = [(RunStatus.STALLED, 1e-4), (RunStatus.CONVERGED, 1e-7), (RunStatus.STALLED, 2e-3)]
    (told,) = shortfall.stalled_runs(ends, "points", 1e-6)
    assert told.startswith(
        "2 of 3 points stalled at KKT residuals up to 0.002 where optimizer.tolerance asks for 1e-06"
    )
    assert shortfall.stalled_runs(ends[1:2], "points") == ()
    (told,) = shortfall.stalled_runs([(RunStatus.STALLED, float("nan"))], "runs")
    assert told.startswith("1 of 1 runs stalled: try")


def test_a_run_that_used_its_iterations_tells_its_residual_and_what_the_last_ones_gained(done) -> None:
    assert done.status == "max_iterations"
    assert f"KKT residual of {done.kkt:.2g}" in done.reason
    assert "; the last 4 iterations " in done.reason


def test_a_run_that_stalls_ends_with_the_warning_in_its_outcome() -> None:
    # steps that gain less than a tenth end it, long before the residual is as small
    case = hand_made_case()
    options = {"bundle": False, "decrease_tolerance": 0.1}
    case = replace(case, optimizer=replace(case.optimizer, tolerance=1e-12, options=options))
    found = run_session(case, engine=FakeEngineWithEvaluations)
    assert found.status == "stalled"
    assert any(each.startswith("stalled at a KKT residual of ") for each in found.warnings)


def test_a_violation_of_a_limit_that_is_zero_is_no_share_of_it() -> None:
    """The mass rises at first whatever holds it."""
    case = read_case(CASE.replace("limit: 0.15", "limit: 0"), overrides={"optimizer.max_iterations": 60})
    found = optimize(case)
    assert "constraints[1] (max displacement of mass) is " in found.reason
    assert "above its limit 0 m " in found.reason
    assert "of its bound" not in found.reason
