"""The outcomes as the documentation shows them."""

from collections.abc import Sequence

from mdstopo.bench.machine import system
from mdstopo.stress.registry import FAMILIES, scenes_of
from mdstopo.stress.scene import Outcome


def markdown_of(outcomes: Sequence[Outcome]) -> str:
    """The page of results: a table for each family of scenes, and the machine."""
    parts = []
    by_name = {each.scene.name: each for each in outcomes}
    for family, words in FAMILIES.items():
        found = [by_name[scene.name] for scene in scenes_of(family) if scene.name in by_name]
        if found:
            rows = [_row(each) for each in found]
            head = ["| scene | integrator | what is compared | outcome | error | bound | s |", "|" + " --- |" * 7]
            parts += [f"### {words[0].upper()}{words[1:]} {{ #stress-{family} }}", "", *head, *rows, ""]
    right = sum(each.ok for each in outcomes)
    parts += [f"{right} of {len(outcomes)} scenes end as they have to. Computed on: {system()}."]
    return "\n".join(parts)


def _row(each: Outcome) -> str:
    scene = each.scene
    ended = each.outcome if each.ok else f"**{each.outcome}**"
    if each.message:
        ended += f": {_short(each.message)}"
    if each.note:
        ended += f"; {each.note}"
    error = "" if each.error is None else f"{each.error:.1e}"
    bound = "" if scene.refusal else f"{scene.bound:.0e}"
    cells = f"`{scene.name}`", scene.integrator, scene.checks, ended, error, bound, f"{each.seconds:.2g}"
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _short(message: str) -> str:
    """A message in a cell: one line, without the place in the file, which a reader has not."""
    line = " ".join(message.split())
    return line.removeprefix("<text>:")
