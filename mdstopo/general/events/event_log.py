"""What happens where members switch: their modes change, and the history of steps gets an event for each."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.members import MODE, SET
from mdstopo.general.events.events import most_switches, smallest_margin, switch_any, watch_all
from mdstopo.general.model.bundles import bundle
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
from mdstopo.integrators.steps import FORCES, OF_STARTS
from mdstopo.mechanics.kinematics.kinematics_interface import pose_size, relative_pose

#: so many switches that follow one within this part of the simulated time are chattering
MOST_TOGETHER, TOGETHER = 400, 1e-6


class Chatter:
    """Switches in a row that are very close to each other, inside kernels. count: how many have followed the first one;
    since: when that one was (s)."""

    def __init__(self, *_numbers: object) -> None: ...


bundle(Chatter, ("count", "since"))


@kernel
def note_switch(chatter, t, times):
    """Count a switch; whether so many have been within so short a time that this would go on forever.

    chatter: the `Chatter`. t: time of the switch (s). times: the breakpoints of the run (s).
    """
    span = times[times.shape[0] - 1] - times[0]
    chatter.count = chatter.count + 1 if t - chatter.since < TOGETHER * span else 0
    if chatter.count == 0:
        chatter.since = t
    return chatter.count > MOST_TOGETHER


@kernel
def log_switches(
    model, member_state, segment, t, q, v, watched, workspace, a, lam, history, state, events, graze, noise, work, where
):
    """Switch every member whose margin is used up, one after the other, and note each as an event.

    The loop ends because members switch a bounded number of times here (`most_switches`).

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      q (n_q,), v (n,): coordinates and velocities.
      watched: the members and contacts that may switch (`events.watch_near`).
      state: number of the state at which this happens.
      events: how many events there have been.
      graze: a member whose margin would fall below zero by less than this only grazes (m).
      noise: margins that are below zero by no more than this are rounding.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      a (n,): accelerations before the first event, then behind the last one.
      history: the history of steps (`StepHistory`), which takes the events.
      where (3,): where[2] becomes a member that grazes so that the motion has no derivative.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      lam (n_row,): multipliers of the joints behind the last event.
      work (WORK,): counts of work, added to.

    Returns how many events there are now; -1: there is no room for them.
    """
    n = v.shape[0]
    n_pair = model.pair.shape[0]
    rel = np.empty((n_pair, pose_size(model)))
    relative_pose(model, q, v, rel)
    done = 0
    most = most_switches(model, member_state, watched)
    while True:
        margin, who = smallest_margin(model, t, member_state, rel, watched)
        if not margin < -noise or done > most:
            return events
        if events >= history.event.shape[0]:
            return -1
        saltation = history.saltation[events]
        new, beyond, kind, by_set, grown = switch_any(model, segment, t, member_state, rel, q, v, a, who, saltation)
        old = int(member_state[MODE, who])
        if beyond < graze and kind == 2:
            where[2] = who
        history.event[events, STATE] = state
        history.event[events, MEMBER] = who
        history.event[events, OLD] = old
        history.event[events, NEW] = new
        history.event[events, GRAZES] = 1 if beyond < graze and kind > 0 else 0
        history.event[events, GIVEN] = 0
        history.kept[events, SET_BEFORE] = member_state[SET, who]
        member_state[SET, who] += grown
        history.kept[events, SET_AFTER] = member_state[SET, who]
        history.kept[events, TIME_BY_SET] = by_set
        member_state[MODE, who] = new
        events += 1
        member_state[MODE, member_state.shape[1] - 1] = events
        done += 1
        for d in range(n):
            saltation[2, d] = a[d]
        solve_accelerations(model, member_state, segment, t, q, v, np.bool_(False), workspace, a, lam)
        work[FORCES] += 1
        work[OF_STARTS] += 1
        for d in range(n):
            saltation[2, d] -= a[d]
        if new == old:
            return events


@kernel
def log_at_breakpoint(
    model, member_state, segment, t, q, v, watched, workspace, a, lam, history, state, events, noise, work, where
):  # fmt: skip
    """`log_switches` where a segment begins: a member whose law begins to act there may be on either side of its
    switch. The time is given, so that it does not vary with the design.

    Constant:
      model: the compiled scene.
    In:
      segment, t: number of the segment, and the time at which it begins (s).
      q (n_q,), v (n,): coordinates and velocities.
      state: number of the state at which this happens.
      events: how many events there have been.
      noise: margins that are below zero by no more than this are rounding.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      history: the history of steps (`StepHistory`), which takes the events.
      where (3,): where[2] becomes a member that grazes so that the motion has no derivative.
    Out:
      watched: the members and contacts that may switch: all that act in the segment.
      workspace: workspace of a balance (`accelerations.Workspace`).
      a (n,), lam (n_row,): accelerations and multipliers behind the last event.
      work (WORK,): counts of work of the switches, added to.

    Returns how many events there are now; -1: there is no room for them.
    """
    watch_all(model, segment, watched)
    solve_accelerations(model, member_state, segment, t, q, v, np.bool_(False), workspace, a, lam)
    found = log_switches(
        model, member_state, segment, t, q, v, watched, workspace, a, lam, history, state, events, -1.0, noise, work,
        where,
    )  # fmt: skip
    for e in range(events, found):
        history.saltation[e] = 0.0
        history.kept[e, TIME_BY_SET] = 0.0
        history.event[e, GIVEN] = 1
    return found
