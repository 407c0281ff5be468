"""The last stage of a run whose case has a catalogue: the sizes of the members that are kept (`size_search`)."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.design.catalogue import has_catalogue
from mdstopo.case.design.stages import stage_count
from mdstopo.case.model import Case, MemberGroup, VolumeRow
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.words import count_text
from mdstopo.optimizer.interface import run as run_optimizer
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.state import State
from mdstopo.scene.moving_volumes import moves, moving_volumes, spent
from mdstopo.session import size_search
from mdstopo.session.outcome import ChosenSizes
from mdstopo.session.size_search import Catalogued, Ints, SearchProgress, SizeSearch, Within, progress_in
from mdstopo.session.start_in_stages import STAGE, Marked, continued, has_sizes
from mdstopo.starts.single_start import make_optimizer
from mdstopo.status import RunStatus
from mdstopo.store.contents import Datasets, design_part
from mdstopo.store.result_reader import ResultView
from mdstopo.store.store_errors import DamagedError

Floats = NDArray[np.float64]

#: where a file has what is known of the choice, and what only the search reads
CATALOGUE, SEARCH = "catalogue", "catalogue/search"
#: members with less than this share of the least size above 0 are not kept
KEPT = 0.5
#: where the best choice for the members kept is worse than the continuous optimum by more than this share, so many of
#: the others are allowed sizes, too
MUCH_WORSE = 0.05
OTHERS = 12
#: ratios above it are told as two values
MANY_TIMES = 10.0
#: seconds between two lines on how far the choice is
SAID_EVERY = 10.0


class Sizes:
    """The choice of sizes of one run. outcome: what is known of it, None before it has begun."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.outcome: ChosenSizes | None = None
        #: whether there is, or was, something to choose from
        self.asked = has_catalogue(case)
        self._search: SizeSearch | None = None
        self._before: ResultView | None = None
        self._continuous = float("nan")
        #: members with a catalogue, and those whose sizes are chosen
        self._all = sum(len(group) for group in case.design_groups if group.sizes)
        self._members = 0
        #: evaluations of the first search, where there is a second one, with more members
        self._spent = 0

    def refuse(self) -> None:
        """Refuse what no sizes can be chosen for. Raises CaseError."""
        case = self.case
        varying = [case.constraints[i] for i in moving_volumes(case)]
        for group in case.design_groups:
            rows = [row for row in varying if isinstance(row, VolumeRow) and group.name in row.groups]
            if not (group.sizes and rows):
                continue
            if moves(case, group):
                why = f"the members of {group.name!r} cost a length that varies; sizes are chosen for lengths that stay"
            elif group.prices != group.sizes:
                why = f"a volume row sums {group.name!r} and lengths that vary; there prices have to be the sizes"
            else:
                continue
            place = case.marks.mistake(f"design.catalogue.{group.name}", why)
            raise CaseError([place], str(case.path or case.name))

    def restore(self, view: ResultView, state: State | None) -> None:
        """Take up what an earlier process has found; state: the best one, where there is one."""
        if f"{SEARCH}/numbers" not in view.arrays:
            return
        self._before = view
        self._spent = int(view.under(SEARCH).get("spent", 0))
        if state is None or not self.is_chosen(state):
            return
        with _whole(view):
            arrays = view.under(SEARCH)
            progress, catalogued = progress_in(arrays), self._catalogued(arrays["place"].astype(np.int64))
            self._continuous = self._sign * float(view.array(f"{CATALOGUE}/continuous"))
        self._members = self._count(catalogued.place)
        self.outcome = self._outcome(progress, catalogued)

    def is_chosen(self, state: State) -> bool:
        """Whether a state belongs to the sizes that were chosen in the end."""
        return has_sizes(self.case, state)

    def choose(
        self,
        problem: Problem,
        state: State,
        stop: Callable[[], bool],
        keep: Callable[[], None],
        notify: Callable[[str], None],
    ) -> State:
        """Choose sizes behind the continuous optimum of a state; the state with the choice, or the same where that has
        not come to its end.

        problem: that of the last stage.
        stop: asked between evaluations whether to stop.
        keep: called whenever there is something to save.
        notify: is given sentences for the user.
        """
        self._continuous = float(state.best_objective)
        x, hooks = state.best_alpha, (stop, keep, notify)
        if self._spent:  # an earlier process has come to the second search
            progress = self._searched(problem, x, self._place_before(), *hooks)
        else:
            kept = self._kept(problem, x) if self._before is None else self._place_before()
            progress = self._searched(problem, x, kept, *hooks)
            if progress.finished and len(more := self._more(problem, x, kept, progress)) > len(kept):
                fails = f"no sizes of the {self._members} kept keep the constraints"
                poor = f"the best choice for the {self._members} kept is {self._beside_continuous(progress)}"
                also = count_text(self._count(more))
                notify(f"{fails if progress.x is None else poor}: now sizes of {also} members are chosen")
                self._before, self._spent = None, progress.evaluations  # the next search is another one
                progress = self._searched(problem, x, more, *hooks, progress)
        if (not progress.finished and stop()) or progress.x is None:
            return state
        return self._end(problem, state, progress.x, progress)

    def _place_before(self) -> Ints:
        """The variables whose sizes an earlier process has searched (k,)."""
        assert self._before is not None
        with _whole(self._before):
            return self._before.under(SEARCH)["place"].astype(np.int64)

    def _searched(
        self,
        problem: Problem,
        x: Floats,
        place: Ints,
        stop: Callable[[], bool],
        keep: Callable[[], None],
        notify: Callable[[str], None],
        known: SearchProgress | None = None,
    ) -> SearchProgress:
        """Search for sizes of some members; how far it has come.

        problem: that of the last stage.
        x (n,): the continuous optimum.
        place (k,): the variables whose sizes are chosen; all others have their least size.
        stop, keep, notify: as of `choose`.
        known: what a search for fewer of them has found.
        """
        held, catalogued = self._held(problem, x, place)
        self._members = self._count(place)
        search = SizeSearch(held, catalogued, held.initial, self._solve, self.case.optimizer.tolerance)
        self._search = search
        if known is not None and known.x is not None:
            search.know(known.x, known.objective)
        if self._before is not None:
            with _whole(self._before):
                search.restore(self._before.under(SEARCH))
        of = count_text(self._all)
        notify(f"choosing sizes of {self._members} members of {of}, {count_text(catalogued.choices)} choices")
        said_at = time.monotonic()

        def save(progress: SearchProgress) -> None:
            self.outcome = self._outcome(progress, catalogued)
            keep()

        def say(progress: SearchProgress) -> None:
            nonlocal said_at
            if time.monotonic() - said_at >= SAID_EVERY:
                said_at = time.monotonic()
                objective = f"{self._sign * progress.objective:.6g}"
                best = "no choice yet" if progress.x is None else f"best choice {objective}"
                notify(f"choosing sizes: {progress.nodes:,} nodes, {progress.evaluations:,} evaluations, {best}")

        progress = search.run(stop, save, say)
        self.outcome = self._outcome(progress, catalogued)
        return progress

    def _end(self, problem: Problem, state: State, x: Floats, progress: SearchProgress) -> State:
        """The last state of a run: of the choice x (n,), behind that of the continuous optimum."""
        # its sizes have been checked at their prices, and it does not move: rows that are free of bounds hold it
        rows = problem.linear
        free = replace(
            rows, b=np.full(len(rows), np.abs(rows.A).sum() + np.abs(rows.b).sum()), equal=rows.equal & False
        )
        marked = Marked(Within(problem, [0], x, x, free), STAGE, stage_count(self.case))
        last = continued(state, make_optimizer(self.case, marked).start(x))
        space = self.case.space
        design = space.expand(x)
        last.history.constraints[-1] = rows.excess(space.reduce(at_prices(self.case, design)))
        for row in last.history.info.get("constraints", [])[-1:]:
            row[:] = excess_at_prices(self.case, design, row)
        last.evaluations += self._spent + progress.evaluations
        last.history.evaluations[-1] += self._spent + progress.evaluations
        # a choice is no optimum of numbers: no residual tells how far it is from one
        last.kkt = last.history.kkt[-1] = float("nan")
        last.status = RunStatus.CONVERGED if progress.finished else RunStatus.MAX_ITERATIONS
        last.reason = self._reason(progress)
        return last

    def conclude(self, state: State) -> tuple[RunStatus, str] | None:
        """How the run ends where no sizes have been chosen; None where they have, or were not asked for."""
        if not self.asked or self.is_chosen(state) or self.outcome is None:
            return None
        ended = self.outcome.finished or self.outcome.evaluations - self._spent >= size_search.MOST_EVALUATIONS
        if ended and not self.outcome.sizes:
            what = "keeps the constraints" if self.outcome.finished else f"was found in {self.outcome.nodes} nodes"
            if not self.outcome.members:
                what += (
                    ": no member is kept (none reaches half of its least size above 0), "
                    "and all members at their least sizes do not keep the constraints"
                )
            return RunStatus.FAILED, f"no choice of sizes {what}; the design is the continuous optimum"
        saved = (
            "the best choice so far is saved" if self.outcome.sizes else "none that keeps the constraints is known yet"
        )
        return RunStatus.INTERRUPTED, f"stopped on request while sizes were chosen; {saved}"

    def part(self) -> Datasets:
        """The datasets that a file keeps of the search, and before its end the best choice as the design."""
        if self._search is None:  # nothing was searched in this process: keep what an earlier one has found
            return {} if self._before is None else _catalogue_part(self._before)
        progress = self._search.progress
        part: Datasets = {f"{SEARCH}/{name}": array for name, array in self._search.to_arrays().items()}
        part[f"{SEARCH}/spent"] = np.array(self._spent)
        part[f"{CATALOGUE}/continuous"] = np.array(self._sign * self._continuous)
        part[f"{CATALOGUE}/bound"] = np.array(self._sign * progress.bound)
        if progress.x is not None:
            part |= design_part(self.case, self.case.space.expand(progress.x))
        return part

    @property
    def best(self) -> Floats | None:
        """The best choice so far as x (n,), None before there is one."""
        return None if self._search is None else self._search.progress.x

    # -- how

    @property
    def _sign(self) -> float:
        """-1 where the objective is to be maximised, and so U is its negative."""
        return -1.0 if self.case.objectives[0].sense == "maximize" else 1.0

    def _kept(self, problem: Problem, x: Floats) -> Ints:
        """The variables of the members that are kept, by their places in x (k,): those with half of their least size in
        the continuous optimum x (n,). Where choices are so few that each is evaluated it is all, unless none is kept
        and a sum is to be equal, which the optimum then meets far below every size."""
        groups = self._groups_at()
        least = {place: next((size for size in group.sizes if size > 0.0), math.inf) for place, group in groups.items()}
        kept = [place for place in groups if x[place] >= KEPT * least[place]]
        choices = math.prod(len(group.sizes) for group in groups.values())
        alone = set(np.flatnonzero(problem.upper > problem.lower).tolist()) <= set(groups)
        everyone = choices <= size_search.FEW_CHOICES and alone and (len(kept) > 0 or not problem.linear.equal.any())
        return np.array(sorted(groups if everyone else kept), dtype=np.int64)

    def _more(self, problem: Problem, x: Floats, kept: Ints, progress: SearchProgress) -> Ints:
        """The variables whose sizes are chosen behind a search for those of members kept, by their places in x (k,).

        All where no choice keeps the constraints. Where the best choice is much worse than the continuous optimum x
        (n,), some others: those with which the objective falls most for what their first size above the least costs,
        to first order. The same ones where nothing more is to be searched.
        """
        groups = self._groups_at()
        # where no member is kept, the continuous optimum is far below every size, and says nothing about their choice
        if not len(kept) or (progress.x is not None and self._worse(progress) <= MUCH_WORSE):
            return kept
        others = [at for at in sorted(groups) if at not in set(kept.tolist()) and len(groups[at].sizes) > 1]
        if progress.x is not None and len(others) > OTHERS:
            slope, weight = problem.evaluate(x).gradients[0], np.abs(problem.linear.A).max(axis=0, initial=0.0)

            def gain(at: int) -> float:
                sizes, prices = groups[at].sizes, groups[at].prices
                cost = weight[at] * (prices[1] - prices[0])
                return float(slope[at] * (sizes[1] - sizes[0]) / (cost if cost > 0.0 else 1.0))

            others = sorted(others, key=gain)[:OTHERS]
        return np.array(sorted([*kept.tolist(), *others]), dtype=np.int64)

    def _held(self, problem: Problem, x: Floats, place: Ints) -> tuple[Within, Catalogued]:
        """The problem from the design x (n,) on, with members at their least size and its price unless their variables
        are at `place` (k,), and those variables."""
        lower, upper, begin = problem.lower.copy(), problem.upper.copy(), x.copy()
        # rows have the sizes of members that are held: what their prices are above these is spent before
        rows, dearer = problem.linear, np.zeros(len(x))
        for at, group in self._groups_at().items():
            if at not in set(place.tolist()):
                lower[at] = upper[at] = begin[at] = group.sizes[0]
                dearer[at] = group.prices[0] - group.sizes[0]
        held = Within(problem, [0], lower, upper, replace(rows, b=rows.b - rows.A @ dearer))
        held.initial = begin
        return held, self._catalogued(place)

    def _places(self, group: MemberGroup) -> Ints:
        """Where in x the alpha of each member of a group is."""
        space = self.case.space
        # seen by expanding the places
        places = space.expand(np.arange(space.size, dtype=np.float64))[: space.n_alpha].astype(np.int64)
        return np.asarray(places[self.case.group_slices[group.name]])

    def _groups_at(self) -> dict[int, MemberGroup]:
        """Of each variable with a catalogue, by its place in x: a group that it is of."""
        return {
            place: group
            for group in self.case.design_groups
            if group.sizes
            for place in np.unique(self._places(group)).tolist()
        }

    def _count(self, place: Ints) -> int:
        """How many members have their alphas at these places in x (k,)."""
        return sum(int(np.isin(self._places(group), place).sum()) for group in self.case.design_groups if group.sizes)

    def _catalogued(self, place: Ints) -> Catalogued:
        """Variables with their sizes and prices. place (k,): in x."""
        groups = [self._groups_at()[at] for at in place.tolist()]
        return Catalogued(
            place,
            tuple(np.array(group.sizes) for group in groups),
            tuple(np.array(group.prices) for group in groups),
        )

    def _solve(self, problem: Problem, x: Floats) -> State:
        optimizer = make_optimizer(self.case, problem)
        return run_optimizer(optimizer, optimizer.start(x))

    def _outcome(self, progress: SearchProgress, catalogued: Catalogued) -> ChosenSizes:
        sign, chosen = self._sign, {}
        if progress.x is not None:
            design = self.case.space.expand(progress.x)
            for group in self.case.design_groups:
                own = design[self.case.group_slices[group.name]]
                if group.sizes:
                    chosen[group.name] = {
                        size: int(np.count_nonzero(np.abs(own - size) <= 1e-12)) for size in group.sizes
                    }
        return ChosenSizes(
            members=self._members, choices=catalogued.choices, objective=sign * progress.objective,
            continuous=sign * self._continuous, bound=sign * progress.bound, nodes=progress.nodes,
            evaluations=self._spent + progress.evaluations, exhaustive=progress.exhaustive,
            exchanged=progress.exchanged, finished=progress.finished, sizes=chosen,
        )  # fmt: skip

    def _worse(self, progress: SearchProgress) -> float:
        """By what share of it the best choice is worse than the continuous optimum."""
        return (progress.objective - self._continuous) / (abs(self._continuous) or 1.0)

    def _beside_continuous(self, progress: SearchProgress) -> str:
        """How much worse, or better, the best choice is than the continuous optimum, in words."""
        worse = self._worse(progress)
        if worse > MANY_TIMES:  # a share of next to nothing says nothing
            value, before = self._sign * progress.objective, self._sign * self._continuous
            return f"{value:.6g}, where the continuous optimum has {before:.6g}"
        return f"{abs(worse):.3%} {'better' if worse < 0.0 else 'worse'} than the continuous optimum"

    def _reason(self, progress: SearchProgress) -> str:
        left = self._all - self._members
        if progress.exhaustive:
            how = "the best of all choices for the members kept" if left else "the best of all choices"
        elif progress.finished:
            how = f"no one of {progress.nodes} nodes has a better relaxation"
        else:
            how = f"the best of {progress.nodes} nodes, after which the search ends"
        were = "other member was left at its" if left == 1 else "other members were left at their"
        apart = f"; the {left} {were} least size, of which no choice was tried" if left else ""
        return (
            f"sizes of {self._members} members chosen: {how}, {self._spent + progress.evaluations} evaluations; "
            f"{self._beside_continuous(progress)}{apart if self._worse(progress) > MUCH_WORSE else ''}"
        )


@contextmanager
def _whole(view: ResultView) -> Iterator[None]:
    """What is missing in a file, or of another kind, is damage of the file."""
    try:
        yield
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise DamagedError(f"{view.path}: damaged: the search for sizes is not whole ({error})") from error


def _catalogue_part(view: ResultView) -> Datasets:
    """The datasets that a file has of a choice of sizes."""
    return {f"{CATALOGUE}/{name}": array for name, array in view.under(CATALOGUE).items()}


def at_prices(case: Case, design: Floats) -> Floats:
    """A design (N + P,) of chosen sizes with their prices in the place of alpha: what volume rows sum up."""
    paid = design.copy()
    for group in case.design_groups:
        own = design[case.group_slices[group.name]]
        for size, price in zip(group.sizes, group.prices, strict=True):
            paid[case.group_slices[group.name]][own == size] = price
    return paid


def excess_at_prices(case: Case, design: Floats, excess: Floats) -> Floats:
    """h - h0 (n_con,) of all constraints with volume rows at the prices of chosen sizes; excess: at the sizes."""
    paid = at_prices(case, design)
    return np.array(
        [
            spent(case, row, paid) - row.bound if isinstance(row, VolumeRow) else value
            for row, value in zip(case.constraints, excess.tolist(), strict=True)
        ]
    )
