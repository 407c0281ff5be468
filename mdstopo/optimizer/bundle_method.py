"""The optimiser's piece for rows that compete, as steps of the driver: begin at an iterate, judge a trial, propose one.

Everything between two steps is in `State`. What is solved, and how, is in `rows`.
"""

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.presets import Settings
from mdstopo.optimizer.problem import Floats, Sample, largest_of_groups
from mdstopo.optimizer.rows import (
    FLOOR,
    MARGIN,
    NOTHING,
    NULL_STEP_SHRINK,
    RAISE,
    RAISES,
    STEER,
    Around,
    RowModel,
    Trial,
)
from mdstopo.optimizer.safeguards import merit, residual_unit
from mdstopo.optimizer.state import State

#: the box after the rows were forgotten, and when another piece begins, in ranges
RESET_TRUST = 0.05
#: steps in a row without a decrease that counts, before rows from elsewhere are forgotten, or the run ends
PATIENCE = 8
#: how often in a row rows from elsewhere are forgotten, each time with a box so much smaller
RESETS, RESET_SHRINK = 3, 0.2
#: share of the row's reach in the box that is rounding of the subproblem; the least price, of the first
ROUNDING, CHEAPEST = 1e-8, 1e-2
#: what is left of the bend from trial to trial
CONCAVITY_FALL = 0.9
#: iterates whose violation has not fallen to this share of what it was, after which limits are restored first; and the
#: factor on prices when that is done
STAGNANT, VIOLATION_FALL, RESTORED_PRICE = 6, 0.8, 10.0
#: share of the box below which a step leaves it too wide
NARROW = 0.1


class BundleMethod:
    """Begin, judge and propose for one problem.

    model: how subproblems are solved; settings: from `presets.settings`. Each method changes the state that it is
    given; the driver copies it first, and takes an accepted trial as the iterate.
    """

    def __init__(self, model: RowModel, settings: Settings) -> None:
        self.model = model
        self.settings = settings

    def begin(self, state: State, price: Floats | None = None) -> None:
        """Start again at the iterate, with its rows alone and without curvature.

        price (J,): what violations cost from here on; None: as `first_price` says, and nothing while restoring.
        """
        sample = state.sample
        rows = self._bundle(sample, state.restoring)
        state.bundle, state.multipliers = rows, np.zeros(len(rows))
        n = len(state.alpha)
        state.steps, state.changes = np.zeros((0, n)), np.zeros((0, n))
        if price is not None:
            state.price = price
        elif state.restoring:
            state.price = np.zeros(0)
        else:
            state.price = self.first_price(rows)
        state.concavity = np.zeros(len(state.price) + 1)
        state.stagnation, state.violation_mark = 0, float("inf")
        state.kkt = float("nan")

    def first_price(self, rows: Bundle) -> Floats:
        """The price of each constraint (J,): its gradient then weighs as much as the objective's."""
        groups = int(rows.group.max(initial=0)) + 1
        steepest = largest_of_groups(rows.steepest, rows.group, groups)
        steepest = np.where(np.isfinite(steepest) & (steepest > 0.0), steepest, 1.0)
        return np.asarray(MARGIN * steepest[0] / steepest[1:])

    # -- the steps

    def judge(self, state: State, sample: Sample) -> bool:
        """Whether the evaluated trial is accepted; its rows join the bundle in any case, seen from the next iterate.

        Adapts the trust box, the curvature's steps, the concavity, and the counts of steps without decrease.
        """
        settings = self.settings
        new = self._bundle(sample, state.restoring)
        groups = len(state.price) + 1
        here, there = state.bundle.subset(state.bundle.own).levels(groups), new.levels(groups)
        actual = merit(here[0], here[1:], state.price) - merit(there[0], there[1:], state.price)
        ratio = actual / state.predicted if state.predicted > 0.0 else -1.0
        d = state.trial - state.alpha
        self._learn(state, new, d)
        size, length = self.model.lengths(d)
        seen, moved = new.moved(-d, length), state.bundle.moved(d, length)
        self._bend(state, seen, here, moved, there)
        negligible = settings.number("decrease_tolerance") * abs(here[0])
        small = abs(actual) <= negligible and abs(state.predicted) <= negligible
        state.small = state.small + 1 if small else 0
        accepted = ratio >= settings.number("accept_ratio")
        if accepted:
            self._mark(state, there)
            state.bundle = moved.joined(new)
            state.kkt = float("nan")
            if ratio > settings.number("good_ratio") and size > 0.5 * state.trust:
                state.trust = min(1.0, settings.number("trust_grow") * state.trust)
            elif ratio < settings.number("poor_ratio"):
                state.trust = max(0.5 * min(state.trust, size), 1e-12)
            elif size < NARROW * state.trust:  # a box of the size of the steps is solved to more digits
                state.trust = max(0.5 * state.trust, size / NARROW)
            if not small:
                state.resets = 0
        else:
            above = seen.values() - here[seen.group]
            decisive = new.values() >= there[new.group] - 1e-12 * np.abs(there[new.group])
            null_step = bool((above[decisive] <= 1e-9 * np.abs(here[seen.group][decisive])).all())
            state.bundle = seen.joined(state.bundle)
            state.trust = NULL_STEP_SHRINK * state.trust if null_step else 0.5 * min(state.trust, size)
        state.bundle = state.bundle.without_repeats().thinned()
        return accepted

    def propose(self, state: State) -> None:
        """Solve the model and set the next trial, what it promises, and the KKT residual."""
        own = state.bundle.subset(state.bundle.own)
        steepest = float(own.steepest[own.group == 0].max(initial=0.0))
        if np.isnan(state.kkt):
            price = np.maximum(state.price, self.first_price(own) if len(state.price) else 0.0) * 1e3
            unit = steepest if state.restoring else residual_unit(state, steepest)
            state.kkt = self.model.residual(own, state.alpha, price, unit)
        reach = state.trust, self.settings.number("move_limit")
        around = self.model.around(state.alpha, reach, state.steps, state.changes, max(steepest, 1e-300))

        here = own.levels(len(state.price) + 1)
        rows = state.bundle.lowered(here, state.concavity)
        trial = self._steer(state, rows, around, here)
        if not trial.solved:
            state.bundle = rows = own
            trial = self._steer(state, rows, around.flat(FLOOR * steepest), here)
        promised = merit(trial.levels[0] + trial.curved, trial.levels[1:], state.price)
        state.predicted = merit(here[0], here[1:], state.price) - promised
        state.trial = trial.x
        state.multipliers = trial.multipliers
        enough = 1e-6 * np.concatenate([[1.0], state.price])
        state.bundle = state.bundle.used(trial.multipliers, enough)

    # -- how

    def _bundle(self, sample: Sample, restoring: bool) -> Bundle:
        """The sample's rows; while limits are restored, those of all constraints as the objective's."""
        if not restoring:
            return Bundle.of(sample, np.arange(len(sample.rows)))
        rows = Bundle.of(sample, np.zeros(0, dtype=np.int64))
        rows.group[:] = 0
        return rows

    def _learn(self, state: State, new: Bundle, d: Floats) -> None:
        """Keep the step d (N,) and the change of the Lagrangian's gradient over it, where that can be told."""
        change = self.model.gradient_change(state.bundle, new, d, state.multipliers)
        if change is None or not self.model.lengths(d)[0] > 0.0:
            return
        state.steps = self.model.learnt(state.steps, d)
        state.changes = self.model.learnt(state.changes, change)

    def _steer(self, state: State, rows: Bundle, around: Around, here: Floats) -> Trial:
        """The trial, at prices that make it take away enough of the violation that can go in the box.

        Raises `state.price` until it does, and else lets it follow the multipliers. here (J + 1,): the groups' levels
        at the iterate.
        """
        trial = around.solve(rows, state.price)
        if not len(state.price):
            return trial
        reach = around.reach(rows.subset(rows.group > 0))
        tiny = max(NOTHING * self.settings.tolerance, ROUNDING * float(reach.max(initial=0.0)))

        def violation(levels: Floats) -> float:
            return float(np.maximum(levels[1:], 0.0).sum())

        if violation(trial.levels) > tiny:
            least = around.least_violation(rows, len(state.price))
            low = violation(least.levels)
            enough = low + (1.0 - STEER) * max(violation(here) - low, 0.0) + tiny
            for _ in range(RAISES):
                if violation(trial.levels) <= enough:
                    break
                state.price = np.where(trial.levels[1:] > tiny / len(state.price), RAISE * state.price, state.price)
                trial = around.solve(rows, state.price)
        carried = np.bincount(rows.group, weights=trial.multipliers, minlength=len(here))[1:]
        state.price = np.where(
            trial.levels[1:] > tiny,
            state.price,
            np.maximum(np.maximum(MARGIN * carried, 0.5 * state.price), CHEAPEST * self.first_price(rows)),
        )
        return trial

    def _mark(self, state: State, there: Floats) -> None:
        """Count iterates whose largest violation is not much below that of the one that the count began with."""
        violation = float(there[1:].max(initial=0.0))
        if violation <= self.settings.tolerance or violation < VIOLATION_FALL * state.violation_mark:
            state.stagnation, state.violation_mark = (
                0,
                violation if violation > self.settings.tolerance else float("inf"),
            )
        else:
            state.stagnation += 1

    def _bend(self, state: State, seen: Bundle, here: Floats, moved: Bundle, there: Floats) -> None:
        """How much each group was seen to bend downwards: a row from one end of a step above the value at the other."""
        state.concavity = CONCAVITY_FALL * state.concavity
        for rows, levels in ((seen, here), (moved, there)):
            some = rows.distance > 0.0
            over = (rows.values() - levels[rows.group])[some] / rows.distance[some] ** 2
            np.maximum.at(state.concavity, rows.group[some], over)
