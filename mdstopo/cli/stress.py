"""`mdstopo stress`: scenes at the edges of what can be computed, each against an independent value."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.options import FILE, output_options
from mdstopo.cli.output import Output, duration, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mdstopo.stress.scene import Outcome, Scene

_HEAD = ("scene", "integrator", "outcome", "error", "bound", "time")


@click.command("stress")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option("--long", is_flag=True, help="Also the scenes that take minutes: a million periods.")
@click.option("--cases", "folder", type=FILE, metavar="DIR", help="Write the cases of the scenes there, run nothing.")
@click.option("--markdown", is_flag=True, help="Print what the documentation has: a table a family, in Markdown.")
@output_options
def command(names: tuple[str, ...], long: bool, folder: Path | None, markdown: bool, as_json: bool, quiet: bool) -> int:
    """Compute extreme scenes and compare each with an independent value, or with the refusal it has to end in.

    NAME is a family of scenes, a scene, or what names of scenes begin with; default: all. Ends with 1 where a scene
    does not end as it has to.
    \f
    Arguments, which --help leaves out:

    names: the NAMEs; none takes all.
    long: whether scenes that take minutes are computed too.
    folder: where the cases of the scenes are written, instead of computing them.
    markdown: whether tables are printed as the documentation has them.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    from mdstopo.stress.registry import FAMILIES, chosen, scenes

    try:
        found = chosen(names, long)
    except KeyError as wrong:
        from difflib import get_close_matches

        near = get_close_matches(wrong.args[0], [*FAMILIES, *scenes()], n=1)
        hint = f"did you mean `{near[0]}`?" if near else f"there are the families {', '.join(FAMILIES)}"
        raise click.UsageError(f"no scene or family `{wrong.args[0]}`; {hint}") from None
    output = Output(json=as_json, quiet=quiet)
    if folder is not None:
        _write(folder, found)
        output.say(f"{len(found)} cases are in {folder}")
        return 0
    outcomes = _run(output, found, markdown)
    failed = [each for each in outcomes if not each.ok]
    if markdown:
        from mdstopo.stress.stress_page import markdown_of

        output.say(markdown_of(outcomes))
    else:
        for each in failed:
            output.say(f"{each.scene.name}: {_expectation(each.scene)}, but {told(each)}")
        output.say(f"{len(outcomes) - len(failed)} of {len(outcomes)} scenes end as they have to")
    output.document(_document(outcomes))
    return 1 if failed else 0


def _write(folder: Path, scenes: "Sequence[Scene]") -> None:
    from mdstopo.store.store_errors import StoreError

    try:
        folder.mkdir(parents=True, exist_ok=True)
        for scene in scenes:
            (folder / f"{scene.name}.yaml").write_text(scene.text, encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {error.strerror}") from error


def _run(output: Output, scenes: "Sequence[Scene]", markdown: bool) -> "list[Outcome]":
    """Every scene in order; a row is printed when it is done."""
    from mdstopo.stress.scene_watch import Watch, compiled

    if not compiled():
        output.notice("scenes take longer the first time, because kernels are compiled: some ten minutes in all")
    widths = [max(len(scene.name) for scene in scenes), max(len(scene.integrator) for scene in scenes), 10, 8, 8]

    def say(cells: "Sequence[str]") -> None:
        padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
        output.say(("  " + "  ".join([*padded, *cells[len(widths) :]])).rstrip())

    if not markdown:
        say(_HEAD)
    outcomes = []
    with Watch() as watch:
        for outcome in watch.outcomes(scenes):
            outcomes.append(outcome)
            if not markdown:
                say(row(outcome))
    return outcomes


def row(outcome: "Outcome") -> list[str]:
    """The cells of the table's row for one scene."""
    scene = outcome.scene
    return [
        scene.name,
        scene.integrator,
        outcome.outcome if outcome.ok else f"{outcome.outcome} !",
        "" if outcome.error is None else number(outcome.error, 2),
        "" if scene.refusal else number(scene.bound, 2),
        f"{duration(outcome.seconds)}{f'; {outcome.note}' if outcome.note else ''}",
    ]


def _expectation(scene: "Scene") -> str:
    if scene.refusal:
        return f"is to be refused with {', '.join(map(repr, scene.refusal))}"
    return f"is to be right within {number(scene.bound, 2)}"


def told(outcome: "Outcome") -> str:
    """How a scene has ended, in words."""
    if outcome.error is not None:
        return f"its error is {number(outcome.error, 3)}"
    return f"it {outcome.outcome if outcome.outcome.endswith('s') else 'is ' + outcome.outcome}: {outcome.message}"


def _document(outcomes: "Sequence[Outcome]") -> dict[str, Any]:
    return {
        "command": "stress",
        "status": "converged" if all(each.ok for each in outcomes) else "failed",
        "scenes": [
            {
                "name": each.scene.name,
                "checks": each.scene.checks,
                "integrator": each.scene.integrator,
                "expected": each.scene.expected,
                "outcome": each.outcome,
                "ok": each.ok,
                "error": each.error,
                "bound": None if each.scene.refusal else each.scene.bound,
                "message": each.message,
                "note": each.note,
                "seconds": each.seconds,
            }
            for each in outcomes
        ],
    }
