"""`mdstopo bound`: what no members can do better."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.options import CASE_FILE, RESULT_FILE, output_options, set_option
from mdstopo.cli.output import Output, number

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.limiting.compare import Compared
    from mdstopo.store.result_reader import ResultView


@click.command("bound")
@click.argument("case_path", metavar="CASE", type=CASE_FILE)
@click.option(
    "--result", "result_file", type=RESULT_FILE, metavar="FILE", help="Compare with a result of run or pareto."
)
@set_option
@output_options
def command(case_path: Path, result_file: Path | None, overrides: dict[str, str], as_json: bool, quiet: bool) -> int:
    """Bound peaks of acceleration and travel from below, for all members that could be.

    Members are replaced by forces that are free in time. What these cannot do under the limits of the case, no design
    can: the least peak acceleration for a given travel of a body's centre of mass, or the least travel for a given
    acceleration. Where theory gives no bound, it says why. Nothing is simulated.
    """
    from mdstopo.case.reader import load_case
    from mdstopo.limiting.compare import compared
    from mdstopo.store.result_reader import read_result

    output = Output(json=as_json, quiet=quiet)
    case = load_case(case_path, overrides)
    view = None
    if result_file is not None:
        view = read_result(result_file, leave_out=("optimizer", "pareto/tasks", "sweep/tasks"))
        if view.case_sha256 != case.sha256:
            output.notice(f"warning: {result_file} was made from another version of the case; limits may differ")
    found = compared(case, view)
    output.say(f"{case.title or case.name} ({case_path})")
    if not found:
        output.say("the case has no objectives")
    say_bounds(output, case, found)
    output.document({"objectives": {name: document(each) for name, each in found.items()}})
    return 0


def say_bounds(output: Output, case: "Case", found: "Mapping[str, Compared]") -> None:
    """A line for each bound, with the best and the gap where they are known, and a sentence on what it is over."""
    from mdstopo.case.responses.response_units import unit_of_value

    units = {each.name: unit_of_value(each) for each in case.objectives}
    side = {each.name: "at most" if each.sense == "maximize" else "at least" for each in case.objectives}
    for name, each in found.items():
        if each.bound is None:
            output.say(f"  {name}: no bound: {each.why}")
            continue
        output.say(f"  {name}: {side[name]} {number(each.bound)} {units[name]}{reached(each)}")
        output.say(f"    {each.why}")


def reached(each: "Compared") -> str:
    """The best and its gap in words, with a comma before; empty where there is none."""
    if each.best is None:
        return ""
    share = "" if each.gap is None else f", {100.0 * each.gap:.3g} % of it above the bound"
    if each.gap is not None and each.gap < 0.0:
        share = f", {-100.0 * each.gap:.2g} % of it beyond the bound"
    return f"; best {number(each.best)}{share}"


def document(each: "Compared") -> dict[str, Any]:
    """The bound of one objective as values for JSON."""
    return {"bound": each.bound, "why": each.why, "best": each.best, "gap": each.gap}


def result_bounds(view: "ResultView") -> "tuple[Case, dict[str, Compared]] | None":
    """The case of a result of run or pareto, and its bounds beside its best; None where there is no bound to tell."""
    from mdstopo.case.text.errors import CaseError
    from mdstopo.limiting.compare import compared
    from mdstopo.store.stored_case import case_of

    if view.kind not in ("run", "pareto"):
        return None
    try:
        case = case_of(view)
    except CaseError:
        return None  # files that the case includes are gone
    found = {name: each for name, each in compared(case, view).items() if each.bound is not None}
    return (case, found) if found else None
