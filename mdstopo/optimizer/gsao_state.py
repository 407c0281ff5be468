"""What GSAO remembers between two iterations, beside what every optimiser knows (`state.State`)."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.problem import Floats, Ints, Sample
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.stack import Slopes, Stack, slopes_of
from mdstopo.optimizer.state import Array, State
from mdstopo.optimizer.violations import merit


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A step by the designs (N,) that it led to and came from: of very many variables the difference is not formed and
    kept only because its sign will be asked for."""

    to: Floats
    origin: Floats

    def __eq__(self, other: object) -> bool:
        """Whether two steps lie between the same arrays."""
        return isinstance(other, Step) and self.to is other.to and self.origin is other.origin

    __hash__ = None  # type: ignore[assignment]  # arrays have none

    def array(self) -> Floats:
        """The difference of the two designs (N,)."""
        return self.to - self.origin


@dataclass(frozen=True, slots=True)
class RowDetails:
    """What a sample says of its rows beside values and gradients (`problem.Sample`)."""

    constraint_groups: Ints
    offset: Floats
    across: Floats
    constraint_offset: Floats
    constraint_across: Floats

    @classmethod
    def of(cls, sample: Sample) -> "RowDetails":
        """The details of the rows of a sample."""
        return cls(*(getattr(sample, f.name) for f in fields(cls)))


@dataclass(slots=True)
class GsaoState(State):
    """What GSAO knows after an iteration, beside `State`.

    What was found at the iterate: `rows` (R,), `gradients` (R, N), `constraint_rows` (C,), `constraint_gradients`
    (C, N), `violation` (`violations.scaled_violation`), and `row_details`, which rows are norms and which constraint
    each belongs to. What rejected trials have shown: `cuts` (K,), rows that were the highest there, linearised and seen
    from the iterate, `cut_gradients` (K, N), and `cuts_lowered` (K,), how much more than the objective they said of
    iterates; `forgotten`, the objective at which they were last dropped.

    Of the trial: `predicted`, the decrease of the merit function that the model promises; infinite where the trial is
    no step but a design far from a least violation. The adaptation: `shift` (N,) distances of the shifts, `step` the
    last accepted step, in files its difference (N,), `trust` the half width of the trust box in ranges, `convex` the
    relative weight of the quadratic term. Of each constraint: `penalty` (J,) on violations in the subproblem,
    `merit_penalty` (J,) on them in the separable approximation's merit. `small` steps and `failed` evaluations in a
    row; `largest_gradient`, the largest |dU/dalpha| of any iterate.

    Of the bundle method, where `uses_bundle` says that it makes the steps: `bundle` with the `multipliers` (K,) of its
    rows, `steps` and `changes` (m, N) of the Lagrangian's gradient over them, `restoring` whether the largest violation
    stands for the objective, `far_design_tried` whether a design far from a least violation was tried, `resets` how
    often in a row rows from elsewhere were dropped, `concavity` (J + 1,) of the groups (`Bundle.lowered`), `stagnation`
    how many iterates the largest violation has not fallen well below `violation_mark`. Of a smooth objective:
    `reliable_steps` how many steps in a row have gained what the model had predicted, and `least_predicted` the least
    decrease that a model has predicted after such steps, of any step within the bounds; infinite where none has.
    """

    optimizer: ClassVar[str] = "gsao"

    rows: Floats
    gradients: Floats
    constraint_rows: Floats
    constraint_gradients: Floats
    violation: float
    row_details: RowDetails
    cuts: Floats
    cut_gradients: Floats
    cuts_lowered: Floats
    forgotten: float
    predicted: float
    shift: Shifts
    step: Step
    trust: float
    convex: float
    penalty: Floats
    merit_penalty: Floats
    small: int
    failed: int
    largest_gradient: float
    uses_bundle: bool
    bundle: Bundle
    multipliers: Floats
    steps: Slopes
    changes: Slopes
    restoring: bool
    far_design_tried: bool
    resets: int
    concavity: Floats
    stagnation: int
    violation_mark: float
    reliable_steps: int
    least_predicted: float

    @property
    def sample(self) -> Sample:
        """Values and derivatives of the functions at the iterate, as a sample."""
        return Sample(
            self.objective,
            self.rows,
            self.gradients,
            self.constraint_rows,
            self.constraint_gradients,
            self.row_details.constraint_groups,
            self.row_details.offset,
            self.row_details.across,
            self.row_details.constraint_offset,
            self.row_details.constraint_across,
        )

    def take(self, sample: Sample, violation: float) -> None:
        """Make the trial the iterate; sample and violation (`violations.scaled_violation`) are what was found there."""
        self.alpha = self.trial
        self.objective, self.violation = sample.objective, violation
        self.rows, self.gradients = sample.rows, sample.gradients
        self.constraint_rows, self.constraint_gradients = sample.constraint_rows, sample.constraint_gradients
        self.row_details = RowDetails.of(sample)

    @property
    def trial_is_far_design(self) -> bool:
        """Whether the trial is no step but a design far from the iterate, a least violation."""
        return self.predicted == np.inf

    @property
    def is_restoring(self) -> bool:
        """Whether steps lower the largest violation at present, instead of the objective."""
        return self.restoring

    def foreseen(self) -> float:
        """What the merit is at the trial if the model is right: where limits hold there, the objective.

        NaN while limits are restored.
        """
        if self.restoring:
            return float("nan")
        penalty = self.penalty if self.uses_bundle else self.merit_penalty
        return merit(self.objective, self.sample.constraint_levels, penalty) - self.predicted

    def slope(self) -> Floats:
        """dU/dalpha (N,) of the highest row at the iterate; see `State.slope`."""
        return self.gradients[0] if len(self.gradients) else np.zeros(len(self.alpha))

    def row_shares(self) -> tuple[Ints, Floats]:
        """The shares of the rows that hold the iterate; see `State.row_shares`. Known of the bundle method's rows
        alone."""
        if not self.uses_bundle or self.restoring or len(self.bundle) != len(self.multipliers):
            return np.zeros(0, dtype=np.int64), np.zeros(0)
        return self.bundle.group, self.multipliers * self.bundle.steepest

    def _to_arrays(self, name: str, value: Any) -> dict[str, Array]:
        """One field as arrays; parts of bundle and row details as `<field>/<part>`."""
        if isinstance(value, (Bundle, RowDetails)):
            parts = {part.name: getattr(value, part.name) for part in fields(value)}
            return {f"{name}/{part}": np.array(x) if isinstance(x, Stack) else x for part, x in parts.items()}
        if isinstance(value, (Step, Shifts)):
            return {name: value.array().copy()}
        return State._to_arrays(self, name, value)  # super() knows no class with slots that a decorator made anew

    @classmethod
    def _from_arrays(cls, name: str, arrays: Mapping[str, Array]) -> Any:
        """The inverse of `_to_arrays`."""
        if name in _PARTS:
            kind = _PARTS[name]
            return kind(*(np.array(arrays[f"{name}/{part.name}"]) for part in fields(kind)))
        if name in ("steps", "changes"):
            return slopes_of(np.array(arrays[name]))
        if name == "shift":
            return Shifts(np.array(arrays[name]))
        if name in _ADDED and name not in arrays:
            return _ADDED[name]
        if name == "cuts_lowered" and name not in arrays:  # of older files
            return np.zeros(len(arrays["cuts"]))
        if name == "step":
            array = np.array(arrays[name])
            return Step(array, np.zeros(array.shape))
        return State._from_arrays(name, arrays)


#: values of fields that older files do not have
_ADDED: dict[str, Any] = {"far_design_tried": False, "reliable_steps": 0, "least_predicted": float("inf")}
#: fields that are arrays by name themselves
_PARTS: dict[str, type[Bundle] | type[RowDetails]] = {"bundle": Bundle, "row_details": RowDetails}
