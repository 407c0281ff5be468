"""What an evaluation gives back."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.error_estimate import ErrorEstimate

FloatArray = NDArray[np.float64]


# Both are tuples because they are made a few thousand times a second: a frozen dataclass takes some 10 us longer.

#: nothing by any name; plain, because evaluations travel between processes
_NONE: Mapping[Any, Any] = {}


class Peak(NamedTuple):
    """One of the competing peaks of an objective.

    time in s (NaN where the objective is no value at one time); value: raw; gradient (N,): d value / d alpha with
    the time held fixed, None where no gradient was asked for. Where the case has variables of laws, their derivatives
    (P,) stand behind those by alpha.
    """

    time: float
    value: float
    gradient: FloatArray | None


class Evaluation(NamedTuple):
    """One design, evaluated; mappings by objective name.

    objectives: raw G; gradients: dG/dalpha (N,), at tied peaks the highest's, the earliest if equal; peak_times: t_n in
    s (NaN for mean and integral); peaks: all that compete, highest first; constraints (n_con,): h_j - h_0j in the
    case's order; constraint_gradients (n_con, N); work: counts of what was done; status: what is not `usable`
    leaves values NaN, and message names the culprit. constraint_peaks: by the place of a constraint on a response, all
    that compete. all_compete: whether all peaks are rows whatever the reduction over time, because they are those of a
    measure over a sample. errors: estimates of the errors of objectives and gradients, where they were asked for.
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
    errors: "Mapping[str, ErrorEstimate]" = _NONE
    variables: Mapping[str, FloatArray] = _NONE
    variable_gradients: Mapping[str, Mapping[str, FloatArray]] = _NONE
    constraint_variable_gradients: Mapping[str, FloatArray] = _NONE
