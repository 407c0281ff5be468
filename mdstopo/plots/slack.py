"""Belts that hang through: members that only pull, while their ends are nearer to each other than they are long."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.laws.gap_law import GapLaw
from mdstopo.case.model import Case, MemberGroup
from mdstopo.plots.scenery import Floats, ends_at

#: share of its length by which a belt is too long from which on it is drawn as slack; of the distance of its ends, how
#: far it hangs through at most; corners of the line
SLACK, DEEPEST, CORNERS = 1e-3, 0.3, 13


def spare_length(case: Case, group: MemberGroup, q: Floats) -> Floats:
    """By how much each member of a group is longer than the distance of its ends at a state q, (M,) in m; 0 where it is
    taut. Of a group whose members are no belts, which only pull from some elongation on, all are 0.

    A belt whose gap, or free length, is a design variable is taken as if it had none.
    """
    laws = [law for law in group.laws if isinstance(law, GapLaw) and law.side == "tension"]
    varied = any(group.name in each.groups and each.parameter in ("gap", "free_length") for each in case.variables)
    if not laws or len(laws) < len(group.laws) or varied:
        return np.zeros(len(group))
    ends = ends_at(case, group, q)
    apart = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    closes = [group.length + law.gap if law.free_length is None else law.free_length + law.gap for law in laws]
    longest = np.min(np.array([np.broadcast_to(each, apart.shape) for each in closes]), axis=0)
    spare: Floats = longest - apart
    return np.where(spare > SLACK * longest, spare, 0.0)


def member_lines(
    case: Case, group: MemberGroup, q: Floats, seen: Callable[[Floats], Floats], some: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Lines (K, CORNERS, 2) of some (K,) of a group's members on the paper, and which of them are slack (K,).

    Taut ones are straight. A slack one hangs along gravity, or down the picture without, as the parabola that is as
    long as it is: of depth h over a length L it is longer by 8 h^2 / (3 L), to leading order. seen: places (n, d) on
    the paper (n, 2).
    """
    places, spare = ends_at(case, group, q)[some], spare_length(case, group, q)[some]
    apart = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
    deep = np.minimum(np.sqrt(0.375 * apart * spare), DEEPEST * apart)
    share = np.linspace(0.0, 1.0, CORNERS)[None, :, None]
    lines = places[:, None, 0] * (1.0 - share) + places[:, None, 1] * share
    lines += deep[:, None, None] * (4.0 * share * (1.0 - share)) * _down(case)
    return seen(lines.reshape(-1, case.dimension)).reshape(len(lines), CORNERS, 2), spare > 0.0


def _down(case: Case) -> Floats:
    """(d,) the direction of gravity, or against the last axis where there is none."""
    gravity = np.array(case.load_cases[0].gravity, dtype=np.float64)
    size = float(np.linalg.norm(gravity))
    return gravity / size if size > 0.0 else -np.eye(case.dimension)[-1]
