"""What keeps sequential approximation safe: a trust box, shifts, penalties and a convex term that adapt, and the stops.

Published rules where there are any: shifts move as Svanberg's (1987) asymptotes do; the trust box follows the
ratio of actual to predicted decrease; the convex term grows when the model proves too low, as in conservative
approximation (Svanberg 2002).
"""

from collections.abc import Callable
from math import inf, isfinite

import numpy as np

from mdstopo.optimizer.gsao_state import GsaoState, Step
from mdstopo.optimizer.problem import Floats, Sample
from mdstopo.optimizer.violations import plain_violation
from mdstopo.optimizer.wide_numbers import finite, steepest
from mdstopo.settings.optimizer_presets import Settings
from mdstopo.status import RunStatus, Status

# Least and largest weight of the convex term, relative to the largest gradient entry over the range.
CONVEX_FLOOR = 1e-6
CONVEX_CEILING = 1e6
# A minimiser of a linear function plus the convex term is promised half of the linear decrease: a step that gains much
# more than promised was held back by that term.
TOO_CONVEX = 1.5
# Factor on the penalty of a constraint whose multiplier has come up to it while limits are violated.
PENALTY_GROWTH = 10.0
# The merit's penalty in multipliers, and what is left of it at least from step to step: a merit is exact where
# violations cost more than the multipliers; every bit more only punishes what a step along a curved limit violates in
# second order, and makes steps short.
MERIT_PENALTY, MERIT_PENALTY_FALL = 2.0, 0.5
# Largest penalty, in first penalties.
PENALTY_CEILING = 1e4
# Rows of a rejected trial so near to its highest become cuts where the trust box is at most so wide, in ranges; further
# off a line says little of a function that is curved. They are kept while they are so near to the highest row of the
# iterate and the box is at most so wide; so many in all. Where one tells what stood in the way, the box shrinks less.
CUT_WINDOW, CUT_TRUST, KEPT_WINDOW, KEPT_TRUST, MOST_CUTS, CUT_SHRINK = 0.02, 0.1, 0.15, 0.4, 24, 0.8
# Iterations of which the last decrease is told.
RECENT = 10
# Share of the objective by which it must have fallen since cuts were dropped, before they are dropped again.
FRESH = 1e-5
# Share of the largest gradient so far that residuals are relative to at least.
GRADIENT_SHARE = 1e-5
# What a residual may be at most, in shares of the violation that it says cannot be made smaller.
RESIDUAL_SHARE = 0.1
# The decrease that a model which was right about the last steps predicts at most where a run has converged, in
# tolerances.
NEGLIGIBLE_PREDICTION = 1e-1
# The largest share of the objective that may be left to be gained and is told of a stalled run.
SMALL_SHARE = 1e-2
# The largest objective, constraint or slope of a usable design: steps need squares of them.
LARGEST_ROW = 1e140


def residual_unit(state: GsaoState, steepest: float, steepest_row: float = 0.0) -> float:
    """What the KKT residual is relative to: the largest |dU/dalpha| here, `steepest`, or a share of the largest of any
    iterate: at a smooth minimum inside the bounds the gradient itself vanishes. The largest is kept in the state, also
    that of other rows, `steepest_row`."""
    state.largest_gradient = max(state.largest_gradient, steepest, steepest_row)
    return max(steepest, GRADIENT_SHARE * state.largest_gradient)


def why_unusable(sample: Sample, steepest: Callable[[Floats], Floats]) -> str:
    """Why a sample cannot be used, as a sentence; empty if it can. steepest: as `wide.steepest`."""
    if sample.status is Status.OK:
        rows = np.concatenate([[sample.objective], sample.rows, sample.constraint_rows])
        if not len(sample.rows) or not finite(rows):
            return Status.NON_FINITE.value
        slopes = np.concatenate([steepest(sample.gradients), steepest(sample.constraint_gradients)])
        if not finite(slopes):
            return Status.NON_FINITE.value
        most = max(float(np.abs(rows).max()), float(slopes.max()))
        if most > LARGEST_ROW:
            return f"the objective, a constraint or a slope of theirs is {most:.2g}, too large to go on with"
        return ""
    return sample.failure


def cuts_of(state: GsaoState, sample: Sample) -> tuple[Floats, Floats, Floats, bool]:
    """The cuts (K,), their gradients (K, N) and by how much they were lowered (K,) after `sample`, that of the state's
    trial, was rejected; and whether the newest tell what stood in the way.

    That were the highest rows there. Often they are none of the rows at the iterate: a peak that only rises on the way,
    or one of more than compete. Linearised they tell the next subproblem, as the null steps of bundle methods do
    (C. Lemarechal, 1975). No cut may say more of the iterate than its own value; of a function that is not convex it
    would, and then the box has to shrink.
    """
    if state.trust > CUT_TRUST:
        return *no_cuts(len(state.alpha)), False
    highest = float(sample.rows.max())
    near = np.flatnonzero(sample.rows >= highest - CUT_WINDOW * abs(highest))
    slopes = sample.gradients[near]
    seen = sample.rows[near] + np.einsum("ri,i->r", slopes, state.alpha - state.trial)
    told = highest > state.objective and bool(seen[int(np.argmax(sample.rows[near]))] <= state.objective)
    values = np.concatenate([state.cuts, np.minimum(seen, state.objective)])
    gradients = np.concatenate([state.cut_gradients.reshape(-1, len(state.alpha)), slopes])
    lowered = np.concatenate([state.cuts_lowered, np.maximum(seen - state.objective, 0.0)])
    return values[-MOST_CUTS:], gradients[-MOST_CUTS:], lowered[-MOST_CUTS:], told


def cuts_from(state: GsaoState, trial: Floats, objective: float) -> tuple[Floats, Floats, Floats]:
    """The cuts (K,) that are near enough to matter, their gradients (K, N) and by how much they were lowered (K,), seen
    from an accepted trial."""
    if not len(state.cuts):
        return state.cuts, state.cut_gradients, state.cuts_lowered
    if state.trust > KEPT_TRUST:
        return no_cuts(len(trial))
    seen = state.cuts + np.einsum("ri,i->r", state.cut_gradients, trial - state.alpha)
    near = seen >= objective - KEPT_WINDOW * abs(objective)
    lowered = state.cuts_lowered[near] + np.maximum(seen[near] - objective, 0.0)
    return np.minimum(seen[near], objective), state.cut_gradients[near], lowered


def no_cuts(n: int) -> tuple[Floats, Floats, Floats]:
    """No cutting planes, of n variables."""
    return np.zeros(0), np.zeros((0, n)), np.zeros(0)


def outdated(state: GsaoState) -> bool:
    """Whether cuts should be dropped before a run ends for want of decrease: seen from far off they may forbid what is
    possible. Not twice at the same place: there they are needed."""
    return len(state.cuts) > 0 and state.objective < state.forgotten - FRESH * abs(state.objective)


def next_merit_penalty(merit_penalty: Floats, multipliers: Floats, penalty: Floats) -> Floats:
    """The penalty in the merit, (J,): twice the multipliers, at most that of the subproblem; it falls gradually."""
    return np.minimum(np.maximum(MERIT_PENALTY * multipliers, MERIT_PENALTY_FALL * merit_penalty), penalty)


def first_penalty(sample: Sample, settings: Settings) -> Floats:
    """(J,) the first penalty of each constraint: its gradient then weighs `elastic` times as much as the
    objective's."""
    if not len(sample.constraint_rows):
        return np.zeros(0)
    limits = sample.levels_of(steepest(sample.constraint_gradients))
    slope = float(steepest(sample.gradients).max())
    return settings.number("elastic") * (slope if slope > 0.0 else 1.0) / np.where(limits > 0.0, limits, 1.0)


def next_trust(trust: float, ratio: float, settings: Settings) -> float:
    """The half width of the trust box, in ranges, after a step with this ratio of actual to predicted decrease."""
    if ratio > settings.number("good_ratio"):
        return min(1.0, trust * settings.number("trust_grow"))
    if ratio < settings.number("poor_ratio"):
        return trust * settings.number("trust_shrink")
    return trust


def next_convex(convex: float, ratio: float, too_low: bool, settings: Settings) -> float:
    """The relative weight of the convex term: more where the model was below the function, less after a good
    step."""
    if convex == 0.0:
        return 0.0
    if too_low:
        return min(convex * settings.number("convex_grow"), CONVEX_CEILING)
    if ratio > TOO_CONVEX:
        return max(convex * settings.number("convex_drop"), CONVEX_FLOOR)
    if ratio > settings.number("good_ratio"):
        return max(convex * settings.number("convex_shrink"), CONVEX_FLOOR)
    return convex


def next_shift(shift: Floats, last: Step, step: Step, settings: Settings) -> Floats:
    """Distances of the shifts in ranges, (N,): wider where a step agrees with the last one, narrower where it
    opposes it."""
    agreement = last.array() * step.array()
    factor = np.where(
        agreement > 0.0,
        settings.number("shift_grow"),
        np.where(agreement < 0.0, settings.number("shift_shrink"), 1.0),
    )
    return np.clip(shift * factor, settings.number("shift_minimum"), settings.number("shift_maximum"))


def verdict(
    state: GsaoState, stuck: bool, settings: Settings, bound: float, most_to_gain: Callable[[GsaoState], float]
) -> tuple[RunStatus, str]:
    """Whether to go on, and if not, why: a function of the state alone, so that a resumed run decides alike.

    stuck: whether the next step would change next to nothing, or the last ones have. bound: no U is below it.
    most_to_gain: what the rows that are known leave to be gained by any design; asked where nothing else decides.
    """
    if state.status is RunStatus.FAILED:
        return state.status, state.reason
    holds = state.violation <= settings.tolerance
    if state.kkt <= settings.tolerance and holds and not state.restoring:
        return RunStatus.CONVERGED, (
            f"the projected KKT residual, {state.kkt:.2g} of the largest gradient entry, "
            f"is within the tolerance {settings.tolerance:.2g}"
        )
    if stuck and is_at_bound(state, settings.tolerance, bound):
        return RunStatus.CONVERGED, (
            f"the objective, {state.best_objective:.2g}, cannot be below {bound:g}, and what is left is within the "
            f"tolerance {settings.tolerance:.2g} of what the first design had to lose"
        )
    if stuck and holds and is_negligible(state.least_predicted, state, settings.tolerance):
        return RunStatus.CONVERGED, (
            f"the last steps gained what the curvature that was learnt had promised, and it promises no more than "
            f"{state.least_predicted / abs(state.objective):.2g} of the objective"
        )
    to_gain = most_to_gain(state) if stuck and holds else inf
    if nothing_is_left(state, to_gain, settings.tolerance):
        return RunStatus.CONVERGED, (
            f"the slopes here and of designs tried beside it leave at most {to_gain / abs(state.objective):.2g} of the "
            f"objective to be gained, which is within the tolerance {settings.tolerance:.2g}"
        )
    if state.restoring and not state.trial_is_far_design and (stuck or is_least(state, settings.tolerance)):
        return _without_limits(state, settings)
    if stuck:
        return RunStatus.STALLED, (
            f"no step is found that lowers the objective, at a projected KKT residual of {state.kkt:.2g} "
            f"where {settings.tolerance:.2g} was asked for{_left(state, to_gain)}{recent_change(state)}"
        )
    if state.iteration >= settings.max_iterations:
        return RunStatus.MAX_ITERATIONS, (
            f"the limit of {settings.max_iterations} iterations was reached "
            f"at a projected KKT residual of {state.kkt:.2g}{recent_change(state)}"
        )
    return RunStatus.RUNNING, ""


def _left(state: GsaoState, to_gain: float) -> str:
    """What is left to be gained, as `BundleMethod.most_to_gain` tells it, as a part of a sentence; nothing where that
    is no small share of the objective."""
    if not to_gain < SMALL_SHARE * abs(state.objective):
        return ""
    share = to_gain / abs(state.objective)
    return f"; the slopes here and of designs tried beside it leave at most {share:.2g} of the objective to be gained"


def recent_change(state: GsaoState) -> str:
    """How much U has changed over the last iterations, as the end of a sentence; nothing where that is not known."""
    count = min(RECENT, state.iteration)
    taken, objective = state.history.accepted, state.history.objective
    before = next((objective[k] for k in range(len(taken) - 1 - count, -1, -1) if taken[k]), float("nan"))
    if count == 0 or not isfinite(before) or before == 0.0:
        return ""
    change = (state.objective - before) / abs(before)
    if change == 0.0:
        return f"; the last {count} iterations changed nothing"
    way = "lowered" if change < 0.0 else "raised"
    return f"; the last {count} iterations {way} the objective by {abs(change):.2g} of itself"


def is_at_bound(state: GsaoState, tolerance: float, bound: float) -> bool:
    """Whether the best design keeps the limits and has lost all that the first one had above the bound of U, but a
    share of `tolerance`: no other is better by more, whatever the slopes are. The norm of a vector that has come to
    zero has none."""
    if not isfinite(bound) or state.best_violation > tolerance:
        return False
    return state.best_objective - bound <= tolerance * (state.history.objective[0] - bound)


def nothing_is_left(state: GsaoState, to_gain: float, tolerance: float) -> bool:
    """Whether what is left to be gained, as `BundleMethod.most_to_gain` tells it, is within a share of U."""
    return to_gain < tolerance * abs(state.objective)


def is_negligible(predicted: float, state: GsaoState, tolerance: float) -> bool:
    """Whether a decrease that a model predicts, which was right about the last steps, is next to nothing: what is left
    to be gained is then a small multiple of it, below the tolerance."""
    return predicted < NEGLIGIBLE_PREDICTION * tolerance * abs(state.objective)


def is_least(state: GsaoState, tolerance: float) -> bool:
    """Whether the largest violation is stationary: its residual is small, also beside the violation itself, which where
    it is tiny could vanish within the residual."""
    rows, slopes = state.constraint_rows, state.constraint_gradients
    left = state.kkt * float(steepest(slopes).max(initial=0.0))
    return bool(state.kkt <= tolerance and left <= RESIDUAL_SHARE * float(rows.max(initial=0.0)))


def _without_limits(state: GsaoState, settings: Settings) -> tuple[RunStatus, str]:
    """The end of a run at an iterate that breaks limits by an amount that no step makes smaller."""
    last = plain_violation(state.sample)
    excess = f"{last:.3g}"
    if state.best_violation <= settings.tolerance:
        return RunStatus.STALLED, (
            f"the best design keeps the limits; from a later one, whose largest violation is {excess} of its bound, "
            f"no step is found that makes it smaller (KKT residual {state.kkt:.2g})"
        )
    if state.far_design_tried and state.best_plain < last:
        return RunStatus.FAILED, (
            f"no design is found that keeps the limits: the least violation met is {state.best_plain:.3g} of its "
            f"bound, and from the last design no step makes its own, {excess}, smaller"
        )
    if is_least(state, settings.tolerance):
        return RunStatus.FAILED, (
            f"no design near this one keeps the limits: the largest violation, {excess} of its bound, "
            f"cannot be made smaller (KKT residual {state.kkt:.2g})"
        )
    return RunStatus.FAILED, (
        "no design is found that keeps the limits: no step makes the largest violation, "
        f"{excess} of its bound, smaller, "
        f"at a KKT residual of {state.kkt:.2g} where {settings.tolerance:.2g} was asked for"
    )
