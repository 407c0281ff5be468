"""The optimiser's piece for rows that compete, as steps of the driver: begin at an iterate, judge a trial, propose one.

Everything between two steps is in `GsaoState`. What is solved, and how, is in `competing_rows`.
"""

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import (
    FLOOR,
    NO_VIOLATION,
    NULL_STEP_SHRINK,
    RAISE,
    RAISES,
    STEER,
    VIOLATION_COST,
    Around,
    RowModel,
    SecantPairs,
    Trial,
    lower_bound,
)
from mdstopo.optimizer.gsao_state import GsaoState
from mdstopo.optimizer.nearest_feasible import project
from mdstopo.optimizer.problem import Floats, Sample, largest_of_groups
from mdstopo.optimizer.safeguards import is_least, is_negligible, nothing_is_left, residual_unit
from mdstopo.optimizer.violations import merit, plain_violation, scaled_violation
from mdstopo.settings.optimizer_presets import Settings

#: the box after the rows were forgotten, and when another piece begins, in ranges
RESET_TRUST = 0.05
#: steps in a row without a decrease that counts, before rows from elsewhere are forgotten, or the run ends
PATIENCE = 8
#: how often in a row rows from elsewhere are forgotten, each time with a box so much smaller
RESETS, RESET_SHRINK = 3, 0.2
#: share of the row's reach in the box that is rounding of the subproblem
ROUNDING = 1e-8
#: the least penalty, in the first one, and what is left of one at least from step to step
LEAST_PENALTY, PENALTY_FALL = 1e-2, 0.5
#: what is left of the concavity from trial to trial
CONCAVITY_FALL = 0.9
#: iterates whose violation has not fallen to this share of what it was, and of which their rows do not promise it
#: either, after which limits are restored first; and the factor on penalties when that is done
STAGNANT, VIOLATION_FALL, RESTORED_PENALTY = 6, 0.8, 10.0
#: the least box, in ranges, in which the objective is returned to once limits are restored; and the least one in which
#: rows are dropped, in shares of the widest
RETURN_TRUST, LEAST_RESET_TRUST = 1e-3, 1e-2
#: factor on the box, or on a step that was shorter, where the model proves poor; and the least box, in ranges, after it
SHRINK, LEAST_TRUST = 0.5, 1e-12
#: shares of the box above which a step is held back by it, and below which a step leaves it too wide
LONG_STEP, NARROW_STEP = 0.5, 0.1
#: of a smooth objective: lengths of the last step beyond which rows from elsewhere are dropped; and the least and the
#: most that is left of a step that was rejected
FARTHEST, LEAST_LEFT, MOST_LEFT = 5.0, 0.1, 0.6
#: share of the objective below which a promised decrease is none
NO_DECREASE = 1e-13
#: of a smooth objective: the ratios of actual to predicted decrease between which a model is reliable, how many such
#: steps in a row show that the curvature is known, and the ratio from which a prediction made before was wrong
RELIABLE_RATIO, RELIABLE_STEPS, PREDICTION_EXCEEDED = (0.5, 1.5), 3, 10.0
#: how near to the highest of its group at the trial a row is decisive, and how far it may lie above the iterate's level
#: for a null step, both in shares of those levels
DECISIVE, NOT_ABOVE = 1e-12, 1e-9
#: share of the tolerance that a curvature may add to the model of all rows, which makes the design where it is least
#: unique
UNIQUE = 1e-3
#: multipliers of constraints that the residual may have at most, in penalties; share of the largest multiplier that its
#: group can have above which a row has carried one
BOUND, CARRIED = 1e3, 1e-6


class BundleMethod:
    """Begin, judge and propose for one problem.

    model: how subproblems are solved, and of which designs; settings: from `presets.settings`; smooth: as of
    `problem.Problem`. Each method changes the state that it is given; the driver copies it first.
    """

    def __init__(self, model: RowModel, settings: Settings, smooth: bool = False) -> None:
        self.model = model
        self.settings = settings
        self.smooth = smooth

    def begin(self, state: GsaoState) -> None:
        """Go on from the iterate, with its rows alone and without curvature."""
        self._begin(state)

    def begin_anew(self, state: GsaoState, stuck: bool) -> bool:
        """Where no further step is found: restore the limits, return to the objective, or drop rows from elsewhere.

        stuck: whether the last steps or the next one change next to nothing. Whether a new step is to be proposed.
        """
        tolerance = self.settings.tolerance
        done = state.kkt <= tolerance
        if state.restoring:
            kept = plain_violation(state.sample) <= NO_VIOLATION * tolerance
            # what is left may be rounding of a steep limit: within the tolerance it is kept
            if kept or ((stuck or done) and state.violation <= tolerance):
                self._return_to_objective(state)
                return True
            if not stuck or is_least(state, tolerance):
                return False
            if self._reset(state):
                return True
            self._propose_far_design(state)
            return False
        resists = len(state.penalty) > 0 and state.violation > tolerance
        if resists and (stuck or done or state.stagnation >= STAGNANT):
            self._restore(state)
            return True
        return stuck and not done and not self._is_confirmed(state) and self._reset(state)

    def _begin(self, state: GsaoState, penalty: Floats | None = None) -> None:
        """Begin. penalty (J,): on violations from here on; None: that of `first_penalty`, and none while restoring."""
        sample = state.sample
        state.uses_bundle, state.small = True, 0
        rows = self._bundle(sample, state.restoring)
        state.bundle, state.multipliers = rows, np.zeros(len(rows))
        n = len(state.alpha)
        state.steps, state.changes = np.zeros((0, n)), np.zeros((0, n))
        if penalty is not None:
            state.penalty = penalty
        elif state.restoring:
            state.penalty = np.zeros(0)
        else:
            state.penalty = self.first_penalty(rows)
        state.concavity = _carried_over(state.concavity, len(state.penalty) + 1)
        state.stagnation, state.violation_mark = 0, float("inf")
        state.kkt, state.reliable_steps = float("nan"), 0

    def _restore(self, state: GsaoState) -> None:
        """Make the largest violation the objective."""
        state.restoring, state.resets, state.least_predicted = True, 0, float("inf")
        state.trust = max(state.trust, RESET_TRUST)
        self._begin(state)

    def _propose_far_design(self, state: GsaoState) -> None:
        """From a least violation propose a design far off, once a run, unless one before has kept the limits.

        It lies half way to the farthest corner of the bounds, or is the design nearest to that which volume rows allow;
        where this is the iterate itself, nothing is proposed.
        """
        space, x = self.model.space, state.alpha
        known = state.far_design_tried or state.best_violation <= self.settings.tolerance
        if known or state.iteration >= self.settings.max_iterations:
            return
        trial = project(0.5 * (x + self._farthest_corner(x)), space.lower, space.upper, space.linear)
        if self.model.lengths(trial - x)[0] > self.settings.number("change_tolerance"):
            state.far_design_tried, state.trial, state.predicted = True, trial, float("inf")

    def _farthest_corner(self, x: Floats) -> Floats:
        """The corner of the bounds that is farthest from a design x (N,)."""
        space = self.model.space
        return np.where(x - space.lower > space.upper - x, space.lower, space.upper)

    def _return_to_objective(self, state: GsaoState) -> None:
        """Go on with the objective, now that limits hold."""
        state.restoring = False
        state.trust = max(state.trust, RETURN_TRUST)
        self._begin(state)
        state.penalty = RESTORED_PENALTY * state.penalty

    def _reset(self, state: GsaoState) -> bool:
        """Drop rows that belong to other designs: they may exclude steps that are possible. False where that was done
        `RESETS` times already."""
        if state.resets >= RESETS:
            return False
        trust = RESET_TRUST * RESET_SHRINK**state.resets
        state.trust = min(trust, max(state.trust, LEAST_RESET_TRUST * trust))
        self._begin(state, state.penalty)
        state.resets += 1
        return True

    def first_penalty(self, rows: Bundle) -> Floats:
        """The penalty of each constraint (J,): its gradient then weighs as much as the objective's."""
        groups = int(rows.group.max(initial=0)) + 1
        steepest = largest_of_groups(rows.steepest, rows.group, groups)
        steepest = np.where(np.isfinite(steepest) & (steepest > 0.0), steepest, 1.0)
        return np.asarray(VIOLATION_COST * steepest[0] / steepest[1:])

    # -- the steps

    def judge(self, state: GsaoState, sample: Sample) -> bool:
        """Whether the evaluated trial is accepted, and then the iterate; its rows join the bundle in any case.

        Adapts the trust box, the curvature's steps, the concavity, and the counts of steps without decrease.
        """
        if state.trial_is_far_design:
            return self._judge_far_design(state, sample)
        settings = self.settings
        new = self._bundle(sample, state.restoring)
        groups = len(state.penalty) + 1
        here, there = state.bundle.subset(state.bundle.own).levels(groups), new.levels(groups)
        now = merit(here[0], here[1:], state.penalty)
        actual = now - merit(there[0], there[1:], state.penalty)
        ratio = actual / state.predicted if state.predicted > 0.0 else -1.0
        d = state.trial - state.alpha
        self._learn_curvature(state, new, d)
        size, length = self.model.lengths(d)
        seen, moved = new.moved(-d, length), state.bundle.moved(d, length)
        self._learn_concavity(state, seen, here, moved, there)
        negligible = settings.number("decrease_tolerance") * abs(here[0])
        small = abs(actual) <= negligible and abs(state.predicted) <= negligible
        smooth = self._is_smooth(state)
        # the last steps to a smooth optimum are small, but each promises truly what the next one gains
        goes_on = smooth and ratio > settings.number("poor_ratio")
        state.small = state.small + 1 if small and not goes_on else 0
        accepted = ratio >= settings.number("accept_ratio")
        reliable = smooth and RELIABLE_RATIO[0] <= ratio <= RELIABLE_RATIO[1]
        state.reliable_steps = state.reliable_steps + 1 if reliable else 0
        if accepted:
            if actual > PREDICTION_EXCEEDED * state.least_predicted:
                state.least_predicted = float("inf")
            promised = moved.subset(state.bundle.own).levels(groups)
            self._count_stagnation(state, *(float(levels[1:].max(initial=0.0)) for levels in (here, promised, there)))
            state.bundle = moved.without_peaks_of(new).joined(new)
            state.kkt = float("nan")
            state.trust = self._trust_after_step(state.trust, size, ratio)
            if not small:
                state.resets = 0
        else:
            null_step = _is_null_step(seen, here, new.values(), there)
            if smooth:
                promised = moved.subset(state.bundle.own).levels(groups)
                promise = now - merit(promised[0], promised[1:], state.penalty)
                state.trust = _share_to_least(promise, actual) * min(state.trust, size)
            else:
                state.trust = NULL_STEP_SHRINK * state.trust if null_step else SHRINK * min(state.trust, size)
            state.bundle = state.bundle.with_rejected(seen, new.below())
        state.bundle = state.bundle.without_repeats().thinned()
        if smooth:
            state.bundle = state.bundle.without_far(0, FARTHEST * length)
        if accepted:
            state.take(sample, scaled_violation(sample))
        return accepted

    def propose(self, state: GsaoState) -> None:
        """Solve the model and set the next trial, what it promises, and the KKT residual."""
        own = state.bundle.subset(state.bundle.own)
        steepest = float(own.steepest[own.group == 0].max(initial=0.0))
        if np.isnan(state.kkt):
            penalty = np.maximum(state.penalty, self.first_penalty(own) if len(state.penalty) else 0.0) * BOUND
            unit = steepest if state.restoring else residual_unit(state, _steepness_of_highest(own), steepest)
            state.kkt = self.model.residual(own, state.alpha, penalty, unit)
        reach = state.trust, self.settings.number("move_limit")
        pairs = SecantPairs(state.steps, state.changes, self._is_smooth(state))
        around = self.model.around(state.alpha, reach, pairs, max(steepest, 1e-300))

        here = own.levels(len(state.penalty) + 1)
        rows = state.bundle.lowered(here, state.concavity)
        trial = self._steer(state, rows, around, here)
        if not trial.solved:
            state.bundle = rows = own
            trial = self._steer(state, rows, around.flat(FLOOR * steepest), here)
        state.predicted = _predicted_decrease(here, trial, state.penalty)
        if state.reliable_steps >= RELIABLE_STEPS and is_negligible(state.predicted, state, self.settings.tolerance):
            state.least_predicted = min(state.least_predicted, self._predicted_anywhere(state, rows, here, pairs))
        state.trial = trial.x
        state.multipliers = trial.multipliers
        enough = CARRIED * np.concatenate([[1.0], state.penalty])
        state.bundle = state.bundle.aged(trial.multipliers, enough)
        if state.restoring and state.violation > self.settings.tolerance and is_least(state, self.settings.tolerance):
            self._propose_far_design(state)

    def is_exhausted(self, state: GsaoState) -> bool:
        """Whether the last steps have changed next to nothing, or the model promises no decrease."""
        if state.trial_is_far_design:
            return False
        return state.small >= PATIENCE or not state.predicted > NO_DECREASE * abs(state.objective)

    def most_to_gain(self, state: GsaoState) -> float:
        """By how much the merit of any design can be below the iterate's, at most, by all rows that are known; infinite
        where that cannot be told.

        No row of a convex problem lies above its function, and neither does the least value of their model, wherever
        bounds and volume rows let a design be (C. Lemarechal, 1975). Where functions bend downwards, rows from
        elsewhere may claim too much; so nothing is told before those from far off were dropped, and the others are
        lowered by what was seen of the bending.
        """
        if state.restoring or not state.resets:
            return float("inf")
        here = state.bundle.subset(state.bundle.own).levels(len(state.penalty) + 1)
        rows = state.bundle.lowered(here, state.concavity)
        added = UNIQUE * self.settings.tolerance * abs(state.objective)
        no_pairs = SecantPairs(state.steps[:0], state.changes[:0])
        around = self.model.around(state.alpha, (np.inf, np.inf), no_pairs, 0.0)
        trial = around.flat(2.0 * added / len(state.alpha)).solve(rows, state.penalty)
        if not trial.solved:
            return float("inf")
        least = lower_bound(rows, trial, state.alpha, self.model.space, state.penalty)
        return max(merit(here[0], here[1:], state.penalty) - least, 0.0)

    # -- how

    def _predicted_anywhere(self, state: GsaoState, rows: Bundle, here: Floats, pairs: SecantPairs) -> float:
        """The decrease that the curvature which steps have shown predicts, of any step within the bounds; infinite
        where that cannot be told.

        Directions that no step has gone along are taken to be so flat that a whole range would change the objective by
        the tolerance: next to nothing is predicted only where the gradient has next to no part along them. In the model
        that steps come from they have the curvature of the last step, and where that was a stiff one nearly nothing is
        predicted along what is flat and not known.

        rows: the model's; here (J + 1,): the groups' levels at the iterate; pairs: of `RowModel.around`.
        """
        flattest = pairs._replace(first=self.settings.tolerance * abs(state.objective))
        trial = self.model.around(state.alpha, (np.inf, np.inf), flattest, 0.0).solve(rows, state.penalty)
        return _predicted_decrease(here, trial, state.penalty) if trial.solved else float("inf")

    def _is_smooth(self, state: GsaoState) -> bool:
        """Whether what is lowered now has no peaks; the largest violation, which limits are restored by, may have."""
        return self.smooth and not state.restoring

    def _judge_far_design(self, state: GsaoState, sample: Sample) -> bool:
        """Whether limits are to be restored from the evaluated trial, far from the least violation v at the iterate.

        A function that bends downwards by at most b is convex once b r^2 is added, r the distance from the iterate; so
        where it is stationary there, it is at least v - b r^2 everywhere. How far a row of one of the two designs lies
        above the value at the other tells b, as far as that is known. Where b cannot bring v to 0 within the bounds,
        as where the violation is convex, the iterate is the end.
        """
        d = state.trial - state.alpha
        length, new = self.model.lengths(d)[1], self._bundle(sample, restoring=True)
        own, value_there = state.bundle.subset(state.bundle.own), float(new.values().max())
        least = float(own.values().max())
        above = max(new.moved(-d, length).values().max() - least, own.moved(d, length).values().max() - value_there)
        farthest = self.model.lengths(self._farthest_corner(state.alpha) - state.alpha)[1]
        if value_there >= least and above * farthest**2 < least * length**2:
            return False
        state.take(sample, scaled_violation(sample))
        state.trust = self.settings.number("trust_start")
        self._restore(state)
        return True

    def _is_confirmed(self, state: GsaoState) -> bool:
        """Whether rows that were found after others had been dropped leave nothing to be gained."""
        return state.violation <= self.settings.tolerance and nothing_is_left(
            state, self.most_to_gain(state), self.settings.tolerance
        )

    def _trust_after_step(self, trust: float, size: float, ratio: float) -> float:
        """The box after an accepted step of this size, both in ranges; ratio: of actual to predicted decrease."""
        settings = self.settings
        if ratio > settings.number("good_ratio") and size > LONG_STEP * trust:
            return min(1.0, settings.number("trust_grow") * trust)
        if ratio < settings.number("poor_ratio"):
            return max(SHRINK * min(trust, size), LEAST_TRUST)
        if size < NARROW_STEP * trust:  # a box of the size of the steps is solved to more digits
            return max(SHRINK * trust, size / NARROW_STEP)
        return trust

    def _bundle(self, sample: Sample, restoring: bool) -> Bundle:
        """The sample's rows; while limits are restored, those of all constraints as the objective's."""
        if not restoring:
            return Bundle.of(sample, np.arange(len(sample.rows)))
        rows = Bundle.of(sample, np.zeros(0, dtype=np.int64))
        rows.group[:] = 0
        return rows

    def _learn_curvature(self, state: GsaoState, new: Bundle, d: Floats) -> None:
        """Keep the step d (N,) and the change of the Lagrangian's gradient over it, where that can be told."""
        smooth = self._is_smooth(state)
        change = self.model.gradient_change(state.bundle, new, d, state.multipliers, smooth)
        if change is None or not self.model.lengths(d)[0] > 0.0:
            return
        state.steps = self.model.learnt(state.steps, d, smooth)
        state.changes = self.model.learnt(state.changes, change, smooth)

    def _steer(self, state: GsaoState, rows: Bundle, around: Around, here: Floats) -> Trial:
        """The trial, at penalties that make it take away enough of the violation that can go in the box.

        Raises `state.penalty` of violated constraints until it does; other penalties follow the multipliers.
        here (J + 1,): the groups' levels at the iterate.
        """
        trial = around.solve(rows, state.penalty)
        if not len(state.penalty):
            return trial
        reach = around.reach(rows.subset(rows.group > 0))
        tiny = max(NO_VIOLATION * self.settings.tolerance, ROUNDING * float(reach.max(initial=0.0)))
        # as in the merit, so that penalties raised in proportion lead to the least of this sum
        weight = state.penalty / state.penalty.max()

        def violation(levels: Floats) -> float:
            return float(weight @ np.maximum(levels[1:], 0.0))

        if violation(trial.levels) > tiny:
            least = around.least_violation(rows, weight)
            low = violation(least.levels)
            enough = low + (1.0 - STEER) * max(violation(here) - low, 0.0) + tiny
            for _ in range(RAISES):
                too_low = trial.violates(rows, state.penalty, tiny / len(state.penalty))
                if violation(trial.levels) <= enough or not too_low.any():
                    break
                state.penalty = np.where(too_low, RAISE * state.penalty, state.penalty)
                trial = around.solve(rows, state.penalty)
        carried = trial.carried(rows, len(state.penalty))
        state.penalty = np.where(
            trial.violates(rows, state.penalty, tiny),
            state.penalty,
            np.maximum(
                np.maximum(VIOLATION_COST * carried, PENALTY_FALL * state.penalty),
                LEAST_PENALTY * self.first_penalty(rows),
            ),
        )
        return trial

    def _count_stagnation(self, state: GsaoState, before: float, promised: float, violation: float) -> None:
        """Count iterates whose largest violation is not much below that of the one that the count began with.

        before, promised, violation: the largest one at the last iterate, at this one by the rows of the last one, and
        at this one. Where the rows promised a fall, the violation is what they leave out: it goes as steps get shorter.
        """
        if violation <= self.settings.tolerance or violation < VIOLATION_FALL * state.violation_mark:
            state.stagnation = 0
            state.violation_mark = violation if violation > self.settings.tolerance else float("inf")
        elif promised >= VIOLATION_FALL * before:
            state.stagnation += 1

    def _learn_concavity(self, state: GsaoState, seen: Bundle, here: Floats, moved: Bundle, there: Floats) -> None:
        """How much each group was seen to bend downwards: a row from one end of a step above the value at the other."""
        state.concavity = CONCAVITY_FALL * state.concavity
        for rows, levels in ((seen, here), (moved, there)):
            some = rows.distance > 0.0
            over = (rows.values() - levels[rows.group])[some] / rows.distance[some] ** 2
            np.maximum.at(state.concavity, rows.group[some], over)


def _predicted_decrease(here: Floats, trial: Trial, penalty: Floats) -> float:
    """By how much the model lowers the merit from the iterate, where the groups' levels are here (J + 1,), to a
    trial."""
    there = merit(trial.levels[0] + trial.curved, trial.levels[1:], penalty)
    return merit(here[0], here[1:], penalty) - there


def _carried_over(concavity: Floats, groups: int) -> Floats:
    """What was seen of how groups bend downwards, where the method begins anew with so many groups.

    The largest violation is taken to bend as the constraint that bends most, and constraints as the largest violation
    did: rows that were seen far away would else stop what is possible until all of it has been seen once more.
    """
    if groups == len(concavity):
        return concavity
    if groups == 1:
        return np.array([concavity[1:].max()])
    return np.concatenate([[0.0], np.full(groups - 1, concavity[0])])


def _share_to_least(promise: float, actual: float) -> float:
    """The share of a rejected step after which its merit is least, by the parabola with the slope and the two ends that
    are known; within limits. promise: of the slopes alone, for the whole step; actual: its decrease."""
    bend = promise - actual
    return min(max(0.5 * promise / bend, LEAST_LEFT), MOST_LEFT) if bend > 0.0 else MOST_LEFT


def _steepness_of_highest(own: Bundle) -> float:
    """The largest gradient entry of the highest row of the objective: lower rows, which may not compete at all, may be
    steeper by far."""
    rows = np.flatnonzero(own.group == 0)
    return float(own.steepest[rows[own.values()[rows].argmax()]]) if len(rows) else 0.0


def _is_null_step(seen: Bundle, here: Floats, values: Floats, there: Floats) -> bool:
    """Whether the rows that made a trial fail tell what stood in the way: none claims more of the iterate than is true.

    seen: the trial's rows from the iterate; values (K,): theirs at the trial; here, there (groups,): the levels at
    both.
    """
    above = seen.values() - here[seen.group]
    decisive = values >= there[seen.group] - DECISIVE * np.abs(there[seen.group])
    return bool((above[decisive] <= NOT_ABOVE * np.abs(here[seen.group][decisive])).all())
