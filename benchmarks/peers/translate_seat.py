"""The case of the seated occupant as the plain arrays that the other programs are given."""

from typing import Any

import numpy as np

from benchmarks.peers.problem import Floats, Indices
from benchmarks.peers.seat_problem import ACTUATOR, GAP, SeatProblem
from mdstopo.case.model import Case

#: the body that moves as it is told, and the one that the others hang on
CABIN, ROOT = "cabin", "pelvis"


def seat_problem_of(case: Case) -> SeatProblem:
    """cases/restraint.yaml in the load case of its objectives, or a case like it."""
    bodies = [body for body in case.bodies if body.name != CABIN]
    order = {body.name: k for k, body in enumerate(bodies)}
    load_case = next(each for each in case.load_cases if each.name == case.objectives[0].load_case)
    chest, excursion = (objective.response for objective in case.objectives)
    pulse: Any = load_case.motions[0].x
    reach = _reach(case, order)
    root = order[ROOT]
    place = np.array(bodies[root].position)
    # joints fit at the start, so the places that they tell are those of the case
    np.testing.assert_allclose(place + reach.sum(axis=1), [body.position for body in bodies], atol=1e-12)
    return SeatProblem(
        mass=np.array([body.mass for body in bodies]),
        inertia=np.array([body.inertia for body in bodies]),
        root=root,
        place=place,
        reach=reach,
        hinges=np.array([[order[name] for name in each.bodies] for each in case.bushings]),
        spring=np.array([each.stiffness[-1] for each in case.bushings]),
        damper=np.array([each.damping[-1] for each in case.bushings]),
        **_members(case, order),
        pulse=np.column_stack([pulse.signal.times, pulse.signal.values[:, 0]]),
        gravity=-load_case.gravity[1],
        chest=order[chest.body or ""],
        head=np.array(excursion.at_local),
        end=load_case.end,
    )


def _reach(case: Case, order: dict[str, int]) -> Floats:
    """`SeatProblem.reach`: from the root over its joints, and on from these."""
    found = np.zeros((len(order), len(order), 2))
    known, waiting = {ROOT}, list(case.joints)
    while waiting:
        joint = next(each for each in waiting if known & set(each.bodies))
        waiting.remove(joint)
        ends = dict(zip(joint.bodies, (joint.at_first, joint.at_second), strict=True))
        (near,) = known & set(joint.bodies)
        (far,) = set(joint.bodies) - known
        found[order[far]] = found[order[near]]
        found[order[far], order[near]] += ends[near]
        found[order[far], order[far]] -= ends[far]
        known.add(far)
    return found


def _members(case: Case, order: dict[str, int]) -> dict[str, Floats | Indices]:
    """The fields of all members, those with gaps first."""
    rows: list[dict[str, Any]] = []
    active: Any = None
    for group in case.members:
        (law,) = group.laws
        at, anchor = (group.p_local, group.q_local) if group.body_to == CABIN else (group.q_local, group.p_local)
        (name,) = {group.body_from, group.body_to} - {CABIN}
        gap = hasattr(law, "gap")
        own = {"body": order[name], "law": GAP if gap else ACTUATOR, "damping": 0.0, "side": 1.0, "limit": 0.0}
        if gap:
            own |= {"stiffness": law.stiffness, "damping": law.damping, "offset": law.gap}
            own["side"] = -1.0 if law.side == "compression" else 1.0
        else:
            own |= {"stiffness": law.proportional, "damping": law.derivative, "offset": law.target, "limit": law.limit}
            active = law.active_from, law.active_until
        first = case.group_slices[group.name].start if group.design else None
        rows += [
            own | {"at": at[i], "anchor": anchor[i], "design": -1 if first is None else first + i}
            for i in range(len(at))
        ]
    rows.sort(key=lambda row: row["law"])
    fields = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return fields | {"active": np.array(active)}
