"""Members as lines: the wider, the more of them there is."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.model import MemberGroup
from mdstopo.plots.scenery import sizes
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.style import COLOURS, MOST_NAMED

#: of the range of alpha: what is thinner is not drawn
FAINT = 0.02
#: points: the widest member, the narrowest
WIDEST, NARROWEST = 1.6, 0.15
#: members of one group that are drawn, the strongest first
MOST = 20_000


def draw_members(axis: Any, source: Source, ends_of: Callable[[MemberGroup], Floats]) -> None:
    """Lines for all groups. ends_of: where both ends of a group's members are drawn, (M, 2, 2)."""
    from matplotlib.collections import LineCollection

    case = source.case
    slices = case.group_slices
    for k, group in enumerate(case.members):
        ends = ends_of(group)
        colour = COLOURS[k % len(COLOURS)]
        style = "-"
        if group.design:
            share = sizes(group, source.alpha[slices[group.name]])
        else:
            share, style = np.full(len(group), 0.5), "--"
        order = np.argsort(share)[-MOST:]
        order = order[share[order] > FAINT]
        widths = NARROWEST + (WIDEST - NARROWEST) * share[order]
        axis.add_collection(
            LineCollection(list(ends[order]), colors=colour, linewidths=widths, alpha=0.8, linestyles=style),
            autolim=True,
        )
        if len(case.members) <= MOST_NAMED:
            axis.plot([], [], style, color=colour, label=group.name)
