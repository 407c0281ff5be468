"""What every optimiser knows between two iterations: its design, how good that is, how it stands, and the history.

What an optimiser remembers beside this is its own: further fields of a class of its own, derived from `State`. Nobody
else reads them. `State.to_arrays` and `State.from_arrays` are inverse to the bit for all fields, so that a resumed run
is exact by construction: there is no other place in which an optimiser remembers anything.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from operator import attrgetter
from pkgutil import resolve_name
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.problem import Floats, Ints, Sample
from mdstopo.settings.optimizer_presets import DEFAULT_OPTIMIZER
from mdstopo.settings.optimizers import OPTIMIZERS
from mdstopo.status import RunStatus, Status

Array = NDArray[Any]


@dataclass(slots=True)
class History:
    """One row per evaluated design, row 0 the start; K + 1 rows after K iterations.

    objective (K+1,): U, NaN where the evaluation failed. info: what the samples report, each (K+1, ...).
    constraints (K+1, m): A x - b. nonlinear (K+1, J): the largest c of each constraint. change (K+1,): largest
    |change of alpha| against the iterate that the step started from. evaluations (K+1,): so far. seconds (K+1,): wall
    time so far. kkt (K+1,): projected KKT residual at the iterate, after the design was taken or not, relative to the
    largest |dU/dalpha|. accepted (K+1,): was the design taken? failure (K+1,): why the evaluation failed, in words;
    empty where it did not.
    """

    objective: list[float] = field(default_factory=list)
    constraints: list[Floats] = field(default_factory=list)
    nonlinear: list[Floats] = field(default_factory=list)
    change: list[float] = field(default_factory=list)
    evaluations: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    kkt: list[float] = field(default_factory=list)
    accepted: list[bool] = field(default_factory=list)
    failure: list[str] = field(default_factory=list)
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
            [*self.failure, sample.failure],
            {name: [*self.info.get(name, []), row] for name, row in rows.items()},
        )

    def to_arrays(self) -> dict[str, Array]:
        """Every column as an array, by name; the columns of `info` as `info/<name>`."""
        out: dict[str, Array] = {}
        for f in fields(self):
            if f.name not in ("info", "failure"):
                out[f.name] = np.array(getattr(self, f.name), dtype=_COLUMN_TYPES.get(f.name, np.float64))
        out |= {f"info/{name}": np.array(rows, dtype=np.float64) for name, rows in self.info.items()}
        if any(self.failure):
            out["failure"] = _bytes("\0".join(self.failure))
        return out

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Array]) -> "History":
        """The history from arrays that `to_arrays` has made."""
        out = cls()
        for name, column in arrays.items():
            head, _, key = name.partition("/")
            if name == "failure":
                out.failure = _text(column).split("\0")
            elif head == "info":
                out.info[key] = list(np.asarray(column, dtype=np.float64))
            elif column.ndim == 1:
                setattr(out, name, column.tolist())
            else:
                setattr(out, name, list(np.asarray(column, dtype=np.float64)))
        out.failure = out.failure or [""] * len(out)
        return out


def _reported(sample: Sample, name: str, before: list[Floats] | None) -> Floats:
    """What the sample reports under a name; NaN in the shape of earlier rows where it reports nothing."""
    if name in sample.info:
        return np.asarray(sample.info[name], dtype=np.float64)
    return np.full_like(before[0], np.nan) if before else np.array(np.nan)


_COLUMN_TYPES: dict[str, type] = {"evaluations": np.int64, "accepted": np.bool_}


@dataclass(slots=True)
class State:
    """What is known after an iteration, whichever optimiser made it.

    The iterate `alpha` (N,), its `objective`, and its `kkt` residual, NaN where that is not known; `trial` (N,), the
    design that is evaluated next. The best design so far: `best_alpha` (N,), `best_objective`, and by how much it
    misses limits, `best_violation` (`violations.scaled_violation`) and `best_plain` (`violations.plain_violation`).
    Counters: `iteration`, `evaluations`, `seconds`. Of several starts: `dropped`, whether others go on instead, and
    `twin`, the number of the one that came to the same (-1: none). How it stands: `status`, and `reason` for it in
    words. `history`: a row an evaluation.

    A derived class says in `optimizer` the name of the record (`settings.optimizers`) whose states it has.
    """

    optimizer: ClassVar[str] = ""

    alpha: Floats
    objective: float
    trial: Floats
    kkt: float
    iteration: int
    evaluations: int
    seconds: float
    best_alpha: Floats
    best_objective: float
    best_violation: float
    best_plain: float
    dropped: bool
    twin: int
    status: RunStatus
    reason: str
    history: History

    @property
    def running(self) -> bool:
        """Whether the optimiser is to do another iteration."""
        return self.status is RunStatus.RUNNING

    # What an optimiser may tell of its own part; the defaults tell nothing.

    @property
    def is_restoring(self) -> bool:
        """Whether a design that keeps the limits is looked for before the objective is lowered any further."""
        return False

    def foreseen(self) -> float:
        """The objective that is expected at the trial; NaN where it is not known."""
        return float("nan")

    def slope(self) -> Floats:
        """dU/dalpha (N,) of the highest row at the iterate; zeros where it is not known."""
        return np.zeros(len(self.alpha))

    def row_shares(self) -> tuple[Ints, Floats]:
        """Which rows hold the iterate: of each (K,) its group, 0 of the objective and j of the j-th constraint, and its
        share of the Lagrangian's gradient, in any unit. No rows where that is not known."""
        return np.zeros(0, dtype=np.int64), np.zeros(0)

    # Copies and files.

    def copy(self) -> Self:
        """Another state with the same values; `dataclasses.replace` takes several times as long."""
        return type(self)(*_getter(type(self))(self))

    def to_arrays(self) -> dict[str, Array]:
        """The state as arrays by name (numbers as 0-d arrays, text as UTF-8 bytes, `history/<column>`)."""
        out: dict[str, Array] = {"optimizer": _bytes(self.optimizer)}
        for f in fields(self):
            out |= self._to_arrays(f.name, getattr(self, f.name))
        return out

    @staticmethod
    def from_arrays(arrays: Mapping[str, Array]) -> "State":
        """The inverse of `to_arrays`, of the class that wrote them.

        Raises KeyError naming the first array that is missing, or the optimiser that is not known.
        """
        # older files do not name theirs
        name = _text(arrays["optimizer"]) if "optimizer" in arrays else DEFAULT_OPTIMIZER
        kind = class_of_states(name)
        return kind(**{f.name: kind._from_arrays(f.name, arrays) for f in fields(kind)})

    def _to_arrays(self, name: str, value: Any) -> dict[str, Array]:
        """One field as arrays; a derived class converts here what is neither number, text nor array."""
        if isinstance(value, History):
            return {f"{name}/{column}": array for column, array in value.to_arrays().items()}
        return {name: _bytes(value) if isinstance(value, str) else np.array(value)}

    @classmethod
    def _from_arrays(cls, name: str, arrays: Mapping[str, Array]) -> Any:
        """The inverse of `_to_arrays`."""
        if name == "history":
            head = f"{name}/"
            names = [key for key in arrays if key.startswith(head)]
            return History.from_arrays({key.removeprefix(head): np.asarray(arrays[key]) for key in names})
        array = np.asarray(arrays[name])
        if name == "status":
            return RunStatus(_text(array))
        if name == "reason":
            return _text(array)
        return array.item() if array.ndim == 0 else np.array(array)


def class_of_states(optimizer: str) -> type[State]:
    """The class of an optimiser's states. Raises KeyError where there is none of that name."""
    return cast(type[State], resolve_name(OPTIMIZERS[optimizer].states))


_getters: dict[type[State], Any] = {}


def _getter(kind: type[State]) -> Any:
    """What takes the values of all fields of a class of states."""
    if kind not in _getters:
        _getters[kind] = attrgetter(*(f.name for f in fields(kind)))
    return _getters[kind]


def _bytes(text: str) -> Array:
    return np.frombuffer(text.encode(), dtype=np.uint8).copy()


def _text(array: Array) -> str:
    return np.asarray(array).tobytes().decode()
