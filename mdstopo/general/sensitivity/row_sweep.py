"""Many rows pulled back through one motion at once: peaks of any responses, and what is across of norms.

All rows go through the steps together, so what a step needs (tangents, factors, the members' forces and directions) is
read or formed once for all of them; each row joins at its own step. A point inside a step that needs a step of its own
(`method_interface`) is gone through by its row alone before it joins.

Of few rows, short steps are gone through first, and the members at all of their stages gathered in one pass: a pass for
each step of one stage would cost little more than being called.

A step is linear in the cotangents. Where there are more rows than free coordinates and velocities, these go through it
one by one, as unit cotangents, and each row is the sum of what became of them: however many rows there are, a step
costs what so few do.
"""

from typing import NamedTuple

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.general.design.across_knots import add_across_knots
from mdstopo.general.design.gather import add_designs
from mdstopo.general.design.parameters import add_times
from mdstopo.general.design.row_design import add_designs_of_rows
from mdstopo.general.dynamics.accelerations import make_workspace
from mdstopo.general.dynamics.members import unscale_general
from mdstopo.general.events.permanent_sets import add_sets_of_rows, count_sets, keep_start
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.sensitivity.adjoint import apply_saltation_transposed, row_cotangents
from mdstopo.general.steps.method_interface import is_explicit, step_back
from mdstopo.general.steps.step_history import EVENTS, FIRST, PARENT, SEGMENT, carve_history, copy_vector, restore_modes
from mdstopo.general.steps.step_linear import free_places
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: stages of a step that is short, how many stages of such steps are gathered at once, and of how many rows at most
SHORT_STEP, GATHERED, FEW_ROWS = 3, 64, 16


class Units(NamedTuple):
    """Unit cotangents that are pulled through a step once for many rows, U of them: two for each free coordinate.

    place (U / 2,): the free coordinates. lam_q, lam_v (U, n), lam_x (U, 2, n), bar_set (U, slots), z (U, 17, n),
    out (U, M_padded + P), fraction (U,): as of `through_step`.
    """

    place: IndexArray
    lam_q: FloatArray
    lam_v: FloatArray
    lam_x: FloatArray
    bar_set: FloatArray
    z: FloatArray
    out: FloatArray
    fraction: FloatArray


@kernel
def make_units(model, rows, columns):
    """Arrays for the unit cotangents of so many rows: empty ones where the rows are not more than these.

    columns: M_padded + P.
    """
    place = free_places(model)
    many = 2 * place.shape[0] if rows > 2 * place.shape[0] else 0
    units = _carve_units(
        place, np.empty(many * (21 * model.mass.shape[0] + count_sets(model) + columns + 1)), many,
        model.mass.shape[0], count_sets(model), columns,
    )  # fmt: skip
    units.lam_x[:] = 0.0
    units.fraction[:] = 1.0
    return units


@kernel
def _carve_units(place, room, many, n, slots, columns):
    """`Units` whose other arrays lie behind each other in `room`, as most sweeps have none of them.

    place: of `Units`. room (many (21 n + slots + columns + 1),). many, n, slots, columns: U, freedoms of all bodies,
    permanent sets, M_padded + P.
    """
    lam_v = many * n
    lam_x = 2 * lam_v
    z = 4 * lam_v
    bar_set = 21 * lam_v
    out = bar_set + many * slots
    fraction = out + many * columns
    return Units(
        place, room[:lam_v].reshape((many, n)), room[lam_v:lam_x].reshape((many, n)),
        room[lam_x:z].reshape((many, 2, n)), room[bar_set:out].reshape((many, slots)),
        room[z:bar_set].reshape((many, 17, n)), room[out:fraction].reshape((many, columns)), room[fraction:],
    )  # fmt: skip


@kernel
def step_of_rows(
    tag, model, tables, member_state, history, count, w, c, lam_q, lam_v, lam_x, bar_set, z, y, workspace, out, work
):
    """Pull the cotangents of R rows through one step back to its start, and to before the events there.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables: coefficients of the method.
      history: the history of steps (`StepHistory`).
      count: number of steps.
    In:
      w: number of the step.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
        The modes change on the way.
      c (R,): the fraction of the step whose state each row's cotangents belong to; becomes 1.
      lam_q, lam_v (R, n): cotangents of coordinates and velocities.
      lam_x (R, 2, n): those of what the method carries from step to step besides (`method_interface`).
      bar_set (R, slots): those of the permanent sets.
    Out:
      z (R, 17, n): virtual displacements of the stages' balances.
      y (n_row,): scratch.
      workspace: workspace of a balance (`accelerations.Workspace`).
      out (R, M_padded + P): derivatives by alpha^mu and values, added to.
      work (WORK,): counts of work, added to.

    Returns the number of the step before, or -1.
    """
    through_step(
        tag, model, tables, member_state, history, w, c, lam_q, lam_v, lam_x, bar_set, z, y, workspace, out, work
    )
    before_step(model, history, member_state, count, w, lam_q, lam_v, bar_set, out)
    for m in range(c.shape[0]):
        c[m] = 1.0
    return history.index[w, PARENT]


@part
def is_short(history, w):
    """Whether step w has few stages."""
    return history.index[w + 1, FIRST] - history.index[w, FIRST] <= SHORT_STEP


@kernel
def short_steps_of_rows(
    tag, model, tables, member_state, history, w, stop, c, lam_q, lam_v, lam_x, z, gathered, y, workspace, out, work
):
    """Pull the cotangents of R rows through short steps of one segment, back from step w, without events between them.

    tag, model, tables, history, c, lam_q, lam_v, lam_x, z, y, workspace, out, work: as of `step_of_rows`.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member, as in these steps.
    w, stop: the step to begin with, and the earliest that may be gone through.
    gathered (R, GATHERED, n): scratch.

    Returns the number of the step before, or -1.
    """
    none = np.empty((0, 3, lam_q.shape[1]))
    no_rows = np.empty((0, model.size[0]))
    segment = history.index[w, SEGMENT]
    first = gathered.shape[1]
    o = history.index[w + 1, FIRST]
    while w >= stop and first >= SHORT_STEP and is_short(history, w) and history.index[w, SEGMENT] == segment:
        step_back(tag, model, tables, history, w, c, lam_q, lam_v, lam_x, none, no_rows, z, y, workspace, work)
        stages = o - history.index[w, FIRST]
        first -= stages
        o -= stages
        for m in range(z.shape[0]):
            for j in range(stages):
                copy_vector(z[m, j], gathered[m, first + j])
            c[m] = 1.0
        w = history.index[w, PARENT]
    stages = gathered.shape[1] - first
    if first > 0:
        for m in range(gathered.shape[0]):
            for j in range(stages):
                copy_vector(gathered[m, first + j], gathered[m, j])
    if gathered.shape[0] == 1:
        add_designs(model, segment, history, o, member_state, gathered[0, :stages], out[0], work)
    else:
        add_designs_of_rows(model, segment, history, o, stages, member_state, gathered, out, work)
    return w


@kernel
def through_step(
    tag, model, tables, member_state, history, w, c, lam_q, lam_v, lam_x, bar_set, z, y, workspace, out, work
):
    """Pull the cotangents of R rows through one step back to its start, behind the events there.

    tag, model, tables, history, w, c, lam_q, lam_v, lam_x, z, y, workspace, work: as of `step_of_rows`; c stays.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member; modes become the step's.
    bar_set (R, slots), out (R, M_padded + P): added to.
    """
    none = np.empty((0, 3, lam_q.shape[1]))
    no_rows = np.empty((0, model.size[0]))
    o = history.index[w, FIRST]
    stages = history.index[w + 1, FIRST] - o
    segment = history.index[w, SEGMENT]
    step_back(tag, model, tables, history, w, c, lam_q, lam_v, lam_x, none, no_rows, z, y, workspace, work)
    restore_modes(history, history.index[w, EVENTS], member_state)
    if z.shape[0] == 1:
        add_designs(model, segment, history, o, member_state, z[0, :stages], out[0], work)
    else:
        add_designs_of_rows(model, segment, history, o, stages, member_state, z, out, work)
    add_across_knots(model, history, w, member_state, z, out)
    if bar_set.shape[1] > 0:
        for j in range(stages):
            add_sets_of_rows(model, segment, member_state, history, o + j, z, j, bar_set)


@kernel
def before_step(model, history, member_state, count, w, lam_q, lam_v, bar_set, out):
    """Pull the cotangents of R rows at the start of step w back to before the events there.

    model, history, count, w: the compiled scene, the history of steps, how many there are, the number of the step.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member; modes may change.
    lam_q, lam_v (R, n), bar_set (R, slots), out (R, M_padded + P): in place, as of `step_of_rows`.
    """
    no_drops = np.empty(0)
    before = history.index[w, PARENT]
    for m in range(lam_q.shape[0]):
        if model.varied.shape[0] > 0:
            add_times(
                model, history, member_state, count, before + 1, np.int64(-1), np.bool_(False), lam_v[m], 0.0, out[m]
            )
        if before >= 0:
            apply_saltation_transposed(
                model, history, before + 1, lam_q[m], lam_v[m], bar_set[m], no_drops, member_state, out[m]
            )


@kernel
def through_step_by_units(
    tag, model, tables, member_state, history, w, lam_q, lam_v, bar_set, units, y, workspace, out, work
):
    """`through_step` of whole steps for many rows, by unit cotangents; of methods that carry nothing else.

    tag, model, tables, history, w, y, workspace, work: as of `step_of_rows`.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member; modes become the step's.
    lam_q, lam_v (R, n), bar_set (R, slots), out (R, M_padded + P): in place, as of `step_of_rows`.
    units: overwritten.
    """
    free = units.place.shape[0]
    units.lam_q[:] = 0.0
    units.lam_v[:] = 0.0
    units.bar_set[:] = 0.0
    units.out[:] = 0.0
    for k in range(free):
        units.lam_q[k, units.place[k]] = 1.0
        units.lam_v[free + k, units.place[k]] = 1.0
    through_step(
        tag, model, tables, member_state, history, w, units.fraction, units.lam_q, units.lam_v, units.lam_x,
        units.bar_set, units.z, y, workspace, units.out, work,
    )  # fmt: skip
    share = np.empty(2 * free)
    for m in range(lam_q.shape[0]):
        for k in range(free):
            d = units.place[k]
            share[k] = lam_q[m, d]
            share[free + k] = lam_v[m, d]
            lam_q[m, d] = 0.0
            lam_v[m, d] = 0.0
        for k in range(2 * free):
            if share[k] != 0.0:
                add_share(share[k], units.lam_q[k], lam_q[m])
                add_share(share[k], units.lam_v[k], lam_v[m])
                add_share(share[k], units.bar_set[k], bar_set[m])
                add_share(share[k], units.out[k], out[m])


@part
def add_share(share, x, out):
    """Add a multiple of one vector to another: out += share x."""
    for i in range(out.shape[0]):
        out[i] += share * x[i]


@kernel
def rows_gradients(tag, model, tables, member_state, history, count, which, rows, workspace, starts, out, work):
    """Differentiate R rows of `extremes` by alpha^mu and the laws' values, in one sweep backwards over the steps.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables: coefficients of the method.
      count: number of steps.
    In:
      which (R, 2): number of each row's response, and 1 where the component across its vector is meant
        (`adjoint.row_cotangents`), else 0.
      rows (R, COLUMNS): the rows, the latest first.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      history: the history of steps (`StepHistory`); partial steps are kept behind it.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      starts (R, n): cotangents of the start's positions; or (R, 0): not wanted.
      out (R, M_padded + P): the derivatives.
      work (WORK,): counts of work, added to.
    """
    n = model.mass.shape[0]
    total = rows.shape[0]
    bars = np.empty((3, n))
    bar_set = np.zeros((total, count_sets(model)))
    both = np.zeros((2, total, n))
    lam_q = both[0]
    lam_v = both[1]
    lam_x = np.zeros((total, 2, n))
    begins = np.empty(total, np.int64)
    fraction = np.ones(total)
    z = np.empty((total, 17, n))
    y = np.empty(model.size[0])
    for m in range(total):
        w, fraction[m] = row_cotangents(
            tag, model, tables, member_state, history, count, which[m, 0], rows[m], which[m, 1] != 0, workspace, bars,
            bar_set[m], out[m], work,
        )  # fmt: skip
        lam_q[m] = bars[0]
        lam_v[m] = bars[1]
        if w > count:
            own = slice(m, m + 1)
            w = step_of_rows(
                tag, model, tables, member_state, history, count, w, fraction[own], lam_q[own], lam_v[own], lam_x[own],
                bar_set[own], z[own], y, workspace, out[own], work,
            )  # fmt: skip
        begins[m] = w
    units = make_units(model, total, out.shape[1])
    # stages of steps lie behind each other in the history, as gathering needs, only where each step's PARENT is w - 1
    gathers = total <= FEW_ROWS and history.index[count, EVENTS] == 0
    gathers = gathers and model.varied.shape[0] == 0 and bar_set.shape[1] == 0
    gathered = np.empty((total if gathers else 0, GATHERED, n))
    w = begins[0] if total > 0 else -1
    active = 0
    while w >= 0:
        while active < total and begins[active] >= w:
            active += 1
        if is_explicit(tag) and active > units.fraction.shape[0] > 0:
            through_step_by_units(
                tag, model, tables, member_state, history, w, lam_q[:active], lam_v[:active], bar_set[:active], units,
                y, workspace, out[:active], work,
            )  # fmt: skip
            before_step(
                model, history, member_state, count, w, lam_q[:active], lam_v[:active], bar_set[:active], out[:active]
            )
            w = history.index[w, PARENT]
            continue
        if gathers and is_short(history, w):
            stop = begins[active] + 1 if active < total else np.int64(0)
            w = short_steps_of_rows(
                tag, model, tables, member_state, history, w, stop, fraction[:active], lam_q[:active], lam_v[:active],
                lam_x[:active], z[:active], gathered[:active], y, workspace, out[:active], work,
            )  # fmt: skip
            continue
        w = step_of_rows(
            tag, model, tables, member_state, history, count, w, fraction[:active], lam_q[:active], lam_v[:active],
            lam_x[:active], bar_set[:active], z[:active], y, workspace, out[:active], work,
        )  # fmt: skip
    for m in range(total):
        keep_start(model, history, lam_q[m], lam_v[m], bar_set[m], starts[m], out[m])


@entry
def rows_vjp(
    tag,
    ints,
    floats,
    tables,
    alpha,
    limits,
    count,
    which,
    rows,
    room,
    room_ints,
    member_state,
    padded,
    out,
    starts,
    work,
):
    """Differentiate R rows of `extremes` by alpha and the laws' values, in one sweep backwards over the steps.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      alpha (N,): the design.
      count: number of steps.
      which (R, 2): number of each row's response, and 1 where the component across its vector is meant
        (`adjoint.row_cotangents`), else 0.
      rows (R, COLUMNS): the rows, the latest first.
    In place:
      room, room_ints: flat arrays of the history of steps (`carve_history`); partial steps are kept behind it.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      padded (R, M_padded + P): derivatives by alpha^mu, then by the values of the laws' variables.
      out (R, N + P): derivatives by alpha, then by these values.
      starts (R, n): cotangents of the start's positions; or (R, 0): not wanted.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    rows_gradients(tag, model, tables, member_state, history, count, which, rows, workspace, starts, padded, work)
    for m in range(rows.shape[0]):
        unscale_general(model.block, model.power, alpha, padded[m], out[m])
