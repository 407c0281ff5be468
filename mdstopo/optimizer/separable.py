"""The separable approximation (GSAO) as steps of the driver: begin at an iterate, judge a trial, propose one.

Everything between two steps is in `State`. The convex subproblem is that of `approximation`, solved by `subproblem`, or
by `wide` where the variables are many and one row decides; `safeguards` adapts shifts, convex term and trust box.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.competing_rows import FeasibleSet
from mdstopo.optimizer.gsao_state import GsaoState, Step
from mdstopo.optimizer.interior import Optimum
from mdstopo.optimizer.problem import Floats, Sample
from mdstopo.optimizer.safeguards import (
    CUT_SHRINK,
    PENALTY_CEILING,
    PENALTY_GROWTH,
    cuts_from,
    cuts_of,
    first_penalty,
    next_convex,
    next_merit_penalty,
    next_shift,
    next_trust,
    no_cuts,
    outdated,
    residual_unit,
)
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.subproblem import solve
from mdstopo.optimizer.violations import merit, scaled_violation
from mdstopo.optimizer.wide import Measures, ShiftRule, is_wide, next_wide_shift, propose
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES
from mdstopo.settings.optimizer_presets import Settings
from mdstopo.status import RunStatus

Indices = NDArray[np.intp]

#: convex terms tried in turn, in the largest gradient entry over the range, where a subproblem resists
RESCUE_WEIGHTS = (0.01, 1.0)
#: steps in a row without a decrease that counts, after which the method is at its end
PATIENCE = 2
#: the least distance of a shift at zero from a variable, in ranges; and the share of it that a step may take
LEAST_SHIFT, SHIFT_REACH = 1e-9, 1.0 - 1e-3
#: share of its penalty from which on a multiplier has come up to it
REACHED = 0.99


class SeparableMethod:
    """Begin, judge and propose for one problem.

    space: bounds, linear rows and ranges; measures: of designs and gradients, shared with the driver; settings: from
    `presets.settings`; competitors: as of `problem.Problem`. Each method changes the state that it is given; the driver
    copies it first.
    """

    def __init__(
        self, space: FeasibleSet, measures: Measures, settings: Settings, competitors: int | None = None
    ) -> None:
        self.space = space
        self.settings = settings
        self._measures = measures
        self._competitors = competitors
        self._rule = ShiftRule.of(settings)
        self._trusted = settings.flag("trust_region")

    def begin(self, state: GsaoState) -> None:
        """Start at the iterate of a new state, whose shifts, trust box and convex term are those of the settings."""
        state.penalty = state.merit_penalty = first_penalty(state.sample, self.settings)

    # -- the steps

    def judge(self, state: GsaoState, sample: Sample) -> bool:
        """Whether the evaluated trial is accepted, and then the iterate.

        Adapts the trust box, the convex term, shifts and cuts, and the count of steps without decrease.
        """
        settings = self.settings
        before = merit(state.objective, state.sample.constraint_levels, state.merit_penalty)
        after = merit(sample.objective, sample.constraint_levels, state.merit_penalty)
        actual = before - after
        ratio = actual / state.predicted if state.predicted > 0.0 else -1.0
        # A decrease that rounding decides is none: both sums carry it.
        negligible = settings.number("decrease_tolerance") * abs(state.objective)
        small = abs(actual) <= negligible and abs(state.predicted) <= negligible
        state.small = state.small + 1 if small else 0
        accepted = not self._trusted or ratio >= settings.number("accept_ratio")
        trust, convex = state.trust, state.convex
        state.convex = next_convex(state.convex, ratio, actual < state.predicted, settings)
        state.trust = next_trust(state.trust, ratio, settings) if self._trusted else 1.0
        if accepted:
            state.cuts, state.cut_gradients, state.cuts_lowered = cuts_from(state, state.trial, sample.objective)
            self._follow(state)
            state.take(sample, scaled_violation(sample))
        elif len(state.alpha) < VERY_MANY_VARIABLES and settings.number("peaks") > 1:
            state.cuts, state.cut_gradients, state.cuts_lowered, told = cuts_of(state, sample)
            if told:
                state.trust, state.convex = CUT_SHRINK * trust, convex
        if small and outdated(state):  # which compares the new iterate
            state.cuts, state.cut_gradients, state.cuts_lowered = no_cuts(len(state.alpha))
            state.forgotten, state.small = state.objective, 0
        return accepted

    def propose(self, state: GsaoState) -> None:
        """Approximate at the iterate, solve, and set the next trial, what it promises, and the KKT residual."""
        chosen = self._competing(state)
        if is_wide(state, self.space.linear, self.settings) and self._propose_wide(state, chosen):
            return
        sample = state.sample
        model, optimum = self._solve(state, chosen)
        promised, constraints = model.model(optimum.x)
        if optimum.converged:
            multipliers = optimum.multipliers[model.n_objective :]
            carried = np.bincount(sample.groups, weights=multipliers, minlength=len(state.penalty)).astype(np.float64)
            state.merit_penalty = next_merit_penalty(state.merit_penalty, carried, state.penalty)
        before = merit(state.objective, sample.constraint_levels, state.merit_penalty)
        state.trial = optimum.x
        state.predicted = before - merit(promised, sample.levels_of(constraints), state.merit_penalty)
        state.kkt = self._kkt(state, model, optimum) if optimum.converged else float("nan")
        if not optimum.converged and not state.predicted > 0.0:
            state.status = RunStatus.FAILED
            state.reason = "the approximate subproblem could not be solved; the best design so far is kept"
        if len(state.penalty) and state.violation > self.settings.tolerance:
            reached = sample.levels_of(optimum.multipliers[model.n_objective :]) >= REACHED * state.penalty
            ceiling = PENALTY_CEILING * first_penalty(sample, self.settings)
            raised = np.minimum(PENALTY_GROWTH * state.penalty, np.maximum(ceiling, state.penalty))
            state.penalty = np.where(reached, raised, state.penalty)

    def is_exhausted(self, state: GsaoState) -> bool:
        """Whether the last steps have changed next to nothing."""
        return state.small >= PATIENCE and state.violation <= self.settings.tolerance

    # -- how

    def _follow(self, state: GsaoState) -> None:
        """The shifts after the step from the iterate to the trial."""
        last, state.step = state.step, Step(state.trial, state.alpha)
        if len(state.alpha) >= VERY_MANY_VARIABLES:
            state.shift = next_wide_shift(state.shift, last, state.step, self._rule, self._measures.room)
        else:
            state.shift = Shifts(next_shift(state.shift.array(), last, state.step, self.settings))

    def _propose_wide(self, state: GsaoState, chosen: Indices) -> bool:
        """Propose as of many variables, if the highest row decides; whether it did."""
        found = propose(state, chosen, self._measures, self.settings)
        if found is None:
            return False
        if len(state.merit_penalty):
            none = np.zeros_like(state.merit_penalty)
            state.merit_penalty = next_merit_penalty(state.merit_penalty, none, state.penalty)
        before = merit(state.objective, state.sample.constraint_levels, state.merit_penalty)
        state.trial, state.kkt = found.trial, found.kkt
        state.predicted = before - found.promised
        return True

    def _solve(self, state: GsaoState, chosen: Indices) -> tuple[Approximation, Optimum]:
        """The model whose competing rows are `chosen`, and its solution; more convex where it resists."""
        linear = self.space.linear
        model = self._approximate(state, chosen)
        lower, upper = self._box(state, model)
        penalty = state.penalty[state.sample.groups] if len(state.penalty) else state.penalty
        optimum = solve(model, lower, upper, linear, penalty)
        for weight in RESCUE_WEIGHTS:
            if optimum.converged:
                break
            steepest = float(np.abs(model.slopes[: model.n_objective]).max())
            model = replace(model, kappa=model.kappa + weight * steepest / self.space.range)
            optimum = solve(model, lower, upper, linear, penalty)
        return model, optimum

    def _competing(self, state: GsaoState) -> Indices:
        """The rows that compete for the objective, by their places."""
        settings = self.settings
        if len(state.rows) == 1:
            return np.zeros(1, dtype=np.intp)
        if self._competitors is not None and settings.number("peaks") > 1:
            return np.arange(len(state.rows))[: self._competitors]
        highest = float(state.rows.max())
        near = state.rows >= highest - settings.number("peak_window") * abs(highest)
        return np.flatnonzero(near)[: int(settings.number("peaks"))]

    def _approximate(self, state: GsaoState, chosen: Indices) -> Approximation:
        settings = self.settings
        n = len(state.alpha)
        slopes = np.concatenate(
            [state.gradients[chosen], state.cut_gradients.reshape(-1, n), state.constraint_gradients.reshape(-1, n)]
        )
        distance = state.shift.array() * self.space.range
        below = distance
        if settings.flag("zero_shift"):
            # A variable at zero would have its shift on top of it.
            below = np.maximum(state.alpha, LEAST_SHIFT * self.space.range)
        steepest = float(self._measures.steepest(state.gradients)[chosen].max())
        return Approximation(
            state.alpha,
            below,
            distance,
            np.concatenate([state.rows[chosen], state.cuts, state.constraint_rows]),
            slopes,
            len(chosen) + len(state.cuts),
            settings.number("power"),
            settings.flag("sign_rule"),
            state.convex * steepest / self.space.range,
        )

    def _box(self, state: GsaoState, model: Approximation) -> tuple[Floats, Floats]:
        """Bounds, move limit, trust box, and the margin that keeps x strictly between its shifts."""
        settings = self.settings
        reach = np.minimum(settings.number("move_limit"), state.trust * self.space.range)
        below, above = reach, reach
        if not model.linear:
            share = 1.0 - settings.number("shift_margin")
            if not settings.flag("zero_shift"):
                below = np.minimum(below, share * model.below)
            elif float(self.space.lower.min()) <= 0.0:
                below = np.where(self.space.lower > 0.0, below, np.minimum(below, SHIFT_REACH * model.below))
            if not model.linear_above:
                above = np.minimum(above, share * model.above)
        return np.maximum(self.space.lower, state.alpha - below), np.minimum(self.space.upper, state.alpha + above)

    def _kkt(self, state: GsaoState, model: Approximation, optimum: Optimum) -> float:
        """The projected KKT residual at the iterate with the subproblem's multipliers, relative to max
        |dU/dalpha|.

        The largest of: what a step along the negative gradient of the Lagrangian, scaled by the largest gradient
        entry, moves within the bounds; the gap of competing rows that carry a multiplier, of cuts with what they were
        lowered by; the slack of volume rows that carry one. At an optimum the subproblem returns the iterate and its
        multipliers, and all are zero.
        """
        steepest = residual_unit(state, float(self._measures.steepest(state.gradients)[0]))
        if steepest == 0.0:
            return 0.0
        linear = self.space.linear
        n_obj = model.n_objective
        gradient = np.einsum("r,ri->i", optimum.multipliers, model.slopes)
        scale = self.space.scale
        gradient = (gradient + np.einsum("r,ri->i", optimum.linear_multipliers, linear.A)) / (steepest / scale)
        descended = np.clip(state.alpha - gradient, self.space.lower, self.space.upper)
        moved = np.abs(state.alpha - descended).max(initial=0.0) / scale
        below = model.values[:n_obj].max() - model.values[:n_obj]
        # a cut that said more of the iterate than is true is a slope of somewhere else, and no second peak here
        below[n_obj - len(state.cuts) :] += state.cuts_lowered
        gaps = optimum.multipliers[:n_obj] * below
        slack = np.where(linear.equal, 0.0, optimum.linear_multipliers * linear.excess(state.alpha))
        held = optimum.multipliers[n_obj:] * state.constraint_rows
        complementarity = float(np.abs(gaps).sum() + np.abs(slack).sum() + np.abs(held).sum()) / (scale * steepest)
        return max(float(moved), complementarity)
