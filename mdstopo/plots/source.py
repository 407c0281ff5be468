"""What a picture is made from: a result file, and the case in it."""

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.plots.windows_of_laws import active_windows
from mdstopo.scene.design_map import as_designed
from mdstopo.store.result_reader import ResultView, read_result
from mdstopo.store.store_errors import DamagedError, StoreError
from mdstopo.store.stored_case import case_of
from mdstopo.store.whole_front import design_of, points_of

if TYPE_CHECKING:
    from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]

#: times at which a history is sampled
SAMPLES = 401


@dataclass(frozen=True)
class Motion:
    """The motion of one load case: times t (T,) and coordinates q (T, 3 n_bodies)."""

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
    def stated(self) -> Case:
        """The case as it was read, with what --set changed; of a fit the fitted one, with what was measured."""
        case = case_of(self.view)
        if self.view.kind != "fit":
            return case
        from mdstopo.fit.fit_record import fitted_case

        return fitted_case(self.view, case)

    @cached_property
    def case(self) -> Case:
        """The same with points that are design variables, or follow from such, where the design shown has them."""
        case, arrays = self.stated, self.view.arrays
        shown = "design/alpha" in arrays or "pareto/alpha" in arrays
        moving = case.movable or any(each.moved for each in case.variables)
        return as_designed(case, self.design) if moving and shown else case

    def as_stated(self) -> "Source":
        """The same with points where the case states them."""
        other = copy(self)
        other.__dict__["case"] = self.stated
        return other

    @property
    def title(self) -> str:
        """The title of the case, or its name."""
        return self.view.title or self.view.name

    @property
    def names(self) -> tuple[str, ...]:
        """The objectives' names; of a fit those of the measured series."""
        return self.view.lines("fit/series/name" if self.view.kind == "fit" else "objectives")

    @cached_property
    def alpha(self) -> Floats:
        """The design that is shown, (N,). Raises StoreError where the file has none, or several."""
        arrays = self.view.arrays
        if "design/alpha" in arrays:
            return self.view.alpha
        if "pareto/alpha" not in arrays:
            raise StoreError(f"{self.view.path}: holds no design")
        found = design_of(self.view, self._shown)
        if found is None:
            last = points_of(self.view) - 1
            raise StoreError(f"{self.view.path}: there is no point {self._shown}; the front has 0 to {last}")
        chosen: Floats = np.asarray(found[0], dtype=np.float64)
        if not np.isfinite(chosen).all():
            raise StoreError(f"{self.view.path}: point {self._shown} has no design")
        return chosen

    @property
    def _shown(self) -> int:
        """The point of a front that is shown: the one in the middle where none was asked for."""
        return len(self.view.array("pareto/alpha")) // 2 if self._point is None else self._point

    @cached_property
    def design(self) -> Floats:
        """The design that is shown: alpha, then the values of variables, as far as the file has them."""
        alpha = self.alpha
        if not self.stated.variables:
            return alpha
        if "design/alpha" in self.view.arrays:
            values = self.view.under("design/variables")
        else:
            found = design_of(self.view, self._shown)
            values = {} if found is None else found[1]
        for each in self.stated.variables:
            if each.name not in values:
                raise DamagedError(f"{self.view.path}: damaged: it has no values of {each.name}")
        return np.concatenate([alpha, *(values[each.name] for each in self.stated.variables)])

    @cached_property
    def windows(self) -> dict[str, Floats]:
        """When the laws of the design that is shown act, of groups of which any begins or ends (`active_windows`)."""
        return active_windows(self.stated, self.design)

    @property
    def load_cases(self) -> tuple[str, ...]:
        """The names of the load cases."""
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
        """The case, compiled: what evaluates designs and motions."""
        from mdstopo.engine import Evaluator

        return Evaluator(self.case)
