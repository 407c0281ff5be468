"""The methods beside adjoint and direct, and responses in optimisation."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from tests.general.support import design_of, load


def test_iterative_agrees_with_direct_where_it_contracts():
    case = load("loaded_pendulum", integrator="generalized_alpha", step=0.002)
    alpha = design_of(case)
    direct, iterative = (mdstopo.evaluate(case, alpha, method=method) for method in ("direct", "iterative"))
    for name, gradient in direct.gradients.items():
        assert np.abs(iterative.gradients[name] - gradient).max() <= 1e-9 * np.abs(gradient).max(), name


def test_iterative_falls_back_on_direct_with_a_word_where_it_does_not_contract():
    """beta h^2 k/m is far above 1."""
    text = """
format: 1
gravity: [0, -10]
time: {end: 0.5}
bodies: {mass: {mass: 1, inertia: 1, position: [0, 1]}}
members:
  m:
    from: {body: ground, at: [0, 0]}
    to: {body: mass, at: [0, 1]}
    law: [{type: spring, stiffness: 1.0e+6}, {type: cubic, stiffness: 1, cubic: 1}]
design: {initial: 0.9}
objectives: {y: {response: {displacement: {body: mass, component: y}}, over_time: final}}
solver: {integrator: generalized_alpha, step: 0.01}
"""
    case = read_case(text)
    direct, iterative = (mdstopo.evaluate(case, method=method) for method in ("direct", "iterative"))
    assert "do not contract" in iterative.message
    for name, gradient in direct.gradients.items():
        assert iterative.gradients[name] == pytest.approx(gradient)


def test_constant_load_is_the_static_answer_of_a_slow_pull():
    """A hinged bar on springs, loaded so slowly that statics is right; what the load's lever changes is left out."""
    text = """
format: 1
time: {end: 200}
bodies: {bar: {mass: 1, inertia: 0.1, position: [0.5, 0]}}
joints: [{name: pin, type: revolute, bodies: [ground, bar], at: [0, 0]}]
members:
  up:
    from: {body: ground, at: [0.5, 2]}
    to: {body: bar, at: [0.5, 0]}
    law: {type: spring, stiffness: 40, damping: 3}
  down:
    from: {body: ground, at: [1, -2]}
    to: {body: bar, at: [1, 0]}
    law: {type: spring, stiffness: 30, damping: 3}
loads: [{body: bar, force: {table: [[0, 0, 0], [200, 0, 6]]}, at: [1, 0]}]
design: {initial: 0.8}
objectives: {y: {response: {displacement: {body: bar, at: [1, 0], component: y}}, over_time: final}}
"""
    case = read_case(text)
    exact, held = (mdstopo.evaluate(case, method=method).gradients["y"] for method in ("adjoint", "constant_load"))
    assert held == pytest.approx(exact, rel=0.05)
    assert np.abs(exact).max() > 1e-3


def test_a_constraint_on_a_response_is_kept_by_the_optimiser():
    text = """
format: 1
gravity: [0, -9.8]
time: {end: 0.4}
bodies: {block: {mass: 10, inertia: 1, position: [0, 0]}}
points:
  b: {body: block, grid: {rectangle: {center: [0, 0], size: [0.4, 0.4], count: 4}}}
  g: {body: ground, grid: {list: [[-1, 1], [1, 1], [0, -1], [-1, -1]]}}
members:
  ties: {from: b, to: g, law: {type: spring, stiffness: 4000, damping: 50}}
loads: [{body: block, force: [200, 0]}]
design: {initial: 0.5, lower: 0.01}
objectives: {M: {response: {acceleration: {body: block}}, over_time: rms}}
constraints:
  - {response: {displacement: {body: block}}, over_time: max, limit: 0.03}
  - {volume: all, fraction: 0.6}
optimizer: {max_iterations: 30}
"""
    case = read_case(text)
    start = mdstopo.evaluate(case)
    found = mdstopo.optimize(case)
    end = mdstopo.evaluate(case, found.alpha)
    assert start.constraints[0] > 0.0  # the start violates it
    assert end.constraints[0] <= 1e-6
    assert end.constraints[1] <= 1e-9
    assert end.status.ok


def test_a_load_case_that_nothing_looks_at_is_not_simulated():
    text = """
format: 1
time: {end: 0.1}
bodies: {block: {mass: 10, inertia: 1, position: [0, 0]}}
members:
  m:
    from: {body: ground, at: [0, -1]}
    to: {body: block, at: [0, 0]}
    law: {type: cubic, stiffness: 4, cubic: 1}
load_cases:
  one: {loads: [{body: block, force: [1, 0]}]}
  two: {loads: [{body: block, force: [0, 1]}]}
objectives: {G: {response: energy, load_case: one}}
"""
    case = read_case(text)
    both = read_case(
        text.replace(
            "objectives: {", "combine: {weights: {G: 1, H: 1}}\nobjectives: {H: {response: energy, load_case: two}, "
        )
    )
    assert mdstopo.evaluate(case).work["steps"] < mdstopo.evaluate(both).work["steps"]
