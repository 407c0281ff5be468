"""Several starts in quotas: all go a little way, those that come to what another comes to are dropped, the best go on.
The first one, from the stated design, goes on behind all others where it was dropped: several starts end no higher than
one, unless it came to the same as another one.

Those that begin at the best design do so one after the other, each at the best that the ones before have found. They
are left out where the other starts have come to the same few optima so often that hardly any are unfound (`all_found`).

Which starts go on depends on the states alone, and is written into them (`State.dropped`, `State.twin`): a resumed run,
and one on any number of processes, decides alike. One that is resumed with another number of starts decides anew
(`carried_over`).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.design.stages import stage_count
from mdstopo.case.model import Case
from mdstopo.optimizer.start_families import Family, begins_at_best, best_run, family_of, rank
from mdstopo.optimizer.state import State
from mdstopo.starts.single_start import StartTask
from mdstopo.status import RunStatus

#: iterations after which a start that is far behind is dropped, for the first and for the last time; and by how much it
#: is then: the share of the best U, or of the bound of a limit, by which it is worse
TRIAL, SECOND_TRIAL, LAGGING = 3, 5, 1.0 / 3.0
#: iterations after which those are dropped that come to the same as another one
LOOKS, LATER_LOOKS = (SECOND_TRIAL, 6, 7, 8, 9, 10, 12, 14, 16, 18), tuple(range(22, 40, 2))
#: iterations after which it is decided who goes on; the share of the starts that do
QUOTAS, SHARE_GOING_ON = (20, 40), 1.0 / 3.0
#: a start that has fallen by this share of U within so many iterations goes on, too
FALLING, LATELY = 0.1, 5
#: a start whose U is higher than the best by more than this share of the best does not go on
FAR_BEHIND = 1.0
#: two designs are one optimum where U differs by less than this, relative, and alpha by less than that on average
SAME_VALUE, SAME_DESIGN = 1e-3, 2e-2
#: two starts come to one optimum where so are the designs that they go to next, and the values foreseen there differ by
#: less than this, relative
SAME_FORESEEN = 1e-2

#: how many more optima than were found are to be expected at most where no further start is worth its evaluations
UNFOUND = 0.5

Floats = NDArray[np.float64]
States = list[State | None]


def rounds(case: Case, states: States, keep: Callable[[int, State], None]) -> Iterator[list[StartTask]]:
    """What every start does next, round by round; `states` are to be up to date when the next round is taken."""
    count = len(states)
    families = [family_of(index, count, case.n_design > 0) for index in range(count)]
    if count == 1 or stage_count(case) > 1:
        yield [StartTask(index, families[index]) for index in range(count)]
        return
    tolerance = case.optimizer.tolerance
    late = [index for index in range(count) if begins_at_best(families[index])]
    early = [index for index in range(count) if index not in late]
    going = _Going(families, tolerance, states, keep)
    yield [StartTask(index, families[index], TRIAL) for index in early]
    yield from going.on(early, (), (TRIAL, *LOOKS), QUOTAS[0])
    decided = any(state is not None and _is_taken_up(state) for state in states)
    begun = any(states[index] is not None for index in late)
    further = begun or not (decided or all_found([states[index] for index in early]))
    for place, index in enumerate(late if further else ()):
        # of those before alone: a resumed run may have begun later ones, and must begin the rest as it would have
        before = [*early, *late[:place]]
        best = states[before[best_run([states[each] for each in before], tolerance)]]
        yield [StartTask(index, families[index], 0, None if best is None else best.best_alpha)]
        yield from going.on([index], before, (*range(TRIAL + 1), *LOOKS), QUOTAS[0])
    for quota, looks, following in zip(QUOTAS, (LATER_LOOKS, ()), (*QUOTAS[1:], None), strict=True):
        drop(tolerance, states, quota, keep)
        yield from going.on(range(count), (), (quota, *looks), following)
    first = states[0]
    if first is not None and first.dropped and first.twin < 0:
        states[0] = first = replace(_taken_up(first), twin=0)
        keep(0, first)
    if first is not None and _is_taken_up(first):
        yield [StartTask(0, families[0])]


def all_found(states: Sequence[State | None]) -> bool:
    """Whether the optima to which independent starts have come are likely to be all that there are.

    By the estimate of C. G. E. Boender and A. H. G. Rinnooy Kan (Bayesian stopping rules for multistart global
    optimization methods, Mathematical Programming 37, 1987): where n starts have come to w optima, w (n - 1) /
    (n - w - 2) are to be expected in all. Starts of which nobody knows where they would have come to are not counted.
    """
    starts, found = came_to(states)
    return expected_optima(starts, found) <= found + UNFOUND


def came_to(states: Sequence[State | None]) -> tuple[int, int]:
    """How many starts are known to lead to an optimum, and to how many distinct ones.

    A start counts that had not been dropped before the first quota, and so does one that was dropped because it came to
    the same as a start that counts. So the numbers are the same at any later time.
    """

    def is_known(index: int) -> bool:
        state = states[index]
        if state is None:
            return False
        return _was_there(state) or (state.twin >= 0 and is_known(state.twin))

    found = sum(state is not None and _was_there(state) for state in states)
    return sum(is_known(index) for index in range(len(states))), found


def _was_there(state: State) -> bool:
    """Whether a start had not been dropped before the first quota."""
    return not state.dropped or state.iteration >= QUOTAS[0]


def expected_optima(starts: int, found: int) -> float:
    """How many optima there are in all, as an expectation, where so many starts have come to so many."""
    return found * (starts - 1) / (starts - found - 2) if starts > found + 2 else math.inf


@dataclass(frozen=True, slots=True)
class _Going:
    """How starts go on together. families, states: of all starts; tolerance: of violations; keep: gets what changes."""

    families: Sequence[Family]
    tolerance: float
    states: States
    keep: Callable[[int, State], None]

    def on(
        self, asked: Sequence[int], others: Sequence[int], looks: Sequence[int], last: int | None
    ) -> Iterator[list[StartTask]]:
        """The rounds of the starts `asked` from iteration to iteration, those left out that come to the same as a
        better one of them or as one of `others`. looks: iterations after which it is seen; last: where they pause."""
        for look, following in zip(looks, (*looks[1:], last), strict=True):
            going = [state for index in asked if (state := self.states[index]) is not None and _goes_on(state)]
            # where one has gone on from here it is decided already: a resumed run does not decide by what that found
            if not any(state.iteration > look for state in going):
                if look in (TRIAL, SECOND_TRIAL):
                    # a softened start begins at the optimum of another problem, and is slow to leave it
                    some = [index for index in asked if self.families[index] is not Family.SOFTENED]
                    drop_lagging(some, [*others, *asked], self.tolerance, self.states, self.keep)
                drop_twins(asked, others, self.tolerance, self.states, self.keep)
            yield [StartTask(index, self.families[index], following) for index in asked if _goes_on(self.states[index])]


def drop_lagging(
    asked: Sequence[int], others: Sequence[int], tolerance: float, states: States, keep: Callable[[int, State], None]
) -> None:
    """Mark those of the starts `asked` that are far behind the best of `others`. tolerance: of violations."""
    best = states[others[best_run([states[each] for each in others], tolerance)]]
    for index in asked:
        state = states[index]
        if (
            state is not None
            and state.running
            and _goes_on(state)
            and best is not None
            and lags(state, best, tolerance)
        ):
            states[index] = marked = _dropped(state, "other starts were far better")
            keep(index, marked)


def drop_twins(
    asked: Sequence[int],
    others: Sequence[int],
    tolerance: float,
    states: States,
    keep: Callable[[int, State], None],
) -> None:
    """Mark those that come to the same as another start.

    asked: the starts that may be dropped, where a better one of them comes to the same.
    others: further ones, which stay.
    tolerance: of violations.
    states: of all starts.
    keep: is given what changes.
    """
    going = [(index, state) for index in asked if (state := states[index]) is not None and _goes_on(state)]
    kept = [(index, state) for index in others if (state := states[index]) is not None and _goes_on(state)]
    for index, state in sorted(going, key=lambda each: (*rank(each[1], tolerance), each[0])):
        twin = twin_of(state, kept)
        if twin < 0 or not state.running:
            kept.append((index, state))
        else:
            states[index] = marked = _dropped(state, HAS_TWIN, twin)
            keep(index, marked)


def twin_of(state: State, others: Sequence[tuple[int, State]]) -> int:
    """The first of the others, with their numbers, that comes to the same as a start; -1 where none does."""
    return next((index for index, other in others if same(state, other) or foresees_same(state, other)), -1)


def lags(state: State, best: State, tolerance: float) -> bool:
    """Whether a start is far behind the best and its U does not fall fast enough to change that."""
    if state.best_violation > tolerance:
        left = best.best_plain if best.best_violation > tolerance else 0.0
        return state.best_plain > left + LAGGING
    worse = state.best_objective - best.best_objective > LAGGING * abs(best.best_objective)
    return worse and not falls(state, 1)


#: why a start is dropped that has a twin
HAS_TWIN = "another start came to the same"


def _dropped(state: State, why: str, twin: int = -1) -> State:
    reason = f"dropped after {state.iteration} iterations: {why}"
    return replace(state, dropped=True, twin=twin, status=RunStatus.MAX_ITERATIONS, reason=reason)


def _goes_on(state: State | None) -> bool:
    return state is not None and not state.dropped and not _is_taken_up(state)


def _is_taken_up(state: State) -> bool:
    """Whether a start was dropped and now goes on behind all others. It is marked by a twin, itself, though it is not
    dropped."""
    return not state.dropped and state.twin >= 0


def drop(tolerance: float, states: States, quota: int, keep: Callable[[int, State], None]) -> None:
    """Mark the starts that do not go on after so many iterations. tolerance: of violations.

    The best third of the distinct ones goes on, and those that are still falling fast. Where one has gone on from here
    it is decided already: a resumed run must not decide again by what that one has found since.
    """
    begun = [(index, state) for index, state in enumerate(states) if state is not None and _goes_on(state)]
    if any(state.iteration > quota for _, state in begun):
        return
    order = sorted(begun, key=lambda each: (*rank(each[1], tolerance), each[0]))
    most = max(1, math.ceil(SHARE_GOING_ON * len(states)))
    kept: list[tuple[int, State]] = []
    for index, state in order:
        twin = twin_of(state, kept)
        good = not kept or (near(state, kept[0][1], tolerance) and (len(kept) < most or falls(state)))
        if twin < 0 and good:
            kept.append((index, state))
        elif state.running:
            states[index] = marked = _dropped(state, HAS_TWIN if twin >= 0 else "other starts were better", twin)
            keep(index, marked)


def carried_over(case: Case, states: States, before: int) -> States:
    """What a run of as many starts as there are `states` takes over from one of `before` starts.

    The end is to be that of a run that had so many starts from the beginning. So a start is taken over where that run
    would have it in the same state: it began alike, and nobody has decided about it as yet. One that has gone beyond
    the trial begins again, as it may be dropped there now; what it was there is no longer known.
    """
    if before == len(states):
        return states
    in_quotas = len(states) > 1 and stage_count(case) == 1
    found: States = [None] * len(states)
    for index, state in enumerate(states[:before]):
        alike = len({family_of(index, starts, case.n_design > 0) for starts in (before, len(states))}) == 1
        if state is not None and alike and not (in_quotas and state.iteration > TRIAL):
            found[index] = _taken_up(state) if state.dropped or _is_taken_up(state) else state
    return found


def _taken_up(state: State) -> State:
    """A start that was dropped, as it was before."""
    return replace(state, dropped=False, twin=-1, status=RunStatus.RUNNING, reason="")


def near(state: State, best: State, tolerance: float) -> bool:
    """Whether a start may still become the best: it does not keep all limits yet, or its U is not far above."""
    if best.best_violation > tolerance or state.best_violation > tolerance:
        return True
    return state.best_objective - best.best_objective <= FAR_BEHIND * abs(best.best_objective)


def falls(state: State, lately: int = LATELY) -> bool:
    """Whether U has been falling fast within so many iterations."""
    objective = np.array(state.history.objective)
    if not state.running or len(objective) <= lately:
        return False
    before, now = np.nanmin(objective[:-lately]), np.nanmin(objective)
    return bool(before - now >= FALLING * abs(before))


def same(one: State, other: State) -> bool:
    """Whether two starts have come to the same optimum."""
    if not abs(one.best_objective - other.best_objective) <= SAME_VALUE * abs(other.best_objective):
        return False
    return float(np.abs(one.best_alpha - other.best_alpha).mean()) <= SAME_DESIGN


def foresees_same(one: State, other: State) -> bool:
    """Whether two starts are about to come to one optimum: so are the designs that they go to next, by their models."""
    ahead, there = _ahead(one), _ahead(other)
    if not abs(ahead[0] - there[0]) <= SAME_FORESEEN * abs(there[0]):
        return False
    return float(np.abs(ahead[1] - there[1]).mean()) <= SAME_DESIGN


def _ahead(state: State) -> tuple[float, Floats]:
    """The value and the design that a start comes to with its next step; NaN where it looks for a design that keeps the
    limits."""
    if not state.running:
        return state.best_objective, state.best_alpha
    return state.foreseen(), state.trial


@dataclass(frozen=True, slots=True)
class Found:
    """One distinct optimum: U, its violation, by which starts, their evaluations all told, and how the best of them
    ended, at which KKT residual."""

    objective: float
    violation: float
    starts: tuple[int, ...]
    evaluations: int
    status: RunStatus
    kkt: float


def distinct(states: Sequence[State | None], tolerance: float) -> list[Found]:
    """The distinct optima that the starts have come to, best first, without the starts that were left behind."""
    begun = [(index, state) for index, state in enumerate(states) if state is not None and not state.dropped]
    groups: list[list[int]] = []
    known = dict(begun)
    for index, state in sorted(begun, key=lambda each: (*rank(each[1], tolerance), each[0])):
        for group in groups:
            if same(state, known[group[0]]):
                group.append(index)
                break
        else:
            groups.append([index])
    left = set(left_behind(states))
    for index, other in enumerate(states):
        if other is not None and other.dropped and index not in left:
            _group_of(_last_twin(states, index), groups).append(index)
    return [_found(states, group) for group in groups]


def left_behind(states: Sequence[State | None]) -> list[int]:
    """The starts that were dropped because others were better, and those that came to the same as one of them."""
    found = []
    for index, state in enumerate(states):
        last = None if state is None or not state.dropped else states[_last_twin(states, index)]
        if last is not None and last.dropped:
            found.append(index)
    return found


def _last_twin(states: Sequence[State | None], index: int) -> int:
    """The start at the end of a chain of starts that were each dropped for the next one."""
    for _ in states:
        state = states[index]
        if state is None or not state.dropped or state.twin < 0:
            break
        index = state.twin
    return index


def _group_of(index: int, groups: Sequence[list[int]]) -> list[int]:
    return next(group for group in groups if index in group)


def _found(states: Sequence[State | None], group: Sequence[int]) -> Found:
    """What a group of starts, the best of them first, has come to."""
    own = [state for index in group if (state := states[index]) is not None]
    best = own[0]
    evaluations = sum(state.evaluations for state in own)
    return Found(
        objective=best.best_objective,
        violation=best.best_plain,
        starts=tuple(sorted(group)),
        evaluations=evaluations,
        status=best.status,
        kkt=best.kkt,
    )
