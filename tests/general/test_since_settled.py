"""Displacements that count from where a scene has settled: closed forms, and differences of everything."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.scene.refusals import refusals
from tests.variables.support import differences, whole, widths

#: a lamp that swings about the place where its cord carries it
LAMP = """
format: 1
gravity: [0, -10]
time: {end: 0.35}
bodies: {lamp: {mass: 2, inertia: 0.1, position: [0, -1], velocity: [0, -0.4]}}
joints: [{name: guide, type: prismatic, bodies: [ground, lamp], at: [0, -1], axis: [0, 1]}]
members:
  cord: {from: {body: ground, at: [0, 0]}, to: {body: lamp, at: [0, -0.9]}, law: {type: spring, stiffness: 500}}
design: {initial: 0.8}
objectives:
  sag: {response: {displacement: {body: lamp, component: y}}, over_time: final}
  swing: {response: {displacement: {body: lamp, component: y, since: settled}}, over_time: final}
  far: {response: {displacement: {body: lamp, since: settled}}, over_time: max}
  mean: {response: {displacement: {body: lamp, component: y, since: settled}}, over_time: mean}
combine: {weights: {sag: 1, swing: 1, far: 1, mean: 1}, normalize: false}
constraints:
  - {response: {displacement: {body: lamp, component: y, since: settled}}, over_time: max_abs, limit: 0.05}
solver: {settle: true, tolerance: 1.0e-12}
"""


@pytest.mark.parametrize("method", ["adjoint", "direct"])
def test_a_lamp_swings_about_its_place_at_rest_as_the_closed_form_says(method):
    """y = v / w sin(w t) from there, w^2 = 500 alpha / 2; its quarter period ends before the time does."""
    case = read_case(LAMP)
    t, v, alpha = 0.35, -0.4, 0.7
    found = mdstopo.evaluate(case, [alpha], method=method)
    w = np.sqrt(250.0 * alpha)
    by_w = -v / w**2 * np.sin(w * t) + v * t / w * np.cos(w * t)
    sag, swing = 20.0 / (500.0 * alpha), v / w * np.sin(w * t)
    assert found.objectives["sag"] == pytest.approx(swing - sag, rel=1e-9)
    assert found.objectives["swing"] == pytest.approx(swing, rel=1e-9)
    assert found.gradients["swing"][0] == pytest.approx(by_w * w / (2.0 * alpha), rel=1e-7)
    for value, slope in (
        (found.objectives["far"], found.gradients["far"]), (found.constraints[0] + 0.05, found.constraint_gradients[0]),
    ):  # fmt: skip
        assert value == pytest.approx(-v / w, rel=1e-9)
        assert slope[0] == pytest.approx(0.5 * v / w / alpha, rel=1e-7)
    mean = v / (w**2 * t) * (1.0 - np.cos(w * t))
    by_w = -2.0 * mean / w + v / w**2 * np.sin(w * t)
    assert found.objectives["mean"] == pytest.approx(mean, rel=1e-9)
    assert found.gradients["mean"][0] == pytest.approx(by_w * w / (2.0 * alpha), rel=1e-7)


#: a frame on a pin, and a ball between it and the sky, both carried by springs; what the frame sees of the ball
NEST = """
format: 1
time: {end: 0.4}
gravity: [0, -4]
bodies:
  frame: {mass: 3, inertia: 0.4, position: [0.5, 0.1], angle: 0.3}
  ball: {mass: 1.5, inertia: 0.1, position: [1.6, 0.2], velocity: [0.5, -0.3], angular_velocity: 0.4}
joints: [{type: revolute, bodies: [ground, frame], at: [0, 0]}]
points:
  sky: {body: ground, grid: {list: [[1.2, 1.1], [2, 1.2], [1.6, -0.7]]}}
  skin: {body: ball, grid: {list: [[1.5, 0.3], [1.7, 0.3], [1.63, 0.1]]}}
members:
  hold: {from: {body: ground, at: [0.9, 1]}, to: {body: frame, at: [1, 0.2]},
         law: {type: spring, stiffness: 90, damping: 1}}
  nest: {from: sky, to: skin, connect: pairs, law: {type: spring, stiffness: 70, damping: 0.5}}
  tie: {from: {body: frame, at: [0.7, 0.5]}, to: {body: ball, at: [1.5, 0.2]}, law: {type: spring, stiffness: 60}}
design:
  initial: 0.8
  variables: {length: {group: hold, parameter: free_length, initial: 0.75, lower: 0.6, upper: 0.9}}
objectives:
  F: {response: {displacement: {body: ball, at: [1.7, 0.1], relative_to: frame, since: settled}}, over_time: final}
  P: {response: {displacement: {body: ball, relative_to: frame, component: x, since: settled}}, over_time: max_abs}
  N: {response: {displacement: {body: ball, at: [1.7, 0.1], since: settled}}, over_time: max}
  R: {response: {displacement: {body: ball, at: [1.7, 0.1], relative_to: frame, since: settled}}, over_time: rms}
  M: {response: {displacement: {body: ball, relative_to: frame, since: settled}}, over_time: mean}
  G: {response: {displacement: {body: ground, at: [1, 1], relative_to: ball, component: y, since: settled}},
      over_time: integral}
combine: {weights: {F: 1, P: 1, N: 1, R: 1, M: 1, G: 1}, normalize: false}
solver: {settle: true, tolerance: 1.0e-12}
"""


def test_all_that_an_observer_who_turns_sees_since_rest_has_the_slopes_of_differences():
    case = read_case(NEST)
    design = np.concatenate([np.random.default_rng(3).uniform(0.4, 1.0, case.n_design), [0.72]])
    found = mdstopo.evaluate(case, design[:-1], variables={"length": 0.72})
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, design[:-1], variables={"length": 0.72}, method="direct")
    for seed in range(2):
        direction = np.random.default_rng(seed).normal(size=len(design)) * widths(case)
        for name, slope in differences(case, design, direction, 2e-3).items():
            own = whole(found, name)
            assert abs(slope - own @ direction) < 2e-7 * np.abs(own * direction).max(), name
            assert np.abs(whole(direct, name) - own).max() < 1e-9 * np.abs(own).max(), name


def test_displacements_since_rest_are_those_since_the_start_of_the_motion():
    """Told from the motion itself: the place of a point in the frame's axes less what it was at first."""
    case = read_case(NEST)
    motion = mdstopo.simulate(case)
    frame, ball = motion.q[:, :3], motion.q[:, 3:6]
    c, s = np.cos(ball[:, 2]), np.sin(ball[:, 2])
    x = np.stack([ball[:, 0] + 0.1 * c + 0.1 * s, ball[:, 1] + 0.1 * s - 0.1 * c], axis=1) - frame[:, :2]
    c, s = np.cos(frame[:, 2]), np.sin(frame[:, 2])
    seen = np.stack([c * x[:, 0] + s * x[:, 1], c * x[:, 1] - s * x[:, 0]], axis=1)
    assert mdstopo.evaluate(case).objectives["F"] == pytest.approx(np.linalg.norm(seen[-1] - seen[0]), rel=1e-10)


@pytest.mark.parametrize("method", ["iterative", "direct"])
def test_implicit_steps_and_their_methods_agree(method):
    case = read_case(NEST.replace("solver: {", "solver: {integrator: generalized_alpha, step: 0.004, "))
    without = read_case(NEST.replace("solver: {", "solver: {integrator: generalized_alpha, step: 0.004, "),
                        overrides={"design.variables": "{}"})  # fmt: skip
    case = without if method == "iterative" else case
    found, other = mdstopo.evaluate(case), mdstopo.evaluate(case, method=method)
    for name, gradient in found.gradients.items():
        assert np.abs(other.gradients[name] - gradient).max() <= 1e-8 * np.abs(gradient).max(), name


def test_histories_have_the_derivatives_of_the_motion():
    case = read_case(NEST, overrides={"design.variables": "{}"})
    alpha = np.full(case.n_design, 0.7)
    evaluator = Evaluator(case)
    found = evaluator.evaluate(alpha)
    driver = evaluator.driver("default")
    status, times, lines = driver.histories(evaluator.design(alpha), 0)
    assert status.ok
    assert times[-1] == pytest.approx(0.4)
    assert np.abs(lines[0]).max() <= 1e-12
    assert np.abs(lines[-1] - found.gradients["F"]).max() <= 1e-9 * np.abs(lines[-1]).max()


ENGINE = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.15}
bodies:
  engine: {mass: 20, inertia: [1, 1.4, 1.2], position: [0, 0, 0.5], orientation: {axis: [0.1, 0.2, 0.3], angle: 0.4},
           velocity: [0.2, 0.1, -0.3], angular_velocity: [0.4, 0, 0.5]}
  arm: {mass: 3, inertia: [0.1, 0.14, 0.12], position: [0.6, 0.1, 0.5], velocity: [0.1, 0.2, 0]}
points:
  lugs: {body: engine, grid: {list: [[0.2, 0.2, 0.6], [-0.2, 0.2, 0.6], [0, -0.2, 0.7]]}}
  posts: {body: ground, grid: {list: [[0.6, 0.5, 0.8], [-0.6, 0.5, 0.8], [0, -0.6, 0.9]]}}
  tip: {body: arm, grid: {list: [[0.9, 0.1, 0.55], [0.8, 0.3, 0.5], [0.7, 0.1, 0.4]]}}
bushings:
  - {bodies: [ground, engine], at: [0.3, 0, 0.3], stiffness: [20000, 20000, 30000, 500, 500, 500]}
members:
  stays: {from: lugs, to: posts, law: {type: spring, stiffness: 5000}}
  ropes: {from: tip, to: lugs, law: {type: spring, stiffness: 900, damping: 2}}
  cords: {from: tip, to: posts, law: {type: spring, stiffness: 700, preload: 20}}
objectives:
  F: {response: {displacement: {body: arm, at: [0.9, 0.1, 0.55], relative_to: engine, since: settled}},
      over_time: final}
  Z: {response: {displacement: {body: arm, relative_to: engine, component: z, since: settled}}, over_time: final}
  R: {response: {displacement: {body: arm, relative_to: engine, since: settled}}, over_time: rms}
combine: {weights: {F: 1, Z: 1, R: 1}}
solver: {integrator: runge_kutta, settle: true, tolerance: 1.0e-11}
"""


def test_in_space_they_have_the_slopes_of_differences():
    case = read_case(ENGINE)
    alpha = np.random.default_rng(1).uniform(0.4, 1.0, case.n_design)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    motion = mdstopo.simulate(case, alpha)
    assert np.abs(motion.q[0, :3] - [0.0, 0.0, 0.5]).max() > 1e-4
    direction = np.random.default_rng(2).normal(size=case.n_design) * alpha
    for name, slope in differences(case, alpha, direction, 1e-3).items():
        own = found.gradients[name]
        assert abs(slope - own @ direction) < 1e-7 * np.abs(own * direction).max(), name


def test_without_settle_it_is_refused_by_its_key():
    case = read_case(LAMP, overrides={"solver.settle": "false"})
    places = [mistake.path_key for mistake in refusals(case)]
    named = [f"objectives.{name}.response.displacement.since" for name in ("swing", "far", "mean")]
    assert places == [*named, "constraints[0].response.displacement.since"]
    with pytest.raises(CaseError, match=r"settled needs `solver: \{settle: true\}`"):
        mdstopo.evaluate(case)
    with pytest.raises(CaseError, match="unknown key 'since'"):
        read_case(LAMP.replace("displacement: {body: lamp, component: y}", "velocity: {body: lamp, since: settled}"))


def test_within_an_expression_it_is_refused_by_its_key():
    expression = "{expression: {formula: 2*d, of: {d: {displacement: {body: lamp, component: y, since: settled}}}}}"
    text = LAMP.replace("{displacement: {body: lamp, since: settled}}, over_time: max", f"{expression}, over_time: max")
    assert text != LAMP
    (mistake,) = refusals(read_case(text))
    assert mistake.path_key == "objectives.far.response.expression.of.d.displacement.since"
    assert "stated" in str(mistake)
