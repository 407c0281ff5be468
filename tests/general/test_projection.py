"""The reverse of the way back onto the joints: iterations with the factors at hand give what the whole matrix gives."""

import numpy as np
import pytest

from mdstopo.general.dynamics.accelerations import NO_SHIFT, factor_matrix, joint_state, make_workspace
from mdstopo.general.dynamics.projection import solve_iteratively
from mdstopo.general.model.general_model import pack_general, unpack_general
from mdstopo.mechanics.kinematics.planar import turn_bodies
from tests.compiled import compiled
from tests.general.test_joint_matrix import MECHANISM, model_of


@compiled
def _solve_iteratively(ints, floats, h, x, y, jac):
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    turn_bodies(model, model.q0, workspace.turned)
    joint_state(model, model.q0, np.zeros_like(model.q0), workspace)
    w = workspace
    factor_matrix(model, w, w.k, w.c, w.turn, w.mass, 0.0, 0.0, w.tangents[NO_SHIFT], True)
    jac[:] = workspace.jac
    return solve_iteratively(model, workspace, h, x, y)


@pytest.mark.parametrize(("size", "settles"), [(0.0, True), (1e-6, True), (1e-3, True), (1e2, False)])
def test_iterations_solve_with_small_multipliers_and_say_where_they_do_not(size, settles):
    model = model_of(MECHANISM.replace("LAW", "{type: spring, stiffness: 1}"))
    rng = np.random.default_rng(3)
    n, n_row = len(model.mass), int(model.size[0])
    h = size * model.mass.min() * rng.normal(size=(len(model.pair), 6, 6))
    right = rng.normal(size=n)
    x, y, jac = right.copy(), np.zeros(n_row), np.zeros((len(model.joint), 3, 6))
    assert _solve_iteratively(*pack_general(model), h, x, y, jac) == settles
    if not settles:
        assert np.array_equal(x, right)
        assert not y.any()
        return
    whole, rows = np.diag(model.mass), np.zeros((n_row, n))
    for p, (a, b) in enumerate(model.pair.tolist()):
        at = [*range(3 * a, 3 * a + 3), *range(3 * b, 3 * b + 3)]
        whole[np.ix_(at, at)] += h[p].T
    for j, (_, a, b, *_) in enumerate(model.joint.tolist()):
        for r, own in enumerate(model.row[j].tolist()):
            if own >= 0:
                rows[own, [*range(3 * a, 3 * a + 3), *range(3 * b, 3 * b + 3)]] += jac[j, r]
    free = np.flatnonzero(model.free)
    weight = np.sqrt(model.mass[free])  # scaled, so that the reference is right to rounding
    rows = rows[:, free] / weight
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    whole = whole[np.ix_(free, free)] / np.outer(weight, weight)
    matrix = np.block([[whole, rows.T], [rows, np.zeros((n_row, n_row))]])
    exact = np.linalg.solve(matrix, np.concatenate([right[free] / weight, np.zeros(n_row)]))[: len(free)]
    assert weight * x[free] == pytest.approx(exact, abs=1e-12 * np.abs(exact).max())
    assert not np.delete(x, free).any()
