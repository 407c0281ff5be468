"""`mdstopo pareto`: the front of several objectives."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.front_display import front_display
from mdstopo.cli.interrupt import Interrupts
from mdstopo.cli.options import FILE, open_case, out_option, output_options, overwrite_option, result_path, set_option
from mdstopo.cli.output import Output, duration, number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mdstopo.case.model import Case
    from mdstopo.front.session import FrontOutcome

METHODS = ("weighted_exponential", "weighted_sum", "weighted_min_max", "weighted_product", "nbi", "nc")
DEFAULT_CASE = Path("cases/fig7.yaml")
EXIT = {"converged": 0, "max_iterations": 0, "failed": 1, "interrupted": 3}
_POINTS = 21


@click.command("pareto")
@click.argument("case_path", metavar="[CASE]", type=FILE, required=False, default=DEFAULT_CASE)
@click.option("--weights", metavar="a:b:step", help="Weights of the first of two objectives: a range, or a list a,b,c.")
@click.option(
    "--points", type=click.IntRange(2), metavar="N", help=f"So many evenly spaced points (default {_POINTS})."
)
@click.option("--method", type=click.Choice(METHODS), help="How the objectives are combined (default: the case's).")
@out_option
@click.option("--resume", is_flag=True, help="Continue the front in the result file.")
@overwrite_option
@set_option
@click.option("--starts", type=click.IntRange(1), default=1, metavar="N", help="How many starts for every solve.")
@click.option("--workers", type=click.IntRange(1), metavar="N", help="At most so many processes (default: all cores).")
@click.option("--cluster", metavar="ADDRESS", help="Workers of a Dask cluster instead, e.g. tcp://host:8786.")
@output_options
def command(
    case_path: Path,
    weights: str | None,
    points: int | None,
    method: str | None,
    out: Path | None,
    resume: bool,
    overwrite: bool,
    overrides: dict[str, str],
    starts: int,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Trace the front of a case's objectives (default: cases/fig7.yaml).

    --weights 0:1:0.05 varies the weight of the first of two objectives, the second takes the rest. --method nbi
    spreads the points evenly. Ctrl-C keeps what is finished, and tells how to resume.
    """
    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    if weights is not None and points is not None:
        raise click.UsageError("--weights and --points exclude each other")
    output = Output(json=as_json, quiet=quiet)
    interrupts = Interrupts(quiet)
    case = open_case(case_path, overrides)
    from mdstopo.front.session import Ask, check, run_front

    check(case)
    directions = _directions(case, weights, points)
    line = shlex.join(["mdstopo", *sys.argv[1:]])
    path = result_path(out, case, "pareto")
    with front_display(quiet) as show:
        outcome = run_front(
            case,
            Ask(directions, method or "", starts),
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
    again = resumed(line)
    _say(output, outcome)
    output.document(_document(outcome, again))
    for warning in outcome.warnings:
        output.notice(f"warning: {warning}")
    if outcome.status == "interrupted":
        output.notice(f"interrupted; to go on: {again}")
    return EXIT[outcome.status]


def resumed(line: str) -> str:
    """The command that continues what a command line began."""
    words = [word for word in shlex.split(line) if word not in ("--resume", "--overwrite")]
    return shlex.join([*words, "--resume"])


def _directions(case: "Case", weights: str | None, points: int | None) -> "NDArray[np.float64]":
    """The points that are asked for, (W, m)."""
    import numpy as np

    from mdstopo.front.directions import lattice, parse_range, weights_of_first

    count = len(case.objectives)
    if weights is not None:
        if count != 2:
            raise click.UsageError(f"--weights is for two objectives; this case has {count}: --points N spreads them")
        try:
            return weights_of_first(parse_range(weights))
        except ValueError as error:
            raise click.BadParameter(str(error), param_hint="'--weights'") from None
    if count == 2:
        return weights_of_first(np.linspace(0.0, 1.0, points or _POINTS).tolist())
    try:
        return lattice(count, points or _POINTS)
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="'--points'") from None


def front_rows(
    names: list[str],
    directions: "NDArray[np.float64]",
    objectives: "NDArray[np.float64]",
    status: list[str],
    dominated: "NDArray[np.bool_]",
    evaluations: "NDArray[np.int64]",
) -> list[list[str]]:
    """A front as a table."""
    rows = [["point", *(f"weight {name}" for name in names), *names, "status", "evaluations", ""]]
    rows += [
        [
            str(j),
            *(number(weight, 4) for weight in directions[j]),
            *(number(value, 7) for value in objectives[j]),
            status[j].replace("_", " "),
            str(int(evaluations[j])),
            "dominated" if dominated[j] else "",
        ]
        for j in range(len(directions))
    ]
    return rows


def _say(output: Output, outcome: "FrontOutcome") -> None:
    case = outcome.case
    output.say(f"{case.title or case.name}: {outcome.status.replace('_', ' ')} - {outcome.reason}")
    if outcome.front is not None:
        from mdstopo.front.content import REFERENCE, front_part

        part: dict[str, Any] = dict(front_part(case, outcome.directions, outcome.front, outcome.tasks))
        names = [objective.name for objective in case.objectives]
        columns = [part[f"pareto/{name}"] for name in ("objectives", "status", "dominated", "evaluations")]
        output.table(front_rows(names, outcome.directions, *columns))
        rows = [
            ["utopia", ", ".join(number(value) for value in outcome.front.utopia)],
            ["maxima", ", ".join(number(value) for value in outcome.front.maxima)],
            ["hypervolume", f"{number(outcome.quality['hypervolume'], 5)}, reference point {REFERENCE:g} of each "
                            "objective scaled by these"],
            ["spacing", f"{number(outcome.quality['spacing'], 3)}, largest gap "
                        f"{number(outcome.quality['largest_gap'], 3)}"],
        ]  # fmt: skip
        output.table(rows)
    output.table(
        [
            ["method", outcome.method],
            ["evaluations", f"{outcome.evaluations} in {len(outcome.tasks)} solves"],
            ["time", duration(outcome.seconds)],
            ["result", str(outcome.path)],
        ]
    )


def _document(outcome: "FrontOutcome", again: str) -> dict[str, Any]:
    from mdstopo.front.content import front_part

    content: dict[str, Any] = {
        "command": "pareto",
        "case": outcome.case.name,
        "method": outcome.method,
        "status": str(outcome.status),
        "reason": outcome.reason,
        "weights": outcome.directions,
        "evaluations": outcome.evaluations,
        "solves": len(outcome.tasks),
        "seconds": outcome.seconds,
        "path": str(outcome.path),
        "warnings": outcome.warnings,
        "resume": again if outcome.status == "interrupted" else None,
    } | outcome.quality
    if outcome.front is not None:
        part = front_part(outcome.case, outcome.directions, outcome.front, outcome.tasks)
        names = ("objectives", "dominated", "kkt", "violation")
        content |= {name: part[f"pareto/{name}"] for name in names}
        content["point_status"] = part["pareto/status"]
        content["utopia"], content["maxima"] = outcome.front.utopia, outcome.front.maxima
    return content
