"""What a simulation of a general scene leaves behind: states, stages with their tangents, events.

A run is m steps. Step k leads from state k to state k + 1 and owns the stages index[k, FIRST] to index[k + 1, FIRST]:
states at which the balance was imposed. Behind the steps there is room for a partial one (`index[w, PARENT]` is the
step before step w).
"""

from typing import Annotated, Any

import numpy as np

from mdstopo.compiler.fields import Field, Fields, views_of
from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.members import MODE, SET
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.general_model import GeneralModel
from mdstopo.general.model.strides import energy_column, pull_column
from mdstopo.general.model.switches import BOTH, DAMPED, SECOND, STORED
from mdstopo.mechanics.kinematics.kinematics_interface import add_pair_force
from mdstopo.scene.springs_model import FloatArray, IndexArray

FIRST, PARENT, SEGMENT, EVENTS = range(4)
STATE, MEMBER, OLD, NEW, GRAZES, GIVEN = range(6)
#: what is kept of a stage beside its state: tangents, these and the factors of the joints' matrix, tangents and rows of
#: `window`, factors with what K of pairs follows from in the place of K, or nothing, where no gradient is wanted
TANGENTS, FACTORS, WINDOWS, POSES, NOTHING = 0, 1, 2, 3, 4
#: where `limits` have it
KEPT = 5
#: rows of `window`: coefficients of the window's polynomial; x, y, u of its node (`kinematics_interface`)
COEFFICIENT, X, Y, U = range(4)
#: columns of `kept`
SET_BEFORE, SET_AFTER, TIME_BY_SET = range(3)

#: what the lengths of arrays are, in terms of what `carve_history` is given
SIZES = {
    "n": "model.mass.shape[0]",
    "n_q": "model.q0.shape[0]",
    "n_body": "model.home.shape[0]",
    "both": "2 * (n // n_body)",
    "load_slopes": "model.size[4]",
    "attitude": "model.size[5]",
    "rows": "model.row.shape[1]",
    "n_pair": "model.pair.shape[0]",
    "n_joint": "model.joint.shape[0]",
    "n_row": "model.size[0]",
    "entries": "model.size[3]",
    "steps": "limits[1]",
    "stages": "limits[2]",
    "events": "limits[3]",
    "inertial": "stages if limits[4] != 0 else 1",
    "pose": "model.size[7]",
    "of_sums": "(both // 2 + 1) ** 2",
    "factored": "stages if limits[5] == 1 or limits[5] == 3 else 1",
    "formed": "stages if limits[5] < 3 else 1",
    "posed": "stages if limits[5] == 3 else 1",
    "collocated": "stages if limits[5] == 2 else 1",
}


class StepHistory:
    """The history of steps inside kernels, made by `carve_history`."""

    t: Annotated[FloatArray, Field("steps + 1", "times of the states (s)")]
    q: Annotated[FloatArray, Field("steps + 1, n_q", "coordinates of the states, on the joints")]
    v: Annotated[FloatArray, Field("steps + 1, n", "their velocities, on the joints")]
    push: Annotated[
        FloatArray, Field("steps + 1, 2, n_row", "the multipliers mu, nu that put the state there (`projection`)")
    ]
    share: Annotated[
        FloatArray,
        Field("steps + 1", "what part a step is of that which its stages were made for; 1 unless it ends at a switch"),
    ]
    index: Annotated[
        IndexArray, Field("steps + 1, 4", "first stage; step before; segment; how many events had happened")
    ]
    when: Annotated[FloatArray, Field("stages", "times of the stages (s)")]
    stage_q: Annotated[FloatArray, Field("stages, n_q", "coordinates of the stages")]
    stage_v: Annotated[FloatArray, Field("stages, n", "their velocities")]
    stage_a: Annotated[FloatArray, Field("stages, n", "their accelerations")]
    lam: Annotated[FloatArray, Field("stages, n_row", "multipliers of the joints (N, N m)")]
    energy: Annotated[
        FloatArray,
        Field(
            "stages, 2",
            "of stages at ends of steps stored energy (J) and its rate (W), where a response is this energy",
        ),
    ]
    K: Annotated[
        FloatArray,
        Field(
            "formed, n_pair, both, both",
            "-dF/dq of each pair, unless `rel` and `sums` are kept; where factors are kept that of pairs which carry "
            "more than joints, of the bodies that move, without the joints' part",
        ),
    ]
    C: Annotated[FloatArray, Field("formed, n_pair, both, both", "-dF/dv, likewise")]
    rel: Annotated[FloatArray, Field("posed, n_pair, pose", "relative poses of the pairs that carry more than joints")]
    sums: Annotated[
        FloatArray,
        Field("posed, n_pair, of_sums", "of these Q, E, E_xi and K by the relative pose (`strides.sums_size`)"),
    ]
    turn: Annotated[
        FloatArray,
        Field(
            "formed, n, load_slopes",
            "slopes of the loads by their bodies' turns and turning rates, unless `rel` and `sums` are kept",
        ),
    ]
    turned: Annotated[FloatArray, Field("factored, n_body, attitude", "attitudes of the bodies")]
    pull: Annotated[
        FloatArray,
        Field("factored, n_joint, rows, both", "of the joints' matrix (`joint_matrix`): Phi_q M⁻¹, by joint"),
    ]
    gram: Annotated[FloatArray, Field("factored, entries", "its entries, factorised")]
    diagonal: Annotated[FloatArray, Field("factored, 2, n_row", "its diagonal; one row where factors are not kept")]
    window: Annotated[
        FloatArray,
        Field("collocated, 4, n", "of a node of a collocated window: a coefficient of its polynomial; x, y, u there"),
    ]
    saltation: Annotated[
        FloatArray, Field("events, 3, n", "of an event: the slopes of its time by q and v, and the jump a- minus a+")
    ]
    kept: Annotated[
        FloatArray,
        Field("events, 3", "the permanent set of its member before and after an event; slope of its time by it"),
    ]
    mass: Annotated[
        FloatArray, Field("inertial, n_pair, both, both", "mass of the inerters; without inerters one of zeros")
    ]
    event: Annotated[
        IndexArray,
        Field(
            "events, 6",
            "the state at which it happened, member (padded), mode before and after; whether it only just happened, so "
            "that forces at it have no derivative; whether its time is given, so that it varies with nothing",
        ),
    ]

    def __init__(self, *_arrays: Any) -> None: ...


FIELDS = Fields(StepHistory, SIZES)
bundle(StepHistory, FIELDS.names)


def history_room(model: GeneralModel, limits: IndexArray) -> tuple[int, int]:
    """Lengths of the flat arrays of floats and integers that `carve_history` needs."""
    return FIELDS.lengths(model=model, limits=limits)


@views_of(FIELDS, StepHistory, kernel)
def carve_history(model, limits, floats, ints):
    """A `StepHistory` over flat arrays.

    model: the compiled scene. limits (6,): steps allowed, room for steps, stages, events, whether there are inerters,
    what is kept of a stage beside (TANGENTS to NOTHING). floats, ints: as long as `history_room` says.
    """


@kernel
def keep_stage(history, o, t, q, v, a, lam, workspace, tangent):
    """Store the state, accelerations and tangents of a stage.

    history: the history of steps (`StepHistory`).
    o: number of the stage.
    t: time (s).
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    lam (n_row,): multipliers of the joints.
    workspace: workspace as the balance of the stage has left it.
    tangent: whether tangents are stored. Where the history keeps factors nothing is copied: the balance has written
      there (`keep_in_place`).
    """
    history.when[o] = t
    copy_vector(q, history.stage_q[o])
    copy_vector(v, history.stage_v[o])
    copy_vector(a, history.stage_a[o])
    copy_vector(lam, history.lam[o])
    if not tangent or has_factors(history):
        return
    _copy(workspace.turn, history.turn[o])
    _copy(workspace.k, history.K[o])
    if workspace.switches[DAMPED] != 0:  # else nobody reads C
        _copy(workspace.c, history.C[o])
    if history.mass.shape[0] > 1:
        _copy(workspace.mass, history.mass[o])


@part
def own_arrays(workspace):
    """The arrays of a workspace in whose place `keep_in_place` puts others: the nine that `take_back` gives back."""
    joints = workspace.turned, workspace.pull, workspace.gram, workspace.diagonal
    return joints, (workspace.rel, workspace.sums), (workspace.k, workspace.c, workspace.turn)


@part
def keep_in_place(history, o, workspace):
    """Have the balance of a stage write into the history what is kept of it where factors are: nothing is copied then.

    Every array that is replaced here is among those of `own_arrays`, and `take_back` gives it back.

    history: the history of steps (`StepHistory`).
    o: number of the stage.
    workspace: workspace of a balance, whose arrays become those of the history.
    """
    workspace.turned = history.turned[o]
    workspace.pull = history.pull[o]
    workspace.gram = history.gram[o]
    workspace.diagonal = history.diagonal[o]
    if has_poses(history):
        workspace.rel = history.rel[o]
        workspace.sums = history.sums[o]
    else:
        workspace.k = history.K[o]
        workspace.c = history.C[o]
        workspace.turn = history.turn[o]


@part
def take_back(workspace, own):
    """Give a workspace its own arrays back: the nine of `own_arrays`, which `keep_in_place` may have replaced."""
    joints, poses, tangents = own
    workspace.turned, workspace.pull, workspace.gram, workspace.diagonal = joints
    workspace.rel, workspace.sums = poses
    workspace.k, workspace.c, workspace.turn = tangents


@kernel
def keep_energy(model, history, o, v, workspace):
    """Store the energy of design members at a stage, and its rate, where a response is this energy.

    model: the compiled scene.
    history, o: the history of steps (`StepHistory`), and the number of the stage.
    v (n,): velocities.
    workspace: workspace as the balance of the stage has left it; its right side x is overwritten.
    """
    if workspace.switches[STORED] == 0:
        return
    slope = workspace.x
    energy = 0.0
    rate = 0.0
    for d in range(v.shape[0]):
        slope[d] = 0.0
    for p in range(model.pair.shape[0]):
        if workspace.carries[p] == 0:  # without members; nothing is written of it into a history
            continue
        sums = workspace.sums[p]
        energy += sums[energy_column(model)]
        add_pair_force(model, workspace.rel, p, sums, pull_column(model), slope)
    for d in range(v.shape[0]):
        rate += slope[d] * v[d]
    history.energy[o, 0] = energy
    history.energy[o, 1] = rate


@kernel
def copy_carried(carries, source, target):
    """target = source, K or C (2 D, 2 D) of a pair: where one of its bodies alone moves, the part of that body.

    carries: which bodies of the pair move (`switches.carriers`); 0: nothing is copied.
    """
    if carries == BOTH:
        _copy(source, target)
    elif carries != 0:
        each = source.shape[0] // 2
        first = each if carries == SECOND else 0
        for i in range(each):
            for j in range(each):
                target[first + i, first + j] = source[first + i, first + j]


@kernel
def _copy(source, target):
    """target = source, contiguous and of any shape."""
    copy_vector(source.reshape(source.size), target.reshape(target.size))


@kernel
def has_factors(history):
    """Whether the stages' factors of the joints' matrix are kept."""
    return history.turned.shape[0] == history.when.shape[0]


@part
def has_poses(history):
    """Whether poses and sums over members are kept of the stages, in the place of K."""
    return history.rel.shape[0] == history.when.shape[0]


@kernel
def mass_of(history, o):
    """The mass that inerters add at stage o, as the history keeps it."""
    return history.mass[o if history.mass.shape[0] > 1 else 0]


@kernel
def keep_state(history, k, t, q, v, mu, nu):
    """Store the state at the end of a step.

    history: the history of steps (`StepHistory`).
    k: number of the state.
    t: time (s).
    q (n_q,), v (n,): coordinates and velocities.
    mu, nu (n_row,): multipliers that put them on the joints (`projection`).
    """
    history.t[k] = t
    copy_vector(q, history.q[k])
    copy_vector(v, history.v[k])
    for r in range(mu.shape[0]):
        history.push[k, 0, r] = mu[r]
        history.push[k, 1, r] = nu[r]


@kernel
def keep_step(history, k, segment, events, stages, t, q, v, push):
    """Store that step k has been made, and its end as the next state.

    history: the history of steps (`StepHistory`).
    k: number of the step, which comes behind step k - 1.
    segment: number of the stretch of time between two breakpoints that it lies in.
    events: how many had happened before its end.
    stages: how many there are by now, those of the step included.
    t: time at its end (s).
    q (n_q,), v (n,): coordinates and velocities there.
    push (2, n_row): multipliers that put these on the joints (`projection`).
    """
    history.index[k, PARENT] = k - 1
    history.index[k, SEGMENT] = segment
    history.index[k, EVENTS] = events
    history.index[k + 1, FIRST] = stages
    keep_state(history, k + 1, t, q, v, push[0], push[1])


@kernel
def restore_modes(history, happened, member_state):
    """The modes and sets of members as they were after so many events."""
    e = events_included(member_state)
    while e > happened:
        e -= 1
        if history.event[e, MEMBER] >= 0:
            member_state[MODE, history.event[e, MEMBER]] = history.event[e, OLD]
            member_state[SET, history.event[e, MEMBER]] = history.kept[e, SET_BEFORE]
    while e < happened:
        if history.event[e, MEMBER] >= 0:
            member_state[MODE, history.event[e, MEMBER]] = history.event[e, NEW]
            member_state[SET, history.event[e, MEMBER]] = history.kept[e, SET_AFTER]
        e += 1
    member_state[MODE, member_state.shape[1] - 1] = e


@kernel
def events_included(member_state):
    """How many events the modes in `member_state` include: kept in its last column, which belongs to no member."""
    return int(member_state[MODE, member_state.shape[1] - 1])


@kernel
def is_finite(x):
    """Whether all numbers of a vector are finite."""
    finite = True
    for d in range(x.shape[0]):
        finite = finite and np.isfinite(x[d])
    return finite


@kernel
def copy_vector(source, target):
    """Copy a vector: target = source."""
    for i in range(source.shape[0]):
        target[i] = source[i]
