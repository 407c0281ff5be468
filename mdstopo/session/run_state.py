"""What a run has reached: what its file keeps, and a later process takes up."""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.design.stages import stage_count
from mdstopo.case.model import Case
from mdstopo.optimizer.state import State
from mdstopo.plan.pricing_rounds import Rounds
from mdstopo.plan.stored_tasks import read_begun, read_tasks
from mdstopo.session.combining import Combining
from mdstopo.session.saved_states import best_of, restore, run_part
from mdstopo.session.sizes import Sizes
from mdstopo.session.start_in_stages import is_done, stage_of
from mdstopo.starts.callbacks import Notify
from mdstopo.starts.quotas import carried_over
from mdstopo.starts.single_start import StartTask
from mdstopo.status import RunStatus
from mdstopo.store.contents import Datasets, case_part
from mdstopo.store.result_reader import ResultView
from mdstopo.store.same_case import describe
from mdstopo.store.store_errors import DifferentCaseError
from mdstopo.store.stored_case import built_case

Floats = NDArray[np.float64]


class RunState:
    """How far a run has come. At first no start has a state.

    case: the design problem, of priced groups with the members that are built. stated: the same as it was read.
    initial (N + P,): the design to begin with in place of the case's; None takes that. states: the optimiser's, by
    start. has_ended: whether every start has gone its way, or is not needed. combining: the optima of several
    objectives alone. rounds: those in which candidates are priced. sizes: the choice of sizes from a catalogue.
    """

    def __init__(self, case: Case, initial: Floats | None) -> None:
        self.case = self.stated = case
        self.initial = initial
        self.states: list[State | None] = [None] * case.optimizer.starts
        self.has_ended = False
        self.combining = Combining(case)
        self.rounds = Rounds(case)
        self.sizes = Sizes(case)

    @property
    def best(self) -> int | None:
        """Which start's result is that of the run; None where none has begun."""
        return best_of(self.case, self.states)

    @property
    def best_state(self) -> State | None:
        """The state of that start."""
        return None if self.best is None else self.states[self.best]

    def restore(self, view: ResultView, notify: Notify) -> None:
        """Take up what an earlier process has saved. Raises DifferentCaseError where it began with another design,
        DamagedError where what it saved is not whole."""
        if self.case.priced_groups and "iterations/round" in view.arrays:
            self.case = self.rounds.case = built_case(view, self.case)
            self.rounds.restore(view)
        if len(self.case.objectives) > 1:
            self.combining.solved = read_tasks(view, "combine/tasks")
            self.combining.begun = read_begun(view, "combine/tasks")
        self._restore_initial(view)
        starts, earlier = self.case.optimizer.starts, int(view.settings.get("starts", 1))
        known = restore(view, starts)
        self.states = known[:1] if self.rounds.count else carried_over(self.case, known, earlier)
        self.sizes.restore(view, self.best_state)
        again = [str(k + 1) for k, each in enumerate(self.states) if known[k] is not None and each is None]
        if again:
            notify(
                f"{view.path} had {earlier} as the number of starts: with {starts} it is decided anew who goes on, "
                f"from the beginning for {', '.join(again)}"
            )
        if any(state is not None for state in self.states) and "combine/utopia" in view.arrays:
            utopia, maxima = (
                np.asarray(view.array(f"combine/{name}"), dtype=np.float64) for name in ("utopia", "maxima")
            )
            self.combining.fixed = utopia, maxima

    def _restore_initial(self, view: ResultView) -> None:
        before = view.arrays.get("design/initial")
        if self.initial is not None and (before is None or not np.array_equal(before, self.initial)):
            raise DifferentCaseError(
                f"{view.path} cannot be resumed with another --alpha: it began with another design",
                ("--alpha",),
            )
        if before is not None:
            self.initial = np.asarray(before, dtype=np.float64)

    def is_through(self, task: StartTask) -> bool:
        """Whether a start has gone the part of its way that it was to go."""
        state = self.states[task.index]
        if state is None:
            return False
        return is_done(self.case, state) or (task.quota is not None and state.iteration >= task.quota)

    def conclude(self) -> tuple[RunStatus, str]:
        """The run's status and why it ended, by its best start alone."""
        if not self.has_ended:
            return RunStatus.INTERRUPTED, "stopped on request; the last iteration is saved"
        state = self.best_state
        assert state is not None
        if self.case.priced_groups:
            return self.rounds.conclude(state)
        if ended := self.sizes.conclude(state):
            return ended
        if self.sizes.is_chosen(state):
            return state.status, state.reason
        stage, count = stage_of(state) + 1, stage_count(self.case)
        return state.status, state.reason if stage == count else f"stage {stage} of {count}: {state.reason}"

    def members_part(self) -> Datasets:
        """The datasets of the case and its members, which change where a round of pricing builds some; a run is resumed
        with the case as it was read."""
        return case_part(self.case) | {"resume/case": describe(self.stated)} | self.rounds.part()

    def part(self, final_objectives: Floats | None = None) -> Datasets:
        """The datasets of what changes while the run goes on: rounds of pricing, iterations, sizes, individual optima.

        final_objectives (2, n_obj): raw values of the best design and of the last one, where they are known.
        """
        datasets = self.rounds.part()
        visited = np.zeros((0, len(self.case.objectives)))
        if self.best is not None:
            part = run_part(self.case, self.states, self.combining.evaluations, final_objectives)
            datasets |= part | self.sizes.part()
            visited = np.asarray(part["iterations/objectives"], dtype=np.float64)
        if len(self.case.objectives) > 1:
            datasets |= self.combining.part(visited)
        return datasets
