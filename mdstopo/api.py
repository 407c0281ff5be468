"""The Python interface: four calls, the same engine as the command line.

    case = mdstopo.load_case("cases/fig6.yaml")
    trajectory = mdstopo.simulate(case)
    evaluation = mdstopo.evaluate(case)
    result = mdstopo.optimize(case)

A case is compiled at its first use and kept, so that `evaluate` in a loop costs what the kernels cost.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mdstopo.case.methods.sensitivities import AUTO_SENSITIVITY, names
from mdstopo.case.model import Case
from mdstopo.case.reader import load_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.evaluation import ErrorEstimate, Evaluation, FloatArray, Peak
from mdstopo.evaluators import evaluator_of
from mdstopo.integrators.trajectory import States, Trajectory
from mdstopo.session.outcome import Outcome as Result
from mdstopo.session.outcome import Progress

__all__ = [
    "Case",
    "CaseError",
    "ErrorEstimate",
    "Evaluation",
    "Peak",
    "Progress",
    "Result",
    "States",
    "Trajectory",
    "evaluate",
    "load_case",
    "optimize",
    "simulate",
]

METHODS = tuple(names())

#: compiled cases kept, the most recently used last; each evaluator holds its case, so an id is never taken twice
_KEPT = 8
#: bytes of steps that they may hold beside the case in use: long motions have gigabytes of them
_HELD = 2**28
_compiled: OrderedDict[int, Evaluator] = OrderedDict()


def _evaluator(case: Case) -> Evaluator:
    """The case's evaluator, made at its first use. Raises CaseError where the engine cannot compute the case."""
    key = id(_checked_case(case))
    found = _compiled.get(key)
    if found is None:
        found = _compiled[key] = evaluator_of(case)
        while len(_compiled) > _KEPT or (len(_compiled) > 1 and sum(each.held for each in _compiled.values()) > _HELD):
            _compiled.popitem(last=False)
    else:
        _compiled.move_to_end(key)
    return found


def _checked_case(case: object) -> Case:
    """What is to be a case, if it is one. Raises TypeError."""
    if not isinstance(case, Case):
        what = f"{type(case).__name__} {case!r:.60}" if isinstance(case, (str, Path)) else type(case).__name__
        raise TypeError(f"found {what}, needed is a case, as mdstopo.load_case gives it")
    return case


def as_real(values: ArrayLike, what: str) -> FloatArray:
    """Real numbers as an array; what: they are called in a message. Raises ValueError for complex ones."""
    if np.iscomplexobj(values):
        # conversion would drop the imaginary part, and with it derivatives by complex steps
        raise ValueError(f"{what} must be real, not complex; exact derivatives come with the values")
    return np.asarray(values, dtype=np.float64)


def _design(case: Case, alpha: ArrayLike | None, variables: Mapping[str, ArrayLike] | None) -> FloatArray:
    """alpha (N,) with the values of variables (P,) behind it."""
    given = case.initial if alpha is None else as_real(alpha, "alpha")
    if not variables and not case.variables:
        return given
    parts = case.space.parts
    unknown = [name for name in variables or {} if name not in parts]
    if unknown:
        there = f"there are {', '.join(parts)}" if parts else "the case has none"
        raise ValueError(f"no design variable {unknown[0]!r}; {there}")
    design = np.array(case.whole(given))
    for name, values in (variables or {}).items():
        own, count = as_real(values, name), parts[name].stop - parts[name].start
        if own.shape not in ((), (count,)):
            raise ValueError(f"{name} has {count} values, not {own.shape}")
        design[parts[name]] = own
    return design


def simulate(
    case: Case,
    alpha: ArrayLike | None = None,
    load_case: str | None = None,
    *,
    variables: Mapping[str, ArrayLike] | None = None,
) -> Trajectory:
    """Compute the motion of one design in one load case.

    alpha (N,): default the case's initial design. load_case: may be left out where there is only one; otherwise a
    ValueError lists them. variables: values of the case's design variables by name, as of `evaluate`.
    A motion that cannot go on ends early, and says so in `Trajectory.status`.
    Raises CaseError where the case asks for what the engine cannot do, ValueError for an unusable alpha.
    """
    names = [each.name for each in _checked_case(case).load_cases]
    if load_case is None:
        if len(names) > 1:
            raise ValueError(f"the case has several load cases, name one of them: {', '.join(names)}")
        load_case = names[0]
    elif load_case not in names:
        raise ValueError(f"no load case {load_case!r}; there are: {', '.join(names)}")
    return _evaluator(case).trajectory(_design(case, alpha, variables), load_case)


def evaluate(
    case: Case,
    alpha: ArrayLike | None = None,
    *,
    variables: Mapping[str, ArrayLike] | None = None,
    method: str = "auto",
    gradient: bool = True,
    error_estimate: bool = False,
) -> Evaluation:
    """Compute objectives and constraints of one design, and their gradients with respect to alpha.

    case: the design problem.
    alpha (N,): default the case's initial design; any finite alpha >= 0 is evaluated, bounds and rows do not matter.
    variables: values of the case's design variables by name, in the parameters' own units, a number or one for each
      member; default their initial ones. What they do to objectives is in `Evaluation.variable_gradients`.
    method: adjoint, direct, iterative or constant_load; auto takes the case's `solver.sensitivity`.
    gradient: whether gradients are computed too.
    error_estimate: compute it once more, much finer, and say in `Evaluation.errors` how far off the objectives and
      gradients are.

    Raises CaseError where the case asks for what the engine cannot do, ValueError for an unusable alpha or method.
    """
    if method not in METHODS:
        raise ValueError(f"no sensitivity method {method!r}; there are: {', '.join(METHODS)}")
    evaluator, design = _evaluator(case), _design(case, alpha, variables)
    chosen = None if method == AUTO_SENSITIVITY else method
    found = evaluator.evaluate(design, gradient, chosen)
    return evaluator.with_errors(design, found, chosen) if error_estimate else found


def optimize(
    case: Case,
    *,
    path: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    starts: int | None = None,
    workers: int | None = None,
    initial: ArrayLike | None = None,
    variables: Mapping[str, ArrayLike] | None = None,
    on_iteration: Callable[[Progress], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
) -> Result:
    """Optimise a case, and keep a result file up to date.

    case: the design problem.
    path: the result file; None keeps everything in memory.
    resume, overwrite: go on where the unfinished run in the file stopped, or replace it.
    starts, workers: how many starts (default: the case's) on how many processes (default 1); no result depends on the
      latter.
    initial (N,): the design to begin with; default the case's.
    variables: values of the case's design variables to begin with, by name, in the parameters' own units; default their
      initial ones.
    on_iteration: called after each iteration with how far the run is.
    stop_requested: asked after each iteration whether to stop.

    Raises CaseError where the case is no optimisation that the engine can do, StoreError for an unusable file.
    """
    from mdstopo.session.run_session import run_session

    return run_session(
        _checked_case(case),
        path=path,
        resume=resume,
        overwrite=overwrite,
        starts=starts,
        workers=workers,
        initial=None if initial is None and variables is None else _design(case, initial, variables),
        on_iteration=on_iteration,
        stop_requested=stop_requested,
    )
