"""The rows of one response with their gradients in one call: all that most evaluations need.

Rows are its peaks, or its value at the end. The call does what `peak_search.peaks_of_steps`, or
`dense_output.sample_responses` at the end, and then `row_sweep.rows_vjp` of the rows that were found do.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.dynamics.members import unscale_general
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.peaks.dense_output import evaluate_here, finished, go_to
from mdstopo.general.peaks.peak_search import DG, MEMBER, G, add_row, highest
from mdstopo.general.responses.extremes import COLUMNS, FRACTION, NOBODY, OTHER, SIGN, STEP
from mdstopo.general.sensitivity.row_sweep import rows_gradients
from mdstopo.general.steps.step_history import carve_history
from mdstopo.integrators.steps import OF_SAMPLES


@entry
def rows_with_gradients(
    tag, ints, floats, tables, alpha, limits, count, j, both, at_end, fine, closeness, room, room_ints, member_state,
    padded, out, gradients, work,
):  # fmt: skip
    """The highest peaks of a response over all steps of a motion, ranked, or its value at the end; and derivatives.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`), whose start is as stated.
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      alpha (N,): the design.
      count: number of steps.
      j, both, fine, closeness: as of `peak_search.peaks_of_steps`.
      at_end: whether the value at the end is meant; then the last three are not used.
    In place:
      room, room_ints: flat arrays of the history of steps (`carve_history`); partial steps are kept behind it.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      padded (1, M_padded + P): scratch.
      out (most, COLUMNS): the rows.
      gradients (most, N + P): derivatives of the response, of its absolute value where `both`, by alpha and values.
      work (WORK,): counts of work, added to.

    Returns how many rows there are, and whether they have derivatives: not where a row is put together from parts.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    motion = finished(model, tables, member_state, history, count, work)
    found = _value_at_end(tag, motion, j, out) if at_end else highest(tag, motion, j, both, fine, closeness, out)
    if found == 0:
        return found, True
    for r in range(found):
        if out[r, OTHER] != NOBODY:
            return found, False
    order = _latest_first(out, found)
    rows = np.empty((found, COLUMNS))
    which = np.zeros((found, 2), np.int64)
    for m in range(found):
        which[m, 0] = j
        rows[m] = out[order[m]]
    own = padded if found == 1 else np.empty((found, padded.shape[1]))
    starts = np.empty((found, 0))
    rows_gradients(tag, model, tables, member_state, history, count, which, rows, motion.workspace, starts, own, work)
    for m in range(found):
        gradient = gradients[order[m]]
        unscale_general(model.block, model.power, alpha, own[m], gradient)
        if both:
            gradient *= rows[m, SIGN]
    return found, True


@kernel
def _value_at_end(tag, motion, j, out):
    """Write the value of response j at the end of a motion as row 0 of out (1 or more, COLUMNS); returns 1.

    tag: the method of integration (`method_interface`).
    motion: the motion (`dense_output.Motion`).
    """
    k = motion.count - 1
    sample = np.empty(3)
    go_to(tag, motion, k, 1.0, np.bool_(True), np.int64(-1))
    sample[G], sample[DG], sample[MEMBER] = evaluate_here(
        tag, motion, j, k, 1.0, -1, np.bool_(True), np.bool_(True), OF_SAMPLES
    )
    return add_row(out, np.int64(0), motion.history.t, k, 1.0, sample, 1.0)


@kernel
def _latest_first(rows, found):
    """Numbers (found,) of the first rows (COLUMNS), those behind others on the motion first, else as they stand."""
    order = np.empty(found, np.int64)
    for r in range(found):
        m = r
        while m > 0 and _is_later(rows[r], rows[order[m - 1]]):
            order[m] = order[m - 1]
            m -= 1
        order[m] = r
    return order


@kernel
def _is_later(row, other):
    """Whether a row (COLUMNS,) is behind another on the motion."""
    if row[STEP] != other[STEP]:
        return row[STEP] > other[STEP]
    return row[FRACTION] > other[FRACTION]
