"""Legends of layouts: what they name, and how many columns they have room for."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.acting import NOT_ACTING, any_timed
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.slack import belt_lengths
from mdstopo.plots.style import MOST_NAMED
from mdstopo.plots.symbols import symbols
from mdstopo.plots.thickness import families

#: how legends are set, in letters: the lines beside names, between these and the names, between columns
SETTING = {"handlelength": 1.7, "handletextpad": 0.6, "columnspacing": 1.0, "alignment": "left", "borderaxespad": 0.3}
#: inches: a name has so much beside its letters, and so much for each; a line; above the
#: lines with a title, and without
BESIDE, LETTER, LINE, HEAD, EDGE = 0.33, 0.058, 0.15, 0.22, 0.08
#: rows after which it counts that one is a little higher than a line, and by how much, in inches
ROWS, MORE = 8, 0.01
#: letters of a name for which there is room; those of its beginning that stay where it is longer
LONGEST, BEGINNING = 50, 30

#: what else than bodies and groups may be in a legend
WORDS = frozenset({"contact", "slack", NOT_ACTING, *(glyph.words for glyph in glyphs().values())})


def name_in_legend(kind: str, name: str, case: Case | None = None) -> str:
    """What a legend calls a body or a group of members: its name, with the word `kind` before it where the name alone
    would be left out by matplotlib (`_a`) or is that of something else in the legend of a case (`load`).

    A name for which there is no room lacks its middle, for names differ most often by their ends.
    """
    is_other = case is not None and name in WORDS and name in _words(case)
    whole = f"{kind} {name}" if name.startswith("_") or is_other else name
    return whole if len(whole) <= LONGEST else f"{whole[:BEGINNING]}\u2026{whole[BEGINNING + 1 - LONGEST :]}"


def _words(case: Case) -> set[str]:
    """What legends of a case name besides bodies and groups."""
    found = {glyphs()[each.kind].words for load_case in case.load_cases for each in symbols(case, load_case.name)}
    found |= {"contact"} if case.contacts else set()
    found |= {NOT_ACTING} if any_timed(case) else set()
    return found | {"slack" for group in case.members if belt_lengths(case, group) is not None}


def legend_names(case: Case, load_case: str | None = None, at_times: bool = False) -> list[str]:
    """What a layout's legend may name, about in its order. at_times: of a picture of a motion at some of its times."""
    groups = dict.fromkeys(families(case))
    names = [*["contact"] * bool(case.contacts), *(name_in_legend("body", body.name, case) for body in case.bodies)]
    names += [f"{name_in_legend('members', group, case)}*" for group in groups] if len(groups) <= MOST_NAMED else []
    names += ["slack"] * any(belt_lengths(case, group) is not None for group in case.members)
    names += [NOT_ACTING] * (at_times and any_timed(case))
    return [*names, *{glyphs()[each.kind].words: None for each in symbols(case, load_case)}]


def columns_of(names: Sequence[str], width: float, most: int) -> int:
    """How many columns names can have in a width in inches, at most so many; they are filled one after the other."""
    for columns in range(min(most, len(names)), 1, -1):
        parts = np.array_split(np.array([len(name) for name in names]), columns)
        if sum(BESIDE + LETTER * int(part.max()) for part in parts) <= width:
            return columns
    return 1


def height_of(count: int, columns: int, title: str | None) -> float:
    """Inches that a legend of so many names in so many columns takes, with its title where it has one."""
    rows = -(-count // columns)
    return (HEAD if title else EDGE) + LINE * rows + MORE * max(0, rows - ROWS)


def legend_handles(*axes: Any) -> tuple[list[Any], list[str]]:
    """The entries of a legend of drawings, those of symbols last: lines whose marker is a shape of its own.

    What the first drawing does not have, as members that are slack or do not act at a later time, is there once.
    """
    from matplotlib.path import Path

    handles, labels = axes[0].get_legend_handles_labels()
    for axis in axes[1:]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            if label not in labels:
                handles, labels = [*handles, handle], [*labels, label]
    order = sorted(range(len(labels)), key=lambda k: isinstance(getattr(handles[k], "get_marker", str)(), Path))
    return [handles[k] for k in order], [labels[k] for k in order]
