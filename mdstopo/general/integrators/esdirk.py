"""A diagonally implicit Runge-Kutta method of general scenes in a plane, adaptive and L-stable: ESDIRK4(3)6L[2]SA.

The first stage is explicit; each of the five behind it solves, for its own accelerations a_i and multipliers,

    a_i = a(q~ + h^2 gamma^2 a_i, v~ + h gamma a_i, t_i)

with q~, v~ from the stages before it (`integrators.esdirk_tables`), by Newton's iteration on W(h^2 gamma^2, h gamma) of
the whole balance with its joints. Steps are as long as accuracy allows, however stiff members, contacts or dampers are.
The embedded method is not damped where it is stiff, so that its error estimate is damped as by one of the stages (Hosea
and Shampine 1996):

    (1 - h gamma J) (x, y) = (e_q, e_v):   W y = M e_v - h gamma K e_q,   x = e_q + h gamma y.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.dynamics.accelerations import (
    apply_mass,
    newton_correction,
    solve_accelerations,
    solve_unknowns,
    subtract_matrices,
)
from mdstopo.general.integrators.adaptive_steps import run_adaptive
from mdstopo.general.integrators.runge_kutta_sensitivity import COMMON
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.steps.method_interface import UNSOLVED, implement
from mdstopo.general.steps.run_start import ROUNDING, scene_size
from mdstopo.general.steps.step_history import carve_history, copy_vector, keep_stage
from mdstopo.integrators.esdirk_tables import ORDER, STAGES
from mdstopo.integrators.runge_kutta_tables import AA, E_Q, E_V, VECTORS, A, C
from mdstopo.integrators.steps import FORCES, NEWTON, TANGENTS, lasting
from mdstopo.mechanics.kinematics.kinematics_interface import (
    difference,
    drive_state,
    moved_most,
    shift_further,
    stage_state,
)

TAG = (0, 0, 0, 0)
#: Newton's iterations of a stage at most; the correction, relative to how far bodies move in the step, at which it
#: ends; and the one from which on a correction that is no smaller than HALF the last is rounding, as is one that is
#: below ROUNDING of the scene's size: where bodies have come to rest they move by less than rounding in a step
MOST_ITERATIONS, CLOSELY, ROUNDED, HALF = 12, 1e-13, 1e-7, 0.5
#: error of a step of the length tau, relative to the motion (`first_step`)
FIRST_ERROR = 0.05


@entry
def simulate(ints, floats, tables, alpha, tangent, settings, limits, room, room_ints, member_state, work, where):
    """Integrate the motion of a design over model.times (`adaptive_steps.run_adaptive`).

    Constant:
      ints, floats: the packed scene (`pack_general`).
      tables (2, 3, 17, 17): coefficients of the method, twice (`integrators.esdirk_tables`).
      settings (5,), limits (6,): see `run_adaptive`.
    In:
      alpha (N,), tangent: the design; whether tangents are kept for a reverse sweep.
    Out:
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      member_state, work, where, and what is returned: see `run_adaptive`.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    return run_adaptive(TAG, model, tables, alpha, tangent, settings, limits, history, member_state, work, where)


@kernel
def make_stages(
    tag, model, table, first, stop, member_state, segment, t, h, q0, v0, tangent, o, workspace, lam, q, v, a, history,
    work,
):  # fmt: skip
    """The stages, and behind them in a the error, x / h^2 and y / h; see `method_interface.make_stages`."""
    singular = -1
    for i in range(first, stop):
        stage_state(model, table, h, i, q0, v0, q, v, a, workspace.slopes)
        time = t + h * table[VECTORS, C, i]
        if table[A, i, i] == 0.0:
            singular = solve_accelerations(
                model, member_state, segment, time, q[i], v[i], np.bool_(True), workspace, a[i], lam
            )
            work[FORCES] += 1
            work[TANGENTS] += 1
        else:
            singular = find_stage(
                model, table, i, member_state, segment, time, h, q0, workspace, lam, q[i], v[i], a, work
            )
        if singular >= 0:
            return singular
        if o >= 0:
            keep_stage(history, o + i, time, q[i], v[i], a[i], lam, workspace, tangent)
    damp_error(model, table, stop, h, workspace, a)
    return singular


@kernel
def find_stage(model, table, i, member_state, segment, t, h, q0, workspace, lam, q, v, a, work):
    """Find the accelerations of an implicit stage.

    Constant:
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method.
    In:
      i: number of the stage.
      member_state (3, columns): state of the members.
      segment, t: number of the stretch of time between two breakpoints, and the stage's time (s).
      h: length of the step (s).
      q0 (n_q,): coordinates at its start.
    In place:
      q (n_q,), v (n,): coordinates and velocities without its own accelerations, then with them.
      a (17, n): accelerations of the stages before it, then its own.
      work (WORK,): counts of work, added to.
    Out:
      workspace: workspace of a balance, with the factors of W and the tangents of the last iteration.
      lam (n_row,): multipliers.

    Returns -1, the place of an unknown at which the joints are singular, or UNSOLVED.
    """
    n = v.shape[0]
    w_q = h * h * table[AA, i, i]
    w_v = h * table[A, i, i]
    now = a[i]
    off = np.empty(n)
    change = np.empty(n)
    shift = np.empty(n)
    row = np.empty(lam.shape[0])
    size = scene_size(model)
    copy_vector(a[i - 1], now)
    for d in range(n):
        shift[d] = w_q * now[d]
        v[d] += w_v * now[d]
    shift_further(model, q0, shift, shift, q)
    before = np.inf
    for _ in range(MOST_ITERATIONS):
        singular = solve_accelerations(model, member_state, segment, t, q, v, np.bool_(True), workspace, off, lam)
        work[FORCES] += 1
        work[TANGENTS] += 1
        work[NEWTON] += 1
        if singular >= 0:
            return singular
        for d in range(n):
            if model.free[d] == 0:
                now[d] = off[d]
            off[d] -= now[d]
        newton_correction(model, workspace, w_q, w_v, off, change, row)
        for d in range(n):
            shift[d] = w_q * change[d]
            now[d] += change[d]
            v[d] += w_v * change[d]
        difference(model, q, q0, off)
        shift_further(model, q0, shift, shift, q)
        reached = moved_most(model, off, size)
        moved = moved_most(model, shift, size)
        if not moved < np.inf:
            return UNSOLVED
        rounded = max(ROUNDED * reached, ROUNDING * size)
        if moved <= CLOSELY * reached or (moved <= rounded and moved >= HALF * before):
            drive_state(model, segment, t, q, v)
            for r in range(lam.shape[0]):
                lam[r] += row[r]
            return -1
        before = moved
    return UNSOLVED


@kernel
def damp_error(model, table, s, h, workspace, a):
    """The estimated error of a step, damped, in rows s and s + 1 of a: of positions by h^2, of velocities by h.

    model: the compiled scene.
    table (3, 17, 17): coefficients of the method.
    s, h: number of stages, and length of the step (s).
    workspace: workspace of a balance, as `find_stage` has left it of the last stage.
    a (17, n): accelerations of the stages.
    """
    n = a.shape[1]
    w_v = h * table[A, s - 1, s - 1]
    e_q = np.zeros(n)
    e_v = np.zeros(n)
    y = np.empty(n)
    row = np.zeros(model.size[0])
    for d in range(n):
        for j in range(s):
            e_q[d] += h * h * table[VECTORS, E_Q, j] * a[j, d]
            e_v[d] += h * table[VECTORS, E_V, j] * a[j, d]
        e_q[d] *= w_v
    apply_mass(model, workspace, e_v, y)
    subtract_matrices(model, workspace.k, e_q, y)
    solve_unknowns(model, workspace, y, row)
    for d in range(n):
        a[s, d] = (e_q[d] / w_v + w_v * y[d]) / (h * h) if model.free[d] != 0 else 0.0
        a[s + 1, d] = y[d] / h


@kernel
def step_error(tag, vectors, s, h, longest, a, weight):
    """The estimated error of a step, from the damped one; see `method_interface.step_error`."""
    later = lasting(h, longest)
    worst = 0.0
    for d in range(weight.shape[0]):
        value = h * h * weight[d] * max(abs(a[s, d]), later * abs(a[s + 1, d]))
        if not np.isfinite(value):
            return np.nan
        worst = max(worst, value)
    return worst


@kernel
def scheme(tag, method):
    """The one scheme of the method; see `method_interface.scheme`."""
    return STAGES, ORDER, FIRST_ERROR


@kernel
def is_explicit(tag):
    """Whether stages follow from those before them: no, a stage's forces depend on its own accelerations."""
    return False


implement(TAG, make_stages=make_stages, step_error=step_error, scheme=scheme, is_explicit=is_explicit)
implement(TAG, **COMMON)
