"""What an evaluation gives back."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mdstopo.shown import html_of
from mdstopo.status import Status

FloatArray = NDArray[np.float64]


# Both are tuples because they are made a few thousand times a second: a frozen dataclass takes some 10 us longer.

#: nothing by any name; plain, because evaluations travel between processes
_NONE: Mapping[Any, Any] = {}


Shape: TypeAlias = Literal["plain", "absolute", "norm"]


class Rows(NamedTuple):
    """How many peaks of a response are reported, and what of them; None: as the engine does by default.

    window: how far below the highest a peak may be to compete, relative to it. most: how many of one response at most.
    cones: tell `Peak.across`, too.
    """

    window: float | None = None
    most: int | None = None
    cones: bool = False


#: rows as the engine takes them by itself
USUAL = Rows()


class Peak(NamedTuple):
    """One of the competing peaks of an objective.

    time in s (NaN where the objective is no value at one time); value: raw; gradient (N,): d value / d alpha with
    the time held fixed, None where no gradient was asked for. Where the case has variables of laws, their derivatives
    (P,) stand behind those by alpha.

    shape: what the value y is of what it is formed of, and so what becomes of it with a design alpha + d at that time,
    to first order in what it is formed of: `plain` y + g.d; `absolute` |y + g.d|; `norm` sqrt((y + g.d)^2 + (p.d)^2),
    where p is `across` (N,): the derivative of the component perpendicular to the vector, a quarter turn ahead of it
    (in the frame in which the vector is formed), with the direction held. None where it was not asked for; zero where
    the vector is.
    """

    time: float
    value: float
    gradient: FloatArray | None
    across: FloatArray | None = None
    shape: Shape = "plain"


@dataclass(frozen=True)
class ErrorEstimate:
    """Absolute errors of one objective. value: of G; gradient: of the worst entry of dG/dalpha, NaN where there is
    none."""

    value: float
    gradient: float


class Evaluation(NamedTuple):
    """One design, evaluated; mappings by objective name.

    objectives: raw G; gradients: dG/dalpha (N,), at tied peaks the highest's, the earliest if equal; peak_times: t_n in
    s (NaN for mean and integral); peaks: all that compete, highest first; constraints (n_con,): h_j - h_0j in the
    case's order; constraint_gradients (n_con, N); work: counts of what was done; status: what is not `usable`
    leaves values NaN, and message says which part is to blame. constraint_peaks: by the place of a constraint on a
    response, all that compete. all_compete: whether all peaks are rows whatever the reduction over time, because they
    are those of a measure over a sample. errors: estimates of the errors of objectives and gradients, where they were
    asked for.
    variables: the values that parameters of laws had, by the name of the design variable; variable_gradients: dG by
    them, by objective, then by variable; constraint_variable_gradients: (n_con, values), by variable. All in the
    parameters' own units.
    """

    objectives: Mapping[str, float]
    gradients: Mapping[str, FloatArray]
    peak_times: Mapping[str, float]
    constraints: FloatArray
    constraint_gradients: FloatArray
    peaks: Mapping[str, tuple[Peak, ...]]
    work: Mapping[str, int]
    status: Status
    message: str = ""
    constraint_peaks: Mapping[int, tuple[Peak, ...]] = _NONE
    all_compete: bool = False
    errors: Mapping[str, ErrorEstimate] = _NONE
    variables: Mapping[str, FloatArray] = _NONE
    variable_gradients: Mapping[str, Mapping[str, FloatArray]] = _NONE
    constraint_variable_gradients: Mapping[str, FloatArray] = _NONE

    def __repr__(self) -> str:
        parts = [self.status.value + (f" ({self.message})" if self.message else "")]
        parts += [f"{name} = {value:.9g}" for name, value in self.objectives.items()]
        if self.gradients:
            parts.append(f"gradients by {len(next(iter(self.gradients.values()))):,} members")
        if len(self.constraints):
            parts.append(f"largest excess of a constraint {self.constraints.max():.3g}")
        return f"<Evaluation: {'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        return html_of(self)


class MotionValues(NamedTuple):
    """What objectives and constraints of one load case come to, of one motion.

    status, message: as of an `Evaluation`; a status that is not `usable` leaves no peaks. peaks: the highest by the
    name of an objective, and by the key path of a constraint: `constraints[2]`.
    """

    status: Status
    message: str
    peaks: Mapping[str, Peak] = _NONE
