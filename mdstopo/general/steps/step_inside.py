"""Inside an explicit step of order 8: the polynomial between both ends, and the step that ends on it.

The step of length h is whole and has passed its error control; a member that switches within it ends it at c h. The
state there is that of the method's own polynomial of order 7 (`runge_kutta_tables`), which needs four balances more and
none for each c that is tried. Seen from its end this is a Runge-Kutta step of 16 stages and of length c h, with

    nodes c_i / c,   a_ij / c,   (A A)_ij / c^2,   b_j(c) / c,   (b(c) A)_j / c^2,

so sweeps go through it as through any other step. Its stages beyond the end are states of the mode before the switch.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.projection import project
from mdstopo.general.model.switches import APART, THOROUGH, UNFORMED
from mdstopo.general.steps.method_interface import is_explicit, scheme
from mdstopo.general.steps.run_start import method_number
from mdstopo.general.steps.step_history import (
    FIRST,
    has_factors,
    has_poses,
    keep_energy,
    keep_in_place,
    keep_stage,
    own_arrays,
    take_back,
)
from mdstopo.integrators.runge_kutta_tables import AA, BB, GENERAL, INSIDE, STAGES, VECTORS, A, B, C, D
from mdstopo.integrators.steps import FORCES, TANGENTS
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, end_state, stage_state


@kernel
def make_stages(
    tag,
    model,
    table,
    first,
    stop,
    member_state,
    segment,
    t,
    h,
    q0,
    v0,
    tangent,
    o,
    workspace,
    lam,
    q,
    v,
    a,
    history,
    work,
):
    """Make the balances of some explicit stages of a step; see `method_interface.make_stages`."""
    workspace.switches[THOROUGH] = 0  # a small eigenvalue shows at the step's end, too
    workspace.switches[APART] = 1 if has_factors(history) else 0
    workspace.switches[UNFORMED] = 1 if has_poses(history) else 0
    own = own_arrays(workspace)
    singular = -1
    for i in range(first, stop):
        if tangent and o >= 0 and has_factors(history):
            keep_in_place(history, o + i, workspace)
        stage_state(model, table, h, i, q0, v0, q, v, a, workspace.slopes)
        time = t + h * table[VECTORS, C, i]
        singular = solve_accelerations(model, member_state, segment, time, q[i], v[i], tangent, workspace, a[i], lam)
        work[FORCES] += 1
        if tangent:
            work[TANGENTS] += 1
        if singular >= 0:
            break
        if o >= 0:
            keep_stage(history, o + i, time, q[i], v[i], a[i], lam, workspace, tangent)
            if i == 0:
                keep_energy(model, history, o, v[0], workspace)
    take_back(workspace, own)
    workspace.switches[THOROUGH] = 1
    workspace.switches[APART] = 0
    workspace.switches[UNFORMED] = 0
    return singular


@kernel
def weigh_inside(table, c, out):
    """The rows BB and B of a step that ends at fraction c of the one with this table, of its 16 stages.

    table (3, 17, 17): of the second method (`integrators.runge_kutta_tables`), or of one without rows D: then the
      polynomial is the quintic through both ends (`weigh_quintic`).
    out (3, 17, 17): whose rows BB and B are set, for the length c h.
    """
    if table[VECTORS, D, 0] == 0.0:
        weigh_quintic(table, c, out)
        return
    d = 1.0 - c
    rows = table[VECTORS]
    for j in range(INSIDE):
        own = rows[B, j]  # 0 behind the step's own stages
        begin = 1.0 if j == 0 else 0.0
        end = 1.0 if j == STAGES[GENERAL] else 0.0
        inner = rows[D, j] + c * (rows[D + 1, j] + d * (rows[D + 2, j] + c * rows[D + 3, j]))
        out[VECTORS, B, j] = own + d * (begin - own + c * (2.0 * own - begin - end + d * inner))
    for j in range(INSIDE):
        total = 0.0
        for i in range(j + 1, INSIDE):
            total += out[VECTORS, B, i] * table[A, i, j]
        out[VECTORS, BB, j] = total / c


@kernel
def weigh_quintic(table, c, out):
    """`weigh_inside` of a method whose last stage is the end of the step.

    Position, velocity and acceleration at both ends are sums over the stages, so is the quintic through them:
    q(c h) = q_0 + c h v_0 + h^2 sum_j w_j a_j, with w_j of Hermite's polynomials, and v(c h) is its derivative.

    table (3, 17, 17): coefficients of the method.
    out (3, 17, 17): whose rows BB and B are set, for the length c h.
    """
    rows = table[VECTORS]
    last = 0
    for j in range(INSIDE):
        if rows[B, j] != 0.0:
            last = j
    square = c * c
    d = 1.0 - c
    for j in range(INSIDE):
        begin = 1.0 if j == 0 else 0.0
        end = 1.0 if j == last else 0.0
        place = square * c * (10.0 + c * (6.0 * c - 15.0))
        speed = square * c * (c * (7.0 - 3.0 * c) - 4.0)
        out[VECTORS, BB, j] = (
            place * rows[BB, j] + speed * rows[B, j] + 0.5 * square * d * d * (d * begin + c * end)
        ) / square
        place = 30.0 * square * d * d
        speed = square * (c * (28.0 - 15.0 * c) - 12.0)
        out[VECTORS, B, j] = (
            place * rows[BB, j]
            + speed * rows[B, j]
            + c * d * d * (1.0 - 2.5 * c) * begin
            + 0.5 * square * d * (3.0 - 5.0 * c) * end
        ) / c


@kernel
def table_inside(table, c, out):
    """Make the table of a step that ends at fraction c of the one with `table`, for the length c h.

    table, out (3, 17, 17): of the second method, and what is made.
    """
    for i in range(INSIDE):
        out[VECTORS, C, i] = table[VECTORS, C, i] / c
        for j in range(INSIDE):
            out[A, i, j] = table[A, i, j] / c
            out[AA, i, j] = table[AA, i, j] / (c * c)
    weigh_inside(table, c, out)


@kernel
def table_of_step(tag, model, tables, history, w):
    """The table of coefficients (3, 17, 17) with which step w was made, and the number of its stages.

    tag: the method of integration (`method_interface`).
    model: the compiled scene.
    tables (2, 3, 17, 17): coefficients of both methods (`integrators.runge_kutta_tables`).
    history, w: the history of steps (`StepHistory`), and the step.
    """
    method = method_number(model)
    s = history.index[w + 1, FIRST] - history.index[w, FIRST]
    table = tables[method]
    if is_explicit(tag) and s != scheme(tag, method)[0]:
        table = np.zeros(tables.shape[1:])
        table_inside(tables[method], history.share[w], table)
    return table, s


@kernel
def state_inside(
    model, table, segment, t, h, c, q0, v0, q, v, a, workspace, size, scaled, end_q, end_v, push
):  # fmt: skip
    """The state at fraction c of a step whose 16 stages have been made, put onto the joints.

    Constant:
      model: the compiled scene.
      table (3, 17, 17): of the second method (`integrators.runge_kutta_tables`).
      size: size of the scene (m).
    In:
      segment: number of the stretch of time between two breakpoints.
      t, h, c: time at the start of the step, its length (s), and the fraction of it.
      q0 (n_q,), v0 (n,): coordinates and velocities at its start.
      q (16 or more, n_q), v, a (16 or more, n): coordinates, velocities, accelerations of its stages.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`), which still has the stages' slopes.
      scaled (3, 17, 17): scratch.
      end_q (n_q,), end_v (n,): the state.
      push (2, n_row): the multipliers of the projection.
    """
    weigh_inside(table, c, scaled)
    end_state(model, scaled, INSIDE, c * h, q0, v0, q, v, a, workspace.slopes, end_q, end_v)
    drive_state(model, segment, t + c * h, end_q, end_v)
    return project(model, size, end_q, end_v, workspace, push[0], push[1])
