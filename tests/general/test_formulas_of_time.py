"""Loads and motions that are formulas of time: the same as tables, kinks where they are, and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mdstopo
from mdstopo.case.arrays import TimeFormula
from mdstopo.case.keys.signals import combined
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.general.scene.driven_integrals import integrated_ends, integration_times, row_of_motion
from tests.variables.support import differences

PLANE = """
format: 1
gravity: [0, -9.81]
time: {end: 0.4}
bodies:
  load: {mass: 20, inertia: 0.5, position: [0, 0], angle: 0.3, velocity: [2, 0.4], angular_velocity: 1.5}
points:
  corners: {body: load, grid: {list: [[0.2, 0.2], [-0.21, 0.17], [0.19, -0.2], [-0.23, -0.22]]}}
  hooks: {body: ground, grid: {list: [[-1, 1.05], [1.1, 1]]}}
members:
  belts: {from: corners, to: hooks, law: {type: spring, stiffness: 2000, damping: 20}}
loads: [LOAD]
design: {initial: 0.5}
objectives:
  G: {response: {acceleration: {body: load}}}
  H: {response: {displacement: {body: load, component: x}}, over_time: final}
combine: {weights: {G: 1, H: 1}, normalize: false}
"""
SPACE = (
    PLANE.replace("format: 1", "format: 1\ndimension: 3")
    .replace("[0, -9.81]", "[0, -9.81, 0]")
    .replace("inertia: 0.5, position: [0, 0], angle: 0.3,", "inertia: [[0.5, 0.1, 0], [0.1, 0.4, 0], [0, 0, 0.6]], ")
    .replace("velocity: [2, 0.4]", "position: [0, 0, 0], velocity: [2, 0.4, 0.2]")
    .replace("angular_velocity: 1.5", "angular_velocity: [0.4, 1, 1.5]")
    .replace("[[0.2, 0.2], [-0.21, 0.17], [0.19, -0.2], [-0.23, -0.22]]", "[[0.2, 0.2, 0], [-0.2, 0.1, 0.1]]")
    .replace("[[-1, 1.05], [1.1, 1]]", "[[-1, 1, 0.3], [1, 1, -0.4]]")
)
#: a table of x and y with kinks and a jump, and the same as formulas
TABLE = "{table: [[0, 0, 20], [0.1, 300, -50], [0.2, 0, -50], [0.2, 0, 100]]}"
X = "max(min(3000*t, 600 - 3000*t), 0)"
Y = "if(t < a, 20 - 700*t, if(t < 0.2, -50, 100))"
FORMULAS = f"{{formula: ['{X}', '{Y}'], parameters: {{a: 0.1}}}}"
IN_PLANE = {
    "force": (f"force: {TABLE}, moment: 5", f"force: {FORMULAS}, moment: '5'"),
    "follower": (f"force: {TABLE}, at: [0.1, 0.2], frame: body", f"force: {FORMULAS}, at: [0.1, 0.2], frame: body"),
    "at_a_point": (f"force: {TABLE}, at: [0.1, 0.2]", f"force: {FORMULAS}, at: [0.1, 0.2]"),
    "acceleration": (
        f"acceleration: {TABLE}, angular_acceleration: {{table: [[0, 0], [0.4, 4]]}}",
        f"acceleration: {FORMULAS}, angular_acceleration: '10*t'",
    ),
}
IN_SPACE_TABLE = "{table: [[0, 0, 20, 3], [0.1, 300, -50, 3], [0.2, 0, -50, 3], [0.2, 0, 100, 3]]}"
IN_SPACE_FORMULAS = f"['{X}', {{formula: '{Y}', parameters: {{a: 0.1}}}}, 3]"
IN_SPACE = {
    "force": (
        f"force: {IN_SPACE_TABLE}, at: [0.1, 0.2, 0.3], moment: {{table: [[0, 0, 1, 5], [0.4, 4, 1, 5]]}}",
        f"force: {IN_SPACE_FORMULAS}, at: [0.1, 0.2, 0.3], moment: ['10*t', '1', 5]",
    ),
    "follower": (
        f"force: {IN_SPACE_TABLE}, at: [0.1, 0.2, 0.3], moment: {{table: [[0, 0, 1, 5], [0.4, 4, 1, 5]]}}, frame: body",
        f"force: {IN_SPACE_FORMULAS}, at: [0.1, 0.2, 0.3], moment: ['10*t', '1', 5], frame: body",
    ),
    "acceleration": (
        f"acceleration: {IN_SPACE_TABLE}, angular_acceleration: {{table: [[0, 0, 1, 5], [0.4, 4, 1, 5]]}}",
        f"acceleration: {IN_SPACE_FORMULAS}, angular_acceleration: ['10*t', '1', '5']",
    ),
    "turning_with_it": (
        "angular_acceleration: {table: [[0, 0, 1, 5], [0.4, 4, 1, 5]]}, frame: body",
        "angular_acceleration: ['10*t', '1', 5], frame: body",
    ),
    "some_by_tables": (
        "angular_acceleration: {table: [[0, 0, 1, 5], [0.4, 4, 1, 5]]}",
        "angular_acceleration: ['10*t', {table: [[0, 1]]}, 5]",
    ),
}


def loaded(text: str, load: str, **solver: object) -> Any:
    """The case with a load."""
    overrides = {f"solver.{key}": value for key, value in solver.items()}
    return read_case(text.replace("LOAD", f"{{body: load, {load}}}"), overrides=overrides)


def assert_same(text: str, pair: tuple[str, str], error: float = 1e-10, **solver: object) -> None:
    """A load by tables and by formulas does the same; error: of gradients."""
    one, other = (mdstopo.evaluate(loaded(text, load, **solver)) for load in pair)
    for name, gradient in one.gradients.items():
        assert other.objectives[name] == pytest.approx(one.objectives[name], rel=1e-12)
        assert np.abs(other.gradients[name] - gradient).max() <= error * np.abs(gradient).max()


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize("kind", IN_PLANE)
def test_a_load_by_formulas_is_that_of_the_table_which_they_repeat(kind: str, integrator: str) -> None:
    # generalized_alpha solves its equations to a tolerance, relative to that of the motion
    tolerance, error = (1e-10, 1e-10) if integrator == "runge_kutta" else (1e-5, 2e-8)
    assert_same(PLANE, IN_PLANE[kind], error, integrator=integrator, tolerance=tolerance)


@pytest.mark.parametrize("kind", IN_SPACE)
def test_in_space_a_load_by_formulas_is_that_of_the_table_which_they_repeat(kind: str) -> None:
    assert_same(SPACE, IN_SPACE[kind], integrator="runge_kutta", tolerance=1e-10)


def test_a_sum_of_formulas_keeps_apart_what_they_have_one_name_for() -> None:
    first = TimeFormula("a*t", (("a", 1.0),))
    second = TimeFormula("a*t + a_*cos(a)", (("a", 2.0), ("a_", 3.0)), 2.0, 0.5)
    matrix = np.array([[0.5, 0.1, 1.0], [0.1, 0.4, 0.0]])
    found = [signal.at(0.3) for signal in combined(matrix, (first, second, 0.7)) if isinstance(signal, TimeFormula)]
    expected = matrix @ [0.3, 2.0 * (2.0 * 0.3 + 3.0 * np.cos(2.0)) + 0.5, 0.7]
    assert found == pytest.approx(expected.tolist(), rel=1e-14)


def test_formulas_that_products_of_inertia_cannot_add_are_refused() -> None:
    def of_numbers(name: str) -> str:
        names = [f"{name}{k}" for k in range(5)]
        numbers = ", ".join(f"{each}: {k + 1}" for k, each in enumerate(names))
        return f"{{formula: '({' + '.join(names)})*t', parameters: {{{numbers}}}}}"

    place = r"loads\[0\]\.angular_acceleration: its products of inertia would add "
    with pytest.raises(CaseError, match=place + "formulas: found 10 parameters, allowed are 8 at most"):
        loaded(SPACE, f"angular_acceleration: [{of_numbers('a')}, {of_numbers('b')}, 0], frame: body")
    with pytest.raises(CaseError, match=place + "a formula and a table: state all as formulas, or none"):
        loaded(SPACE, "angular_acceleration: ['t', {table: [[0, 0], [1, 1]]}, 0], frame: body")


def test_steps_of_collocation_take_loads_by_formulas_too() -> None:
    smooth = "force: ['100*sin(9*t)', '30*t', 3], moment: ['cos(7*t)', 0, 1]"
    one, other = (
        mdstopo.evaluate(loaded(SPACE, smooth, integrator=integrator, tolerance=1e-10))
        for integrator in ("gauss", "runge_kutta")
    )
    for name, gradient in one.gradients.items():
        assert other.objectives[name] == pytest.approx(one.objectives[name], rel=1e-8)
        assert other.gradients[name] == pytest.approx(gradient, abs=1e-7 * np.abs(gradient).max())


def test_gradients_with_a_smooth_load_that_turns_its_body_are_those_of_differences() -> None:
    case = loaded(PLANE, "force: ['400*sin(30*t)^2', '50*exp(-t)'], at: [0.1, 0.2]", tolerance=1e-11)
    design, direction = np.linspace(0.3, 0.9, 8), np.array([1.0, -2.0, 1.5, 0.5, -1.0, 2.0, 1.0, -0.5])
    found, expected = mdstopo.evaluate(case, design), differences(case, design, direction, 1e-3)
    for name, gradient in found.gradients.items():
        assert gradient @ direction == pytest.approx(expected[name], abs=1e-8 * float(np.abs(gradient).sum()))


FREE = """
format: 1
gravity: GRAVITY
time: {start: 0.5, end: 2.5}
bodies: {load: {mass: 20, inertia: 0.5, position: [0, 0], velocity: [0.3, 0]}}
loads: [{body: load, force: FORCE}]
objectives: {G: {response: {displacement: {body: load, component: x}}, over_time: final}}
"""


@pytest.mark.parametrize(
    ("force", "displacement"),
    [
        # x'' = (a/m) sin(w t)
        ("[{formula: 'a*sin(w*t)', parameters: {a: 100, w: 7}}, 0]",
         lambda: 5.0 / 49.0 * (np.sin(3.5) - np.sin(17.5)) + 2.0 * 5.0 / 7.0 * np.cos(3.5)),
        # a jump at 1.1 s
        ("['40*step(t - 1.1)', 0]", lambda: 0.5 * 2.0 * 1.4**2),
        # a ramp from a kink at 2.2 s on, which a margin that is a product finds
        ("['60*max((t - 2.2)*(t + 1), 0)/(t + 1)', 0]", lambda: 3.0 * 0.3**3 / 6.0),
    ],
)  # fmt: skip
def test_a_force_over_time_moves_a_free_body_as_its_integrals_say(force: str, displacement: Any) -> None:
    case = read_case(FREE.replace("GRAVITY", "[0, 0]").replace("FORCE", force), overrides={"solver.tolerance": 1e-12})
    found = mdstopo.evaluate(case)
    assert found.objectives["G"] == pytest.approx(0.3 * 2.0 + displacement(), abs=1e-12)


DRIVEN = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies:
  cart: {mass: 2, inertia: 1, position: [0.1, 0]}
  load: {mass: 20, inertia: 0.5, position: [0.1, -1]}
joints: [{type: revolute, bodies: [cart, load], at: [0.1, 0]}]
points:
  low: {body: load, grid: {list: [[0.1, -1.1]]}}
  hook: {body: ground, grid: {list: [[1, -1], [-1, -1.2]]}}
members: {belts: {from: low, to: hook, law: {type: spring, stiffness: 400, damping: 5}}}
motions:
  - {body: cart, x: {position: POSITION}, y: {velocity: 0}, angle: {velocity: 0}}
design: {initial: 0.5}
solver: {tolerance: 1e-11}
objectives:
  G: {response: {angle: {body: load}}, over_time: max_abs}
  A: {response: {acceleration: {body: cart, component: x}}, over_time: max}
  V: {response: {velocity: {body: cart, component: x}}, over_time: final}
combine: {weights: {G: 1, A: 1, V: 1}, normalize: false}
"""


def test_a_motion_by_a_formula_has_its_rate_and_acceleration_exactly() -> None:
    formula = "{formula: '0.1 + a*sin(w*t)^2', parameters: {a: 0.2, w: 5}}"
    found = mdstopo.evaluate(read_case(DRIVEN.replace("POSITION", formula)))
    assert found.status.ok
    assert found.objectives["A"] == pytest.approx(2.0 * 0.2 * 25.0, rel=1e-12)
    assert found.objectives["V"] == pytest.approx(0.2 * 5.0 * np.sin(10.0), rel=1e-12)


def test_a_motion_by_a_formula_is_that_of_the_cubic_which_it_repeats_with_its_gradients() -> None:
    rows = [[t, 0.1 + 0.4 * t**2 - 0.3 * t**3] for t in np.linspace(0.0, 1.0, 4).tolist()]
    one, other = (
        mdstopo.evaluate(read_case(DRIVEN.replace("POSITION", position)))
        for position in (f"{{table: {rows}}}", "'0.1 + 0.4*t^2 - 0.3*t^3'")
    )
    for name, gradient in one.gradients.items():
        assert other.objectives[name] == pytest.approx(one.objectives[name], rel=1e-9)
        assert other.gradients[name] == pytest.approx(gradient, abs=1e-8 * max(np.abs(gradient).max(), 1e-12))


#: a position, and what its rate and its acceleration are as formulas
RATES = {
    "wave": ("0.1 + a*sin(w*t)^2", "a*w*sin(2*w*t)", "2*a*w^2*cos(2*w*t)", "{a: 0.02, w: 70}"),
    "kink": ("0.1 + a*max(t - w, 0)^2", "2*a*max(t - w, 0)", "2*a*step(t - w)", "{a: 0.3, w: 0.35}"),
    "slow": ("0.1 + a*(exp(-t) - 1 + w*t)", "a*(w - exp(-t))", "a*exp(-t)", "{a: 0.3, w: 1}"),
    "beginning with a root": ("0.1 + a*t^2.5*w", "2.5*a*t^1.5*w", "3.75*a*t^0.5*w", "{a: 0.3, w: 1}"),
}


@pytest.mark.parametrize("kind", RATES)
def test_a_motion_by_its_velocity_or_its_acceleration_is_the_integral(kind: str) -> None:
    position, velocity, acceleration, parameters = RATES[kind]
    text = DRIVEN.replace(
        "objectives:",
        """objectives:
  X: {response: {displacement: {body: cart, component: x}}, over_time: final}
  N: {response: {velocity: {body: load}}, over_time: mean}""",
    ).replace("weights: {", "weights: {X: 1, N: 1, ")
    found = [
        mdstopo.evaluate(
            read_case(text.replace("position: POSITION", f"{key}: {{formula: '{formula}', parameters: {parameters}}}"))
        )
        for key, formula in (("position", position), ("velocity", velocity), ("acceleration", acceleration))
    ]
    for other in found[1:]:
        for name, gradient in found[0].gradients.items():
            assert other.objectives[name] == pytest.approx(found[0].objectives[name], rel=1e-9, abs=1e-12), name
            assert np.abs(other.gradients[name] - gradient).max() <= 1e-7 * np.abs(gradient).max() + 1e-13, name
    values = {word: float(value) for word, value in (each.split(":") for each in parameters.strip("{}").split(","))}
    values = {word.strip(): value for word, value in values.items()}
    moved = TimeFormula(position, tuple(values.items())).at(1.0) - 0.1
    for each in found:
        assert each.objectives["X"] == pytest.approx(moved, rel=1e-12)


def test_a_short_pulse_of_the_velocity_moves_a_body_by_its_integral() -> None:
    case = read_case(DRIVEN.replace("position: POSITION", "velocity: 'exp(-((t - 0.333)/0.0005)^2)'"))
    signal = case.load_cases[0].motions[0].x.signal
    assert isinstance(signal, TimeFormula)
    ends = np.array([0.0, *sorted(integration_times(case, case.load_cases[0], [])), 1.0])
    row = row_of_motion(signal, "velocity")
    moved = integrated_ends(row, np.zeros(len(ends) - 1, dtype=np.int64), ends, 0.0, 0.0)[-1, 1, 0]
    assert abs(moved - 0.0005 * np.sqrt(np.pi)) < 1e-16


def test_a_motion_that_is_back_at_zero_at_all_ends_of_segments_does_not_jump() -> None:
    text = DRIVEN.replace("joints: [{type: revolute, bodies: [cart, load], at: [0.1, 0]}]\n", "")
    text = text.replace("position: [0.1, 0]}", "position: [0, 0]}")
    states = mdstopo.simulate(read_case(text.replace("position: POSITION", "velocity: 'cos(2*pi*t)'")))
    assert states.status.ok


def test_in_space_a_turn_by_its_rate_is_the_integral() -> None:
    text = """
    format: 1
    dimension: 3
    time: {end: 1}
    bodies:
      drum: {mass: 2, inertia: [1, 2, 3], position: [0, 0, 0]}
      load: {mass: 3, inertia: [1, 1, 1], position: [1, 0, 0]}
    points:
      rim: {body: drum, grid: {list: [[0.3, 0, 0], [0, 0.3, 0.1], [-0.2, 0.1, 0]]}}
      eye: {body: load, grid: {list: [[0.8, 0, 0.1], [1, 0.2, 0]]}}
    members: {ropes: {from: rim, to: eye, law: {type: spring, stiffness: 300, damping: 3}}}
    motions: [{body: drum, x: {velocity: 0}, y: {velocity: 0}, z: {velocity: 'sin(3*t)'}, rotation: TURN}]
    design: {initial: 0.5}
    solver: {tolerance: 1e-10}
    objectives: {G: {response: {velocity: {body: load}}, over_time: final}}
    """
    about = "{axis: [1, 2, 3], ANGLE}"
    turns = [
        "position: 'a*t^3'", "velocity: '3*a*t^2'", "acceleration: '6*a*t'",
    ]  # fmt: skip
    angles = "{roll: {velocity: '2*t'}, pitch: {acceleration: 'sin(t)'}, yaw: {position: 't^2/3'}}"
    same = "{roll: {position: 't^2'}, pitch: {position: 't - sin(t)'}, yaw: {position: 't^2/3'}}"
    stated = [about.replace("ANGLE", each.replace("a*", "0.7*")) for each in turns] + [angles, same]
    found = [mdstopo.evaluate(read_case(text.replace("TURN", each)), method="direct") for each in stated]
    for one, other in ((0, 1), (0, 2), (4, 3)):
        assert found[other].objectives["G"] == pytest.approx(found[one].objectives["G"], rel=1e-10)
        assert found[other].gradients["G"] == pytest.approx(found[one].gradients["G"], rel=1e-8)


#: what is stated -> the key and what the message has
MALFORMED = {
    "force: ['10*sin(tt)', 0]": ("loads[0].force[0]", "did you mean 't'? names are t (column 8"),
    "force: ['10*t', '3 +']": ("loads[0].force[1]", "found the end"),
    "force: {formula: ['t'], parameters: {a: 1}}": ("loads[0].force.formula", "needed are at least 2"),
    "force: {formula: ['t', 'b'], parameters: {a: 1}}": ("loads[0].force.formula[1]", "there is no name 'b'"),
    "force: {formula: ['t', 'a'], parameters: {t: 1}}": ("loads[0].force.parameters.t", "the name 't' is taken"),
    "moment: 'x + 1'": ("loads[0].moment", "allowed is a number, an expression of t, or {table"),
    "force: ['a * t', 0]": ("loads[0].force[0]", "numbers of its own have names in {formula: ..., parameters: {...}}"),
    "force: 3": ("loads[0].force", "allowed is [fx, fy], {formula: expressions of t} or {table"),
    "moment: '3 mm'": ("loads[0].moment", "in a unit that measures the same"),
}


@pytest.mark.parametrize("stated", MALFORMED)
def test_a_mistake_in_a_formula_of_time_is_told_with_its_place(stated: str) -> None:
    with pytest.raises(CaseError) as caught:
        loaded(PLANE, stated)
    key, words = MALFORMED[stated]
    assert f"{key}: " in str(caught.value)
    assert words in str(caught.value)


def test_what_formulas_of_time_cannot_do_is_refused() -> None:
    with pytest.raises(CaseError, match=r"has no value at t = 0"):
        mdstopo.evaluate(loaded(PLANE, "force: ['log(t)', 0]"))
    with pytest.raises(CaseError, match=r"the prescribed velocity of cart jumps at t = 0\.5 s, but it is jointed"):
        mdstopo.evaluate(read_case(DRIVEN.replace("POSITION", "'0.1 + max(t - 0.5, 0)'")))
    with pytest.raises(CaseError, match=r"the prescribed position of cart jumps at t = 0\.5 s"):
        mdstopo.evaluate(read_case(DRIVEN.replace("POSITION", "'0.1 + step(t - 0.5)'")))
    with pytest.raises(CaseError, match="they must agree"):
        read_case(DRIVEN.replace("POSITION", "'0.3 + t^2'"))
    with pytest.raises(CaseError, match=r"motions\[0\].x.velocity: the expression has no value at the start, 0 s"):
        read_case(DRIVEN.replace("position: POSITION", "velocity: '1/t'"))
    with pytest.raises(CaseError, match=r"the prescribed velocity of cart jumps at t = 0\.5 s, but it is jointed"):
        mdstopo.evaluate(read_case(DRIVEN.replace("position: POSITION", "velocity: 'step(t - 0.5)'")))
    with pytest.raises(CaseError, match=r"the expression t\*sin\(1e6\*t\) changes too fast at t = "):
        mdstopo.evaluate(read_case(DRIVEN.replace("position: POSITION", "velocity: 't*sin(1e6*t)'")))
