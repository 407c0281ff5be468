"""`mdstopo run`: optimise a case."""

import math
import shlex
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.interrupt import Interrupts, saying_how_to_go_on
from mdstopo.cli.options import (
    EXIT,
    alpha_option,
    case_argument,
    open_case,
    open_design,
    out_option,
    output_options,
    overwrite_option,
    result_path,
    set_option,
)
from mdstopo.cli.output import Output, duration, number, write
from mdstopo.cli.progress import display
from mdstopo.cli.uncertain_numbers import document_of, lines_of
from mdstopo.shown import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from mdstopo.scene.settled import Settled
    from mdstopo.session.outcome import ChosenSizes, Outcome

_GREY = (0.1, 0.9)  # alpha, as a share of its range, between which a member is neither there nor gone


@click.command("run")
@case_argument
@out_option
@click.option("--resume", is_flag=True, help="Continue the run in the result file.")
@overwrite_option
@set_option
@alpha_option
@click.option("--starts", type=click.IntRange(1), metavar="N", help="How many starts at most (default: the case's).")
@click.option(
    "--workers", type=click.IntRange(1), metavar="N", help="Processes for starts, or a sample's points (default 1)."
)
@output_options
def command(
    case_path: Path,
    out: Path | None,
    resume: bool,
    overwrite: bool,
    overrides: dict[str, str],
    alpha_path: Path | None,
    starts: int | None,
    workers: int | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Optimise a case and keep its result file up to date.

    Ctrl-C finishes the iteration, saves, and tells how to resume.
    \f
    Arguments, which --help leaves out:

    case_path: the case file.
    out: the result file; None takes a name after the case's.
    resume, overwrite: whether the run in the file is continued, or replaced.
    overrides: values of the case's keys.
    alpha_path: the file of the design to begin with; None takes the case's.
    starts: how many; None takes the case's.
    workers: processes for starts or a sample's points; None takes one.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    output = Output(json=as_json, quiet=quiet)
    interrupts = Interrupts(quiet)
    case = open_case(case_path, overrides, alpha_path)
    initial = open_design(alpha_path, case) if alpha_path is not None else None
    path = result_path(out, case)
    from mdstopo.session.run_session import run_session

    again = resume_command(case_path, out, overrides, alpha_path, starts, workers)
    with saying_how_to_go_on(output, "run", case.name, path, resume, again), display(quiet) as show:
        outcome = run_session(
            case,
            path=path,
            resume=resume,
            overwrite=overwrite,
            starts=starts,
            workers=workers,
            initial=initial,
            on_iteration=show,
            stop_requested=interrupts.stop_requested,
            notify=output.notice,
            command=shlex.join(["mdstopo", *sys.argv[1:]]),
        )
    settled = _settled(outcome)
    _summarise(output, outcome, path, settled)
    output.document(_document(outcome, path, again, settled))
    for warning in outcome.warnings:
        output.notice(f"warning: {warning}")
    if len(outcome.states) == 1 and _misses_constraints(outcome):
        output.notice(_advice(outcome, again))
    if outcome.status == "interrupted":
        output.notice(f"interrupted; to go on: {again}")
    status = EXIT[outcome.status]
    if status == 0 and not outcome.keeps_constraints:
        status = 1
    if status == 1 and quiet:
        write(sys.stderr, f"{case_path}: {outcome.reason}")
    return status


def resume_command(
    case_path: Path,
    out: Path | None,
    overrides: dict[str, str],
    alpha_path: Path | None,
    starts: int | None,
    workers: int | None,
) -> str:
    """The exact command that continues this run.

    case_path: the case file.
    out: the result file, if it was given.
    overrides: values of the case's keys.
    alpha_path: the file of the design to begin with, if it was given.
    starts, workers: how many, if they were given.
    """
    words = ["mdstopo", "run", str(case_path), "--resume"]
    if out is not None:
        words += ["--out", str(out)]
    for key, value in overrides.items():
        words += ["--set", f"{key}={value}"]
    if alpha_path is not None:
        words += ["--alpha", str(alpha_path)]
    if starts is not None:
        words += ["--starts", str(starts)]
    if workers is not None:
        words += ["--workers", str(workers)]
    return shlex.join(words)


def _settled(outcome: "Outcome") -> "dict[str, Settled]":
    """Where the start has settled with the best design, by load case; empty where the case does not settle."""
    case = outcome.case
    if not case.solver.settle:
        return {}
    import numpy as np

    from mdstopo.engine import Evaluator

    engine = Evaluator(replace(case, uncertainty=None), in_background=False)  # of an uncertain case the nominal one
    design = np.concatenate([outcome.alpha, *outcome.variables.values()])
    found = {each.name: engine.settled(design, each.name) for each in case.load_cases}
    return {name: rest for name, rest in found.items() if rest is not None}


def _misses_constraints(outcome: "Outcome") -> bool:
    """Whether a run has ended, its best design computed, without a design that keeps the constraints."""
    computed = all(map(math.isfinite, outcome.constraints.tolist()))
    return computed and not outcome.keeps_constraints and outcome.status != "interrupted"


def _advice(outcome: "Outcome", again: str) -> str:
    """What may find a design that keeps the constraints; again: the command that goes on."""
    if outcome.status == "max_iterations":
        return (
            f"no design was found that keeps the constraints within {outcome.iterations} iterations; a larger "
            f"optimizer.max_iterations goes on ({again}), or another start may find one: --starts 8"
        )
    return "from this start no design was found that keeps the constraints; another start may find one: --starts 8"


def _summarise(output: Output, outcome: "Outcome", path: Path, settled: "Mapping[str, Settled]") -> None:
    case = outcome.case
    state = outcome.states[outcome.best_start]
    assert state is not None
    output.say(f"{case.title or case.name}: {outcome.status.replace('_', ' ')} - {outcome.reason}")
    rows = []
    for name, value in outcome.objectives.items():
        begin = outcome.initial_objectives[name]  # NaN where nothing asked for it: a weight of 0
        first = "not computed" if math.isnan(begin) else number(begin, 9)
        rows.append([name, f"{first} -> {number(value, 9)}"])
        peaks = outcome.peaks.get(name, ()) if case.uncertainty is None else ()
        # an integral or a mean is of no one time
        rows += [["  peak", f"{number(value, 9)} at {number(t)} s"] for t, value in peaks if not math.isnan(t)]
        rows += lines_of(outcome.conclusion, name)
    if outcome.combined is not None:
        rows.append(["combined", f"{number(outcome.combined, 9)} ({case.combine.method if case.combine else ''})"])
    for title, scale in (("utopia", outcome.utopia), ("maxima", outcome.maxima)):
        if scale is not None:
            named = zip(outcome.objectives, scale.tolist(), strict=True)
            rows.append([f"  {title}", ", ".join(f"{name} {number(value)}" for name, value in named)])
    rows.append(["iterations", f"{outcome.iterations}, {outcome.evaluations} evaluations"])
    if len(outcome.states) > 1:
        rows += _optima(outcome)
    rows += [[name, sentence] for name, sentence in _material(outcome)]
    # a design may settle far from where the scene is drawn: what is optimised is then another machine
    several = len(case.load_cases) > 1
    rows += [[f"start of {name}" if several else "start", each.moves] for name, each in settled.items()]
    rows.append(["integrator", f"{outcome.integrator}: {outcome.integrator_reason}"])
    rows.append(
        [
            "time",
            f"{duration(outcome.seconds)} of iterations, {duration(outcome.compile_seconds)} to get ready",
        ]
    )
    rows.append(["result", str(path)])
    output.table(rows)


def _optima(outcome: "Outcome") -> list[list[str]]:
    """The distinct optima that several starts have come to: U, which starts, their evaluations, how the best ended.

    Then the starts that came to none, because they were left where others were better.
    """
    from mdstopo.optimizer.start_families import family_of
    from mdstopo.starts.quotas import came_to, distinct, expected_optima, left_behind

    tolerance, count = outcome.case.optimizer.tolerance, len(outcome.states)
    begun = sum(each is not None for each in outcome.states)
    family = family_of(outcome.best_start, count, outcome.case.n_design > 0)
    rows = [["starts", f"{begun} of {count}; best is {outcome.best_start + 1}, from {family}"]]
    for found in distinct(outcome.states, tolerance):
        broken = f", violation {number(found.violation, 3)}" if found.violation > tolerance else ""
        rows.append(
            [
                f"  {number(found.objective, 7)}{broken}",
                f"{_numbers(found.starts)}, {found.evaluations} evaluations, "
                f"{found.status.replace('_', ' ')}, KKT residual {number(found.kkt, 2)}",
            ]
        )
    left = left_behind(outcome.states)
    if left:
        spent = sum(state.evaluations for index in left if (state := outcome.states[index]) is not None)
        rows.append(["  left early", f"{_numbers(left)}, {spent} evaluations: others were better"])
    if begun < count and outcome.status != "interrupted":
        came, optima = came_to(outcome.states)
        more = expected_optima(came, optima) - optima
        rows.append(
            [
                "  not begun",
                f"{_numbers([k for k, state in enumerate(outcome.states) if state is None])}: {came} starts came to "
                f"{optima} optim{'um' if optima == 1 else 'a'}, so {number(more, 2)} more are to be expected",
            ]
        )
    return rows


def _numbers(starts: "Sequence[int]") -> str:
    """Starts, counted from 1."""
    return f"start{'s' if len(starts) > 1 else ''} {', '.join(str(index + 1) for index in starts)}"


def _material(outcome: "Outcome") -> list[tuple[str, str]]:
    """What the design is made of: volume rows, members that are neither there nor gone."""
    import numpy as np

    from mdstopo.case.model import VolumeRow
    from mdstopo.case.responses.response_units import bounded
    from mdstopo.case.text.words import count_text
    from mdstopo.cli.show import values_text
    from mdstopo.cli.values_of_motion import bounded_name
    from mdstopo.scene.moving_volumes import spent
    from mdstopo.session.sizes import at_prices

    case, lines = outcome.case, []
    for i, (row, excess) in enumerate(zip(case.constraints, outcome.constraints.tolist(), strict=True)):
        if not isinstance(row, VolumeRow):
            lines.append((bounded_name(case, row), f"{number(excess + row.bound, 9)}, {bounded(row)}"))
            lines += [(title, sentence) for title, sentence in lines_of(outcome.conclusion, f"constraints[{i}]")]
        else:
            design = np.concatenate([outcome.alpha, *outcome.variables.values()])
            chosen = outcome.sizes is not None and bool(outcome.sizes.sizes)
            used = spent(case, row, at_prices(case, design) if chosen else design)
            lines.append((bounded_name(case, row), f"{number(used, 9)}, {bounded(row)}"))
    width = case.upper - case.lower
    # A member whose bounds are equal is as much there as they say.
    share = np.divide(outcome.alpha - case.lower, width, out=np.array(outcome.alpha), where=width > 0.0)
    grey = int(np.count_nonzero((share > _GREY[0]) & (share < _GREY[1])))
    full = int(np.count_nonzero(share >= _GREY[1]))
    if case.n_design:
        gone = case.n_design - full - grey
        # Many small members may share what a few whole ones would do: nothing is "absent" then but by its own range.
        largest = f"; the largest alpha is {number(outcome.alpha.max(), 3)}" if not full + grey else ""
        lines.append(("members", f"{full} present, {grey} grey, {gone} absent of {case.n_design}{largest}"))
    if outcome.pricing is not None:
        rounds = counted(outcome.pricing.rounds, "round")
        best, together = number(outcome.pricing.best, 2), number(outcome.pricing.together, 2)
        gain = f"gain to first order, relative: {best} by the best one, {together} by all at most"
        lines.append(("candidates", f"{count_text(outcome.pricing.candidates)}, {rounds}; {gain}"))
    if outcome.sizes is not None:
        lines += _sizes(outcome.sizes)
    lines += [(each.name, f"{values_text(outcome.variables[each.name])} {each.unit}") for each in case.variables]
    return lines


def _sizes(chosen: "ChosenSizes") -> list[tuple[str, str]]:
    """What has been chosen from a catalogue, and what is known of it."""
    from mdstopo.case.text.words import count_text

    lines = [
        (f"sizes of {name}", ", ".join(f"{count} of {number(size)}" for size, count in sizes.items()))
        for name, sizes in chosen.sizes.items()
    ]
    how = "all evaluated" if chosen.exhaustive else f"{chosen.nodes} nodes"
    found = f"{chosen.members} members, {count_text(chosen.choices)} choices; {how}, {chosen.evaluations} evaluations"
    lines.append(("  choice", found + ("; found beside the best of the nodes" if chosen.exchanged else "")))
    if chosen.sizes:
        value, before = number(chosen.objective, 9), number(chosen.continuous, 9)
        lines.append(("  continuous", f"{before}, with sizes {value}; best open relaxation {number(chosen.bound, 9)}"))
    return lines


def _document(outcome: "Outcome", path: Path, again: str, settled: "Mapping[str, Settled]") -> dict[str, Any]:
    return {
        "command": "run",
        "case": outcome.case.name,
        "status": str(outcome.status),
        "reason": outcome.reason,
        "objectives": outcome.objectives,
        "initial_objectives": outcome.initial_objectives,
        "peaks": {name: [{"time": t, "value": value} for t, value in found] for name, found in outcome.peaks.items()},
        "kkt": outcome.kkt,
        "evaluations": outcome.evaluations,
        "iterations": outcome.iterations,
        "starts": [
            None
            if each is None
            else {
                "status": str(each.status),
                "objective": each.best_objective,
                "kkt": each.kkt,
                "dropped": each.dropped,
                "twin": each.twin if each.twin >= 0 else None,
            }
            for each in outcome.states
        ],
        "best_start": outcome.best_start,
        "constraints": outcome.constraints,
        "variables": outcome.variables,
        "combined": outcome.combined,
        "utopia": outcome.utopia,
        "maxima": outcome.maxima,
        "integrator": outcome.integrator,
        "integrator_reason": outcome.integrator_reason,
        "seconds": outcome.seconds,
        "compile_seconds": outcome.compile_seconds,
        "uncertainty": document_of(outcome.conclusion),
        **({"pricing": asdict(outcome.pricing)} if outcome.pricing is not None else {}),
        **({"sizes": asdict(outcome.sizes)} if outcome.sizes is not None else {}),
        **(
            {"settled": {name: {"moved": each.moved, "turned": each.turned} for name, each in settled.items()}}
            if settled
            else {}
        ),
        "warnings": outcome.warnings,
        "path": str(path),
        "resume": again if outcome.status == "interrupted" else None,
    }
