"""What a run begins with: the scene's size, the members' modes, and how far pairs are strained."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.members import MODE, SET, set_modes
from mdstopo.general.model.strides import energy_column
from mdstopo.general.steps.first_step import rounding_at_start
from mdstopo.general.steps.step_history import (
    GIVEN,
    GRAZES,
    MEMBER,
    NEW,
    OLD,
    SET_AFTER,
    SET_BEFORE,
    STATE,
    TIME_BY_SET,
)
from mdstopo.mechanics.kinematics.kinematics_interface import (
    freedoms,
    home_extent,
    pair_stiffness,
    pose_acceleration,
    pose_size,
    relative_pose,
)

#: what rounding leaves of a margin, relative to the scene's size
ROUNDING = 4e-15


@kernel
def method_number(model):
    """Which of the two methods a scene takes: 0 where nothing depends on velocity and nothing switches, else 1."""
    return 1 if model.size[2] != 0 else 0


@kernel
def scene_size(model):
    """A length of the scene (m), which rounding of positions is relative to."""
    size = 0.0
    for p in range(model.reach.shape[0]):
        size = max(size, model.reach[p])
    size = max(size, home_extent(model))
    return size if size > 0.0 else 1.0


@kernel
def modes_at_start(model, member_state, workspace, q, v, a, lam, most_knotted):
    """Set the modes and permanent sets at the start: by elongation, then by its rate, then by its second derivative.

    The last is that of a balance with the modes that elongations and rates tell.

    Constant:
      model: the compiled scene.
      most_knotted: up to how many members with curves steps end at the knots of these (`members.set_modes`).
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v (n,): the start; driven parts are put in place.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      a (n,), lam (n_row,): accelerations and multipliers of that balance.

    Returns the place of an unknown at which the joints are singular, or -1.
    """
    n_pair = model.pair.shape[0]
    rel = np.empty((n_pair, pose_size(model)))
    second = np.zeros((n_pair, freedoms(model)))
    relative_pose(model, q, v, rel)
    for attempt in range(2):
        set_modes(model, member_state, rel, second, most_knotted)
        if attempt == 0:
            singular = solve_accelerations(
                model, member_state, np.int64(0), model.times[0], q, v, np.bool_(False), workspace, a, lam
            )
            if singular >= 0:
                return singular
            for p in range(n_pair):
                pose_acceleration(model, rel, p, a, second[p])
    return -1


@kernel
def motion_at_start(model, member_state, workspace, rel, v, stiffness, motion, noise):
    """By how much each pair is strained at the start, and how uncertain rounding makes that.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    In:
      workspace: workspace of the balance at the start, with its tangents (`accelerations.Workspace`).
      rel (n_pair, POSE), v (n,): relative poses and velocities there.
    Out:
      stiffness (n_pair,): of a pair's members (N/m).
      motion (n_pair,): how far a pair is strained (m); it comes as zeros.
      noise (n_pair,): what is uncertain of that (m).
    """
    for p in range(stiffness.shape[0]):
        stiffness[p] = pair_stiffness(model, workspace.sums, p)
        energy = workspace.sums[p, energy_column(model)]
        if energy > 0.0 and stiffness[p] > 0.0:
            motion[p] = np.sqrt(2.0 * energy / stiffness[p])  # members of the pair store energy at the start
    rounding_at_start(model, member_state, rel, v, stiffness, motion, noise)


@kernel
def log_start(member_state, history):
    """Note the modes at the start, to which events lead back (`step_history.restore_modes`), as events of state 0.

    member_state (3, columns): state of the members; its last column takes how many there are.
    history: the history of steps (`StepHistory`), which takes the events.

    Returns how many events there are; -1: there is no room for them.
    """
    events = np.int64(0)
    for i in range(member_state.shape[1] - 1):
        if member_state[MODE, i] != 0.0:
            if events >= history.event.shape[0]:
                return np.int64(-1)
            history.event[events, STATE] = 0
            history.event[events, MEMBER] = i
            history.event[events, OLD] = 0
            history.event[events, NEW] = int(member_state[MODE, i])
            history.event[events, GRAZES] = 0
            history.event[events, GIVEN] = 1
            history.kept[events, SET_BEFORE] = 0.0
            history.kept[events, SET_AFTER] = member_state[SET, i]
            history.kept[events, TIME_BY_SET] = 0.0
            history.saltation[events] = 0.0
            events += 1
    member_state[MODE, member_state.shape[1] - 1] = events
    return events
