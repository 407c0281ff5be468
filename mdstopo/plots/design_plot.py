"""The design variables: which members are there."""

from typing import Any

import numpy as np

from mdstopo.plots.legend import name_in_legend
from mdstopo.plots.source import Source
from mdstopo.plots.style import HEIGHT, MOST_NAMED, colour, new_figure

#: groups whose names have room beside the stems; letters of a name of which two have room in a line; a line in inches
FEW_GROUPS, LETTERS_OF_TWO, LINE_HEIGHT = 4, 22, 0.14
#: members that still are stems of their own
STEMS = 400


def draw(module: Any, source: Source) -> Any:
    """Draw alpha by member, group beside group."""
    groups = source.case.group_slices
    above = FEW_GROUPS < len(groups) <= MOST_NAMED  # names beside the stems would hide some
    columns = 2 if max(map(len, groups), default=0) <= LETTERS_OF_TWO else 1
    lines = -(-len(groups) // columns) if above else 0
    figure, (axis,) = new_figure(module, height=HEIGHT + LINE_HEIGHT * lines)
    alpha = source.alpha
    for k, (name, part) in enumerate(groups.items()):
        places = np.arange(part.start, part.stop)
        own = colour(k)
        if len(alpha) <= STEMS:
            axis.vlines(places, 0.0, alpha[part], color=own, linewidth=0.8)
        axis.plot(places, alpha[part], ".", color=own, markersize=2, label=name_in_legend("members", name))
    axis.set_xlabel("member")
    axis.set_ylabel("alpha")
    axis.set_ylim(bottom=min(0.0, float(alpha.min(initial=0.0))))
    if above:
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, markerscale=2.0)
    elif 1 < len(groups) <= FEW_GROUPS:
        axis.legend()
    return figure
