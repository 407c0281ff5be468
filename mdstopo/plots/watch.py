"""What every objective looks at, over time: for pictures and tables, not for the optimiser."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case, MemberGroup, SpringLaw

if TYPE_CHECKING:
    from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]

#: members times states whose energy is computed at once
_AT_ONCE = 4_000_000


def response_history(engine: "Evaluator", alpha: Floats, load_case: str, times: Floats) -> dict[str, Floats]:
    """g(t) (T,) of each objective of a load case at times (T,) that its motion reaches, by the objective's name.

    Raises ValueError where the motion ends before the last of them.
    """
    from mdstopo.integrators.driver import Driver

    case = engine.case
    motion = engine.trajectory(alpha, load_case)
    if times[-1] > motion.t[-1]:
        raise ValueError(f"the motion in load case {load_case} ends at {motion.t[-1]:g} s: {motion.status.value}")
    looked = [objective for objective in case.objectives if objective.load_case == load_case]
    driver = engine.driver(load_case)
    if isinstance(driver, Driver):  # springs between free bodies: all of them look at the energy
        energy = stored_energy(case, alpha, motion.at(times).q)
        return {objective.name: energy for objective in looked}
    driver.run(alpha, False)
    t = motion.t
    step = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    places = np.stack([step.astype(np.float64), (times - t[step]) / (t[step + 1] - t[step])], axis=1)
    return {each.name: driver.sample_response(j, places, True, len(t) - 1)[2][:, 0] for j, each in enumerate(looked)}


def stored_energy(case: Case, alpha: Floats, q: Floats) -> Floats:
    """The energy (T,) in design members of the spring law at states q (T, 3 n_bodies)."""
    total = np.zeros(len(q))
    for group, part in zip(case.design_groups, case.group_slices.values(), strict=True):
        strength = alpha[part] ** group.power
        chunk = max(1, _AT_ONCE // max(len(group), 1))
        for first in range(0, len(q), chunk):
            states = q[first : first + chunk]
            length = member_lengths(case, group, states)
            for law in group.laws:
                assert isinstance(law, SpringLaw)
                free = group.length if law.free_length is None else law.free_length
                total[first : first + chunk] += 0.5 * law.stiffness * ((length - free) ** 2 @ strength)
    return total


def member_lengths(case: Case, group: MemberGroup, q: Floats) -> Floats:
    """Lengths (T, M) of a group's members at states q (T, 3 n_bodies)."""
    p = points_at(case, group.body_from, group.from_local, q)[:, group.from_index]
    return np.asarray(np.linalg.norm(points_at(case, group.body_to, group.to_local, q)[:, group.to_index] - p, axis=2))


def points_at(case: Case, body: str, local: Floats, q: Floats) -> Floats:
    """Global places (T, K, 2) of points (K, 2) of a body at states q (T, 3 n_bodies)."""
    if body == GROUND:
        return np.broadcast_to(local, (len(q), *local.shape))
    i = 3 * [each.name for each in case.bodies].index(body)
    cos, sin = np.cos(q[:, i + 2, None]), np.sin(q[:, i + 2, None])
    x = q[:, i, None] + cos * local[:, 0] - sin * local[:, 1]
    y = q[:, i + 1, None] + sin * local[:, 0] + cos * local[:, 1]
    return np.stack([x, y], axis=2)
