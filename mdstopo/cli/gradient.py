"""`mdstopo gradient`: sensitivity methods side by side."""

import shlex
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.case.methods.sensitivities import DEFAULT_SENSITIVITY, SENSITIVITIES, having
from mdstopo.cli.options import (
    alpha_option,
    announce_compilation,
    case_argument,
    check_design,
    open_case,
    open_design,
    out_option,
    output_options,
    overwrite_option,
    result_path,
    set_option,
)
from mdstopo.cli.output import Output, duration, number

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from mdstopo.case.model import Case
    from mdstopo.cli.gradient_numbers import DifferenceSteps
    from mdstopo.engine import Evaluator
    from mdstopo.evaluation import Evaluation

    Gradients = dict[str, NDArray[np.float64]]

#: methods that are compared where none is named
USUAL = (DEFAULT_SENSITIVITY, having("of_histories")[0])
_TIGHT = 1e-12  # solver tolerance for differences: what the integrator leaves of noise is divided by the step
_SHOWN = 6  # values of a variable that are shown
_OFF = 1e-6  # relative difference from differences above which it is told whether another peak explains it


@click.command("gradient")
@case_argument
@click.option(
    "--method",
    "methods",
    type=click.Choice(tuple(SENSITIVITIES)),
    multiple=True,
    help="A method; may be repeated (default: adjoint and direct).",
)
@click.option("--differences", "differencing", is_flag=True, help="Compare with extrapolated differences too.")
@click.option(
    "--members",
    "count",
    type=click.IntRange(1),
    default=10,
    show_default=True,
    metavar="N",
    help="How many members, chosen at random, the differences are taken for.",
)
@click.option(
    "--error-estimate", "estimating", is_flag=True, help="Estimate the errors of values and gradients by finer steps."
)
@click.option("--history", is_flag=True, help="Store the time histories dg(t)/dalpha of the direct method.")
@alpha_option
@out_option
@overwrite_option
@set_option
@output_options
def command(
    case_path: Path,
    methods: tuple[str, ...],
    differencing: bool,
    count: int,
    estimating: bool,
    history: bool,
    alpha_path: Path | None,
    out: Path | None,
    overwrite: bool,
    overrides: dict[str, str],
    as_json: bool,
    quiet: bool,
) -> int:
    """Compute the gradient of one design by several methods and compare them.

    The first method is the reference; differences are relative to its largest entry.
    \f
    Arguments, which --help leaves out:

    case_path: the case file.
    methods: the sensitivity methods; none takes adjoint and direct.
    differencing: whether differences are taken too.
    count: for how many members.
    estimating: whether errors are estimated by finer steps.
    history: whether histories of the direct method are stored.
    alpha_path: the file of the design; None takes the case's.
    out: the result file; None takes a name after the case's.
    overwrite: whether what the file holds is replaced.
    overrides: values of the case's keys.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    from mdstopo.store.output_file import output_file

    output = Output(json=as_json, quiet=quiet)
    methods = tuple(dict.fromkeys(methods or USUAL))
    case = _prepared(output, open_case(case_path, overrides, alpha_path), case_path, methods, history)
    alpha = open_design(alpha_path, case)
    path = result_path(out, case, "gradient")
    line = shlex.join(["mdstopo", *sys.argv[1:]])
    with output_file(path, case, "gradient", overwrite=overwrite, notify=output.notice, command=line) as file:
        announce_compilation(output, case, methods)
        from mdstopo.evaluators import evaluator_of
        from mdstopo.session.compiling_apart import RESPONSES, compiling_in_background
        from mdstopo.status import RunStatus
        from mdstopo.store.contents import design_part, sensitivity_part

        with compiling_in_background(case, RESPONSES, methods):
            engine = evaluator_of(case)
            check_design(engine, alpha, alpha_path)
            datasets: dict[str, Any] = design_part(case, engine.design(alpha))
            results, failure = _all_methods(engine, alpha, methods, estimating)
        for method, result in results.items():
            datasets |= sensitivity_part(result["gradients"], method, result["by_variable"])
        if differencing and not failure:
            failure = _difference(engine, case, alpha, count, results, datasets)
        if history and not failure:
            failure = _histories(engine, case, alpha, datasets)
        status = RunStatus.FAILED if failure else RunStatus.CONVERGED
        file.write(
            status.value,
            failure or "done",
            datasets,
            {"integrator": engine.integrator, "integrator_reason": engine.integrator_reason},
            tuple(f"{method}: {result['message']}" for method, result in results.items() if result["message"]),
        )
    _say(output, case, engine, results, failure, path)
    output.document(_document(case, engine, results, failure, path))
    return 1 if failure else 0


def _prepared(output: Output, case: "Case", case_path: Path, methods: tuple[str, ...], history: bool) -> "Case":
    """The case as the methods need it; raises CaseError where they cannot be applied."""
    from mdstopo.case.methods.integrators import AUTO
    from mdstopo.case.methods.integrators import having as integrators_having
    from mdstopo.case.text.errors import CaseError
    from mdstopo.case.text.words import listed
    from mdstopo.scene.refusals import no_derivatives

    refused = [method for method in methods if not SENSITIVITIES[method].by_parameters]
    if case.variables and refused:
        raise CaseError([case.marks.mistake(*no_derivatives(case, refused[0]))], str(case_path))
    if not case.is_optimizable:
        key = "members" if case.objectives else "objectives"
        words = "a gradient needs at least one objective and one design variable"
        raise CaseError([case.marks.mistake(key, words)], str(case_path))
    if history and not any(SENSITIVITIES[method].of_histories for method in methods):
        raise click.UsageError(f"--history needs --method {' or '.join(having('of_histories'))}")
    for method in methods:
        if not SENSITIVITIES[method].steps:
            continue
        on = integrators_having(SENSITIVITIES[method].steps)
        if case.solver.integrator not in (AUTO, *on):
            words = f"the {method} method does not go with {case.solver.integrator}, only with {listed(on)}"
            raise CaseError([case.marks.mistake("solver.integrator", words)], str(case_path))
        if case.solver.integrator == AUTO:
            output.notice(
                f"the {method} method goes with {on[0]} alone: gradients by all methods are those of that integrator"
            )
            return replace(case, solver=replace(case.solver, integrator=on[0]))
    return case


def _all_methods(
    engine: "Evaluator", alpha: "NDArray[np.float64]", methods: tuple[str, ...], estimating: bool
) -> tuple[dict[str, dict[str, Any]], str]:
    """Gradients, time and disagreement by method, and why it failed where it did."""
    from mdstopo.cli.gradient_numbers import disagreement, relative, timed, whole_gradient

    results: dict[str, dict[str, Any]] = {}
    failures: list[str] = []
    for method in methods:
        evaluation = engine.evaluate(alpha, sensitivity=method)
        if not evaluation.status.usable:
            return results, f"{method}: {_in_words(evaluation)}"
        gradients = dict(evaluation.gradients)
        whole = {name: whole_gradient(engine.case, evaluation, name) for name in gradients}
        reference = results[methods[0]]["whole"] if results else whole
        results[method] = {
            "objectives": dict(evaluation.objectives),
            "gradients": gradients,
            "by_variable": evaluation.variable_gradients,
            "whole": whole,
            "seconds": timed(partial(engine.evaluate, alpha, sensitivity=method)),
            "message": evaluation.message if evaluation.status.ok else _in_words(evaluation),
            "disagreement": {name: disagreement(whole[name], reference[name]) for name in gradients},
        }
        if estimating:
            judged = engine.with_errors(alpha, evaluation, method)
            if not judged.errors:
                failures.append(f"{method}: no error estimate, because the finer motion failed: {judged.message}")
            else:
                errors = judged.errors
                results[method]["errors"] = {name: relative(errors[name], evaluation, name) for name in errors}
    return results, "; ".join(failures)


def _in_words(evaluation: "Evaluation") -> str:
    """The status in words, with the part of the case that it concerns."""
    sentence = f"{evaluation.status.value}"
    return f"{sentence} ({evaluation.message})" if evaluation.message else sentence


def _difference(
    engine: "Evaluator",
    case: "Case",
    alpha: "NDArray[np.float64]",
    count: int,
    results: dict[str, dict[str, Any]],
    datasets: dict[str, Any],
) -> str:
    """Add differences of some members to the results; why there are none, where there are none.

    engine: the evaluator that the results are of.
    case, alpha: the case and the design (N + P,).
    count: for how many members, and for how many values of variables.
    results: by method, what it has found.
    datasets: of the result file; differences are added.
    """
    import numpy as np

    from mdstopo.case.methods.integrators import AUTO, INTEGRATORS
    from mdstopo.cli.gradient_numbers import chosen_members, difference_steps, differences, ranges, value_differences
    from mdstopo.evaluators import evaluator_of

    members = chosen_members(case.n_design, count, case.optimizer.seed)
    tight = replace(case, solver=replace(case.solver, tolerance=min(case.solver.tolerance, _TIGHT)))
    # fixed steps are differenced as they are: the tolerance would choose others, and too many
    fixed = case.solver.integrator != AUTO and not INTEGRATORS[case.solver.integrator].adaptive
    exact = evaluator_of(case if fixed else tight)

    def objectives(x: "NDArray[np.float64]") -> "Mapping[str, float]":
        found = exact.evaluate(x, gradient=False)
        if not found.status.usable:
            raise ArithmeticError(f"{found.status.value} {found.message}".strip())
        return found.objectives

    places = chosen_members(case.space.length - case.n_design, count, case.optimizer.seed)
    try:
        found = differences(objectives, alpha, members, float(alpha[: case.n_design].max(initial=0.0)))
        of_values = value_differences(objectives, case, alpha, places)
    except ArithmeticError as error:
        return f"differences: {error}"
    for result in results.values():
        result["differences"] = {}
        for name, whole in result["whole"].items():
            # values of variables by their share of the range, as in `whole`
            own = np.concatenate([found.get(name, np.zeros(0)), of_values.get(name, np.zeros(0))])
            chosen = np.concatenate([members, case.n_design + places])
            off = np.abs(whole[chosen] - own).max(initial=0.0)
            result["differences"][name] = float(off / (np.abs(whole).max(initial=0.0) or 1.0))
    datasets["differences/members"] = members.astype(np.int64)
    datasets |= {f"differences/{name}": values for name, values in found.items()}
    if case.variables:
        for name, values in of_values.items():
            whole = np.full(case.space.length, np.nan)
            whole[case.n_design + places] = values / ranges(case)[places]
            named = case.space.named(whole)
            datasets |= {f"differences/variables/{name}/{variable}": each for variable, each in named.items()}
    _note_other_peaks(engine, alpha, difference_steps(case, alpha, members, places), results)
    return ""


def _note_other_peaks(
    engine: "Evaluator", alpha: "NDArray[np.float64]", steps: "DifferenceSteps", results: dict[str, dict[str, Any]]
) -> None:
    """Note with the first method where differences are off because another peak becomes decisive within a step.

    steps: of the differences.
    """
    from mdstopo.cli.gradient_numbers import changes_peak
    from mdstopo.design_problem import PEAKS_OF_MEMBERS
    from mdstopo.evaluation import Rows

    method, result = next(iter(results.items()))
    off = [name for name, difference in result["differences"].items() if difference > _OFF]
    found = engine.evaluate(alpha, sensitivity=method, rows=Rows(*PEAKS_OF_MEMBERS)) if off else None
    if found is None or not found.status.usable:
        return
    tied = [name for name in off if changes_peak(found.peaks[name], steps)]
    if tied:
        why = (
            f"of {', '.join(tied)} another peak becomes decisive within a step of the differences, which are no "
            "derivative there; the gradient is that of the peak which is decisive"
        )
        result["message"] = "; ".join(filter(None, [result["message"], why]))


def _histories(engine: "Evaluator", case: "Case", alpha: "NDArray[np.float64]", datasets: dict[str, Any]) -> str:
    """Add the histories dg(t)/dalpha; why there are none, where there are none."""
    from mdstopo.store.contents import sensitivity_part

    for objective in case.objectives:
        status, t, rows = engine.histories(alpha, objective.name)
        if not status.ok:
            return f"history: {status.value}"
        datasets[f"trajectories/{objective.load_case}/t"] = t
        datasets |= sensitivity_part(
            {objective.name: rows[:, : case.n_design]},
            "direct/history",
            {objective.name: case.space.named(rows)} if case.variables else {},
        )
    return ""


def _say(
    output: Output,
    case: "Case",
    engine: "Evaluator",
    results: dict[str, dict[str, Any]],
    failure: str,
    path: Path,
) -> None:
    """Print what the methods have found as tables, and their warnings.

    output: where to.
    case: the case.
    engine: its evaluator, which knows the integrator.
    results: by method, what it has found, by name.
    failure: why it ended early; empty where it did not.
    path: the result file.
    """
    output.say(f"{case.title or case.name}: {failure or 'done'}")
    head = ["method", "objective", "value", "largest |dG/dalpha|", "differs by", "from differences by", "time"]
    estimated = any("errors" in result for result in results.values())
    rows = [[*head, "error of value", "of gradient"] if estimated else head]
    for method, result in results.items():
        for name, gradient in result["gradients"].items():
            rows.append(
                [
                    method,
                    name,
                    number(result["objectives"][name], 9),
                    number(float(abs(gradient).max(initial=0.0)), 9),
                    number(result["disagreement"][name], 3),
                    number(result["differences"][name], 3) if "differences" in result else "",
                    duration(result["seconds"]),
                    *(number(error, 2) for error in result.get("errors", {}).get(name, {}).values()),
                ]
            )
    output.table(rows)
    _say_variables(output, results)
    for method, result in results.items():
        if result["message"]:
            output.notice(f"warning: {method}: {result['message']}")
    output.table([["integrator", f"{engine.integrator}: {engine.integrator_reason}"], ["result", str(path)]], indent="")


def _say_variables(output: Output, results: dict[str, dict[str, Any]]) -> None:
    """What values of variables do to objectives, in their own units, by the first method."""
    rows = [["objective", "variable", "derivative by its value"]]
    for name, named in next(iter(results.values()), {}).get("by_variable", {}).items():
        for variable, gradient in named.items():
            more = f", ... ({len(gradient)} values)" if len(gradient) > _SHOWN else ""
            rows.append([name, variable, ", ".join(number(value, 9) for value in gradient[:_SHOWN]) + more])
    if len(rows) > 1:
        output.table(rows)


def _document(
    case: "Case", engine: "Evaluator", results: dict[str, dict[str, Any]], failure: str, path: Path
) -> dict[str, Any]:
    return {
        "command": "gradient",
        "case": case.name,
        "status": "failed" if failure else "converged",
        "reason": failure or "done",
        "methods": {
            method: {key: value for key, value in result.items() if key not in ("gradients", "by_variable", "whole")}
            | ({"variables": result["by_variable"]} if result["by_variable"] else {})
            for method, result in results.items()
        },
        "integrator": engine.integrator,
        "path": str(path),
    }
