"""Laws of formulas in scenes: the same as the built-in laws, and gradients through their kinks against differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import beta

import mdstopo
from mdstopo.case.reader import read_case
from tests.variables.support import differences, whole

#: nothing in it is symmetric, and the force that is looked at is that of one member: of equal forces none is the
#: largest
PLANE = """
format: 1
gravity: [0, -9.81]
time: {end: 0.5}
bodies:
  load: {mass: 20, inertia: 0.5, position: [0, 0], velocity: [1, 0.4], angular_velocity: 1.5}
points:
  corners: {body: load, grid: {list: [[0.2, 0.2], [-0.21, 0.17], [0.19, -0.2], [-0.23, -0.22]]}}
  hooks: {body: ground, grid: {list: [[-1, 1.05], [1.1, 1]]}}
  corner: {body: load, grid: {list: [[0.1, -0.2]]}}
  hook: {body: ground, grid: {list: [[1, 0.9]]}}
members:
  belts: {from: corners, to: hooks, law: LAW}
  tie: {from: corner, to: hook, law: TIE}
  straps: {from: corners, to: hooks, law: {type: spring, stiffness: 2000}}
design: {initial: 0.5, variables: {VARIABLES}}
solver: {integrator: runge_kutta, tolerance: 1e-8}
objectives:
  G: {response: energy}
  H: {response: {acceleration: {body: load}}, over_time: mean}
  F: {response: {member_force: {group: tie}}, over_time: mean}
combine: {weights: {G: 1, H: 1, F: 1}, normalize: false}
"""
_BODY = "inertia: [0.5, 0.4, 0.6], position: [0, 0, 0], velocity: [1, 0.4, 0.2], angular_velocity: [0.4, 1, 1.5]}"
_CORNERS = "{list: [[0.2, 0.2, 0], [-0.2, 0.2, 0.1], [0.2, -0.2, 0], [-0.2, -0.1, 0.2]]}"
_PLANAR_BODY = "inertia: 0.5, position: [0, 0], velocity: [1, 0.4], angular_velocity: 1.5}"
_PLANAR_CORNERS = "{list: [[0.2, 0.2], [-0.21, 0.17], [0.19, -0.2], [-0.23, -0.22]]}"
SPACE = (
    PLANE.replace("format: 1", "format: 1\ndimension: 3")
    .replace("gravity: [0, -9.81]", "gravity: [0, -9.81, 0]")
    .replace(_PLANAR_BODY, _BODY)
    .replace(_PLANAR_CORNERS, _CORNERS)
    .replace("[[0.1, -0.2]]", "[[0.1, -0.2, 0.1]]")
    .replace("[[1, 0.9]]", "[[1, 0.9, 0.2]]")
    .replace("[[-1, 1.05], [1.1, 1]]", "[[-1, 1, 0.3], [1, 1, -0.4], [0.1, 1.2, 1]]")
)
PAIRS = {
    "gap": (
        "{type: gap, stiffness: 8000, damping: 60, gap: 0.02}",
        '{type: expression, force: "if(x >= g, k*(x - g) + c*xd, 0)", energy: "if(x >= g, k*(x - g)^2/2, 0)",'
        " parameters: {k: 8000, c: 60, g: 0.02}}",
        {"stiffness": "k", "damping": "c", "gap": "g", "free_length": "free_length"},
    ),
    "clipped": (
        "{type: gap, stiffness: 8000, damping: 60, gap: 0.02, clip: true}",
        '{type: expression, force: "if(x >= g, max(k*(x - g) + c*xd, 0), 0)", energy: "k*max(x - g, 0)^2/2",'
        " parameters: {k: 8000, c: 60, g: 0.02}}",
        {"stiffness": "k", "damping": "c", "gap": "g"},
    ),
    "cubic": (
        "{type: cubic, stiffness: 800, cubic: 20000}",
        '{type: expression, energy: "k*x^2/2 + b*x^4/4", parameters: {k: 800, b: 2e4}}',
        {"stiffness": "k", "cubic": "b"},
    ),
    "actuator": (
        "{type: actuator, proportional: 800, derivative: 20, target: 0.05, limit: 60}",
        '{type: expression, force: "clip(p*(x - a) + d*xd, -f, f)", parameters: {p: 800, d: 20, a: 0.05, f: 60}}',
        {"proportional": "p", "derivative": "d", "target": "a", "limit": "f"},
    ),
    "spring": (
        "{type: spring, stiffness: 800, damping: 20, preload: 3}",
        '{type: expression, force: "k*x + c*xd + p", energy: "k*x^2/2", parameters: {k: 800, c: 20, p: 3}}',
        {"stiffness": "k", "damping": "c", "preload": "p"},
    ),
}
#: what gradients may differ by, relative to the largest: generalized_alpha solves its equations to a tolerance
EQUAL = {"runge_kutta": 1e-12, "generalized_alpha": 1e-10}
BOUNDS = {"free_length": "initial: 1.2, lower: 0.5, upper: 2"}


def scene(text: str, law: str, parameters: Any, tie: str = "", **solver: object) -> Any:
    """The case with a law, and with some of its parameters as variables; tie: the law of one member beside."""
    variables = ", ".join(
        f"{group}_{i}: {{group: {group}, parameter: {word}, {BOUNDS.get(word, 'lower: 0.001, upper: 30000')}}}"
        for group in ("belts", "tie")
        for i, word in enumerate(parameters)
    )
    case = text.replace("LAW", law).replace("TIE", tie or law).replace("VARIABLES", variables)
    return read_case(case, overrides={f"solver.{key}": value for key, value in solver.items()})


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize("kind", PAIRS)
def test_built_in_laws_written_as_formulas_give_the_same_scene(kind: str, integrator: str) -> None:
    built_in, formulas, words = PAIRS[kind]
    one = mdstopo.evaluate(scene(PLANE, built_in, words, integrator=integrator))
    other = mdstopo.evaluate(scene(PLANE, formulas, words.values(), integrator=integrator))
    assert one.status.ok
    assert other.status.ok
    for name in one.objectives:
        assert other.objectives[name] == pytest.approx(one.objectives[name], rel=1e-12)
        of_one, of_other = whole(one, name), whole(other, name)
        assert np.abs(of_other - of_one).max() <= EQUAL[integrator] * np.abs(of_one).max()


#: what each is: see `test_expression_kernels`
FORMULAS = {
    "hunt_crossley": ("if(x > 0, k*x^n*(1 + d*xd), 0)", {"k": 4e3, "n": 1.5, "d": 0.4}),
    "brown_mcphee": (
        "N*(mu*tanh(4*xd/v) + (ms - mu)*(xd/v)/((xd/v)^2/4 + 3/4)^2)",
        {"N": 50.0, "mu": 0.2, "ms": 0.4, "v": 0.5},
    ),
    "two_slopes": ("sign(x)*min(k*abs(x), k*y + h*(abs(x) - y)) + c*xd", {"k": 900.0, "h": 90.0, "y": 0.03, "c": 4.0}),
    "switched": ("a*step(t - when)*x + b*max(0, sin(w*t))*l", {"a": 400.0, "when": 0.17, "b": 30.0, "w": 20.0}),
    "length": ("k*log(l/l0)*l0 + c*xd/l", {"k": 900.0, "c": 2.0}),
}


def check_gradients(text: str, kind: str, bound: float, **solver: object) -> None:
    """Gradients by all values against differences of a tight run, and by both methods."""
    force, parameters = FORMULAS[kind]
    laws = []
    for share in (1.0, 1.07):  # what switches at the same time has no derivative
        stated = ", ".join(f"{word}: {share * value}" for word, value in parameters.items())
        laws.append(f'{{type: expression, force: "{force}", parameters: {{{stated}}}}}')
    words = [*parameters, *(["free_length"] if kind == "length" else [])]
    case = scene(text, laws[0], words, laws[1], tolerance=1e-12, **solver)
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, method="direct")
    start = np.concatenate([case.initial, *(np.full(each.count, each.initial) for each in case.variables)])
    values = start[case.n_design :]
    shares = np.concatenate([np.ones(case.n_design), np.abs(values)])
    rng = np.random.default_rng(4)
    direction = 0.3 * rng.normal(size=len(start)) * shares
    slopes = differences(case, start, direction, 2e-4)
    for name in found.objectives:
        gradient = whole(found, name)
        assert abs(slopes[name] - gradient @ direction) <= bound * np.abs(gradient * direction).max(), name
        assert whole(direct, name) == pytest.approx(gradient, abs=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("kind", FORMULAS)
def test_gradients_through_kinks_are_slopes(kind: str) -> None:
    check_gradients(PLANE, kind, 1e-7)


@pytest.mark.parametrize("kind", ["hunt_crossley", "switched"])
def test_gradients_in_space_are_slopes(kind: str) -> None:
    check_gradients(SPACE, kind, 1e-7)


def test_a_formula_compiles_nothing_of_the_kernels_and_its_numbers_nothing_at_all() -> None:
    from mdstopo.compiler import formulas

    formulas.address_of.cache_clear()
    engines = len(formulas._ENGINES)
    law = '{{type: expression, force: "k*x + {0}*xd + k*x^3", parameters: {{k: {1}}}}}'
    for k in (500.0, 600.0, 700.0):
        assert mdstopo.evaluate(scene(PLANE, law.format("c0", k).replace("c0", "3"), [])).status.ok
    assert len(formulas._ENGINES) == engines + 1


#: a load of 2 kg that moves along a line away from a hook, or towards it; Delta is -0.1 m (or REST less than 1 m) first
ONE = """
format: 1
gravity: [0, 0]
time: {end: 0.35}
bodies: {load: {mass: 2, inertia: 1, position: [0, 0], velocity: [SPEED, 0]}}
points:
  eye: {body: load, grid: {list: [[0, 0]]}}
  hook: {body: ground, grid: {list: [[1, 0]]}}
members: {rope: {from: eye, to: hook, law: LAW}}
design: {initial: 0.5, variables: {VARIABLES}}
solver: {integrator: runge_kutta, tolerance: 1e-12}
objectives:
  D: {response: {displacement: {body: load, component: x}}, over_time: final}
  A: {response: {acceleration: {body: load}}, over_time: max}
combine: {weights: {D: 1, A: 1}, normalize: false}
"""


def on_a_line(
    force: str, parameters: dict[str, float], rest: float, speed: float, more: str = "", text: str = ONE, **solver: Any
) -> Any:
    """The load on a line, with all parameters as variables.

    force: the formula.
    parameters: its numbers.
    rest: free length (m).
    speed: of the load towards the hook (m/s).
    more: further keys of the law.
    text: the case.
    solver: settings.
    """
    stated = ", ".join(f"{word}: {value}" for word, value in parameters.items())
    law = f'{{type: expression, free_length: {rest}, {more}force: "{force}", parameters: {{{stated}}}}}'
    variables = ", ".join(f"{word}: {{group: rope, parameter: {word}, lower: 0, upper: 9e6}}" for word in parameters)
    text = text.replace("SPEED", str(speed)).replace("LAW", law).replace("VARIABLES", variables)
    return read_case(text, overrides={f"solver.{key}": value for key, value in solver.items()})


@pytest.mark.parametrize(
    ("n", "tolerance", "bound"),
    [(1.5, 1e-6, 2e-6), (1.5, 1e-8, 2e-7), (1.5, 1e-12, 1e-9), (1.2, 1e-8, 1e-6), (2.5, 1e-8, 1e-7)],
)
def test_an_elastic_impact_lasts_as_long_as_its_closed_form_says(n: float, tolerance: float, bound: float) -> None:
    # with k x^n it lasts 2 depth / speed times the integral of (1 - u^(n + 1))^(-1/2) over (0, 1), which is
    # B(1/(n + 1), 1/2) / (n + 1): 2.9433 depth / speed for n = 1.5 (K. L. Johnson, Contact Mechanics, 1985, 11.4);
    # it leaves as fast as it came
    speed, alpha, depth = 1.0, 0.5, 0.03
    k = (n + 1.0) * speed**2 / (alpha * depth ** (n + 1.0))
    found = mdstopo.evaluate(on_a_line("if(x > 0, k*x^n, 0)", {"k": k, "n": n}, 1.1, -speed, tolerance=tolerance))
    assert found.status.ok, found.message
    lasts = 2.0 / (n + 1.0) * beta(1.0 / (n + 1.0), 0.5) * depth / speed
    assert found.objectives["D"] == pytest.approx(-0.1 + speed * (0.35 - 0.1 / speed - lasts), rel=tolerance * 10.0)
    # lasts ~ (alpha k)^(-1/(n + 1))
    slope = speed * lasts / ((n + 1.0) * alpha * k)
    assert found.gradients["D"][0] == pytest.approx(slope * k, rel=bound)
    assert found.variable_gradients["D"]["k"][0] == pytest.approx(slope * alpha, rel=bound)


def test_a_peak_at_a_switch_in_time_moves_with_it() -> None:
    found = mdstopo.evaluate(on_a_line("if(t < when, a*t, 0)", {"a": 900.0, "when": 0.2}, 1.1, 0.1))
    assert found.status.ok, found.message
    assert found.objectives["A"] == pytest.approx(0.5 * 900.0 * 0.2 / 2.0, rel=1e-12)
    assert found.variable_gradients["A"]["a"][0] == pytest.approx(0.5 * 0.2 / 2.0, rel=1e-12)
    assert found.variable_gradients["A"]["when"][0] == pytest.approx(0.5 * 900.0 / 2.0, rel=1e-11)
    # D = v t + the integral of (end - t) alpha a t / m up to `when`
    moved = 0.25 * 900.0 * (0.35 * 0.2**2 / 2.0 - 0.2**3 / 3.0)
    assert found.objectives["D"] == pytest.approx(0.1 * 0.35 + moved, rel=1e-11)
    assert found.variable_gradients["D"]["when"][0] == pytest.approx(0.25 * 900.0 * 0.2 * (0.35 - 0.2), rel=1e-11)


def test_a_force_of_time_alone_peaks_where_its_slope_by_time_is_zero() -> None:
    # at the peak the slope by time is zero, so that slopes by parameters are those at a fixed time
    a, r, w = 40.0, 9.0, 11.0
    text = ONE.replace("{acceleration: {body: load}}", "{member_force: {group: rope}}")
    looked = mdstopo.evaluate(on_a_line("a*(1 - exp(-r*t))*sin(w*t)", {"a": a, "r": r, "w": w}, 1.1, 0.1, text=text))
    peak = brentq(lambda t: r * np.exp(-r * t) * np.sin(w * t) + (1 - np.exp(-r * t)) * w * np.cos(w * t), 0.1, 0.2,
                  xtol=1e-15)  # fmt: skip
    share, wave = 1.0 - np.exp(-r * peak), np.sin(w * peak)
    assert looked.objectives["A"] == pytest.approx(0.5 * a * share * wave, rel=1e-13)
    slopes = {"a": share * wave, "r": a * peak * (1.0 - share) * wave, "w": a * share * peak * np.cos(w * peak)}
    for word, slope in slopes.items():
        assert looked.variable_gradients["A"][word][0] == pytest.approx(0.5 * slope, rel=1e-11)


def test_a_switch_in_time_that_passes_before_the_law_acts_moves_nothing() -> None:
    case = on_a_line("a*step(t - when)", {"a": 90.0, "when": 0.05}, 1.1, 0.1, "active_from: 0.1, ")
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    assert found.objectives["D"] == pytest.approx(0.1 * 0.35 + 0.25 * 90.0 * 0.25**2 / 2.0, rel=1e-11)
    assert found.variable_gradients["D"]["when"][0] == 0.0


def test_a_slope_that_is_infinite_is_no_gradient() -> None:
    case = on_a_line("k*sqrt(max(x, 0))", {"k": 1.0}, 0.9, 0.5)
    found = mdstopo.evaluate(case)
    assert found.status.name == "NO_GRADIENT"
    assert found.message == "a slope of a formula of group rope is infinite or has no value"
    assert np.isfinite(found.objectives["D"])


def test_a_formula_without_a_value_stops_the_motion() -> None:
    found = mdstopo.evaluate(on_a_line("k*sqrt(x)", {"k": 1.0}, 0.9, 0.5))
    assert not found.status.usable
    assert "at t = 0.1" in found.message or "at t = 0.2" in found.message
    assert mdstopo.evaluate(on_a_line("k*sqrt(x)", {"k": 1.0}, 0.9, -0.5)).status.ok


def test_a_force_that_comes_by_time_alone_is_seen_while_everything_is_at_rest() -> None:
    """m x'' = b max(0, sin(w t - p)): the force is off at the start, and nothing moves until it comes."""
    text = """
    format: 1
    time: {end: 1}
    bodies: {mass: {mass: 2, inertia: 1, position: [0, 0]}}
    members:
      push:
        from: {body: ground, at: [-1, 0]}
        to: {body: mass, at: [0, 0]}
        law: {type: expression, force: "-b*max(0, sin(w*t - p))", parameters: {b: 50, w: 50, p: 1}}
    design: {initial: 1, lower: 1, upper: 1}
    objectives: {G: {response: {velocity: {body: mass, component: x}}, over_time: final}}
    solver: {tolerance: 1.0e-10}
    """
    t = np.linspace(0.0, 1.0, 2_000_001)
    expected = np.trapezoid(25.0 * np.maximum(0.0, np.sin(50.0 * t - 1.0)), t)
    found = mdstopo.evaluate(read_case(text))
    assert found.objectives["G"] == pytest.approx(expected, rel=1e-8)
