"""The unit of cost: one pass over all members at one pose, the sum of their forces and energies."""

from collections.abc import Callable

import numpy as np

from mdstopo.case.model import Case
from mdstopo.compiler.jit import entry
from mdstopo.engine import Evaluator
from mdstopo.mechanics.kinematics.planar_poses import relative_pose
from mdstopo.mechanics.passes import SUMS, member_sums, scale_members
from mdstopo.scene.packing import pack, unpack

#: poses in one pass over the members, about as many as a step of collocation has
POSES = 8
#: passes in one call, so that the call itself does not count
REPEATS = 50


@entry
def _passes(ints, floats, alpha, strength, rel, sums, repeats):  # type: ignore[no-untyped-def]
    model = unpack(ints, floats)
    scale_members(model, alpha, strength)
    for j in range(rel.shape[0]):
        relative_pose(model.pair, model.q0, model.v0, rel[j])
        for p in range(rel.shape[1]):
            rel[j, p, 0] += 1e-3 * j
    for _ in range(repeats):
        member_sums(model, strength, rel, np.int64(rel.shape[0]), np.bool_(False), sums)


def force_pass(case: Case) -> tuple[Callable[[], None], int]:
    """A call that makes force passes over the members of a case's first scene, and how many it makes."""
    model = next(iter(Evaluator(case).scenes.values())).model
    packed = pack(model)
    strength = np.zeros((3, model.member.shape[1]))
    rel = np.zeros((POSES, len(model.pair), 10))
    sums = np.zeros((POSES, len(model.pair), SUMS))
    alpha = np.array(case.initial)

    def call() -> None:
        _passes(packed.ints, packed.floats, alpha, strength, rel, sums, REPEATS)

    return call, POSES * REPEATS
