"""Springs of no free length: k r whatever the length, so closed forms are those of an isotropic oscillator."""

import numpy as np
import pytest

from mdstopo.api import evaluate, simulate
from mdstopo.case.reader import read_case
from mdstopo.cli.check_scene import in_words, restraint
from mdstopo.engine import Evaluator

BALL = """\
format: 1
gravity: [0, {gravity}]
time: {{end: 2}}
bodies: {{ball: {{mass: 2, inertia: 1, position: [1, 0], velocity: [0, {speed}]}}}}
members:
  spring:
    from: {{body: ground, at: [0, 0]}}
    to: {{body: ball, at: [1, 0]}}
    law: {{type: spring, stiffness: 8, free_length: 0}}
design: {{initial: 0.5, lower: 0, upper: 1}}
objectives: {{G: {{response: {response}, over_time: {over_time}}}}}
solver: {{integrator: {integrator}, tolerance: 1e-9}}
"""
HEIGHT = "{displacement: {body: ball, component: y}}"
#: held by a spring without free length from a point above its pivot, which carries it in every pose: k a h = m g c
LAMP = """\
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies: {arm: {mass: 3, inertia: 0.2, position: [0.3, 0.4]}}
joints: [{type: revolute, bodies: [ground, arm], at: [0, 0]}]
members:
  spring:
    from: {body: ground, at: [0, 0.6]}
    to: {body: arm, at: [0.24, 0.32]}
    law: {type: spring, stiffness: 61.3125, free_length: 0}
design: {initial: 1}
objectives: {G: {response: {angle: {body: arm}}, over_time: final}}
solver: {tolerance: 1e-9}
"""


def ball(**changes: str) -> str:
    usual = {"gravity": "0", "speed": "0", "response": "energy", "over_time": "max", "integrator": "auto"}
    return BALL.format(**{**usual, **changes})


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
@pytest.mark.parametrize("speed", [0.0, 0.7])
def test_a_ball_on_such_a_spring_moves_on_an_ellipse_and_through_its_middle(integrator: str, speed: float) -> None:
    rate = np.sqrt(0.5 * 8.0 / 2.0)
    motion = simulate(read_case(ball(speed=str(speed), integrator=integrator)))
    assert motion.status.ok
    assert motion.q[:, 0] == pytest.approx(np.cos(rate * motion.t), abs=1e-8)
    assert motion.q[:, 1] == pytest.approx(speed / rate * np.sin(rate * motion.t), abs=1e-8)
    assert motion.t[-1] > np.pi / 2 / rate  # past the middle, which it meets where it starts at rest


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_gradients_are_those_of_the_closed_form(integrator: str) -> None:
    text = ball(gravity="-3", integrator=integrator)
    if integrator == "runge_kutta":
        text = ball(gravity="-3", integrator=integrator, response=HEIGHT, over_time="final")
    found = evaluate(read_case(text))
    alpha, end = 0.5, 2.0
    w2 = alpha * 8.0 / 2.0
    w = np.sqrt(w2)
    if integrator == "runge_kutta":
        value = -3.0 / w2 * (1.0 - np.cos(w * end))
        slope = (3.0 / w2**2 * (1.0 - np.cos(w * end)) - 3.0 / w2 * np.sin(w * end) * end / (2.0 * w)) * 4.0
        assert found.objectives["G"] == pytest.approx(value, rel=1e-8)
        assert found.gradients["G"] == pytest.approx([slope], rel=1e-7)
        return
    # stored: alpha k (x^2 + y^2) / 2, the largest within the time
    t = np.linspace(0.0, end, 200_001)

    def energy(share: float, at: np.ndarray) -> np.ndarray:
        square = share * 8.0 / 2.0
        rate = np.sqrt(square)
        y = -3.0 / square * (1.0 - np.cos(rate * at))
        return 0.5 * share * 8.0 * (np.cos(rate * at) ** 2 + y**2)

    peak = t[int(energy(alpha, t).argmax())]
    assert found.objectives["G"] == pytest.approx(float(energy(alpha, np.array(peak))), rel=1e-8)
    step = 1e-6
    around = energy(alpha + step, np.array(peak)) - energy(alpha - step, np.array(peak))
    assert found.gradients["G"] == pytest.approx([float(around) / (2.0 * step)], rel=1e-5)


def test_a_balanced_arm_stays_in_every_pose_and_check_says_that_it_is_free() -> None:
    for pose in (0.0, 0.9):
        turned = LAMP
        if pose:  # the arm is drawn turned about its pivot
            c, s = np.cos(pose), np.sin(pose)
            for x, y in ((0.3, 0.4), (0.24, 0.32)):
                turned = turned.replace(f"[{x}, {y}]", f"[{float(c * x - s * y)!r}, {float(s * x + c * y)!r}]")
        case = read_case(turned)
        motion = simulate(case)
        assert motion.status.ok
        assert np.abs(motion.q[:, 2]).max() < 1e-8
        engine = Evaluator(case)
        found = restraint(case, case.load_cases[0], engine.start_modes(case.start, "default"), ("arm", "ground"))
        assert (found["loose"], found["growing"]) == (1, [])
        assert "one mode has no stiffness" in in_words(found)[0]


def test_a_softer_spring_lets_the_arm_fall_as_fast_as_check_says() -> None:
    case = read_case(LAMP.replace("61.3125", "50"))
    engine = Evaluator(case)
    found = restraint(case, case.load_cases[0], engine.start_modes(case.start, "default"), ("arm", "ground"))
    # the potential is (m g c - k a h) cos of the angle to the vertical; the inertia is that about the pivot
    rate = np.sqrt((3 * 9.81 * 0.5 - 50 * 0.4 * 0.6) * 0.8 / (0.2 + 3 * 0.25))
    (growing,) = found["growing"]
    assert growing["rate"] == pytest.approx(rate, rel=1e-9)
    assert found["loose"] == 0
    assert abs(simulate(case).q[-1, 2]) > 0.1


@pytest.mark.parametrize("push", [True, False])
def test_a_slide_settles_where_the_ends_of_its_spring_meet(push: bool) -> None:
    loads = "[0.2, 0]" if push else "[{table: [[0, 0], [1, 1]]}, 0]"
    text = f"""
format: 1
time: {{end: 1}}
bodies: {{slide: {{mass: 2, inertia: 1, position: [1, 0]}}}}
joints: [{{type: prismatic, bodies: [ground, slide], at: [1, 0], axis: [1, 0]}}]
members:
  spring:
    from: {{body: ground, at: [0, 0]}}
    to: {{body: slide, at: [1, 0]}}
    law: {{type: spring, stiffness: 8, free_length: 0}}
loads: [{{body: slide, force: {loads}}}]
objectives: {{G: {{response: {{displacement: {{body: slide, component: x}}}}, over_time: final}}}}
solver: {{settle: true, tolerance: 1e-9}}
design: {{initial: 0.5, lower: 0.1, upper: 1}}
"""
    found = evaluate(read_case(text))
    k = 0.5 * 8.0
    w = np.sqrt(k / 2.0)
    # pushed it rests at F / k; else it rests at no length, and a force that grows with time moves it from there
    value, slope = 0.2 / k, -0.2 / k**2
    if not push:
        value = (1.0 - np.sin(w) / w) / k
        slope = -(1.0 - np.sin(w) / w) / k**2 - (w * np.cos(w) - np.sin(w)) / w**2 / (4.0 * w) / k
    assert found.objectives["G"] == pytest.approx(value - 1.0, abs=1e-10)
    assert found.gradients["G"] == pytest.approx([8.0 * slope], abs=1e-9)
