"""What only the final design of a run has: its motion, sensitivities and advice; and whether it is of use."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.case.responses.response_units import constrained, unit_of_bound
from mdstopo.optimizer.state import State
from mdstopo.session.advice import advise, without_slope
from mdstopo.session.coarse_steps import coarse_steps
from mdstopo.session.shortfall import stalled_run
from mdstopo.session.sizes import excess_at_prices
from mdstopo.session.start_in_stages import has_sizes
from mdstopo.starts.constraint_columns import relative_violations
from mdstopo.starts.evaluator_interface import Engine, Evaluation
from mdstopo.starts.getting_ready import motions
from mdstopo.status import RunStatus
from mdstopo.store.contents import Datasets, Motion, sensitivity_part, trajectory_part

if TYPE_CHECKING:
    from mdstopo.robust.conclusion import Conclusion

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class FinalDesign:
    """What has been computed of the final design; nothing of a run that was stopped.

    peaks: (time, value) of all that compete, by objective. constraints (n_con,): h_j - h_0j; None where they could not
    be evaluated. objectives (2, n_obj): raw values of this design and of the last one, of several objectives alone.
    datasets: those of the result file. conclusion: of an uncertain case. warnings: sentences.
    """

    peaks: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    constraints: Floats | None = None
    objectives: Floats | None = None
    datasets: Datasets = field(default_factory=dict)
    conclusion: "Conclusion | None" = None
    warnings: tuple[str, ...] = ()


#: of a run that was stopped
NOT_COMPUTED = FinalDesign()


def final_design(case: Case, engine: Engine, state: State, before: Mapping[str, Motion]) -> FinalDesign:
    """Compute what only the final design has.

    state: that of the best start. before: the motion with the design that the run began with, by load case. Raises
    WorkerError where a process of an uncertain case is lost.
    """
    design = case.space.expand(state.best_alpha)
    evaluation = engine.evaluate(design, gradient=True)
    usable = evaluation.status.usable
    constraints = objectives = conclusion = None
    if usable:
        constraints = np.asarray(evaluation.constraints, dtype=np.float64)
        if has_sizes(case, state):
            constraints = excess_at_prices(case, design, constraints)
        if len(case.objectives) > 1:
            objectives = _objectives(case, engine, state, evaluation)
    after = motions(case, engine, design)
    by_variable = getattr(evaluation, "variable_gradients", {})
    datasets = trajectory_part(after) | sensitivity_part(evaluation.gradients, by_variable=by_variable)
    warnings = [*_of_evaluation(evaluation), *_of_motions(after), *advise(case, design, before, after)]
    warnings += filter(None, (coarse_steps(case, *each) for each in after.items()))
    if usable:
        warnings += without_slope(case, evaluation)
    if case.uncertainty is not None and usable:
        from mdstopo.robust.uncertain_run import concluded

        conclusion = concluded(engine, design)
        datasets |= conclusion.part
        warnings += conclusion.warnings
    peaks = {name: tuple((peak.time, peak.value) for peak in found) for name, found in evaluation.peaks.items()}
    warnings += stalled_run(case, state)
    return FinalDesign(peaks, constraints, objectives, datasets, conclusion, tuple(warnings))


def _objectives(case: Case, engine: Engine, state: State, evaluation: Evaluation) -> Floats:
    """Raw values of the best design, which is evaluated, and of the last one (2, n_obj)."""
    last = evaluation
    if not np.array_equal(state.alpha, state.best_alpha):
        last = engine.evaluate(case.space.expand(state.alpha), gradient=False)
    names = [objective.name for objective in case.objectives]
    return np.array([[each.objectives[name] for name in names] for each in (evaluation, last)])


def _of_evaluation(evaluation: Evaluation) -> tuple[str, ...]:
    """The warning about an evaluation that has failed, or that has something to say."""
    message = getattr(evaluation, "message", "")
    if evaluation.status.ok:
        return (message,) if message else ()
    lacks = "the sensitivities of the final design: " if evaluation.gradients else "no sensitivities: "
    whose = f": {message}" if message else ""
    return (f"{lacks}{evaluation.status.value}{whose}",)


def _of_motions(found: Mapping[str, Motion]) -> list[str]:
    """Warnings about motions that end early."""
    return [
        f"the motion in load case {name} is not whole: {motion.status.value}"
        for name, motion in found.items()
        if not motion.status.ok
    ]


def judged(
    case: Case, state: State, constraints: Floats | None, status: RunStatus, reason: str
) -> tuple[RunStatus, str]:
    """The status, where no design keeps the constraints: then the optimiser has converged to nothing of use.

    state: that of the best start. constraints (n_con,): those of the final design. status, reason: how the optimiser
    ended, and why.
    """
    if state.best_violation <= case.optimizer.tolerance or constraints is None:
        return status, reason
    excess = relative_violations(case, constraints[None])[0]
    i = int(np.argmax(excess))
    if not (np.isfinite(state.best_violation) and excess[i] > 0.0):  # no design was ever evaluated
        return status, reason
    row = case.constraints[i]
    word = {"limit": "above its limit", "at_least": "below its least", "equals": "away from its"}[row.sense]
    unit = unit_of_bound(row)
    sentence = (
        f"no design was found that keeps the constraints: constraints[{i}] ({constrained(case, row)}) is "
        f"{f'{abs(constraints[i]):.6g} {unit}'.rstrip()} {word} {f'{row.bound:.6g} {unit}'.rstrip()}"
    )
    if row.bound == 0.0:  # the optimiser takes it as it is
        reason = reason.replace(" of its bound", "")
    return (RunStatus.FAILED if status is RunStatus.CONVERGED else status), f"{sentence} ({reason})"
