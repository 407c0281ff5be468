"""A start at rest that depends on parameters of laws: where it is, and its place in the gradients."""

from pathlib import Path

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.status import Status
from tests.variables.support import differences, whole, widths, with_variables

GRAVITY, MASS = 10.0, 2.0
#: a mass on a guide, held by a cord, and by a rope until it lets go
HANGS = """
format: 1
gravity: [0, -10]
time: {end: 0.35}
bodies: {lamp: {mass: 2, inertia: 0.1, position: [0, -1], velocity: [0, SPEED]}}
joints: [{name: guide, type: prismatic, bodies: [ground, lamp], at: [0, -1], axis: [0, 1]}]
members:
  cord: {from: {body: ground, at: [0, 0]}, to: {body: lamp, at: [0, -0.9]}, law: {type: spring, stiffness: 500}}
  rope:
    from: {body: ground, at: [0, 0]}
    to: {body: lamp, at: [0, -0.8]}
    law: {type: spring, stiffness: 300, active_until: 0.1}
    design: false
design: {initial: 0.8, variables: {VARIABLES}}
objectives:
  E: {response: energy, over_time: max}
  y: {response: {displacement: {body: lamp, component: y}}, over_time: final}
combine: {weights: {E: 1, y: 1}, normalize: false}
solver: {settle: true, tolerance: 1.0e-12}
"""


def hanging(speed, **variables):
    stated = ", ".join(f"{name}: {{{variable}}}" for name, variable in variables.items())
    return read_case(HANGS.replace("SPEED", str(speed)).replace("VARIABLES", stated))


def test_a_mass_that_swings_about_its_static_deflection_has_the_slopes_of_the_closed_form():
    """y = -m g / (k alpha) + (v / w) sin(w t), w^2 = k alpha / m, the rope being out of it."""
    case = hanging(-0.4, k="group: cord, parameter: stiffness, lower: 100, upper: 900",
                   r="group: rope, parameter: active_until, initial: -1, lower: -2, upper: -0.5")  # fmt: skip
    for k in (500.0, 330.0):
        found = mdstopo.evaluate(case, variables={"k": k})
        s, t, v = 0.8 * k, 0.35, -0.4
        w = np.sqrt(s / MASS)
        y = -MASS * GRAVITY / s + v / w * np.sin(w * t)
        by_s = MASS * GRAVITY / s**2 + 0.5 / s * (v * t * np.cos(w * t) - v / w * np.sin(w * t))
        assert found.objectives["y"] == pytest.approx(y, rel=1e-9)
        assert found.variable_gradients["y"]["k"][0] == pytest.approx(0.8 * by_s, rel=1e-7)
        assert found.gradients["y"][0] == pytest.approx(k * by_s, rel=1e-7)
        # the most it is stretched: by m g / s - v / w, at a quarter of its period
        peak = MASS * GRAVITY / s - v / w
        assert found.objectives["E"] == pytest.approx(0.5 * s * peak**2, rel=1e-9)
        by_k = 0.8 * (0.5 * peak**2 - s * peak * (MASS * GRAVITY / s**2 - 0.5 * v / (w * s)))
        assert found.variable_gradients["E"]["k"][0] == pytest.approx(by_k, rel=1e-7)
        assert found.variable_gradients["y"]["r"][0] == 0.0


def test_a_rope_that_carries_at_the_start_and_lets_go_has_the_slopes_of_the_closed_form():
    """y = -m g / c + (m g / c - m g / (c + r)) cos(w (t - tau)), w^2 = c / m, c = k alpha."""
    case = hanging(0, k="group: cord, parameter: stiffness, lower: 100, upper: 900",
                   r="group: rope, parameter: stiffness, lower: 100, upper: 900",
                   tau="group: rope, parameter: active_until, lower: 0.01, upper: 0.3")  # fmt: skip
    weight = MASS * GRAVITY

    def place(alpha, k, r, tau):
        c = k * alpha
        return -weight / c + (weight / c - weight / (c + r)) * np.cos(np.sqrt(c / MASS) * (0.35 - tau))

    at = np.array([0.8, 420.0, 250.0, 0.12])
    found = mdstopo.evaluate(case, at[:1], variables={"k": at[1], "r": at[2], "tau": at[3]})
    assert found.objectives["y"] == pytest.approx(place(*at), rel=1e-9)
    step = np.diag(at * 1e-30j)
    exact = [place(*(at + own)).imag / own.imag.max() for own in step]
    own = found.variable_gradients["y"]
    assert [found.gradients["y"][0], own["k"][0], own["r"][0], own["tau"][0]] == pytest.approx(exact, rel=1e-7)


def test_preload_and_free_length_move_the_equilibrium_as_they_should():
    case = hanging(0, p="group: cord, parameter: preload, initial: 6, lower: -9, upper: 9",
                   l="group: cord, parameter: free_length, initial: 0.93, lower: 0.5, upper: 1.5",
                   r="group: rope, parameter: active_until, initial: -1, lower: -2, upper: -0.5")  # fmt: skip
    found = mdstopo.evaluate(case)
    # k (0.9 - y - l) + p = m g / alpha
    assert found.objectives["y"] == pytest.approx(0.9 - 0.93 - (MASS * GRAVITY / 0.8 - 6.0) / 500.0, rel=1e-10)
    assert found.variable_gradients["y"]["p"][0] == pytest.approx(1.0 / 500.0, rel=1e-8)
    assert found.variable_gradients["y"]["l"][0] == pytest.approx(-1.0, rel=1e-8)
    assert found.gradients["y"][0] == pytest.approx(MASS * GRAVITY / 0.8**2 / 500.0, rel=1e-8)


#: a frame on a pin and a block that slides on it, both carried by springs; a cart on a level floor that nothing holds
SCENE = """
format: 1
time: {end: 0.4}
gravity: [0, -4]
bodies:
  frame: {mass: 3, inertia: 0.4, position: [0.5, 0.1]}
  block: {mass: 2, inertia: 0.3, position: [0.6, 0.4]}
  ball: {mass: 1.5, inertia: 0.1, position: [1.6, 0.2], velocity: [0.5, -0.3], angular_velocity: 0.4}
  cart: {mass: 1, inertia: 0.1, position: [2.4, 0], velocity: [-0.3, 0]}
joints:
  - {type: revolute, bodies: [ground, frame], at: [0, 0]}
  - {type: prismatic, bodies: [frame, block], at: [0.6, 0.4], axis: [0.2, 1]}
  - {type: prismatic, bodies: [ground, cart], at: [2.4, 0], axis: [1, 0]}
points:
  sky: {body: ground, grid: {list: [[1.2, 1.1], [2, 1.2], [1.6, -0.7]]}}
  skin: {body: ball, grid: {list: [[1.5, 0.3], [1.7, 0.3], [1.63, 0.1]]}}
members:
  hold: {from: {body: ground, at: [0.9, 1]}, to: {body: frame, at: [1, 0.2]},
         law: {type: spring, stiffness: 90, damping: 1}}
  stack: {from: {body: frame, at: [0.5, 0]}, to: {body: block, at: [0.6, 0.4]}, law: {type: spring, stiffness: 150}}
  nest: {from: sky, to: skin, connect: pairs, law: {type: spring, stiffness: 70, damping: 0.5}}
  drag: {from: {body: cart, at: [2.4, 0]}, to: {body: ball, at: [1.7, 0.1]},
         law: {type: spring, stiffness: 0, damping: 2}, design: false}
  t: {from: {body: block, at: [0.7, 0.5]}, to: {body: ball, at: [1.5, 0.2]}, law: LAW}
design: {initial: 0.8, variables: {VARIABLES}}
objectives:
  E: {response: energy, over_time: max}
  M: {response: energy, over_time: mean}
  X: {response: {displacement: {body: block, at: [0.7, 0.5]}}, over_time: final}
  C: {response: {velocity: {body: cart, component: x}}, over_time: final}
  B: {response: {member_force: {group: t}}, over_time: max}
  A: {response: {acceleration: {body: ball, component: x}}, over_time: rms}
combine: {weights: {E: 1, M: 1, X: 1, C: 1, B: 1, A: 1}, normalize: false}
constraints:
  - {response: {angle: {body: frame}}, over_time: max_abs, limit: 3}
solver: {settle: true}
"""
SPRING = "type: spring, stiffness: 60, damping: 2, preload: 3"
GAP = "type: gap, stiffness: 300, damping: 4"
ACTUATOR = "type: actuator, proportional: 80, derivative: 5, target: 0.03"
#: by name: the law, and by parameter its value, and the bounds that its differences are a share of
LAWS = {
    "spring": (
        SPRING,
        {"stiffness": (60, 10, 100), "damping": (2, 0, 5), "preload": (3, -5, 5), "free_length": (0.7, 0.5, 1)},
    ),
    "spring active at the start": (
        SPRING + ", active_from: -1, active_until: 0.25",
        {"stiffness": (60, 10, 100), "active_from": (-0.1, -0.5, -0.01), "active_until": (0.25, 0.01, 0.39)},
    ),
    "spring active later": (
        SPRING + ", active_from: 0.15",
        {"stiffness": (60, 10, 100), "preload": (3, -5, 5), "active_from": (0.15, 0.01, 0.3)},
    ),
    "gap in contact": (
        GAP + ", gap: 0.02",
        {"stiffness": (300, 10, 900), "damping": (4, 0, 9), "gap": (0.02, 0, 0.3), "free_length": (0.6, 0.5, 1)},
    ),
    "gap out of contact": (
        GAP + ", gap: 0.02, side: compression",
        {"stiffness": (300, 10, 900), "damping": (4, 0, 9), "gap": (0.02, 0, 0.3), "free_length": (0.75, 0.5, 1)},
    ),
    "gap without pull": (
        GAP + ", gap: 0.02, clip: true",
        {"stiffness": (300, 10, 900), "damping": (4, 0, 9), "gap": (0.02, 0, 0.3), "free_length": (0.6, 0.5, 1)},
    ),
    "cubic": (
        "type: cubic, stiffness: 60, cubic: 200",
        {"stiffness": (60, 10, 100), "cubic": (200, 0, 500), "free_length": (0.7, 0.5, 1)},
    ),
    "curve": (
        "type: curve, curve: [[-1.2, -60], [-1, -40], [0.02, 5], [1, 50], [1.2, 90]]",
        {"free_length": (0.7, 0.5, 1)},
    ),
    "pulse": (
        "type: pulse, peak: 20, rate: 100, time: 0.12",
        {"peak": (20, 0, 30), "rate": (100, 10, 300), "time": (0.12, 0.05, 0.2)},
    ),
    "table": (
        "type: table, table: [[0, 10], [0.6, -20]], active_until: 0.1",
        {"active_until": (0.1, 0.01, 0.39)},
    ),
    "actuator": (
        ACTUATOR,
        {"proportional": (80, 10, 100), "derivative": (5, 0, 9), "target": (0.03, -1, 1)},
    ),
    "actuator at its limit": (
        ACTUATOR + ", limit: 1.5",
        {"proportional": (80, 10, 100), "derivative": (5, 0, 9), "target": (0.03, -0.1, 0.1), "limit": (1.5, 0.5, 3)},
    ),
    "inerter": ("type: inerter, inertance: 1.5", {"inertance": (1.5, 0, 3)}),
}
#: at the start these do not hold anything: no parameter of theirs moves the equilibrium
IDLE = {"spring active later", "gap out of contact", "inerter"}
#: generalized_alpha differentiates times and what follows from events as the motion does, not as its steps do
SMOOTH = ("spring", "cubic", "curve", "actuator", "inerter")


def settled(law, parameters, **solver):
    return with_variables(SCENE.replace("LAW", f"{{{law}}}"), "t", parameters, **solver)


def directions(case):
    """One for each variable, one of all alphas, one of all at once; in shares of ranges and of alpha."""
    rng = np.random.default_rng(3)
    start, n = np.array(case.start), case.n_design
    for variable in case.variables:
        direction = np.zeros(len(start))
        part = case.space.parts[variable.name]
        direction[part] = (variable.upper - variable.lower) * rng.uniform(0.5, 1.0, variable.count)
        yield variable.name, direction
    direction = np.zeros(len(start))
    direction[:n] = rng.normal(size=n)
    yield "alpha", direction
    for variable in case.variables:
        direction[case.space.parts[variable.name]] = 0.3 * (variable.upper - variable.lower)
    yield "all", direction


def check(case, bound, size=5e-4):
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    for name, direction in directions(case):
        for objective, slope in differences(case, case.start, direction, size).items():
            gradient = whole(found, objective)
            scale = np.abs(gradient * widths(case)).max()
            assert abs(gradient @ direction - slope) <= bound * scale, (name, objective, gradient @ direction, slope)


def agree(case, bound=1e-9):
    adjoint, direct = (mdstopo.evaluate(case, method=method) for method in ("adjoint", "direct"))
    for objective in adjoint.objectives:
        one, other = (whole(found, objective) * widths(case) for found in (adjoint, direct))
        assert np.abs(one - other).max() <= bound * np.abs(one).max(), objective


@pytest.mark.parametrize("name", LAWS)
def test_the_derivative_by_a_parameter_goes_through_the_equilibrium(name):
    check(settled(*LAWS[name], tolerance=1e-11), 1e-7)


@pytest.mark.parametrize("name", SMOOTH)
def test_so_it_does_with_the_fixed_steps_of_generalized_alpha(name):
    check(settled(*LAWS[name], integrator="generalized_alpha", step=0.0125), 1e-7, 1e-3)


@pytest.mark.parametrize("solver", [{"tolerance": 1e-9}, {"integrator": "generalized_alpha", "step": 0.01}], ids=str)
@pytest.mark.parametrize("name", LAWS)
def test_direct_and_adjoint_agree(name, solver):
    agree(settled(*LAWS[name], **solver))


@pytest.mark.parametrize("name", LAWS)
def test_what_holds_at_rest_moves_the_start_and_nothing_else_does(name):
    """What the scene is for; and damping, inertance and times have no part in statics."""
    case = settled(*LAWS[name])
    evaluator = Evaluator(case)
    before = evaluator.settled(case.start, "default")
    assert before is not None
    for variable in case.variables:
        design = np.array(case.start)
        design[case.space.parts[variable.name]] += 0.02 * (variable.upper - variable.lower)
        after = evaluator.settled(design, "default")
        assert after is not None
        shift = np.abs(after.q - before.q)
        idle = name in IDLE or variable.parameter in ("damping", "derivative", "active_from", "active_until")
        idle = idle or (name == "actuator at its limit" and variable.parameter in ("proportional", "target"))
        assert (shift.max() < 1e-12) if idle else (shift.max() > 1e-7), variable.name
        assert shift[9] <= 1e-11  # nothing holds the cart, so it keeps its place


def test_a_design_settles_in_the_same_place_whatever_was_evaluated_before():
    case = settled(*LAWS["gap in contact"])
    evaluator = Evaluator(case)
    other = np.array(case.start)
    other[case.n_design :] *= 1.1
    before = evaluator.evaluate(case.start)
    evaluator.evaluate(other)
    frequencies = evaluator.natural_frequencies(case.start, "default")
    after = evaluator.evaluate(case.start)
    assert not np.array_equal(evaluator.natural_frequencies(other, "default"), frequencies)
    for objective, value in before.objectives.items():
        assert after.objectives[objective] == value
        assert np.array_equal(whole(after, objective), whole(before, objective))


def cradle():
    """A frame with an arm, a load, a member that is crushed by the weight, laws in a list; its two load cases."""
    text = (Path(__file__).parents[1] / "general" / "cases" / "cradle.yaml").read_text()
    loads = text[text.index("loads:") : text.index("design:")]
    cases = loads.replace("loads:", "load_cases:\n  shaken:\n    loads:").replace("\n  -", "\n      -")
    cases += "  still:\n    loads:\n      - {body: load, force: [30, -100], at: [0.1, 1.5]}\n"
    variables = """design:
  initial: 0.5
  lower: 0.01
  mirrored: [[tip, leg]]
  variables:
    k: {group: mounts, parameter: stiffness, each: member, lower: 4000, upper: 20000}
    c: {group: mounts, parameter: damping, lower: 0, upper: 200}
    l: {group: nest, parameter: free_length, initial: 0.36, lower: 0.3, upper: 0.5}
    s: {group: tip, parameter: stiffness, law: 0, lower: 100, upper: 2000}
    p: {group: tip, parameter: preload, law: 0, lower: 0, upper: 50}
    g: {group: tip, parameter: gap, law: 1, lower: 0, upper: 0.1}
"""
    objectives = text[text.index("objectives:") :].replace("over_time:", "load_case: shaken, over_time:")
    objectives = objectives.replace(
        "combine: {weights: {", "  low: {response: energy, load_case: still, over_time: max}\n"
        "  lean: {response: {displacement: {body: load, component: x}}, load_case: still, over_time: final}\n"
        "combine: {weights: {low: 1, lean: 1, ",
    )  # fmt: skip
    return read_case(
        text[: text.index("loads:")] + cases + variables + objectives, overrides={"solver.tolerance": "1e-11"}
    )


def test_values_of_each_member_two_load_cases_and_what_is_crushed_at_the_start_go_together():
    case = cradle()
    check(case, 1e-6)
    agree(case)


def test_a_time_at_the_start_leaves_out_the_jump_of_the_equilibrium():
    """From earlier times nothing changes; a later one begins in another place."""
    law, times = f"{SPRING}, active_from: 0", {"active_from": (0, -0.1, 0.3)}
    case = settled(law, times)
    found = mdstopo.evaluate(case)
    earlier, later = (mdstopo.evaluate(case, variables={"active_from": t}) for t in (-0.05, 1e-9))
    assert found.variable_gradients["X"]["active_from"][0] == 0.0
    assert earlier.objectives["X"] == found.objectives["X"]
    assert abs(later.objectives["X"] - found.objectives["X"]) > 1e-3


def test_what_holds_nothing_at_rest_can_begin_at_the_start_and_has_its_derivative_there():
    law, times = "type: inerter, inertance: 1.5, active_from: 0", {"active_from": (0, -0.1, 0.3)}
    case = settled(law, times, tolerance=1e-12)
    found = mdstopo.evaluate(case)
    h = 1e-4
    values = [mdstopo.evaluate(case, variables={"active_from": k * h}).objectives["X"] for k in range(5)]
    slope = np.dot([-25.0 / 12.0, 4.0, -3.0, 4.0 / 3.0, -0.25], values) / h
    assert found.variable_gradients["X"]["active_from"][0] == pytest.approx(slope, rel=1e-6)


def test_a_value_that_cannot_hold_its_load_ends_the_evaluation_with_the_body_named():
    case = hanging(0, k="group: [cord, rope], parameter: stiffness, initial: 300, lower: 0.01, upper: 900")
    found = mdstopo.evaluate(case, variables={"k": 0.02})
    assert found.status is Status.NO_EQUILIBRIUM
    assert "body lamp" in found.message
    assert mdstopo.evaluate(case, variables={"k": 300.0}).status.ok


#: a block on two legs that its weight may crush, beside springs; pushed down, lifted and let down again
BLOCK = """
format: 1
gravity: [0, -9.81]
time: {end: 0.5}
bodies: {b: {mass: 10, inertia: 0.5, position: [0, 1]}}
points:
  t: {body: b, grid: {list: [[-0.3, 0.9], [0.3, 0.9]]}}
  g: {body: ground, grid: {list: [[-0.3, 0], [0.3, 0]]}}
  s: {body: ground, grid: {list: [[-2, 1.2], [2, 1.4]]}}
members:
  legs: {from: t, to: g, connect: pairs, law: {type: crush, stiffness: 6000, force: PLATEAU, gap: 0.001}}
  hold: {from: t, to: s, connect: pairs, law: {type: spring, stiffness: 900, damping: 20}, design: false}
loads:
  - body: b
    force:
      - {table: [[0, 0], [0.1, 60], [0.3, -20], [0.5, 0]]}
      - {table: [[0, 0], [0.1, -250], [0.25, 100], [0.5, 0]]}
design:
  initial: 0.8
  variables:
    k: {group: legs, parameter: stiffness, lower: 1000, upper: 9000}
    F: {group: legs, parameter: force, lower: 10, upper: 100}
    gap: {group: legs, parameter: gap, lower: -0.01, upper: 0.02}
objectives:
  Y: {response: {displacement: {body: b, component: y}}, over_time: final}
  A: {response: {angle: {body: b}}, over_time: final}
  E: {response: energy, over_time: mean}
combine: {weights: {Y: 1, A: 1, E: 1}}
solver: {tolerance: 1.0e-12, integrator: runge_kutta, settle: true}
"""


@pytest.mark.parametrize("plateau", [100, 30], ids=["elastic at rest", "crushed at rest"])
def test_legs_that_carry_the_weight_have_exact_derivatives_by_their_parameters(plateau):
    case = read_case(BLOCK.replace("PLATEAU", str(plateau)))
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    for each in case.variables:
        direction = np.zeros(len(case.start))
        direction[case.space.parts[each.name]] = each.upper - each.lower
        for objective, slope in differences(case, case.start, direction, 3e-4).items():
            own = whole(found, objective) * widths(case)
            scale = np.abs(own[case.n_design :]).max()
            assert abs(own[case.space.parts[each.name]][0] - slope) <= 1e-6 * scale, (objective, each.name)
    agree(case)
    assert (found.variable_gradients["Y"]["gap"][0] != pytest.approx(0.0, abs=1e-9)) == (plateau == 100)
