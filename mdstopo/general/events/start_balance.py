"""The balance that a run with switching members begins with."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.members import MODE, SET
from mdstopo.general.events.events import has_switches
from mdstopo.general.events.permanent_sets import begins_divided
from mdstopo.general.steps.run_start import modes_at_start


@kernel
def balance_at_start(model, member_state, workspace, q, v, a, lam, most_knotted, graze, where):
    """The modes and permanent sets of all members at the start of a run, and the balance there.

    Constant:
      model: the compiled scene.
      most_knotted: as of `modes_at_start`.
      graze: sets that differ by less than this count as one (m).
    In:
      q (n_q,), v (n,): the start, with driven parts in place.
    Out:
      member_state (3, columns): modes and permanent sets of the members; their scales are read.
      where (3,): all -1 but where[2], which becomes a member whose set may be either of two.
      workspace: workspace of the balance, with its tangents (`accelerations.Workspace`).
      a (n,), lam (n_row,): accelerations and multipliers.

    Returns the place of an unknown at which the joints are singular, or -1.
    """
    member_state[MODE] = 0.0
    member_state[SET] = 0.0
    for i in range(where.shape[0]):
        where[i] = -1
    if has_switches(model, most_knotted > 0):
        singular = modes_at_start(model, member_state, workspace, q, v, a, lam, most_knotted)
        if singular >= 0:
            return singular
        if model.varied.shape[0] > 0:
            where[2] = begins_divided(model, member_state, q, v, graze)
    return solve_accelerations(
        model, member_state, np.int64(0), model.times[0], q, v, np.bool_(True), workspace, a, lam
    )
