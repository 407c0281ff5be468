"""Rounds of pricing: the optimum of the members that are built, the prices of all candidates there, the best enter.

A round begins at the optimum of the last one, with the new members at alpha = 0, and so no round ends higher. Members
leave only where a round has lowered the objective: no set of members comes twice, and the rounds end.
"""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.case.scene.candidates import Pairs, pairs_of, with_members
from mdstopo.case.text.words import count_text
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.state import State
from mdstopo.plan.pricing import Prices, Pricing, confirmed, price
from mdstopo.status import RunStatus
from mdstopo.store.contents import CANDIDATES, Datasets
from mdstopo.store.result_reader import ResultView
from mdstopo.store.store_errors import DamagedError

Floats = NDArray[np.float64]

#: rounds at most
MOST_ROUNDS = 200
#: share of the tolerance by which a round has to lower the objective for a next one, once no candidate alone is worth
#: the tolerance
WORTH_A_ROUND = 0.1
#: rounds in a row that lower it by less, after which the run ends: what gains to first order does not in fact
PATIENCE = 3
#: residual of the optimality conditions of built members, with the slopes that prices follow from, and what these leave
#: them to gain, relative: where an optimum has more of both, its slopes are those of one side of a kink
ONE_SIDED = 1e-3
#: the largest gain, in tolerances, up to which prices of laws that switch are confirmed with members that are built
CLOSE_GAIN = 10.0
#: columns of the table of rounds in the file
COLUMNS = ("members", "entered", "left", "objective", "best", "together", "residual", "level")
#: candidates that the first rounds price, of each group and evenly spread: where an optimum moves far it does so in few
#: rounds. By how many times more it is once none of these gains much, and up to how much, in tolerances
FIRST_PRICED, PRICED_GROWTH, LITTLE_GAIN = 20_000, 32, 100.0


def members_part(case: Case) -> Datasets:
    """The datasets that a file keeps of the members that priced groups have."""
    part: Datasets = {}
    for name, (i, j) in pairs_of(case).items():
        where = f"{CANDIDATES}/members/{name}"
        part |= {f"{where}/from": i.astype(np.int64), f"{where}/to": j.astype(np.int64)}
    return part


class Rounds:
    """The rounds of pricing of a case. case: with the members that are built; design (n,): where the next round
    begins, as the optimiser's x."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.design: Floats = np.zeros(0)
        #: how many rounds have ended, of which a row each
        self.rows: list[tuple[float, ...]] = []
        self.candidates = sum(group.candidates.count for group in case.priced_groups if group.candidates is not None)
        self.last: Prices | None = None
        self._ended = False

    @property
    def count(self) -> int:
        """How many rounds of pricing have ended."""
        return len(self.rows)

    @property
    def outcome(self) -> Pricing | None:
        """What is known of the candidates; None where none are priced."""
        if not self.case.priced_groups:
            return None
        best, together = self.rows[-1][4:6] if self.rows else (np.nan, np.nan)
        return Pricing(self.candidates, self.count, best, together)

    def go_on(self, problem: Problem, state: State) -> bool:
        """Price all candidates at the end of a round. Returns whether another round follows, with the candidates
        that enter.

        problem, state: what was optimised, and where that has ended.
        """
        before = self.rows[-1][3] if self.rows else np.inf
        tolerance = self.case.optimizer.tolerance
        fallen = before - state.best_objective
        level = int(self.rows[-1][-1]) if self.rows else 0
        little = LITTLE_GAIN * tolerance
        while True:
            count = self._count_of(level)
            found = self.last = price(self.case, problem, state.best_alpha, count)
            if found is None:
                self._ended = True
                return False
            if count is None or (found.best > little and fallen > little * abs(state.best_objective)):
                break
            level += 1
        small = WORTH_A_ROUND * tolerance * abs(state.best_objective)
        falls = -np.diff([*(row[3] for row in self.rows[-PATIENCE:]), state.best_objective])
        in_vain = len(falls) >= PATIENCE and bool(np.all(falls <= small))
        if count is None:
            self.candidates = found.seen
            if self._switches and (found.best <= CLOSE_GAIN * tolerance or in_vain):
                found = self.last = confirmed(self.case, problem, state.best_alpha, found)
        pairs, staying = self._entered(found, state, fallen > 0.0)
        entered = sum(len(i) for i, _ in found.pairs.values())
        left = self.case.n_design - int(staying.sum())
        row = (self.case.n_design, entered, left, state.best_objective, found.best, found.together, found.residual,
               level)  # fmt: skip
        enough = count is None and found.best <= tolerance and (found.together <= tolerance or fallen <= small)
        # a round that has not come to its optimum is followed by another
        enough = enough and (state.status is RunStatus.CONVERGED or fallen <= small) and not _is_one_sided(found)
        self._ended = enough or not entered or in_vain or self.count + 1 >= MOST_ROUNDS
        if self._ended:
            row = (*row[:1], 0, 0, *row[3:])
        self.rows.append(tuple(float(each) for each in row))
        if not self._ended:
            self._build(pairs, staying, self.case.space.expand(state.best_alpha))
        return not self._ended

    @property
    def _switches(self) -> bool:
        """Whether candidates are priced whose law is not smooth."""
        return any(not law.is_smooth for group in self.case.priced_groups for law in group.laws)

    def _count_of(self, level: int) -> int | None:
        """About how many candidates of each group are priced at a level; None: all."""
        count = FIRST_PRICED * PRICED_GROWTH**level
        most = max(group.candidates.count for group in self.case.priced_groups if group.candidates is not None)
        return count if count < most else None

    def conclude(self, state: State) -> tuple[RunStatus, str]:
        """The run's status, and what is known of the candidates."""
        stalled = RunStatus.FAILED if state.status is RunStatus.FAILED else RunStatus.STALLED
        if self.last is None or not self._ended:
            return stalled, f"{state.reason}; the candidates could not be priced"
        several, objective = len(self.case.objectives) > 1, self.case.objectives[0]
        verb = "lower" if several or objective.sense == "minimize" else "raise"
        tolerance, best = self.case.optimizer.tolerance, self.last.best
        named = f"of {count_text(self.candidates)} candidates would {verb} {'U' if several else objective.name}"
        status = state.status
        if _is_one_sided(self.last):
            return stalled, (
                f"{state.reason}; whether one {named} is not known: slopes, and so prices, are others on either side "
                "of this design, as where a member only just touches"
            )
        if best <= tolerance:
            words = f"no one {named} by more than {tolerance:.3g} of it"
        else:
            words = f"one {named} by {best:.3g} of it"
            status = RunStatus.MAX_ITERATIONS if self.count >= MOST_ROUNDS else stalled
        most = f"all together by {self.last.together:.2g} at most" if self.last.together > 0.0 else "nor all together"
        return status, f"{state.reason}; {words}, {most}, to first order"

    def _entered(self, found: Prices, state: State, may_leave: bool) -> tuple[dict[str, Pairs], NDArray[np.bool_]]:
        """The candidates that enter, and which members (N,) stay."""
        case = self.case
        alpha = case.space.expand(state.best_alpha)
        staying = np.ones(case.n_design, dtype=np.bool_)
        if may_leave:
            for group in case.priced_groups:
                part = case.group_slices[group.name]
                gone = (alpha[part] <= group.lower) & (found.built[case.space.slots[part]] >= 0.0)
                gone[:1] &= not gone.all()
                staying[part] = ~gone
        return found.pairs, staying

    def _build(self, entering: dict[str, Pairs], staying: NDArray[np.bool_], alpha: Floats) -> None:
        """Make the case of the next round, and the design with which it begins; alpha (N,): of the last one."""
        slices, pairs, pieces = self.case.group_slices, {}, []
        for group in self.case.design_groups:
            part = slices[group.name]
            if group.name not in entering:
                pieces.append(alpha[part])
                continue
            stays, (new_i, new_j) = staying[part], entering[group.name]
            i = np.concatenate([group.from_index[stays], new_i])
            j = np.concatenate([group.to_index[stays], new_j])
            own = np.concatenate([alpha[part][stays], np.zeros(len(new_i))])
            order = np.lexsort((j, i))
            pairs[group.name] = (i[order], j[order])
            pieces.append(own[order])
        self.case = with_members(self.case, pairs)
        self.design = self.case.space.reduce(np.concatenate(pieces))

    def part(self) -> Datasets:
        """The datasets that a file keeps: the points of the members that are built, and the rounds."""
        if not self.case.priced_groups:
            return {}
        part = members_part(self.case)
        columns = np.array(self.rows).reshape(-1, len(COLUMNS)).T
        part |= {f"{CANDIDATES}/rounds/{name}": column for name, column in zip(COLUMNS, columns, strict=True)}
        return part | {f"{CANDIDATES}/count": np.array(self.candidates)}

    def restore(self, view: ResultView) -> None:
        """Take up the rounds of pricing that an earlier process has saved."""
        try:
            columns = [np.asarray(view.array(f"{CANDIDATES}/rounds/{name}"), dtype=np.float64) for name in COLUMNS]
            begun = view.array("iterations/round")
            self.rows = [tuple(row) for row in np.array(columns).T.tolist()][: int(begun[-1])]
            self.candidates = int(view.array(f"{CANDIDATES}/count"))
        except (ValueError, TypeError, IndexError) as error:
            raise DamagedError(f"{view.path}: damaged: the rounds of pricing are not whole ({error})") from error


def _is_one_sided(prices: Prices) -> bool:
    """Whether prices follow from slopes with which built members are far from their optimum, as on one side of a kink:
    then they do not tell what a candidate would gain."""
    return prices.residual > ONE_SIDED and prices.unsettled > ONE_SIDED
