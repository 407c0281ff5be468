"""What a run tells while it goes and when it ends."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.state import State
from mdstopo.plan.pricing import Pricing
from mdstopo.session.start_in_stages import iterations_of
from mdstopo.shown import counted, html_of
from mdstopo.starts.callbacks import Notify
from mdstopo.status import RunStatus

if TYPE_CHECKING:
    from mdstopo.robust.conclusion import Conclusion

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Progress:
    """One iteration of one start.

    start, starts: which of how many, from 0. iteration: of all stages of this start, as max_iterations. objective: U at
    this design (NaN where its evaluation failed); best: the lowest so far in this stage; violation: largest excess over
    a constraint, in the constraint's unit; change: largest |change of alpha|; evaluations: of this start so far;
    failure: why the evaluation failed, in words, empty where it did not.
    """

    start: int
    starts: int
    iteration: int
    max_iterations: int
    objective: float
    best: float
    violation: float
    change: float
    evaluations: int
    failure: str = ""

    @classmethod
    def of(cls, state: State, start: int, starts: int, max_iterations: int) -> "Progress":
        """The progress of a start whose state has just been reached."""
        history = state.history
        rows = np.concatenate([np.atleast_1d(history.constraints[-1]), np.atleast_1d(history.nonlinear[-1])])
        return cls(
            start=start,
            starts=starts,
            iteration=iterations_of(state),
            max_iterations=max_iterations,
            objective=float(history.objective[-1]),
            best=float(state.best_objective),
            violation=float(rows.max(initial=0.0)),
            change=float(history.change[-1]),
            evaluations=int(state.evaluations),
            failure=history.failure[-1],
        )


@dataclass(frozen=True, slots=True)
class Callbacks:
    """What a run asks and tells its caller.

    on_iteration: called after each iteration. stop_requested: asked after each iteration whether to stop. notify: is
    given sentences for the user.
    """

    on_iteration: Callable[[Progress], None]
    stop_requested: Callable[[], bool]
    notify: Notify


@dataclass(frozen=True, slots=True)
class ChosenSizes:
    """What is known of the choice of sizes from a catalogue.

    members: how many there are whose sizes are chosen; choices: how many of these there are. objective: raw value of
    the best choice; continuous: that of the optimum before. bound: the best optimum of a relaxation that is still open,
    or the objective where none is; of a problem with several optima it is no proven bound. nodes, evaluations: so far.
    exhaustive: whether all choices were evaluated; exchanged: whether a neighbour of the best of all nodes was better
    still. finished: whether the search has come to its end. sizes: by group, how many members have each.
    """

    members: int
    choices: int
    objective: float
    continuous: float
    bound: float
    nodes: int
    evaluations: int
    exhaustive: bool
    exchanged: bool
    finished: bool
    sizes: Mapping[str, Mapping[float, int]]


@dataclass(frozen=True, slots=True, repr=False)
class Outcome:
    """A run that has ended, or was stopped.

    alpha (N,): the best design. objectives: raw G there, by name. initial_objectives: at the best start's
    first design, of the last stage where there are several. peaks: (time, value) of all that compete at the best
    design, highest first; empty for a run that was stopped. constraints (n_con,): h_j - h_0j there. combined, utopia,
    maxima: U of several objectives and what it is made with, else None. history: columns by the names of the file's
    `iterations/...`, K + 1 rows. states: each start's last state, None where it has not begun; best_start: whose result
    this is. evaluations, iterations: of all starts. seconds: wall time of the iterations in this process;
    compile_seconds: of getting ready, loading or compiling kernels. conclusion: nominal and robust values and the fresh
    sample's, of an uncertain case. variables: the best design's values, by name, in the parameters' units. pricing:
    what is known of candidates that are priced; case: then with the members that were built in the end. sizes: what is
    known of the choice of sizes from a catalogue.
    """

    case: Case
    alpha: Floats
    objectives: Mapping[str, float]
    initial_objectives: Mapping[str, float]
    peaks: Mapping[str, tuple[tuple[float, float], ...]]
    constraints: NDArray[np.float64]
    utopia: NDArray[np.float64] | None
    maxima: NDArray[np.float64] | None
    combined: float | None
    history: Mapping[str, NDArray[np.generic]]
    status: RunStatus
    reason: str
    path: Path | None
    warnings: tuple[str, ...]
    states: tuple[State | None, ...]
    best_start: int
    evaluations: int
    iterations: int
    seconds: float
    compile_seconds: float
    integrator: str
    integrator_reason: str
    conclusion: "Conclusion | None" = None
    variables: Mapping[str, Floats] = field(default_factory=dict)
    pricing: Pricing | None = None
    sizes: "ChosenSizes | None" = None

    def __repr__(self) -> str:
        parts = [f"{self.status.value}: {self.reason}"]
        parts += [
            f"{name} {self.initial_objectives[name]:.9g} -> {value:.9g}" for name, value in self.objectives.items()
        ]
        parts.append(f"{counted(self.iterations, 'iteration')}, {counted(self.evaluations, 'evaluation')}")
        return f"<Result of {self.case.title or self.case.name!r}: {'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        return html_of(self)

    @property
    def kkt(self) -> float:
        """The projected KKT residual at the best start's last iterate, relative to the largest |dU/dalpha|."""
        state = self.states[self.best_start]
        return float("nan") if state is None else float(state.kkt)

    @property
    def keeps_constraints(self) -> bool:
        """Whether the best design does, to the optimiser's tolerance."""
        state = self.states[self.best_start]
        return state is not None and state.best_violation <= self.case.optimizer.tolerance
