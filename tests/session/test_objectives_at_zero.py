"""Objectives that cannot be below zero, and designs with which they are zero."""

import numpy as np
import pytest

from mdstopo import optimize
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.design_problem import lower_bound_of
from tests.docs.pages import DOCS, blocks

#: an arm that springs without free length balance exactly, where their moments add up to its weight's
ARM = """
format: 1
time: {end: 0.05}
gravity: [0, -9.81]
bodies:
  arm: {mass: 2, inertia: 0.1, position: [0.4, 0]}
joints:
  - {type: revolute, name: pivot, bodies: [ground, arm], at: [0, 0]}
points:
  wall: {body: ground, grid: {line: {from: [0, 0.1], to: [0, 0.5], count: 9}}}
  hooks: {body: arm, frame: global, grid: {line: {from: [0.1, 0], to: [0.6, 0], count: 6}}}
members:
  springs: {from: wall, to: hooks, law: {type: spring, stiffness: 200, free_length: 0}}
objectives:
  sag: {response: {RESPONSE}, over_time: REDUCTION}
"""


def arm(response: str, reduction: str) -> Case:
    return read_case(ARM.replace("RESPONSE", response).replace("REDUCTION", reduction))


@pytest.mark.parametrize(
    ("response", "reduction"),
    [
        ("displacement: {body: arm}", "max"),
        ("displacement: {body: arm, component: y}", "rms"),
        ("angle: {body: arm}", "max_abs"),
    ],
)
def test_a_balanced_arm_has_converged(response: str, reduction: str) -> None:
    done = optimize(arm(response, reduction))
    assert done.status == "converged", done.reason
    assert done.objectives["sag"] < 1e-7 * done.initial_objectives["sag"]
    assert not any("stalled" in each for each in done.warnings)


def test_a_drive_that_has_nothing_to_hold_has_converged_and_its_springs_balance_the_arm_exactly() -> None:
    """Of springs from height h on the post to a on the arm, sum alpha k h a = m g r (closed form)."""
    page = (DOCS / "expressions.md").read_text(encoding="utf-8")
    (text,) = [block.text for block in blocks(page) if block.title == "balance.yaml"]
    case = read_case(text)
    done = optimize(case)
    assert done.status == "converged", done.reason
    assert 0.0 <= done.objectives["held"] - 1e-3 <= 1e-9
    (springs,) = case.members
    moment = 200.0 * float(done.alpha @ (springs.p_world[:, 1] * springs.q_world[:, 0]))
    assert moment == pytest.approx(2.0 * 9.81 * 0.4, abs=1e-6)


@pytest.mark.parametrize(
    ("response", "reduction", "is_so"),
    [
        ("displacement: {body: arm}", "final", True),
        ("joint_force: {joint: pivot}", "max", True),
        ("member_force: {group: springs}", "max", True),
        ("displacement: {body: arm, component: y}", "max", False),
        ("displacement: {body: arm, component: y}", "integral", False),
        ("displacement: {body: arm}", "max, sense: maximize", False),
    ],
)
def test_which_objectives_cannot_be_below_zero(response: str, reduction: str, is_so: bool) -> None:
    assert lower_bound_of(arm(response, reduction).objectives[0]) == (0.0 if is_so else -np.inf)
