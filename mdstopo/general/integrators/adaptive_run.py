"""A run of adaptive steps inside kernels: what it is made with, and the numbers that a step hands to the next.

Numbers of these structures are changed from step to step; their arrays are written on, and never exchanged.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import make_workspace
from mdstopo.general.events.event_log import Chatter
from mdstopo.general.events.events import has_switches, room_for_watched
from mdstopo.general.events.landing import landing_of
from mdstopo.general.events.locate import NEAREST
from mdstopo.general.model.bundles import bundle
from mdstopo.general.steps.method_interface import is_explicit, scheme
from mdstopo.general.steps.run_start import ROUNDING, method_number, scene_size
from mdstopo.general.steps.step_trial import Trial
from mdstopo.integrators.springs_runge_kutta import MOST_STAGES
from mdstopo.integrators.steps import OF_REJECTED, REJECTED
from mdstopo.mechanics.kinematics.kinematics_interface import pose_size

#: error of a step relative to the tolerance of the motion: errors of many steps add up, and projection adds its own.
#: Above LOOSE_TOLERANCE the estimate is larger than the error by more and more (in long steps it is not the next term
#: of a series), and ERROR_SHARE (tolerance / LOOSE_TOLERANCE)^LOOSE_POWER is as safe: over 110 scenes with joints, all
#: laws, motions and events errors are below ten tolerances in 98 to 99 of a hundred objectives and gradients, at every
#: tolerance
ERROR_SHARE, LOOSE_TOLERANCE, LOOSE_POWER = 0.02, 1e-5, 1.0 / 3.0

#: the parts of the structures below
RULES = (
    "tolerance", "fixed_step", "most_steps", "stages_inside", "tangent", "s", "order", "switching", "curved",
    "rubbing", "measures", "rounding", "graze", "span",
)  # fmt: skip
SCALES = ("rel0", "weight", "motion", "noise", "scale", "shortest", "shaken")
RATES = ("brake", "braking", "held", "decay", "limited", "ended", "moving")
POSES = ("sigma", "at_end", "largest", "way", "reaches")
ROOTS = ("ahead", "whose", "usual", "since", "nearest")
FIELDS = (
    "step", "rules", "scales", "rates", "poses", "roots", "trial", "history", "work", "where", "lam", "push", "end_q",
    "end_v", "a0", "rel", "before", "segment", "t", "wanted", "longest", "count", "stages", "events", "chatter",
)  # fmt: skip


class Rules:
    """What holds for all steps of a run.

    tolerance: error that a step may have, relative. fixed_step (s): above 0 where steps have no error control.
    most_steps: how many are allowed. stages_inside: whether all stages are to lie within their steps. tangent: whether
    tangents are kept for a reverse sweep. s, order: stages and order of the method. switching: whether members have
    modes. curved: whether some have curves, found at the start. rubbing: whether contacts limit steps (implicit stages
    bear what brakes). measures: whether steps tell the rate of dampers. rounding, graze (m): margins below these count
    as zero, as that of a member that has just switched; or as no switch. span (s): how long the motion is.
    """

    def __init__(self, *_parts: object) -> None: ...


class Scales:
    """How far bodies have moved against each other, by which errors are weighed; arrays have an entry a pair of bodies.

    rel0 (n_pair, POSE): poses at the start of the run. weight (n,): of errors of coordinates. motion, noise (m): by how
    much each pair has been strained, and what rounding leaves of that. scale: the weight of its pose. shortest (m): at
    most the length of its shortest member at the start. shaken: what rounding leaves of forces.
    """

    def __init__(self, *_parts: object) -> None: ...


class Rates:
    """The rates by which stability limits explicit steps.

    brake (1/s), braking: the rate at which contacts brake, and the contact that brakes most, -1: none. held: steps in a
    row that were kept short by a rate. decay (1/s): the rate at which dampers damp, as the last step tells. limited:
    steps in a row that were as long as stability allows by it. ended (s): length of the last step, if its last stage
    and the next step's first tell that rate; else 0. moving (n,): masses, 0 where a coordinate is held.
    """

    def __init__(self, *_parts: object) -> None: ...


class Poses:
    """The poses at which joints repeat each other (`singular_poses`).

    sigma, at_end: the least singular value of the joints at the start and at the end of a step. largest: the largest of
    these so far. way (s): time until the next such pose. reaches: whether a step has to reach across it.
    """

    def __init__(self, *_parts: object) -> None: ...


class Roots:
    """Switches at which slopes of a force begin with a root, beside which steps are short (`locate`).

    ahead (s), whose: when such a one is foreseen, infinite where none is; whose it is, -1: nobody's. usual (s): length
    of a step before they became short for it. since (s): when the last such one was. nearest: how close to it steps go,
    in lengths of the longest step.
    """

    def __init__(self, *_parts: object) -> None: ...


class AdaptiveRun:
    """A run of adaptive steps, inside kernels.

    step: scene, members, state at the start of the step, its stages, workspace (`landing.Landing`).
    rules, scales, rates, poses, roots, trial: a `Rules`, `Scales`, `Rates`, `Poses`, `Roots`, `Trial`.
    history, work, where: as of `adaptive_steps.run_adaptive`.
    lam (n_row,), push (2, n_row): multipliers of the joints at the last stage, and of the projection.
    end_q (n_q,), end_v (n,): the end of the step. a0 (n,): accelerations at the start, and behind
    switches and breakpoints.
    rel, before (n_pair, POSE): poses at the end of the step, and at its start.
    segment: number of the stretch of time between two breakpoints.
    t (s): time reached. wanted, longest (s): lengths of the next step, and of the longest so far.
    count, stages, events: how many there are.
    chatter: an `event_log.Chatter`.
    """

    def __init__(self, *_parts: object) -> None: ...


bundle(Rules, RULES)
bundle(Scales, SCALES)
bundle(Rates, RATES)
bundle(Poses, POSES)
bundle(Roots, ROOTS)
bundle(AdaptiveRun, FIELDS)


@kernel
def make_run(tag, model, tables, tangent, settings, limits, history, member_state, work, where):
    """An `AdaptiveRun` before its start; see `adaptive_steps.run_adaptive`.

    tag: the method of integration.
    model, tables: the compiled scene, and the coefficients of both methods.
    tangent: whether tangents are kept.
    settings, limits: what the run is to keep to.
    history, member_state, work, where: what it writes.
    """
    n_q, n, n_row = model.q0.shape[0], model.v0.shape[0], model.size[0]
    pose = (model.pair.shape[0], pose_size(model))
    step = landing_of(
        model, tables[method_number(model)], scene_size(model), member_state, model.q0.copy(), model.v0.copy(),
        np.zeros((MOST_STAGES, n_q)), np.zeros((MOST_STAGES, n)), np.zeros((MOST_STAGES, n)), make_workspace(model),
        room_for_watched(model),
    )  # fmt: skip
    none = np.int64(0)
    nobody = np.int64(-1)
    no = np.bool_(False)
    t = model.times[0]
    return AdaptiveRun(
        step,
        _rules(tag, model, tangent, settings, limits, step.size),
        _no_scales(model),
        _no_rates(model),
        Poses(0.0, 0.0, 0.0, np.inf, np.bool_(True)),
        Roots(np.inf, nobody, 0.0, -np.inf, settings[0] ** NEAREST),
        Trial(0.0, no, none, no, nobody),
        history,
        work,
        where,
        np.zeros(n_row),
        np.zeros((2, n_row)),
        np.empty(n_q),
        np.empty(n),
        np.zeros(n),
        np.empty(pose),
        np.empty(pose),
        none,
        t,
        settings[2],
        0.0,
        none,
        none,
        none,
        Chatter(none, t),
    )


@kernel
def _rules(tag, model, tangent, settings, limits, size):
    """The `Rules` of a run.

    tag: the method of integration.
    model: the compiled scene.
    tangent: whether tangents are kept.
    settings, limits: as of `adaptive_steps.run_adaptive`.
    size: of the scene (m).
    """
    s, order, _ = scheme(tag, method_number(model))
    explicit = is_explicit(tag)
    return Rules(
        ERROR_SHARE * settings[0] * max(settings[0] / LOOSE_TOLERANCE, 1.0) ** LOOSE_POWER,
        settings[2],
        limits[0],
        settings[4] != 0.0,
        np.bool_(tangent),
        s,
        order,
        has_switches(model, np.bool_(True)),
        np.bool_(False),
        explicit and model.contact_pair.shape[0] > 0,
        explicit and method_number(model) == 1 and not settings[2] > 0.0,
        ROUNDING * size,
        settings[0] * size,
        model.times[model.times.shape[0] - 1] - model.times[0],
    )


@kernel
def _no_scales(model):
    """A `Scales` before the start."""
    n_pair = model.pair.shape[0]
    return Scales(
        np.empty((n_pair, pose_size(model))),
        np.empty(model.v0.shape[0]),
        np.zeros(n_pair),
        np.empty(n_pair),
        np.empty(n_pair),
        np.empty(n_pair),
        0.0,
    )


@kernel
def _no_rates(model):
    """A `Rates` before the first step."""
    moving = np.empty_like(model.mass)
    for d in range(moving.shape[0]):
        moving[d] = model.mass[d] if model.free[d] != 0 else 0.0
    return Rates(0.0, np.int64(-1), np.int64(0), 0.0, np.int64(0), 0.0, moving)


@kernel
def reject(run, stages, wanted):
    """Take the step back that is being made, after so many stages; wanted: length of the one in its place (s)."""
    run.wanted = wanted
    run.poses.reaches = np.bool_(False)
    count_rejected(run, stages)


@kernel
def count_rejected(run, stages):
    """Count a step that is taken back after so many stages."""
    run.work[REJECTED] += 1
    run.work[OF_REJECTED] += stages
