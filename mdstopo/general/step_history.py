"""What a simulation of a general scene leaves behind: states, stages with their tangents, events.

A run is m steps. Step k leads from state k to state k + 1 and owns the stages index[k, FIRST] to index[k + 1, FIRST]:
states at which the balance was imposed. Behind the steps there is room for a partial one (`index[w, PARENT]` is the
step before step w).

========  ====================  ======================================================================
t         (m + 1,)              times of the states
state     (m + 1, 2, n)         q, v, on the joints
push      (m + 1, 2, n_row)     the multipliers mu, nu that put the state there (`projection`)
index     (m + 1, 4) integers   first stage; step before; segment; how many events had happened
when      (S,)                  times of the stages
stage     (S, 3, n)             q, v, a
lam       (S, n_row)            multipliers of the joints
K, C      (S, n_pair, 6, 6)     tangents of the balance; mass (the same, or one of zeros) of the inerters; where
                                factors are kept those of pairs that carry more than joints, without the joints' part
turn      (S, n)                slope of the turning loads
turned    (S, n_body, 2)        cos and sin of the bodies' angles; pull (S, n_joint, 3, 6), gram (S, size[3]), diagonal
                                (S, 2, n_row): the factors of the joints' matrix (`joint_matrix`); one row of each where
                                they are not kept
saltation      (E, 3, n)             of an event: the slopes of its time by q and v, and the jump a- minus a+
kept      (E, 3)                the permanent set of its member before and after an event; slope of its time by it
event     (E, 5) integers       the state at which it happened, member (padded), mode before and after; whether it
                                only just happened, so that forces at it have no derivative
========  ====================  ======================================================================
"""

from typing import Any

from mdstopo.compiler.jit import kernel
from mdstopo.general.model import GeneralModel
from mdstopo.general.structures import bundle
from mdstopo.general.switches import DAMPED
from mdstopo.scene.model import IndexArray

FIRST, PARENT, SEGMENT, EVENTS = range(4)
STATE, MEMBER, OLD, NEW, GRAZES = range(5)

FIELDS = (
    "t", "state", "push", "index", "when", "stage", "lam", "K", "C", "mass", "turn", "turned", "pull", "gram",
    "diagonal", "saltation", "kept", "event",
)  # fmt: skip


class StepHistory:
    """The history of steps inside kernels, made by `carve_history`; the fields are those of the table above."""

    def __init__(self, *_arrays: Any) -> None: ...


bundle(StepHistory, FIELDS)


def history_room(model: GeneralModel, limits: IndexArray) -> tuple[int, int]:
    """Lengths of the flat arrays of floats and integers that `carve_history` needs."""
    n, n_pair, n_row = len(model.mass), len(model.pair), int(model.size[0])
    _, steps, stages, events, inertial, factors = limits.tolist()
    per_stage = 1 + 4 * n + n_row + 72 * n_pair
    floats = (steps + 1) * (1 + 2 * n + 2 * n_row) + stages * per_stage + events * (3 * n + 3)
    floats += (2 * (n // 3) + 18 * len(model.joint) + int(model.size[3]) + 2 * n_row) * (stages if factors else 1)
    return floats + 36 * n_pair * (stages if inertial else 1), 4 * (steps + 1) + 5 * events


@kernel
def carve_history(model, limits, floats, ints):
    """A `StepHistory` over flat arrays; limits: steps allowed, room for steps, stages, events, whether there are
    inerters, whether the factors of the joints' matrix are kept.
    """
    n = model.mass.shape[0]
    n_pair = model.pair.shape[0]
    n_row = model.size[0]
    steps = limits[1]
    stages = limits[2]
    events = limits[3]
    index = ints[: 4 * (steps + 1)].reshape((steps + 1, 4))
    event = ints[4 * (steps + 1) : 4 * (steps + 1) + 5 * events].reshape((events, 5))
    t = floats[: steps + 1]
    f = steps + 1
    state = floats[f : f + 2 * n * (steps + 1)].reshape((steps + 1, 2, n))
    f += 2 * n * (steps + 1)
    push = floats[f : f + 2 * n_row * (steps + 1)].reshape((steps + 1, 2, n_row))
    f += 2 * n_row * (steps + 1)
    when = floats[f : f + stages]
    f += stages
    stage = floats[f : f + 3 * n * stages].reshape((stages, 3, n))
    f += 3 * n * stages
    lam = floats[f : f + n_row * stages].reshape((stages, n_row))
    f += n_row * stages
    size = 36 * n_pair * stages
    k = floats[f : f + size].reshape((stages, n_pair, 6, 6))
    f += size
    c = floats[f : f + size].reshape((stages, n_pair, 6, 6))
    f += size
    turn = floats[f : f + n * stages].reshape((stages, n))
    f += n * stages
    rows = stages if limits[5] != 0 else 1
    turned = floats[f : f + 2 * (n // 3) * rows].reshape((rows, n // 3, 2))
    f += 2 * (n // 3) * rows
    n_joint = model.joint.shape[0]
    pull = floats[f : f + 18 * n_joint * rows].reshape((rows, n_joint, 3, 6))
    f += 18 * n_joint * rows
    entries = model.size[3]
    gram = floats[f : f + entries * rows].reshape((rows, entries))
    f += entries * rows
    diagonal = floats[f : f + 2 * n_row * rows].reshape((rows, 2, n_row))
    f += 2 * n_row * rows
    saltation = floats[f : f + 3 * n * events].reshape((events, 3, n))
    f += 3 * n * events
    kept = floats[f : f + 3 * events].reshape((events, 3))
    f += 3 * events
    rows = stages if limits[4] != 0 else 1
    mass = floats[f : f + 36 * n_pair * rows].reshape((rows, n_pair, 6, 6))
    return StepHistory(
        t, state, push, index, when, stage, lam, k, c, mass, turn, turned, pull, gram, diagonal, saltation, kept, event
    )  # fmt: skip


@kernel
def keep_stage(history, o, t, q, v, a, lam, workspace, tangent):
    """Store a stage.

    history: the history of steps (`StepHistory`).
    o: number of the stage.
    t: time (s).
    q, v, a (n,): coordinates, velocities, accelerations (m, rad; m/s, rad/s; m/s^2, rad/s^2).
    lam (n_row,): multipliers of the joints.
    workspace: workspace as the balance of the stage has left it.
    tangent: whether its tangents are stored, and the factors of the joints' matrix where these are kept.
    """
    history.when[o] = t
    stage = history.stage[o]
    for d in range(q.shape[0]):
        stage[0, d] = q[d]
        stage[1, d] = v[d]
        stage[2, d] = a[d]
    copy_vector(lam, history.lam[o])
    if not tangent:
        return
    copy_vector(workspace.turn, history.turn[o])
    damped = workspace.switches[DAMPED] != 0  # else nobody reads C
    apart = has_factors(history)
    for p in range(workspace.k.shape[0]):
        if workspace.carries[p] != 0 or not apart:
            _copy(workspace.k[p], history.K[o, p])
            if damped:
                _copy(workspace.c[p], history.C[o, p])
    if history.mass.shape[0] > 1:
        _copy(workspace.mass, history.mass[o])
    if apart:
        _copy(workspace.turned, history.turned[o])
        _copy(workspace.pull, history.pull[o])
        copy_vector(workspace.gram, history.gram[o])
        _copy(workspace.diagonal, history.diagonal[o])


@kernel
def _copy(source, target):
    """target = source, contiguous and of any shape."""
    copy_vector(source.reshape(source.size), target.reshape(target.size))


@kernel
def has_factors(history):
    """Whether the stages' factors of the joints' matrix are kept."""
    return history.turned.shape[0] == history.when.shape[0]


@kernel
def mass_of(history, o):
    """The inerters' mass at stage o."""
    return history.mass[o if history.mass.shape[0] > 1 else 0]


@kernel
def keep_state(history, k, t, q, v, mu, nu):
    """Store a state.

    history: the history of steps (`StepHistory`).
    k: number of the state.
    t: time (s).
    q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
    mu, nu (n_row,): multipliers that put them on the joints (`projection`).
    """
    history.t[k] = t
    for d in range(q.shape[0]):
        history.state[k, 0, d] = q[d]
        history.state[k, 1, d] = v[d]
    for r in range(mu.shape[0]):
        history.push[k, 0, r] = mu[r]
        history.push[k, 1, r] = nu[r]


@kernel
def restore_modes(history, happened, member_state):
    """The modes and sets of members as they were after so many events."""
    e = events_included(member_state)
    while e > happened:
        e -= 1
        if history.event[e, 1] >= 0:
            member_state[1, history.event[e, 1]] = history.event[e, 2]
            member_state[2, history.event[e, 1]] = history.kept[e, 0]
    while e < happened:
        if history.event[e, 1] >= 0:
            member_state[1, history.event[e, 1]] = history.event[e, 3]
            member_state[2, history.event[e, 1]] = history.kept[e, 1]
        e += 1
    member_state[1, member_state.shape[1] - 1] = e


@kernel
def events_included(member_state):
    """How many events the modes in `member_state` include: kept in its last column, which belongs to no member."""
    return int(member_state[1, member_state.shape[1] - 1])


@kernel
def step_at(history, count, t):
    """The step that holds time t: the last one that begins before it."""
    low = 0
    high = count - 1
    while low < high:
        middle = (low + high + 1) // 2
        if history.t[middle] < t:
            low = middle
        else:
            high = middle - 1
    return low


@kernel
def copy_vector(source, target):
    """target = source, one-dimensional."""
    for i in range(source.shape[0]):
        target[i] = source[i]
