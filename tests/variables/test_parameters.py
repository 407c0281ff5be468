"""Every parameter of every law as a design variable: its derivative is that of what is computed, by both methods."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case import laws as declared
from mdstopo.case.laws.law import with_role
from mdstopo.case.reader import read_case
from tests.variables.support import OBJECTIVES, differences, with_variables

SCENE = """
format: 1
time: {end: 0.6}
gravity: [0, -1]
bodies:
  m: {mass: 2, inertia: 0.3, position: [0, 0], velocity: [0.8, 0.3], angular_velocity: TURN}
JOINTS
members:
  s: {from: {body: ground, at: [-0.6, 0.5]}, to: {body: m, at: [0.1, 0.1]},
      law: {type: spring, stiffness: 40, damping: 1}}
  t: {from: {body: ground, at: [1, 0]}, to: {body: m, at: [0.1, 0]}, law: LAW}
design: {initial: 0.8, variables: {VARIABLES}}
"""
SCENE += OBJECTIVES
GAP = "{type: gap, side: compression, stiffness: 300, damping: 4, gap: 0.1}"
#: by name: the law, and by parameter its value, and the bounds that its differences are a share of
LAWS = {
    "spring": (
        "{type: spring, stiffness: 60, damping: 2, preload: 3}",
        {"stiffness": (60, 10, 100), "damping": (2, 0, 5), "preload": (3, -5, 5), "free_length": (0.8, 0.5, 1)},
    ),
    "gap": (
        GAP,
        {"stiffness": (300, 10, 1000), "damping": (4, 0, 9), "gap": (0.1, 0, 0.3), "free_length": (0.9, 0.5, 1)},
    ),
    "clipped": (
        GAP.replace("damping: 4", "damping: 14, clip: true"),
        {"stiffness": (300, 10, 1000), "damping": (14, 0, 29), "gap": (0.1, 0, 0.3), "free_length": (0.9, 0.5, 1)},
    ),
    "cubic": (
        "{type: cubic, stiffness: 60, cubic: 200}",
        {"stiffness": (60, 10, 100), "cubic": (200, 0, 500), "free_length": (0.8, 0.5, 1)},
    ),
    "curve": (
        "{type: curve, curve: [[-1.2, -60], [-1, -40], [1, 50], [1.2, 90]]}",
        {"free_length": (0.8, 0.5, 1)},
    ),
    "pulse": (
        "{type: pulse, peak: 20, rate: 100, time: 0.2}",
        {"peak": (20, 0, 30), "rate": (100, 10, 300), "time": (0.2, 0, 0.5)},
    ),
    "actuator": (
        "{type: actuator, proportional: 80, derivative: 5, target: 0.03, limit: 8}",
        {"proportional": (80, 10, 100), "derivative": (5, 0, 9), "target": (0.03, -1, 1), "limit": (8, 1, 20)},
    ),
    "crush": (
        "{type: crush, stiffness: 300, force: 8, gap: 0.1}",
        {"stiffness": (300, 10, 1000), "force": (8, 1, 20), "gap": (0.1, 0, 0.3), "free_length": (0.9, 0.5, 1)},
    ),
    "drawn": (  # crushed from the start
        "{type: crush, side: tension, stiffness: 200, force: 6, gap: -0.1}",
        {"stiffness": (200, 10, 1000), "force": (6, 1, 20), "gap": (-0.1, -0.3, 0.1), "free_length": (0.9, 0.5, 1)},
    ),
    "inerter": ("{type: inerter, inertance: 1.5}", {"inertance": (1.5, 0, 3)}),
    "expression": (
        '{type: expression, energy: "k*l0*log(l/l0)^2/2", damping: "c*xd/l", parameters: {k: 60, c: 2}}',
        {"free_length": (0.8, 0.5, 1)},
    ),
    "formula": (  # "gap", but that its damping grows with l0
        '{type: expression, force: "if(x < -g, k*(x + g) + c*l0*xd, 0)", energy: "k*min(x + g, 0)^2/2",'
        " parameters: {k: 300, c: 4, g: 0.1}}",
        {"k": (300, 10, 1000), "c": (4, 0, 9), "g": (0.1, 0, 0.3), "free_length": (0.9, 0.5, 1)},
    ),
}
TIMES = {"active_from": (0.15, 0, 0.5), "active_until": (0.4, 0, 0.6)}
TIMED = {
    "spring": "{type: spring, stiffness: 90, damping: 2, active_from: 0.15, active_until: 0.4}",
    "gap": GAP.replace("gap: 0.1", "gap: 0.05, active_from: 0.15, active_until: 0.3"),
    "table": "{type: table, table: [[0, 10], [0.6, -20]], active_from: 0.15, active_until: 0.4}",
    "inerter": "{type: inerter, inertance: 1.5, active_from: 0.15, active_until: 0.4}",
    "formula": '{type: expression, force: "90*x + 2*xd + 2*sin(9*t)", active_from: 0.15, active_until: 0.4}',
    # elastic, as a force that stands at its plateau does not feel when; beyond it: `test_crush`
    "crush": "{type: crush, stiffness: 300, force: 40, gap: 0.05, active_from: 0.15, active_until: 0.4}",
}
SLIDE = "joints: [{type: prismatic, bodies: [ground, m], at: [0, 0], axis: [0.8, 0.3]}]"
#: laws that switch: generalized_alpha differentiates the time of that as the motion does, not as its steps do
SWITCHING = {"gap", "clipped", "actuator", "crush", "drawn", "formula"}


def scene_of(law, parameters, jointed=False, **solver):
    text = SCENE.replace("LAW", law).replace("JOINTS", SLIDE if jointed else "")
    text = text.replace("TURN", "0" if jointed else "0.4")
    return with_variables(text, "t", parameters, **solver)


def largest(found, objective, case):
    """The largest derivative of an objective by any value, as a share of its range: what agreement is relative to."""
    named = found.variable_gradients[objective]
    return max(abs(named[each.name][0]) * (each.upper - each.lower) for each in case.variables)


def check(case, bound, size=3e-4):
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    for variable in case.variables:
        width = variable.upper - variable.lower
        direction = np.zeros(len(case.start))
        direction[case.space.parts[variable.name]] = width
        slopes = differences(case, case.start, direction, size)
        for objective in found.objectives:
            own = found.variable_gradients[objective][variable.name][0] * width
            scale = max(abs(own), 0.1 * largest(found, objective, case))
            assert abs(own - slopes[objective]) <= bound * scale, (variable.name, objective, own, slopes)


def test_no_law_of_the_format_is_left_out():
    parts = {"clipped": "gap", "drawn": "crush"}
    seen: dict[str, set[str]] = {}
    for name, (_, parameters) in LAWS.items():
        seen.setdefault(parts.get(name, name), set()).update(parameters)
    for law, names in {word: with_role(each, "varies") for word, each in declared.LAWS.items()}.items():
        assert set(names) - set(TIMES) == seen.get(law, set()), law


@pytest.mark.parametrize("jointed", [False, True], ids=["free", "jointed"])
@pytest.mark.parametrize("name", LAWS)
def test_the_derivative_by_a_parameter_is_that_of_what_is_computed(name, jointed):
    check(scene_of(*LAWS[name], jointed, tolerance=1e-12), 1e-7)


@pytest.mark.parametrize("name", [name for name in LAWS if name not in SWITCHING])
def test_so_it_is_with_the_fixed_steps_of_generalized_alpha(name):
    law, parameters = LAWS[name]
    if name == "pulse":  # the ends of steps follow it, so that its time and rate are as the other times
        parameters = {"peak": parameters["peak"]}
    check(scene_of(law, parameters, integrator="generalized_alpha", step=0.01), 1e-7)


@pytest.mark.parametrize("jointed", [False, True], ids=["free", "jointed"])
@pytest.mark.parametrize("name", TIMED)
def test_the_derivative_by_a_time_is_that_of_what_is_computed(name, jointed):
    times = {**TIMES, "active_until": (0.3, 0, 0.6)} if name == "gap" else TIMES
    check(scene_of(TIMED[name], times, jointed, tolerance=1e-12), 1e-6)


@pytest.mark.parametrize("solver", [{"tolerance": 1e-9}, {"integrator": "generalized_alpha", "step": 0.01}], ids=str)
@pytest.mark.parametrize("name", [*LAWS, *(f"timed {name}" for name in TIMED)])
def test_direct_and_adjoint_agree(name, solver):
    law, parameters = (TIMED[name[6:]], TIMES) if name.startswith("timed") else LAWS[name]
    case = scene_of(law, parameters, True, **solver)
    adjoint, direct = (mdstopo.evaluate(case, method=method) for method in ("adjoint", "direct"))
    for objective in adjoint.objectives:
        scale = largest(adjoint, objective, case)
        for each in case.variables:
            difference = (
                adjoint.variable_gradients[objective][each.name] - direct.variable_gradients[objective][each.name]
            )
            assert np.abs(difference).max() * (each.upper - each.lower) <= 1e-9 * scale, (objective, each.name)


def test_by_times_and_through_events_generalized_alpha_is_right_to_its_own_order():
    for law, parameters in (LAWS["gap"], LAWS["pulse"], (TIMED["spring"], TIMES)):
        exact = mdstopo.evaluate(scene_of(law, parameters, tolerance=1e-11)).variable_gradients["M"]
        errors = []
        for step in (0.004, 0.001):
            case = scene_of(law, parameters, integrator="generalized_alpha", step=step)
            found = mdstopo.evaluate(case).variable_gradients["M"]
            errors.append(max(abs(found[name][0] - exact[name][0]) / abs(exact[name][0]) for name in exact))
        assert errors[0] < 1e-2
        assert errors[1] < errors[0] / 8.0


def test_at_the_start_the_derivative_by_a_time_is_that_to_the_side_on_which_it_does_something():
    law, times = "{type: spring, stiffness: 90, preload: 5, active_from: 0}", {"active_from": (0, -0.1, 0.5)}
    case = scene_of(law, times, tolerance=1e-12)
    found = mdstopo.evaluate(case)
    h = 1e-4
    values = [mdstopo.evaluate(case, variables={"active_from": k * h}).objectives["X"] for k in range(5)]
    slope = np.dot([-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25], values) / h
    assert found.variable_gradients["X"]["active_from"][0] == pytest.approx(slope, rel=1e-6)
    earlier = mdstopo.evaluate(case, variables={"active_from": -0.05})
    assert earlier.variable_gradients["X"]["active_from"][0] == 0.0
    assert earlier.objectives["X"] == found.objectives["X"]


def test_a_law_that_never_acts_has_no_derivatives():
    case = scene_of(TIMED["spring"], TIMES)
    found = mdstopo.evaluate(case, variables={"active_from": 0.45})
    assert found.variable_gradients["M"]["active_from"][0] == 0.0
    assert found.variable_gradients["M"]["active_until"][0] == 0.0


def test_a_value_for_each_member_and_one_for_all_of_them_tell_the_same():
    text = SCENE.replace("JOINTS", "points: {w: {body: ground, grid: {list: [[1, 0], [1, 0.4], [0.9, -0.5]]}}}")
    text = text.replace("to: {body: m, at: [0.1, 0]}", "to: {body: m, at: [0.1, 0]}").replace("TURN", "0.4")
    text = text.replace("from: {body: ground, at: [1, 0]}", "from: w").replace("LAW", LAWS["gap"][0])
    one = "g: {group: t, parameter: gap, lower: 0, upper: 0.3}, c: {group: t, parameter: damping, lower: 0, upper: 9}"
    together = read_case(text.replace("VARIABLES", one), overrides={"solver.tolerance": "1e-11"})
    each = read_case(
        text.replace("VARIABLES", one.replace("parameter", "each: member, parameter")),
        overrides={"solver.tolerance": "1e-11"},
    )
    whole, parts = mdstopo.evaluate(together), mdstopo.evaluate(each)
    for objective, value in whole.objectives.items():
        assert parts.objectives[objective] == pytest.approx(value, rel=1e-10)
        assert parts.gradients[objective] == pytest.approx(whole.gradients[objective], rel=1e-7, abs=1e-10)
        for name in ("g", "c"):
            assert parts.variable_gradients[objective][name].shape == (3,)
            total = parts.variable_gradients[objective][name].sum()
            assert total == pytest.approx(whole.variable_gradients[objective][name][0], rel=1e-7)


def test_constraints_on_responses_and_volume_rows_have_derivatives_by_variables_too():
    case = scene_of(*LAWS["spring"], tolerance=1e-11)
    found = mdstopo.evaluate(case)
    h = 1e-3
    above, below = (mdstopo.evaluate(case, variables={"damping": 2 + s * h}).constraints[0] for s in (1, -1))
    assert found.constraint_variable_gradients["damping"][0, 0] == pytest.approx((above - below) / (2 * h), rel=1e-5)
    assert found.constraint_gradients.shape == (1, case.n_design)


def test_the_value_takes_the_place_of_the_laws_own():
    law, parameters = LAWS["gap"]
    moved = {"stiffness": (450, 10, 1000), "damping": (2.5, 0, 9), "gap": (0.08, 0, 0.3)}
    varied = mdstopo.evaluate(scene_of(law, parameters), variables={name: value[0] for name, value in moved.items()})
    stated = law.replace("300", "450").replace("damping: 4", "damping: 2.5").replace("gap: 0.1", "gap: 0.08")
    plain = mdstopo.evaluate(scene_of(stated.replace("}", ", free_length: 0.9}"), {"stiffness": moved["stiffness"]}))
    for objective, value in plain.objectives.items():
        assert varied.objectives[objective] == pytest.approx(value, rel=1e-9)
