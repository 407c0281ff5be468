"""Sums in single precision: near the exact ones, and no result is worse for a first correction made with them."""

import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_vectors
from mdstopo.engine import Evaluator
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.passes import SUMS, member_sums
from mdstopo.mechanics.single_precision import may_use_single_precision, single_precision_sums
from mdstopo.scene import compile as scenes
from mdstopo.scene.grids import STRIDE
from mdstopo.scene.model import STIFFNESS, Springs
from tests.compiled import compiled
from tests.engine.scenes import read
from tests.mechanics.test_grids import grids

with_vectors()


@compiled
def _sums(block, member, chunk, strength, rel, exact, single_precision):
    springs = Springs(block, member, chunk, 0, np.zeros((block.shape[0], 2)))
    member_sums(springs, strength, rel, rel.shape[0], True, exact)
    single_precision_sums(springs, strength, rel, rel.shape[0], single_precision)


def web(p, q, scale=1.0, **more):
    """The grids' scene without members beside, all stiffness and inertia times the scale."""
    scene = grids(p, q, **more)
    scene["members"] = {"web": scene["members"]["web"]}
    scene["members"]["web"]["law"]["stiffness"] *= scale
    for body in scene["bodies"].values():
        body["mass"] *= scale
        body["inertia"] *= scale
    scene["gravity"] = [0, 0]
    scene["objectives"] = {"G": {"response": "energy"}}
    del scene["combine"]
    return scene


def model_of(case):
    return Evaluator(case).scenes["default"].model


@pytest.mark.parametrize(
    ("p", "q"),
    [(20, 51), (70, 32), (5, 2 * STRIDE)],  # one tile; tiles of rows, the last one short; of columns
)
def test_sums_in_single_precision_are_near_the_exact_ones(p, q):
    model = model_of(read(web(p, q)))
    assert may_use_single_precision.py_func(model)
    rng = np.random.default_rng(p)
    strength = rng.uniform(0.5, 1.0, (3, model.member.shape[1])) * model.member[STIFFNESS]
    turns = rng.uniform(-1.0, 1.0, (9, 1))
    rel = np.zeros((9, 1, POSE))
    rel[:, :, :2] = rng.uniform(-1.0, 1.0, (9, 1, 2))
    rel[:, :, 2], rel[:, :, 3] = np.cos(turns), np.sin(turns)
    exact, single_precision = np.empty((2, 9, 1, SUMS))
    _sums(
        np.array(model.block),
        np.array(model.member),
        np.zeros((0, 3), np.int64),
        strength,
        rel,
        exact,
        single_precision,
    )
    # a sum's rounding is that of its largest terms: forces, tangents
    for part in (slice(0, 3), slice(7, 16)):
        size = np.abs(exact[..., part]).max()
        assert size > 0.0
        assert np.abs(single_precision[..., part] - exact[..., part]).max() <= 2e-6 * size


def test_only_grids_alone_are_summed_in_single_precision():
    assert not may_use_single_precision.py_func(model_of(read(grids(20, 51))))  # members beside
    assert not may_use_single_precision.py_func(model_of(read(web(3, 51))))  # no grid


@pytest.mark.parametrize("seed", range(6))
def test_results_and_passes_are_those_of_double_precision(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    scene = web(20, 51, time={"end": float(rng.uniform(0.05, 0.4))})
    pushed = {"acceleration": rng.uniform(-20, 20, 2).tolist(), "angular_acceleration": float(rng.uniform(-30, 30))}
    scene["loads"] = [{"body": "deck", **pushed}]
    tolerance = 1e-6
    case = read(scene, integrator="gauss", tolerance=tolerance)
    design = rng.uniform(0.05, 1.0, case.n_design)
    found = Evaluator(case).evaluate(design)
    monkeypatch.setattr(scenes, "row_of", lambda *_: (0, 0))
    plain = Evaluator(case).evaluate(design)
    exact = Evaluator(read(scene, integrator="runge_kutta", tolerance=1e-12)).evaluate(design)
    assert found.work["force_sums"] == plain.work["force_sums"]
    size = np.abs(exact.gradients["G"]).max()
    for each in (found, plain):
        assert each.status.ok
        assert each.objectives["G"] == pytest.approx(exact.objectives["G"], rel=tolerance)
        assert np.abs(each.gradients["G"] - exact.gradients["G"]).max() <= tolerance * size


@pytest.mark.parametrize("scale", [1e36, 1e-42])
def test_numbers_beyond_single_precision_change_nothing(scale):
    """Motions are those of the unscaled scene: forces and inertia are both scaled."""
    one, other = (read(web(20, 51, each), integrator="gauss", tolerance=1e-6) for each in (1.0, scale))
    design = np.random.default_rng(1).uniform(0.05, 1.0, one.n_design)
    found, scaled = (Evaluator(case).evaluate(design) for case in (one, other))
    assert scaled.status.ok, scaled.message
    assert scaled.objectives["G"] / scale == pytest.approx(found.objectives["G"], rel=1e-7)
    slope = found.gradients["G"]
    assert np.abs(scaled.gradients["G"] / scale - slope).max() <= 1e-7 * np.abs(slope).max()
