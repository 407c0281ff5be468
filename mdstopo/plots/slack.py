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
#: how wide it is as a share of a taut one; its dashes on a screen in pixels, drawn and free
THIN, DASHES = 0.5, (4, 3)


def belt_lengths(case: Case, group: MemberGroup) -> Floats | None:
    """(M,) how long each member is as a belt, m: the distance of its ends at which it begins to pull.

    None of a group that does more than pull beyond a gap, and where the gap, or the free length, is a design variable:
    such members are drawn straight.
    """
    laws = [law for law in group.laws if isinstance(law, GapLaw) and law.side == "tension"]
    varied = any(group.name in each.groups and each.parameter in ("gap", "free_length") for each in case.variables)
    if not laws or len(laws) < len(group.laws) or varied:
        return None
    closes = [group.length + law.gap if law.free_length is None else law.free_length + law.gap for law in laws]
    return np.asarray(np.min(np.array([np.broadcast_to(each, (len(group),)) for each in closes]), axis=0))


def spare_length(case: Case, group: MemberGroup, q: Floats) -> Floats:
    """(M,) by how much each member is longer than its ends are apart at a state q, m; 0 where it is taut or no belt."""
    longest = belt_lengths(case, group)
    if longest is None:
        return np.zeros(len(group))
    ends = ends_at(case, group, q)
    spare: Floats = longest - np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return np.where(spare > SLACK * longest, spare, 0.0)


def member_lines(
    case: Case,
    group: MemberGroup,
    q: Floats,
    seen: Callable[[Floats], Floats],
    some: NDArray[np.int64],
    acts: NDArray[np.bool_] | None = None,
) -> tuple[Floats, NDArray[np.bool_]]:
    """Lines (K, CORNERS, 2) of some (K,) of a group's members on the paper, and which of them are slack (K,).

    The page draws the same by `memberLine` in report/members.js.

    Taut ones are straight. A slack one hangs along gravity, or down the picture without, as the parabola that is as
    long as it is: of depth h over a length L it is longer by 8 h^2 / (3 L), to leading order.

    case, group: whose members they are.
    q: the state.
    seen: places (n, d) on the paper (n, 2).
    some: numbers of the members in the group.
    acts (M,): which of all members of the group act; what does not is straight and not slack. None: all act.
    """
    places, spare = ends_at(case, group, q)[some], spare_length(case, group, q)[some]
    if acts is not None:
        spare = np.where(acts[some], spare, 0.0)
    apart = np.linalg.norm(places[:, 1] - places[:, 0], axis=1)
    deep = np.minimum(np.sqrt(0.375 * apart * spare), DEEPEST * apart)
    share = np.linspace(0.0, 1.0, CORNERS)[None, :, None]
    lines = places[:, None, 0] * (1.0 - share) + places[:, None, 1] * share
    lines += deep[:, None, None] * (4.0 * share * (1.0 - share)) * down(case)
    flat = seen(lines.reshape(-1, case.dimension))
    return flat.reshape(len(lines), CORNERS, flat.shape[-1]), spare > 0.0


def down(case: Case) -> Floats:
    """(d,) the direction of gravity, or against the last axis where there is none."""
    gravity = np.array(case.load_cases[0].gravity, dtype=np.float64)
    size = float(np.linalg.norm(gravity))
    return gravity / size if size > 0.0 else -np.eye(case.dimension)[-1]
