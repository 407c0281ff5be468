"""Integrals over time of what jumps at events, or has kinks: values and gradients against other ways to them."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from mdstopo import evaluate, simulate
from mdstopo.case.reader import read_case
from tests.tiers import examples

#: a mass between a spring and a damped stop that it hits and leaves again
STOP = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 1, inertia: 1, position: [2, 0], velocity: [1, 0]}
members:
  s: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [2, 0]}, law: {type: spring, stiffness: 3}}
  g:
    from: {body: ground, at: [-1, 0]}
    to: {body: a, at: [2, 0]}
    law: {type: gap, stiffness: 20, damping: 4, gap: 0.2}
design: {initial: 0.5}
objectives:
  A: {response: {acceleration: {body: a, component: x}}, over_time: mean}
  V: {response: {velocity: {body: a, component: x}}, over_time: final}
  F: {response: {member_force: {group: g}}, over_time: rms}
combine: {weights: {A: 1, V: 1, F: 1}}
solver: {integrator: runge_kutta}
"""

#: an oscillator whose force, place and speed pass zero: x = 2 + sin(3 t) / 3 at alpha = 1
SWING = """
format: 1
time: {end: 3}
bodies:
  a: {mass: 1, inertia: 1, position: [2, 0], velocity: [1, 0]}
members:
  s: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [2, 0]}, law: {type: spring, stiffness: 9}}
design: {initial: 1}
objectives:
  F: {response: {RESPONSE}, over_time: integral}
"""


def differences(case, name, alpha, size=1e-5):
    found = np.zeros(len(alpha))
    for i in range(len(alpha)):
        for k, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
            for sign in (1.0, -1.0):
                x = alpha.copy()
                x[i] += sign * k * size
                found[i] += sign * weight * evaluate(case, x, gradient=False).objectives[name] / size
    return found


@pytest.mark.parametrize("method", ["adjoint", "direct"])
@pytest.mark.parametrize("clip", [False, True])
def test_an_integrand_that_jumps_at_an_event_feels_when_the_event_is(method, clip):
    """The mean acceleration is the change of velocity: so are their gradients."""
    case = read_case(STOP.replace("gap: 0.2}", f"gap: 0.2, clip: {str(clip).lower()}}}"))
    alpha = np.array([0.5, 0.7])
    found = evaluate(case, alpha, method=method)
    assert found.objectives["A"] == pytest.approx(found.objectives["V"] - 1.0, rel=1e-8)
    assert found.gradients["A"] == pytest.approx(found.gradients["V"], rel=1e-7)
    assert found.gradients["F"] == pytest.approx(differences(case, "F", alpha), rel=1e-5)


def exact(kind):
    """The integral and its derivative by alpha, omega^2 = 9 alpha, from quadrature of the closed form."""
    from scipy.integrate import quad

    def value(alpha):
        w = 3.0 * np.sqrt(alpha)
        kinks = np.arange(1, 8) * np.pi / w if kind != "velocity" else (np.arange(8) + 0.5) * np.pi / w
        g = {
            "member_force": lambda t: 9.0 * alpha * abs(np.sin(w * t)) / w,
            "displacement": lambda t: abs(np.sin(w * t)) / w,
            "velocity": lambda t: abs(np.cos(w * t)),
        }[kind]
        edges = [0.0, *kinks[kinks < 3.0], 3.0]
        return sum(quad(g, a, b, epsabs=1e-14)[0] for a, b in pairwise(edges))

    h = 1e-4
    slope = sum(w * (value(1 + k * h) - value(1 - k * h)) for k, w in ((1, 0.75), (2, -0.15), (3, 1 / 60))) / h
    return value(1.0), slope


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("method", ["adjoint", "direct"])
@pytest.mark.parametrize(
    ("kind", "response"),
    [
        ("member_force", "{member_force: {group: s}}"),
        ("displacement", "{displacement: {body: a}}"),
        ("velocity", "{velocity: {body: a}}"),
    ],
)
def test_integrals_of_absolute_values_are_right_where_they_pass_zero(kind, response, method, tolerance):
    case = read_case(SWING.replace("{RESPONSE}", response), overrides={"solver.tolerance": tolerance})
    value, slope = exact(kind)
    found = evaluate(case, method=method)
    assert found.objectives["F"] == pytest.approx(value, rel=max(10 * tolerance, 1e-9))
    assert found.gradients["F"] == pytest.approx([slope], rel=max(100 * tolerance, 1e-5))


@pytest.mark.parametrize("over_time", ["mean", "rms", "integral"])
def test_the_largest_of_several_forces_changes_hands(over_time):
    text = """
format: 1
time: {end: 3}
bodies:
  a: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0]}
joints:
  - {name: p, type: prismatic, bodies: [ground, a], at: [0, 0], axis: [1, 0]}
points:
  p: {body: ground, grid: {list: [[-3, 0], [0, 2]]}}
  q: {body: a, grid: {list: [[0, 0], [0.1, 0.3]]}}
members:
  g: {from: p, to: q, connect: pairs, law: {type: spring, stiffness: 9, preload: 2}}
design: {initial: 0.6}
objectives:
  F: {response: {member_force: {group: g}}, over_time: OVER}
"""
    case = read_case(text.replace("OVER", over_time))
    alpha = np.array([0.7, 0.5])
    tight = read_case(text.replace("OVER", over_time), overrides={"solver.tolerance": 1e-11})
    found, better = evaluate(case, alpha), evaluate(tight, alpha)
    assert found.objectives["F"] == pytest.approx(better.objectives["F"], rel=1e-7)
    assert found.gradients["F"] == pytest.approx(differences(tight, "F", alpha), rel=1e-5)
    assert evaluate(case, alpha, method="direct").gradients["F"] == pytest.approx(found.gradients["F"], rel=1e-9)


def test_only_what_may_have_kinks_is_looked_at_twice():
    smooth = evaluate(read_case(SWING.replace("{RESPONSE}", "{displacement: {body: a, component: x}}")))
    kinked = evaluate(read_case(SWING.replace("{RESPONSE}", "{displacement: {body: a}}")))
    assert kinked.work["steps"] > smooth.work["steps"]


def test_landings_leave_tables_and_driven_motion_as_they_were():
    text = """
format: 1
time: {end: 1}
bodies:
  cart: {mass: 1, inertia: 1, position: [0, 0]}
  a: {mass: 1, inertia: 1, position: [1, 0.2]}
motions:
  - {body: cart, x: {acceleration: {table: [[0, 0], [0.3, 4], [1, -4]]}}, y: {velocity: 0}, angle: {velocity: 0}}
members:
  s: {from: {body: cart, at: [0, 0]}, to: {body: a, at: [1, 0.2]}, law: {type: spring, stiffness: 60, damping: 1}}
loads:
  - {body: a, force: [{table: [[0, 0], [0.4, 5], [1, 0]]}, 1]}
design: {initial: 0.8}
objectives:
  F: {response: {member_force: {group: s}}, over_time: mean}
  X: {response: {displacement: {body: a, component: x}}, over_time: final}
combine: {weights: {F: 1, X: 1}}
"""
    case = read_case(text)
    found = evaluate(case)
    # X is read off the motion that lands on the kinks of F; the plain motion must end at the same place
    end = simulate(case).q[-1, 3]
    assert found.objectives["X"] == pytest.approx(end - 1.0, rel=1e-8)
    assert found.gradients["F"] == pytest.approx(differences(case, "F", np.array([0.8])), rel=1e-5)


def test_a_motion_stays_itself_when_a_later_evaluation_lands_elsewhere():
    loads = "loads:\n  - {body: a, force: [{table: [[0, 0], [2.4, 2], [3, -9]]}, 0]}\ndesign:"
    text = SWING.replace("{RESPONSE}", "{member_force: {group: s}}").replace("design:", loads)
    case, times = read_case(text), np.linspace(0.05, 2.95, 40)
    motion = simulate(case)
    before = motion.at(times)
    evaluate(case)
    after = motion.at(times)
    assert np.array_equal(before.a, after.a)
    assert np.array_equal(before.q, after.q)


def test_a_component_that_changes_its_sign_is_no_norm():
    """Its integral is a smooth function's: the motion is not landed on its zeros, and its gradient is exact."""
    case = read_case(SWING.replace("{RESPONSE}", "{displacement: {body: a, component: x}}"))
    found = evaluate(case)
    # x - 2 = sin(w t) / w, w = 3 sqrt(alpha)
    assert found.objectives["F"] == pytest.approx((1.0 - np.cos(9.0)) / 9.0, rel=1e-8)
    slope = 1.5 * (3.0 * np.sin(9.0) / 9.0 - 2.0 * (1.0 - np.cos(9.0)) / 27.0)
    assert found.gradients["F"] == pytest.approx([slope], rel=1e-8)


#: a damped, loaded spring whose force passes zero several times; what it is made of varies
LOADED = """
format: 1
gravity: [0, -9.81]
time: {end: 0.9}
bodies:
  b: {mass: 10, inertia: 0.5, position: [0, 1], velocity: [0, -1]}
members:
  g:
    from: {body: b, at: [0, 1]}
    to: {body: ground, at: [0, 0]}
    law: {type: spring, stiffness: 2000, damping: 40, preload: 3, free_length: 0.98}
design:
  initial: 1
  variables:
    k: {group: g, parameter: stiffness, lower: 1000, upper: 9000}
    c: {group: g, parameter: damping, lower: 0, upper: 100}
    p: {group: g, parameter: preload, lower: -50, upper: 50}
    l: {group: g, parameter: free_length, lower: 0.9, upper: 1.1}
objectives:
  F: {response: {member_force: {group: g}}, over_time: OVER}
solver: {tolerance: 1e-10, integrator: runge_kutta}
"""


@pytest.mark.parametrize("method", ["adjoint", "direct"])
@pytest.mark.parametrize("over_time", ["mean", "integral"])
def test_parameters_change_a_force_also_where_it_passes_zero(over_time, method):
    case = read_case(LOADED.replace("OVER", over_time))
    values = {"k": 2000.0, "c": 40.0, "p": 3.0, "l": 0.98}
    slopes = evaluate(case, variables=values, method=method).variable_gradients["F"]
    for name, size in (("k", 1.0), ("c", 0.02), ("p", 0.01), ("l", 5e-6)):
        slope = 0.0
        for k, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
            for sign in (1.0, -1.0):
                moved = values | {name: values[name] + sign * k * size}
                slope += sign * weight * evaluate(case, variables=moved, gradient=False).objectives["F"] / size
        assert slopes[name] == pytest.approx([slope], rel=1e-7), name


#: two ropes' forces pass zero a fifth of a millisecond apart: each is the larger for a moment
TOGETHER = """
format: 1
gravity: [0, -9.81]
time: {end: 0.4}
bodies:
  b: {mass: 10, inertia: 0.5, position: [0, 1], velocity: [0, -1], angular_velocity: 0.8}
points:
  t: {body: b, grid: {list: [[-0.3, 0.9], [0.3, 0.9]]}}
  g: {body: ground, grid: {list: [[-0.3, 0], [0.3, 0]]}}
members:
  g:
    from: t
    to: g
    connect: pairs
    law: {type: gap, side: compression, stiffness: 6000, damping: 40, gap: 0.05, clip: false}
design: {initial: 0.8}
objectives:
  F: {response: {member_force: {group: g}}, over_time: integral}
solver: {tolerance: 1e-9, integrator: runge_kutta}
"""


def test_forces_that_vanish_one_after_the_other_change_hands_twice():
    case = read_case(TOGETHER)
    alpha = np.array([0.8415044629746464, 0.9388241278267757])
    found = evaluate(case, alpha)
    assert found.gradients["F"] == pytest.approx(differences(case, "F", alpha), rel=1e-6)
    tight = evaluate(read_case(TOGETHER, overrides={"solver.tolerance": 1e-12}), alpha)
    assert found.objectives["F"] == pytest.approx(tight.objectives["F"], rel=1e-8)
    assert found.gradients["F"] == pytest.approx(tight.gradients["F"], rel=1e-6)


def test_rounding_does_not_decide_on_which_side_of_zero_a_force_is():
    """Steps end where the force is zero to rounding: of sixty designs all but equal four went wrong."""
    case = read_case(TOGETHER, overrides={"solver.tolerance": 1e-12})
    design = np.array([0.5523017237726272, 0.9636723949525898])
    found = np.array([evaluate(case, design * (1.0 + 1e-9 * k)).gradients["F"] for k in range(examples(30, 60))])
    assert np.abs(found - found[0]).max() < 1e-5 * np.abs(found[0]).max()
    assert np.abs(found[0] - differences(case, "F", design)).max() < 1e-6 * np.abs(found[0]).max()


#: a mass that moves against a tie, and a load of -12 t N that grows: its acceleration is largest where a strap, which
#: pulled it on, goes slack at x = -0.001 m
SLACK = """
format: 1
time: {end: 0.2}
bodies:
  a: {mass: 1, inertia: 1, position: [1, 0], velocity: [-0.1, 0]}
points:
  t: {body: a, grid: {list: [[1, 0], [1, 0]]}}
  g: {body: ground, grid: {list: [[-0.151, 0], [2.1, 0]]}}
members:
  tie: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 20}}
  straps:
    from: t
    to: g
    connect: pairs
    law: {type: gap, stiffness: 400, gap: 0.05, free_length: 1.1}
    design: false
loads:
  - {body: a, force: ["-12*t", 0]}
design: {initial: 0.7}
objectives:
  A: {response: {acceleration: {body: a, component: x}}, over_time: max}
  F: {response: {member_force: {group: straps}}, over_time: integral}
combine: {weights: {A: 1, F: 1}}
"""


@pytest.mark.parametrize("tolerance", [1e-9, 1e-10, 1e-11])
def test_a_peak_at_an_event_moves_with_it_where_an_integral_has_a_kink_there_too(tolerance):
    def largest(alpha):
        w = np.sqrt(20.0 * alpha + 400.0)  # x'' = -12 t - 0.4 - w^2 x
        rest, drift = -0.4 / w**2, -12.0 / w**2

        def beyond(t):
            return rest + drift * t - rest * np.cos(w * t) + (-0.1 - drift) / w * np.sin(w * t) + 0.001

        return -12.0 * brentq(beyond, 0.0, 0.05, xtol=1e-16) + 20.0 * alpha * 0.001

    found = evaluate(read_case(SLACK, overrides={"solver.tolerance": tolerance}))
    assert found.objectives["A"] == pytest.approx(largest(0.7), rel=1e-8)
    h = 1e-3
    near, far = ((largest(0.7 + k * h) - largest(0.7 - k * h)) / (2.0 * k * h) for k in (1.0, 2.0))
    assert found.gradients["A"][0] == pytest.approx((4.0 * near - far) / 3.0, rel=1e-6)


#: a mass on two springs across each other: its acceleration, speed and distance turn round near zero, never at it
NEARLY = """
format: 1
time: {end: 2}
bodies:
  a: {mass: 1, inertia: 1, position: [2, 0], velocity: [1, ASIDE]}
members:
  s: {from: {body: ground, at: [-5, 0]}, to: {body: a, at: [2, 0]}, law: {type: spring, stiffness: 9}}
  u: {from: {body: ground, at: [2, 7]}, to: {body: a, at: [2, 0]}, law: {type: spring, stiffness: 6}}
design: {initial: 1}
objectives:
  A: {response: {acceleration: {body: a}}, over_time: mean}
  V: {response: {velocity: {body: a}}, over_time: mean}
  D: {response: {displacement: {body: a}}, over_time: mean}
combine: {weights: {A: 1, V: 1, D: 1}, normalize: false}
solver: {integrator: runge_kutta, tolerance: 1e-13}
"""


def means_by_quadrature(case):
    """The three means from the motion alone, by panels that are halved until they no longer change."""
    motion = simulate(case)
    nodes, weights = np.polynomial.legendre.leggauss(16)

    def panel(low, high):
        at = motion.at(0.5 * (low + high) + 0.5 * (high - low) * nodes)
        sizes = [np.hypot(x[:, 0], x[:, 1]) for x in (at.a, at.v, at.q - motion.q[0])]
        return 0.5 * (high - low) * np.array([weights @ size for size in sizes])

    edges = np.linspace(0.0, 2.0, 41)
    left = [(low, high, panel(low, high)) for low, high in pairwise(edges)]
    total = np.zeros(3)
    while left:
        low, high, whole = left.pop()
        middle = 0.5 * (low + high)
        halves = panel(low, middle), panel(middle, high)
        if np.abs(sum(halves) - whole).max() < 1e-14 or high - low < 1e-7:
            total += sum(halves)
        else:
            left += [(low, middle, halves[0]), (middle, high, halves[1])]
    return dict(zip("AVD", total / 2.0, strict=True))


@pytest.mark.parametrize("aside", [1e-4, 1e-2, 0.03, 0.1, 0.3, 1.0])
def test_means_of_norms_that_come_near_zero_are_right_to_the_tolerance(aside):
    text = NEARLY.replace("ASIDE", repr(aside))
    exact = means_by_quadrature(read_case(text))
    for tolerance in (1e-6, 1e-8, 1e-10):
        found = evaluate(read_case(text, overrides={"solver.tolerance": tolerance}), gradient=False)
        for name, value in exact.items():
            assert found.objectives[name] == pytest.approx(value, rel=3 * tolerance), (name, tolerance)


@pytest.mark.parametrize("method", ["adjoint", "direct"])
@pytest.mark.parametrize("aside", [0.03, 0.3])
def test_gradients_of_means_of_norms_that_come_near_zero_are_those_of_the_values(aside, method):
    text = NEARLY.replace("ASIDE", repr(aside))
    alpha = np.array([0.9, 0.8])
    tight = read_case(text)
    found = evaluate(read_case(text, overrides={"solver.tolerance": 1e-10}), alpha, method=method)
    for name in "AVD":
        slope = differences(tight, name, alpha, 1e-4)
        assert np.abs(found.gradients[name] - slope).max() <= 1e-7 * np.abs(slope).max(), name


#: what swings past a point of rest: its speed and acceleration come near zero several times
NEAR_ZERO = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0.1]}}
members:
  s: {from: {body: ground, at: [-5, 0]}, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 9, preload: 1}}
  u: {from: {body: ground, at: [1, 7]}, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 6}}
design: {initial: 1}
objectives:
  V: {response: {velocity: {body: a}}, over_time: integral}
  A: {response: {acceleration: {body: a}}, over_time: mean}
combine: {weights: {V: 1, A: 1}}
"""


@pytest.mark.parametrize("name", ["V", "A"])
def test_gradients_of_integrals_hold_the_tolerance_where_a_norm_comes_near_zero(name):
    """Near zero derivatives bend more sharply than values: steps that are good for these are not for those."""
    found = evaluate(read_case(NEAR_ZERO))
    exact = evaluate(read_case(NEAR_ZERO, overrides={"solver.tolerance": 1e-12}))
    assert found.objectives[name] == pytest.approx(exact.objectives[name], rel=1e-8)
    largest = np.abs(exact.gradients[name]).max()
    assert found.gradients[name] == pytest.approx(exact.gradients[name], abs=1e-7 * largest)


#: a body that nothing slows down passes by: the error of its motion is zero with any step
PASSING = """
format: 1
time: {end: 1}
bodies: {a: {mass: MASS, inertia: MASS, position: [0, 0], velocity: [5, 0]}}
members:
  g: {from: {body: ground, at: [1.5, 0.3]}, to: {body: a, at: [0, 0]}, law: LAW}
design: {initial: 1}
objectives:
  E: {response: energy, over_time: OVER}
"""


@pytest.mark.parametrize("law", ["{type: cubic, stiffness: 1, cubic: 1e-30}", "{type: spring, stiffness: 1}"])
@pytest.mark.parametrize("over_time", ["mean", "rms", "integral"])
def test_integrals_hold_the_tolerance_where_the_motion_does_not_feel_what_is_integrated(over_time, law):
    """G = integral of k (L - L0)^2 / 2 and its power over a straight way; G is linear in alpha."""
    from scipy.integrate import quad

    def stored(t):
        return 0.5 * (np.hypot(1.5 - 5.0 * t, 0.3) - np.hypot(1.5, 0.3)) ** 2

    power = 2 if over_time == "rms" else 1
    value = sum(quad(lambda t: stored(t) ** power, a, b, epsabs=1e-14)[0] for a, b in ((0, 0.3), (0.3, 0.6), (0.6, 1)))
    value = np.sqrt(value) if over_time == "rms" else value
    text = PASSING.replace("OVER", over_time).replace("LAW", law).replace("MASS", "1.0e12")
    found = evaluate(read_case(text))
    assert found.objectives["E"] == pytest.approx(value, rel=5e-8)
    assert found.gradients["E"] == pytest.approx([value], rel=5e-8)


def test_what_oscillates_within_a_step_is_integrated_beside_many_short_steps():
    """A slider does not feel the load across it, and a table gives another body 100 short steps in the first second."""
    table = [[k / 100, float(k * k % 7)] for k in range(101)] + [[301.0, 0.0]]
    case = f"""
format: 1
time: {{end: 300}}
bodies:
  a: {{mass: 1, inertia: 1, position: [0, 0], velocity: [0.3, 0]}}
  b: {{mass: 1, inertia: 1, position: [0, 5]}}
joints: [{{name: p, type: prismatic, bodies: [ground, a], at: [0, 0], axis: [1, 0]}}]
loads: [{{body: a, force: [0, "sin(7*t)"]}}, {{body: b, force: [{{table: {table}}}, 0]}}]
objectives: {{F: {{response: {{joint_force: {{joint: p}}}}, over_time: mean}}}}
solver: {{tolerance: 1e-6, integrator: runge_kutta}}
"""
    halves, rest = divmod(7.0 * 300.0, np.pi)
    mean = (2.0 * halves + 1.0 - np.cos(rest)) / 7.0 / 300.0
    assert evaluate(read_case(case)).objectives["F"] == pytest.approx(mean, rel=1e-6)


def test_the_energy_of_a_driven_body_is_integrated_to_the_tolerance():
    text = PASSING.replace("OVER", "mean").replace("LAW", "{type: spring, stiffness: 1, damping: 0.1}")
    text += "motions: [{body: a, x: {velocity: 5}, y: {velocity: 0}, angle: {velocity: 0}}]\n"
    free = PASSING.replace("OVER", "mean").replace("LAW", "{type: cubic, stiffness: 1, cubic: 1e-30}")
    found = evaluate(read_case(text.replace("MASS", "1")))
    other = evaluate(read_case(free.replace("MASS", "1.0e12"), overrides={"solver.tolerance": 1e-12}))
    assert found.objectives["E"] == pytest.approx(other.objectives["E"], rel=1e-8)
    assert found.gradients["E"] == pytest.approx(other.gradients["E"], rel=1e-8)


HELD = """
format: 1
gravity: [0, -9.81]
time: {end: 0.8}
bodies: {a: {mass: 1, inertia: 0.3, position: [0.2, 0.1]}}
joints:
  - {name: j, type: prismatic, bodies: [ground, a], at: [-0.4, 0.3], axis: [0.53, 0.4]}
members:
  s: {from: {body: ground, at: [-1, 1]}, to: {body: a, at: [0.3, 0.4]}, law: {type: spring, stiffness: 60, damping: 1}}
design: {initial: 1}
objectives:
  A: {response: {angular_velocity: {body: a}}, over_time: rms}
  B: {response: {angle: {body: a}}, over_time: rms}
  V: {response: {velocity: {body: a}}, over_time: rms}
combine: {weights: {A: 1, B: 1, V: 1}}
"""


def test_what_joints_hold_at_zero_takes_no_more_steps():
    """Rounding is no polynomial however short steps are: it is not what they are halved for."""
    only = HELD.replace("  A: {response: {angular_velocity: {body: a}}, over_time: rms}\n", "")
    only = only.replace("  B: {response: {angle: {body: a}}, over_time: rms}\n", "").replace("A: 1, B: 1, ", "")
    found = evaluate(read_case(HELD))
    assert abs(found.objectives["A"]) < 1e-12
    assert found.work["steps"] == evaluate(read_case(only)).work["steps"]


@pytest.mark.parametrize("over_time", ["mean", "rms"])
def test_a_member_whose_length_joints_hold_has_no_force_on_average(over_time):
    """Between states it has one, by how much joints are missed there: no step can be halved until that is smooth."""
    member = "  t: {from: {body: a, at: [0.3, 0.4]}, to: {body: b, at: [0.9, 0]}, law: {type: spring, stiffness: 90}}\n"
    text = HELD.replace(
        "position: [0.2, 0.1]}", "position: [0.2, 0.1]}, b: {mass: 1, inertia: 0.2, position: [0.8, 0.2]}"
    )
    text = text.replace("joints:\n", "joints:\n  - {type: fixed, bodies: [a, b]}\n").replace(
        "prismatic, ", "revolute, "
    )
    text = text.replace(", axis: [0.53, 0.4]", "").replace("design:", member + "design:")
    text = text[: text.index("objectives:")]
    force = evaluate(
        read_case(f"{text}objectives: {{F: {{response: {{member_force: {{group: t}}}}, over_time: {over_time}}}}}")
    )
    place = evaluate(read_case(f"{text}objectives: {{F: {{response: {{angle: {{body: b}}}}, over_time: final}}}}"))
    assert force.status.ok
    assert abs(force.objectives["F"]) < 90 * 1e-8
    assert force.work["steps"] == place.work["steps"]


#: two bodies that are fixed to each other hang on a pin; members between them carry nothing
FIXED = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies:
  a: {mass: 1, inertia: 0.2, position: [0.5, 0]}
  b: {mass: 2, inertia: 0.5, position: [1.5, 0.2]}
joints:
  - {type: revolute, bodies: [ground, a], at: [0, 0]}
  - {type: fixed, bodies: [a, b]}
points:
  p: {body: a, grid: {list: [[0.1, 0.3], [0.7, 0.2]]}}
  q: {body: b, grid: {list: [[1.4, 0.5], [1.9, -0.3], [1.2, 0.1]]}}
members:
  g: {from: p, to: q, law: {type: spring, stiffness: 60, damping: 1}}
  s: {from: {body: ground, at: [0.5, -1]}, to: {body: b, at: [1.5, 0.2]}, law: {type: spring, stiffness: 90}}
design: {initial: 1}
objectives:
  F: {response: {member_force: {group: g}}, over_time: mean}
  U: {response: {displacement: {body: b, relative_to: a, component: x}}, over_time: rms}
combine: {weights: {F: 1, U: 1}}
"""


def test_forces_that_joints_hold_at_zero_take_no_more_steps_where_another_integral_has_taken_short_ones():
    """In short steps there is no telling from values that a force is rounding."""
    found = evaluate(read_case(FIXED))
    assert found.status.ok, found.message
    alone = FIXED.replace("  F: {response: {member_force: {group: g}}, over_time: mean}\n", "")
    alone = evaluate(read_case(alone.replace("{F: 1, U: 1}", "{U: 1}")))
    assert found.work["steps"] == alone.work["steps"]
    assert abs(found.objectives["F"]) < 60 * 1e-8
    assert found.objectives["U"] == alone.objectives["U"]


@pytest.mark.parametrize("response", ["{member_force: {group: g}}", "{acceleration: {body: b, relative_to: a}}"])
@pytest.mark.parametrize("slides", [False, True])
def test_forces_and_accelerations_that_joints_hold_at_zero_have_a_mean(slides, response):
    """Where the bodies slide without turning these are rounding between states, too."""
    text = FIXED.replace("{member_force: {group: g}}", response)
    if slides:
        text = text.replace(
            "revolute, bodies: [ground, a], at: [0, 0]", "prismatic, bodies: [ground, a], at: [0, 0], axis: [1, 2]"
        )
    found, still = evaluate(read_case(text)), evaluate(read_case(text.replace(response, "{velocity: {body: b}}")))
    assert found.status.ok, found.message
    assert found.work["steps"] <= still.work["steps"]
    assert abs(found.objectives["F"]) < 1e-6


STILL = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 1, inertia: 0.2, position: [0.5, 0]}
  b: {mass: 2, inertia: 0.5, position: [1.5, 0.2]}
joints:
  - {type: fixed, bodies: [ground, a], at: [0, 0]}
  - {name: free, type: fixed, bodies: [a, b]}
members:
  g: {from: {body: a, at: [0.1, 0.3]}, to: {body: b, at: [1.4, 0.5]}, law: {type: spring, stiffness: 60}}
loads:
  - {body: a, force: FORCE}
design: {initial: 1}
objectives:
  F: {response: RESPONSE, over_time: mean}
"""


@pytest.mark.parametrize("response", ["{member_force: {group: g}}", "{joint_force: {joint: free}}"])
@pytest.mark.parametrize(
    "force",
    ["[1000, 0]", "{table: [[0, 0, 0], [1, 1000, 0]]}", '[0, "1000*sin(5*t)^2"]'],
    ids=["constant", "table", "formula"],
)
def test_what_joints_hold_at_zero_in_a_scene_at_rest_takes_few_steps_whatever_its_loads(response, force):
    """The joint between the bodies carries nothing; the load goes into the ground by the other one."""
    found = evaluate(read_case(STILL.replace("RESPONSE", response).replace("FORCE", force)), gradient=False)
    assert found.status.ok, found.message
    assert found.work["steps"] <= 30
    assert abs(found.objectives["F"]) < 1e-9


WELDED = """
format: 1
time: {end: END}
bodies:
  a: {mass: 2, inertia: 1, position: [0, 0]}
joints:
  - {name: j, type: fixed, bodies: [ground, a], at: [0, 0]}
loads:
  - {body: a, force: ["LOAD", 0]}
objectives:
  f: {response: {joint_force: {joint: j}}, over_time: OVER}
"""


@pytest.mark.parametrize(
    ("load", "end", "over", "exact"),
    [
        ("10*sin(2*pi*5*t)", 1, "rms", 10 / np.sqrt(2)),
        ("10*sin(2*pi*5*t)", 1, "mean", 20 / np.pi),
        ("10*(1-cos(2*pi*10*t))", 1, "mean", 10.0),
        ("100*exp(-((t-0.3)/0.05)^2)", 1, "integral", 5 * np.sqrt(np.pi)),
        ("100*t*exp(-30*t)", 1, "mean", 1 / 9),
    ],
)
def test_a_force_that_is_zero_where_steps_end_is_not_taken_for_one_that_joints_hold_at_zero(load, end, over, exact):
    """Nothing moves, so that one step is the whole motion; the load is zero, or as good as zero, at its ends."""
    text = WELDED.replace("END", str(end)).replace("LOAD", load).replace("OVER", over)
    assert evaluate(read_case(text), gradient=False).objectives["f"] == pytest.approx(exact, rel=3e-6)


@pytest.mark.parametrize(("tolerance", "most"), [(1e-6, 1e-2), (1e-8, 1e-4), (1e-6, 1e-8)])
def test_a_pulse_on_one_body_beside_a_much_faster_one_is_no_rounding(tolerance, most):
    text = f"""
format: 1
time: {{end: 1}}
bodies:
  car: {{mass: 1000, inertia: 1000, position: [0, 0], velocity: [20, 0]}}
  part: {{mass: 1, inertia: 1, position: [2, 0]}}
loads:
  - {{body: part, force: [0, "{most}*exp(-((t-0.43)/0.02)^2)"]}}
  - {{body: car, force: [-8000, 0]}}
objectives: {{a: {{response: {{acceleration: {{body: part, component: y}}}}, over_time: mean}}}}
solver: {{tolerance: {tolerance}}}
"""
    found = evaluate(read_case(text), gradient=False).objectives["a"]
    assert found == pytest.approx(most * 0.02 * np.sqrt(np.pi), rel=10 * tolerance)


@pytest.mark.parametrize("response", ["energy", "{member_force: {group: g}}"])
def test_integrals_are_followed_in_scenes_of_any_force(response):
    """What counts as rounding is relative to the scene: tiny forces and energies of tiny bodies are not."""

    def mean_square(unit):
        text = PASSING.replace("MASS", repr(unit)).replace("energy", response).replace("OVER", "rms")
        law = f"{{type: spring, stiffness: {2e-3 * unit!r}, damping: {1e-6 * unit!r}}}"
        case = read_case(text.replace("LAW", law), overrides={"solver.integrator": "runge_kutta"})
        return evaluate(case, gradient=False).objectives["E"] / unit

    assert mean_square(2.0**-46) == pytest.approx(mean_square(1.0), rel=1e-9)


#: an arm that swings there and back: every point of it comes to rest at the turns
ARM = """
format: 1
time: {end: 0.8}
bodies:
  arm: {mass: 0.94, inertia: 0.138, position: [0, -0.14]}
joints:
  - {name: p, type: revolute, bodies: [ground, arm], at: [-0.22, 0.115]}
loads:
  - {body: arm, moment: {table: [[0, -2.4], [0.2, 7.2], [0.5, 2.2], [0.8, 2.4]]}}
points:
  p: {body: ground, grid: {list: [[0.49, 0.5], [-1.75, 0.74], [-1.53, 0.16]]}}
  q: {body: arm, grid: {list: [[-0.135, -0.285], [-0.087, 0.13], [-0.07, 0]]}}
members:
  g: {from: p, to: q, connect: pairs, law: {type: spring, stiffness: 92, damping: 3.3}}
design: {initial: 1}
objectives:
  F: {response: {velocity: {body: arm, at: [0.37, 0.07]}}, over_time: integral}
solver: {integrator: runge_kutta}
"""


@pytest.mark.parametrize("alpha", [[0.865, 1.436, 0.387], [0.54, 0.588, 1.258], [0.311, 0.508, 1.242]])
def test_a_vector_that_passes_zero_has_its_direction_on_either_side_at_any_tolerance(alpha):
    """The last stages of a step are off by more than the step: long steps beside the zero were wrong by thousands."""
    alpha = np.array(alpha)
    exact = evaluate(read_case(ARM, overrides={"solver.tolerance": 1e-12}), alpha).gradients["F"]
    for tolerance in (1e-6, 1e-7, 1e-8, 1e-9):
        found = evaluate(read_case(ARM, overrides={"solver.tolerance": tolerance}), alpha).gradients["F"]
        assert np.abs(found - exact).max() <= 10.0 * tolerance * np.abs(exact).max()
    assert exact == pytest.approx(differences(read_case(ARM), "F", alpha, 1e-3), rel=1e-6)


#: a body on a slider, pushed across it: its motion does not feel the push, so that one step may be the whole motion
PUSHED = """
format: 1
time: {end: END}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0], velocity: [0.3, 0]}}
joints: [JOINT]
loads: [{body: a, force: [0, "sin(7*t)"]}]
objectives: {F: {response: {joint_force: {joint: p}}, over_time: OVER}}
solver: {tolerance: TOL, integrator: runge_kutta}
"""


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("end", [3.0, 30.0])
@pytest.mark.parametrize("joint", ["prismatic", "fixed"])
def test_the_mean_size_of_a_force_that_passes_zero_many_times_in_a_step_follows_the_tolerance(joint, end, tolerance):
    stated = f"{{name: p, type: {joint}, bodies: [ground, a], at: [0, 0]"
    stated += ", axis: [1, 0]}" if joint == "prismatic" else "}"
    text = (
        PUSHED.replace("END", str(end)).replace("JOINT", stated).replace("OVER", "mean").replace("TOL", f"{tolerance}")
    )
    if joint == "fixed":
        text = text.replace(", velocity: [0.3, 0]", "")
    # |sin| has the integral 2 over each half period, and 1 - cos over what is left of the last one
    halves, left = divmod(7.0 * end, np.pi)
    exact = (2.0 * halves + 1.0 - np.cos(left)) / 7.0 / end
    found = evaluate(read_case(text), gradient=False).objectives["F"]
    assert found == pytest.approx(exact, rel=max(3.0 * tolerance, 1e-11))
