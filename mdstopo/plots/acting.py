"""Which members act at a time: laws begin at `active_from` and end at `active_until`, which may be design variables."""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case, MemberGroup
from mdstopo.plots.source import Floats, Source
from mdstopo.plots.windows_of_laws import is_timed

Mask = NDArray[np.bool_]

#: what a legend says of members that do not act
NOT_ACTING = "not acting"
#: points: how wide they are, at most as wide as the widest; their dots on a screen in pixels, drawn and free
IDLE, DOTS = 0.6, (1.5, 3)


def acting(source: Source, group: MemberGroup, t: float | None) -> Mask:
    """(M,) which members of a group act at a time t (s): those of which any law acts, of the design that is shown.

    A law acts from `active_from` on and no more at `active_until`. t None: where no time is shown, as in the picture of
    a design, all are drawn as members that act.
    """
    if t is None or not is_timed(source.case, group):
        return np.ones(len(group), dtype=bool)
    return np.asarray(acts_in(source.windows[group.name], t))


def acts_in(windows: Floats, t: Floats | float) -> Mask:
    """(T, M), of one time (M,): which members act at times t (T,), s. windows (M, L, 2): of `active_windows`."""
    at = np.asarray(t)[..., None, None]
    within: Mask = (windows[..., 0] <= at) & (at < windows[..., 1])
    return np.asarray(within.any(axis=-1))


def any_timed(case: Case) -> bool:
    """Whether a picture of a motion may show members that do not act."""
    return any(is_timed(case, group) for group in case.members)
