"""The scaled KKT residual of a design, found again without the optimiser: from an evaluation of that design alone.

Each objective is a maximum of peaks f_r, so that its generalised gradient is the convex hull of theirs. With g the
gradient of the Lagrangian sum_k w_k sum_r mu_kr f_kr + sum nu_c c + sum lambda_k (A x - b)_k, multipliers mu >= 0 of
sum 1 for each objective k, nu >= 0, lambda >= 0 (free for equalities), w_k = dU/dG_k, and S the largest entry of the
gradient by the highest peaks, the residual is the least t, over all multipliers, with

    |x - clip(x - g / S, lower, upper)| <= t,
    sum w_k mu_kr (max f_k - f_kr) / S + sum nu_c |c_c| / S + sum lambda_k |b - A x|_k / S <= t.

For a given t these are linear inequalities in the multipliers (an entry of g is held only where x is farther than t
from the bound that it points to), so that a linear program decides, and bisection finds the least. With
weighted_min_max the peaks of all objectives, times their weights, are those of one maximum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from benchmarks.forces import whole_forces
from benchmarks.optimum.measure import slopes_of
from mdstopo import Case, Evaluation
from mdstopo.case.model import ReducedResponse, ResponseRow, VolumeRow
from mdstopo.evaluation import Peak
from mdstopo.optimizer.problem import LinearRows

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]

#: smallest residual that is looked for; factor between two that are told apart
SMALLEST, APART = 1e-9, 1.05
#: reductions over time whose peaks compete where the value is bounded from above, and from below
UPPER, LOWER = ("max", "max_abs"), ("min",)
#: by sense of a constraint on a response, the signs with which it is bounded from above
SIGNS = {"limit": (1.0,), "at_least": (-1.0,), "equals": (1.0, -1.0)}


@dataclass(frozen=True)
class Rows:
    """What competes at a design x (n,), as of minimise U, c <= 0.

    peaks: values (R,) less the highest of their own objective, times dU/dG; slopes (R, n); objective (R,): whose they
    are. c (C,), c_slopes (C, n): constraints on responses. slack (m,) = A x - b, A (m, n), equal (m,): volume rows.
    below, above (n,): distances from the bounds.
    """

    peaks: Floats
    slopes: Floats
    objective: NDArray[np.int64]
    c: Floats
    c_slopes: Floats
    slack: Floats
    A: Floats
    equal: Truths
    below: Floats
    above: Floats


class Residual(NamedTuple):
    """scaled: the residual; infinite where no multipliers can be found. objective, constraints, linear: multipliers of
    the rows, those of the objective's of sum 1."""

    scaled: float
    objective: Floats
    constraints: Floats
    linear: Floats


def rows_of(case: Case, design: Floats, found: Evaluation, driven: bool = False) -> Rows:
    """The rows at a design (alpha, with the values of variables behind it), from its evaluation with gradients.

    driven: the motion is prescribed, so that a member's largest force is alpha_i times a constant: then every member of
    a group whose largest force is asked for has its row, not only the few that an evaluation tells of.
    """
    space = case.space
    x = space.reduce(design)
    lower, upper = space.bounds(case.lower, case.upper)
    weights, together = slopes_of(case, found.objectives)
    peaks: list[float] = []
    slopes: list[Floats] = []
    objective: list[int] = []
    for k, (each, weight) in enumerate(zip(case.objectives, weights, strict=True)):
        sign = -1.0 if each.sense == "maximize" else 1.0
        own = _members(case, design, each, found.peaks[each.name]) if driven else found.peaks[each.name]
        own = competing(each, sign, own)
        peaks += [weight * sign * peak.value for peak in own]
        slopes += [weight * sign * space.vjp(gradient_of(peak)) for peak in own]
        objective += [0 if together else k] * len(own)
    owners, values = np.array(objective), np.array(peaks)
    for k in set(objective):
        values[owners == k] -= values[owners == k].max()
    c, c_slopes = _constraints(case, design, found, driven)
    volumes = volume_rows(case)
    slack = volumes.A @ x - volumes.b
    return Rows(values, np.array(slopes), owners, c, c_slopes, slack, volumes.A, volumes.equal, x - lower, upper - x)


def volume_rows(case: Case) -> LinearRows:
    """The volume rows of the optimiser's variables, `at_least` with its signs turned."""
    rows = [row for row in case.constraints if isinstance(row, VolumeRow)]
    own = [case.space.row(row) for row in rows]
    signs = np.array([-1.0 if row.sense == "at_least" else 1.0 for row in rows])
    return LinearRows(
        np.array([a for a, _ in own]).reshape(len(own), case.space.size) * signs[:, None],
        np.array([b for _, b in own]) * signs,
        np.array([row.sense == "equals" for row in rows], dtype=np.bool_),
    )


def _members(case: Case, design: Floats, looked: ReducedResponse, peaks: Sequence[Peak]) -> Sequence[Peak]:
    """A peak for every member of a group in a driven scene; other responses' peaks as they are.

    None is higher than the highest that the evaluation found: the residual is that of the function that it computes.
    """
    name = looked.response.group
    if looked.response.kind != "member_force" or looked.over_time not in UPPER or name is None:
        return peaks
    group = next(each for each in case.design_groups if each.name == name)
    whole = whole_forces(case, design[: case.n_design], group, looked.load_case)
    highest, found = peaks[0].value, []
    for i, force in zip(range(*case.group_slices[name].indices(case.n_design)), whole.tolist(), strict=True):
        gradient = np.zeros(case.space.length)
        gradient[i] = force
        found.append(Peak(float("nan"), min(float(design[i]) * force, highest), gradient))
    return found


def _constraints(case: Case, design: Floats, found: Evaluation, driven: bool) -> tuple[Floats, Floats]:
    """Excesses relative to the bounds and their gradients, a row a peak."""
    c: list[float] = []
    c_slopes: list[Floats] = []
    for i, row in enumerate(case.constraints):
        if not isinstance(row, ResponseRow):
            continue
        scale = abs(row.bound) or 1.0
        for sign in SIGNS[row.sense]:
            peaks = found.constraint_peaks[i]
            for peak in competing(row, sign, _members(case, design, row, peaks) if driven else peaks):
                c.append(sign * (peak.value - row.bound) / scale)
                c_slopes.append(sign * case.space.vjp(gradient_of(peak)) / scale)
    return np.array(c), np.array(c_slopes).reshape(len(c), case.space.size)


def competing(looked: ReducedResponse, sign: float, peaks: Sequence[Peak]) -> Sequence[Peak]:
    """The peaks that bound sign times a response over time from above: all of a maximum, else the value."""
    several = looked.over_time in (UPPER if sign > 0.0 else LOWER)
    last = looked.over_time == "final" and looked.response.kind == "member_force" and sign > 0.0
    return peaks if several or last else peaks[:1]


def gradient_of(peak: Peak) -> Floats:
    """A peak's gradient by the design. Raises ValueError where it was not computed."""
    if peak.gradient is None:
        raise ValueError("the evaluation has no gradients")
    return peak.gradient


def residual(rows: Rows) -> Residual:
    """The residual and the multipliers with which it is least."""
    owners = np.unique(rows.objective)
    highest = [int(np.flatnonzero(rows.objective == k)[np.argmax(rows.peaks[rows.objective == k])]) for k in owners]
    steepest = float(np.abs(rows.slopes[highest].sum(axis=0)).max(initial=0.0)) or 1.0
    # Multipliers of the constraints are scaled by their own gradients, so that the program's numbers are of one size.
    sizes = np.maximum(np.abs(rows.c_slopes).max(axis=1, initial=0.0), 1e-300)
    coarse = np.maximum(np.abs(rows.A).max(axis=1, initial=0.0), 1e-300)
    matrix = np.concatenate([rows.slopes / steepest, rows.c_slopes / sizes[:, None], rows.A / coarse[:, None]]).T
    gaps = np.concatenate(
        [-rows.peaks / steepest, np.abs(rows.c) / sizes, np.where(rows.equal, 0.0, np.abs(rows.slack) / coarse)]
    )
    programs = _Programs(rows, matrix, gaps)
    high, found = 1.0, programs.multipliers(1.0)
    while found is None and high < 1e6:
        high *= 10.0
        found = programs.multipliers(high)
    counts = [len(rows.peaks), len(rows.peaks) + len(rows.c)]
    if found is None:
        none = np.split(np.full(matrix.shape[1], np.nan), counts)
        return Residual(float("inf"), *none)
    low = SMALLEST
    while high / low > APART:
        middle = float(np.sqrt(low * high))
        tried = programs.multipliers(middle)
        if tried is None:
            low = middle
        else:
            high, found = middle, tried
    mu, nu, lam = np.split(found, counts)
    return Residual(high, mu, nu * steepest / sizes, lam * steepest / coarse)


class _Programs:
    """The linear programs of the bisection."""

    def __init__(self, rows: Rows, matrix: Floats, gaps: Floats) -> None:
        self.matrix, self.gaps = matrix, gaps
        self.below, self.above = rows.below, rows.above
        free = np.concatenate([np.zeros(len(rows.peaks) + len(rows.c), dtype=bool), rows.equal])
        self.bounds = [(None, None) if each else (0.0, None) for each in free]
        owners = np.unique(rows.objective)
        self.totals = np.zeros((len(owners), matrix.shape[1]))
        self.totals[:, : len(rows.peaks)] = owners[:, None] == rows.objective

    def multipliers(self, t: float) -> Floats | None:
        """Multipliers that keep the residual at most t; None where there are none."""
        down, up = self.matrix[self.below > t], self.matrix[self.above > t]
        sides = np.concatenate([down, -up, self.gaps[None]]) / t
        answer = linprog(
            np.zeros(self.matrix.shape[1]),
            A_ub=sides,
            b_ub=np.ones(len(sides)),
            A_eq=self.totals,
            b_eq=np.ones(len(self.totals)),
            bounds=self.bounds,
            method="highs",
        )
        return np.asarray(answer.x) if answer.status == 0 else None
