"""`mdstopo finalize`: the members of a design that are worth having, as a case of their own."""

import math
import shlex
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.interrupt import Interrupts
from mdstopo.cli.options import EXIT, FILE, output_options, result_argument, set_option
from mdstopo.cli.output import Output, number
from mdstopo.cli.progress import display
from mdstopo.shown import counted

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.finalize.finalize_design import Finalized
    from mdstopo.store.result_reader import ResultView

_SIGNS = {"limit": "<=", "equals": "=", "at_least": ">="}


@click.command("finalize")
@result_argument
@click.option("--keep", type=click.IntRange(1), metavar="K", help="Keep the K members with the largest alpha.")
@click.option("--threshold", type=click.FloatRange(0.0), metavar="A", help="Keep the members with alpha >= A.")
@click.option("--out", type=FILE, metavar="CASE", help="Where to write the case (default: RESULT's name.final.yaml).")
@click.option("--overwrite", is_flag=True, help="Replace the case file that is there.")
@set_option
@output_options
def command(
    result_path: Path,
    keep: int | None,
    threshold: float | None,
    out: Path | None,
    overwrite: bool,
    overrides: dict[str, str],
    as_json: bool,
    quiet: bool,
) -> int:
    """Keep the members of a result of `run` that count, size them anew, verify them, write them as a case.

    Say --keep or --threshold. The sizes are optimised again from those in the result, with only these members, and so
    are parameters of laws that vary; the outcome is computed with a hundredth of the solver's tolerance. In the case
    that is written each member is a group of its own with its size and its parameters in its law: `mdstopo simulate`
    computes its motion without any design.
    \f
    Arguments, which --help leaves out:

    result_path: the result file of `run`.
    keep: how many members with the largest alpha are kept.
    threshold: or from which alpha on.
    out: where the case is written; None takes the result's name with .final.yaml.
    overwrite: whether a file that is there is replaced.
    overrides: values of the case's keys.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    if (keep is None) == (threshold is None):
        raise click.UsageError("say --keep or --threshold, one of them")
    if threshold is not None and not math.isfinite(threshold):
        raise click.BadParameter(f"{threshold} is no alpha, which is a finite number", param_hint="--threshold")
    from mdstopo.finalize.finalize_design import finalize, opened, ready, tied
    from mdstopo.store.atomic import replace_file
    from mdstopo.store.result_reader import read_result
    from mdstopo.store.store_errors import StoreError

    output = Output(json=as_json, quiet=quiet)
    interrupts = Interrupts(quiet)
    view = read_result(result_path, leave_out=("trajectories", "sensitivities", "optimizer", "iterations"))
    place = out or result_path.with_suffix(".final.yaml")
    if place.exists() and not (overwrite and place.is_file()):
        raise StoreError(f"{place} exists already; it is left as it is")
    case, design = opened(view, overrides, output.notice)
    alpha = design[: case.n_design]
    for taken in (result_path, case.path):
        if taken is not None and place.exists() and taken.exists() and place.samefile(taken):
            raise StoreError(f"{place}: this is what the new case is made from; choose another place with --out")
    kept, reduced = ready(case, design, keep, threshold)
    if not view.finished:
        output.notice(f"{result_path}: the run is not finished ({view.status}); its best design so far is taken")
    if others := tied(alpha, kept):
        output.notice(
            f"{others} more members have the alpha of the smallest one kept: of equal ones the first are kept"
        )
    if keep is not None and len(kept) > keep:
        output.notice(
            f"{len(kept) - keep} more members are kept: they have one alpha (`shared`, `mirrored`) with the others"
        )
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{place}: cannot be written: {error.strerror}") from error
    with display(quiet) as show:
        done = finalize(
            case,
            design,
            kept,
            reduced,
            place=place,
            head=partial(_head, case),
            on_iteration=show,
            stop_requested=interrupts.stop_requested,
            notify=output.notice,
        )
    if done.text:
        replace_file(place, done.text.encode())
    _say(output, done, place)
    if done.text:
        _say_held(output, view, case)
    output.document(_document(done, place))
    for warning in (*_warnings(done), *(each for each in map(_trouble, done.columns) if each)):
        output.notice(f"warning: {warning}")
    if not done.text and (quiet or as_json):  # else it stands first
        output.notice(f"{place} is not written: {_why(done)}")
    return EXIT[done.outcome.status] or (0 if done.text else 1)


def _head(case: "Case", count: int) -> str:
    """Where a case comes from, as comments."""
    command_line = shlex.join(["mdstopo", *sys.argv[1:]]).replace("\n", " ")
    return (
        f"# {count} of the {case.n_design:,} members of {case.name}, sized: {command_line}\n"
        "# Each is a group, and its law and cost are those of its size: alpha is 1.\n"
    )


def _say_held(output: Output, view: "ResultView", case: "Case") -> None:
    """Tell which variables of the result (`view`) are none of the case that is sized anew, and so stay."""
    from mdstopo.case.text.words import listed

    if held := sorted(set(view.under("design/variables")) - {each.name for each in case.variables}):
        keep = f"{listed(held)} keep the values" if len(held) > 1 else f"{held[0]} keeps the value"
        output.notice(f"{keep} of the result: defined names and points are not optimised again with the members kept")


def _say(output: Output, done: "Finalized", place: Path) -> None:
    outcome = done.outcome
    ended = f"{outcome.status.replace('_', ' ')} - {outcome.reason}"
    # what was asked for is a case; how its sizes ended is told of one that is refused, but not first
    head, sizes = (ended, "") if done.text else (f"not written - {_why(done)}", ended)
    output.say(f"{done.case.title or done.case.name}: {head}")
    if done.columns:
        rows = [["", *(column.title for column in done.columns)]]
        found = [column.evaluation for column in done.columns]
        names = [objective.name for objective in done.case.objectives]
        rows += [[name, *(number(each.objectives[name], 9) for each in found)] for name in names]
        for i, row in enumerate(done.case.constraints):
            values = (number(float(each.constraints[i]) + row.bound, 9) for each in found)
            rows.append([_constraint(done.case, i), *values])
        rows.append(["members", *(str(column.members) for column in done.columns)])
        rows += _values(done)
        output.table(rows)
    rows = [["sizes", sizes]] if sizes else []
    rows.append(["iterations", f"{outcome.iterations}, {outcome.evaluations} evaluations"])
    if done.tighter:
        rows.append(["verified with", done.tighter])
    if done.difference is not None:
        rows.append(["the case repeats", f"objectives within {number(done.difference, 2)} of themselves"])
    if done.text:
        count = len(done.kept)
        left_out = f"; {count - done.written} of {count} have no size and are left out" if count > done.written else ""
        rows += [["written", f"{counted(done.written, 'member')}{left_out}"], ["case", str(place)]]
    output.table(rows)


def _values(done: "Finalized") -> list[list[str]]:
    """The values of each variable in the four designs; of several the lowest and the highest."""
    full = getattr(done.columns[0].evaluation, "variables", {})
    rows = []
    for each in done.case.variables:
        own = [found for found in done.values if found.name == each.name]
        before, now = [found.before for found in own], [found.value for found in own]
        title = f"{each.name}, {each.unit}" if each.unit else each.name
        rows.append([title, _range(full[each.name].tolist()), _range(before), _range(now), _range(now)])
    return rows


def _range(values: list[float]) -> str:
    if not values:
        return "-"
    least, most = min(values), max(values)
    return number(most, 9) if least == most else f"{number(least)} to {number(most)}"


def _constraint(case: "Case", i: int) -> str:
    """A constraint and its bound in words."""
    from mdstopo.case.responses.response_units import constrained

    row = case.constraints[i]
    return f"{constrained(case, row)} {_SIGNS[row.sense]} {number(row.bound, 9)}"


def _trouble(column: Any) -> str:
    """What is wrong with the motion of a design, or nothing."""
    found = column.evaluation
    return "" if found.status.ok else f"{column.title}: {found.status.value}: {getattr(found, 'message', '')}"


def _warnings(done: "Finalized") -> tuple[str, ...]:
    moved = [done.equilibria.moved] if done.equilibria.moved else []
    return (*done.outcome.warnings, *done.told, *moved, *done.worse)


def _why(done: "Finalized") -> str:
    if not done.columns:
        return "the run was interrupted"
    if done.equilibria.lost:
        return f"{done.equilibria.lost}; keep more members"
    if any(not column.evaluation.status.usable for column in done.columns[-2:]):
        return "the motion of its design cannot be computed"
    return "all members have alpha = 0"


def _document(done: "Finalized", place: Path) -> dict[str, Any]:
    return {
        "command": "finalize",
        "case": done.case.name,
        "status": str(done.outcome.status),
        "reason": done.outcome.reason,
        "designs": [
            {
                "name": column.title,
                "members": column.members,
                "status": column.evaluation.status.value,
                "objectives": column.evaluation.objectives,
                "constraints": column.evaluation.constraints,
            }
            for column in done.columns
        ],
        "kept": [
            {"group": group, "member": member, "alpha_before": before, "alpha": after}
            for (group, member), before, after in zip(
                done.places, done.before.tolist(), done.alpha.tolist(), strict=True
            )
        ],
        "variables": [
            {
                "name": each.name,
                "member": each.member,
                "unit": each.unit,
                "value_before": each.before,
                "value": each.value,
            }
            for each in done.values
        ],
        "iterations": done.outcome.iterations,
        "evaluations": done.outcome.evaluations,
        "verified_with": done.tighter or None,
        "difference": done.difference,
        "written": done.written,
        "warnings": _warnings(done),
        "path": str(place) if done.text else None,
        "not_written": None if done.text else _why(done),
    }
