"""Members as lines: the wider, the more of them there is."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.model import MemberGroup
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.style import MOST_NAMED, colour
from mdstopo.plots.thickness import Thickness, families, strongest

#: points: the widest member where there are few, where there are many, and the narrowest
WIDEST, CROWDED, NARROWEST = 2.4, 0.5, 0.35
#: members that are few, and that are many; those that are drawn, the strongest first
FEW, MANY, MOST = 40, 4000, 20_000


def draw_members(axis: Any, source: Source, ends_of: Callable[[MemberGroup], Floats], thick: Thickness) -> None:
    """Lines for all groups. ends_of: where both ends of a group's members are drawn, (M, 2, 2)."""
    from matplotlib.collections import LineCollection

    case = source.case
    chosen = strongest(thick.shares, MOST)
    widest = widest_of(sum(len(each) for each in chosen))
    named = families(case)
    order = list(dict.fromkeys(named))
    for group, share, some, family in zip(case.members, thick.shares, chosen, named, strict=True):
        own, style = colour(order.index(family)), "-" if group.design else "--"
        some = some[np.argsort(share[some])]
        widths = NARROWEST + (widest - NARROWEST) * share[some]
        axis.add_collection(
            LineCollection(
                list(ends_of(group)[some]), colors=own, linewidths=widths, alpha=0.85, linestyles=style, zorder=2.2
            ),
            autolim=True,
        )
    for family in order if len(order) <= MOST_NAMED else ():
        has_design = any(group.design for group, each in zip(case.members, named, strict=True) if each == family)
        axis.plot([], [], "-" if has_design else "--", color=colour(order.index(family)), label=family)


def widest_of(count: int) -> float:
    """Points: how wide the widest of so many members is, so that they do not cover each other."""
    share = np.clip(np.log(max(count, 1) / FEW) / np.log(MANY / FEW), 0.0, 1.0)
    return float(WIDEST + (CROWDED - WIDEST) * share)
