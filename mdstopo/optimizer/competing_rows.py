"""The piece of the optimiser for problems whose rows compete: limits on responses, members, load cases, objectives.

A sequential quadratic program with a bundle. At the iterate x the subproblem is

    minimise   z + sum_j nu_j s_j + d'B d/2   in the trust box, under the linear rows
    subject to m_r(d) <= z,  m_r(d) <= s_j    for every row of the objective, and of constraint j, that is known

with rows from the iterate and from trials near it, accepted or not, each a line or a norm (`bundle`, `conic`), one
slack and one penalty a constraint, and B from the gradients of the Lagrangian (`curvature`). A step has to decrease the
merit U + sum_j nu_j max(0, c_j), which is continuous whatever peaks come and go. Prices follow the multipliers, raised
where a step leaves a violation that another in the box would not (steering: R. H. Byrd, J. Nocedal, R. A. Waltz, 2008).
Where violation resists, the largest one becomes the objective itself (restoration) until limits hold, or until its own
optimality conditions say that nothing near keeps them.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.conic import Program, Solution, solve
from mdstopo.optimizer.curvature import FEW_VARIABLES, KEPT_STEPS, Curvature, learnt
from mdstopo.optimizer.nearest_feasible import repair
from mdstopo.optimizer.problem import Bools, Floats, Ints, LinearRows, largest_of_groups, scale_of
from mdstopo.optimizer.stack import Slopes, Stack, joined

#: what violations cost, in multipliers of their limits: more than one, or the merit would be least where limits are
#: violated, but little more, or it would reject long steps along a curved limit; the least share of the violation that
#: could go which has to go; the factor on penalties until it does, and how often
VIOLATION_COST, STEER, RAISE, RAISES = 1.2, 0.3, 5.0, 8
#: steps that curvature is learnt from where B is a matrix, and where it is that of a smooth objective (elsewhere:
#: `KEPT_STEPS`)
STEPS, SMOOTH_STEPS = 60, 120
#: the least curvature, of the largest gradient entry over the range
FLOOR = 1e-5
#: cosine of two gradients from which on they are taken for those of one peak
MATCH_COSINE = 0.5
#: how much a rejected trial shrinks the box where its rows tell what stood in the way
NULL_STEP_SHRINK = 0.7
#: how far a row may lie below the highest, or from its limit, to compete in the residual, in largest gradient entries
NEAR_ROW = 1e-3
#: a violation below this share of the tolerance is none
NO_VIOLATION = 1e-3
#: bounds of multipliers, in largest gradient entries of the objective, with which the residual's subproblem is solved
#: where it cannot be with higher ones
HIGHEST_MULTIPLIER = 1e6
#: the least share of its penalty that the rows of a violated constraint carry: all of it, but for rounding
AT_PENALTY = 0.9


@dataclass(frozen=True, slots=True)
class Trial:
    """A proposed step: x + d (N,), multipliers of the rows (K,) and of the linear rows (m,), what the model promises of
    every group (J + 1,) there, and d'B d/2; whether the subproblem was solved."""

    x: Floats
    multipliers: Floats
    linear: Floats
    levels: Floats
    curved: float
    solved: bool

    def carried(self, rows: Bundle, constraints: int) -> Floats:
        """The sum of the multipliers of each constraint's rows, (J,)."""
        return np.asarray(np.bincount(rows.group, weights=self.multipliers, minlength=constraints + 1)[1:], dtype=float)

    def violates(self, rows: Bundle, penalty: Floats, tiny: float) -> Bools:
        """(J,) which constraints the model violates by more than `tiny`, as their penalties (J,) are too low.

        The rows of such a constraint carry all of its penalty. Where they carry less, it is high enough to keep the
        constraint, and what is left of the violation is rounding of the subproblem.
        """
        return np.asarray((self.levels[1:] > tiny) & (self.carried(rows, len(penalty)) >= AT_PENALTY * penalty))


@dataclass(frozen=True, slots=True)
class FeasibleSet:
    """The designs that keep bounds (N,) and linear rows; range (N,): the unit of each variable."""

    lower: Floats
    upper: Floats
    linear: LinearRows
    range: Floats

    @property
    def scale(self) -> float:
        """What moves of variables are judged by (`scale_of`)."""
        return scale_of(self.lower, self.upper)


class SecantPairs(NamedTuple):
    """What curvature is learnt from: steps (m, N), the oldest first, and changes (m, N) of the Lagrangian's gradient
    over them; smooth: whether the objective has no peaks (`problem.Problem`); first: the curvature of directions that
    no step has gone along, in ranges, None: that of the last step."""

    steps: Slopes
    changes: Slopes
    smooth: bool = False
    first: float | None = None


class Around(Protocol):
    """The subproblems in a box around one iterate."""

    def solve(self, rows: Bundle, penalty: Floats) -> Trial:
        """Solve the subproblem of these rows, where violations of the constraints cost penalty (J,)."""

    def least_violation(self, rows: Bundle, weight: Floats) -> Trial:
        """The step to the least sum of violations of the constraints, each times weight (J,)."""

    def reach(self, rows: Bundle) -> Floats:
        """By how much rows can change in the box, at most, (K,)."""

    def flat(self, curvature: float) -> "Around":
        """The same subproblems with one curvature for all variables, in ranges, in the place of the learnt one."""


class RowModel(Protocol):
    """What a problem's size decides of the bundle method: how subproblems are solved and steps are measured.

    space: the designs that bounds and linear rows allow.
    """

    space: FeasibleSet

    def around(self, x: Floats, reach: tuple[float, float], pairs: SecantPairs, steepest: float) -> Around:
        """The subproblems at x (N,), in a box of so many ranges and so far; steepest: the largest gradient entry of the
        objective's rows."""

    def residual(self, own: Bundle, x: Floats, penalty: Floats, steepest: float) -> float:
        """The projected KKT residual, as the function `residual` has it."""

    def gradient_change(
        self, bundle: Bundle, new: Bundle, d: Floats, multipliers: Floats, smooth: bool
    ) -> Floats | None:
        """How the Lagrangian's gradient has changed over a step, as the function `gradient_change` has it."""

    def lengths(self, d: Floats) -> tuple[float, float]:
        """The largest change of a variable and the length of a step d (N,), in ranges."""

    def learnt(self, known: Slopes, more: Floats, smooth: bool) -> Slopes:
        """The last steps, or changes, that curvature is learnt from, and one (N,) more; smooth: as of `SecantPairs`."""


class DenseModel:
    """The model of problems whose rows are matrices: everything is computed for all variables."""

    def __init__(self, space: FeasibleSet) -> None:
        self.space = space

    def around(self, x: Floats, reach: tuple[float, float], pairs: SecantPairs, steepest: float) -> Around:
        """The subproblems in a box around x; see `RowModel.around`."""
        space = self.space
        far = np.minimum(reach[1], reach[0] * space.range)
        box = np.maximum(space.lower, x - far), np.minimum(space.upper, x + far)
        return _DenseAround(x, space, box, curvature_of(pairs, space.scale * steepest, space.range))

    def residual(self, own: Bundle, x: Floats, penalty: Floats, steepest: float) -> float:
        """The projected KKT residual at x; see `RowModel.residual`."""
        return residual(own, x, self.space, penalty, steepest)

    def gradient_change(
        self, bundle: Bundle, new: Bundle, d: Floats, multipliers: Floats, smooth: bool
    ) -> Floats | None:
        """How the Lagrangian's gradient has changed over a step, as of `RowModel`."""
        return gradient_change(bundle, new, d, multipliers, smooth)

    def lengths(self, d: Floats) -> tuple[float, float]:
        """The largest entry and the length of a step, as of `RowModel`."""
        scaled = d / self.space.range
        return float(np.abs(scaled).max(initial=0.0)), float(np.sqrt(np.einsum("i,i->", scaled, scaled)))

    def learnt(self, known: Slopes, more: Floats, smooth: bool) -> Slopes:
        """The steps, or changes, that curvature is learnt from, as of `RowModel`.

        Of a smooth objective they are more than it has variables, as far as they may: with as many steps as variables
        the flat directions of a long valley are forgotten before all are known, and it is crept along.
        """
        most = KEPT_STEPS if len(more) > FEW_VARIABLES else SMOOTH_STEPS if smooth else STEPS
        return joined(known, more[None])[-most:]


@dataclass(frozen=True, slots=True)
class _DenseAround:
    """The subproblems around an iterate x in a box (its ends (N,)), with the curvature B."""

    x: Floats
    space: FeasibleSet
    box: tuple[Floats, Floats]
    curvature: Curvature

    def solve(self, rows: Bundle, penalty: Floats) -> Trial:
        return subproblem(rows, self.x, self.space, self.box, penalty, self.curvature)

    def least_violation(self, rows: Bundle, weight: Floats) -> Trial:
        return least_violation(rows, self.x, self.space, self.box, weight)

    def reach(self, rows: Bundle) -> Floats:
        return np.asarray(np.abs(_matrix(rows)) @ (self.box[1] - self.box[0]))

    def flat(self, curvature: float) -> Around:
        flat = Curvature.diagonal_of(np.full(len(self.x), curvature) / self.space.range**2)
        return replace(self, curvature=flat)


def _matrix(rows: Bundle) -> Floats:
    assert not isinstance(rows.slope, Stack)
    return rows.slope


def subproblem(
    bundle: Bundle, x: Floats, space: FeasibleSet, box: tuple[Floats, Floats], penalty: Floats, curvature: Curvature
) -> Trial:
    """Solve the model of the rows in a box around the iterate.

    Constant:
      space: bounds, linear rows and ranges of the designs.
    In:
      bundle: the K rows that are known, seen from x.
      x (N,): the iterate.
      box: the lower and the upper end of the box, designs (N,).
      penalty (J,): what a violation of each constraint costs.
      curvature: B, the matrix of the quadratic term.

    Fixed variables and linear rows without a free one are left out; the trial keeps box and linear rows to rounding.
    In a very small box, rounding of levels that are far apart, or of vectors that hardly change, is more than the rows
    change. Where the subproblem cannot be solved for that reason, only the rows that matter in the box are kept.
    """
    trial = _subproblem_of(bundle, x, space, box, penalty, curvature)
    if trial.solved:
        return trial
    kept, rows = bundle.relevant(np.maximum(box[1] - x, x - box[0]))
    trial = _subproblem_of(rows, x, space, box, penalty, curvature)
    multipliers = np.zeros(len(bundle))
    multipliers[kept] = trial.multipliers
    levels = largest_of_groups(bundle.values_at(trial.x - x), bundle.group, len(penalty) + 1)
    return replace(trial, multipliers=multipliers, levels=levels)


def _subproblem_of(
    bundle: Bundle, x: Floats, space: FeasibleSet, box: tuple[Floats, Floats], penalty: Floats, curvature: Curvature
) -> Trial:
    """Solve the model of the rows of a bundle around x, as `subproblem` has it.

    space: the linear rows; box: the bounds of the next x; penalty: of a violation, by limit; curvature: of the model.
    """
    lower, upper = box[0] - x, box[1] - x
    free = upper > lower
    d, linear = np.zeros(len(x)), np.zeros(len(space.linear))
    multipliers, solved = np.zeros(len(bundle)), True
    if free.any():
        left = LinearRows(space.linear.A[:, free], -space.linear.excess(x), space.linear.equal)
        used = np.abs(left.A).max(axis=1, initial=0.0) > 0.0
        left = LinearRows(left.A[used], left.b[used], left.equal[used])
        (at_lines, lines), (at_norms, norms) = bundle.lines(), bundle.norms()
        program = Program(
            np.minimum(lower[free], 0.0), np.maximum(upper[free], 0.0),
            replace(lines, slope=lines.slope[:, free]),
            replace(norms, slope=norms.slope[:, free], across=norms.across[:, free]),
            penalty, left, curvature.restricted(free),
        )  # fmt: skip
        found: Solution = solve(program)
        solved = found.solved
        d[free] = found.d
        multipliers[at_lines], multipliers[at_norms] = found.lines, found.norms
        linear[used] = found.linear
    trial = repair(np.clip(x + d, box[0], box[1]), box[0], box[1], space.linear)
    d = trial - x
    levels = largest_of_groups(bundle.values_at(d), bundle.group, len(penalty) + 1)
    return Trial(trial, multipliers, linear, levels, 0.5 * float(d @ curvature.times(d)), solved)


def least_violation(bundle: Bundle, x: Floats, space: FeasibleSet, box: tuple[Floats, Floats], weight: Floats) -> Trial:
    """The step to the least sum of violations in the box, times weight (J,); of the rows of constraints alone."""
    only = bundle.subset(bundle.group > 0)
    nothing = Bundle(
        np.zeros((1, 2)), np.zeros((1, len(x))), np.zeros((1, only.across.shape[1])), np.array([np.nan]),
        np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.bool_), np.zeros(1, dtype=np.int64), np.zeros(1),
    )  # fmt: skip
    steepest = float((weight[only.group - 1] * only.steepest).max(initial=0.0))
    flat = Curvature.diagonal_of(np.maximum(1e-6 * steepest, 1e-300) / space.range)
    return subproblem(nothing.joined(only), x, space, box, weight, flat)


def gradient_change(bundle: Bundle, new: Bundle, d: Floats, multipliers: Floats, smooth: bool) -> Floats | None:
    """How the gradient of the Lagrangian has changed over a step d beyond what the rows foresee, (N,), or None.

    Rows of the iterate, as `rows_to_compare` has them, are compared with those of the trial (`new`, seen from there)
    which have nearly the same gradient: the same peak, moved. The only row of a smooth objective is the same however
    much its gradient has turned.
    """
    own, weights = rows_to_compare(bundle, multipliers, smooth)
    slopes, fresh = bundle.subset(own).slopes_at(d), new.slopes_at(np.zeros(len(d)))
    change, matched = np.zeros(len(d)), False
    sizes = np.sqrt((fresh**2).sum(axis=1))
    for k, weight, slope in zip(own.tolist(), weights.tolist(), slopes, strict=True):
        size = float(np.sqrt(slope @ slope))
        same = np.flatnonzero(new.group == bundle.group[k])
        if size * weight == 0.0 or not len(same):
            continue
        cosine = fresh[same] @ slope / np.maximum(size * sizes[same], 1e-300)
        best = int(cosine.argmax())
        if cosine[best] >= MATCH_COSINE or is_only_row(bundle, new, k, smooth):
            change += weight * (fresh[same[best]] - slope)
            matched = True
    return change if matched else None


def rows_to_compare(bundle: Bundle, multipliers: Floats, smooth: bool) -> tuple[Ints, Floats]:
    """The iterate's own rows that tell how the Lagrangian's gradient changes: their places (K,) and their weights (K,).

    These are rows that carry a multiplier, and the only row of a smooth objective in any case. Rows from elsewhere have
    no gradient at the iterate; their multipliers count for the own ones of their group.
    """
    groups = int(bundle.group.max(initial=0)) + 1
    carried = multipliers
    if smooth and _own_objective_rows(bundle).sum() == 1:
        carried = np.where(_own_objective_rows(bundle), 1.0, multipliers)
    own = np.flatnonzero(bundle.own & (carried > 0.0))
    total = np.bincount(bundle.group, weights=multipliers, minlength=groups)
    mine = np.bincount(bundle.group[own], weights=carried[own], minlength=groups)
    group = bundle.group[own]
    return own, carried[own] * total[group] / mine[group]


def is_only_row(bundle: Bundle, new: Bundle, k: int, smooth: bool) -> bool:
    """Whether row k of the iterate is the only one of a smooth objective, and so the same as the trial's only one."""
    only = int(_own_objective_rows(bundle).sum()) == int((new.group == 0).sum()) == 1
    return smooth and bundle.group[k] == 0 and only


def _own_objective_rows(bundle: Bundle) -> Bools:
    """(K,) which rows are the objective's at the iterate itself."""
    found: Bools = bundle.own & (bundle.group == 0)
    return found


def lower_bound(rows: Bundle, trial: Trial, x: Floats, space: FeasibleSet, penalty: Floats) -> float:
    """A value that the merit of the rows' model is nowhere below in the space: that of the dual problem.

    Any multipliers would do: y of sum 1 of the objective's rows, of at most penalty (J,) of each constraint's, and lam
    of linear rows, not negative where these are no equations. Then for every design z

        merit(z) >= sum y_r m_r(z - x) + lam (A z - b),

    and what is on the right is linear once rows are replaced by their tangents. Those of a trial come close to the
    least merit, whatever digits its solver has missed.

    rows (K,), seen from x (N,); trial: a step from there, with multipliers. Minus infinity where these say nothing.
    """
    y = np.maximum(trial.multipliers, 0.0)
    total = np.bincount(rows.group, weights=y, minlength=len(penalty) + 1)
    if not total[0] > 0.0:
        return float("-inf")
    share = np.divide(penalty, total[1:], out=np.ones(len(penalty)), where=total[1:] > penalty)
    y *= np.concatenate([[1.0 / total[0]], share])[rows.group]
    value, gradient = rows.tangent(y, trial.x - x)
    if len(space.linear):
        lam = np.where(space.linear.equal, trial.linear, np.maximum(trial.linear, 0.0))
        value += float(lam @ space.linear.excess(x))
        gradient = gradient + lam @ space.linear.A
    least = np.minimum(gradient * (space.lower - x), gradient * (space.upper - x))
    return value + float(np.einsum("i->", least))


def curvature_of(pairs: SecantPairs, steepest: float, range_: Floats) -> Curvature:
    """B in the variables' own units; it is learnt in ranges.

    pairs: in the variables' own units; steepest: the largest gradient entry of the objective's rows, by the scale of
      the variables; range_ (N,).
    """
    steps, changes = pairs.steps, pairs.changes
    assert isinstance(steps, np.ndarray)
    assert isinstance(changes, np.ndarray)
    found = learnt(steps / range_, changes * range_, FLOOR * steepest, not pairs.smooth, pairs.first)
    return found.scaled(1.0 / range_, 1.0)


def residual(own: Bundle, x: Floats, space: FeasibleSet, penalty: Floats, steepest: float) -> float:
    """The projected KKT residual at x, relative to the largest gradient entry `steepest`, in `FeasibleSet.scale`.

    own: the iterate's rows; penalty (J,): bounds of the constraints' multipliers. The multipliers are those of the
    proximal step, whose curvature is that entry by the scale: they make the residual all but least. Where that step is
    long, rows that do not compete here stop it; so it is tried without them, too, and the smaller residual told. It is
    the largest of: what a step along the Lagrangian's negative gradient over `steepest` moves within the bounds;
    the gaps of objective rows, the values of constraint rows and the slack of linear rows that carry a multiplier.
    """
    return multipliers(own, x, space, penalty, steepest)[0]


def multipliers(
    own: Bundle, x: Floats, space: FeasibleSet, penalty: Floats, steepest: float
) -> tuple[float, Floats, Floats]:
    """The residual as `residual` has it, with its multipliers: of the iterate's rows (K,), of the linear rows (m,).

    Where no variable changes anything (`steepest` is 0) the first row has all of them.
    """
    if steepest == 0.0:
        return 0.0, np.eye(1, len(own))[0], np.zeros(len(space.linear.A))
    lines = own.with_tangents(own.norm)
    found = _multipliers_of(lines, x, space, penalty, steepest)
    near = _gaps(lines) <= NEAR_ROW * steepest * space.scale
    if near.all() or not (near & (lines.group == 0)).any():
        return found
    among = _multipliers_of(lines.subset(near), x, space, penalty, steepest)
    if not among[0] < found[0]:
        return found
    of_all = np.zeros(len(lines))
    of_all[near] = among[1]
    return among[0], of_all, among[2]


def _multipliers_of(
    lines: Bundle, x: Floats, space: FeasibleSet, penalty: Floats, steepest: float
) -> tuple[float, Floats, Floats]:
    """The multipliers of the proximal step of these lines, and the residual with them, as `multipliers` has them."""
    flat, whole = Curvature.diagonal_of(np.full(len(x), steepest / space.scale)), (space.lower, space.upper)
    trial = subproblem(lines, x, space, whole, penalty, flat)
    if not trial.solved:  # as where limits contradict each other, and penalties have risen by many powers of ten
        trial = subproblem(lines, x, space, whole, np.minimum(penalty, HIGHEST_MULTIPLIER * steepest), flat)
    found = residual_of(lines, trial.multipliers, trial.linear, x, space, steepest)
    return found, trial.multipliers, trial.linear


def _gaps(lines: Bundle) -> Floats:
    """How far the lines (K,) are from carrying a multiplier: below the highest of the objective, or from the limit."""
    values = lines.values()
    objective = lines.group == 0
    return np.where(objective, values.max(initial=-np.inf, where=objective) - values, np.abs(values))


def residual_of(
    lines: Bundle, multipliers: Floats, linear: Floats, x: Floats, space: FeasibleSet, steepest: float
) -> float:
    """The KKT residual with given multipliers; `residual` says what it is.

    Constant:
      space: bounds and linear rows of the designs.
    In:
      lines: the iterate's K rows, as lines.
      multipliers (K,): of these rows.
      linear (m,): multipliers of the linear rows.
      x (N,): the iterate.
      steepest: the largest gradient entry, which the residual is relative to.
    """
    scale = space.scale
    gradient = (multipliers @ _matrix(lines) + linear @ space.linear.A) / (steepest / scale)
    moved = float(np.abs(x - np.clip(x - gradient, space.lower, space.upper)).max(initial=0.0)) / scale
    gaps = multipliers * _gaps(lines)
    slack = np.where(space.linear.equal, 0.0, np.abs(linear * space.linear.excess(x)))
    missing = abs(1.0 - float(multipliers[lines.group == 0].sum()))
    return max(moved, float(gaps.sum() + slack.sum()) / (scale * steepest), missing)
