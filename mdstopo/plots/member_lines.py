"""Members as lines: the wider, the more of them there is."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mdstopo.case.model import Case
from mdstopo.plots.acting import IDLE, NOT_ACTING, acting
from mdstopo.plots.beside import FREE, side_places, sideways
from mdstopo.plots.legend import name_in_legend
from mdstopo.plots.slack import THIN, member_lines
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.style import MOST_NAMED, colour, ink
from mdstopo.plots.thickness import Thickness, families, strongest

#: points: the widest member where there are few, where there are many, and the narrowest
WIDEST, CROWDED, NARROWEST = 2.4, 0.4, 0.35
#: dashes of a slack member, in its widths
HANGING = (0, (3.0, 2.0))
#: dots of a member that does not act, in its widths
DOTTED = (0, (1.0, 2.0))
#: members that are few, and that are many; those that are drawn, the strongest first
FEW_MEMBERS, MANY_MEMBERS, MOST_DRAWN = 40, 1000, 20_000


def draw_members(
    axis: Any,
    source: Source,
    q: Floats,
    seen: Callable[[Floats], Floats],
    thick: Thickness,
    t: float | None = None,
) -> None:
    """Lines for all groups at a state q; belts that are slack hang through, thin and dashed, and members that do not
    act are thin, straight and dotted in grey.

    axis: where they are drawn.
    source: the result.
    q: the state.
    seen: places (n, d) on the paper (n, 2).
    thick: how thick members are.
    t: the time that is shown, s; None where there is none, for which every member is drawn as one that acts.
    """
    case = source.case
    chosen = strongest(thick.shares, MOST_DRAWN)
    widest = widest_of(sum(len(each) for each in chosen))
    named = families(case)
    order = list(dict.fromkeys(named))
    any_slack = any_idle = False
    every = zip(case.members, thick.shares, chosen, side_places(case, chosen), named, strict=True)
    for group, share, some, side, family in every:
        rising = np.argsort(share[some])
        some, side = some[rising], side[rising]
        acts = acting(source, group, t)
        lines, slack = member_lines(case, group, q, seen, some, acts)
        idle, widths = ~acts[some], NARROWEST + (widest - NARROWEST) * share[some]
        ends, hue = slice(None, None, lines.shape[1] - 1), colour(order.index(family))
        for own, corners, style, own_colour, wide in (
            (~(slack | idle), ends, "-", hue, widths),
            (slack, slice(None), HANGING, hue, THIN * widths),
            (idle, ends, DOTTED, ink("middle"), np.full(len(some), min(IDLE, widest))),
        ):
            if own.any():
                add_lines(
                    axis, lines[own][:, corners], side[own], widest, colors=own_colour, linewidths=wide[own],
                    alpha=0.85, linestyles=[style], zorder=2.2,
                )  # fmt: skip
        any_slack |= bool(slack.any())
        any_idle |= bool(idle.any())
    chosen_from = {each for group, each in zip(case.members, named, strict=True) if group.design}
    for family in order if len(order) <= MOST_NAMED else ():
        star = "" if family in chosen_from or not chosen_from else "*"
        axis.plot(
            [], [], "-", color=colour(order.index(family)), label=f"{name_in_legend('members', family, case)}{star}"
        )
    if any_slack:
        axis.plot([], [], color=ink("middle"), linewidth=0.8, linestyle=HANGING, label="slack")
    if any_idle:
        axis.plot([], [], color=ink("middle"), linewidth=IDLE, linestyle=DOTTED, label=NOT_ACTING)


def add_lines(axis: Any, lines: Floats, side: Floats, widest: float, **style: Any) -> None:
    """Lines of members on the paper.

    axis: where they are drawn.
    lines (K, n, 2): their corners.
    side (K,): of `side_places`.
    widest: points, the width of the widest.
    style: settings of the lines.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.transforms import Affine2D

    if np.any(side):
        shifts = (widest + FREE) * sideways(lines, side) * _ahead(axis)
        style |= {"offsets": shifts, "offset_transform": Affine2D().scale(1.0 / 72.0) + axis.figure.dpi_scale_trans}
    axis.add_collection(LineCollection(list(lines), **style), autolim=False)


def _ahead(axis: Any) -> Floats:
    """(2,) -1 where an axis of a picture runs backwards."""
    return np.array([-1.0 if axis.xaxis_inverted() else 1.0, -1.0 if axis.yaxis_inverted() else 1.0])


def legend_title(case: Case, thick: Thickness) -> str | None:
    """What the width of lines is, and what the star at names means; None where widths say nothing."""
    varied = [group.design for group in case.members]
    starred = "; *: not varied" if any(varied) and not all(varied) else ""
    return f"width: {thick.what}{starred}" if thick.what else None


def widest_of(count: int) -> float:
    """Points: how wide the widest of so many members is, so that they do not cover each other."""
    share = np.clip(np.log(max(count, 1) / FEW_MEMBERS) / np.log(MANY_MEMBERS / FEW_MEMBERS), 0.0, 1.0)
    return float(WIDEST + (CROWDED - WIDEST) * share)
