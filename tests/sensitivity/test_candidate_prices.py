"""Prices of candidates that are not built: the gradient that they would have if they were."""

import json

import numpy as np
import pytest

from mdstopo.case.scene.candidates import spread, with_members
from mdstopo.engine import Evaluator
from mdstopo.sensitivity.candidate_pass import SAMPLE, SMOOTH_ERROR
from mdstopo.sensitivity.springs_candidate_prices import BEST, COMPUTED, ERROR, SEEN
from mdstopo.sensitivity.tile_interpolation import BROAD, TALL
from tests.reading import case_from

#: relative to the largest
AGREE = 1e-10


def plate(law=None, group=None, **more):
    """A hull with 33 points above a deck with 150; candidates between them are priced."""
    return {
        "gravity": [0, -9.8],
        "time": {"end": 0.3},
        "bodies": {
            "hull": {"mass": 40, "inertia": 8, "position": [0, 0.1], "angle": 0.3},
            "deck": {"mass": 900, "inertia": 700, "position": [0.2, -1.2]},
        },
        "points": {
            "p": {"body": "hull", "grid": {"line": {"from": [-0.3, 0.2], "to": [0.4, 0.3], "count": 33}}},
            "q": {"body": "deck", "grid": {"line": {"from": [-1, -1.1], "to": [1.2, -1], "count": 150}}},
        },
        "members": {
            "web": {
                "from": "p", "to": "q", "law": {"type": "spring", "stiffness": 400, **(law or {})},
                "candidates": "priced", **(group or {}),
            },
            "beside": {"from": "p", "to": {"body": "deck", "at": [3, 0]}, "law": {"type": "spring", "stiffness": 3}},
        },
        "loads": [{"body": "deck", "acceleration": [9.8, 0], "angular_acceleration": 20}],
        "design": {"initial": 0.4, "lower": 0},
        "objectives": {"G": {"response": "energy"}},
        **more,
    }  # fmt: skip


def ground(scene):
    """The same with the deck's points on ground, far from the origin: there the scene turns members round."""
    scene["points"]["q"]["body"] = "ground"
    scene["members"]["beside"]["to"]["body"] = "ground"
    for body in scene["bodies"].values():
        body["position"][0] += 1e6
    scene["members"]["beside"]["to"]["at"][0] += 1e6
    for name in ("p", "q"):
        for end in ("from", "to"):
            scene["points"][name]["grid"]["line"][end][0] += 1e6
    return scene


def looked(over_time):
    return {"objectives": {"G": {"response": "energy", "over_time": over_time}}}


SCENES = {
    "max": plate(),
    "final": plate(**looked("final")),
    "mean": plate(**looked("mean")),
    "integral": plate(**looked("integral")),
    "least": plate(
        law={"free_length": 0.9}, objectives={"G": {"response": "energy", "over_time": "min", "sense": "maximize"}}
    ),
    "runge_kutta": plate(solver={"integrator": "runge_kutta"}),
    "generalized_alpha": plate(solver={"integrator": "generalized_alpha", "step": 0.005}),
    "damped": plate(law={"damping": 3}),
    "preloaded": plate(law={"preload": 5, "free_length": 0.9}),
    "free length": plate(law={"free_length": 0.9}),
    "filtered": plate(group={"min_length": 1.2, "max_length": 1.5, "cost": "length"}),
    "ground": ground(plate()),
    "follower": plate(loads=[{"body": "deck", "force": [3e3, 0], "at": [0.5, -1], "frame": "body"}]),
}


def priced(scene):
    """The case, its candidates' pairs, what rows ask of them, and the gradient of all of them at the same design."""
    case = case_from(scene)
    group = case.members[0]
    i, j = np.divmod(np.arange(group.candidates.count), len(group.to_local))
    length = np.hypot(*(group.to_world[j] - group.from_world[i]).T)
    inside = (length >= group.candidates.shortest) & (length <= group.candidates.longest)
    i, j = i[inside], j[inside]
    whole = with_members(case, {"web": (i, j)})
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    x = np.random.default_rng(5).uniform(0.1, 1.0, case.n_design)
    evaluation = problem.evaluation(x)
    sample = problem.sample_of(evaluation)
    factor = np.linspace(1.0, 0.5, len(sample.rows))
    states = problem.pricing_states(evaluation, factor)
    there = np.isin(i * len(group.to_local) + j, group.from_index * len(group.to_local) + group.to_index)
    alpha = np.zeros(whole.n_design)
    alpha[: len(i)][there] = x[: len(group)]
    alpha[len(i) :] = x[len(group) :]
    found = Evaluator(whole).problem().evaluate(alpha)
    assert np.allclose(found.rows, sample.rows, rtol=1e-12, atol=0)
    return evaluator.candidates_of(group), (i, j), states, (factor @ found.gradients)[: len(i)], there, case


@pytest.mark.parametrize("name", SCENES)
def test_prices_are_the_gradient_of_candidates_that_are_built(name):
    candidates, (i, j), states, gradient, _, _ = priced(SCENES[name])
    assert len(i) > 300
    assert np.abs(candidates.prices(states, i, j) - gradient).max() <= AGREE * np.abs(gradient).max()


def test_all_methods_differentiate_by_the_members_that_are_built():
    """Though a case that names another method than the adjoint one cannot price the others."""
    evaluator = Evaluator(case_from(SCENES["max"]))
    alpha = np.random.default_rng(5).uniform(0.1, 1.0, evaluator.case.n_design)
    usual = evaluator.evaluate(alpha).gradients["G"]
    direct = evaluator.evaluate(alpha, sensitivity="direct").gradients["G"]
    assert np.abs(direct - usual).max() <= AGREE * np.abs(usual).max()
    status, t, lines = evaluator.histories(alpha, "G")
    assert status.ok
    assert lines.shape == (len(t), len(alpha))


@pytest.mark.parametrize("name", SCENES)
def test_a_pass_finds_the_best_candidates_and_what_all_gain(name):
    candidates, (i, j), states, gradient, there, case = priced(SCENES[name])
    group = case.members[0]
    cost = np.hypot(*(group.to_world[j] - group.from_world[i]).T) if group.candidates.cost is None else 1.0
    worth = 0.1 * np.abs(gradient).max()
    gain = np.where(there, -np.inf, -(gradient + worth * cost))
    found = candidates.go_through(states, worth, 10**6)
    size = np.abs(gradient).max()
    assert found.seen == (~there).sum()
    assert abs(found.best - max(gain.max(), 0.0)) <= AGREE * size
    assert abs(found.together - np.maximum(gain, 0.0).sum()) <= 1e-9 * len(i) * size
    assert abs(found.ratio - np.maximum(gain / cost, 0.0).max()) <= AGREE * size
    # every tile of this scene is among those of which all are told
    told = sorted(zip(found.i.tolist(), found.j.tolist(), strict=True))
    assert told == sorted(zip(i[~there].tolist(), j[~there].tolist(), strict=True))
    assert np.all(np.diff(found.gain) <= 0.0)
    by_pair = dict(zip(zip(i.tolist(), j.tolist(), strict=True), gain.tolist(), strict=True))
    wanted = [by_pair[pair] for pair in zip(found.i.tolist(), found.j.tolist(), strict=True)]
    assert np.abs(found.gain - wanted).max() <= AGREE * size


@pytest.mark.parametrize("name", ["mean", "damped", "free length", "filtered"])
def test_a_dense_pass_computes_few_of_the_prices_and_knows_all(name):
    scene = json.loads(json.dumps(SCENES[name]))
    for grid, count in (("p", 3 * TALL), ("q", 2 * BROAD)):
        line = scene["points"][grid]["grid"]["line"]
        line["to"] = (0.95 * np.array(line["from"]) + 0.05 * np.array(line["to"])).tolist()
        line["count"] = count
    if name == "filtered":  # some of them
        scene["members"]["web"]["max_length"] = 1.48
    candidates, _, states, gradient, _, _ = priced(scene)
    size = np.abs(gradient).max()
    assert_dense_pass_is_right(candidates, states, size, 1e-12)


def assert_dense_pass_is_right(candidates, states, size, error):
    """A pass over all tiles is, tile by tile, what it is with every price computed; error: relative to `size`."""
    common = candidates.common(states, 0.1 * size)
    every = np.arange(candidates.shape[0] * candidates.shape[1])
    few, prices = candidates.tiles(states, common, every, True)
    assert 0.0 < common[ERROR] <= 1.01 * error * size
    common[ERROR] = 0.0
    all_of_them, exact = candidates.tiles(states, common, every, True)
    assert few[:, COMPUTED].sum() < 0.25 * all_of_them[:, COMPUTED].sum()
    assert np.array_equal(few[:, SEEN], all_of_them[:, SEEN])
    assert np.array_equal(np.isfinite(prices), np.isfinite(exact))
    there = np.isfinite(exact)
    assert np.abs(prices[there] - exact[there]).max() <= 10.0 * error * size
    assert np.abs(few[:, BEST] - all_of_them[:, BEST]).max() <= 10.0 * error * size


def test_prices_may_be_off_by_as_little_of_the_largest_where_lengths_leave_few_candidates():
    """So few that none is among evenly spread pairs; an error of nothing would have every candidate priced."""
    length = float(np.hypot(0.4 + 0.3, -1.1 - 0.2)) + 0.003
    few = {"min_length": length - 0.0005, "max_length": length + 0.0005}
    candidates, (i, j), states, gradient, _, _ = priced(plate(group=few))
    p, q = spread(33, 150, SAMPLE)
    assert not (np.isin(i, p) & np.isin(j, q)).any()
    error = candidates.common(states, 0.0)[ERROR] / (SMOOTH_ERROR * np.abs(gradient).max())
    assert 0.1 <= error <= 1.01


def test_of_many_that_pay_some_of_every_tile_are_told():
    candidates, _, states, gradient, _, _ = priced(SCENES["max"])
    found = candidates.go_through(states, -10.0 * np.abs(gradient).max(), 40)
    tiles = set(zip((found.i // TALL).tolist(), (found.j // BROAD).tolist(), strict=True))
    assert len(found.i) == 40
    assert len(tiles) >= 4


def test_a_pass_does_not_depend_on_threads(monkeypatch):
    candidates, _, states, gradient, _, _ = priced(SCENES["mean"])
    worth = 0.1 * np.abs(gradient).max()
    monkeypatch.setenv("MDSTOPO_THREADS", "1")
    alone = candidates.go_through(states, worth, 100)
    monkeypatch.setenv("MDSTOPO_THREADS", "3")
    shared = candidates.go_through(states, worth, 100)
    assert (alone.best, alone.together, alone.ratio, alone.seen) == (
        shared.best, shared.together, shared.ratio, shared.seen
    )  # fmt: skip
    assert np.array_equal(alone.i, shared.i)
    assert np.array_equal(alone.j, shared.j)
