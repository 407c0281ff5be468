"""What a picture is made from: a result file, and the case in it."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.store.errors import StoreError
from mdstopo.store.reader import ResultView, read_result
from mdstopo.store.stored_case import case_of

if TYPE_CHECKING:
    from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]

#: times at which a history is sampled
SAMPLES = 401


@dataclass(frozen=True)
class Motion:
    """t (T,), q (T, 3 n_bodies) of one load case."""

    t: Floats
    q: Floats


class Source:
    """A result file, with what pictures ask of it. point: of a front, which of its designs."""

    def __init__(self, path: Path, point: int | None = None) -> None:
        self.view: ResultView = read_result(path, leave_out=("optimizer", "pareto/tasks", "sweep/tasks"))
        self._point = point
        if point is not None and "pareto/alpha" not in self.view.arrays:
            raise StoreError(f"{path}: --point is for fronts; this was made by `{self.view.kind}`")

    @cached_property
    def case(self) -> Case:
        """The case as it was read, with what --set changed."""
        return case_of(self.view)

    @property
    def title(self) -> str:
        """Of the case, or its name."""
        return self.view.title or self.view.name

    @property
    def names(self) -> tuple[str, ...]:
        """The objectives' names."""
        return self.view.lines("objectives")

    @cached_property
    def alpha(self) -> Floats:
        """The design that is shown, (N,). Raises StoreError where the file has none, or several."""
        arrays = self.view.arrays
        if "design/alpha" in arrays:
            return self.view.alpha
        if "pareto/alpha" not in arrays:
            raise StoreError(f"{self.view.path}: holds no design")
        designs = np.asarray(arrays["pareto/alpha"], dtype=np.float64)
        point = len(designs) // 2 if self._point is None else self._point
        if not 0 <= point < len(designs):
            raise StoreError(f"{self.view.path}: there is no point {point}; the front has 0 to {len(designs) - 1}")
        if not np.isfinite(designs[point]).all():
            raise StoreError(f"{self.view.path}: point {point} has no design")
        chosen: Floats = designs[point]
        return chosen

    @cached_property
    def design(self) -> Floats:
        """The design that is shown: alpha, then the values of variables, as far as the file has them."""
        alpha = self.alpha
        if not self.case.variables:
            return alpha
        front = "design/alpha" not in self.view.arrays
        point = len(self.view.array("pareto/alpha")) // 2 if self._point is None and front else self._point
        prefix = "pareto" if front else "design"
        values = [self.view.array(f"{prefix}/variables/{each.name}") for each in self.case.variables]
        return np.concatenate([alpha, *(each[point] if front else each for each in values)])

    @property
    def load_cases(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(each.name for each in self.case.load_cases)

    def motion(self, load_case: str, times: Floats | None = None) -> Motion:
        """The motion of the design in a load case, as the file has it, or simulated again.

        times (T,): where it is wanted; default evenly over the whole.
        """
        stored = self.view.under(f"trajectories/{load_case}")
        if stored and times is None and len(stored["t"]) > 1:
            return Motion(stored["t"].astype(np.float64), stored["q"].astype(np.float64))
        motion = self.engine.trajectory(self.design, load_case)
        if times is None:
            times = np.linspace(motion.t[0], motion.t[-1], SAMPLES)
        if times.max() > motion.t[-1] or times.min() < motion.t[0]:
            raise StoreError(
                f"load case {load_case} runs from {motion.t[0]:g} to {motion.t[-1]:g} s; asked for {times.max():g} s"
            )
        return Motion(times, motion.at(times).q)

    @cached_property
    def engine(self) -> "Evaluator":
        """The case, compiled."""
        from mdstopo.engine import Evaluator

        return Evaluator(self.case)
