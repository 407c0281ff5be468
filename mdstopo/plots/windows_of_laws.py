"""When laws act: from `active_from` on, until `active_until`, both of which may be design variables."""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case, MemberGroup
from mdstopo.scene.design_map import DesignMap

Floats = NDArray[np.float64]

#: the numbers of a law between which it acts, and what stands for one that it does not have
_ENDS = {"active_from": -np.inf, "active_until": np.inf}


def is_timed(case: Case, group: MemberGroup) -> bool:
    """Whether a law of a group begins or ends at a time, or may as a design variable."""
    stated = any(getattr(law, name) is not None for law in group.laws for name in _ENDS)
    return stated or any(group.name in each.groups and each.parameter in _ENDS for each in case.variables)


def active_windows(case: Case, design: Floats) -> dict[str, Floats]:
    """(M, L, 2) of each group that `is_timed`: from when on and until when each of its L laws acts in each of its
    members, s; infinite where it has no such time.

    case: as it was read. design (N + P,): alpha, then the values of its variables, which count where these are times,
    or names from which times follow.
    """
    names = [group.name for group in case.members if is_timed(case, group)]
    if not names:
        return {}
    if case.follows is not None:
        design_map = DesignMap(case)
        case, design = design_map.case, design_map.design(design)
    found = {group.name: _stated(group) for group in case.members if group.name in names}
    values = case.space.named(design)
    for each in case.variables:
        for name, place in zip(each.groups, each.laws, strict=True):
            if each.parameter in _ENDS and name in found:
                found[name][:, place, list(_ENDS).index(each.parameter)] = values[each.name]
    return found


def _stated(group: MemberGroup) -> Floats:
    """(M, L, 2) the times that the laws of a group have in the case."""
    own = [[getattr(law, name) for name in _ENDS] for law in group.laws]
    filled = [[free if time is None else time for time, free in zip(both, _ENDS.values(), strict=True)] for both in own]
    return np.tile(np.array(filled, dtype=np.float64), (len(group), 1, 1))
