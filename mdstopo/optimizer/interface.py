"""The interface of an optimiser, and what is alike for all: making one, driving it, its first state. No mechanics.

One step is one evaluation. Between two steps everything is in the state, of a class of the optimiser's own that has the
fields of `state.State`. So the loop can be stopped, stored and resumed anywhere without a difference in any bit.
"""

from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any, Protocol, cast

from mdstopo.optimizer.problem import Floats, Problem, Sample
from mdstopo.optimizer.state import History, State
from mdstopo.optimizer.violations import plain_violation, scaled_violation
from mdstopo.settings.optimizer_presets import Settings
from mdstopo.settings.optimizers import OPTIMIZERS
from mdstopo.status import RunStatus


class Optimizer(Protocol):
    """An optimiser of a problem, made by a record of `settings.optimizers` with the problem and the settings."""

    problem: Problem
    settings: Settings

    def start(self, initial: Floats | None = None) -> State:
        """The first state: `initial`, or the problem's own first design, brought into the bounds and evaluated.

        Its `trial` is the design that the first step evaluates.
        """

    def step(self, state: State) -> State:
        """The next state, after one evaluation, that of `state.trial`; the given one, its own, is left as it is.

        Raises ValueError where the state is not running.
        """

    def terminate(self, state: State) -> tuple[RunStatus, str]:
        """Whether a state goes on, and if not why: by the present limits, whatever they were when it was made."""


def make(problem: Problem, settings: Settings) -> Optimizer:
    """The optimiser that the settings name, for a problem."""
    return cast(Optimizer, resolve_name(OPTIMIZERS[settings.optimizer].made_by)(problem, settings))


def reopen(optimizer: Optimizer, state: State) -> State:
    """A state under new limits or tolerances: a run that ended because of the old ones goes on."""
    state = state.copy()
    state.status, state.reason = optimizer.terminate(state)
    return state


def run(
    optimizer: Optimizer,
    state: State | None = None,
    *,
    on_iteration: Callable[[State], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
) -> State:
    """Drive an optimiser to its end, from `state` or from the start.

    on_iteration sees every new state, the first included. Between iterations stop_requested is asked; if it
    says yes the state is returned still running, and `run` continues from it as if nothing had been.
    """
    if state is None:
        state = optimizer.start()
        if on_iteration is not None:
            on_iteration(state)
    while state.running:
        if stop_requested is not None and stop_requested():
            break
        state = optimizer.step(state)
        if on_iteration is not None:
            on_iteration(state)
    return state


def known_at_first(alpha: Floats, sample: Sample, failed: bool = False) -> dict[str, Any]:
    """The fields of `State` at a first design, before an optimiser proposes the next; `failed`: it has no values."""
    infinite = float("inf")
    return {
        "alpha": alpha,
        "objective": sample.objective,
        "trial": alpha,
        "kkt": float("nan"),
        "iteration": 0,
        "evaluations": 1,
        "seconds": 0.0,
        "best_alpha": alpha,
        "best_objective": sample.objective,
        "best_violation": infinite if failed else scaled_violation(sample),
        "best_plain": infinite if failed else plain_violation(sample),
        "dropped": False,
        "twin": -1,
        "status": RunStatus.RUNNING,
        "reason": "",
        "history": History(),
    }
