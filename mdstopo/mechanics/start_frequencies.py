"""Small motion about the start of springs between free bodies."""

import numpy as np

from mdstopo.case.model import Case
from mdstopo.mechanics.start_tangents_entry import start_tangents
from mdstopo.scene.compile_scene import Scene
from mdstopo.scene.grid_members import places_of
from mdstopo.scene.packing import pack
from mdstopo.scene.springs_model import COUNT, DESIGN, MEMBER, STIFFNESS, FloatArray
from mdstopo.scene.vibration_modes import Modes, modes_of


def start_modes(case: Case, scene: Scene, design: FloatArray) -> Modes:
    """Small undamped motion about the start; design: alpha (N,)."""
    model, n, pairs = scene.model, len(scene.model.inv_mass), len(scene.model.pair)
    strength = model.member[STIFFNESS:MEMBER].copy()
    for block, group in zip(model.block.tolist(), case.members, strict=True):
        if block[DESIGN] >= 0:
            first = block[DESIGN]
            strength[:, places_of(block)] *= design[first : first + block[COUNT]] ** group.power
    strength[1] = 0.0  # undamped
    k, turn = np.zeros((1, pairs, 6, 6)), np.zeros((1, n))
    packed = pack(model)
    start_tangents(packed.ints, packed.floats, strength, scene.damped, k, turn)
    matrix = np.zeros((n, n))
    for p, (a, b) in enumerate(model.pair.tolist()):
        rows = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
        matrix[np.ix_(rows, rows)] += k[0, p]
    for body in range(0, n, 3):
        matrix[body : body + 3, body + 2] -= turn[0, body : body + 3]
    return modes_of(matrix, np.diag(np.sqrt(model.inv_mass)), np.zeros((0, n)), 0.0)
