"""The driver loop, as the paper's Figure 2: evaluate, judge, adapt, approximate, solve, and again.

The interface is that of `interface`.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.bundle_method import RESET_TRUST, BundleMethod
from mdstopo.optimizer.competing_rows import DenseModel, FeasibleSet
from mdstopo.optimizer.gsao_state import GsaoState, RowDetails, Step
from mdstopo.optimizer.interface import known_at_first
from mdstopo.optimizer.nearest_feasible import project
from mdstopo.optimizer.problem import Floats, Problem, Sample
from mdstopo.optimizer.safeguards import no_cuts, verdict, why_unusable
from mdstopo.optimizer.separable import SeparableMethod
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.state import State
from mdstopo.optimizer.violations import better, plain_violation, scaled_violation
from mdstopo.optimizer.wide import Measures, Space, ranges
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES
from mdstopo.optimizer.wide_rows import WideModel
from mdstopo.settings.optimizer_presets import Settings
from mdstopo.status import RunStatus, Status

# Share of U by which a design may be better than the iterate that has converged, by what it breaks limits within their
# tolerance.
EQUAL = 1e-5
# What is left of the step that led to a failed evaluation.
RETREAT = 0.5
# Iterations after which the separable model hands a smooth objective over to the bundle method, whose curvature leads
# on sooner from there.
HAND_OVER = 30


class Method(Protocol):
    """The interface of a method that makes the optimiser's steps; it changes the state in place, which is a copy."""

    def begin(self, state: GsaoState) -> None:
        """Go on from the iterate, whatever another method knows."""

    def judge(self, state: GsaoState, sample: Sample) -> bool:
        """Whether the evaluated trial is accepted, and then the iterate; adapts what depends on that."""

    def propose(self, state: GsaoState) -> None:
        """Set the next trial, what it promises, and the KKT residual at the iterate."""

    def is_exhausted(self, state: GsaoState) -> bool:
        """Whether the last steps have changed next to nothing, or the next one promises nothing."""


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
        space = FeasibleSet(self.lower, self.upper, problem.linear, ranges(self.lower, self.upper))
        self._measures = Measures(Space.of(self.lower, self.upper, problem.linear))
        self.separable = SeparableMethod(space, self._measures, settings, getattr(problem, "competitors", None))
        #: whether rows compete from the start; else the separable model begins
        self.competes = bool(getattr(problem, "competes", False))
        self.objective_bound = float(getattr(problem, "objective_bound", -np.inf))
        #: as of `problem.Problem`
        self.smooth = bool(getattr(problem, "smooth", False))
        self.bundle = self._bundle_method(space) if settings.flag("bundle") else None

    def _bundle_method(self, space: FeasibleSet) -> BundleMethod | None:
        """The bundle method for the problem's size; of very many variables only where rows compete from the start."""
        if len(self.lower) < VERY_MANY_VARIABLES:
            return BundleMethod(DenseModel(space), self.settings, self.smooth)
        if not self.competes:
            return None
        return BundleMethod(WideModel(space, self._measures), self.settings, self.smooth)

    def start(self, initial: Floats | None = None) -> GsaoState:
        """Evaluate the (projected) initial design and propose a first step."""
        began = self.clock()
        first = self.problem.initial if initial is None else initial
        alpha = project(np.asarray(first, dtype=np.float64), self.lower, self.upper, self.problem.linear)
        sample = self.problem.evaluate(alpha)
        sample, wrong = self._usable(sample)
        state = self._first_state(alpha, sample, bool(wrong))
        if wrong:
            state.status = RunStatus.FAILED
            state.reason = f"the initial design cannot be evaluated: {wrong}"
        else:
            self.separable.begin(state)
            if self.bundle is not None and self.competes:
                self.bundle.begin(state)
            self._propose(state)
        return self._finish(state, sample, alpha, 0.0, not wrong, began)

    def step(self, state: State) -> GsaoState:
        """One iteration: evaluate the proposed design, judge it, adapt, and propose the next.

        Raises ValueError where the state is not running.
        """
        assert isinstance(state, GsaoState)
        if not state.running:
            raise ValueError(f"the run has ended: {state.reason}")
        began = self.clock()
        state = state.copy()
        state.iteration += 1
        state.evaluations += 1
        tried, origin = state.trial, state.alpha
        sample = self.problem.evaluate(tried)
        self._measures.look(sample.gradients, tried)
        sample, wrong = self._usable(sample)
        accepted = False
        if wrong:
            self._retreat(state, wrong)
        else:
            accepted = self._judge(state, sample)
        if state.running:
            self._propose(state)
        change, _ = self._measures.change(tried, origin)
        return self._finish(state, sample, tried, change, accepted, began)

    def _usable(self, sample: Sample) -> tuple[Sample, str]:
        """The sample, and why it cannot be used, in words; one whose numbers are not finite has a status that says so,
        as the history keeps it."""
        wrong = why_unusable(sample, self._measures.steepest)
        unmarked = wrong and sample.status is Status.OK
        return (replace(sample, status=Status.NON_FINITE) if unmarked else sample), wrong

    def terminate(self, state: State) -> tuple[RunStatus, str]:
        """Whether a state goes on, and if not why."""
        assert isinstance(state, GsaoState)
        return verdict(state, self._is_stuck(state), self.settings, self.objective_bound, self._most_to_gain)

    def _most_to_gain(self, state: GsaoState) -> float:
        """What the rows that are known leave to be gained, as `BundleMethod.most_to_gain` tells it; infinite where
        another method makes the steps."""
        if not state.uses_bundle or self.bundle is None:
            return float("inf")
        return self.bundle.most_to_gain(state)

    # The steps of the loop.

    def _first_state(self, alpha: Floats, sample: Sample, failed: bool) -> GsaoState:
        """The state at a first design, before a method begins."""
        n = len(alpha)
        cuts, cut_gradients, cuts_lowered = no_cuts(n)
        return GsaoState(
            **known_at_first(alpha, sample, failed),
            rows=sample.rows,
            gradients=sample.gradients,
            constraint_rows=sample.constraint_rows,
            constraint_gradients=sample.constraint_gradients,
            violation=float("inf") if failed else scaled_violation(sample),
            row_details=RowDetails.of(sample),
            cuts=cuts,
            cut_gradients=cut_gradients,
            cuts_lowered=cuts_lowered,
            forgotten=float("inf"),
            predicted=0.0,
            shift=Shifts(np.full(n, self.settings.number("shift_start"))),
            step=Step(alpha, alpha),
            trust=self.settings.number("trust_start") if self.settings.flag("trust_region") else 1.0,
            convex=self.settings.number("convex_start"),
            penalty=np.zeros(0),
            merit_penalty=np.zeros(0),
            small=0,
            failed=0,
            largest_gradient=0.0,
            uses_bundle=False,
            bundle=Bundle.empty(n),
            multipliers=np.zeros(0),
            steps=np.zeros((0, n)),
            changes=np.zeros((0, n)),
            restoring=False,
            far_design_tried=False,
            resets=0,
            concavity=np.zeros(1),
            stagnation=0,
            violation_mark=float("inf"),
            reliable_steps=0,
            least_predicted=float("inf"),
        )

    def _judge(self, state: GsaoState, sample: Sample) -> bool:
        """Keep the evaluated trial where it is the best so far; whether the method in use accepts it."""
        violation, plain = scaled_violation(sample), plain_violation(sample)
        if better(sample.objective, violation, plain, state, self.settings.tolerance):
            state.best_alpha, state.best_objective = state.trial, sample.objective
            state.best_violation, state.best_plain = violation, plain
        state.failed = 0
        return self._method(state).judge(state, sample)

    def _propose(self, state: GsaoState) -> None:
        """Set the next trial; where the method in use gets no further, another one sets it, or the same begun anew."""
        self._method(state).propose(state)
        if self.bundle is not None and state.running and self._change_method(state, self.bundle):
            self._method(state).propose(state)

    def _method(self, state: GsaoState) -> Method:
        """The method that makes the steps now."""
        if not state.uses_bundle:
            return self.separable
        assert self.bundle is not None
        return self.bundle

    def _change_method(self, state: GsaoState, bundle: BundleMethod) -> bool:
        """Whether the bundle method takes over or begins anew, because the method in use gets no further, or slowly."""
        stuck = self._is_stuck(state)
        if state.uses_bundle:
            return bundle.begin_anew(state, stuck)
        tolerance = self.settings.tolerance
        slow = self.smooth and state.iteration >= HAND_OVER
        if not (stuck or slow) or (state.kkt <= tolerance and state.violation <= tolerance):
            return False
        state.trust = max(state.trust, RESET_TRUST)
        bundle.begin(state)
        return True

    def _is_stuck(self, state: GsaoState) -> bool:
        """Whether the next step would change next to nothing, or the last ones have."""
        if self._move(state) <= self.settings.number("change_tolerance"):
            return True
        return self._method(state).is_exhausted(state)

    def _retreat(self, state: GsaoState, wrong: str) -> None:
        """After a failed evaluation: a smaller box around the iterate, or the end after too many in a row."""
        state.failed += 1
        state.small = 0
        move = self._move(state)
        state.trust = min(state.trust, move) * RETREAT
        if state.failed > self.settings.number("failures"):
            state.status = RunStatus.FAILED
            state.reason = (
                f"{state.failed} evaluations in a row failed, the last one because {wrong}; "
                "the best design so far is kept"
            )

    def _move(self, state: GsaoState) -> float:
        return self._measures.change(state.trial, state.alpha)[1]

    def _finish(
        self, state: GsaoState, sample: Sample, design: Floats, change: float, accepted: bool, began: float
    ) -> GsaoState:
        """Write the evaluated design into the history and say whether the run ends. Returns the state.

        state: after the iteration; changed here.
        sample: what was found at the design.
        design (N,): the one that was evaluated.
        change: its largest |change of alpha| against the iterate that the step started from.
        accepted: whether it was taken as the iterate.
        began: when the iteration began, by the driver's clock (s).
        """
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
        state.status, state.reason = self.terminate(state)
        if state.status is RunStatus.CONVERGED:
            self._report_iterate(state)
        return state

    def _report_iterate(self, state: GsaoState) -> None:
        """What has converged is what is told, where a design before it is better by no more than limits are kept to."""
        if state.violation <= self.settings.tolerance and abs(state.objective - state.best_objective) <= EQUAL * abs(
            state.best_objective
        ):
            state.best_alpha, state.best_objective = state.alpha, state.objective
            state.best_violation, state.best_plain = state.violation, plain_violation(state.sample)
