"""adjoint, direct and iterative agree with each other on the same steps; adjoint with extrapolated differences."""

import numpy as np
import pytest

from mdstopo.engine import Evaluator
from mdstopo.sensitivity.reductions import FINAL, INTEGRAL, MAX, MEAN, MIN
from tests.engine.plain import Plain
from tests.engine.scenes import FEATURES, random_design, read
from tests.engine.scenes import random_scene as random_case
from tests.integrators.scenes import Bench, Group, energy_at, random_scene, solved

ALL = (MAX, MIN, MEAN, INTEGRAL, FINAL)
SCENES = {
    "free": random_scene([Group(0, 1, 40)], [(3, 0.5), (20, 8)]),
    "three bodies, damped, preloaded, mu 3, fixed members, turning loads, jumps": random_scene(
        [
            Group(0, 1, 30, damping=4.0, preload=2.0),
            Group(1, 2, 20, power=3.0),
            Group(0, 2, 17, design=False, damping=1.0),
        ],
        [(3, 0.5), (5, 1.0), (20, 8)],
        times=(0, 0.1, 0.17, 0.3), turning=3, jumps=True, spin=0.3,
    ),
    "tied to ground, a kink": random_scene(
        [Group(0, 2, 30, preload=1.0), Group(1, 0, 20, damping=3.0)], [(3, 0.5), (5, 1.0)],
        times=(0, 0.13, 0.3), turning=2, ground=True, spin=0.3,
    ),
}  # fmt: skip
#: scenes as cases, and what is at their design (`tests.engine.scenes.random_scene`)
CASES = {
    "plain": random_case(34),
    "everything": random_case(34, *sorted(FEATURES), bodies=3),
    "tied to ground": random_case(34, "damping", "ground", "follower", bodies=1),
}
KINDS = ("max", "min", "mean", "integral", "final")


def case_of(name, method):
    """A case with an objective of every kind, and a design of it."""
    scene = dict(CASES[name])
    scene["objectives"] = {kind: {"response": "energy", "over_time": kind} for kind in KINDS}
    scene["combine"] = {"weights": dict.fromkeys(KINDS, 1)}
    case = read(scene, integrator=method, step=0.02)
    return case, random_design(case, 31, low=0.3)


@pytest.mark.parametrize("method", ["gauss", "runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize("name", CASES)
def test_exact_methods_agree_on_the_same_steps(name, method):
    """The adjoint sweep is that of springs between free bodies, the others go forward through general steps."""
    case, alpha = case_of(name, method)
    own = Evaluator(case)
    adjoint = own.evaluate(alpha)
    assert own.beyond == ""
    others = ["direct", *(["iterative"] if method == "generalized_alpha" else [])]
    for other in others:
        found = own.evaluate(alpha, sensitivity=other)
        assert found.message == ""
        for kind, gradient in adjoint.gradients.items():
            assert found.objectives[kind] == pytest.approx(adjoint.objectives[kind], rel=1e-11)
            assert np.abs(found.gradients[kind] - gradient).max() <= 1e-10 * max(np.abs(gradient).max(), 1e-9)
    status, _, history = own.histories(alpha, "final")
    assert status.ok
    final = adjoint.gradients["final"]
    assert np.abs(history[-1] - final).max() <= 1e-10 * np.abs(final).max()
    plain = Plain(case, alpha)
    power = np.concatenate([np.full(len(group), group.power) for group in case.members if group.design])
    start = power * alpha ** (power - 1.0) * plain.energies(plain.start[: len(plain.mass)])
    assert history[0] == pytest.approx(start, rel=1e-9, abs=1e-20)


@pytest.mark.parametrize("radius", [0.0, 0.8, 1.0])
@pytest.mark.parametrize("name", SCENES)
def test_gradients_agree_with_extrapolated_differences_on_frozen_steps(name, radius):
    alpha, step = np.random.default_rng(1).uniform(0.2, 1.0, SCENES[name].n_design), 0.3 / 40
    bench = solved(SCENES[name], alpha, radius=radius, reductions=ALL, step=step, tolerance=1e-9, newton=1e-15)
    peak = bench.rows[0, 0, 0]
    exact = bench.gradients[[0, 2, 3, 4], 0]
    other = Bench(bench.scene, radius=radius, reductions=ALL)

    def values(design):
        other.run(design, step=step, gradient=False, newton=1e-15)
        return np.array([energy_at(other, peak), *other.rows[2:, 0, 1]])

    def difference(i, width):
        change = np.zeros_like(alpha)
        change[i] = width
        return (values(alpha + change) - values(alpha - change)) / (2 * width)

    for i in np.random.default_rng(2).choice(len(alpha), 4, replace=False):
        coarse, middle, fine = (difference(i, width) for width in (0.04, 0.02, 0.01))
        better = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
        extrapolated = (16 * better[1] - better[0]) / 15
        assert np.all(np.abs(extrapolated - exact[:, i]) <= 1e-8 * np.abs(exact).max(axis=1))
