"""A trajectory comes with the values of what looks at it: those of `evaluate` to the bit, of one motion."""

from typing import Any

import pytest

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

SPRINGS = """
format: 1
time: {end: 0.2}
bodies: {mass: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0]}}
members:
  spring: {from: {body: ground, at: [0, 0]}, to: {body: mass, at: [1, 0]}, law: {type: spring, stiffness: 100}}
load_cases:
  usual: {}
  short: {time: {end: 0.1}}
design: {initial: 1}
objectives: {G: {response: energy, load_case: usual}}
constraints:
  - {response: energy, over_time: mean, load_case: short, limit: 0.1}
  - {response: energy, over_time: final, load_case: short, limit: 0.1}
"""
GENERAL = SPRINGS + "  - {response: {velocity: {body: mass, at: [0, 0], component: x}}, load_case: usual, limit: 2}\n"
#: the speed has kinks where the mass turns round, where steps have to end for its integral
INTEGRAL = GENERAL.replace(", component: x", "").replace("limit: 2", "limit: 2, over_time: integral")
SETTLED = (
    GENERAL.replace("bodies:", "gravity: [0.5, 0]\nsolver: {settle: true}\nbodies:")
    .replace("mass, at: [1, 0]", "mass, at: [0.9, 0]")
    .replace(", velocity: [1, 0]", "")
)
ITERATIVE = GENERAL.replace("bodies:", "solver: {sensitivity: iterative}\nbodies:")


def counted(driver: Any, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """The calls that a driver gets to compute a motion, from now on."""
    calls = list[tuple[Any, ...]]()
    run = driver.run

    def noted(*given: Any) -> Any:
        calls.append(given)
        return run(*given)

    monkeypatch.setattr(driver, "run", noted)
    return calls


@pytest.mark.parametrize("text", [SPRINGS, GENERAL, INTEGRAL, SETTLED, ITERATIVE])
def test_values_with_trajectories_are_those_of_an_evaluation(text: str) -> None:
    case = read_case(text)
    found = Evaluator(case, in_background=False).evaluate(case.start, gradient=False)
    assert found.status.ok
    engine = Evaluator(case, in_background=False)
    keys = list[str]()
    for load_case in ("short", "usual"):
        trajectory, values = engine.trajectory_with_values(case.start, load_case)
        assert trajectory.t[-1] == case.load_case(load_case).end
        assert values.status.ok
        keys += values.peaks
        for key, peak in values.peaks.items():
            if key in found.objectives:
                assert (peak.value, peak.time) == (found.objectives[key], found.peak_times[key])
            else:
                i = int(key.removeprefix("constraints[").removesuffix("]"))
                assert repr(peak) == repr(found.constraint_peaks[i][0])  # of an integral its time is NaN
    assert len(keys) == len(case.objectives) + len(case.constraints)


@pytest.mark.parametrize("text", [SPRINGS, GENERAL, SETTLED])
def test_the_motion_is_computed_once(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    case = read_case(text)
    engine = Evaluator(case, in_background=False)
    calls = counted(engine.driver("usual"), monkeypatch)
    assert engine.trajectory_with_values(case.start, "usual")[1].peaks
    assert len(calls) == 1


def test_a_motion_is_computed_again_for_an_integral_that_needs_other_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    case = read_case(INTEGRAL)
    engine = Evaluator(case, in_background=False)
    calls = counted(engine.driver("usual"), monkeypatch)
    _, values = engine.trajectory_with_values(case.start, "usual")
    assert len(calls) > 1
    assert len(values.peaks) == 2


def test_a_motion_that_fails_has_no_values() -> None:
    case = read_case(SPRINGS)
    engine = Evaluator(case, in_background=False)
    engine.driver("usual").limits[0] = 0
    trajectory, values = engine.trajectory_with_values(case.start, "usual")
    assert not trajectory.status.ok
    assert (values.status, values.peaks) == (trajectory.status, {})
