"""The interface of an optimiser, and what is alike for all: making one, driving it, its first state. No mechanics.

One step is one evaluation. Between two steps everything is in `State`, so that the loop can be stopped, stored and
resumed anywhere without a difference in any bit.
"""

import importlib
from collections.abc import Callable
from typing import Any, Protocol, cast

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.problem import Floats, Problem, Sample
from mdstopo.optimizer.safeguards import no_cuts, plain_violation, scaled_violation
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.state import History, RowDetails, State, Step
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
        """The next state, after one evaluation, that of `state.trial`; the given one is left as it is.

        Raises ValueError where the state is not running.
        """

    def terminate(self, state: State) -> tuple[RunStatus, str]:
        """Whether a state goes on, and if not why: by the present limits, whatever they were when it was made."""


def make(problem: Problem, settings: Settings) -> Optimizer:
    """The optimiser that the settings name."""
    module, _, name = OPTIMIZERS[settings.optimizer].made_by.partition(":")
    return cast(Optimizer, getattr(importlib.import_module(module), name)(problem, settings))


def reopen(optimizer: Optimizer, state: State) -> State:
    """The state under the present limits: a run that a moved limit or tolerance ended goes on."""
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


def first_state(alpha: Floats, sample: Sample, failed: bool = False, **own: Any) -> State:
    """The state at a first design, before a method proposes the next.

    own: what an optimiser remembers in other fields of `State` than these; the rest is empty.
    """
    n = len(alpha)
    violation, plain = (float("inf"),) * 2 if failed else (scaled_violation(sample), plain_violation(sample))
    known: dict[str, Any] = {
        "alpha": alpha,
        "objective": sample.objective,
        "rows": sample.rows,
        "gradients": sample.gradients,
        "constraint_rows": sample.constraint_rows,
        "constraint_gradients": sample.constraint_gradients,
        "violation": violation,
        "cuts": no_cuts(n)[0],
        "cut_gradients": no_cuts(n)[1],
        "forgotten": float("inf"),
        "trial": alpha,
        "predicted": 0.0,
        "kkt": float("nan"),
        "shift": Shifts(np.zeros(n)),
        "step": Step(alpha, alpha),
        "trust": 1.0,
        "convex": 0.0,
        "penalty": np.zeros(0),
        "merit_penalty": np.zeros(0),
        "row_details": RowDetails.of(sample),
        "bundle": Bundle.empty(n),
        "multipliers": np.zeros(0),
        "steps": np.zeros((0, n)),
        "changes": np.zeros((0, n)),
        "uses_bundle": False,
        "restoring": False,
        "resets": 0,
        "concavity": np.zeros(1),
        "stagnation": 0,
        "violation_mark": float("inf"),
        "dropped": False,
        "twin": -1,
        "largest_gradient": 0.0,
        "iteration": 0,
        "evaluations": 1,
        "small": 0,
        "failed": 0,
        "seconds": 0.0,
        "best_alpha": alpha,
        "best_objective": sample.objective,
        "best_violation": violation,
        "best_plain": plain,
        "status": RunStatus.RUNNING,
        "reason": "",
        "history": History(),
    }
    return State(**{**known, **own})
