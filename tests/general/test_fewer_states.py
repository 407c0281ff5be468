"""Sums over fewer states than the stages of steps: of any candidate they are the same, or they are not taken."""

import numpy as np
import pytest

from mdstopo.case.scene import candidates as candidates_of_cases
from mdstopo.general.driver import fewer_states, general_pricing
from mdstopo.general.model.priced_candidates import FIRST_STAGE, LAST_STAGE, TOGETHER_LEVELS
from mdstopo.general.pricing.sampled_works import OF_CHANGES, OF_ELONGATION, OF_INVERSE, OF_RATE, sample_works
from tests.general.test_candidate_prices import (
    DENSE,
    ENERGY,
    PUSH,
    arm,
    assert_pass_is_right,
    dense,
    in_space,
    looked,
    states_of,
)

#: by name how a scene is made, and the law of its candidates
SCENES = {
    "slack belts": (arm, DENSE["slack"]),
    "curves": (arm, DENSE["curve"]),
    "crushed legs": (arm, {**DENSE["crushed"], "side": "compression"}),
    "crushed legs in space": (in_space, DENSE["crushed"]),
}


@pytest.fixture(autouse=True)
def many(monkeypatch):
    """Fewer states are looked for however few tiles there are; some 40 of the candidates are built."""
    monkeypatch.setattr(candidates_of_cases, "START_SET", 40)
    monkeypatch.setattr(general_pricing, "MANY_TILES", 0)


def scene_of(name, looks):
    """The candidates of a dense scene, and their states."""
    make, law = SCENES[name]
    return states_of(dense(make(law, **looks), 0.02 if make is arm else 0.002), 0.2)


def fewer_of(candidates, states):
    """The fewer states of a scene with one run that passes take."""
    (own,) = candidates._fewer(states, candidates.common(states, 0.0))
    return own


@pytest.mark.parametrize(
    ("name", "looks"),
    [
        *((name, ENERGY) for name in SCENES),
        ("curves", looked("energy", "mean")),
        *((name, {}) for name in SCENES if "space" not in name),
    ],
    ids=lambda each: (
        each if isinstance(each, str) else f"energy {each['objectives']['G']['over_time']}" if each else "peak"
    ),
)
def test_a_pass_that_sums_over_fewer_states_knows_what_each_candidate_is_worth(name, looks):
    candidates, states = scene_of(name, looks)
    stages, *together = (fewer_of(candidates, states).few @ [-1, 1]).sum(axis=0)
    assert 0 < together[-1] < 0.5 * stages
    assert_pass_is_right(candidates, states)


@pytest.mark.parametrize("name", ["curves", "crushed legs"])
def test_sums_over_fewer_states_are_those_over_all_stages_for_candidates_that_were_not_looked_at(name):
    candidates, states = scene_of(name, looked(PUSH, "rms"))
    own = fewer_of(candidates, states)
    (run,) = general_pricing._runs(states.scenes[0], candidates._places[0])
    rng = np.random.default_rng(7)
    places = np.stack([rng.integers(0, len(numbers), 64) for numbers in candidates.chosen])
    change = run.change[:, 0]
    works = np.empty((len(run.when), OF_CHANGES + change.shape[1], places.shape[1]))
    sample_works(*candidates._packed_scene(states), *candidates._packed(states, candidates.chosen), 0, places, works)
    compared = 0
    for level in range(1, TOGETHER_LEVELS):
        for s in np.flatnonzero(own.few[:, level, 1]):
            few = np.arange(*own.few[s, level]) - len(works)
            stages = np.arange(run.step[s, FIRST_STAGE], run.step[s + (1 << level) - 1, LAST_STAGE])
            assert np.isfinite(own.nearest[s, level])  # there are candidates too short for any few states
            fits = works[own.state[few[0]], OF_INVERSE] <= own.nearest[s, level]
            compared += fits.sum()
            for kind in (OF_ELONGATION, OF_RATE):
                each = works[:, OF_CHANGES:] * works[:, kind, None]
                all_stages = np.einsum("sc,scm->m", change[stages], each[stages])
                some = np.einsum("sc,scm->m", own.change[few], each[own.state[few]])
                size = np.abs(change[stages, :, None] * each[stages]).sum(axis=(0, 1)).max()
                assert np.abs(some - all_stages)[fits].max(initial=0.0) <= 1e-12 * size
    assert compared > 500


def test_all_stages_are_summed_where_prices_with_fewer_states_would_differ(monkeypatch):
    monkeypatch.setattr(fewer_states, "EXACT", 1e-5)
    candidates, states = scene_of("curves", ENERGY)
    common, every = candidates.common(states, 0.0), np.arange(candidates.shape[0] * candidates.shape[1])
    few = candidates._find_fewer(states)
    assert len(few[0].state) > 0
    assert not candidates._is_same(states, common, few)
    _, found = candidates.tiles(states, common, every, True)
    monkeypatch.setattr(general_pricing, "MANY_TILES", len(every) + 1)
    _, own = candidates.tiles(states, common, every, True)
    assert np.array_equal(found, own)


def test_a_pass_that_sums_over_fewer_states_does_not_depend_on_threads(monkeypatch):
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("MDSTOPO_THREADS", threads)
        candidates, states = scene_of("slack belts", ENERGY)
        assert len(fewer_of(candidates, states).state) > 0
        found.append(candidates.tiles(states, candidates.common(states, 0.0), np.arange(candidates.shape[1]), True)[1])
    assert np.array_equal(*found)
