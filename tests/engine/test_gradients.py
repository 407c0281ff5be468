"""The adjoint gradient against differences, and at the corners: no strain, no members, ties, peaks at the ends."""

from itertools import pairwise

import numpy as np
import pytest

from mdstopo import evaluate
from mdstopo.engine import Evaluator
from mdstopo.status import Status
from tests.engine.scenes import FEATURES, paper, random_design, random_scene, read, spring_scene, with_solver

EVERYTHING = sorted(FEATURES)
UNDAMPED = [f for f in EVERYTHING if f != "damping"]


def differences(case, alpha, directions, width=0.01):
    """Derivatives of the objective along directions (D, N) by central differences, extrapolated three times.

    Steps must be fixed by the case.
    """
    evaluator = Evaluator(case)

    def value(x):
        found = evaluator.evaluate(x, gradient=False)
        assert found.status.ok
        return found.objectives["G"]

    out = []
    for direction in directions:
        rows = []
        for k in range(4):
            h = width / 2**k
            rows.append((value(alpha + h * direction) - value(alpha - h * direction)) / (2 * h))
        for order in range(1, 4):
            rows = [(4**order * b - a) / (4**order - 1) for a, b in pairwise(rows)]
        out.append(rows[0])
    return np.array(out)


def directions_for(alpha, seed, count=4):
    """Random signs, scaled so that no component changes by more than its own size."""
    rng = np.random.default_rng(seed)
    return rng.choice([-1.0, 1.0], (count, len(alpha))) * alpha


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
@pytest.mark.parametrize("over_time", ["final", "mean", "integral", "max", "min"])
@pytest.mark.parametrize(
    ("features", "bodies"),
    [((), 2), (EVERYTHING, 3), (UNDAMPED, 2), (("damping", "ground", "follower"), 1)],
    ids=["plain", "everything", "undamped", "damped"],
)
def test_gradient_is_that_of_extrapolated_differences_on_the_same_steps(integrator, over_time, features, bodies):
    # with fixed steps the discretised objective is a smooth function of the design; at a peak inside the time its
    # differences see the moving peak, whose rate is zero (envelope theorem)
    if over_time == "min":  # never unstrained: else the smallest energy is 0, at the start
        features = {*features, "free_length"}
    scene = random_scene(34, *sorted(features), bodies=bodies, over_time=over_time)
    case = read(scene, integrator=integrator, step=0.02)
    alpha = random_design(case, 31, low=0.3)
    found = Evaluator(case).evaluate(alpha)
    assert found.status.ok
    directions = directions_for(alpha, 3)
    expected = differences(case, alpha, directions)
    gradient = found.gradients["G"]
    scale = np.abs(directions * gradient).sum(axis=1)
    assert np.all(scale > 0.0)
    assert directions @ gradient == pytest.approx(expected, rel=0, abs=1e-8 * scale.max())


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_each_entry_of_the_gradient_is_that_of_differences(integrator):
    case = read(random_scene(32, *EVERYTHING, bodies=2, over_time="final"), integrator=integrator, step=0.02)
    alpha = random_design(case, 32, low=0.3)
    gradient = Evaluator(case).evaluate(alpha).gradients["G"]
    chosen = np.unique(np.r_[np.abs(gradient).argsort()[-4:], 0, len(alpha) // 2, len(alpha) - 1])
    unit = np.eye(len(alpha))[chosen]
    expected = differences(case, alpha, unit)
    assert gradient[chosen] == pytest.approx(expected, rel=0, abs=1e-8 * np.abs(gradient).max())


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_highest_strain_at_the_start_is_a_peak_with_the_explicit_gradient(integrator):
    # pulled out and let go from rest: energy falls at first, and the start is the peak (dg/dt = 0 there)
    scene = spring_scene(end=0.1)
    scene["members"]["spring"]["law"]["free_length"] = 0.7
    found = evaluate(read(scene, integrator=integrator))
    assert found.peak_times["G"] == 0.0
    assert found.objectives["G"] == pytest.approx(0.5 * 200.0 * 0.3**2, rel=1e-14)
    assert found.gradients["G"] == pytest.approx([0.5 * 200.0 * 0.3**2], rel=1e-14)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_peak_at_the_end_carries_the_gradient_of_the_final_value(integrator):
    law = {"loads": [{"body": "mass", "force": [10.0, 0.0]}]}
    one = evaluate(read(spring_scene(end=0.2, **law), integrator=integrator))
    final = {"G": {"response": "energy", "over_time": "final"}}
    other = evaluate(read(spring_scene(end=0.2, objectives=final, **law), integrator=integrator))
    assert one.peak_times["G"] == other.peak_times["G"] == 0.2
    assert one.objectives["G"] == other.objectives["G"]
    assert one.gradients["G"] == pytest.approx(other.gradients["G"], rel=1e-14)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
@pytest.mark.parametrize("over_time", ["max", "min", "mean", "integral", "final"])
def test_nothing_strained_gives_zero_and_a_zero_gradient(integrator, over_time):
    scene = random_scene(5, "several", over_time=over_time)
    scene["loads"] = []  # both bodies fall together
    found = evaluate(read(scene, integrator=integrator))
    assert found.status is Status.OK
    assert found.objectives["G"] == pytest.approx(0.0, abs=1e-20)
    assert np.all(np.isfinite(found.gradients["G"]))
    assert np.abs(found.gradients["G"]).max() < 1e-12


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_members_of_no_strength_have_no_gradient_at_a_power_above_one(integrator):
    scene = random_scene(6, over_time="final")
    scene["design"]["power"] = 3
    case = read(scene, integrator=integrator)
    alpha = random_design(case, 6)
    alpha[::2] = 0.0
    found = evaluate(case, alpha)
    assert found.status.ok
    assert np.all(found.gradients["G"][::2] == 0.0)
    assert np.all(found.gradients["G"][1::2] != 0.0)
    nothing = evaluate(case, np.zeros_like(alpha))
    assert nothing.objectives["G"] == 0.0
    assert np.all(nothing.gradients["G"] == 0.0)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_designs_outside_the_bounds_are_evaluated_as_they_are(integrator):
    case = read(random_scene(7), integrator=integrator)
    found = evaluate(case, np.full(case.n_design, 3.0))
    stiffer = random_scene(7)
    for group in stiffer["members"].values():
        group["law"]["stiffness"] *= 3.0
    same = evaluate(read(stiffer, integrator=integrator), np.ones(case.n_design))
    assert found.objectives["G"] == pytest.approx(same.objectives["G"], rel=1e-12)
    assert 3.0 * found.gradients["G"] == pytest.approx(same.gradients["G"], rel=1e-11)


def test_a_member_that_carries_nothing_at_zero_strength_still_has_a_gradient_at_power_one():
    case = read(random_scene(8, over_time="final"))
    alpha = random_design(case, 8)
    alpha[0] = 0.0
    gradient = evaluate(with_solver(case, tolerance=1e-11), alpha).gradients["G"]
    # one-sided difference, second order: alpha = 0 is the edge
    h = 1e-5
    values = []
    for k in range(3):
        alpha[0] = k * h
        values.append(evaluate(with_solver(case, tolerance=1e-12), alpha, gradient=False).objectives["G"])
    slope = (-3 * values[0] + 4 * values[1] - values[2]) / (2 * h)
    assert gradient[0] == pytest.approx(slope, rel=0, abs=1e-5 * np.abs(gradient).max())


def test_a_time_history_has_steps_enough_to_see_and_is_the_gradient_of_shorter_motions():
    """Collocation needs one step here; the history has fifty, each line the gradient of a motion that ends there."""
    whole = Evaluator(with_solver(paper("fig6", ("objectives.G.over_time", "final")), tolerance=1e-10))
    alpha = whole.case.initial
    status, t, lines = whole.histories(alpha, "G")
    assert status.ok
    assert whole.integrator == "gauss"
    assert len(t) > 50
    assert lines.shape == (len(t), len(alpha))
    assert np.abs(lines[-1] - whole.evaluate(alpha).gradients["G"]).max() <= 1e-8 * np.abs(lines[-1]).max()
    k = len(t) // 3
    early = ("objectives.G.over_time", "final"), ("time.end", float(t[k]))
    gradient = Evaluator(with_solver(paper("fig6", *early), tolerance=1e-10)).evaluate(alpha).gradients["G"]
    assert np.abs(lines[k] - gradient).max() <= 1e-8 * np.abs(gradient).max()
