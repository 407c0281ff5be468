"""Forces, compatibility matrix and energy against the paper's equations written out member by member."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo import simulate
from mdstopo.engine import Evaluator
from mdstopo.mechanics.start_tangents_entry import start_tangents
from mdstopo.scene.compile_scene import compile_members, compile_scene, state_order
from mdstopo.scene.grid_members import places_of
from mdstopo.scene.packing import pack
from mdstopo.scene.springs_model import COUNT, DESIGN, STIFFNESS
from tests.engine.plain import Plain
from tests.engine.scenes import FEATURES, random_design, random_scene, read

EVERYTHING = sorted(FEATURES)


def drawn(seed, features, bodies=3):
    case = read(random_scene(seed, *features, bodies=bodies))
    return case, random_design(case, seed)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.sets(st.sampled_from(EVERYTHING)), st.integers(1, 4))
def test_accelerations_are_those_of_the_equations_member_by_member(seed, features, bodies):
    if bodies == 1:
        features = features | {"ground"}
    case, alpha = drawn(seed, sorted(features), bodies)
    motion = simulate(case, alpha)
    times = np.linspace(motion.t[0], motion.t[-1], 9)
    states = motion.at(times)
    plain = Plain(case, alpha)
    for t, q, v, a in zip(times, states.q, states.v, states.a, strict=True):
        expected = plain.acceleration(t, q, v)
        scale = np.abs(expected).max() + 9.8
        assert a == pytest.approx(expected, rel=0, abs=1e-11 * scale)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.sets(st.sampled_from(EVERYTHING)))
def test_the_reference_itself_obeys_its_differentials(seed, features):
    # B = -dDelta/dq (Eq. 36), and undamped forces without preload are minus the slope of the energy
    case, alpha = drawn(seed, sorted(features - {"damping", "preload", "fixed"}), bodies=2)
    plain = Plain(case, alpha)
    rng = np.random.default_rng(seed)
    q = plain.start[:6] + rng.uniform(-0.2, 0.2, 6)
    at_rest = np.zeros(6)
    for d in range(6):
        step = np.zeros(6)
        step[d] = 1e-6
        for above, here, below in zip(
            plain.groups(q + step, at_rest), plain.groups(q, at_rest), plain.groups(q - step, at_rest), strict=True
        ):
            assert -here[3][:, d] == pytest.approx((above[4] - below[4]) / 2e-6, abs=2e-8)
        slope = (plain.energy(q + step) - plain.energy(q - step)) / 2e-6
        assert plain.member_force(q, at_rest)[d] == pytest.approx(-slope, rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_energy_over_time_is_that_of_the_design_members(seed):
    case, alpha = drawn(seed, EVERYTHING)
    motion = simulate(case, alpha)
    plain = Plain(case, alpha)
    final = read({**random_scene(seed, *EVERYTHING, bodies=3, over_time="final")})
    q = motion.q[-1]
    assert Evaluator(final).evaluate(alpha).objectives["G"] == pytest.approx(plain.energy(q), rel=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_tangents_are_the_differentials_of_the_forces(seed):
    # at a state away from the start, damping's part included, against differences of the plain forces
    case, alpha = drawn(seed, EVERYTHING)
    plain = Plain(case, alpha)
    order = state_order(case)
    shared = compile_members(case, {name: i for i, name in enumerate(order)})
    model = compile_scene(case, case.load_cases[0], shared).model
    n, moving = len(model.inv_mass), 3 * len(case.bodies)
    rng = np.random.default_rng(seed)
    q, v = model.q0.copy(), model.v0.copy()
    q[:moving] = rng.uniform(-0.2, 0.2, moving)
    v[:moving] += rng.uniform(-1.0, 1.0, moving)
    strength = model.member[STIFFNESS:].copy()
    for block, mu in zip(model.block.tolist(), model.power, strict=True):
        if block[DESIGN] >= 0:
            first = block[DESIGN]
            strength[:, places_of(block)] *= alpha[first : first + block[COUNT]] ** mu
    segment = 1
    t = model.times[segment]
    pairs = len(model.pair)
    k, turns = np.zeros((1, pairs, 6, 6)), np.zeros((1, n))
    later = model._replace(
        q0=q, v0=v, times=model.times[segment:], force=model.force[segment:], load_force=model.load_force[segment:]
    )
    packed = pack(later)
    start_tangents(packed.ints, packed.floats, strength, True, k, turns)
    K = np.zeros((n, n))
    for p, (a, b) in enumerate(model.pair):
        rows = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
        K[np.ix_(rows, rows)] += k[0, p]
    for b in range(0, n, 3):
        K[b : b + 3, b + 2] -= turns[0, b : b + 3]
    scale = np.abs(K).max()
    for d in range(moving):
        step = np.zeros(moving)
        step[d] = 1e-6
        x, w = model.home[:, :3].ravel()[:moving] + q[:moving], v[:moving]
        above = plain.member_force(x + step, w) + plain.load_force(t, x + step)
        below = plain.member_force(x - step, w) + plain.load_force(t, x - step)
        assert -K[:moving, d] == pytest.approx((above - below) / 2e-6, rel=0, abs=1e-7 * scale)
