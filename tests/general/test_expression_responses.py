"""Responses that are expressions of others: the same as built-in ones, and gradients through their kinks and jumps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.integrators.steps import OF_SAMPLES
from mdstopo.status import Status
from tests.variables.support import differences, whole

PLANE = """
format: 1
gravity: [0, -9.81]
time: {end: 0.4}
bodies:
  load: {mass: 20, inertia: 0.5, position: [0, 0], velocity: [2, 0.4], angular_velocity: 1.5}
points:
  corners: {body: load, grid: {list: [[0.2, 0.2], [-0.21, 0.17], [0.19, -0.2], [-0.23, -0.22]]}}
  hooks: {body: ground, grid: {list: [[-1, 1.05], [1.1, 1]]}}
members:
  belts: {from: corners, to: hooks, law: {type: spring, stiffness: 2000, damping: 20}}
design: {initial: 0.5}
"""
SPACE = (
    PLANE.replace("format: 1", "format: 1\ndimension: 3")
    .replace("[0, -9.81]", "[0, -9.81, 0]")
    .replace(
        "inertia: 0.5, position: [0, 0], velocity: [2, 0.4]",
        "inertia: [0.5, 0.4, 0.6], position: [0, 0, 0], velocity: [2, 0.4, 0.2]",
    )
    .replace("angular_velocity: 1.5", "angular_velocity: [0.4, 1, 1.5]")
    .replace("[[0.2, 0.2], [-0.21, 0.17], [0.19, -0.2], [-0.23, -0.22]]", "[[0.2, 0.2, 0], [-0.2, 0.1, 0.1]]")
    .replace("[[-1, 1.05], [1.1, 1]]", "[[-1, 1, 0.3], [1, 1, -0.4]]")
)


def part(word: str, component: str = "") -> str:
    """A response of the body, perhaps one component."""
    return f"{{{word}: {{body: load{f', component: {component}' if component else ''}}}}}"


def expression(formula: str, parameters: str = "", **of: str) -> str:
    """A response that is an expression of others."""
    named = ", ".join(f"{name}: {response}" for name, response in of.items())
    more = f", parameters: {{{parameters}}}" if parameters else ""
    return f'{{expression: {{formula: "{formula}", of: {{{named}}}{more}}}}}'


AX, AY, VX, DX = part("acceleration", "x"), part("acceleration", "y"), part("velocity", "x"), part("displacement", "x")
A = part("acceleration")


def looking(text: str, objectives: dict[str, tuple[str, str]], **solver: object) -> Any:
    """The case with these objectives: by name a response, and what becomes of it over time."""
    lines = [f"  {name}: {{response: {response}, over_time: {how}}}" for name, (response, how) in objectives.items()]
    weights = ", ".join(f"{name}: 1" for name in objectives)
    case = "\n".join([text, "objectives:", *lines, f"combine: {{weights: {{{weights}}}, normalize: false}}"])
    return read_case(case, overrides={f"solver.{key}": value for key, value in solver.items()})


#: built-in responses, and the same as expressions
SAME = {
    "acceleration": (A, expression("sqrt(x^2 + y^2)", x=AX, y=AY)),
    "velocity": (part("velocity"), expression("(x^2 + y^2)^0.5", x=VX, y=part("velocity", "y"))),
    "displacement": (DX, expression("3*x/k", "k: 3", x=DX)),
}


@pytest.mark.parametrize("over_time", ["max", "max_abs", "min", "mean", "rms", "final"])
def test_a_built_in_response_written_as_an_expression_is_the_same(over_time: str) -> None:
    found = [
        mdstopo.evaluate(looking(PLANE, {name: (pair[which], over_time) for name, pair in SAME.items()}))
        for which in range(2)
    ]
    for name in SAME:
        assert found[1].objectives[name] == pytest.approx(found[0].objectives[name], rel=1e-12)
        of_one, of_other = (each.gradients[name] for each in found)
        assert np.abs(of_other - of_one).max() <= 1e-10 * np.abs(of_one).max()


#: with kinks, jumps, roots at zero, time and stored energy in them
KINKED = {
    "least": (expression("min(x + 1, y/10)", x=DX, y=A), "max"),
    "largest": (expression("max(-x, x/2, y/5 - 3)", x=VX, y=A), "min"),
    "chosen": (expression("if(v > 0, x, y)", v=VX, x=AX, y=AY), "max_abs"),
    "jump": (expression("if(v > 0, x, 0)", v=VX, x=A), "max"),
    "travel": (expression("abs(x)", x=VX), "integral"),
    "excess": (expression("max(abs(x) - 1, 0)^2", x=VX), "mean"),
    "time_above": (expression("step(x - m)", "m: 15", x=A), "integral"),
    "squares": (expression("if(x > 15, x, 2) + e", x=A, e="energy"), "rms"),
    "deviation": (expression("abs(x - 0.3*t)", x=DX), "mean"),
    "root": (expression("sqrt(v^2)", v=VX), "mean"),
    "energy": (expression("e*abs(v)", e="energy", v=VX), "max"),
    "at_end": (expression("max(e, v)", e="energy", v=VX), "final"),
    "steady": (expression("x^2*step(t - 0.2)", x=A), "mean"),
    "late": (expression("x*step(t - w)", "w: 0.21", x=AX), "max_abs"),
    "until": (expression("if(t < 0.3, min(x, 10), 0)", x=AX), "integral"),
}


@pytest.mark.parametrize(("integrator", "tolerance", "error"), [("runge_kutta", 1e-11, 2e-8)])
def test_gradients_through_kinks_and_jumps_are_those_of_differences(
    integrator: str, tolerance: float, error: float
) -> None:
    case = looking(PLANE, KINKED, integrator=integrator, tolerance=tolerance)
    design, direction = np.linspace(0.3, 0.9, 8), np.array([1.0, -2.0, 1.5, 0.5, -1.0, 2.0, 1.0, -0.5])
    found = mdstopo.evaluate(case, design)
    expected = differences(case, design, direction, 1e-3)
    for name, gradient in found.gradients.items():
        size = float(np.abs(gradient) @ np.abs(direction))
        assert size > 0.0, name
        assert abs(gradient @ direction - expected[name]) <= error * size, name


#: a body on a pin, which turns round: the speed of its point is 0.8 m times its angular velocity
SWING = """
format: 1
gravity: [0, -9.81]
time: {end: 2}
bodies: {load: {mass: 2, inertia: 0.3, position: [0.5, 0], velocity: [0, 0.5], angular_velocity: 1}}
joints: [{type: revolute, bodies: [ground, load], at: [0, 0]}]
points:
  hooks: {body: ground, grid: {list: [[0.5, 1.2], [1, 1]]}}
  eyes: {body: load, grid: {list: [[0.5, 0.1], [0.8, 0]]}}
members: {belts: {from: hooks, to: eyes, connect: pairs, law: {type: spring, stiffness: 60, damping: 0.5}}}
design: {initial: 0.7}
"""


@pytest.mark.parametrize(
    ("formula", "over_time", "solver", "error"),
    [
        ("1 - b + 0.3*d", "max", {"tolerance": 1e-10}, 1e-9),
        ("1 - b + 0.3*d", "max", {"integrator": "generalized_alpha", "step": 1e-3}, 1e-5),
        ("b + 0.3*d", "min", {"tolerance": 1e-10}, 1e-9),
        ("if(d > -9, 1 - b + 0.3*d, 0)", "max", {"tolerance": 1e-10}, 1e-9),
        ("b - d", "mean", {"tolerance": 1e-10}, 1e-7),
    ],
)
def test_a_speed_in_an_expression_has_a_kink_where_it_passes_zero(
    formula: str, over_time: str, solver: dict[str, Any], error: float
) -> None:
    d, w = part("displacement"), part("angular_velocity")
    speed = "{velocity: {body: load, at: [0.8, 0]}}"
    of_norm, of_sign = expression(formula, b=speed, d=d), expression(formula.replace("b", "abs(b)*0.8"), b=w, d=d)
    both = {"of_norm": (of_norm, over_time), "of_sign": (of_sign, over_time)}
    found = mdstopo.evaluate(looking(SWING, both, **solver), [0.4, 0.9])
    assert found.objectives["of_norm"] == pytest.approx(found.objectives["of_sign"], rel=error)
    expected = found.gradients["of_sign"]
    assert np.abs(expected).max() > 1e-4
    assert np.abs(found.gradients["of_norm"] - expected).max() <= error * np.abs(expected).max()


@pytest.mark.parametrize("text", [PLANE, SPACE], ids=["plane", "space"])
def test_switches_by_time_alone_are_looked_for_once_and_not_along_the_motion(text: str) -> None:
    """The mean from 0.25 s on is that of the whole motion less that of one that ends there."""

    def sampled(formula: str, end: float) -> tuple[float, int]:
        case = looking(text.replace("end: 0.4", f"end: {end}"), {"G": (expression(formula, x=AX), "integral")})
        evaluator = Evaluator(case)
        found = evaluator.evaluate(case.initial).objectives["G"]
        return found, int(evaluator.driver("default").work[OF_SAMPLES])

    whole_motion, without = sampled("x^2", 0.4)
    first, _ = sampled("x^2", 0.25)
    behind, with_switch = sampled("x^2*step(t - 0.25)", 0.4)
    assert behind == pytest.approx(whole_motion - first, rel=1e-6)
    by_motion, located = sampled("x^2*step(t + 1e-300*x - 0.25)", 0.4)
    assert by_motion == pytest.approx(behind, rel=1e-6)
    assert with_switch < 1.2 * without < 0.6 * located


@pytest.mark.parametrize(("integrator", "methods"), [("runge_kutta", ["direct"]), ("generalized_alpha", ["iterative"])])
def test_the_methods_of_differentiation_agree_on_expressions(integrator: str, methods: list[str]) -> None:
    design = np.linspace(0.3, 0.9, 8)
    some = {name: KINKED[name] for name in ("least", "jump", "squares")}
    adjoint = mdstopo.evaluate(looking(PLANE, some, integrator=integrator, tolerance=1e-4), design)
    for method in methods:
        case = looking(PLANE, some, integrator=integrator, tolerance=1e-4, sensitivity=method)
        other = mdstopo.evaluate(case, design)
        for name, gradient in adjoint.gradients.items():
            assert np.abs(other.gradients[name] - gradient).max() <= 1e-9 * np.abs(gradient).max(), name


def test_in_space_expressions_are_the_same_and_have_the_derivatives_of_differences() -> None:
    az = part("acceleration", "z")
    objectives = {
        "norm": (expression("sqrt(x^2 + y^2 + z^2)", x=AX, y=AY, z=az), "max"),
        "built_in": (A, "max"),
        "least": (expression("min(20*x + 8, y)", x=DX, y=A), "max"),
        "turned": (expression("max(x - 0.4, 0)", x="{tilt: {body: load}}"), "integral"),
    }
    case = looking(SPACE, objectives, integrator="runge_kutta", tolerance=1e-10)
    design, direction = np.linspace(0.3, 0.9, 4), np.array([1.0, -2.0, 1.5, 0.5])
    found = mdstopo.evaluate(case, design)
    assert found.objectives["norm"] == pytest.approx(found.objectives["built_in"], rel=1e-12)
    assert found.gradients["norm"] == pytest.approx(found.gradients["built_in"], rel=1e-10)
    expected = differences(case, design, direction, 1e-3)
    for name, gradient in found.gradients.items():
        assert gradient @ direction == pytest.approx(expected[name], abs=1e-7 * float(np.abs(gradient).sum())), name


#: a load on a crushable strut, a strap that becomes slack and an inerter, each a group of one member
STRUTS = """
format: 1
gravity: [0, -9.81]
time: {end: 0.5}
bodies: {load: {mass: 4, inertia: 0.3, position: [0.02, 1], velocity: [0.3, -3]}}
members:
  leg:
    from: {body: ground, at: [0, 0]}
    to: {body: load, at: [0.05, 0.9]}
    law: {type: crush, stiffness: 2000, force: 150, gap: 0.03}
  strap:
    from: {body: ground, at: [-1, 1.1]}
    to: {body: load, at: [-0.1, 1]}
    law: [{type: gap, stiffness: 700, gap: -0.01}, {type: spring, stiffness: 40, damping: 3}]
  fly: {from: {body: ground, at: [1, 1]}, to: {body: load, at: [0.1, 1]}, law: {type: inerter, inertance: 0.4}}
design:
  initial: 0.8
  variables:
    plateau: {group: leg, parameter: force, lower: 50, upper: 400}
    slack: {group: strap, law: 0, parameter: gap, lower: -0.1, upper: 0.1}
solver: {tolerance: 1e-11}
"""
LEG, STRAP, FLY = (f"{{member_force: {{group: {name}}}}}" for name in ("leg", "strap", "fly"))
OF_FORCES = {
    "sum": (expression("f + g/2", f=LEG, g=STRAP), "max"),
    "power": (expression("f*abs(v)", f=LEG, v=part("velocity", "y")), "mean"),
    "beyond": (expression("max(f - 20, 0)^2 + e", f=STRAP, e="energy"), "integral"),
    "inertial": (expression("sqrt(f^2 + 1)", f=FLY), "final"),
}


def test_forces_of_members_in_expressions_are_those_of_the_group() -> None:
    objectives = {}
    for over_time in ("max", "mean", "rms", "final"):
        objectives[f"built_in_{over_time}"] = (STRAP, over_time)
        objectives[f"formula_{over_time}"] = (expression("f", f=STRAP), over_time)
    found = mdstopo.evaluate(looking(STRUTS, objectives))
    for over_time in ("max", "mean", "rms", "final"):
        one, other = f"built_in_{over_time}", f"formula_{over_time}"
        assert found.objectives[other] == pytest.approx(found.objectives[one], rel=1e-10)
        gradient = whole(found, one)
        assert np.abs(whole(found, other) - gradient).max() <= 1e-8 * np.abs(gradient).max(), over_time


def test_gradients_of_forces_in_expressions_are_those_of_differences() -> None:
    case = looking(STRUTS, OF_FORCES)
    design = np.array([0.8, 0.7, 0.9, 150.0, -0.01])
    direction = np.array([1.0, -2.0, 1.5, 20.0, 0.02])
    found, direct = (mdstopo.evaluate(case, design, method=method) for method in ("adjoint", "direct"))
    expected = differences(case, design, direction, 1e-3)
    for name in OF_FORCES:
        gradient = whole(found, name)
        size = float(np.abs(gradient) @ np.abs(direction))
        assert abs(gradient @ direction - expected[name]) <= 1e-7 * size, name
        assert np.abs(whole(direct, name) - gradient).max() <= 1e-8 * np.abs(gradient).max(), name


def test_a_group_of_several_members_in_an_expression_is_refused() -> None:
    case = looking(PLANE, {"G": (expression("f", f="{member_force: {group: belts}}"), "max")})
    with pytest.raises(CaseError) as caught:
        mdstopo.evaluate(case)
    assert "G.response.expression.of.f.member_force.group: found 'belts' with 8 members" in str(caught.value)


@pytest.mark.parametrize("over_time", ["max", "mean"])
def test_an_expression_without_a_value_is_told(over_time: str) -> None:
    found = mdstopo.evaluate(looking(PLANE, {"G": (expression("log(x)", x=VX), over_time)}))
    assert found.status is Status.NON_FINITE
    assert "the expression log(x) has no value" in found.message


def test_an_infinite_slope_is_no_gradient() -> None:
    found = mdstopo.evaluate(looking(PLANE, {"G": (expression("abs(x)^(1/3)", x=DX), "min")}))
    assert found.status is Status.NO_GRADIENT
    assert "the expression abs(x)^(1/3) has an infinite slope" in found.message


#: keys of an expression -> what the message has
MALFORMED = {
    'formula: "sqrt(chst^2)", of: {chest: energy}': "did you mean 'chest'? names are chest, t (column 6",
    'formula: "chest + ", of: {chest: energy}': "found the end",
    'formula: "__import__(1)", of: {chest: energy}': "there is no function '__import__'",
    'formula: "x", of: {}': "allowed is a mapping from names to 1 to 20 responses",
    'formula: "t", of: {t: energy}': "the name 't' is taken",
    'formula: "x", of: {x: {expression: {formula: "1", of: {y: energy}}}}': "unknown key 'expression'",
    'formula: "x", of: {x: energy}, parameters: {x: 1}': "is a response already",
    'formula: "x", of: {x: {velocity: {body: lode}}}': "did you mean 'load'?",
    "of: {x: energy}": "the key 'formula' is missing",
    f'formula: "{"+".join(f"abs(x - {i})" for i in range(41))}", of: {{x: energy}}': "allowed, which are 40",
}


@pytest.mark.parametrize("keys", MALFORMED)
def test_a_mistake_is_told_with_its_place(keys: str) -> None:
    with pytest.raises(CaseError) as caught:
        looking(PLANE, {"G": (f"{{expression: {{{keys}}}}}", "max")})
    text = str(caught.value)
    assert "objectives.G.response.expression" in text
    assert MALFORMED[keys] in text
