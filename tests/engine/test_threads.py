"""Scenes with so many members that threads share them: the same bits for any number of threads, and right ones."""

import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_kernels
from mdstopo.compiler.threads import VARIABLE
from mdstopo.engine import Evaluator
from mdstopo.mechanics import passes
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.scene.packing import FIELDS, pack, unpack
from mdstopo.scene.springs_model import CHUNK, MANY
from tests.compiled import compiled
from tests.engine.scenes import read

with_kernels()


#: where packed scenes have the number of chunks, and that of threads
COUNT, THREADS = FIELDS.place_of("n_chunk"), FIELDS.place_of("threads")


def scene(count, **changes):
    """Two bodies and three groups: springs, dampers that are no variables, springs with preload and power 2."""
    side = round(count**0.5)
    made = {
        "gravity": [0, -9.8],
        "time": {"end": 0.15},
        "bodies": {
            "torso": {"mass": 60, "inertia": 10, "position": [0, 0]},
            "vehicle": {"mass": 2000, "inertia": 6000, "position": [0, -1]},
        },
        "points": {
            "p": {"body": "torso", "grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], "count": side}}},
            "q": {"body": "vehicle", "grid": {"line": {"from": [-1, -1], "to": [1, -1], "count": side}}},
            "few": {"body": "vehicle", "grid": {"line": {"from": [-1, -2], "to": [1, -2], "count": 30}}},
        },
        "members": {
            "belts": {"from": "p", "to": "q", "law": {"type": "spring", "stiffness": 2e5 / count}},
            "dampers": {
                "from": "p", "to": "few", "design": False,
                "law": {"type": "spring", "stiffness": 1, "damping": 0.05},
            },
            "tight": {"from": "p", "to": "few", "law": {"type": "spring", "stiffness": 3, "preload": 0.5}},
        },
        "loads": [{"body": "vehicle", "acceleration": [9.8, 0], "angular_acceleration": 20}],
        "design": {"initial": 0.5, "lower": 0, "power": {"tight": 2}},
        "objectives": {"G": {"response": "energy"}, "I": {"response": "energy", "over_time": "integral"}},
        "combine": {"weights": {"G": 1, "I": 1}},
    }  # fmt: skip
    return made | changes


def _found(case, design, threads, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(threads))
    return Evaluator(case).evaluate(design)


@pytest.mark.parametrize(("integrator", "absent"), [("gauss", 0.0), ("gauss", 0.6), ("runge_kutta", 0.6)])
def test_results_are_the_same_to_the_bit_for_any_number_of_threads(integrator, absent, monkeypatch):
    # one pose alone is worth threads, too: what is single steps for `runge_kutta`
    count = {"gauss": 50_000, "runge_kutta": passes.WORTH_THREADS}[integrator]
    case = read(scene(count), integrator=integrator, tolerance=1e-4)
    assert case.n_design > MANY
    rng = np.random.default_rng(3)
    design = rng.uniform(0.0, 1.0, case.n_design)
    design[rng.random(case.n_design) < absent] = 0.0
    one, *others = (_found(case, design, threads, monkeypatch) for threads in (1, 2, 3))
    assert one.status.ok, one.message
    fixed = len(case.members[1])
    assert one.work["spring_states"] == one.work["force_sums"] * (np.count_nonzero(design) + fixed)
    for other in others:
        assert other.objectives == one.objectives
        assert other.work == one.work
        for name, gradient in one.gradients.items():
            assert np.array_equal(other.gradients[name], gradient)


@compiled
def _summed(ints, floats, alpha, strength, rel, tangent, sums):
    model = unpack(ints, floats)
    passes.scale_members(model, alpha, strength)
    passes.member_sums(passes.springs_of(model), strength, rel, rel.shape[0], tangent, sums)


@pytest.mark.parametrize("tangent", [False, True])
def test_chunks_add_up_to_what_one_sum_over_all_gives(tangent):
    case = read(scene(MANY + 3 * CHUNK))
    model = Evaluator(case).scenes["default"].model
    packed = pack(model, threads=3)
    whole = packed.ints.copy()
    assert whole[COUNT] > 6
    whole[THREADS] = 0  # in whole blocks
    rng = np.random.default_rng(5)
    alpha = rng.uniform(0.0, 1.0, case.n_design)
    turn = rng.normal(size=4)
    rel = rng.normal(size=(4, len(model.pair), POSE))
    rel[:, 0, 2], rel[:, 0, 3] = np.cos(turn), np.sin(turn)
    found = []
    for ints in (packed.ints, whole):
        strength, sums = np.zeros((3, model.member.shape[1])), np.empty((4, len(model.pair), passes.SUMS))
        _summed(ints, packed.floats, alpha, strength, rel, tangent, sums)
        found.append(sums)
    scale = np.abs(found[1]).max(axis=(0, 1))
    assert np.all(np.abs(found[0] - found[1]) <= 1e-12 * scale)
    assert np.all(scale[:7] > 0.0)


def test_few_members_are_not_cut_into_chunks():
    few, many = read(scene(1000)), read(scene(MANY))
    model = Evaluator(few).scenes["default"].model
    packed = pack(model, threads=3).ints
    assert packed[COUNT] == len(model.block)
    assert packed[THREADS] == 0
    model = Evaluator(many).scenes["default"].model
    packed = pack(model, threads=3).ints
    assert packed[THREADS] == 3
    assert packed[COUNT] > 2 * len(model.block)
