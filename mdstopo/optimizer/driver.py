"""The driver loop, as the paper's Figure 2: evaluate, judge, adapt, approximate, solve, and again.

One step is one evaluation. Between two steps everything is in `State`, so that the loop can be stopped,
stored and resumed anywhere without a difference in any bit.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.bundle_method import (
    PATIENCE,
    RESET_SHRINK,
    RESET_TRUST,
    RESETS,
    RESTORED_PRICE,
    STAGNANT,
    BundleMethod,
)
from mdstopo.optimizer.interior import Optimum
from mdstopo.optimizer.presets import Settings
from mdstopo.optimizer.problem import Floats, Problem, Sample
from mdstopo.optimizer.projection import project
from mdstopo.optimizer.rows import NOTHING, DenseModel, FeasibleSet
from mdstopo.optimizer.safeguards import (
    CUT_SHRINK,
    PRICE_CEILING,
    PRICE_GROWTH,
    better,
    cuts_from,
    cuts_of,
    failure,
    first_price,
    is_least,
    merit,
    next_charge,
    next_convex,
    next_shift,
    next_trust,
    no_cuts,
    outdated,
    plain_violation,
    residual_unit,
    scaled_violation,
    verdict,
)
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.state import History, RowDetails, State, Step
from mdstopo.optimizer.subproblem import solve
from mdstopo.optimizer.wide import Measures, ShiftRule, Space, is_wide, next_wide_shift, propose, ranges
from mdstopo.optimizer.wide_numbers import WIDE
from mdstopo.optimizer.wide_rows import WideModel
from mdstopo.status import RunStatus

Indices = NDArray[np.intp]

# Share of U by which a design may be better than the iterate that has converged, by what it breaks limits within their
# tolerance.
EQUAL = 1e-5
# Convex terms tried in turn, in the largest gradient entry over the range, where a subproblem resists.
RESCUE_WEIGHTS = (0.01, 1.0)


class Gsao:
    """General Sequential Approximate Optimization of a `Problem`.

    problem: what to minimise; settings: from `presets.settings`. `start` gives the first state, `step` the
    next one, until `state.running` is false. Raises InfeasibleRows from `start` where no design satisfies
    bounds and volume rows, and ValueError where the bounds cross.
    """

    def __init__(self, problem: Problem, settings: Settings, clock: Callable[[], float] = time.perf_counter) -> None:
        self.problem = problem
        self.settings = settings
        self.clock = clock
        self.lower = np.asarray(problem.lower, dtype=np.float64)
        self.upper = np.asarray(problem.upper, dtype=np.float64)
        if not np.all(self.lower <= self.upper):
            raise ValueError("a lower bound lies above its upper bound")
        self.range = ranges(self.lower, self.upper)
        self.competitors: int | None = getattr(problem, "competitors", None)
        self.trusted = settings.flag("trust_region")
        #: whether rows compete from the start; else the separable model begins
        self.competes = bool(getattr(problem, "competes", False))
        self._rule = ShiftRule.of(settings)
        self._measures = Measures(Space.of(self.lower, self.upper, problem.linear))
        self.bundle = self._bundle_method() if settings.flag("bundle") else None

    def _bundle_method(self) -> BundleMethod | None:
        """That of the problem's size; of very many variables only where rows compete from the start."""
        feasible = FeasibleSet(self.lower, self.upper, self.problem.linear, self.range)
        if len(self.lower) < WIDE:
            return BundleMethod(DenseModel(feasible), self.settings)
        return BundleMethod(WideModel(feasible, self._measures), self.settings) if self.competes else None

    def start(self, initial: Floats | None = None) -> State:
        """Evaluate the (projected) initial design and propose a first step."""
        began = self.clock()
        first = self.problem.initial if initial is None else initial
        alpha = project(np.asarray(first, dtype=np.float64), self.lower, self.upper, self.problem.linear)
        sample = self.problem.evaluate(alpha)
        wrong = failure(sample, self._measures.steepest)
        n = len(alpha)
        price = np.zeros(0) if wrong else first_price(sample, self.settings)
        violation, plain = (float("inf"),) * 2 if wrong else (scaled_violation(sample), plain_violation(sample))
        state = State(
            alpha=alpha,
            objective=sample.objective,
            rows=sample.rows,
            gradients=sample.gradients,
            constraint_rows=sample.constraint_rows,
            constraint_gradients=sample.constraint_gradients,
            violation=violation,
            cuts=no_cuts(n)[0],
            cut_gradients=no_cuts(n)[1],
            forgotten=float("inf"),
            trial=alpha,
            predicted=0.0,
            kkt=float("nan"),
            shift=Shifts(np.full(n, self.settings.number("shift_start"))),
            step=Step(alpha, alpha),
            trust=self.settings.number("trust_start") if self.trusted else 1.0,
            convex=self.settings.number("convex_start"),
            price=price,
            charge=price,
            row_details=RowDetails.of(sample),
            bundle=Bundle.empty(n),
            multipliers=np.zeros(0),
            steps=np.zeros((0, n)),
            changes=np.zeros((0, n)),
            uses_bundle=False,
            restoring=False,
            resets=0,
            concavity=np.zeros(1),
            stagnation=0,
            violation_mark=float("inf"),
            dropped=False,
            largest_gradient=0.0,
            iteration=0,
            evaluations=1,
            small=0,
            failed=0,
            seconds=0.0,
            best_alpha=alpha,
            best_objective=sample.objective,
            best_violation=violation,
            best_plain=plain,
            status=RunStatus.RUNNING,
            reason="",
            history=History(),
        )
        if wrong:
            state.status = RunStatus.FAILED
            state.reason = f"the initial design cannot be evaluated: {wrong}"
        else:
            if self.bundle is not None and self.competes:
                self._begin_bundle(state)
            self._propose(state)
            self._switch_method(state)  # where the first design is one that the piece at work cannot leave
        return self._finish(state, sample, alpha, 0.0, not wrong, began)

    def step(self, state: State) -> State:
        """One iteration: evaluate the proposed design, judge it, adapt, and propose the next.

        Raises ValueError where the state is not running.
        """
        if not state.running:
            raise ValueError(f"the run has ended: {state.reason}")
        began = self.clock()
        state = state.copy()
        state.iteration += 1
        state.evaluations += 1
        tried, origin = state.trial, state.alpha
        sample = self.problem.evaluate(tried)
        self._measures.look(sample.gradients, tried)
        wrong = failure(sample, self._measures.steepest)
        accepted = False
        if wrong:
            self._retreat(state, wrong)
        else:
            accepted = self._judge(state, sample)
        if state.running:
            self._propose(state)
            self._switch_method(state)
        change, _ = self._measures.change(tried, origin)
        return self._finish(state, sample, tried, change, accepted, began)

    def reopen(self, state: State) -> State:
        """The state under the present limits: a run that a moved limit or tolerance ended goes on."""
        state = state.copy()
        state.status, state.reason = verdict(state, self._is_stuck(state), self.settings)
        return state

    # The steps of the loop.

    def _judge(self, state: State, sample: Sample) -> bool:
        """Accept or reject the evaluated trial and adapt what depends on that; whether it was accepted."""
        settings = self.settings
        violation, plain = scaled_violation(sample), plain_violation(sample)
        if better(sample.objective, violation, plain, state, settings.tolerance):
            state.best_alpha, state.best_objective = state.trial, sample.objective
            state.best_violation, state.best_plain = violation, plain
        state.failed = 0
        if state.uses_bundle:
            assert self.bundle is not None
            accepted = self.bundle.judge(state, sample)
            if accepted:
                self._take(state, sample)
            return accepted
        before = merit(state.objective, state.sample.constraint_levels, state.charge)
        after = merit(sample.objective, sample.constraint_levels, state.charge)
        actual = before - after
        ratio = actual / state.predicted if state.predicted > 0.0 else -1.0
        # A decrease that rounding decides is none: both sums carry it.
        negligible = settings.number("decrease_tolerance") * abs(state.objective)
        small = abs(actual) <= negligible and abs(state.predicted) <= negligible
        state.small = state.small + 1 if small else 0
        accepted = not self.trusted or ratio >= settings.number("accept_ratio")
        trust, convex = state.trust, state.convex
        state.convex = next_convex(state.convex, ratio, actual < state.predicted, settings)
        state.trust = next_trust(state.trust, ratio, settings) if self.trusted else 1.0
        if accepted:
            state.cuts, state.cut_gradients = cuts_from(state, state.trial, sample.objective)
            last, state.step = state.step, Step(state.trial, state.alpha)
            if len(state.alpha) >= WIDE:
                state.shift = next_wide_shift(state.shift, last, state.step, self._rule, self._measures.room)
            else:
                state.shift = Shifts(next_shift(state.shift.array(), last, state.step, settings))
            self._take(state, sample)
        elif len(state.alpha) < WIDE and settings.number("peaks") > 1:
            state.cuts, state.cut_gradients, told = cuts_of(state, sample)
            if told:
                state.trust, state.convex = CUT_SHRINK * trust, convex
        if small and outdated(state):
            state.cuts, state.cut_gradients = no_cuts(len(state.alpha))
            state.forgotten, state.small = state.objective, 0
        return accepted

    def _take(self, state: State, sample: Sample) -> None:
        """The trial becomes the iterate."""
        state.alpha = state.trial
        state.objective, state.violation = sample.objective, scaled_violation(sample)
        state.rows, state.gradients = sample.rows, sample.gradients
        state.constraint_rows, state.constraint_gradients = sample.constraint_rows, sample.constraint_gradients
        state.row_details = RowDetails.of(sample)

    def _begin_bundle(self, state: State, trust: float | None = None, price: Floats | None = None) -> None:
        """The bundle method goes on from the iterate."""
        assert self.bundle is not None
        state.uses_bundle, state.small = True, 0
        if trust is not None:
            state.trust = trust
        self.bundle.begin(state, price)

    def _switch_method(self, state: State) -> None:
        """Where the piece at work gets no further: another one, or the same without what it knows from elsewhere."""
        if self.bundle is None or state.status is not RunStatus.RUNNING:
            return
        tolerance = self.settings.tolerance
        done = state.kkt <= tolerance
        stuck = self._is_stuck(state)
        if not state.uses_bundle:
            if stuck and not (done and state.violation <= tolerance):
                self._begin_bundle(state, max(state.trust, RESET_TRUST))
                self._propose(state)
            return
        if state.restoring:
            kept = plain_violation(state.sample) <= NOTHING * tolerance
            # what is left may be rounding of a steep limit: within the tolerance it is kept
            if kept or ((stuck or done) and state.violation <= tolerance):
                state.restoring = False
                self._begin_bundle(state, max(state.trust, 1e-3))
                state.price = RESTORED_PRICE * state.price
                self._propose(state)
            elif stuck and not is_least(state, tolerance):
                self._reset_bundle(state)
            return
        resists = len(state.price) > 0 and state.violation > tolerance
        if resists and (stuck or done or state.stagnation >= STAGNANT):
            state.restoring, state.resets = True, 0
            self._begin_bundle(state, max(state.trust, RESET_TRUST))
            self._propose(state)
        elif stuck and not done:
            self._reset_bundle(state)

    def _reset_bundle(self, state: State) -> None:
        """Go on without rows from elsewhere, which may forbid what is possible; not too often at one place."""
        if state.resets >= RESETS:
            return
        trust = RESET_TRUST * RESET_SHRINK**state.resets
        self._begin_bundle(state, min(trust, max(state.trust, 1e-2 * trust)), state.price)
        state.resets += 1
        self._propose(state)

    def _is_stuck(self, state: State) -> bool:
        """Whether the next step would change next to nothing, or the last ones have."""
        if self._move(state) <= self.settings.number("change_tolerance"):
            return True
        if state.uses_bundle:
            return state.small >= PATIENCE or not state.predicted > 1e-13 * abs(state.objective)
        return state.small >= 2 and state.violation <= self.settings.tolerance

    def _retreat(self, state: State, wrong: str) -> None:
        """After a failed evaluation: a smaller box around the iterate, or the end after too many in a row."""
        state.failed += 1
        state.small = 0
        move = self._move(state)
        state.trust = min(state.trust, move) * 0.5
        if state.failed > self.settings.number("failures"):
            state.status = RunStatus.FAILED
            state.reason = (
                f"{state.failed} evaluations in a row failed, the last one because {wrong}; "
                "the best design so far is kept"
            )

    def _propose(self, state: State) -> None:
        """Approximate at the iterate, solve, and set the next trial and the KKT residual."""
        if state.uses_bundle:
            assert self.bundle is not None
            self.bundle.propose(state)
            return
        chosen = self._competing(state)
        if is_wide(state, self.problem.linear, self.settings):
            found = propose(state, chosen, self._measures, self.settings)
            if found is not None:
                if len(state.charge):
                    state.charge = next_charge(state.charge, np.zeros_like(state.charge), state.price)
                before = merit(state.objective, state.sample.constraint_levels, state.charge)
                state.trial, state.kkt = found.trial, found.kkt
                state.predicted = before - found.promised
                return
        model = self._approximate(state, chosen)
        lower, upper = self._box(state, model)
        sample = state.sample
        price = state.price[sample.groups] if len(state.price) else state.price
        optimum = solve(model, lower, upper, self.problem.linear, price)
        for weight in RESCUE_WEIGHTS:
            if optimum.converged:
                break
            steepest = float(np.abs(model.slopes[: model.n_objective]).max())
            model = replace(model, kappa=model.kappa + weight * steepest / self.range)
            optimum = solve(model, lower, upper, self.problem.linear, price)
        promised, constraints = model.model(optimum.x)
        if optimum.converged:
            multipliers = optimum.multipliers[model.n_objective :]
            carried = np.bincount(sample.groups, weights=multipliers, minlength=len(state.price)).astype(np.float64)
            state.charge = next_charge(state.charge, carried, state.price)
        before = merit(state.objective, sample.constraint_levels, state.charge)
        state.trial = optimum.x
        state.predicted = before - merit(promised, sample.levels_of(constraints), state.charge)
        state.kkt = self._kkt(state, model, optimum) if optimum.converged else float("nan")
        if not optimum.converged and not state.predicted > 0.0:
            state.status = RunStatus.FAILED
            state.reason = "the approximate subproblem could not be solved; the best design so far is kept"
        if len(state.price) and state.violation > self.settings.tolerance:
            bought = sample.levels_of(optimum.multipliers[model.n_objective :]) >= 0.99 * state.price
            dearest = PRICE_CEILING * first_price(sample, self.settings)
            dearer = np.minimum(PRICE_GROWTH * state.price, np.maximum(dearest, state.price))
            state.price = np.where(bought, dearer, state.price)

    def _competing(self, state: State) -> Indices:
        """The rows that compete for the objective, by their places."""
        settings = self.settings
        if len(state.rows) == 1:
            return np.zeros(1, dtype=np.intp)
        if self.competitors is not None and settings.number("peaks") > 1:
            return np.arange(len(state.rows))[: self.competitors]
        highest = float(state.rows.max())
        near = state.rows >= highest - settings.number("peak_window") * abs(highest)
        return np.flatnonzero(near)[: int(settings.number("peaks"))]

    def _approximate(self, state: State, chosen: Indices) -> Approximation:
        settings = self.settings
        n = len(state.alpha)
        slopes = np.concatenate(
            [state.gradients[chosen], state.cut_gradients.reshape(-1, n), state.constraint_gradients.reshape(-1, n)]
        )
        distance = state.shift.array() * self.range
        below = distance
        if settings.flag("zero_shift"):
            # A variable at zero would have its shift on top of it.
            below = np.maximum(state.alpha, 1e-9 * self.range)
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
            state.convex * steepest / self.range,
        )

    def _box(self, state: State, model: Approximation) -> tuple[Floats, Floats]:
        """Bounds, move limit, trust box, and the margin that keeps x strictly between its shifts."""
        settings = self.settings
        reach = np.minimum(settings.number("move_limit"), state.trust * self.range)
        below, above = reach, reach
        if not model.linear:
            share = 1.0 - settings.number("shift_margin")
            if not settings.flag("zero_shift"):
                below = np.minimum(below, share * model.below)
            elif float(self.lower.min()) <= 0.0:
                below = np.where(self.lower > 0.0, below, np.minimum(below, (1.0 - 1e-3) * model.below))
            if not model.linear_above:
                above = np.minimum(above, share * model.above)
        return np.maximum(self.lower, state.alpha - below), np.minimum(self.upper, state.alpha + above)

    # Measures.

    def _kkt(self, state: State, model: Approximation, optimum: Optimum) -> float:
        """The projected KKT residual at the iterate with the subproblem's multipliers, relative to max
        |dU/dalpha|.

        The largest of: what a step along the negative gradient of the Lagrangian, scaled by the largest
        gradient entry, moves within the bounds; the gap of competing rows that carry a multiplier; the slack
        of volume rows that carry one. At an optimum the subproblem returns the iterate and its multipliers,
        and all are zero.
        """
        steepest = residual_unit(state, float(self._measures.steepest(state.gradients)[0]))
        if steepest == 0.0:
            return 0.0
        linear = self.problem.linear
        n_obj = model.n_objective
        gradient = np.einsum("r,ri->i", optimum.multipliers, model.slopes)
        gradient = (gradient + np.einsum("r,ri->i", optimum.linear_multipliers, linear.A)) / steepest
        moved = np.abs(state.alpha - np.clip(state.alpha - gradient, self.lower, self.upper)).max(initial=0.0)
        gaps = optimum.multipliers[:n_obj] * (model.values[:n_obj].max() - model.values[:n_obj])
        slack = np.where(linear.equal, 0.0, optimum.linear_multipliers * linear.excess(state.alpha))
        held = optimum.multipliers[n_obj:] * state.constraint_rows
        complementarity = float(np.abs(gaps).sum() + np.abs(slack).sum() + np.abs(held).sum()) / steepest
        return max(float(moved), complementarity)

    def _move(self, state: State) -> float:
        return self._measures.change(state.trial, state.alpha)[1]

    def _finish(
        self, state: State, sample: Sample, design: Floats, change: float, accepted: bool, began: float
    ) -> State:
        """Write the history's row and look at the stops."""
        state.seconds += self.clock() - began
        state.history = state.history.extended(
            sample,
            self._measures.excess(design),
            change,
            state.evaluations,
            state.seconds,
            state.kkt,
            accepted,
        )
        state.status, state.reason = verdict(state, self._is_stuck(state), self.settings)
        if state.status is RunStatus.CONVERGED:
            self._report_iterate(state)
        return state

    @staticmethod
    def _report_iterate(state: State) -> None:
        """What has converged is what is told, where a design before it is better by no more than limits are kept to."""
        if abs(state.objective - state.best_objective) <= EQUAL * abs(state.best_objective):
            state.best_alpha, state.best_objective = state.alpha, state.objective
            state.best_violation, state.best_plain = state.violation, plain_violation(state.sample)


def run(
    optimizer: Gsao,
    state: State | None = None,
    *,
    on_iteration: Callable[[State], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
) -> State:
    """Drive an optimiser to its end, from `state` or from the start.

    on_iteration sees every new state, the first included. Between iterations stop_requested is asked; if it
    says yes the state is returned still running, and `run` continues from it as if nothing had been.
    """
    if state is None:
        state = optimizer.start()
        if on_iteration is not None:
            on_iteration(state)
    while state.running:
        if stop_requested is not None and stop_requested():
            break
        state = optimizer.step(state)
        if on_iteration is not None:
            on_iteration(state)
    return state
