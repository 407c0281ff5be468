"""Getting ready: every kernel loaded before the first iteration, in one order.

So iterations are timed for themselves, and a kernel that cannot be compiled is found before work is lost. Where kernels
are not known to be on the disk, another process compiles them first (`session.compiling_apart`): what the compiler
leaves in memory ends with it.
"""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.problem import LinearRows, Problem, Sample
from mdstopo.optimizer.wide import MANY_VARIABLES
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES
from mdstopo.starts.evaluator_interface import Engine
from mdstopo.starts.single_start import first_design, make_optimizer
from mdstopo.store.contents import Motion

Floats = NDArray[np.float64]

FEW_VARIABLES = 3
"""Variables of the smallest problem."""
_SMALL = 100_000  # members up to which an evaluation costs nothing beside loading its kernels


def get_ready(
    case: Case, engine: Engine, problem: Problem, initial: Floats | None
) -> tuple[Floats, Floats, dict[str, Motion]]:
    """Load every kernel, always in this order, so that iterations are timed for themselves and repeat to the bit.

    Returns the stated first x (n,), the nearest one that keeps bounds and volume rows, and its motion in each load
    case. Raises CaseError where no design keeps the rows.
    """
    competes = bool(getattr(problem, "competes", False))
    for size in [
        FEW_VARIABLES,
        *(many for many in (MANY_VARIABLES, VERY_MANY_VARIABLES) if len(problem.initial) >= many),
    ]:
        load_optimizer(case, size, size >= VERY_MANY_VARIABLES and competes)
    if competes:
        load_optimizer(case, FEW_VARIABLES, competes)
    stated, begin = first_design(case, problem, initial)
    before = motions(case, engine, case.space.expand(begin))
    if case.n_members <= _SMALL:
        problem.evaluate(begin)
    return stated, begin, before


def load_optimizer(case: Case, size: int, competes: bool = False) -> None:
    """Load the kernels of the optimiser for so many variables, and for rows that compete where they do."""
    optimizer = make_optimizer(case, _Toy(size, competes))
    state = optimizer.start()
    if state.running:
        optimizer.step(state)


def motions(case: Case, engine: Engine, design: Floats) -> dict[str, Motion]:
    """Compute the motion of a design in each load case."""
    return {each.name: engine.trajectory(design, each.name) for each in case.load_cases}


class _Toy:
    """A problem of two rows, large enough to call every kernel of the optimiser. Both rows decide at its optimum; where
    variables are many only the higher one does."""

    def __init__(self, size: int, competes: bool) -> None:
        self.competes = competes
        self.initial = np.full(size, 0.5)
        self.lower = np.full(size, 0.001)
        self.upper = np.ones(size)
        self.linear = LinearRows(np.ones((1, size)), np.array([0.5 * size]), np.array([True]))
        rising = np.linspace(1.0, 3.0, size)
        self._slopes = np.array([rising, rising[::-1] if size < MANY_VARIABLES else 0.9 * rising])

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """The rows and their slopes."""
        values = np.sum(self._slopes / x, axis=1)
        order = np.argsort(-values, kind="stable")
        slopes = (-self._slopes / x**2)[order]
        return Sample(float(values.max()), values[order], slopes, np.zeros(0), np.zeros((0, len(x))))
