"""Forces of members at given states."""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case, MemberGroup
from mdstopo.plots.scenery import Floats
from mdstopo.scene.point_positions import point_rates, points_at

Chosen = list[tuple[MemberGroup, NDArray[np.int64]]]


def forces_of(case: Case, alpha: Floats, kept: Chosen, q: Floats, v: Floats) -> Floats | None:
    """f* (T, K) in N of chosen members of groups at states q (T, n), v (T, m), pull positive.

    None where a law's force depends on more than elongation and rate, or acts for a time, and where laws vary.
    """
    slices, columns = case.group_slices, []
    if case.variables:
        return None
    for group, chosen in kept:
        if not all(law.active_from is None and law.active_until is None for law in group.laws):
            return None
        p = points_at(case, group.body_from, group.p_local[chosen], q)
        r = points_at(case, group.body_to, group.q_local[chosen], q) - p
        length = np.linalg.norm(r, axis=2)
        parting = point_rates(case, group.body_to, group.q_local[chosen], q, v)
        parting = parting - point_rates(case, group.body_from, group.p_local[chosen], q, v)
        rate = np.einsum("tki,tki->tk", r, parting) / np.where(length > 0.0, length, 1.0)
        scale = alpha[slices[group.name]][chosen] ** group.power if group.design else np.ones(len(chosen))
        total = np.zeros_like(length)
        for law in group.laws:
            stated = getattr(law, "free_length", None)
            force = law.force_at(length - (group.length[chosen] if stated is None else stated), rate)
            if force is None:
                return None
            total += force
        columns.append(scale * total)
    return np.concatenate(columns, axis=1) if columns else np.zeros((len(q), 0))
