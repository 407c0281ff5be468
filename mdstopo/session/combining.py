"""How a run makes one U of several objectives: utopia and maxima first, by optimising each alone (Eq. 24)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.design_problem import sign_of
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.plan.front_plan import NoEndError, Planner, Request, Starts
from mdstopo.plan.priced_designs import packed
from mdstopo.plan.solve_task import Found, Result, Task, front_key, solve
from mdstopo.plan.stored_tasks import begun_part, tasks_part
from mdstopo.settings.scalarisations import SCALARISATIONS, SUM
from mdstopo.starts.callbacks import ignore
from mdstopo.starts.evaluator_interface import Engine
from mdstopo.store.contents import Datasets
from mdstopo.workers.worker_pool import StoppedError

Floats = NDArray[np.float64]


class NoUtopiaError(Exception):
    """An objective alone cannot be optimised, so that several cannot be combined."""

    exit_status = 1


class Combining:
    """The optima of the objectives alone, each found once and kept, and the U that follows from them."""

    def __init__(self, case: Case) -> None:
        self.case = case
        #: finished solves by key
        self.solved: dict[str, Found] = {}
        #: the optimisers' states of solves that were left in the middle, by key
        self.begun: dict[str, State] = {}
        self.used: set[str] = set()
        #: those of an earlier process whose iterates go on: they stay, whatever options have changed
        self.fixed: tuple[Floats, Floats] | None = None
        self.utopia: Floats | None = None
        self.maxima: Floats | None = None

    @property
    def evaluations(self) -> int:
        """How many designs were evaluated for the combination."""
        return sum(self.solved[key].evaluations for key in self.used)

    def scalarisation(
        self,
        engine: Engine,
        first: Floats,
        keep: Callable[[], None],
        stop: Callable[[], bool],
        notify: Callable[[str], None] = ignore,
    ) -> Scalarisation | None:
        """U of the case; None for one objective.

        first (N,): the design that the individual optima begin with. keep is called after each of them, and notify is
        given a sentence on it. Raises StoppedError where `stop` says so, and NoUtopiaError where an objective alone
        cannot be optimised.
        """
        case, combine = self.case, self.case.combine
        if combine is None or len(case.objectives) < 2:
            return None
        weights = np.array([combine.weights[objective.name] for objective in case.objectives])
        if np.count_nonzero(weights) == 1:
            return Scalarisation(SUM, weights)  # Eq. 24 would change nothing but its unit
        if not (combine.normalize and SCALARISATIONS[combine.method].scaled):
            return Scalarisation(combine.method, weights, exponent=combine.exponent)
        signs = np.array([sign_of(objective) for objective in case.objectives])
        if self.fixed is not None:
            self.utopia, self.maxima = self.fixed
            self.used = set(self.solved)
            return Scalarisation(combine.method, weights, signs * self.utopia, signs * self.maxima, combine.exponent)
        active = tuple(np.flatnonzero(weights > 0.0).tolist())
        request = Request(
            np.zeros((0, len(weights))), combine.method, combine.exponent, True, signs,
            Starts(packed(case, first) if case.priced_groups else first), case.optimizer.max_iterations, active,
        )  # fmt: skip
        planner = Planner(request)
        rounds = planner.ends_alone()
        key_of_case = front_key(case)
        try:
            tasks = next(rounds)
            while True:
                found: list[Result] = []
                for task in tasks:
                    key = task.key(key_of_case)
                    if key not in self.solved:
                        if stop():
                            raise StoppedError
                        self.solved[key] = self._solved(engine, task, key, keep, stop)
                        self.used.add(key)  # before anything is saved, which leaves out what is not used
                        notify(_sentence(case, task, self.solved[key]))
                        keep()
                    self.used.add(key)
                    found.append(self.solved[key])
                tasks = rounds.send(found)
        except StopIteration:
            pass
        except NoEndError as error:
            name = case.objectives[error.place].name
            raise NoUtopiaError(f"objective {name} alone cannot be optimised: {error}") from error
        self.begun.clear()
        self.utopia, self.maxima = signs * planner.lowest, signs * planner.highest
        return Scalarisation(combine.method, weights, planner.lowest, planner.highest, combine.exponent)

    def _solved(
        self, engine: Engine, task: Task, key: str, keep: Callable[[], None], stop: Callable[[], bool]
    ) -> Found:
        """What a solve finds, from where an earlier process left it; `keep` is called after each iteration."""

        def hold(state: State) -> None:
            self.begun[key] = state
            keep()

        found = solve(engine, self.case, replace(task, begun=self.begun.get(key)), key, stop, hold)
        assert isinstance(found, Found)  # no part of a task was asked for
        self.begun.pop(key, None)
        return found

    def part(self, visited: Floats) -> Datasets:
        """The datasets that the result file has of it. visited (K, m): raw values so far, in case utopia is better than
        was known."""
        kept = [found for key, found in self.solved.items() if key in self.used] or list(self.solved.values())
        part: Datasets = tasks_part(kept, self.case, "combine/tasks") if kept else {}
        part |= begun_part(self.begun, "combine/tasks")
        if self.utopia is not None and self.maxima is not None:
            signs = np.array([sign_of(objective) for objective in self.case.objectives])
            found = np.concatenate([visited * signs, (self.utopia * signs)[None]])
            # of objectives of weight 0 nothing is known, nor needed
            part |= {
                "combine/utopia": self.utopia,
                "combine/maxima": self.maxima,
                "combine/best_found": signs * np.nanmin(found, axis=0),
            }
        return part


def _sentence(case: Case, task: Task, found: Found) -> str:
    """How the optimisation of one objective alone ended."""
    place = -1 - task.point
    name, ended = case.objectives[place].name, str(found.status).replace("_", " ")
    return f"{name} alone: {found.objectives[place]:.6g} after {found.evaluations} evaluations, {ended}"
