"""`mdstopo diff`: what differs between two results."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.options import FILE, RESULT_FILE, output_options
from mdstopo.cli.output import Output, number

if TYPE_CHECKING:
    from mdstopo.report.difference import Designs, Pair

#: keys that are told; more is counted
MOST_KEYS = 40
#: of members that only one result has, so many are named
NAMED_MEMBERS = 8


@click.command("diff")
@click.argument("first_path", metavar="A", type=RESULT_FILE)
@click.argument("second_path", metavar="B", type=RESULT_FILE)
@click.option("--picture", type=FILE, metavar="FILE", help="Draw both designs and what differs: .png, .svg or .pdf.")
@click.option("--dark", is_flag=True, help="On a dark ground.")
@output_options
def command(first_path: Path, second_path: Path, picture: Path | None, dark: bool, as_json: bool, quiet: bool) -> int:
    """Say what differs between two results: case, outcome, objectives, constraints, design.

    Members are compared by their groups and the places of their ends, so that cases with other points or groups can be
    compared, and final designs whose members have other numbers.
    Of a front it is the point in the middle. The exit status is 0 whether they differ or not.
    \f
    Arguments, which --help leaves out:

    first_path, second_path: the results.
    picture: where both designs are drawn; None draws nothing.
    dark: whether on a dark ground.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    from dataclasses import asdict

    from mdstopo.plots.source import Source
    from mdstopo.report.difference import difference

    output = Output(json=as_json, quiet=quiet)
    first, second = Source(first_path), Source(second_path)
    found = difference(first, second)
    if found.is_none:
        output.say("the two results are the same")
    for title, pairs in (("case", found.case), ("outcome", found.outcome)):
        _say(output, title, pairs)
    for title, pairs in (("objectives", found.objectives), ("constraints", found.constraints)):
        _say_values(output, title, pairs)
    if found.designs is not None:
        output.say("design")
        output.table(_design_rows(found.designs))
    if picture is not None:
        from mdstopo.plots.designs_plot import draw_pair
        from mdstopo.plots.style import save, styled

        with styled(dark) as module:
            save(draw_pair(module, first, second, (first_path.name, second_path.name)), picture)
        output.say(str(picture))
    output.document(
        {"command": "diff", "first": str(first_path), "second": str(second_path), "same": found.is_none,
         "picture": None if picture is None else str(picture)} | asdict(found)
    )  # fmt: skip
    return 0


def _say(output: Output, title: str, pairs: "list[Pair]") -> None:
    if not pairs:
        return
    output.say(title)
    output.table([_row(pair) for pair in pairs[:MOST_KEYS]])
    if len(pairs) > MOST_KEYS:
        output.say(f"  and {len(pairs) - MOST_KEYS} more")


def _row(pair: "Pair") -> list[str]:
    """Two values that differ, in a table: numbers that do so in few digits with all of them."""
    first, second = _short(pair.first), _short(pair.second)
    if first == second and isinstance(pair.first, float) and isinstance(pair.second, float):
        first, second = f"{pair.first!r}", f"{pair.second!r}"
    return [pair.name, first, "->", second]


def _short(value: Any) -> str:
    if value is None:
        return "(not there)"
    if isinstance(value, dict):
        return "(there)"
    text = number(value) if isinstance(value, float) else str(value)
    return text if len(text) <= 48 else f"{text[:45]}..."


def _say_values(output: Output, title: str, pairs: "list[Pair]") -> None:
    if not pairs:
        return
    rows = []
    for pair in pairs:
        row = [pair.name, _short(pair.first), "->", _short(pair.second)]
        if pair.first and pair.second is not None:
            row.append(f"{100.0 * (pair.second - pair.first) / abs(pair.first):+.3g} %")
        rows.append(row)
    output.say(title)
    output.table(rows)


def _design_rows(own: "Designs") -> list[list[str]]:
    rows = [["members in both", str(own.common)], ["other alpha", str(own.changed)]]
    rows += [["absent -> present", str(own.appeared)], ["present -> absent", str(own.vanished)]]
    if own.largest is not None and own.changed:
        rows.append(["largest change", f"{own.largest[0]:+.6g}, of {own.largest[1]}"])
    for title, members in (("only in the first", own.members_first), ("only in the second", own.members_second)):
        if own.only_first or own.only_second:
            rows.append([title, str(len(members))])
        rows += [["", words] for words in members[:NAMED_MEMBERS]]
        rows += [["", f"and {len(members) - NAMED_MEMBERS} more"]] if len(members) > NAMED_MEMBERS else []
    return rows
