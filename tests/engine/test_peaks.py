"""Where the largest and smallest stored energy are found: in continuous time, all that compete."""

import numpy as np
import pytest

from mdstopo import evaluate, simulate
from tests.engine.plain import Plain
from tests.engine.scenes import INTERIOR, interior, paper, random_scene, read, spring_scene, with_solver

BOTH = pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])

# G, t_n, entries 0, 39, 500 and the sum of dG/dalpha, made outside this package: forward sensitivities of the plain
# equations by DOP853 at rtol 1e-13 with t_n by Brent's method on dg/dt, and an unrelated reverse-mode program at fixed
# steps of order 8; the two agree to 1e-13
REFERENCE = {
    ("interior", "uniform"): (
        192.9072128969335, 0.2035247604316433,
        [-1.8622969233322968, -3.317293153509925, -2.764052022498989], -1936.7090525878057,
    ),
    ("interior", "random"): (
        38.841952234650876, 0.09131855131711068,
        [-0.08119316500312017, -0.1360125284987514, -0.10864276985397352], -78.31865540599617,
    ),
    ("fig6", "uniform"): (
        101.79334598698631, 0.2, [-0.36370742970445, None, -0.3832000320620508], -180.11744572761685,
    ),
    ("fig6", "random"): (
        29.741887993317263, 0.2, [-0.04866908966567238, None, -0.1175567473322004], -110.66004351966083,
    ),
}  # fmt: skip


def design(kind, n=1020):
    return np.full(n, 0.1) if kind == "uniform" else np.random.default_rng(7).uniform(0.01, 1.0, n)


@BOTH
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-11])
@pytest.mark.parametrize(("scene", "kind"), REFERENCE, ids=lambda x: x)
def test_peak_and_gradient_are_the_references(scene, kind, integrator, tolerance):
    value, time, entries, total = REFERENCE[scene, kind]
    case = interior() if scene == "interior" else paper("fig6")
    found = evaluate(with_solver(case, integrator=integrator, tolerance=tolerance), design(kind))
    gradient = found.gradients["G"]
    assert found.objectives["G"] == pytest.approx(value, rel=10 * tolerance)
    assert found.peak_times["G"] == pytest.approx(time, rel=100 * tolerance)
    largest = np.abs(gradient).max()
    for i, expected in zip((0, 39, 500), entries, strict=True):
        if expected is not None:
            assert gradient[i] == pytest.approx(expected, rel=0, abs=10 * tolerance * largest)
    assert gradient.sum() == pytest.approx(total, rel=10 * tolerance)


def test_a_peak_taken_from_a_grid_has_another_gradient():
    # the mistake: the highest of 41 samples differs little in G, but its gradient lacks dg/dt = 0
    case, alpha = interior(tolerance=1e-10), design("uniform")
    found = evaluate(case, alpha)
    plain = Plain(case, alpha)
    grid = np.linspace(0.0, 0.4, 41)
    energies = [plain.energy(q) for q in simulate(case, alpha).at(grid).q]
    best = int(np.argmax(energies))
    assert energies[best] == pytest.approx(found.objectives["G"], rel=2e-3)
    # the energy at the fixed time of the grid, differentiated
    final = paper(
        "fig6", INTERIOR[0], ("time.end", float(grid[best])), ("objectives.G.over_time", "final"),
        ("solver.tolerance", 1e-10),
    )  # fmt: skip
    on_grid = evaluate(final, alpha).gradients["G"]
    exact = found.gradients["G"]
    wrong = np.abs(on_grid - exact).max() / np.abs(exact).max()
    assert 0.01 < wrong < 0.2
    assert exact[39] == pytest.approx(REFERENCE["interior", "uniform"][2][1], rel=1e-9)


@BOTH
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_both_competing_peaks_are_found_highest_first(integrator, tolerance):
    found = evaluate(interior(integrator=integrator, tolerance=tolerance), design("random"))
    first, second = found.peaks["G"][:2]
    assert first.value == pytest.approx(38.842, abs=2e-3)
    assert first.time == pytest.approx(0.0914, abs=2e-4)
    assert second.value == pytest.approx(38.320, abs=2e-3)
    assert second.time == pytest.approx(0.273, abs=2e-4)
    assert len(found.peaks["G"]) == 2
    assert second.gradient is not None
    assert np.abs(second.gradient - first.gradient).max() > 1e-3 * np.abs(first.gradient).max()


@BOTH
def test_of_equal_peaks_the_earliest_comes_first_and_the_four_highest_are_kept(integrator):
    # a spring from rest under a constant force strains to the same value in every period
    omega = 10.0
    case = read(
        spring_scene(1.0, omega**2, end=6.0, loads=[{"body": "mass", "force": [20.0, 0.0]}]),
        integrator=integrator, tolerance=1e-10,
    )  # fmt: skip
    found = evaluate(case)
    peaks = found.peaks["G"]
    assert len(peaks) == 4
    # g = (2 F / k)^2 k / 2; the gradient at a fixed time is that of F^2 (1 - cos)^2 / (2 alpha k)
    assert peaks[0].value == pytest.approx(8.0, rel=1e-9)
    assert found.gradients["G"] == pytest.approx([-8.0], rel=1e-8)
    times = sorted(peak.time for peak in peaks)
    for time in times:
        n = (time * omega / np.pi - 1.0) / 2.0
        assert n == pytest.approx(round(n), abs=1e-6)
    assert len({round(time, 6) for time in times}) == 4
    values = [peak.value for peak in peaks]
    assert values == sorted(values, reverse=True)


@BOTH
@pytest.mark.parametrize("seed", range(12))
def test_no_moment_of_a_dense_sampling_is_higher_than_the_peak(integrator, seed):
    features = [(), ("kinks", "ground"), ("damping",), ("preload", "spin", "several")][seed % 4]
    scene = random_scene(seed, *features)
    scene["time"]["end"] = 0.05 + 1.5
    alpha = np.ones(read(scene).n_design)
    for over_time in ("max", "min"):
        scene["objectives"]["G"]["over_time"] = over_time
        case = read(scene, integrator=integrator, tolerance=1e-6)
        found = evaluate(case, alpha, gradient=False)
        fine = simulate(with_solver(case, integrator="gauss", tolerance=1e-10), alpha)
        plain = Plain(case, alpha)
        energies = np.array([plain.energy(q) for q in fine.at(np.linspace(0.05, 1.55, 400)).q])
        sign = 1.0 if over_time == "max" else -1.0
        highest = (sign * energies).max()
        assert sign * found.objectives["G"] >= highest - 1e-5 * energies.max()
        # every other peak that rises well above its surroundings and competes is there too
        inside = sign * energies
        tops = np.flatnonzero((inside[1:-1] > inside[:-2]) & (inside[1:-1] >= inside[2:])) + 1
        competing = [i for i in tops if inside[i] >= highest - 0.14 * abs(highest)]
        if len(competing) <= 3:
            times = np.array([peak.time for peak in found.peaks["G"]])
            for i in competing:
                assert np.abs(times - (0.05 + 1.5 * i / 399)).min() < 1.5 / 399 + 1e-6


@BOTH
@pytest.mark.parametrize("features", [(), ("damping", "preload", "kinks")], ids=["plain", "damped"])
def test_a_start_from_rest_unstrained_is_the_minimum_and_no_maximum(integrator, features):
    # dg/dt = 0 there, and the energy is rounding
    for seed in range(1040, 1046):
        scene = random_scene(seed, *features, bodies=2, over_time="min")
        case = read(scene, integrator=integrator)
        lowest = evaluate(case)
        assert lowest.peak_times["G"] == 0.05
        assert lowest.objectives["G"] < 1e-20
        scene["objectives"]["G"]["over_time"] = "max"
        highest = evaluate(read(scene, integrator=integrator))
        assert highest.objectives["G"] > 1e-3
        assert all(peak.time > 0.05 for peak in highest.peaks["G"])
