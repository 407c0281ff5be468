"""adjoint, direct and iterative agree with each other on the same steps, and with extrapolated differences."""

import numpy as np
import pytest

from mdstopo.sensitivity.reductions import FINAL, INTEGRAL, MAX, MEAN, MIN
from tests.integrators.scenes import Bench, Group, energies, energy_at, random_scene, solved

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
METHODS = [("gauss", 0.0), ("runge_kutta", 0.0), *(("generalized_alpha", r) for r in (0.0, 0.8, 1.0))]


def bench_of(name, method, radius, **options) -> Bench:
    scene = SCENES[name]
    alpha = np.random.default_rng(1).uniform(0.2, 1.0, scene.n_design)
    step = 0.3 / 40 if method == "generalized_alpha" else 0.0
    return solved(scene, alpha, method=method, radius=radius, reductions=ALL, step=step, tolerance=1e-9, **options)


@pytest.mark.parametrize(("method", "radius"), METHODS)
@pytest.mark.parametrize("name", SCENES)
def test_exact_methods_agree_on_the_same_steps(name, method, radius):
    bench = bench_of(name, method, radius)
    found, history = bench.direct(history=True)
    others = [found]
    if method == "generalized_alpha":
        iterative, stopped = bench.iterative()
        assert stopped == -1
        others.append(iterative)
    for other in others:
        for j in range(len(ALL)):
            rows = bench.found[j]
            size = max(np.abs(bench.gradients[j, :rows]).max(), 1e-9)
            assert np.abs(other[j, :rows] - bench.gradients[j, :rows]).max() <= 1e-12 * size
    final = bench.gradients[4, 0]
    assert np.abs(history[-1] - final).max() <= 1e-12 * np.abs(final).max()
    unit, power = energies(bench.scene, bench.state[0, 0])
    assert np.allclose(history[0], power * bench.alpha ** (power - 1.0) * unit, atol=1e-20)


@pytest.mark.parametrize("radius", [0.0, 0.8, 1.0])
@pytest.mark.parametrize("name", SCENES)
def test_gradients_agree_with_extrapolated_differences_on_frozen_steps(name, radius):
    bench = bench_of(name, "generalized_alpha", radius, newton=1e-15)
    alpha, step, peak = bench.alpha, 0.3 / 40, bench.rows[0, 0, 0]
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


def test_iterative_says_where_it_does_not_contract():
    scene = random_scene([Group(1, 0, 30, stiffness=1e6)], [(1.0, 0.1)], ground=True)
    bench = solved(scene, np.ones(30), step=0.1)
    assert bench.iterative()[1] == 0
    assert np.abs(bench.direct()[0, 0] - bench.gradient).max() <= 1e-9 * np.abs(bench.gradient).max()
