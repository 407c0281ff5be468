"""A case as an optimisation problem: what `Gsao` minimises when it designs a structure.

U is the objective, negated where it is to be maximised. Where U is the worst of several peaks (a maximum that is
minimised, a minimum that is maximised) every competing peak is a row of its own (bound formulation); elsewhere the one
value is.
"""

import numpy as np

from mdstopo.case.errors import CaseError
from mdstopo.case.model import ResponseRow, VolumeRow
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Evaluation
from mdstopo.optimizer.problem import Floats, LinearRows, Sample
from mdstopo.scene.refusals import refusals

#: reductions whose competing peaks bound U from above, by sense
_COMPETING = {("max", "minimize"), ("max_abs", "minimize"), ("min", "maximize")}
#: by sense of a constraint on a response, the signs with which its excess must not be positive
SIGNS = {"limit": (1.0,), "at_least": (-1.0,), "equals": (1.0, -1.0)}
#: peaks of one constraint that are rows of their own
COMPETITORS = 4


class StructureProblem:
    """The `Problem` of a case with one objective, volume rows, and constraints on responses.

    Raises CaseError where the case asks for an optimisation that is not there yet.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        case = evaluator.case
        refused = refusals(case, optimizing=True)
        if refused:
            raise CaseError(refused, str(case.path or case.name))
        self._evaluator = evaluator
        self._objective = case.objectives[0]
        self._sign = -1.0 if self._objective.sense == "maximize" else 1.0
        self._competing = (self._objective.over_time, self._objective.sense) in _COMPETING
        self.initial: Floats = np.array(case.initial)
        self.lower: Floats = np.array(case.lower)
        self.upper: Floats = np.array(case.upper)
        self._responses = [(i, row) for i, row in enumerate(case.constraints) if isinstance(row, ResponseRow)]
        self.linear = _linear_rows([row for row in case.constraints if isinstance(row, VolumeRow)], case.n_design)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """The rows of U at a design; a design that cannot be computed comes back with its status."""
        evaluation = self._evaluator.evaluate(x, gradient)
        name = self._objective.name
        info = {
            "objectives": np.array([evaluation.objectives[name]]),
            "peak_time": np.array([evaluation.peak_times[name]]),
        }
        if self._responses:
            info["constraints"] = evaluation.constraints
        if not evaluation.status.ok:
            return Sample(np.inf, status=evaluation.status, message=evaluation.message, info=info)
        peaks = evaluation.peaks[name] if self._competing else evaluation.peaks[name][:1]
        rows = self._sign * np.array([peak.value for peak in peaks])
        limits, slopes = self._limits(evaluation)
        if not gradient:
            return Sample(float(rows[0]), rows, constraint_rows=limits, info=info)
        gradients = self._sign * np.array([peak.gradient for peak in peaks])
        return Sample(float(rows[0]), rows, gradients, limits, slopes, info=info)

    def _limits(self, evaluation: Evaluation) -> tuple[Floats, Floats]:
        """Rows and gradients of the constraints on responses, feasible where <= 0, relative to their bounds.

        Every competing peak is a row (bound formulation); a constraint always has COMPETITORS rows, the last repeated.
        """
        rows: list[float] = []
        slopes: list[Floats] = []
        for i, row in self._responses:
            peaks = evaluation.constraint_peaks[i]
            scale = abs(row.bound) if row.bound != 0.0 else 1.0
            for sign in SIGNS[row.sense]:
                compete = (row.over_time, sign) in (("max", 1.0), ("max_abs", 1.0), ("min", -1.0))
                for r in range(COMPETITORS):
                    peak = peaks[min(r, len(peaks) - 1) if compete else 0]
                    rows.append(sign * (peak.value - row.bound) / scale)
                    if peak.gradient is not None:
                        slopes.append(sign * peak.gradient / scale)
        return np.array(rows), np.array(slopes).reshape(len(slopes), len(self.initial))


def _linear_rows(rows: list[VolumeRow], n: int) -> LinearRows:
    """Volume rows (Eq. 14), `at least` with its signs turned."""
    signs = np.array([-1.0 if row.sense == "at_least" else 1.0 for row in rows])
    matrix = np.array([row.coefficients for row in rows]).reshape(len(rows), n)
    return LinearRows(
        matrix * signs[:, None],
        np.array([row.bound for row in rows]) * signs,
        np.array([row.sense == "equals" for row in rows], dtype=np.bool_),
    )
