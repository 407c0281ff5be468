"""`mdstopo sweep`: a case over weights (`sweep weights`, the same as `pareto`), or over values of any keys."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.front_display import front_display
from mdstopo.cli.interrupt import Interrupts, saying_how_to_go_on
from mdstopo.cli.options import (
    EXIT,
    case_argument,
    open_case,
    out_option,
    output_options,
    overwrite_option,
    result_path,
)
from mdstopo.cli.output import Output, duration, number
from mdstopo.cli.pareto import command as pareto
from mdstopo.cli.pareto import resumed

if TYPE_CHECKING:
    from mdstopo.front.run_sweep import SweepOutcome


@click.group("sweep")
def command() -> None:
    """Run a case over weights of its objectives, or over values of any keys."""


command.add_command(pareto, "weights")


@command.command("set")
@case_argument
@click.argument("sets", metavar="KEY=a:b:step...", nargs=-1, required=True)
@out_option
@click.option("--resume", is_flag=True, help="Continue the sweep in the result file.")
@overwrite_option
@click.option("--workers", type=click.IntRange(1), metavar="N", help="At most so many processes (default: all cores).")
@click.option("--cluster", metavar="ADDRESS", help="Workers of a Dask cluster instead, e.g. tcp://host:8786.")
@output_options
def set_values(
    case_path: Path,
    sets: tuple[str, ...],
    out: Path | None,
    resume: bool,
    overwrite: bool,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run a case with every combination of values: a:b:step (both ends included) or x,y,z; one value sets a key.

    For example: mdstopo sweep set cases/fig6.yaml members.belts.law.stiffness=225:2250:675 optimizer.starts=1,4
    \f
    Arguments, which --help leaves out:

    case_path: the case file.
    sets: the keys and their values, KEY=VALUES.
    out: the result file; None takes a name after the case's.
    resume, overwrite: whether the sweep in the file is continued, or replaced.
    workers: processes at most; None takes all cores.
    cluster: address of a Dask cluster in their place.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    output = Output(json=as_json, quiet=quiet)
    interrupts = Interrupts(quiet)
    wanted: dict[str, str] = {}
    for text in sets:
        key, sign, value = text.partition("=")
        if not sign or not key.strip() or not value.strip():
            raise click.BadParameter(f"{text!r} is not KEY=VALUES", param_hint="'KEY=a:b:step'")
        wanted[key.strip()] = value
    case = open_case(case_path, {})
    from mdstopo.front.run_sweep import combinations, run_sweep

    try:
        combinations(wanted)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="'KEY=a:b:step'") from None
    line = shlex.join(["mdstopo", *sys.argv[1:]])
    path, again = result_path(out, case, "sweep"), resumed(line)
    with saying_how_to_go_on(output, "sweep", case.name, path, resume, again), front_display(quiet) as show:
        outcome = run_sweep(
            case_path,
            {},
            wanted,
            path=path,
            resume=resume,
            overwrite=overwrite,
            workers=workers,
            cluster=cluster,
            on_progress=show,
            stop_requested=interrupts.stop_requested,
            notify=output.notice,
            command=line,
        )
    _say(output, outcome)
    output.document(_document(outcome, again))
    for warning in outcome.warnings:
        output.notice(f"warning: {warning}")
    if outcome.status == "interrupted":
        output.notice(f"interrupted; to go on: {again}")
    return EXIT[outcome.status]


def _say(output: Output, outcome: "SweepOutcome") -> None:
    output.say(f"{outcome.case.title or outcome.case.name}: {outcome.status.replace('_', ' ')} - {outcome.reason}")
    rows = [[*outcome.keys, *(o.name for o in outcome.case.objectives), "status", "evaluations", "KKT"]]
    for values, found in zip(outcome.values, outcome.found, strict=True):
        if found is None:
            rows.append([*values, *("" for _ in outcome.case.objectives), "not run", "", ""])
            continue
        word = found.status.value.replace("_", " ")
        if found.status == "failed":
            word += f": {found.reason}"
        cells = [*values, *(number(value, 7) for value in found.objectives), word]
        rows.append([*cells, str(found.evaluations), number(found.kkt, 2)])
    output.table(rows)
    output.table([["time", duration(outcome.seconds)], ["result", str(outcome.path)]])


def _document(outcome: "SweepOutcome", again: str) -> dict[str, Any]:
    runs = [
        {
            "values": dict(zip(outcome.keys, values, strict=True)),
            "status": "running" if found is None else found.status.value,
            "reason": "" if found is None else found.reason,
            "objectives": None if found is None else found.objectives,
            "kkt": None if found is None else found.kkt,
            "evaluations": 0 if found is None else found.evaluations,
        }
        for values, found in zip(outcome.values, outcome.found, strict=True)
    ]
    return {
        "command": "sweep",
        "case": outcome.case.name,
        "status": str(outcome.status),
        "reason": outcome.reason,
        "objectives": [objective.name for objective in outcome.case.objectives],
        "runs": runs,
        "seconds": outcome.seconds,
        "warnings": outcome.warnings,
        "path": str(outcome.path),
        "resume": again if outcome.status == "interrupted" else None,
    }
