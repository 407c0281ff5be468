"""`mdstopo pareto`: the front of several objectives."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.front_display import front_display
from mdstopo.cli.interrupt import Interrupts, saying_how_to_go_on
from mdstopo.cli.options import (
    CASE_FILE,
    EXIT,
    open_case,
    out_option,
    output_options,
    overwrite_option,
    result_path,
    set_option,
)
from mdstopo.cli.output import Output, duration, number
from mdstopo.settings.scalarisations import SCALARISATIONS

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from mdstopo.case.model import Case
    from mdstopo.front.run_front import Ask, FrontOutcome

DEFAULT_CASE = Path("cases/fig7.yaml")
_POINTS = 21
#: violation, relative to a constraint's bound, from which a point says so
STATED = 1e-8


@click.command("pareto")
@click.argument("case_path", metavar="[CASE]", type=CASE_FILE, required=False, default=DEFAULT_CASE)
@click.option("--weights", metavar="a:b:step", help="Weights of the first of two objectives: a range, or a list a,b,c.")
@click.option(
    "--points", type=click.IntRange(2), metavar="N", help=f"So many evenly spaced points (default {_POINTS})."
)
@click.option(
    "--method", type=click.Choice(tuple(SCALARISATIONS)), help="How the objectives are combined (default: the case's)."
)
@out_option
@click.option("--resume", is_flag=True, help="Continue the front in the result file.")
@overwrite_option
@set_option
@click.option("--starts", type=click.IntRange(1), default=None, metavar="N", help="How many starts for every solve.")
@click.option("--workers", type=click.IntRange(1), metavar="N", help="At most so many processes (default: all cores).")
@click.option("--cluster", metavar="ADDRESS", help="Workers of a Dask cluster instead: tcp://host:8786, or tls://...")
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
    starts: int | None,
    workers: int | None,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Trace the front of a case's objectives (default: cases/fig7.yaml).

    --weights 0:1:0.05 varies the weight of the first of two objectives, the second takes the rest. --method nbi
    spreads the points evenly. Ctrl-C keeps what is finished, and tells how to resume.
    \f
    Arguments, which --help leaves out:

    case_path: the case file.
    weights: of the first of two objectives, as text; excludes `points`.
    points: how many points; None takes 21.
    method: how the objectives are combined; None takes the case's.
    out: the result file; None takes a name after the case's.
    resume, overwrite: whether the front in the file is continued, or replaced.
    overrides: values of the case's keys.
    starts: of every solve; None takes the case's.
    workers: processes at most; None takes all cores.
    cluster: address of a Dask cluster in their place.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    if weights is not None and points is not None:
        raise click.UsageError("--weights and --points exclude each other")
    if workers is not None and cluster is not None:
        raise click.UsageError("--workers and --cluster exclude each other")
    if case_path == DEFAULT_CASE and not case_path.exists():
        case_path = Path(DEFAULT_CASE.name)  # the one that comes with the package
    output = Output(json=as_json, quiet=quiet)
    interrupts = Interrupts(quiet)
    case = open_case(case_path, overrides)
    from mdstopo.front.run_front import check, run_front

    check(case)
    line = shlex.join(["mdstopo", *sys.argv[1:]])
    path = result_path(out, case, "pareto")
    ask = _asked(case, path if resume else None, weights, points, method, starts)
    again = resumed(line)
    with saying_how_to_go_on(output, "pareto", case.name, path, resume, again), front_display(quiet) as show:
        outcome = run_front(
            case,
            ask,
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


def resumed(line: str) -> str:
    """The command that continues what a command line began."""
    words = [word for word in shlex.split(line) if word not in ("--resume", "--overwrite")]
    return shlex.join([*words, "--resume"])


def _asked(
    case: "Case", earlier: Path | None, weights: str | None, points: int | None, method: str | None, starts: int | None
) -> "Ask":
    """What is to be computed; what is not said is as in the file that is resumed, else as in the case.

    case: the case.
    earlier: the file that is resumed; None where none is.
    weights: of the first of two objectives, as text.
    points: how many points.
    method: how the objectives are combined.
    starts: of every solve.
    """
    from mdstopo.front.run_front import Ask
    from mdstopo.store.result_reader import read_result

    if earlier is not None and earlier.exists():
        view = read_result(earlier, leave_out=("pareto/tasks", "pareto/visited", "members"))
        if view.kind == "pareto":
            method = method or str(view.settings["method"])
            starts = starts or int(view.settings["starts"])
            if weights is None and points is None:
                return Ask(view.array("pareto/weights").astype("f8"), method, starts)
    return Ask(_directions(case, weights, points), method or "", starts or case.optimizer.starts)


def _directions(case: "Case", weights: str | None, points: int | None) -> "NDArray[np.float64]":
    """Weights or anchors of the points of the front, (W, m)."""
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


def front_rows(names: list[str], part: "Mapping[str, Any]") -> list[list[str]]:
    """A front as a table: the columns of `pareto/...`, with those of further points behind (`store.whole_front`)."""
    from mdstopo.status import RunStatus

    rows = [["point", *(f"weight {name}" for name in names), *names, "status", "evaluations", "KKT", ""]]
    for j, status in enumerate(part["status"]):
        violation, was_visited = float(part["violation"][j]), status == RunStatus.VISITED
        remarks = ["dominated"] if part["dominated"][j] else []
        if violation > STATED:
            remarks.append(f"exceeds a constraint by {violation:.1e} of its bound")
        rows.append(
            [
                str(j),
                *("" if was_visited else number(weight, 4) for weight in part["weights"][j]),
                *(number(value, 7) for value in part["objectives"][j]),
                status.replace("_", " "),
                "" if was_visited else str(int(part["evaluations"][j])),
                "" if was_visited else number(float(part["kkt"][j]), 1),
                ", ".join(remarks),
            ]
        )
    return rows


def quality_rows(names: list[str], numbers: "Mapping[str, Any]", part: "Mapping[str, Any]") -> list[list[str]]:
    """Utopia and maxima that the points were found with, where there are any yet, and how good the front is."""
    import numpy as np

    from mdstopo.plan.front_measures import REFERENCE

    rows = [
        [title, ", ".join(f"{name} {number(value)}" for name, value in zip(names, part[title][0], strict=True))]
        for title in ("utopia", "maxima")
        if not np.isnan(part[title][0]).any()
    ]
    if "ideal" in part:
        scale = "; ".join(
            f"{title} {', '.join(number(value) for value in part[title])}" for title in ("ideal", "nadir")
        )
        rows += [
            ["hypervolume", f"{number(numbers['hypervolume'], 5)} up to {REFERENCE:g} of objectives scaled to {scale}"],
            ["spacing", f"{number(numbers['spacing'], 3)}, largest gap {number(numbers['largest_gap'], 3)}, scaled"],
        ]
    return rows


def _say(output: Output, outcome: "FrontOutcome") -> None:
    from mdstopo.status import RunStatus
    from mdstopo.store.whole_front import joined

    case = outcome.case
    output.say(f"{case.title or case.name}: {outcome.status.replace('_', ' ')} - {outcome.reason}")
    names = [objective.name for objective in case.objectives]
    part = joined(outcome.part, names)
    output.table(front_rows(names, part))
    for j, word in enumerate(part["status"]):
        if word == RunStatus.FAILED:
            output.say(f"point {j}: {part['reason'][j]}")
    good = outcome.quality
    numbers = {} if good is None else good.numbers()
    scale = {} if good is None else {"ideal": good.ideal, "nadir": good.nadir}
    output.table(quality_rows(names, numbers, {**part, **scale}))
    output.table(
        [
            ["method", outcome.method],
            ["evaluations", f"{outcome.evaluations} in {len(outcome.tasks)} solves"],
            ["time", duration(outcome.seconds)],
            ["result", str(outcome.path)],
        ]
    )


def _document(outcome: "FrontOutcome", again: str) -> dict[str, Any]:
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
    }
    part = outcome.part
    for name in ("objectives", "dominated", "kkt", "violation"):
        content[name] = part[name]
    content["point_status"] = part["status"]
    content["further"] = {
        name: part[f"further/{name}"]
        for name in ("objectives", "dominated", "violation", "point", "iterate")
        if f"further/{name}" in part
    }
    content["utopia"], content["maxima"] = part["utopia"][0], part["maxima"][0]
    if outcome.quality is not None:
        content |= outcome.quality.numbers()
        content |= {name: getattr(outcome.quality, name) for name in ("ideal", "nadir", "reference")}
    return content
