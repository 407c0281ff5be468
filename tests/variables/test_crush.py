"""Parameters of `crush` as design variables: exact through every state, the set that is remembered among them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.status import Status
from tests.general.support import CASES
from tests.reading import case_of
from tests.tiers import examples
from tests.variables.support import differences, whole, widths

ONE = """
format: 1
gravity: [0, {g}]
time: {{end: {end}}}
bodies: {{ball: {{mass: 2, inertia: 1, position: [0, 1], velocity: [0, {v}]}}}}
motions: [{{body: ball, x: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  leg:
    from: {{body: ground, at: [0, {foot}]}}
    to: {{body: ball, at: [0, 1]}}
    law: {{type: crush, stiffness: 2000, force: 60, gap: {gap}, {more}}}
loads: [{{body: ball, force: [0, {{table: [[0, 0], [0.35, 0], [0.36, {push}], [0.44, {push}], [0.45, 0]]}}]}}]
design:
  initial: 0.9
  lower: 0.1
  power: 1.5
  variables:
    k: {{group: leg, parameter: stiffness, lower: 1000, upper: 3000}}
    F: {{group: leg, parameter: force, lower: 40, upper: 80}}
    g: {{group: leg, parameter: gap, lower: {lower}, upper: {upper}}}
objectives:
  a: {{response: {{acceleration: {{body: ball}}}}, over_time: max}}
  s: {{response: {{displacement: {{body: ball, component: y}}}}, over_time: final}}
  v: {{response: {{velocity: {{body: ball, component: y}}}}, over_time: rms}}
  E: {{response: energy, over_time: mean}}
  Em: {{response: energy, over_time: max}}
  Ef: {{response: energy, over_time: final}}
  F: {{response: {{member_force: {{group: leg}}}}, over_time: max}}
  Ff: {{response: {{member_force: {{group: leg}}}}, over_time: final}}
  I: {{response: {{member_force: {{group: leg}}}}, over_time: integral}}
  R: {{response: {{member_force: {{group: leg}}}}, over_time: rms}}
combine: {{weights: {{a: 1, s: 1, v: 1, E: 1, Em: 1, Ef: 1, F: 1, Ff: 1, I: 1, R: 1}}, normalize: false}}
constraints:
  - {{response: {{member_force: {{group: leg}}}}, over_time: mean, limit: 100}}
  - {{response: energy, over_time: rms, limit: 100}}
"""
K, F, M = 2000.0, 60.0, 2.0
#: what the motion ends in: the leg is touched at 0.03 s, stands at its plateau until 0.25 s, and throws the ball off at
#: 0.33 s; pushed back it is touched again at 0.37 s, crushed from 0.39 s to 0.6 s, and left at 0.69 s
REGIMES = {
    "elastic": {"v": -0.3, "foot": 0, "gap": 0.005, "end": 0.1},
    "crushing": {"end": 0.2},
    "on the way back": {"end": 0.29},
    "thrown off": {"end": 0.345},
    "second stroke, elastic": {"end": 0.375},
    "second stroke, crushing": {"end": 0.5},
    "second stroke, thrown off": {"end": 0.71},
    "begins beyond, further in": {"v": -1, "foot": 0, "gap": -0.2, "end": 0.25},
    "begins beyond, way back": {"v": 1, "foot": 0, "gap": -0.2, "end": 0.03},
    "begins beyond, second stroke": {"v": 1, "foot": 0, "gap": -0.2, "end": 0.6},
    "begins on the flank": {"v": -1, "foot": 0, "gap": -0.02, "end": 0.2},
}


def one(side="compression", **given):
    """The leg under the ball, or its mirror image, drawn out upwards."""
    v = {"v": -3.0, "g": -10.0, "foot": -1.0, "gap": 0.1, "end": 1.0, "push": -70.0, "more": "", **given}
    if side == "tension":
        v.update(v=-v["v"], g=-v["g"], push=-v["push"], foot=-2.0, more="side: tension, " + v["more"])
    return ONE.format(lower=v["gap"] - 0.1, upper=v["gap"] + 0.1, **v)


def check_each(case, bound, h=1e-4):
    """The derivative by each entry of the design is the difference, to a share of the largest of the same number."""
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    wide = widths(case)
    for i in range(len(wide)):
        direction = np.zeros(len(wide))
        direction[i] = wide[i]
        for name, slope in differences(case, case.start, direction, h).items():
            own = whole(found, name) * wide
            assert abs(own[i] - slope) <= bound * np.abs(own).max() + 1e-12, (i, name, own, slope)


def check_methods(case, design=None):
    design = case.start if design is None else design
    adjoint, direct = (Evaluator(case).evaluate(design, sensitivity=method) for method in ("adjoint", "direct"))
    wide = widths(case)
    for name in (*adjoint.objectives, *range(len(adjoint.constraints))):
        own = whole(adjoint, name) * wide
        assert np.abs(whole(direct, name) * wide - own).max() <= 1e-9 * np.abs(own).max() + 1e-15, name


@pytest.mark.parametrize("side", ["compression", "tension"])
@pytest.mark.parametrize("regime", REGIMES)
def test_derivatives_are_those_of_what_is_computed_in_every_regime(regime, side):
    check_each(case_of(one(side, **REGIMES[regime]), tolerance=1e-12), 1e-6)


@pytest.mark.parametrize("solver", [{"tolerance": 1e-9}, {"integrator": "generalized_alpha", "step": 0.001}], ids=str)
@pytest.mark.parametrize("regime", REGIMES)
def test_direct_and_adjoint_agree_in_every_regime(regime, solver):
    check_methods(case_of(one(**REGIMES[regime]), **solver))


@pytest.mark.parametrize("regime", ["elastic", "crushing", "thrown off", "second stroke, crushing"])
def test_generalized_alpha_is_right_to_its_own_order(regime):
    """At events it differentiates the motion, not its steps, as for alpha."""
    exact = mdstopo.evaluate(case_of(one(**REGIMES[regime]), tolerance=1e-11))
    errors = []
    for step in (1e-3, 1.25e-4):
        found = mdstopo.evaluate(case_of(one(**REGIMES[regime]), integrator="generalized_alpha", step=step))
        wide = widths(case_of(one(**REGIMES[regime])))
        off = [
            np.abs((whole(found, name) - whole(exact, name)) * wide).max() / np.abs(whole(exact, name) * wide).max()
            for name in ("s", "v", "E", "I", "R")
        ]
        errors.append(max(off))
    assert errors[0] < 0.05
    assert errors[1] < errors[0] / 5.0


def test_the_stroke_has_the_slopes_of_the_energy_balance():
    """Without gravity m v^2 / 2 = F^2 / (2 k) + F p, at alpha = 1; behind it the ball leaves with F / sqrt(k m)."""
    v, t = 3.0, 0.5
    case = case_of(one(v=-v, g=0, push=0, end=t), tolerance=1e-11)
    found = mdstopo.evaluate(case, np.ones(1))

    def place(k, force, gap):
        omega = math.sqrt(k / M)
        touch = gap / v
        plateau = math.asin(force / k * omega / v) / omega
        speed = v * math.cos(omega * plateau)
        stopped = speed * M / force
        lost = (0.5 * M * v * v - 0.5 * force**2 / k) / force
        leaves = touch + plateau + stopped + 0.5 * math.pi / omega
        return -gap - lost + (t - leaves) * force / math.sqrt(k * M)

    own = [found.variable_gradients["s"][name][0] for name in "kFg"]
    z = np.array([K, F, 0.1])
    for i in range(3):
        e = np.zeros(3)
        e[i] = 1e-5 * z[i]
        slope = (8 * (place(*(z + e)) - place(*(z - e))) - place(*(z + 2 * e)) + place(*(z - 2 * e))) / (12 * e[i])
        assert own[i] == pytest.approx(slope, rel=1e-7)
    # the plateau is alpha F, and what is left at its end F^2 / (2 k)
    assert found.variable_gradients["F"]["F"][0] == pytest.approx(1.0, rel=1e-9)
    assert found.variable_gradients["Em"]["F"][0] == pytest.approx(F / K, rel=1e-9)
    assert found.variable_gradients["Em"]["k"][0] == pytest.approx(-0.5 * F**2 / K**2, rel=1e-9)


def test_histories_end_in_the_derivatives():
    case = case_of(one(**REGIMES["second stroke, crushing"]), tolerance=1e-9)
    evaluator = Evaluator(case)
    for name in ("s", "Ef", "Ff"):
        status, _, lines = evaluator.histories(case.start, name)
        assert status.ok
        own = whole(evaluator.evaluate(case.start), name)
        assert np.abs((lines[-1] - own) * widths(case)).max() <= 1e-6 * np.abs(own * widths(case)).max(), name


# --- many members at once

VARIABLES = """design:
  initial: 0.5
  lower: 0.01
  mirrored: [[legs, others]]
  variables:
    k: {group: [legs, others], parameter: stiffness, lower: 20000, upper: 90000}
    F: {group: legs, parameter: force, each: member, lower: 1000, upper: 4000}
    g: {group: legs, parameter: gap, each: member, lower: 0, upper: 0.2}
    l: {group: others, parameter: free_length, initial: 0.7, lower: 0.5, upper: 1}
    draw: {group: struts, law: 1, parameter: force, lower: 500, upper: 1500}
    push: {group: struts, law: 2, parameter: force, each: member, lower: 500, upper: 1500}
    stiff: {group: struts, law: 1, parameter: stiffness, lower: 20000, upper: 90000}
    slack: {group: struts, law: 2, parameter: gap, lower: 0, upper: 0.01}
    late: {group: others, parameter: active_from, initial: 0.05, lower: 0, upper: 0.2}
    soft: {group: struts, law: 0, parameter: stiffness, lower: 10000, upper: 50000}
"""
OTHERS = """  others:
    from: pads
    to: feet
    connect: pairs
    law: {type: crush, stiffness: 60000, force: 900, gap: -0.02}
  struts:
"""


def crash(**solver):
    """The scene of `tests/general/test_crush.py`, with every parameter varying, alone, shared, and by member."""
    text = (CASES / "crash.yaml").read_text()
    text = text.replace("design: {initial: 0.5, lower: 0.01}\n", VARIABLES).replace("  struts:\n", OTHERS)
    return case_of(text, **solver)


def test_many_members_with_values_of_their_own_are_right_along_random_directions():
    case = crash(tolerance=1e-11)
    rng = np.random.default_rng(3)
    # equal members on equal plateaus have no largest force of their own
    design = case.start * rng.uniform(0.9, 1.1, len(case.start))
    found = Evaluator(case).evaluate(design)
    assert found.status.ok, found.message
    for _ in range(2):
        direction = rng.normal(size=len(case.start)) * widths(case)
        for name, slope in differences(case, design, direction, 1e-6).items():
            own = whole(found, name)
            assert abs(slope - own @ direction) <= 1e-6 * np.abs(own * direction).max(), name


@pytest.mark.parametrize("solver", [{"tolerance": 1e-9}, {"integrator": "generalized_alpha", "step": 0.001}], ids=str)
def test_with_many_members_direct_and_adjoint_agree(solver):
    case = crash(**solver)
    check_methods(case, case.start * np.random.default_rng(3).uniform(0.9, 1.1, len(case.start)))


def scene(seed):
    """A body on random legs, thrown about; their parameters vary, with alpha or without it."""
    rng = np.random.default_rng(seed)
    number = lambda low, high: round(float(rng.uniform(low, high)), 4)  # noqa: E731
    push = [[round(t, 3), number(-60, 60), number(-60, 60)] for t in np.linspace(0, 0.6, 7).tolist()]
    lines = [
        "format: 1", "gravity: [0, -9.81]", "time: {end: 0.6}",
        f"bodies: {{m: {{mass: 2, inertia: 0.2, position: [0, 0], velocity: [{number(-2, 2)}, {number(-2, 2)}]}}}}",
        f"loads: [{{body: m, force: {{table: {push}}}}}]", "members:",
        "  hold: {from: {body: ground, at: [0, 0.9]}, to: {body: m, at: [0, 0.2]}, design: false, "
        "law: {type: spring, stiffness: 60, damping: 3}}",
    ]  # fmt: skip
    variables = []
    for i in range(3):
        angle = 2.0 * math.pi * (i + number(-0.3, 0.3)) / 3.0
        at = [round(1.2 * math.cos(angle), 4), round(1.2 * math.sin(angle), 4)]
        to = [round(0.2 * math.cos(angle + number(-1, 1)), 4), round(0.2 * math.sin(angle), 4)]
        law = {"stiffness": number(300, 900), "force": number(8, 25), "gap": number(-0.05, 0.05)}
        side = ("tension", "compression")[rng.integers(2)]
        stated = ", ".join(f"{key}: {value}" for key, value in law.items())
        lines.append(
            f"  m{i}: {{from: {{body: ground, at: {at}}}, to: {{body: m, at: {to}}}, "
            f"design: {('true', 'false')[i % 2]}, law: {{type: crush, side: {side}, {stated}}}}}"
        )
        variables += [
            f"    {key[0]}{i}: {{group: m{i}, parameter: {key}, lower: {value - 0.05}, upper: {1.3 * value + 0.05}}}"
            for key, value in law.items()
        ]
    lines += ["design:", "  initial: 0.8", "  variables:", *variables, "objectives:"]
    lines += [
        f"  {name}: {{response: {response}, over_time: {how}}}"
        for name, response, how in (
            ("X", "{displacement: {body: m, component: x}}", "final"), ("V", "{velocity: {body: m}}", "rms"),
            ("T", "{angle: {body: m}}", "final"), ("E", "energy", "mean"), ("P", "{member_force: {group: m1}}", "mean"),
        )
    ]  # fmt: skip
    lines += ["combine: {weights: {X: 1, V: 1, T: 1, E: 1, P: 1}, normalize: false}", "solver: {tolerance: 1e-11}"]
    return read_case("\n".join(lines) + "\n")


@settings(max_examples=examples(6, 12), derandomize=True, deadline=None)
@given(st.integers(0, 10**6))
def test_random_legs_are_right_by_both_methods(seed):
    case = scene(seed)
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    check_methods(case)
    direction = np.random.default_rng(seed).normal(size=len(case.start)) * widths(case)
    for name, slope in differences(case, case.start, direction, 1e-5).items():
        own = whole(found, name)
        assert abs(slope - own @ direction) <= 1e-6 * np.abs(own * direction).max(), name


# --- times at which the law acts


@pytest.mark.parametrize(
    ("regime", "given"),
    {
        "long before": {"end": 0.3, "more": "active_from: 0.02, active_until: 0.29"},
        "on the flank": {"end": 0.3, "more": "active_from: 0.04, active_until: 0.29"},
        "beyond the plateau, further in": {"end": 0.3, "more": "active_from: 0.08, active_until: 0.15"},
        "ceases while crushing": {"end": 0.2, "more": "active_from: 0.02, active_until: 0.1"},
        "ceases on the way back": {"end": 0.3, "more": "active_from: 0.02, active_until: 0.22"},
        # thrown up through the place where it would have been crushed
        "beyond the plateau, way back": {
            "v": 4, "foot": 0, "gap": -0.9, "end": 0.6, "more": "active_from: 0.1, active_until: 0.5",
        },
    }.items(),
)  # fmt: skip
def test_derivatives_by_the_times_of_a_leg_are_those_of_what_is_computed(regime, given):
    text = one(**given).replace(
        "objectives:\n",
        "    from: {group: leg, parameter: active_from, lower: 0, upper: 1}\n"
        "    until: {group: leg, parameter: active_until, lower: 0, upper: 1}\nobjectives:\n",
    )
    for jumps in ("a", "F", "Ff", "Ef"):  # where the law's own force jumps these have a kink or none to differentiate
        text = text.replace(f" {jumps}: 1,", "", 1).replace(f"{{{jumps}: 1, ", "{", 1)
        text = "\n".join(line for line in text.split("\n") if not line.startswith(f"  {jumps}: {{response"))
    case = case_of(text, tolerance=1e-12)
    check_each(case, 1e-6, 1e-5)
    check_methods(case)


# --- what has no derivative, what is refused


@pytest.mark.parametrize("beyond", [1e-12, -1e-12])
def test_a_plateau_that_is_only_just_reached_is_told_on_either_side(beyond):
    speed = math.sqrt(K / M) * (F / K + beyond)
    case = case_of(one(v=-speed, g=0, push=0, foot=0, gap=0, end=0.3), tolerance=1e-10)
    assert mdstopo.evaluate(case, np.ones(1)).status is Status.GRAZING


def test_on_either_side_of_a_plateau_just_reached_the_derivatives_are_others():
    sides = []
    for beyond in (1e-6, -1e-6):
        speed = math.sqrt(K / M) * (F / K + beyond)
        case = case_of(one(v=-speed, g=0, push=0, foot=0, gap=0, end=0.3), tolerance=1e-10)
        found = mdstopo.evaluate(case, np.ones(1))
        assert found.status.ok
        sides.append(found.variable_gradients["s"]["F"][0])
    assert abs(sides[0]) > 1e-3
    assert sides[1] == 0.0


@pytest.mark.parametrize("beyond", [0.0, 1e-12, -1e-12])
@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_a_start_just_at_the_plateau_and_on_the_way_back_is_told(integrator, beyond):
    """More force, and nothing has been crushed; less, and something has."""
    given = {"v": 1, "g": 0, "foot": 0, "gap": -F / K - beyond, "end": 0.02}
    assert mdstopo.evaluate(case_of(one(**given), integrator=integrator)).status is Status.GRAZING
    given["v"] = -1
    assert mdstopo.evaluate(case_of(one(**given), integrator=integrator)).status.ok


def test_on_either_side_of_such_a_start_the_derivatives_are_others():
    given = {"v": 1, "g": 0, "foot": 0, "end": 0.02}
    slopes = []
    for beyond in (1e-6, -1e-6):
        found = mdstopo.evaluate(case_of(one(gap=-F / K - beyond, **given)), np.ones(1))
        assert found.status.ok
        slopes.append(found.variable_gradients["s"]["F"][0])
    assert slopes[0] > 5e-5
    assert slopes[1] == 0.0


@pytest.mark.parametrize("parameter", ["stiffness", "force"])
def test_bounds_of_what_must_be_above_zero_are_too(parameter):
    text = one().replace(f"parameter: {parameter}, lower: {1000 if parameter == 'stiffness' else 40}",
                         f"parameter: {parameter}, lower: 0")  # fmt: skip
    with pytest.raises(CaseError, match=rf"found 0, {parameter} is a number > 0"):
        read_case(text)
