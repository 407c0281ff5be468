"""The whole state of an optimisation between two iterations: arrays and numbers, nothing else.

`State.to_arrays` and `State.from_arrays` are inverse to the bit, so that a resumed run is exact by
construction: there is no other place in which the optimiser remembers anything.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.problem import Floats, Ints, Sample
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.stack import Slopes, Stack, slopes_of
from mdstopo.status import RunStatus, Status

Array = NDArray[Any]


@dataclass(slots=True)
class History:
    """One row per evaluated design, row 0 the start; K + 1 rows after K iterations.

    objective (K+1,): U, NaN where the evaluation failed. info: what the samples report, each (K+1, ...).
    constraints (K+1, m): A x - b. nonlinear (K+1, J): the largest c of each constraint. change (K+1,): largest
    |change of alpha| against the iterate that the step started from. evaluations (K+1,): so far. seconds (K+1,): wall
    time so far. kkt (K+1,): projected KKT residual at the iterate, after the design was taken or not, relative to the
    largest |dU/dalpha|. accepted (K+1,): was the design taken?
    """

    objective: list[float] = field(default_factory=list)
    constraints: list[Floats] = field(default_factory=list)
    nonlinear: list[Floats] = field(default_factory=list)
    change: list[float] = field(default_factory=list)
    evaluations: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    kkt: list[float] = field(default_factory=list)
    accepted: list[bool] = field(default_factory=list)
    info: dict[str, list[Floats]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.objective)

    def extended(
        self,
        sample: Sample,
        constraints: Floats,
        change: float,
        evaluations: int,
        seconds: float,
        kkt: float,
        accepted: bool,
    ) -> "History":
        """This history and one row more; this one stays as it is. Where the sample failed its values are NaN.

        sample: what was found at the evaluated design.
        constraints (m,): A x - b of the linear rows there.
        change: largest |change of alpha| against the iterate that the step started from.
        evaluations: so far.
        seconds: wall time so far (s).
        kkt: projected KKT residual at the iterate, relative to the largest |dU/dalpha|.
        accepted: whether the design was taken as the iterate.
        """
        ok = sample.status is Status.OK
        nonlinear = sample.constraint_levels
        if not ok:
            nonlinear = np.full_like(self.nonlinear[0] if self.nonlinear else nonlinear, np.nan)
        names = self.info if self.info else dict.fromkeys(sample.info)
        rows = {name: _reported(sample, name, self.info.get(name)) for name in names}
        return History(
            [*self.objective, float(sample.objective) if ok else float("nan")],
            [*self.constraints, constraints],
            [*self.nonlinear, nonlinear],
            [*self.change, change],
            [*self.evaluations, evaluations],
            [*self.seconds, seconds],
            [*self.kkt, kkt],
            [*self.accepted, accepted],
            {name: [*self.info.get(name, []), row] for name, row in rows.items()},
        )

    def to_arrays(self) -> dict[str, Array]:
        """Every column as an array, by name; the columns of `info` as `info/<name>`."""
        out: dict[str, Array] = {}
        for f in fields(self):
            if f.name != "info":
                out[f.name] = np.array(getattr(self, f.name), dtype=_COLUMN_TYPES.get(f.name, np.float64))
        out |= {f"info/{name}": np.array(rows, dtype=np.float64) for name, rows in self.info.items()}
        return out

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Array]) -> "History":
        """The inverse of `to_arrays`."""
        out = cls()
        for name, column in arrays.items():
            head, _, key = name.partition("/")
            if head == "info":
                out.info[key] = list(np.asarray(column, dtype=np.float64))
            elif column.ndim == 1:
                setattr(out, name, column.tolist())
            else:
                setattr(out, name, list(np.asarray(column, dtype=np.float64)))
        return out


def _reported(sample: Sample, name: str, before: list[Floats] | None) -> Floats:
    """What the sample reports under a name; NaN in the shape of earlier rows where it reports nothing."""
    if name in sample.info:
        return np.asarray(sample.info[name], dtype=np.float64)
    return np.full_like(before[0], np.nan) if before else np.array(np.nan)


_COLUMN_TYPES: dict[str, type] = {"evaluations": np.int64, "accepted": np.bool_}


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
        """The difference, (N,)."""
        return self.to - self.origin


@dataclass(frozen=True, slots=True)
class RowDetails:
    """What a sample says of its rows beside values and gradients; see `problem.Sample`."""

    constraint_groups: Ints
    offset: Floats
    across: Floats
    constraint_offset: Floats
    constraint_across: Floats

    @classmethod
    def of(cls, sample: Sample) -> "RowDetails":
        """The details of a sample's rows."""
        return cls(*(getattr(sample, f.name) for f in fields(cls)))


@dataclass(slots=True)
class State:
    """What the optimiser knows after an iteration.

    The iterate and what was found there: `alpha` (N,), `objective`, `rows` (R,), `gradients` (R, N),
    `constraint_rows` (C,), `constraint_gradients` (C, N), `violation` (`safeguards.scaled_violation`), and
    `row_details`, which rows are norms and which constraint each belongs to. What rejected trials have
    shown: `cuts` (K,), rows that were the highest there, linearised and seen from the iterate, and `cut_gradients`
    (K, N); `forgotten`, the objective at which they were last dropped.
    The design to be evaluated next: `trial` (N,), with `predicted`, the decrease of the merit function that
    the model promises, and `kkt`, the residual at `alpha`. The adaptation: `shift` (N,) distances of the
    shifts, `step` the last accepted step, in files its difference (N,), `trust` the half width of the trust box in
    ranges, `uses_bundle` which method makes the steps: `bundle` with the `multipliers` (K,) of its rows, `steps` and
    `changes` (m, N) of the Lagrangian's gradient over them, `restoring` whether the largest violation stands for the
    objective, `resets` how often in a row rows from elsewhere were dropped, `concavity` (J + 1,) of the groups
    (`Bundle.lowered`), `stagnation` how many iterates the largest violation has not fallen well below `violation_mark`,
    `dropped` whether others of several starts go on instead, `twin` the number of the one that came to the same (-1:
    none), `largest_gradient` the largest |dU/dalpha| of any iterate;
    or else `convex` the relative weight of the quadratic term. Of each constraint: `penalty` (J,) on violations in the
    subproblem, `merit_penalty` (J,) on them in the separable approximation's merit. Counters: `iteration`,
    `evaluations`, `small` steps in a row, `failed` evaluations in a row, `seconds`.
    The best so far: `best_alpha` (N,), `best_objective`, `best_violation`, and `best_plain`, its violation
    relative to the bounds alone. How it stands: `status`, and `reason` for it in words. `history`: a row an evaluation.
    """

    alpha: Floats
    objective: float
    rows: Floats
    gradients: Floats
    constraint_rows: Floats
    constraint_gradients: Floats
    violation: float
    cuts: Floats
    cut_gradients: Floats
    forgotten: float
    trial: Floats
    predicted: float
    kkt: float
    shift: Shifts
    step: Step
    trust: float
    convex: float
    penalty: Floats
    merit_penalty: Floats
    row_details: RowDetails
    bundle: Bundle
    multipliers: Floats
    steps: Slopes
    changes: Slopes
    uses_bundle: bool
    restoring: bool
    resets: int
    concavity: Floats
    stagnation: int
    violation_mark: float
    dropped: bool
    twin: int
    largest_gradient: float
    iteration: int
    evaluations: int
    small: int
    failed: int
    seconds: float
    best_alpha: Floats
    best_objective: float
    best_violation: float
    best_plain: float
    status: RunStatus
    reason: str
    history: History

    @property
    def running(self) -> bool:
        """Whether another iteration is due."""
        return self.status is RunStatus.RUNNING

    @property
    def sample(self) -> Sample:
        """The iterate's function values as a sample."""
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
        """Make the trial the iterate; sample and violation (`safeguards.scaled_violation`) are what was found there."""
        self.alpha = self.trial
        self.objective, self.violation = sample.objective, violation
        self.rows, self.gradients = sample.rows, sample.gradients
        self.constraint_rows, self.constraint_gradients = sample.constraint_rows, sample.constraint_gradients
        self.row_details = RowDetails.of(sample)

    def copy(self) -> "State":
        """Another state with the same values; `dataclasses.replace` takes several times as long."""
        return State(*_values(self))

    def to_arrays(self) -> dict[str, Array]:
        """The state as arrays by name (numbers as 0-d arrays, text as UTF-8 bytes, `history/<column>`)."""
        out: dict[str, Array] = {}
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, History):
                out |= {f"history/{name}": column for name, column in value.to_arrays().items()}
            elif isinstance(value, (Bundle, RowDetails)):
                parts = {part.name: getattr(value, part.name) for part in fields(value)}
                out |= {f"{f.name}/{name}": np.array(x) if isinstance(x, Stack) else x for name, x in parts.items()}
            elif isinstance(value, (Step, Shifts)):
                out[f.name] = value.array().copy()
            elif isinstance(value, str):
                out[f.name] = np.frombuffer(value.encode(), dtype=np.uint8).copy()
            else:
                out[f.name] = np.array(value)
        return out

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Array]) -> "State":
        """The inverse of `to_arrays`. Raises KeyError naming the first array that is missing."""
        values: dict[str, object] = {}
        history: dict[str, Array] = {}
        for name, array in arrays.items():
            if name.startswith("history/"):
                history[name.removeprefix("history/")] = np.asarray(array)
        for f in fields(cls):
            if f.name == "history":
                values[f.name] = History.from_arrays(history)
                continue
            if f.name in _PARTS:
                kind = _PARTS[f.name]
                values[f.name] = kind(*(np.array(arrays[f"{f.name}/{part.name}"]) for part in fields(kind)))
                continue
            array = np.asarray(arrays[f.name])
            if f.name in ("steps", "changes"):
                values[f.name] = slopes_of(np.array(array))
            elif f.name in ("status", "reason"):
                text = array.tobytes().decode()
                values[f.name] = RunStatus(text) if f.name == "status" else text
            elif f.name == "shift":
                values[f.name] = Shifts(np.array(array))
            elif f.name == "step":
                values[f.name] = Step(np.array(array), np.zeros(array.shape))
            else:
                values[f.name] = array.item() if array.ndim == 0 else np.array(array)
        return cls(**values)  # type: ignore[arg-type]


#: fields that are arrays by name themselves
_PARTS: dict[str, type[Bundle] | type[RowDetails]] = {"bundle": Bundle, "row_details": RowDetails}

_values = attrgetter(*(f.name for f in fields(State)))
