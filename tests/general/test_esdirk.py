"""The diagonally implicit method: its coefficients, stiff scenes, switches, contacts, and gradients by other ways."""

from __future__ import annotations

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.integrators.esdirk_tables import STAGES, esdirk_tables
from mdstopo.integrators.runge_kutta_tables import BB, E_Q, E_V, VECTORS, A, B, C
from mdstopo.status import Status
from tests.tiers import examples
from tests.variables.support import differences

OWN = slice(STAGES)
#: directions in which the two members of `PENDULUM` change
ALONG = np.array([0.9, -0.4]), np.array([0.4, 0.9])
#: a double pendulum whose end is held by a damped spring
PENDULUM = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies:
  a: {mass: 2, inertia: 0.3, position: [0.5, 0]}
  b: {mass: 1, inertia: 0.1, position: [1.5, 0]}
joints:
  - {name: p, type: revolute, bodies: [ground, a], at: [0, 0]}
  - {name: r, type: revolute, bodies: [a, b], at: [1, 0]}
points:
  tip: {body: b, grid: {list: [[0.5, 0.02], [0.3, -0.01]]}}
  hook: {body: ground, grid: {list: [[2.2, 1.1]]}}
members:
  s: {from: tip, to: hook, law: {type: spring, stiffness: 80, damping: DAMPING}}
design: {initial: 0.5}
objectives:
  G: {response: {displacement: {body: b, component: y}}, over_time: max_abs}
  H: {response: {acceleration: {body: a}}, over_time: mean}
combine: {weights: {G: 1, H: 1}, normalize: false}
"""
#: a block that slides over ground with friction, between a spring and a damped stop
BLOCK = """
format: 1
gravity: [0, -9.81]
time: {end: 0.6}
bodies:
  a: {mass: 1, inertia: 0.05, position: [0, 0.1], velocity: [1.5, 0]}
points:
  feet: {body: a, grid: {list: [[-0.2, 0], [0.2, 0]]}}
contacts:
  - points: feet
    on: {body: ground, from: [-2, 0], to: [2, 0]}
    stiffness: 1e5
    damping: 300
    friction: 0.3
    slip: 0.01
members:
  s: {from: {body: ground, at: [-1, 0.1]}, to: {body: a, at: [0, 0.1]}, law: {type: spring, stiffness: 40}}
  g:
    from: {body: ground, at: [-1, 0.1]}
    to: {body: a, at: [0, 0.1]}
    law: {type: gap, stiffness: 900, damping: 20, gap: 0.1}
design: {initial: 0.8}
objectives:
  D: {response: {displacement: {body: a, component: x}}, over_time: max}
  V: {response: {velocity: {body: a, component: x}}, over_time: final}
combine: {weights: {D: 1, V: 1}, normalize: false}
"""
#: a body that sinks onto two stiff and strongly damped springs, and then hangs there
HANGING = """
format: 1
gravity: [0, -9.81]
time: {end: 20}
bodies: {a: {mass: 2, inertia: 0.3, position: [0, 0]}}
points:
  top: {body: a, grid: {list: [[-0.3, 0], [0.3, 0]]}}
  hooks: {body: ground, grid: {list: [[-0.3, 1], [0.3, 1]]}}
members:
  s: {from: top, to: hooks, connect: pairs, law: {type: spring, stiffness: 1e6, damping: 1e4}}
design: {initial: 0.5}
objectives: {G: {response: {displacement: {body: a, component: y}}, over_time: final}}
solver: {integrator: esdirk, tolerance: 1e-5}
"""


def pendulum(damping: float, **solver: object) -> mdstopo.Case:
    return read_case(
        PENDULUM.replace("DAMPING", str(damping)), overrides={f"solver.{key}": value for key, value in solver.items()}
    )


def test_coefficients_are_of_fourth_order_and_the_embedded_ones_of_third() -> None:
    table = esdirk_tables()[1]
    a, b, c = table[A, OWN, OWN], table[VECTORS, B, OWN], table[VECTORS, C, OWN]
    embedded = b - table[VECTORS, E_V, OWN]
    for weights in (b, embedded):
        for value, exact in ((1, 1), (c, 1 / 2), (c * c, 1 / 3), (a @ c, 1 / 6)):
            assert weights @ (value * np.ones(STAGES)) == pytest.approx(exact, abs=1e-14)
    for value, exact in ((c**3, 1 / 4), (c * (a @ c), 1 / 8), (a @ (c * c), 1 / 12), (a @ (a @ c), 1 / 24)):
        assert b @ value == pytest.approx(exact, abs=1e-14)
    assert np.array_equal(b, a[-1])
    assert table[VECTORS, BB, OWN] == pytest.approx(b @ a, abs=1e-15)
    assert table[VECTORS, E_Q, OWN] == pytest.approx((b - embedded) @ a, abs=1e-15)


def test_what_is_infinitely_stiff_is_damped_in_one_step() -> None:
    a, b = esdirk_tables()[1][A, OWN, OWN], esdirk_tables()[1][VECTORS, B, OWN]

    def growth(z: complex) -> float:
        return abs(1.0 + z * b @ np.linalg.solve(np.eye(STAGES) - z * a, np.ones(STAGES)))

    assert growth(-1e9) < 1e-8
    assert max(growth(complex(0.0, y)) for y in np.logspace(-2, 4, 200)) <= 1.0 + 1e-12


@pytest.mark.parametrize("damping", [500.0, 5e3, 5e6])
def test_stiff_dampers_cost_no_steps_and_no_digits(damping: float) -> None:
    case = pendulum(damping, integrator="esdirk", tolerance=1e-5)
    found = mdstopo.evaluate(case)
    assert found.status.ok
    assert found.work["steps"] <= 2000
    exact = mdstopo.evaluate(pendulum(damping, integrator="esdirk", tolerance=1e-8))
    other = mdstopo.evaluate(case, method="direct")
    for name in found.objectives:
        assert found.objectives[name] == pytest.approx(exact.objectives[name], rel=1e-4)
        assert found.gradients[name] == pytest.approx(exact.gradients[name], rel=1e-3)
        assert other.gradients[name] == pytest.approx(found.gradients[name], rel=1e-9)


@pytest.fixture(scope="module")
def slopes() -> list[dict[str, float]]:
    """Differences of a tight run on a stiff damper, along each of `ALONG`."""
    case = pendulum(5000.0, integrator="esdirk", tolerance=1e-8)
    return [differences(case, np.full(2, 0.5), along, 1e-3) for along in ALONG[: examples(1, 2)]]


@pytest.mark.parametrize("integrator", ["esdirk", "runge_kutta"])
def test_gradients_are_right_where_a_damper_is_stiff(integrator: str, slopes: list[dict[str, float]]) -> None:
    """Explicit steps as long as stability allows had gradients that were wrong by a factor of a thousand."""
    found = mdstopo.evaluate(pendulum(5000.0, integrator=integrator, tolerance=1e-6))
    for name, gradient in found.gradients.items():
        assert np.ptp(gradient) > 0.01 * np.abs(gradient).max()  # members are told from each other
        for along, slope in zip(ALONG, slopes, strict=False):
            assert gradient @ along == pytest.approx(slope[name], rel=1e-5)


def test_a_stop_and_friction_agree_with_the_explicit_method() -> None:
    case = read_case(BLOCK, overrides={"solver.integrator": "esdirk", "solver.tolerance": 1e-8})
    explicit = read_case(BLOCK, overrides={"solver.integrator": "runge_kutta", "solver.tolerance": 1e-10})
    found, exact = mdstopo.evaluate(case), mdstopo.evaluate(explicit)
    other = mdstopo.evaluate(case, method="direct")
    for name in found.objectives:
        assert found.objectives[name] == pytest.approx(exact.objectives[name], rel=1e-6)
        assert found.gradients[name] == pytest.approx(exact.gradients[name], rel=1e-5)
        assert other.gradients[name] == pytest.approx(found.gradients[name], rel=1e-8)


def test_bodies_at_rest_on_stiff_springs_are_followed_in_long_steps() -> None:
    """Newton's iteration ended as failed where bodies move by less than rounding in a step."""
    case = read_case(HANGING)
    found, (one, other) = mdstopo.evaluate(case, method="direct"), (0.5, 0.5)
    height = -2.0 * 9.81 / (1e6 * (one + other))
    assert found.status.ok
    assert found.work["steps"] <= 300
    assert found.objectives["G"] == pytest.approx(height, rel=1e-9)
    assert found.gradients["G"] == pytest.approx(np.full(2, -height / (one + other)), rel=1e-6)


def test_auto_takes_it_where_explicit_steps_have_no_hope_to_reach_the_end() -> None:
    text = PENDULUM.replace("DAMPING", "5e4").replace("{end: 1}", "{end: 100}")
    chosen = Evaluator(read_case(text, overrides={"solver.tolerance": 1e-5}), in_background=False)
    assert chosen.integrator == "esdirk"


def test_auto_takes_it_where_stability_holds_most_explicit_steps_short() -> None:
    chosen = {damping: Evaluator(pendulum(damping, tolerance=1e-5), in_background=False) for damping in (500.0, 5e4)}
    assert chosen[500.0].integrator == "runge_kutta"
    assert chosen[5e4].integrator == "esdirk"
    assert "stability holds" in chosen[5e4].integrator_reason
    start = np.full(2, 0.5)
    assert chosen[5e4].evaluate(start).work["steps"] <= 1500
    assert chosen[500.0].evaluate(start).work["steps_held_short"] > 100


def test_steps_for_integrals_that_are_too_many_end_with_a_status(monkeypatch: pytest.MonkeyPatch) -> None:
    """The motion alone may be computed: it was taken for all, and no value was found."""
    evaluator = Evaluator(pendulum(500.0, integrator="esdirk", tolerance=1e-4), in_background=False)
    driver = evaluator.driver(next(iter(evaluator.scenes)))
    found = driver.evaluate(np.full(2, 0.5), False)
    monkeypatch.setattr(driver, "evaluate", lambda *_: found._replace(status=Status.STEP_LIMIT))
    assert evaluator.evaluate(np.full(2, 0.5), gradient=False).status is Status.STEP_LIMIT


def test_bodies_in_space_are_refused() -> None:
    case = read_case(
        """
format: 1
dimension: 3
time: {end: 1}
bodies: {a: {mass: 1, inertia: [1, 1, 1], position: [0, 0, 0]}}
members: {s: {from: {body: ground, at: [0, 0, 1]}, to: {body: a, at: [0, 0, 0]}, law: {type: spring, stiffness: 9}}}
objectives: {G: {response: energy}}
solver: {integrator: esdirk}
"""
    )
    with pytest.raises(CaseError, match="esdirk does not compute bodies in space"):
        mdstopo.evaluate(case)
