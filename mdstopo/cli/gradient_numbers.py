"""Comparing gradients: with one another, and with differences."""

import time
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.evaluation import ErrorEstimate, Evaluation, Peak

Floats = NDArray[np.float64]
Objectives = Callable[[Floats], Mapping[str, float]]

_BUDGET = 0.3  # seconds for timing one method
_STEP = 2e-3  # of the largest alpha, for differences
_LEVELS = 4  # steps halved from one to the next, extrapolated


def timed(compute: Callable[[], object]) -> float:
    """Seconds of the fastest of a few runs; `compute` has run before, so that all is compiled."""
    best, spent = np.inf, 0.0
    while spent < _BUDGET:
        began = time.perf_counter()
        compute()
        taken = time.perf_counter() - began
        best, spent = min(best, taken), spent + taken
    return float(best)


def disagreement(gradient: Floats, reference: Floats) -> float:
    """Largest difference, relative to the reference's largest entry; 0 where both vanish."""
    largest = float(np.abs(reference).max(initial=0.0))
    difference = float(np.abs(gradient - reference).max(initial=0.0))
    return difference / largest if largest > 0.0 else difference


def relative(error: "ErrorEstimate", evaluation: "Evaluation", name: str) -> dict[str, float]:
    """An estimate over the value, and over the largest entry of the gradient; absolute where that is 0."""
    value = abs(evaluation.objectives[name])
    largest = float(np.abs(evaluation.gradients[name]).max(initial=0.0))
    return {"value": error.value / (value or 1.0), "gradient": error.gradient / (largest or 1.0)}


def chosen_members(count: int, wanted: int, seed: int) -> NDArray[np.intp]:
    """`wanted` of `count` design variables at random, in rising order."""
    rng = np.random.default_rng(seed)
    return np.sort(rng.choice(count, size=min(wanted, count), replace=False)).astype(np.intp)


def ranges(case: "Case") -> Floats:
    """(P,): upper less lower bound of every value of the case's variables; 1 where they are one."""
    width = [np.full(each.count, each.upper - each.lower or 1.0) for each in case.variables]
    return np.concatenate(width) if width else np.zeros(0)


def whole_gradient(case: "Case", evaluation: "Evaluation", name: str) -> Floats:
    """(N + P,): dG/dalpha, then the derivatives by variables, as shares of their ranges, so that all compare."""
    named = evaluation.variable_gradients.get(name, {})
    own = np.concatenate(list(named.values())) * ranges(case) if named else np.zeros(0)
    return np.concatenate([evaluation.gradients[name], own])


def value_differences(
    objectives: Objectives, case: "Case", design: Floats, places: NDArray[np.intp]
) -> dict[str, Floats]:
    """As `differences`, by some values of the case's variables, as shares of their ranges."""
    if not len(places):
        return {}
    n, width = case.n_design, ranges(case)
    low, start = _shares(case, design)

    def of_shares(shares: Floats) -> Mapping[str, float]:
        return objectives(np.concatenate([design[:n], low + shares * width]))

    return differences(of_shares, start, places, 1.0)


def _shares(case: "Case", design: Floats) -> tuple[Floats, Floats]:
    """The lower bounds (P,) of the values of variables, and what share of its range each has above that."""
    low = np.concatenate([np.full(each.count, each.lower) for each in case.variables] or [np.zeros(0)])
    return low, (design[case.n_design :] - low) / ranges(case)


def differences(
    objectives: Objectives, alpha: Floats, members: NDArray[np.intp], size: float | None = None
) -> dict[str, Floats]:
    """dG/dalpha of some members by central differences, extrapolated to step zero (Richardson), by objective.

    size: what steps are a share of; default the largest alpha.

    Steps never leave alpha >= 0: where a member is closer to zero than the step, its step is shorter; at
    zero itself differences are one-sided.
    """
    found: dict[str, Floats] = {}
    for place, member in enumerate(members):
        for name, value in _one(objectives, alpha, int(member), size).items():
            found.setdefault(name, np.zeros(len(members)))[place] = value
    return found


def _one(objectives: Objectives, alpha: Floats, member: int, size: float | None) -> dict[str, float]:
    here = float(alpha[member])
    central = here > 0.0
    step = _step(alpha, member, size)
    # The error of a central difference has even powers of the step only.
    powers = [2.0 * (level + 1) if central else level + 1.0 for level in range(_LEVELS)]
    base = None if central else objectives(alpha)
    table: list[dict[str, float]] = []
    for level in range(_LEVELS):
        h = step / 2.0**level
        above = objectives(_moved(alpha, member, here + h))
        below = base if base is not None else objectives(_moved(alpha, member, here - h))
        width = 2.0 * h if central else h
        table.append({name: (above[name] - below[name]) / width for name in above})
    for power in powers[: _LEVELS - 1]:
        factor = 2.0**power
        table = [
            {name: (factor * finer[name] - coarser[name]) / (factor - 1.0) for name in finer}
            for coarser, finer in pairwise(table)
        ]
    return table[0]


def _step(alpha: Floats, member: int, size: float | None) -> float:
    """The longest step of a difference by one member."""
    step = _STEP * (float(alpha.max(initial=0.0)) if size is None else size) or _STEP
    here = float(alpha[member])
    return min(step, 0.5 * here) if here > 0.0 else step


class DifferenceSteps(NamedTuple):
    """What differences are taken by: places (K,) in the whole design (N + P,), the longest step (K,) of each in its own
    unit, and whether steps are taken to both sides (K,)."""

    places: NDArray[np.intp]
    longest: Floats
    both: NDArray[np.bool_]


def difference_steps(
    case: "Case", design: Floats, members: NDArray[np.intp], values: NDArray[np.intp]
) -> DifferenceSteps:
    """The steps of `differences` by members and of `value_differences` by values, from a design (N + P,)."""
    n, width = case.n_design, ranges(case)
    _, shares = _shares(case, design)
    by_members = [_step(design[:n], int(member), None) for member in members]
    by_values = [_step(shares, int(value), 1.0) * width[value] for value in values]
    both = np.concatenate([design[members] > 0.0, shares[values] > 0.0])
    return DifferenceSteps(np.concatenate([members, n + values]), np.array([*by_members, *by_values]), both)


def changes_peak(peaks: "Sequence[Peak]", steps: DifferenceSteps) -> bool:
    """Whether a step of differences makes another peak decisive than the first one.

    peaks: those that compete, the decisive one first, with gradients by the whole design.
    """
    first = peaks[0]
    for other in peaks[1:]:
        if first.gradient is None or other.gradient is None:
            continue
        gap = first.value - other.value
        nearer = (other.gradient - first.gradient)[steps.places] * (steps.longest if gap >= 0.0 else -steps.longest)
        overtakes = np.where(steps.both | (gap == 0.0), np.abs(nearer), nearer)
        if overtakes.max(initial=0.0) > abs(gap):
            return True
    return False


def _moved(alpha: Floats, member: int, value: float) -> Floats:
    moved = alpha.copy()
    moved[member] = value
    return moved
