"""Several starts in quotas: all go a little way, those that find what another found are dropped, the best go on.

Those that begin at the best design do so one after the other: the next one at what the last one has made better.

Which go on depends on the states alone, and is written into them (`State.dropped`): a resumed run, and one on any
number of processes, decides alike. One that is resumed with another number of starts decides anew (`carried_over`).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.stages import stage_count
from mdstopo.optimizer.start_families import Family, begins_at_best, best_run, family_of, rank
from mdstopo.optimizer.state import State
from mdstopo.starts.single_start import StartTask
from mdstopo.status import RunStatus

#: iterations after which a start that is far behind is dropped; and by how much it is then: the share of the best U, or
#: of the bound of a limit, by which it is worse
TRIAL, LAGGING = 5, 1.0 / 3.0
#: iterations after which it is decided who goes on; the share of the starts that do
QUOTAS, SHARE = (20, 40), 1.0 / 3.0
#: a start that has fallen by this share of U within so many iterations goes on, too
FALLING, LATELY = 0.1, 5
#: a start whose U is higher than the best by more than this share of it does not
BEHIND = 1.0
#: two designs are one optimum where U differs by less than this, relative, and alpha by less than that on average
SAME_VALUE, SAME_DESIGN = 1e-3, 2e-2

States = list[State | None]


def rounds(case: Case, states: States, keep: Callable[[int, State], None]) -> Iterator[list[StartTask]]:
    """What every start does next, round by round; `states` are to be up to date when the next round is asked for."""
    count = len(states)
    families = [family_of(index, count) for index in range(count)]
    if count == 1 or stage_count(case) > 1:
        yield [StartTask(index, families[index]) for index in range(count)]
        return
    tolerance = case.optimizer.tolerance
    late = [index for index in range(count) if begins_at_best(families[index])]
    early = [index for index in range(count) if index not in late]
    yield [StartTask(index, families[index], TRIAL) for index in early]
    if not any(_has_gone_on(states[index]) for index in early):
        # a softened start begins at the optimum of another problem, and is slow to leave it
        drop_lagging([i for i in early if families[i] is not Family.SOFTENED], early, tolerance, states, keep)
    yield [StartTask(index, families[index], QUOTAS[0]) for index in early if _goes_on(states[index])]
    for place, index in enumerate(late):
        # of those before alone: a resumed run may have begun later ones, and must begin the rest as it would have
        before = [*early, *late[:place]]
        best = states[before[best_run([states[each] for each in before], tolerance)]]
        yield [StartTask(index, families[index], TRIAL, None if best is None else best.best_alpha)]
        if not _has_gone_on(states[index]):
            drop_lagging([index], [*before, index], tolerance, states, keep)
        yield [StartTask(each, families[each], QUOTAS[0]) for each in (index,) if _goes_on(states[each])]
    for quota, following in zip(QUOTAS, (*QUOTAS[1:], None), strict=True):
        drop(tolerance, states, quota, keep)
        going = [i for i, state in enumerate(states) if _goes_on(state)]
        yield [StartTask(i, families[i], following) for i in going]


def drop_lagging(
    asked: Sequence[int], others: Sequence[int], tolerance: float, states: States, keep: Callable[[int, State], None]
) -> None:
    """Mark those of the starts `asked` that are far behind the best of `others`. tolerance: of violations."""
    best = states[others[best_run([states[each] for each in others], tolerance)]]
    for index in asked:
        state = states[index]
        if state is not None and state.running and best is not None and lags(state, best, tolerance):
            states[index] = marked = _dropped(state, "other starts were far better")
            keep(index, marked)


def lags(state: State, best: State, tolerance: float) -> bool:
    """Whether a start is far behind the best, and nothing says that it will not be: U does not fall fast."""
    if state.best_violation > tolerance:
        left = best.best_plain if best.best_violation > tolerance else 0.0
        return state.best_plain > left + LAGGING
    worse = state.best_objective - best.best_objective > LAGGING * abs(best.best_objective)
    return worse and not falls(state, 1)


def _dropped(state: State, why: str) -> State:
    reason = f"dropped after {state.iteration} iterations: {why}"
    return replace(state, dropped=True, status=RunStatus.MAX_ITERATIONS, reason=reason)


def _goes_on(state: State | None) -> bool:
    return state is not None and not state.dropped


def _has_gone_on(state: State | None) -> bool:
    """Whether a start has been let go on beyond the trial."""
    return state is not None and state.iteration > TRIAL


def drop(tolerance: float, states: States, quota: int, keep: Callable[[int, State], None]) -> None:
    """Mark the starts that do not go on after so many iterations. tolerance: of violations.

    The best third of the distinct ones goes on, and those that are still falling fast. Where one has gone on from here
    it is decided already: a resumed run must not decide again by what that one has found since.
    """
    begun = [(index, state) for index, state in enumerate(states) if state is not None and not state.dropped]
    if any(state.iteration > quota for _, state in begun):
        return
    order = sorted(begun, key=lambda each: (*rank(each[1], tolerance), each[0]))
    most = max(1, math.ceil(SHARE * len(states)))
    kept: list[State] = []
    for index, state in order:
        twin = any(same(state, other) for other in kept)
        if not twin and (not kept or (near(state, kept[0], tolerance) and (len(kept) < most or falls(state)))):
            kept.append(state)
        elif state.running:
            why = "another start came to the same" if twin else "other starts were better"
            states[index] = marked = _dropped(state, why)
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
        alike = family_of(index, before) is family_of(index, len(states))
        if state is None or not alike or (in_quotas and state.iteration > TRIAL):
            continue
        found[index] = replace(state, dropped=False, status=RunStatus.RUNNING, reason="") if state.dropped else state
    return found


def near(state: State, best: State, tolerance: float) -> bool:
    """Whether a start may still come to be the best: it violates limits, as yet, or its U is not far above."""
    if best.best_violation > tolerance or state.best_violation > tolerance:
        return True
    return state.best_objective - best.best_objective <= BEHIND * abs(best.best_objective)


def falls(state: State, lately: int = LATELY) -> bool:
    """Whether U has been falling fast within so many iterations."""
    objective = np.array(state.history.objective)
    if not state.running or len(objective) <= lately:
        return False
    before, now = np.nanmin(objective[:-lately]), np.nanmin(objective)
    return bool(before - now >= FALLING * abs(before))


def same(one: State, other: State) -> bool:
    """Whether two starts have come to one optimum."""
    if not abs(one.best_objective - other.best_objective) <= SAME_VALUE * abs(other.best_objective):
        return False
    return float(np.abs(one.best_alpha - other.best_alpha).mean()) <= SAME_DESIGN


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
    """The distinct optima that the starts have come to, best first."""
    begun = [(index, state) for index, state in enumerate(states) if state is not None]
    order = sorted(begun, key=lambda each: (*rank(each[1], tolerance), each[0]))
    groups: list[list[tuple[int, State]]] = []
    for item in order:
        for group in groups:
            if same(item[1], group[0][1]):
                group.append(item)
                break
        else:
            groups.append([item])
    return [
        Found(
            group[0][1].best_objective,
            group[0][1].best_plain,
            tuple(index for index, _ in group),
            sum(state.evaluations for _, state in group),
            group[0][1].status,
            group[0][1].kkt,
        )
        for group in groups
    ]
