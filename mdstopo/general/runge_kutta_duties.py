"""The duties of the explicit methods: partial steps, reverse and tangent steps, weights."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.duties import implement
from mdstopo.general.runge_kutta import TAG, advance, scene_size
from mdstopo.general.step_linear import explicit_back, explicit_forward
from mdstopo.general.track import keep_state, restore_modes
from mdstopo.integrators.runge_kutta import MOST
from mdstopo.integrators.runge_kutta_tables import STAGES


@kernel
def point_of(tag, model, tables, strength, track, count, k, c, keep, desk, q, v, work):
    """A step of length c h from the start of step k; kept as step count + 1 where asked."""
    n = q.shape[0]
    method = 1 if model.size[2] != 0 else 0
    s = STAGES[method]
    h = c * (track.t[k + 1] - track.t[k])
    o = track.index[count, 0]
    ends = np.empty((2, n))
    push = np.empty((2, model.size[0]))
    restore_modes(track, track.index[k, 3], strength)
    advance(
        model, tables[method], s, strength, track.index[k, 2], track.t[k], h, track.state[k, 0], track.state[k, 1],
        keep, o if keep else np.int64(-1), desk, np.empty(model.size[0]), np.empty((MOST, n)), np.empty((MOST, n)),
        np.empty((MOST, n)), track, ends, push, scene_size(model), work,
    )  # fmt: skip
    for d in range(n):
        q[d] = ends[0, d]
        v[d] = ends[1, d]
    if not keep:
        return k
    w = count + 1
    track.t[w] = track.t[k]
    track.index[w, 0] = o
    track.index[w, 1] = k - 1
    track.index[w, 2] = track.index[k, 2]
    track.index[w, 3] = track.index[k, 3]
    keep_state(track, w + 1, track.t[k] + h, q, v, push[0], push[1])
    track.index[w + 1, 0] = o + s
    return w


@kernel
def step_back(tag, model, tables, track, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, desk, work):
    """Duty 2; a point inside a step is a partial step's end, so c is always 1."""
    explicit_back(model, tables, track, w, bars, rows_bar, lam_q, lam_v, z, y, desk, work)


@kernel
def step_forward(tag, model, tables, track, w, c, sweeps, dq, dv, dx, force, changes, rows, desk):
    """Duty 3; nothing is implicit here."""
    explicit_forward(model, tables, track, w, dq, dv, force, changes, rows, desk)
    return True


@kernel
def beside(tag, track, k, c, e, q, v, a, q_out, v_out):
    """The parabola: the motion has the accelerations of its balance everywhere."""
    for d in range(q.shape[0]):
        q_out[d] = q[d] + e * (v[d] + 0.5 * e * a[d])
        v_out[d] = v[d] + e * a[d]


@kernel
def derivatives(tag):
    """Velocities and accelerations."""
    return 2


@kernel
def weights_of(tag, model, tables, track, w, out):
    """An integral is the velocity of one more coordinate."""
    method = 1 if model.size[2] != 0 else 0
    for j in range(STAGES[method]):
        out[j] = (track.t[w + 1] - track.t[w]) * tables[method, 2, 2, j]


implement(
    TAG,
    point_of=point_of,
    step_back=step_back,
    step_forward=step_forward,
    beside=beside,
    derivatives=derivatives,
    weights_of=weights_of,
)
