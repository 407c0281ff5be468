"""What Python asks of the start: joints assembled, and the linear equations of small motion about it."""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.dynamics.accelerations import joint_state, make_workspace, solve_accelerations, solve_unknowns
from mdstopo.general.dynamics.members import scale_general
from mdstopo.general.dynamics.projection import project
from mdstopo.general.model.general_model import JOINT_ROWS, unpack_general
from mdstopo.general.model.strides import pair_freedoms, place_in_joint, place_in_pair, place_of_turn
from mdstopo.general.steps.run_start import modes_at_start, scene_size
from mdstopo.mechanics.kinematics.kinematics_interface import (
    difference,
    drive_state,
    most_rows,
    moved_most,
    retract,
    rotations,
    turn_bodies,
)

#: projections onto the joints, each from where the last one ended: of a stated start, and behind a step along them
PROJECTIONS, AGAIN = 20, 2
#: what is left along the joints of the way to the stated start, relative to all of it, at which a start is the nearest;
#: and relative to the scene, where there is hardly any way
NEAREST, NONE_LEFT = 1e-7, 1e-13
#: steps along the joints at most, how often one is shortened, how far it goes at most relative to the scene or in rad
MOST_STEPS, MOST_SHORTENINGS, LONGEST_STEP = 1000, 30, 0.1
#: how much of the pull along a step may point back at its end, and how much longer the next one may be
BACK, LONGER = 0.1, 4.0


@kernel
def _pull(model, workspace, stated, q, pull, mu):
    """The part along the joints of the way from q to the stated start: M pull + Phi_q^T mu = M e, Phi_q pull = 0.

    Constant:
      model: the compiled scene.
    In:
      workspace: the factors at q, as `project` leaves them.
      stated, q (n_q,): coordinates.
    Out:
      pull (n,), mu (n_row,): it, and its multipliers.

    Returns e^T M e, of the whole way e.
    """
    difference(model, stated, q, pull)
    way = 0.0
    for d in range(pull.shape[0]):
        force = model.mass[d] * pull[d] if model.free[d] != 0 else 0.0
        way += force * pull[d]
        pull[d] = force
    mu[:] = 0.0
    solve_unknowns(model, workspace, pull, mu)
    return way


@kernel
def _by_mass(model, a, b):
    """a^T M b of two shifts (n,)."""
    total = 0.0
    for d in range(a.shape[0]):
        if model.free[d] != 0:
            total += model.mass[d] * a[d] * b[d]
    return total


@kernel
def _approach(model, scale, stated, stated_v, q, v, workspace, push):
    """Move a start along the joints until it is the nearest to the stated one, by mass.

    `project` ends as soon as the joints fit. Where they bend as sharply as the start is moved, that is before M (q -
    stated) is a force of the joints alone. Steps follow the pull along the joints (`_pull`) from there. They are as
    long as the last one says (J. Barzilai and J. M. Borwein 1988, "Two-point step size gradient methods"), and are
    shortened until the pull at their end does not point back. A start that is the nearest stays as it is, to the bit.

    Constant:
      model: the compiled scene.
      scale: size of the scene (m).
    In:
      stated (n_q,), stated_v (n,): the stated start.
    In place:
      q (n_q,), v (n,): a start that fits.
      workspace: the factors at q, as `project` leaves them.
      push (2, n_row): room for multipliers.
    """
    n = v.shape[0]
    pull = np.empty(n)
    pull_there = np.empty(n)
    step = np.empty(n)
    there = np.empty_like(q)
    v_there = np.empty(n)
    way = _pull(model, workspace, stated, q, pull, push[0])
    length = 1.0
    for _ in range(MOST_STEPS):
        size = _by_mass(model, pull, pull)
        largest = 0.0
        for d in range(n):  # no array expression: Numba names it by an address, which differs from process to process
            largest = max(largest, abs(pull[d]))
        if not size > NEAREST**2 * way or largest <= NONE_LEFT * min(moved_most(model, q, scale), scale):
            return
        length = min(length, LONGEST_STEP * min(scale, 1.0) / largest)
        for _ in range(MOST_SHORTENINGS):
            for d in range(n):
                step[d] = length * pull[d]
            retract(model, q, step, there)
            v_there[:] = stated_v
            fits = True
            for _ in range(AGAIN):
                fits = project(model, scale, there, v_there, workspace, push[0], push[1]) < 0
            way = _pull(model, workspace, stated, there, pull_there, push[0])
            along = _by_mass(model, pull_there, pull) / size
            if fits and along >= -BACK:
                break
            # where the pull along the step would vanish
            length *= min(max(1.0 / (1.0 - along), 0.1), 0.5) if fits else 0.5
        else:
            return
        q[:] = there
        v[:] = v_there
        pull[:] = pull_there
        length = length / max(1.0 - along, 1.0 / LONGER)


@entry
def assemble(ints, floats, q, v, move, phi, rates):
    """Phi and Phi_q v of the joints at the start, which is put on the joints first where asked: at the nearest place by
    mass, with the nearest velocities there.

    Constant:
      ints, floats: the packed scene (`pack_general`).
    In:
      move: whether the start is moved onto the joints.
    In place:
      q, v (n,): the start (m, rad; m/s, rad/s); the driven ones are put in place.
    Out:
      phi, rates (n_joint, rows): Phi (m or rad) and Phi_q v (m/s or rad/s), as many rows as each joint has.
    """
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    drive_state(model, 0, model.times[0], q, v)
    if move:
        push = np.zeros((2, model.size[0]))
        stated = q.copy()
        stated_v = v.copy()
        found = -1
        for _ in range(PROJECTIONS):
            v[:] = stated_v  # not those of the last try: which are nearest depends on the place
            found = project(model, scene_size(model), q, v, workspace, push[0], push[1])
        if model.size[0] > 0 and found < 0:
            _approach(model, scene_size(model), stated, stated_v, q, v, workspace, push)
    turn_bodies(model, q, workspace.turned)
    joint_state(model, q, v, workspace)
    for j in range(model.joint.shape[0]):
        for r in range(model.joint[j, JOINT_ROWS]):
            phi[j, r] = workspace.phi[j, r]
            rates[j, r] = 0.0
            for i in range(pair_freedoms(model)):
                rates[j, r] += workspace.jac[j, r, i] * v[place_in_joint(model, j, i)]


@entry
def linearise(ints, floats, alpha, member_state, stiffness, mass, rows):
    """Stiffness, mass and constraints of small undamped motion about the start.

    Constant:
      ints, floats: the packed scene (`pack_general`).
    In:
      alpha (N,): the design.
    Out:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      stiffness, mass (n, n): zero before.
      rows (n_row, n): Phi_q; zero before.
    """
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    q = model.q0.copy()
    v = model.v0.copy()
    a = np.zeros(n)
    lam = np.zeros(model.size[0])
    scale_general(model.block, model.power, alpha, member_state)
    modes_at_start(model, member_state, workspace, q, v, a, lam, np.int64(0))
    solve_accelerations(model, member_state, np.int64(0), model.times[0], q, v, np.bool_(True), workspace, a, lam)
    for d in range(n):
        mass[d, d] = model.mass[d]
        for r in range(rotations(model)):
            stiffness[d, place_of_turn(model, d, r)] -= workspace.turn[d, r]
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            for j in range(pair_freedoms(model)):
                row = place_in_pair(model, p, i)
                column = place_in_pair(model, p, j)
                stiffness[row, column] += workspace.k[p, i, j]
                mass[row, column] += workspace.mass[p, i, j]
    for j in range(model.joint.shape[0]):
        for r in range(most_rows(model)):
            if model.row[j, r] >= 0:
                for i in range(pair_freedoms(model)):
                    rows[model.row[j, r], place_in_joint(model, j, i)] += workspace.jac[j, r, i]
