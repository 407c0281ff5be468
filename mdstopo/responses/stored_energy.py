"""The stored energy at given states, with NumPy: for histories, not for the optimiser (`mechanics.passes`)."""

import numpy as np

from mdstopo.case.model import Case, SpringLaw
from mdstopo.scene.point_positions import member_lengths
from mdstopo.scene.springs_model import FloatArray

#: members times states whose energy is computed at once
AT_ONCE = 4_000_000


def stored_energy(case: Case, alpha: FloatArray, q: FloatArray) -> FloatArray:
    """The energy (T,) in design members of the spring law at states q (T, 3 n_bodies)."""
    total = np.zeros(len(q))
    for group, part in zip(case.design_groups, case.group_slices.values(), strict=True):
        strength = alpha[part] ** group.power
        chunk = max(1, AT_ONCE // max(len(group), 1))
        for first in range(0, len(q), chunk):
            states = q[first : first + chunk]
            length = member_lengths(case, group, states)
            for law in group.laws:
                assert isinstance(law, SpringLaw)
                free = group.length if law.free_length is None else law.free_length
                total[first : first + chunk] += 0.5 * law.stiffness * ((length - free) ** 2 @ strength)
    return total
