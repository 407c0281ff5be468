"""Exact optima of driven linkages by a cone solver.

The motion is prescribed, so that a joint's force is r(t) = r0(t) + R(t) alpha and a member's alpha_i f_i(t). r0 and R
are sampled from motions simulated with no members and with one member at a time, f from the kinematics alone; no
objective, gradient or optimiser of mdstopo is used. The least largest |r| under limits on others and volume rows is

    minimise z   subject to   |r0(t) + R(t) alpha| <= z,   |q0(t) + Q(t) alpha| <= limit,   volume rows,   bounds

a second-order cone program in (alpha, z). Times are added where the last solution has peaks, between the samples too,
until no peak exceeds what the program allowed. Where the limits cannot be kept, each becomes limit (1 + s), and s, the
least violation, is minimised.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from benchmarks.forces import whole_forces
from mdstopo import Case, simulate
from mdstopo.case.model import Response, ResponseRow, VolumeRow
from mdstopo.general.driver.general_steps import GeneralSteps

Floats = NDArray[np.float64]

#: times that are sampled; how much of a peak's neighbourhood is looked at again; relative excess that is left
SAMPLES, BETWEEN, LEFT = 3001, 20, 1e-7
#: rounds of adding times
ROUNDS = 30


@dataclass
class Force:
    """One affine vector over time. |constant(t) + slopes(t) alpha| is what is bounded; times: where, so far."""

    grid: Floats
    constant: Floats  # (T, d)
    slopes: Floats  # (T, d, N)
    times: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        whole = np.concatenate([self.constant[:, :, None], self.slopes], axis=2)
        self._spline = CubicSpline(self.grid, whole, axis=0)

    def at(self, time: float) -> tuple[Floats, Floats]:
        """constant (d,) and slopes (d, N) at a time."""
        whole = np.asarray(self._spline(time))
        return whole[:, 0], whole[:, 1:]

    def peaks(self, alpha: Floats) -> tuple[Floats, Floats]:
        """Times and values of the local maxima of |r|, looked for between the samples too; highest first."""
        size = np.linalg.norm(self.constant + self.slopes @ alpha, axis=1)
        padded = np.concatenate([[-np.inf], size, [-np.inf]])
        top = np.flatnonzero((size >= padded[:-2]) & (size >= padded[2:]))
        top = top[np.argsort(-size[top])][:40]
        design = np.concatenate([[1.0], alpha])
        times, values = [], []
        for i in top.tolist():
            near = np.linspace(self.grid[max(i - 1, 0)], self.grid[min(i + 1, len(size) - 1)], 2 * BETWEEN + 1)
            close = np.linalg.norm(np.asarray(self._spline(near)) @ design, axis=1)
            best = int(np.argmax(close))
            times.append(float(near[best]))
            values.append(float(close[best]))
        found = np.array([times, values])
        ordered = found[:, np.argsort(-found[1])]
        return ordered[0], ordered[1]


@dataclass(frozen=True)
class Exact:
    """A solved cone program. value: of the objective, None where the limits cannot be kept; violation: the least
    relative excess over the limits, 0 where they can be kept; alpha (N,): the design."""

    value: float | None
    violation: float
    alpha: Floats


def exact(case: Case) -> Exact:
    """The optimum of a driven linkage. Needs cvxpy and CLARABEL. Raises ValueError for what is not affine."""
    motions = {each.name: _Samples(case, each.name) for each in case.load_cases}
    objectives = [motions[each.load_case].forces(each.response, each.over_time) for each in case.objectives]
    rows = [row for row in case.constraints if isinstance(row, ResponseRow)]
    if any(row.sense != "limit" for row in rows):
        raise ValueError("only upper limits keep the set of designs convex")
    limits = [(motions[row.load_case].forces(row.response, row.over_time), row.bound) for row in rows]
    least = _solve(case, [], limits) if limits else None
    if least is not None and least[1] > 1e-6:
        return Exact(None, float(least[1]), least[0])
    alpha, value = _solve(case, objectives, limits)
    return Exact(float(value), 0.0, alpha)


def _solve(
    case: Case, objectives: Sequence[Sequence[Force]], limits: Sequence[tuple[Sequence[Force], float]]
) -> tuple[Floats, float]:
    """Design and least value; without objectives the least relative excess over the limits, negative below them."""
    alpha = np.clip(case.initial, case.lower, case.upper)
    forces = [each for group in (*objectives, *(group for group, _ in limits)) for each in group]
    for force in forces:
        force.times[:] = force.peaks(alpha)[0][:6].tolist()
    for _ in range(ROUNDS):
        alpha, value, heights, excess = _program(case, objectives, limits)
        worst = 0.0
        for group, bound in [*zip(objectives, heights, strict=True)] + [(g, b * (1.0 + excess)) for g, b in limits]:
            for force in group:
                times, values = force.peaks(alpha)
                over = (values - bound) / abs(bound)
                worst = max(worst, float(over.max()))
                force.times += times[over > 0.1 * LEFT][:6].tolist()
        if worst <= LEFT:
            return alpha, value
    raise ValueError(f"peaks still exceed what the program allowed by {worst:.1e}")


def _program(
    case: Case, objectives: Sequence[Sequence[Force]], limits: Sequence[tuple[Sequence[Force], float]]
) -> tuple[Floats, float, Floats, float]:
    """One cone program: design, value, bound of each objective, relative excess."""
    import cvxpy as cp

    scale = (
        1.0
        if not objectives
        else max(float(f.peaks(np.asarray(case.initial))[1][0]) for group in objectives for f in group)
    )
    x, heights, excess = cp.Variable(case.n_design), cp.Variable(max(len(objectives), 1)), cp.Variable()
    rows: list[Any] = [x >= case.lower, x <= case.upper]
    for row in case.constraints:
        if isinstance(row, VolumeRow):
            total = row.coefficients @ x / (row.bound or 1.0)
            rows.append({"limit": total <= 1.0, "at_least": total >= 1.0, "equals": total == 1.0}[row.sense])
    for k, group in enumerate(objectives):
        for force in group:
            for constant, slopes in map(force.at, force.times):
                rows.append(cp.norm(constant / scale + (slopes / scale) @ x) <= heights[k])
    for group, bound in limits:
        for force in group:
            for constant, slopes in map(force.at, force.times):
                rows.append(cp.norm(constant / bound + (slopes / bound) @ x) <= 1.0 + excess)
    if objectives:
        rows.append(excess == 0.0)
    program = cp.Problem(cp.Minimize(_combined(cp, case, heights) if objectives else excess), rows)
    program.solve(solver=cp.CLARABEL, tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
    if program.status not in ("optimal", "optimal_inaccurate"):
        raise ValueError(f"the cone solver ended with {program.status}")
    value = float(program.value) * (scale if objectives else 1.0)
    solved = np.zeros(0) if not objectives else np.asarray(heights.value) * scale
    return np.asarray(x.value), value, solved, float(excess.value)


def _combined(cp: Any, case: Case, heights: Any) -> Any:
    """What is minimised of the objectives' bounds."""
    if len(case.objectives) == 1:
        return heights[0]
    combine = case.combine
    assert combine is not None
    if combine.normalize:
        raise ValueError("normalised objectives are no data of the program")
    weights = np.array([combine.weights[each.name] for each in case.objectives])
    weights = weights / weights.sum()
    if combine.method == "weighted_min_max":
        return cp.max(cp.multiply(weights, heights))
    if combine.method == "weighted_sum":
        return weights @ heights
    raise ValueError(f"{combine.method} is no convex combination")


class _Samples:
    """Reactions and member forces of one load case at many times, as functions of alpha."""

    def __init__(self, case: Case, load_case: str) -> None:
        self.case, self.load_case = case, load_case
        first = simulate(case, np.zeros(case.n_design), load_case)
        self.grid = np.linspace(first.t[0], first.t[-1], SAMPLES)
        self.states = first.at(self.grid)
        bare = self._reactions(np.zeros(case.n_design), load_case)
        each = [self._reactions(unit, load_case) for unit in np.eye(case.n_design)]
        self._bare = bare
        self._slopes = {name: np.stack([one[name] - bare[name] for one in each], axis=2) for name in bare}

    def forces(self, response: Response, over_time: str) -> list[Force]:
        """What a response bounds over time."""
        if over_time not in ("max", "max_abs"):
            raise ValueError(f"{over_time} of a force is not among what the program bounds")
        if response.kind == "member_force":
            return self._member_forces(str(response.group))
        part = {"joint_force": slice(0, 2), "joint_moment": slice(2, 3)}[response.kind]
        name = str(response.joint)
        return [Force(self.grid, self._bare[name][:, part], self._slopes[name][:, part])]

    def _reactions(self, alpha: Floats, load_case: str) -> dict[str, Floats]:
        motion = simulate(self.case, alpha, load_case)
        if not motion.status.ok or motion.t[-1] != self.grid[-1]:
            raise ValueError(f"the linkage cannot be moved: {motion.message or motion.status.value}")
        states = motion.at(self.grid)
        moved = np.abs(states.q - self.states.q).max() / max(1.0, float(np.abs(self.states.q).max()))
        if moved > 1e-6:
            raise ValueError(f"the motion depends on alpha: {moved:.1e}")
        assert isinstance(motion.steps, GeneralSteps)
        out, lam = motion.steps.balanced(self.grid)
        return {name: np.asarray(values) for name, values in motion.steps.reactions(out[0], lam).items()}

    def _member_forces(self, name: str) -> list[Force]:
        """alpha_i times the largest |f_i| over time, one number a member."""
        case = self.case
        group = next(each for each in case.design_groups if each.name == name)
        whole = whole_forces(case, np.zeros(case.n_design), group, self.load_case)
        out = []
        for i, force in zip(range(*case.group_slices[name].indices(case.n_design)), whole, strict=True):
            slopes = np.zeros((2, 1, case.n_design))
            slopes[:, 0, i] = force
            out.append(Force(self.grid[[0, -1]], np.zeros((2, 1)), slopes))
        return out
