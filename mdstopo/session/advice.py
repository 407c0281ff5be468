"""Warnings about a final design: it restrains bodies less than the first one, or no variable has an effect."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case, FloatArray, Objective, ReducedResponse, ResponseRow, VolumeRow
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.scene.moving_volumes import spent
from mdstopo.scene.point_positions import seats_at
from mdstopo.starts.evaluator_interface import Evaluation
from mdstopo.store.contents import Motion

Floats = NDArray[np.float64]

_USED = 0.9  # share of a volume limit below which it is far from active
_LARGER = 1.05  # ratio of two relative motions from which on the larger one is told
#: share of the scene's size, or of a radian, by which prescribed motions of two designs differ at most
_SAME = 1e-6
#: share of an objective by which a variable changes it, across its whole range, where the slope is rounding alone
_ROUNDING = 1e-13


def advise(case: Case, design: Floats, before: Mapping[str, Motion], after: Mapping[str, Motion]) -> tuple[str, ...]:
    """Warnings about the final design, alpha with the values of variables (N + P,).

    before, after: the motion by load case with the starting and the final design. A volume limit that is hardly used,
    and bodies that move farther than before, are signs that stored energy was lowered by taking away members that
    restrain the bodies. There are no warnings where that cannot be: where a displacement or an angle is bounded or
    minimised, where the energy is no objective, or where joints and motions prescribe how the bodies move, as in a
    driven linkage.
    """
    found = []
    soft = any(may_soften(case, name) and not _prescribed(before[name], after[name]) for name in after)
    for row in case.constraints if soft else ():
        if isinstance(row, VolumeRow) and row.sense == "limit" and row.bound > 0.0:
            share = spent(case, row, design) / row.bound
            if share < _USED:
                found.append(
                    f"only {share:.1%} of the volume limit {row.bound:g} of {', '.join(row.groups)} is used: "
                    "the objective may have been lowered by removing what restrains; "
                    "spend the volume (`equals`), or bound a displacement"
                )
    for name, motion in after.items():
        if not may_soften(case, name) or not (motion.status.ok and before[name].status.ok):
            continue
        earlier, later = relative_motion(case, before[name]), relative_motion(case, motion)
        if later > _LARGER * earlier:
            found.append(
                f"in load case {name} the bodies that members join move {later:.4g} m against each other, "
                f"more than the {earlier:.4g} m of the starting design: it restrains them less; "
                "if that matters, bound a displacement"
            )
    return tuple(found)


def without_slope(case: Case, found: Evaluation) -> tuple[str, ...]:
    """Warnings about objectives that no design variable changes at the design that was found.

    To the optimiser such a design is an optimum, whatever it is: acceleration at the start, before any member carries
    something, a pendulum that swings from one side to the other whatever holds it, or a response that `constant_load`
    holds.
    """
    told = []
    for objective in case.objectives_that_count:
        name = objective.name
        value = found.objectives.get(name, 0.0)
        if found.gradients.get(name) is None or value == 0.0:
            continue
        if _largest_change(case, found, name) > _ROUNDING * abs(value):
            continue
        time = found.peaks[name][0].time
        where = "" if np.isnan(time) else f" at t = {time:.6g} s"
        told.append(
            f"no design variable changes {name} = {value:.6g}{where}, as the sensitivity method has it: "
            "the optimiser had nothing to go by there"
        )
    return tuple(told)


def _largest_change(case: Case, found: Evaluation, name: str) -> float:
    """The largest change of an objective that its slope promises for one variable's whole range."""
    slopes = getattr(found, "variable_gradients", {}).get(name, {})
    width = case.upper - case.lower
    of_alpha = np.abs(found.gradients[name]) * np.where(width > 0.0, width, 1.0)
    of_variables = [
        np.abs(slopes[each.name]) * (each.upper - each.lower or 1.0) for each in case.variables if each.name in slopes
    ]
    return float(np.concatenate([of_alpha, *of_variables]).max(initial=0.0))


def may_soften(case: Case, load_case: str) -> bool:
    """Whether energy is minimised in this load case and nothing limits the motion, so that the softest design would be
    best."""
    energy = any(kind_of(each.response).is_energy and each.load_case == load_case for each in _minimised(case))
    return energy and not is_held(case, load_case)


def _prescribed(before: Motion, after: Motion) -> bool:
    """Whether the motion does not depend on the design: no degree of freedom is left, and multipliers follow it."""
    if not (before.status.ok and after.status.ok) or before.lam.shape[1] < before.q.shape[1]:
        return False
    return bool(np.abs(after.q[-1] - before.q[-1]).max() <= _SAME * max(1.0, float(np.abs(before.q).max())))


def is_held(case: Case, load_case: str) -> bool:
    """Whether a displacement or an angle is limited, or minimised, in this load case."""
    responses: list[ReducedResponse] = [*_minimised(case)]
    responses += [row for row in case.constraints if isinstance(row, ResponseRow) and row.sense in ("limit", "equals")]
    return any(each.load_case == load_case and kind_of(each.response).is_position for each in responses)


def _minimised(case: Case) -> list[Objective]:
    """The objectives that are made small and count."""
    return [each for each in case.objectives_that_count if each.sense == "minimize"]


def relative_motion(case: Case, motion: Motion) -> float:
    """Largest displacement, in m, of a body's centre of mass seen from another one that members tie it to.

    The displacement is that of an observer riding on the first body, since the start.
    """
    index = {body.name: i for i, body in enumerate(case.bodies)}
    pairs = {(group.body_from, group.body_to) for group in case.members if group.design}
    largest = 0.0
    for one, other in sorted(pairs):
        if one == GROUND:
            one, other = other, one
        seen = _seen(case, motion.q, index[one], -1 if other == GROUND else index[other])
        largest = max(largest, float(np.sqrt(((seen - seen[0]) ** 2).sum(axis=1)).max(initial=0.0)))
    return largest


def _seen(case: Case, q: FloatArray, one: int, other: int) -> FloatArray:
    """(T, d): where a body's centre of mass is in another one's axes at states q; numbers of the bodies, -1: ground."""
    if case.dimension > 2:
        place, turned = seats_at(q, one)
        away = (seats_at(q, other)[0] if other >= 0 else np.zeros((1, 3))) - place
        return np.asarray(np.einsum("tji,tj->ti", turned, away))
    first = q[:, 3 * one : 3 * one + 3]
    second = q[:, 3 * other : 3 * other + 3] if other >= 0 else np.zeros((1, 3))
    dx, dy = second[:, 0] - first[:, 0], second[:, 1] - first[:, 1]
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    return np.stack([c * dx + s * dy, c * dy - s * dx], axis=1)
