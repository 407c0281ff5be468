"""How long the next adaptive step is to be: what stability, singular poses and switches with roots leave of it."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.singular_poses import CROSSED_SIGMA, step_beside
from mdstopo.general.events.locate import step_beside_sharp, time_to_switch
from mdstopo.general.integrators.braking import HELD, HOPELESS
from mdstopo.integrators.steps import HELD_SHORT, OK, STABLE, STEP_LIMIT, STEP_TOO_SMALL
from mdstopo.mechanics.kinematics.kinematics_interface import relative_pose


@kernel
def plan_step(run):
    """Write the length of the next step into `run.trial`, and whether it ends its segment.

    run: the run (`AdaptiveRun`).

    Returns OK, or the code with which the run ends (`integrators.steps`).
    """
    times = run.step.model.times
    end = times[run.segment + 1]
    last = times[times.shape[0] - 1]
    run.where[0] = -1
    if _limit_by_stability(run, last - run.t) or run.count >= run.rules.most_steps:
        return STEP_LIMIT
    pieces = np.ceil((end - run.t) / run.wanted - 1e-9)
    h = (end - run.t) / max(pieces, 1.0)
    lands = pieces <= 1.0
    if not run.rules.fixed_step > 0.0:
        longer_or_shorter = _beside_pose(run, h)
        if longer_or_shorter < end - run.t:
            h = longer_or_shorter
            lands = False
        shorter = _beside_root(run)
        if shorter < min(h, end - run.t):
            h = shorter
            lands = False
    if not h > 1e-14 * max(abs(run.t), abs(end)) or h < 1e-15 * run.rules.span:
        return STEP_TOO_SMALL
    run.trial.h = h
    run.trial.lands = np.bool_(lands)
    return OK


@kernel
def _limit_by_stability(run, left):
    """Keep the wanted step as short as stability asks for; whether far too many would be needed.

    left: until the end of the run (s).
    """
    rates = run.rates
    fastest = max(rates.decay, rates.brake) if rates.limited > 1 else rates.brake
    rates.held = rates.held + 1 if run.wanted * fastest > STABLE else 0
    if rates.held == 0:
        return False
    run.wanted = STABLE / fastest
    run.where[0] = rates.braking
    run.work[HELD_SHORT] += 1
    return rates.held > HELD and left > HOPELESS * run.wanted * run.rules.most_steps


@kernel
def _beside_pose(run, h):
    """Length for a step of about h beside a singular pose (s), which may be longer; infinite where none is ahead."""
    poses = run.poses
    if not poses.way < np.inf:
        return np.inf
    must = poses.reaches and poses.sigma < CROSSED_SIGMA * poses.largest
    return step_beside(h, poses.way, must, run.step.table[2, 0], run.rules.s)


@kernel
def _beside_root(run):
    """The longest step beside a switch at which slopes begin with a root (s); infinite where none is near."""
    roots, step = run.roots, run.step
    if not (roots.ahead < np.inf or roots.since > -np.inf):
        return np.inf
    away = roots.ahead - run.t
    if roots.whose >= 0:
        relative_pose(step.model, step.q0, step.v0, run.before)
        away = min(away, time_to_switch(step.model, run.t, step.member_state, run.before, roots.whose))
    return step_beside_sharp(away, run.t - roots.since, roots.nearest * run.longest)
