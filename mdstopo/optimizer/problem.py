"""What an optimiser may know of a problem: a box, linear rows, and samples of the functions. No mechanics.

    minimise    U(x) = max_r f_r(x)
    subject to  c_j(x) <= 0,   A x <= b or A x = b,   lower <= x <= upper

The rows f_r are those pieces of U that compete at a design (the peaks of a maximum over time); which ones
there are may change from design to design.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.status import Status

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class LinearRows:
    """Linear rows (Eq. 14): A x <= b, and A x = b where `equal`.

    A: (m, N); b: (m,); equal: (m,). An `at least` row is written with the signs of A and b turned.
    """

    A: Floats
    b: Floats
    equal: Bools

    @classmethod
    def none(cls, n: int) -> "LinearRows":
        """No rows at all, for `n` variables."""
        return cls(np.zeros((0, n)), np.zeros(0), np.zeros(0, dtype=np.bool_))

    def __len__(self) -> int:
        return len(self.b)

    def excess(self, x: Floats) -> Floats:
        """A x - b, (m,): positive where a limit is exceeded. Summed in a fixed order, whatever the threads."""
        return np.asarray(np.einsum("ij,j->i", self.A, x) - self.b)


def scale_of(lower: Floats, upper: Floats) -> float:
    """What moves of variables within bounds (N,) are judged by: the largest bound, at most 1; 1 where all are zero.

    Sizes may be small numbers, as areas in square metres are: moves of a millionth would be all that they can do.
    """
    largest = max(float(np.abs(lower).max(initial=0.0)), float(np.abs(upper).max(initial=0.0)))
    return min(largest, 1.0) if largest > 0.0 else 1.0


def largest_of_groups(values: Floats, group: Ints, groups: int) -> Floats:
    """The largest of the values (K,) of each group (groups,), group (K,) saying whose each is; -inf of one without."""
    out = np.full(groups, -np.inf)
    np.maximum.at(out, group, values)
    return out


def _no_rows() -> Floats:
    return np.zeros(0)


def _no_gradients() -> Floats:
    return np.zeros((0, 0))


def _no_groups() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class Sample:
    """One design, evaluated.

    objective: U, the number to be minimised, equal to rows[0].
    rows (R,), gradients (R, N): the competing pieces of U, highest first.
    constraint_rows (C,), constraint_gradients (C, N): nonlinear constraints, feasible where <= 0.
    constraint_groups (C,): which constraint each is a piece of, 0 ... J - 1 in order; none: each is one of its own.
    offset (R,), across (R, N), constraint_offset, constraint_across: where a row is the norm of a two-vector less an
        offset, that (NaN where it is not), and the gradient of the vector's component across its direction; the row's
        own gradient is that of the component along it. Nothing where no row is a norm. An absolute value is a norm
        whose `across` is zero.
    status: anything but `Status.OK` means the evaluation failed; values may then be missing.
    message: what a failure was about (the member, the time), in words; may be empty.
    info: what the driver should record with the iterate, number or array by name (`objectives`, `peak_time`).
        The names and shapes must not change from sample to sample of one problem.
    """

    objective: float
    rows: Floats = field(default_factory=_no_rows)
    gradients: Floats = field(default_factory=_no_gradients)
    constraint_rows: Floats = field(default_factory=_no_rows)
    constraint_gradients: Floats = field(default_factory=_no_gradients)
    constraint_groups: Ints = field(default_factory=_no_groups)
    offset: Floats = field(default_factory=_no_rows)
    across: Floats = field(default_factory=_no_gradients)
    constraint_offset: Floats = field(default_factory=_no_rows)
    constraint_across: Floats = field(default_factory=_no_gradients)
    status: Status = Status.OK
    message: str = ""
    info: Mapping[str, Floats | float] = field(default_factory=dict)

    @property
    def failure(self) -> str:
        """Why the evaluation failed, in words; empty where it did not."""
        if self.status is Status.OK:
            return ""
        return f"{self.status.value} ({self.message})" if self.message else self.status.value

    @property
    def groups(self) -> Ints:
        """The constraint that each constraint row belongs to (C,)."""
        return self.constraint_groups if len(self.constraint_groups) else np.arange(len(self.constraint_rows))

    @property
    def constraint_levels(self) -> Floats:
        """(J,) the value of each constraint: the largest of its rows."""
        return self.levels_of(self.constraint_rows)

    def levels_of(self, rows: Floats) -> Floats:
        """The largest of numbers (C,) of the constraint rows for each constraint (J,)."""
        if not len(self.constraint_groups):
            return rows
        return largest_of_groups(rows, self.constraint_groups, int(self.constraint_groups[-1]) + 1)


class Problem(Protocol):
    """What an optimiser asks of a problem.

    1. `initial`, `lower`, `upper` (N,) and `linear` never change; lower <= upper; `initial` may be infeasible.
    2. `evaluate` is a pure function of x: the same bits in, the same bits out, or resumed runs differ.
    3. `evaluate` never raises because of x: a design that cannot be computed comes back with a status.
    4. `gradient=False` may leave `gradients` and `constraint_gradients` empty.

    A problem may have more, which is asked for by name (`getattr`, `hasattr`) and therefore not declared below:

    competes (bool, else False): whether the bundle method makes the steps from the start; else the separable
        approximation begins, and the bundle method takes over where that gets no further, of a smooth problem after 30
        iterations at the latest.
    smooth (bool, else False): whether every row of U is told at each design, as a smooth function of x: no peaks, of
        which others may rise that were not told. The bundle method then trusts curvature rather than rows from far off.
    competitors (int or None, else None): how many of the highest rows the separable approximation takes; None: as the
        options `peaks` and `peak_window` say.
    even (int, else 0): how many of the last variables are drawn uniformly at every random start, because no part of
        their range is likelier than another.
    objective_bound (float, else -inf): no U is below it.
    softened(share) -> Problem: the same problem with members that have only this share of their strength, with which
        a start of the family `start_families.Family.SOFTENED` begins; without it such a start begins as the first
        one does.
    exchange_ends(x, side, rng) -> x: another design that is alike, but far away (`exchange`); without it starts of the
        families OTHER_FROM and OTHER_TO begin near x.
    """

    @property
    def initial(self) -> Floats: ...

    @property
    def lower(self) -> Floats: ...

    @property
    def upper(self) -> Floats: ...

    @property
    def linear(self) -> LinearRows: ...

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample: ...
