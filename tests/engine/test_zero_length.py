"""Members whose ends meet: no direction, no force; named where they would carry one."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mdstopo import evaluate, simulate
from mdstopo.status import Status
from tests.engine.plain import Plain
from tests.engine.scenes import random_scene, read, with_solver

BOTH = pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])


def passing(offset=0.0, law=None, speed=-4.0, end=0.6):
    """A body on its way through the ground end of a member, or past it at `offset`; a weak member is in line."""
    return {
        "time": {"end": end},
        "bodies": {"ball": {"mass": 2.0, "inertia": 0.5, "position": [1.0, offset], "velocity": [speed, 0.0]}},
        "members": {
            "through": {
                "from": {"body": "ground", "at": [0.0, 0.0]}, "to": {"body": "ball", "at": [1.0, offset]},
                "law": {"type": "spring", "stiffness": 10.0, **(law or {})},
            },
            "aside": {
                "from": {"body": "ground", "at": [5.0, offset]}, "to": {"body": "ball", "at": [1.0, offset]},
                "law": {"type": "spring", "stiffness": 1e-9},
            },
        },
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": "energy"}},
    }  # fmt: skip


@BOTH
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_a_pass_through_zero_length_is_named_and_gives_no_gradient(integrator, tolerance):
    case = read(passing(), integrator=integrator, tolerance=tolerance)
    found = evaluate(case)
    assert found.status is Status.ZERO_LENGTH
    assert "through" in found.message
    assert "aside" not in found.message
    assert found.gradients == {}
    assert np.isnan(found.objectives["G"])
    motion = simulate(case)
    assert np.all(np.isfinite(motion.q))


@BOTH
def test_a_member_without_force_at_zero_length_lets_it_pass(integrator):
    # f = k (L - l0) + preload with k l0 = preload: f = k L, a plain linear spring through the origin, q'' = -k/m q
    case = read(passing(law={"preload": 10.0}), integrator=integrator, tolerance=1e-9)
    found = evaluate(case)
    assert found.status.ok
    omega = np.sqrt(10.0 / 2.0)
    x = simulate(case).at([0.6]).q[0, 0]
    assert x == pytest.approx(np.cos(0.6 * omega) - 4.0 / omega * np.sin(0.6 * omega), abs=1e-7)
    assert np.all(np.isfinite(found.gradients["G"]))


@BOTH
@pytest.mark.parametrize("offset", [1e-1, 1e-2, 1e-3])
def test_a_near_miss_is_integrated_accurately(integrator, offset):
    case = read(passing(offset), integrator=integrator, tolerance=1e-8)
    motion = simulate(case)
    assert motion.status.ok
    assert evaluate(case).status.ok
    expected = Plain(case, case.initial).solve(np.array([0.0, 0.2, 0.4, 0.6]))
    assert motion.at([0.0, 0.2, 0.4, 0.6]).q == pytest.approx(expected[:, :3], abs=2e-6)


def passed(offset, end=0.6):
    """x, y of the body that passes at `offset` (without the weak member): steps as short as the distance asks for."""
    free, t, y = np.hypot(1.0, offset), 0.0, np.array([1.0, offset, -4.0, 0.0])

    def rates(_, y):
        length = np.hypot(y[0], y[1])
        pull = -5.0 * (length - free) / length
        return [y[2], y[3], pull * y[0], pull * y[1]]

    while t < end - 1e-12:
        h = min(end - t, 0.02 * np.hypot(y[0], y[1]))
        y = solve_ivp(rates, (t, t + h), y, "DOP853", rtol=1e-13, atol=1e-18, first_step=0.99 * h).y[:, -1]
        t += h
    return y[:2]


@BOTH
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("offset", [1e-4, 1e-6, 1e-8])
def test_a_pass_far_nearer_than_a_step_is_long_keeps_the_tolerance(integrator, tolerance, offset):
    """The force turns round within a part of a step; what its velocity is off by there leads on for long."""
    motion = simulate(read(passing(offset), integrator=integrator, tolerance=tolerance))
    if integrator == "gauss" and offset == 1e-8:  # between two windows, where no force is looked at
        assert motion.status is Status.ZERO_LENGTH
        assert "member 0 of group through" in motion.message
        return
    assert motion.status.ok
    assert motion.q[-1, :2] == pytest.approx(passed(offset), abs=10.0 * tolerance * np.abs(motion.q[:, 0] - 1.0).max())


def test_passes_near_zero_length_are_right_or_refused_whatever_window_they_fall_into():
    """Wherever windows end; a third at most is refused."""
    rng, refused = np.random.default_rng(0), 0
    for _ in range(24):
        offset, tolerance = 10.0 ** rng.uniform(-8.0, -3.0), 10.0 ** rng.uniform(-9.0, -4.0)
        scene = passing(offset, speed=-rng.uniform(2.5, 6.0))
        motion = simulate(read(scene, integrator="gauss", tolerance=tolerance))
        exact = simulate(read(scene, integrator="runge_kutta", tolerance=1e-12))
        assert exact.status.ok
        if motion.status.ok:
            bound = 20.0 * tolerance * np.abs(exact.q[:, 0] - 1.0).max()
            assert motion.q[-1, :2] == pytest.approx(exact.q[-1, :2], abs=bound)
        else:
            assert motion.status is Status.ZERO_LENGTH
            refused += 1
    assert refused <= 8


@BOTH
def test_members_of_no_strength_are_no_obstacle(integrator):
    case = read(passing(), integrator=integrator)
    found = evaluate(case, [0.0, 1.0])
    assert found.status.ok
    assert simulate(case, [0.0, 1.0]).at([0.5]).q[0, 0] == pytest.approx(1.0 - 4.0 * 0.5, abs=1e-7)


@BOTH
def test_ordinary_scenes_are_not_suspected(integrator):
    for seed in range(5):
        case = read(random_scene(seed, "spin", "ground"), integrator=integrator)
        assert evaluate(with_solver(case, tolerance=1e-5)).status.ok
