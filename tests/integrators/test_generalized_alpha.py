"""Generalized-alpha: second order, spectral radius, energy, landing on kinks, dense output."""

import numpy as np
import pytest

from mdstopo.integrators.driver import CLOSENESS, NEWTON_TOLERANCE
from mdstopo.integrators.steps import NEEDS_ROOM, STEP_LIMIT
from tests.integrators.scenes import Bench, Group, figure_3, random_scene, solved

FREE = [Group(0, 1, 40)]
MASSES = [(3.0, 0.5), (20.0, 8.0)]


@pytest.fixture(scope="module")
def paper():
    scene = figure_3()
    alpha = np.random.default_rng(7).uniform(0.01, 1.0, 1020)
    return scene, alpha, solved(scene, alpha, method="gauss", tolerance=1e-11)


@pytest.mark.parametrize("radius", [1.0, 0.8, 0.0])
def test_objective_and_gradient_converge_at_second_order(paper, radius):
    scene, alpha, exact = paper
    counts = np.array([50, 100, 200, 400]) * (8 if radius == 0.0 else 1)  # a large error settles late
    errors = []
    for count in counts:
        bench = solved(scene, alpha, radius=radius, step=0.2 / count)
        gradient = np.abs(bench.gradient - exact.gradient).max() / np.abs(exact.gradient).max()
        errors.append([abs(bench.value / exact.value - 1.0), gradient])
    slopes = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert np.all(np.abs(slopes + 2.0) <= 0.05)


def test_kinks_jumps_and_damping_keep_second_order():
    scene = random_scene(
        [Group(0, 1, 30, damping=4.0, preload=2.0), Group(1, 2, 20)], [*MASSES, (5.0, 1.0)],
        times=(0.0, 0.1, 0.17, 0.3), turning=3, jumps=True, spin=0.3,
    )  # fmt: skip
    alpha = np.random.default_rng(1).uniform(0.2, 1.0, 50)
    exact = solved(scene, alpha, method="gauss", tolerance=1e-11)
    counts = np.array([60, 120, 240, 480])
    errors = [np.abs(solved(scene, alpha, step=0.3 / c).state[-1] - exact.state[-1]).max() for c in counts]
    assert abs(np.polyfit(np.log(counts), np.log(errors), 1)[0] + 2.0) <= 0.05


def test_steps_land_on_every_kink_and_divide_each_segment_equally():
    scene = random_scene(FREE, MASSES, times=(0.0, 0.1, 0.17, 0.3))
    bench = solved(scene, np.full(40, 0.5), step=0.03)
    assert bench.t.tolist() == pytest.approx(
        [0, 0.025, 0.05, 0.075, 0.1, 0.1 + 0.07 / 3, 0.1 + 0.14 / 3, 0.17, 0.196, 0.222, 0.248, 0.274, 0.3]
    )
    assert set(scene.model.times) <= set(bench.t)


@pytest.mark.parametrize("radius", [0.8, 0.9, 0.95])
def test_what_is_too_fast_for_the_step_decays_by_the_spectral_radius(radius):
    scene = random_scene(
        [Group(1, 0, 30, stiffness=1e9)], [(1.0, 0.1)], ground=True, times=(0.0, 9.0), load=0.0, spin=1e-3
    )
    bench = solved(scene, np.ones(30), radius=radius, step=0.1, gradient=False)
    size = np.abs(bench.state[:, 0, :3] - bench.state[0, 0, :3]).max(axis=1)
    # a triple eigenvalue: its power times a polynomial of degree two
    rate = np.log(size[40] / size[20] / 4.0) / 20
    assert rate == pytest.approx(np.log(radius), abs=0.1)


def test_energy_is_kept_at_radius_one_and_only_falls_below_it():
    scene = random_scene([Group(0, 1, 40, preload=0.0)], MASSES, times=(0.0, 3.0), load=0.0, spin=0.4)
    alpha = np.ones(40)
    mass = 1.0 / scene.model.inv_mass

    def drift(radius, step):
        bench = solved(scene, alpha, radius=radius, step=step)
        stored = np.concatenate([[0.0], bench.scalar[: bench.count + (2 if radius < 1 else 1), 1]])[-bench.count :]
        total = 0.5 * bench.state[1:, 1] ** 2 @ mass + stored
        start = 0.5 * bench.state[0, 1] ** 2 @ mass
        return total / start - 1.0

    coarse, fine = np.abs(drift(1.0, 0.01)).max(), np.abs(drift(1.0, 0.005)).max()
    assert fine < 0.3 * coarse < 0.003
    assert np.all(drift(0.5, 0.02) < 1e-3)
    assert drift(0.5, 0.02)[-1] < drift(0.5, 0.02)[20] < 0.0


def test_internal_forces_leave_the_momentum_alone():
    scene = random_scene([Group(0, 1, 40, damping=2.0)], MASSES, times=(0.0, 3.0), load=0.0, spin=0.4)
    bench = solved(scene, np.ones(40), step=0.01, gradient=False)
    momentum = np.array([(bench.state[:, 1, axis::3] / scene.model.inv_mass[axis::3]).sum(axis=1) for axis in range(2)])
    assert np.abs(momentum - momentum[:, :1]).max() <= 1e-11 * np.abs(momentum).max()


def test_dense_output_is_of_second_order_and_its_velocity_its_derivative():
    scene = random_scene(FREE, MASSES, times=(0.0, 0.1, 0.3), jumps=True, turning=2)
    alpha = np.full(40, 0.7)
    exact = solved(scene, alpha, method="gauss", tolerance=1e-12)
    times = 0.0117 + 0.0129 * np.arange(22)  # at no end of a step
    errors = []
    for count in (30, 60):
        bench = solved(scene, alpha, step=0.3 / count)
        errors.append(np.abs(bench.at(times)[:2] - exact.at(times)[:2]).max(axis=(1, 2)))
    assert np.all(errors[0] / errors[1] > 3.5)
    d = 1e-5
    slope = (bench.at(times + d)[0] - bench.at(times - d)[0]) / (2 * d)
    assert np.allclose(slope, bench.at(times)[1], atol=1e-7)
    ends = bench.at(bench.t)
    assert np.array_equal(ends[0], bench.state[:, 0])
    assert np.array_equal(ends[1], bench.state[:, 1])


def test_a_small_step_costs_one_pass_over_the_members():
    bench = solved(random_scene(FREE, MASSES), np.ones(40), step=0.3 / 3000, gradient=False)
    assert bench.work[1] <= 1.02 * bench.count


def test_too_many_steps_are_refused_before_any_is_taken():
    bench = Bench(random_scene(FREE, MASSES))
    assert bench.run(np.ones(40), step=1e-9) == STEP_LIMIT
    assert bench.work[2] == 0


def test_room_is_asked_for_before_any_step_is_taken():
    bench = solved(random_scene(FREE, MASSES), np.ones(40), step=0.01, gradient=False)
    settings = np.array([1e-10, NEWTON_TOLERANCE, 3e-6, CLOSENESS])  # 100,000 steps: far more than there is room for
    work = np.zeros_like(bench.work)
    code, count, time = bench.entry.simulate(
        *bench.packed, bench.tables, bench.alpha, bench.scene.damped, True, settings, bench.limits, bench.room,
        bench.room_ints, bench.strength, work,
    )  # fmt: skip
    assert (code, count, time) == (NEEDS_ROOM, 0, bench.t[0])
    assert work[2] == 0
