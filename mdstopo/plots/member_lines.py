"""Members as lines: the wider, the more of them there is."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.slack import member_lines
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.style import MOST_NAMED, colour, ink
from mdstopo.plots.thickness import Thickness, families, strongest

#: points: the widest member where there are few, where there are many, and the narrowest
WIDEST, CROWDED, NARROWEST = 2.4, 0.5, 0.35
#: of a slack member: its dashes, and how wide it is, as a share of a taut one
HANGING, THIN = (0, (3.0, 2.0)), 0.5
#: members that are few, and that are many; those that are drawn, the strongest first
FEW, MANY, MOST = 40, 4000, 20_000


def draw_members(axis: Any, source: Source, q: Floats, seen: Callable[[Floats], Floats], thick: Thickness) -> None:
    """Lines for all groups at a state q; belts that are slack hang through, thin and dashed.

    axis: where they are drawn.
    source: the result.
    q: the state.
    seen: places (n, d) on the paper (n, 2).
    thick: how thick members are.
    """
    from matplotlib.collections import LineCollection

    case = source.case
    chosen = strongest(thick.shares, MOST)
    widest = widest_of(sum(len(each) for each in chosen))
    named = families(case)
    order = list(dict.fromkeys(named))
    any_slack = False
    for group, share, some, family in zip(case.members, thick.shares, chosen, named, strict=True):
        some = some[np.argsort(share[some])]
        lines, slack = member_lines(case, group, q, seen, some)
        widths = NARROWEST + (widest - NARROWEST) * share[some]
        for hangs, style, factor in ((False, "-", 1.0), (True, HANGING, THIN)):
            own = slack == hangs
            if hangs and not own.any():
                continue
            corners = slice(None) if hangs else slice(None, None, lines.shape[1] - 1)
            axis.add_collection(
                LineCollection(
                    list(lines[own][:, corners]), colors=colour(order.index(family)), linewidths=factor * widths[own],
                    alpha=0.85, linestyles=[style], zorder=2.2,
                ),
                autolim=True,
            )  # fmt: skip
        any_slack |= bool(slack.any())
    chosen_from = {each for group, each in zip(case.members, named, strict=True) if group.design}
    for family in order if len(order) <= MOST_NAMED else ():
        label = family if family in chosen_from or not chosen_from else f"{family}*"
        axis.plot([], [], "-", color=colour(order.index(family)), label=label)
    if any_slack:
        axis.plot([], [], color=ink("middle"), linewidth=0.8, linestyle=HANGING, label="slack")


def legend_title(case: Case, thick: Thickness) -> str | None:
    """What the width of lines is, and what the star at names means; None where widths say nothing."""
    varied = [group.design for group in case.members]
    starred = "; *: not varied" if any(varied) and not all(varied) else ""
    return f"width: {thick.what}{starred}" if thick.what else None


def widest_of(count: int) -> float:
    """Points: how wide the widest of so many members is, so that they do not cover each other."""
    share = np.clip(np.log(max(count, 1) / FEW) / np.log(MANY / FEW), 0.0, 1.0)
    return float(WIDEST + (CROWDED - WIDEST) * share)
