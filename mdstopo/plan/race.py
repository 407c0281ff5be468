"""Several starts of the solves of a front: families of `optimizer.start_families`, in the quotas of `starts.quotas`.

The starts of one solve compete with each other; those of many solves go side by side. Like all of the plan, who goes on
depends on results alone: the optimisers' states at the quotas. They are kept in the file while tasks are in the making,
with what was decided about them, so a front that was stopped goes on with the same ones.
"""

import hashlib
from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np

from mdstopo.optimizer.state import State
from mdstopo.plan.solve_task import Found, Result, Task
from mdstopo.starts.callbacks import ignore_state
from mdstopo.starts.quotas import QUOTAS, drop

Solved = list[tuple[Task, Found]]


def in_contest(tasks: Sequence[Task]) -> list[Task]:
    """The starts of one solve as tasks, of which the worse are dropped on the way."""
    if len(tasks) < 2:
        return list(tasks)
    digest = hashlib.blake2b(digest_size=16)
    for task in tasks:
        digest.update(np.ascontiguousarray(task.start).tobytes() + bytes([task.softened]))
    return [replace(task, contest=digest.hexdigest()) for task in tasks]


def race(
    alone: Sequence[Task], contests: Sequence[Sequence[Task]], tolerance: float
) -> Generator[list[Task], list[Result], Solved]:
    """Solve tasks that stand alone, and those that compete (`in_contest`) in quotas. Yields tasks, and is sent their
    results.

    A result is a state where the task has a quota, or what was found where an earlier process has ended it.
    """
    alone = [*alone, *(task for contest in contests if len(contest) == 1 for task in contest)]
    runners = {(c, i): task for c, tasks in enumerate(contests) if len(tasks) > 1 for i, task in enumerate(tasks)}
    states: dict[int, list[State | None]] = {c: [None] * len(contests[c]) for c, _ in runners}
    ended: dict[tuple[int, int], Found] = {}
    solved: Solved = []
    waiting = list(alone)
    for quota in QUOTAS if runners else ():
        going = [place for place in runners if place not in ended]
        results = yield [
            *waiting, *(replace(runners[c, i], quota=quota, begun=states[c][i]) for c, i in going)
        ]  # fmt: skip
        solved += _pairs(waiting, results)
        for (c, i), result in zip(going, results[len(waiting) :], strict=True):
            if isinstance(result, Found):
                ended[c, i], states[c][i] = result, None
            else:
                states[c][i] = result
        waiting = []
        for c, own in states.items():
            # nobody ends before it is decided who goes on, except by a failure: an earlier process has decided
            if not any(ended[place].evaluations for place in ended if place[0] == c):
                drop(tolerance, own, quota, ignore_state)
    going = [place for place in runners if place not in ended]
    last = [*waiting, *(replace(runners[c, i], begun=states[c][i]) for c, i in going)]
    results = (yield last) if last else []
    solved += _pairs(waiting, results)
    for place, result in zip(going, results[len(waiting) :], strict=True):
        assert isinstance(result, Found)
        ended[place] = result
    return solved + [(runners[place], ended[place]) for place in runners]


def _pairs(tasks: Sequence[Task], results: Sequence[Result]) -> Solved:
    """Each task with its result, which is the task's end; results behind those of the tasks are left out."""
    pairs: Solved = []
    for task, result in zip(tasks, results, strict=False):
        assert isinstance(result, Found)
        pairs.append((task, result))
    return pairs
