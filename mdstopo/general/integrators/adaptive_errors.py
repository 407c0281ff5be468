"""Whether an adaptive step is good enough to be kept, and how long the next one is to be."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.singular_poses import (
    CROSSED_SIGMA,
    LEAST_SIGMA_LEFT,
    crosses,
    error_along,
    least_singular_value,
)
from mdstopo.general.integrators.adaptive_run import count_rejected, reject
from mdstopo.general.integrators.braking import friction_error
from mdstopo.general.steps.first_step import motion_scale
from mdstopo.general.steps.method_interface import step_error
from mdstopo.general.steps.step_history import is_finite
from mdstopo.integrators.steps import LIMITED, NON_FINITE, OK, TURN, decay_rate
from mdstopo.mechanics.kinematics.kinematics_interface import largest_turn, motion_weights, relative_pose

#: a step that may grow does so by this power of what the order allows: where steps are long the estimate rises faster
#: than the order says, and a step that is rejected costs more than one that could have been longer
GROWTH = 2.0 / 3.0
#: an estimate above this says nothing of the step that would do
ABSURD = 1e6


@kernel
def judge_step(tag, run):
    """Whether the step that has been made is good enough; the length of the next one, either way, is written.

    tag: the method of integration (`method_interface`). run: the run (`AdaptiveRun`).

    Returns whether it is kept, and OK or the code with which the run ends (`integrators.steps`).
    """
    step, poses, h, s = run.step, run.poses, run.trial.h, run.rules.s
    _learn_decay(run)
    poses.at_end = least_singular_value(step.model, step.workspace)
    relative_pose(step.model, run.end_q, run.end_v, run.rel)
    error = _error(tag, run)
    finite = is_finite(run.end_q) and is_finite(run.end_v)
    if run.rules.fixed_step > 0.0:
        return finite, OK if finite else NON_FINITE
    if not finite or not error < ABSURD:
        reject(run, s, 0.1 * h)
        return False, OK
    change = 0.9 * (run.rules.tolerance / max(error, 1e-30)) ** (1.0 / run.rules.order)
    if change > 1.0:
        change **= GROWTH
    turned = largest_turn(step.model, step.q0, run.end_q, h, step.v0, run.end_v)
    run.wanted = h * min(max(change, 0.1), 4.0, TURN / max(turned, 1e-300))
    if error > run.rules.tolerance or turned > 1.1 * TURN:
        reject(run, s, run.wanted)
        return False, OK
    if poses.at_end < LEAST_SIGMA_LEFT * poses.sigma and not run.trial.lands and h > 1e-9 * run.rules.span:
        run.wanted = 0.6 * h  # and it still reaches across the pose
        count_rejected(run, s)
        return False, OK
    return True, OK


@kernel
def _learn_decay(run):
    """The rate of dampers, from the last stage of the step before and the first one of this."""
    rates, history, o = run.rates, run.history, run.stages
    if not rates.ended > 0.0:
        return
    rates.decay = decay_rate(
        rates.moving, history.stage_a[o], history.stage_a[o - 1], history.stage_v[o], history.stage_v[o - 1]
    )
    rates.limited = rates.limited + 1 if rates.ended * rates.decay > LIMITED else 0
    rates.ended = 0.0


@kernel
def _error(tag, run):
    """The error of the step that has been made, relative to the motion."""
    step, scales, poses, h, s = run.step, run.scales, run.poses, run.trial.h, run.rules.s
    model, weights = step.model, step.table[2]
    motion_scale(model, run.end_q, run.rel, scales.rel0, scales.motion, scales.noise, run.rules.tolerance, scales.scale)
    motion_weights(model, run.rel, scales.scale, scales.weight)
    # near a singular pose errors of velocities do not count as if they lasted: joints determine velocities there, and
    # the step has to reach across the pose
    lasting = run.longest if poses.sigma >= CROSSED_SIGMA * poses.largest else 0.0
    error = step_error(tag, weights, s, h, lasting, step.a, scales.weight)
    if crosses(h, poses.way):
        error = error_along(model, step.workspace, weights, s, h, step.a, scales.weight, error, poses.at_end)
    if run.rules.rubbing:
        grip = friction_error(
            model, step.member_state, weights, s, h, step.q0, step.v0, run.end_q, run.end_v, step.a, scales.noise,
            scales.shaken, run.rules.tolerance,
        )  # fmt: skip
        if grip > error or not np.isfinite(grip):
            error = grip
    return error
