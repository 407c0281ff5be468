"""Whether an integral over time is so near to zero that the tolerance, which is relative to it, makes steps short.

An error is measured relative to the objective. Where a response is very small beside the motion that it is computed
from, rounding of that motion is larger than the error that the response may have, and steps are made ever shorter.
"""

from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import Case, ReducedResponse, ResponseRow
from mdstopo.case.responses.response_units import constrained, unit_of_value, words
from mdstopo.general.responses.extremes import VALUE
from mdstopo.starts.callbacks import Notify

#: steps that end where they do for the sake of integrals alone, from which on it is told, and how many times as many
#: they are as the others
MANY_STEPS, TIMES_OTHERS = 500, 4
#: expressions that have a small amount more than a response, and the like of its square
ADDED, SQUARED = "x + 1e-3", "sqrt(x^2 + 1e-6)"


class NearZeroNotice:
    """Says once of a run that an integral is so near to zero that it makes evaluations slow.

    case: the design problem. engine: its evaluator. notify: is given the warning.
    """

    def __init__(self, case: Case, engine: object, notify: Notify) -> None:
        self._case = case
        self._engine = engine
        self._notify = notify
        self._is_told = False

    def look(self) -> None:
        """Look at the last evaluation."""
        if not self._is_told and (sentence := near_zero(self._case, self._engine)):
            self._notify(f"warning: {sentence}")
            self._is_told = True


def near_zero(case: Case, engine: object) -> str:
    """Which integrals of the last evaluation are near to zero so that they cost many steps, and what helps; empty where
    none is. engine: where it is no evaluator of one case, as of a sample, nothing is known of it."""
    from mdstopo.engine import Evaluator
    from mdstopo.general.driver.general_driver import GeneralDriver

    if not isinstance(engine, Evaluator) or not engine.beyond:
        return ""
    for name in engine.scenes:
        responses: list[ReducedResponse] = [each for each in case.objectives if each.load_case == name]
        responses += [each for each in case.constraints if isinstance(each, ResponseRow) and each.load_case == name]
        integrals = [(j, reduced) for j, reduced in enumerate(responses) if REDUCTIONS[reduced.over_time].is_integral]
        if not integrals:
            continue
        driver = engine.driver(name)
        assert isinstance(driver, GeneralDriver)
        asked, others = len(driver.quadrature_breakpoints), driver.count - len(driver.quadrature_breakpoints)
        if asked < MANY_STEPS or asked < TIMES_OTHERS * others:
            continue
        found = [
            f"{_words(case, reduced)} is {driver.rows[j, 0, VALUE]:.2g} {unit_of_value(reduced)}"
            for j, reduced in integrals
        ]
        # of a mean square the least value stays where it is if the squares have an amount more
        formula = SQUARED if any(REDUCTIONS[reduced.over_time].is_squared for _, reduced in integrals) else ADDED
        return (
            f"{' and '.join(found)}: an integral so near to zero takes {driver.count:,} steps where the motion takes "
            f"{max(others, 1):,}, because solver.tolerance is relative to it; where less than some amount is as good "
            f"as nothing, add that to the response by an expression (formula: {formula}), or loosen solver.tolerance"
        )
    return ""


def _words(case: Case, reduced: ReducedResponse) -> str:
    """An objective by its name and what it measures, a constraint by what it bounds."""
    if isinstance(reduced, ResponseRow):
        return constrained(case, reduced)
    return f"objective {reduced.name} ({reduced.over_time} {words(reduced.response)})"
