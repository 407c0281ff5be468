"""A case as an optimisation problem: what `Gsao` minimises when it designs a structure.

U is the objective, negated where it is to be maximised, or a scalarisation of several. Where an objective is the worst
of several peaks (a maximum that is minimised, a minimum that is maximised) every competing peak is a row of its own
(bound formulation); elsewhere the one value is.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from mdstopo.case.design.exchange import Side, exchange_ends
from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import Case, MemberGroup, Objective, ReducedResponse, ResponseRow, VolumeRow
from mdstopo.case.objects.design_space import DesignSpace
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.case.text.errors import CaseError
from mdstopo.evaluation import USUAL, Evaluation, Peak, Rows
from mdstopo.optimizer.problem import Floats, Ints, LinearRows, Sample
from mdstopo.optimizer.scalarisation import MOST_ROWS_OF_U, NotPositiveError, Part, Scalarisation
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES
from mdstopo.scene.moving_volumes import moving_volumes
from mdstopo.scene.refusals import refusals
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.sensitivity.candidate_pass import CandidatePass

#: by sense of a constraint on a response, the signs with which its excess must not be positive
SIGNS = {"limit": (1.0,), "at_least": (-1.0,), "equals": (1.0, -1.0)}
#: how far below the highest a peak may be to be a row, and how many of one response; of many members' forces more,
#: because a design that lowers the largest raises others that are far below it
PEAKS_OF_RESPONSE, PEAKS_OF_MEMBERS = (0.3, 12), (0.6, 60)
#: where the last row told is within this share of the largest, so many times as many are asked for, up to so many: in a
#: good design most members share the largest force, and a step that knows nothing of one of them raises it; as long as
#: their gradients have room, in numbers
TIED, GROWTH, MOST_ROWS, ROOM_FOR_GRADIENTS = 0.1, 4, 960, 2e7


class DesignEvaluator(Protocol):
    """What the problem asks of `engine.Evaluator`, where each function is described."""

    case: Case

    def evaluate(
        self, alpha: Floats, gradient: bool = True, sensitivity: str | None = None, rows: Rows = USUAL
    ) -> Evaluation: ...
    def with_objectives(self, objectives: Sequence[str]) -> "DesignEvaluator": ...
    def pricing_states(self, weights: Mapping[str, Sequence[float]]) -> Any: ...
    def candidates_of(self, group: MemberGroup, count: int | None = None) -> "CandidatePass[Any]": ...


class DesignProblem:
    """The `Problem` of a case: volume rows, constraints on responses, and one objective or a scalarisation of several.

    scalarisation: of all objectives of the case; those it leaves out are neither simulated nor differentiated. None:
    the case's only objective. Raises CaseError where the case asks for what is not computed.
    """

    def __init__(self, evaluator: DesignEvaluator, scalarisation: Scalarisation | None = None) -> None:
        case = evaluator.case
        refused = refusals(case)
        if refused:
            raise CaseError(refused, str(case.path or case.name))
        if scalarisation is None and len(case.objectives) != 1:
            raise ValueError("several objectives need a scalarisation")
        self.scalarisation = scalarisation
        one = scalarisation is None and case.uncertainty is None
        #: how many of the highest rows the separable approximation takes; None: as the optimiser's settings say
        self.competitors: int | None = None if one else MOST_ROWS_OF_U
        active = [0] if scalarisation is None else scalarisation.active
        self._count = len(case.objectives)
        self._places = active
        self._objectives = [case.objectives[i] for i in active]
        self._signs = [sign_of(objective) for objective in self._objectives]
        self._evaluator = evaluator.with_objectives([objective.name for objective in self._objectives])
        self._factor: Floats | None = None
        #: what x stands for
        self.space = case.space
        #: how many of the last x are values of variables, of which all parts of their range are alike
        self.even = self.space.length - self.space.n_alpha
        self.initial: Floats = np.array(self.space.reduce(case.start))
        self.lower: Floats
        self.upper: Floats
        self.lower, self.upper = self.space.bounds(case.lower, case.upper)
        self._responses = [(i, row) for i, row in enumerate(case.constraints) if isinstance(row, ResponseRow)]
        #: sums of lengths that vary, and what bounds them
        moving = moving_volumes(case)
        self._moving = [(volume, case.constraints[i]) for i, volume in moving.items()]
        #: whether rows compete from the start: limits on responses, objectives that are no energy, parameters of laws
        self.competes = (
            bool(self._responses)
            or bool(self._moving)
            or self.even > 0
            or any(not kind_of(objective.response).is_energy for objective in self._objectives)
        )
        #: whether U has no peaks, of which others could rise that were not told
        self.smooth = case.uncertainty is None and all(map(_is_smooth, self._objectives))
        #: no U is below it
        self.objective_bound = lower_bound_of(self._objectives[0]) if one else -np.inf
        responses: list[ReducedResponse] = [*self._objectives, *(row for _, row in self._responses)]
        members = any(kind_of(each.response).of_members for each in responses)
        # of very many variables all rows are lines: what makes norms of them costs as much as the rows themselves
        cones = len(self.initial) < VERY_MANY_VARIABLES
        few, many = Rows(*PEAKS_OF_RESPONSE, cones=cones), Rows(*PEAKS_OF_MEMBERS, cones=cones)
        #: the peaks that an evaluation is asked for
        self.rows = (many if members else few) if self.competes else USUAL
        #: how many of them the last design needed: the next evaluation begins with these, and tells the same as if not
        self._enough: int | None = None
        fixed = [row for i, row in enumerate(case.constraints) if isinstance(row, VolumeRow) and i not in moving]
        self.linear = _linear_rows(fixed, self.space)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """The rows of U at x; a design that cannot be computed comes back with its status."""
        return self.sample_of(self.evaluation(x, gradient), gradient, x)

    def evaluation(self, x: Floats, gradient: bool = True) -> Evaluation:
        """What the engine finds at x, with as many rows as compete."""
        return self._with_all_that_compete(self._design(x), gradient)

    def pricing_states(self, evaluation: Evaluation, rows: Floats) -> Any:
        """The pricing states of a weighted sum of the rows of U and of constraints on responses, with factors (R +
        C,), at the last evaluation.

        Where no parameter of a law varies, nor a point or a defined name.
        """
        of_limits = {f"constraints[{i}]": evaluation.constraint_peaks[i] for i, _ in self._responses}
        all_peaks = {**evaluation.peaks, **of_limits}
        places = {name: len(found) for name, found in all_peaks.items()}
        unit = iter(np.eye(sum(places.values())))
        marked = {
            name: tuple(Peak(peak.time, peak.value, next(unit)) for peak in found) for name, found in all_peaks.items()
        }
        # the same rows with one number a peak in the place of its gradient: how a row is made of peaks
        other = copy(self)
        other.space = DesignSpace(sum(places.values()), None, ())
        other.initial = np.zeros(other.space.size)
        other._factor = None
        peaks = {name: marked[name] for name in evaluation.peaks}
        limits = {i: marked[f"constraints[{i}]"] for i, _ in self._responses}
        sample = other.sample_of(evaluation._replace(peaks=peaks, constraint_peaks=limits))
        weights = rows[: len(sample.rows)] @ sample.gradients
        if len(rows) > len(sample.rows):
            weights = weights + rows[len(sample.rows) :] @ sample.constraint_gradients
        ends = np.cumsum(list(places.values()))
        parts = zip(places, np.split(weights, ends[:-1]), strict=True)
        return self._evaluator.pricing_states({name: part.tolist() for name, part in parts})

    def candidates_of(self, group: MemberGroup, count: int | None = None) -> "CandidatePass[Any]":
        """The candidates of a priced group, by the kernels that the pricing states are of; see
        `Evaluator.candidates_of`."""
        return self._evaluator.candidates_of(group, count)

    def sample_of(self, evaluation: Evaluation, gradient: bool = True, x: Floats | None = None) -> Sample:
        """The rows of U of an evaluation; x: of the design, where sums of lengths vary with it."""
        info = {name: np.full(self._count, np.nan) for name in ("objectives", "peak_time")}
        for place, objective in zip(self._places, self._objectives, strict=True):
            info["objectives"][place] = evaluation.objectives[objective.name]
            info["peak_time"][place] = evaluation.peak_times[objective.name]
        if self._responses or self._moving:
            info["constraints"] = evaluation.constraints
        if not evaluation.status.usable:
            return Sample(np.inf, status=evaluation.status, message=evaluation.message, info=info)
        parts = [self._part(o, s, evaluation) for o, s in zip(self._objectives, self._signs, strict=True)]
        limits, slopes, groups, own_cones = self._limits(evaluation, x)
        cones = Cones.none()
        if self.scalarisation is None:
            rows, gradients = parts[0]
            cones = self._cones(self._objectives[0], self._signs[0], evaluation)
        else:
            try:
                rows, gradients = self.scalarisation.rows(parts)
            except NotPositiveError as error:
                name = self._objectives[error.args[0]].name
                message = f"objective {name}, which {self.scalarisation.method} needs to be positive"
                return Sample(np.inf, status=Status.NOT_POSITIVE, message=message, info=info)
            if len(self.scalarisation.planes):
                own, of_plane, own_slopes = self.scalarisation.limits(parts)
                groups = np.concatenate([groups, groups.max(initial=-1) + 1 + of_plane])
                limits = np.concatenate([limits, own])
                slopes = np.concatenate(
                    [slopes.reshape(-1, len(self.initial)), own_slopes.reshape(-1, len(self.initial))]
                )
                own_cones = own_cones.extended(len(own))
        if not gradient:
            return Sample(float(rows[0]), rows, constraint_rows=limits, constraint_groups=groups, info=info)
        return Sample(float(rows[0]), rows, gradients, limits, slopes, groups, *cones, *own_cones, info=info)

    def _with_all_that_compete(self, design: Floats, gradient: bool) -> Evaluation:
        """An evaluation with as many rows as compete: more than usual where those are cut off among the largest.

        It is begun with as many as the last design needed, since the next one mostly needs as many. What is told is the
        same whatever was evaluated before: where fewer would have been enough, these are asked for.
        """
        few, room = self.rows.most, min(MOST_ROWS, ROOM_FOR_GRADIENTS / len(self.initial))
        if not gradient or few is None:
            return self._evaluator.evaluate(design, gradient, rows=self.rows)

        def evaluated(most: int) -> Evaluation:
            return self._evaluator.evaluate(design, gradient, rows=self.rows._replace(most=most))

        most = self._enough or few
        evaluation = evaluated(most)
        needed = few
        while needed < most and _is_cut_off(evaluation, needed):
            needed *= GROWTH
        if needed < most:
            most = needed
            evaluation = evaluated(most)
        while _is_cut_off(evaluation, most) and GROWTH * most <= room:
            most *= GROWTH
            evaluation = evaluated(most)
        self._enough = most
        return evaluation

    def _cones(self, objective: Objective, sign: float, evaluation: Evaluation) -> "Cones":
        """The vectors whose norms are the rows of the only objective, as cones."""
        if not (sign > 0.0 and competes(objective, sign)) or evaluation.all_compete:
            return Cones.none()
        return Cones.of([(peak, 1.0, 0.0) for peak in evaluation.peaks[objective.name]], self._pull)

    def softened(self, share: float) -> "DesignProblem":
        """The same problem with members that have only a share of their strength: alpha^mu f, times the share."""
        other = copy(self)
        case = self._evaluator.case
        other._factor = np.concatenate([share ** (1.0 / case.power), np.ones(case.space.length - case.n_design)])
        return other

    def exchange_ends(self, x: Floats, side: Side, rng: np.random.Generator) -> Floats:
        """The design x (n,) with the members' ends on one side exchanged; variables keep their values."""
        design = self.space.expand(x)
        groups = self._evaluator.case.design_groups
        n = self.space.n_alpha
        other = np.concatenate([exchange_ends(groups, design[:n], side, rng), design[n:]])
        return np.asarray(self.space.reduce(other))

    def _design(self, x: Floats) -> Floats:
        design = self.space.expand(x)
        return design if self._factor is None else design * self._factor

    def _pull(self, gradient: Floats) -> Floats:
        return self.space.vjp(gradient if self._factor is None else gradient * self._factor)

    def _part(self, objective: Objective, sign: float, evaluation: Evaluation) -> Part:
        peaks = evaluation.peaks[objective.name]
        chosen = peaks if evaluation.all_compete or competes(objective, sign) else peaks[:1]
        values = sign * np.array([peak.value for peak in chosen])
        slopes = [_signed(sign, self._pull(peak.gradient)) for peak in chosen if peak.gradient is not None]
        if len(slopes) == 1:  # of very many members a copy takes as long as a few steps of the motion
            return values, slopes[0][None]
        return values, np.array(slopes).reshape(len(slopes), len(self.initial))

    def _limits(self, evaluation: Evaluation, x: Floats | None) -> tuple[Floats, Floats, Ints, "Cones"]:
        """Rows, gradients, groups and cones of constraints on responses, feasible where <= 0, relative to their bounds.

        Every competing peak is a row (bound formulation); an equality makes two groups.
        """
        rows: list[float] = []
        slopes: list[tuple[Floats, float, float]] = []
        groups: list[int] = []
        shapes: list[tuple[Peak, float, float]] = []
        for i, row in self._responses:
            peaks = evaluation.constraint_peaks[i]
            scale = abs(row.bound) if row.bound != 0.0 else 1.0
            for sign in SIGNS[row.sense]:
                compete = evaluation.all_compete or competes(row, sign)
                group = groups[-1] + 1 if groups else 0
                for peak in peaks if compete else peaks[:1]:
                    groups.append(group)
                    round_ = sign > 0.0 and compete and not evaluation.all_compete
                    shapes.append((peak, 1.0 / scale if round_ else np.nan, row.bound / scale))
                    rows.append(sign * (peak.value - row.bound) / scale)
                    if peak.gradient is not None:
                        slopes.append((peak.gradient, sign, scale))
        matrix = np.empty((len(slopes), len(self.initial)))
        for slope, (gradient, sign, scale) in zip(matrix, slopes, strict=True):
            np.divide(np.multiply(self._pull(gradient), sign, out=slope), scale, out=slope)
        cones = Cones.of(shapes, self._pull)
        if not self._moving:
            return np.array(rows), matrix, np.array(groups, dtype=np.int64), cones
        sums, more = self._volumes(x)
        first = groups[-1] + 1 if groups else 0
        groups += range(first, first + len(sums))
        matrix = np.concatenate([matrix, more]) if len(matrix) == len(rows) else matrix
        return np.concatenate([rows, sums]), matrix, np.array(groups, dtype=np.int64), cones.extended(len(sums))

    def _volumes(self, x: Floats | None) -> tuple[Floats, Floats]:
        """Sums of lengths that vary as rows of `_limits`, of the design as it is, not as softened."""
        assert x is not None
        design = self.space.expand(x)
        rows: list[float] = []
        slopes: list[Floats] = []
        for volume, row in self._moving:
            spent, slope = volume.at(design)
            scale = abs(row.bound) if row.bound != 0.0 else 1.0
            for sign in SIGNS[row.sense]:
                rows.append(sign * (spent - row.bound) / scale)
                slopes.append(sign / scale * self.space.vjp(slope))
        return np.array(rows), np.array(slopes)


class Cones(NamedTuple):
    """What the optimiser has to know of rows that are norms of vectors: `offset` (R,) and `across` (R, N); see
    `problem.Sample`."""

    offset: Floats
    across: Floats

    @classmethod
    def none(cls) -> "Cones":
        """Cones for rows of which none is the norm of a vector."""
        return cls(np.zeros(0), np.zeros((0, 0)))

    @classmethod
    def of(cls, rows: Sequence[tuple[Peak, float, float]], pull: Callable[[Floats], Floats]) -> "Cones":
        """Cones of rows (peak, scale, offset), each scale |w| - offset; scale NaN where a row is no norm."""
        shaped = [peak.gradient is not None and peak.shape != "plain" and scale == scale for peak, scale, _ in rows]
        if not any(shaped):
            return cls.none()
        offset = np.array([c if is_norm else np.nan for is_norm, (_, _, c) in zip(shaped, rows, strict=True)])
        found = [
            scale * pull(peak.across) if is_norm and peak.across is not None else None
            for is_norm, (peak, scale, _) in zip(shaped, rows, strict=True)
        ]
        first = next(peak.gradient for peak, _, _ in rows if peak.gradient is not None)
        nothing = np.zeros(len(pull(first)))
        return cls(offset, np.array([nothing if each is None else each for each in found]))

    def extended(self, more: int) -> "Cones":
        """These cones and so many more rows that are no norms."""
        if not len(self.offset):
            return self
        width = self.across.shape[1]
        return Cones(
            np.concatenate([self.offset, np.full(more, np.nan)]), np.concatenate([self.across, np.zeros((more, width))])
        )


def _is_cut_off(evaluation: Evaluation, most: int) -> bool:
    """Whether a response or a constraint has so many peaks, of which the last is still near the largest."""
    if evaluation.all_compete or not evaluation.status.usable:
        return False
    told = [*evaluation.peaks.values(), *evaluation.constraint_peaks.values()]
    return any(
        len(peaks) >= most and abs(peaks[most - 1].value - peaks[0].value) <= TIED * abs(peaks[0].value)
        for peaks in told
    )


def _signed(sign: float, slope: Floats) -> Floats:
    return slope if sign > 0.0 else -slope


def sign_of(objective: Objective) -> float:
    """-1 where an objective is to be maximised, else 1."""
    return -1.0 if objective.sense == "maximize" else 1.0


def lower_bound_of(objective: Objective) -> float:
    """What an objective cannot be below, with the sign with which it is minimised: 0 of a length, a magnitude or a mean
    square, else -inf."""
    response = objective.response
    is_length = kind_of(response).never_negative or response.component == "norm"
    positive = is_length or REDUCTIONS[objective.over_time].ignores_sign
    return 0.0 if positive and sign_of(objective) > 0.0 else -np.inf


def competes(reduced: ReducedResponse, sign: float) -> bool:
    """Whether every competing peak of an objective or a constraint is a lower bound of sign times its value."""
    reduction = REDUCTIONS[reduced.over_time]
    if reduction.at_end and kind_of(reduced.response).of_members:
        return sign > 0.0  # members compete at the end, too
    return reduction.is_largest if sign > 0.0 else reduction.is_smallest


def _is_smooth(objective: Objective) -> bool:
    """Whether an objective is a smooth function of the design: an integral over time, or the end of one response."""
    return not REDUCTIONS[objective.over_time].signs and not competes(objective, 1.0)


def _linear_rows(rows: list[VolumeRow], space: DesignSpace) -> LinearRows:
    """Volume rows (Eq. 14) of x, `at least` with its signs turned."""
    signs = np.array([-1.0 if row.sense == "at_least" else 1.0 for row in rows])
    own = [space.row(row) for row in rows]
    matrix = np.array([coefficients for coefficients, _ in own]).reshape(len(rows), space.size)
    return LinearRows(
        matrix * signs[:, None],
        np.array([bound for _, bound in own]) * signs,
        np.array([row.sense == "equals" for row in rows], dtype=np.bool_),
    )
