"""The methods beside adjoint and direct, and responses in optimisation."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
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


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_histories_by_direct_end_in_the_gradient_and_are_those_of_shorter_motions(integrator):
    """At the last step the history is the gradient of `final`; before it, that of a motion that ends there."""
    text = """
format: 1
gravity: [0, -9.8]
time: {end: 0.9}
bodies: {bar: {mass: 2, inertia: 0.3, position: [0.5, 0]}}
joints: [{name: pin, type: revolute, bodies: [ground, bar], at: [0, 0]}]
members:
  tie:
    from: {body: ground, at: [1, 1]}
    to: {body: bar, at: [1, 0]}
    law: [{type: spring, stiffness: 40, damping: 1}, {type: cubic, stiffness: 10, cubic: 300}]
  floor:
    from: {body: ground, at: [1, -2]}
    to: {body: bar, at: [1, 0]}
    law: {type: gap, stiffness: 900, damping: 9, gap: 0.3, side: compression}
design: {initial: 0.8}
objectives:
  y: {response: {displacement: {body: bar, at: [1, 0], component: y}}, over_time: final}
  f: {response: {joint_force: {joint: pin}}, over_time: final}
  m: {response: {member_force: {group: tie}}, over_time: final}
combine: {weights: {y: 1, f: 1, m: 1}}
solver: {integrator: INTEGRATOR, step: 0.001}
""".replace("INTEGRATOR", integrator)
    whole = Evaluator(read_case(text))
    alpha = np.array([0.7, 0.9])
    final = whole.evaluate(alpha, sensitivity="direct").gradients
    for name in final:
        status, t, rows = whole.histories(alpha, name)
        assert status.ok
        assert rows.shape == (len(t), 2)
        assert np.abs(rows[-1] - final[name]).max() <= 1e-9 * np.abs(final[name]).max()
    k = int(np.searchsorted(t, 0.6))  # after the touch, on the grid of steps
    shorter = Evaluator(read_case(text.replace("end: 0.9", f"end: {float(t[k])!r}")))
    for name, gradient in shorter.evaluate(alpha).gradients.items():
        _, _, rows = whole.histories(alpha, name)
        assert np.abs(rows[k] - gradient).max() <= 2e-5 * np.abs(gradient).max(), name
