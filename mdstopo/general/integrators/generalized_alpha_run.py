"""A run of generalized-alpha in fixed steps inside kernels, and the numbers that a step hands to the next.

Numbers of these structures are changed from step to step; their arrays are written on, and never exchanged.
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import make_workspace
from mdstopo.general.events.event_log import Chatter
from mdstopo.general.events.events import has_switches, room_for_watched
from mdstopo.general.events.locate import CUTS
from mdstopo.general.integrators.generalized_alpha_step import VELOCITY, advance, make_step_room
from mdstopo.general.model.bundles import bundle
from mdstopo.general.steps.run_start import ROUNDING, scene_size
from mdstopo.general.steps.step_trial import Trial
from mdstopo.mechanics.kinematics.kinematics_interface import pose_size

#: the parts of the structures below
RULES = ("radius", "newton_tolerance", "step", "size", "rounding", "graze", "switching")
PACE = ("segment", "t", "begin", "pieces", "done", "known", "count", "stages", "events")
PARTS = (
    "model", "rules", "pace", "trial", "chatter", "member_state", "watched", "workspace", "history", "q", "state",
    "end_q", "ends", "push", "guess", "a0", "lam", "extent", "rel0", "rel", "before", "shortest", "step_room",
    "switch_room", "where", "work",
)  # fmt: skip
ROOM = (
    "cut", "beyond_q", "beyond", "left_q", "left_v", "kept", "trial_q", "trial", "trials", "curve_q", "curve", "push",
)  # fmt: skip


class FixedRules:
    """What holds for all steps of a run.

    radius, newton_tolerance, size: as of `generalized_alpha_step.advance`. step (s): their length; until the run has
    begun it may be negative: so many radians of the fastest vibration at the start. rounding, graze: margins up to
    these count as zero, or touch zero only (m). switching: whether members have modes.
    """

    def __init__(self, *_numbers: Any) -> None: ...


class Pace:
    """How far a run is.

    segment: number of the stretch of time between two breakpoints. t (s): time reached. begin (s), pieces, done: since
    when steps are equal, into how many the rest of the segment is divided, and how many of these are made. known: how
    many steps before the next one tell how it begins. count, stages, events: how many there are.
    """

    def __init__(self, *_numbers: Any) -> None: ...


class FixedRun:
    """A run in fixed steps, inside kernels.

    model: the compiled scene. rules, pace, trial, chatter: a `FixedRules`, `Pace`, `Trial`, `event_log.Chatter`.
    workspace, history, q, state, end_q, ends, push, guess, extent, rel0, step_room, work: as of
    `generalized_alpha_step.advance`. member_state (3, columns): scale, mode and permanent set. watched: as of
    `events.smallest_margin`. a0 (n,), lam (n_row,): accelerations and multipliers at the start, and behind switches and
    breakpoints. rel, before (n_pair, POSE): poses at the end of the step, and at its start or that of a piece of it.
    shortest (n_pair,): at most the length of the shortest member of each pair at the start (m). switch_room: a
    `SwitchRoom`. where (3,): as of `generalized_alpha.simulate`.
    """

    def __init__(self, *_parts: Any) -> None: ...


class SwitchRoom:
    """What looking for a switch within a step takes, made by `make_switch_room`.

    cut (CUTS + 1,): times after the start at which the step is cut, the end first (s). beyond_q (CUTS + 1, n_q), beyond
    (CUTS + 1, 3, n): the states there. left_q (n_q,), left_v (n,): the last state known to be in front of the switch.
    kept (3, n): the state that a trial begins with. trial_q (n_q,), trial (3, n): where it ends; push (2, n_row): what
    put it onto the joints there. trials (2, 2), curve_q (2, n_q), curve (2, 2, n): as of `locate.foreseen_trial`.
    """

    def __init__(self, *_arrays: Any) -> None: ...


bundle(FixedRules, RULES)
bundle(Pace, PACE)
bundle(SwitchRoom, ROOM)
bundle(FixedRun, PARTS)


@kernel
def make_switch_room(model):
    """A `SwitchRoom`."""
    n_q = model.q0.shape[0]
    n = model.v0.shape[0]
    return SwitchRoom(
        np.empty(CUTS + 1), np.zeros((CUTS + 1, n_q)), np.zeros((CUTS + 1, 3, n)), np.zeros(n_q), np.zeros(n),
        np.zeros((3, n)), np.zeros(n_q), np.zeros((3, n)), np.zeros((2, 2)), np.empty((2, n_q)), np.empty((2, 2, n)),
        np.zeros((2, model.size[0])),
    )  # fmt: skip


@kernel
def make_run(model, radius, settings, history, member_state, where, work):
    """A `FixedRun` before its start.

    model: the compiled scene.
    radius: the spectral radius.
    settings, member_state, where, work: as of `generalized_alpha.simulate`.
    history: the history of steps (`StepHistory`).
    """
    n_q, n, n_pair, n_row = model.q0.shape[0], model.v0.shape[0], model.pair.shape[0], model.size[0]
    pose = (n_pair, pose_size(model))
    none = np.int64(0)
    no = np.bool_(False)
    t = model.times[0]
    size = scene_size(model)
    state = np.zeros((3, n))
    state[VELOCITY] = model.v0
    return FixedRun(
        model,
        FixedRules(
            radius, settings[1], settings[2], size, ROUNDING * size, settings[0] * size, has_switches(model, no)
        ),
        Pace(none, t, t, 0.0, 0.0, none, none, none, none),
        Trial(0.0, no, none, no, np.int64(-1)),
        Chatter(none, t),
        member_state,
        room_for_watched(model),
        make_workspace(model),
        history,
        model.q0.copy(),
        state,
        np.zeros(n_q),
        np.zeros((3, n)),
        np.zeros((2, n_row)),
        np.zeros((3, n)),
        np.zeros(n),
        np.zeros(n_row),
        np.zeros((2, n_pair)),
        np.empty(pose),
        np.empty(pose),
        np.empty(pose),
        np.empty(n_pair),
        make_step_room(model),
        make_switch_room(model),
        where,
        work,
    )


@kernel
def make_step(run, segment, t, h, starting, o, state, end_q, ends, push):
    """One step of a run: `generalized_alpha_step.advance`, which returns what this does.

    run: a `FixedRun`.
    segment, t, h, starting, o, state, end_q, ends, push: as of `advance`.
    """
    return advance(
        run.model, run.rules.radius, run.member_state, segment, t, h, starting, run.q, state, run.guess,
        run.rules.newton_tolerance, run.rules.size, o, run.workspace, run.history, end_q, ends, push, run.extent,
        run.rel0, run.step_room, run.work,
    )  # fmt: skip
