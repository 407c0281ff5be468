"""Motions against scipy's DOP853 on the plain equations; landing on kinks; dense output."""

import numpy as np
import pytest

from mdstopo import simulate
from tests.engine.plain import Plain
from tests.engine.scenes import FEATURES, paper, random_design, random_scene, read, spring_scene, with_solver

EVERYTHING = sorted(FEATURES)
SCENES = [
    ("plain", (), 2),
    ("several bodies", ("ground", "several", "reversed"), 4),
    ("damped", ("damping", "preload", "spin"), 2),
    ("loads", ("off_centre", "follower", "jumps", "ground"), 1),
    ("kinks", ("kinks", "free_length", "power"), 2),
    ("everything undamped", tuple(f for f in EVERYTHING if f != "damping"), 3),
    ("everything", tuple(EVERYTHING), 3),
]


@pytest.fixture(scope="module", params=SCENES, ids=[name for name, *_ in SCENES])
def solved(request):
    """A case, its design, times and DOP853's states there."""
    name, features, bodies = request.param
    case = read(random_scene(len(name), *features, bodies=bodies))
    alpha = random_design(case, 5)
    load_case = case.load_cases[0]
    times = np.linspace(load_case.start, load_case.end, 7)
    return case, alpha, times, Plain(case, alpha).solve(times)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_motion_is_that_of_an_independent_integrator(solved, integrator):
    case, alpha, times, expected = solved
    motion = simulate(with_solver(case, integrator=integrator, tolerance=1e-11), alpha)
    assert motion.status.ok
    states = motion.at(times)
    n = states.q.shape[1]
    way = np.abs(expected[:, :n] - expected[0, :n]).max()
    speed = np.abs(expected[:, n:]).max()
    assert np.abs(states.q - expected[:, :n]).max() <= 2e-10 * way
    assert np.abs(states.v - expected[:, n:]).max() <= 5e-10 * speed
    plain = Plain(case, alpha)
    for t, a, y in zip(times, states.a, expected, strict=True):
        right = plain.acceleration(t, y[:n], y[n:])
        assert a == pytest.approx(right, rel=0, abs=1e-8 * (np.abs(right).max() + 1.0))


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
@pytest.mark.parametrize("feature", ["kinks", "jumps"])
def test_rows_of_tables_are_ends_of_steps(integrator, feature):
    case = read(random_scene(11, feature), integrator=integrator, tolerance=1e-4)
    motion = simulate(case)
    kinks = Plain(case, case.initial).kinks
    assert len(kinks) > 3
    assert set(kinks.tolist()) <= set(motion.t.tolist())


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_accelerations_are_right_continuous_where_a_load_jumps(integrator):
    force = {"table": [[0.0, 1.0], [0.25, 1.0], [0.25, -7.0], [0.5, -3.0]]}
    case = read(spring_scene(stiffness=40.0, loads=[{"body": "mass", "force": [force, 0.0]}]), integrator=integrator)
    motion = simulate(case)
    k = int(np.flatnonzero(motion.t == 0.25)[0])
    before, at, after = motion.at([np.nextafter(0.25, 0.0), 0.25, np.nextafter(0.25, 1.0)]).a[:, 0]
    assert at == pytest.approx(after, abs=1e-12)
    assert at - before == pytest.approx(-8.0 / 2.0, abs=1e-12)
    assert motion.a[k, 0] == at
    # v is continuous there
    v = motion.at([np.nextafter(0.25, 0.0), 0.25, np.nextafter(0.25, 1.0)]).v[:, 0]
    assert np.ptp(v) < 1e-12


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
@pytest.mark.parametrize("features", [("kinks", "ground"), ("kinks", "damping")], ids=["undamped", "damped"])
def test_dense_output_is_continuous_and_as_accurate_as_the_steps(integrator, features):
    case = read(random_scene(21, *features), integrator=integrator, tolerance=1e-8)
    alpha = random_design(case, 2)
    motion = simulate(case, alpha)
    ends = motion.t[1:-1]
    assert len(ends) >= 3
    below, at = motion.at(np.nextafter(ends, -np.inf)), motion.at(ends)
    way, speed = np.abs(motion.q - motion.q[0]).max(), np.abs(motion.v).max()
    assert np.abs(below.q - at.q).max() <= 1e-13 * (1.0 + way)
    assert np.abs(below.v - at.v).max() <= 1e-12 * (1.0 + speed)
    between = np.sort(np.concatenate([motion.t[:-1] + c * np.diff(motion.t) for c in (0.13, 0.5, 0.81)]))
    states = motion.at(between)
    other = "gauss" if integrator == "runge_kutta" else "runge_kutta"
    fine = simulate(with_solver(case, integrator=other, tolerance=1e-12), alpha).at(between)
    assert np.abs(states.q - fine.q).max() <= 1e-7 * way
    assert np.abs(states.v - fine.v).max() <= 2e-7 * speed


def test_both_integrators_agree_on_the_papers_scene():
    case = paper("fig6")
    times = np.linspace(0.0, 0.2, 11)
    alpha = random_design(case, 7)
    a, b = (
        simulate(with_solver(case, integrator=each, tolerance=1e-12), alpha).at(times)
        for each in ("gauss", "runge_kutta")
    )
    assert np.abs(a.q - b.q).max() < 1e-13
    assert np.abs(a.v - b.v).max() < 1e-11
