"""The design variables: which members are there."""

from typing import Any

import numpy as np

from mdstopo.plots.source import Source
from mdstopo.plots.style import MOST_NAMED, colour, new_figure

#: members that still are stems of their own
STEMS = 400


def draw(module: Any, source: Source) -> Any:
    """alpha by member, group beside group."""
    figure, (axis,) = new_figure(module)
    alpha = source.alpha
    for k, (name, part) in enumerate(source.case.group_slices.items()):
        places = np.arange(part.start, part.stop)
        own = colour(k)
        if len(alpha) <= STEMS:
            axis.vlines(places, 0.0, alpha[part], color=own, linewidth=0.8)
        axis.plot(places, alpha[part], ".", color=own, markersize=2, label=name)
    axis.set_xlabel("member")
    axis.set_ylabel("alpha")
    axis.set_ylim(bottom=min(0.0, float(alpha.min(initial=0.0))))
    if 1 < len(source.case.group_slices) <= MOST_NAMED:
        axis.legend()
    return figure
