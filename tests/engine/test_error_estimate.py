"""Error estimates are what the errors are: against motions of another integrator at the tightest tolerance."""

import math

import numpy as np
import pytest

from mdstopo import evaluate
from mdstopo.error_estimate import ROUNDING
from tests.engine.scenes import FEATURES, paper, random_design, random_scene, read, with_solver
from tests.tiers import examples

SCENES = examples(15, 30)
OTHER = {"gauss": "runge_kutta", "runge_kutta": "gauss", "generalized_alpha": "gauss"}


def scene(seed):
    """A random scene with two to four random features, its objective of a random kind, and a random design."""
    rng = np.random.default_rng(seed)
    features = rng.choice(sorted(FEATURES), size=rng.integers(2, 5), replace=False)
    over_time = ("max", "mean", "final", "integral")[seed % 4]
    case = read(random_scene(seed, *features, bodies=int(rng.integers(2, 4)), over_time=over_time))
    return case, random_design(case, seed)


def ratios(case, alpha, integrator, tolerance, exact):
    """Estimate over true error, of the value and of the gradient, neither below rounding."""
    found = evaluate(with_solver(case, integrator=integrator, tolerance=tolerance), alpha, error_estimate=True)
    (name,) = found.objectives
    largest = np.abs(exact.gradients[name]).max()
    true = (
        abs(found.objectives[name] - exact.objectives[name]) + 10 * ROUNDING * abs(exact.objectives[name]),
        np.abs(found.gradients[name] - exact.gradients[name]).max() + 10 * ROUNDING * largest,
    )
    error = found.errors[name]
    rounding = 10 * ROUNDING * abs(exact.objectives[name]), 10 * ROUNDING * largest
    return [(e + r) / t for e, r, t in zip((error.value, error.gradient), rounding, true, strict=True)]


@pytest.mark.parametrize(
    ("integrator", "tolerances"),
    [
        ("gauss", (1e-4, 1e-6, 1e-8, 1e-10)),
        ("runge_kutta", (1e-4, 1e-6, 1e-8, 1e-10)),
        ("generalized_alpha", (1e-4,)),
    ],
)
def test_estimates_are_within_a_factor_of_ten_in_95_of_100_random_scenes(integrator, tolerances):
    found = []
    for seed in range(SCENES):
        case, alpha = scene(500 + seed)
        exact = evaluate(with_solver(case, integrator=OTHER[integrator], tolerance=1e-13), alpha)
        if not exact.status.ok or not exact.objectives["G"]:
            continue
        for tolerance in tolerances:
            found += ratios(case, alpha, integrator, tolerance, exact)
    assert len(found) >= 1.5 * SCENES
    within = np.mean([0.1 <= ratio <= 10.0 for ratio in found])
    assert within >= 0.95, sorted(found)[:5] + sorted(found)[-5:]


def test_an_evaluation_without_gradient_has_an_estimate_of_the_value_alone():
    error = evaluate(paper("fig6"), gradient=False, error_estimate=True).errors["G"]
    assert 0.0 < error.value < 1e-8 * 102
    assert math.isnan(error.gradient)


def test_fixed_steps_are_halved():
    case = with_solver(paper("fig6"), integrator="generalized_alpha", step=0.004)
    exact = evaluate(with_solver(paper("fig6"), tolerance=1e-13))
    found = evaluate(case, error_estimate=True)
    true = abs(found.objectives["G"] - exact.objectives["G"])
    assert found.errors["G"].value == pytest.approx(true, rel=1e-2)


def test_at_the_tightest_tolerance_the_estimate_is_still_no_smaller_than_the_error():
    case = with_solver(paper("fig6"), tolerance=1e-13)
    exact = evaluate(with_solver(paper("fig6"), integrator="runge_kutta", tolerance=1e-13))
    found = evaluate(case, error_estimate=True)
    true = np.abs(found.gradients["G"] - exact.gradients["G"]).max()
    assert 0.1 * true <= found.errors["G"].gradient <= 1e-11


def test_the_methods_of_other_steps_are_estimated_on_those_steps():
    found = evaluate(with_solver(paper("fig6"), tolerance=1e-5), method="iterative", error_estimate=True)
    exact = evaluate(with_solver(paper("fig6"), tolerance=1e-12))
    true = np.abs(found.gradients["G"] - exact.gradients["G"]).max()
    assert found.errors["G"].gradient == pytest.approx(true, rel=0.2)


#: length m, stiffness N/m, mass kg, load N, end s: a spring whose elongation is near the rounding of its length
ROUNDED = {
    "a long member": (1e4, 1.0, 1.0, 1e-4, 2.0),
    "a long member for some periods": (1e4, 1.0, 1.0, 1e-4, 20.5),
    "a light body": (1.0, 1.0, 1e-6, 1e-6, 0.01),
    "a stiff member": (1.0, 1e8, 1.0, 2.0, 0.0031),
    "a stiff member for hundreds of periods": (1.0, 1e8, 1.0, 2.0, 0.31),
    "a moment": (1.0, 100.0, 1.0, 100.0, 1e-6),
    "a member that stretches": (1.0, 100.0, 1.0, 10.0, 1.0),
}


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
@pytest.mark.parametrize("which", ROUNDED)
def test_estimates_know_what_rounding_leaves_of_a_small_elongation(which, integrator):
    """Against the closed form x = F/(alpha k) (1 - cos wt), w^2 = alpha k/m, G = alpha k x^2/2."""
    length, k, m, force, end = ROUNDED[which]
    case = read(
        {
            "time": {"end": end},
            "bodies": {"ball": {"mass": m, "inertia": m, "position": [length, 0.0]}},
            "members": {
                "tie": {
                    "from": {"body": "ground", "at": [0.0, 0.0]},
                    "to": {"body": "ball", "at": [length, 0.0]},
                    "law": {"type": "spring", "stiffness": k},
                }
            },
            "loads": [{"body": "ball", "force": [force, 0.0]}],
            "design": {"initial": 1.0},
            "objectives": {"G": {"response": "energy", "over_time": "final"}},
        },
        tolerance=1e-10,
        integrator=integrator,
    )
    phase = math.sqrt(k / m) * end
    x = 2.0 * force / k * math.sin(0.5 * phase) ** 2
    value = 0.5 * k * x * x
    gradient = value + k * x * (0.5 * phase * math.sin(phase) * force / k - x)
    found = evaluate(case, error_estimate=True)
    error = found.errors["G"]
    assert abs(found.objectives["G"] - value) <= 10.0 * error.value
    assert abs(found.gradients["G"][0] - gradient) <= 10.0 * error.gradient
    assert error.value <= 1e-4 * value  # it is an estimate still
