"""Responses and limits on them as rows of the linear program."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import GROUND
from mdstopo.case.objects.problem_parts import Objective, Response, ResponseRow
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.case.responses.response_units import words
from mdstopo.limiting.known import Cubics, Floats
from mdstopo.limiting.system import System


class NoBoundError(Exception):
    """A response or a limit for which theory gives nothing; the message says why."""


@dataclass(frozen=True)
class Bounded:
    """A limit on the motion at all times: y(t) = (matrix X)(t), or a derivative of it, stays within a set.

    matrix (r, 2 n); known: r functions that are added (X_known is not in them). radius: of the set, or None where it is
    what is minimised. by_component: every component of y is at most the radius; else the norm of y is. final: only at
    the end. until: only up to this time, None for always. words: what it is.
    """

    order: int
    matrix: Floats
    known: Cubics
    radius: float | None
    by_component: bool = False
    final: bool = False
    until: float | None = None
    words: str = ""


@dataclass
class Limits:
    """The limits of one load case: rows, in words those counted and those left out, and angles that are bounded.

    counted, left_out: sentences; turns: body -> the largest angle from the start, rad.
    """

    rows: list[Bounded] = field(default_factory=list)
    counted: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    turns: dict[str, float] = field(default_factory=dict)


def objective_row(system: System, objective: Objective) -> tuple[Bounded, float]:
    """The row whose least radius bounds the objective, and the sign (+1 least, -1 largest value) of the objective.

    Raises NoBoundError.
    """
    response, over, minimized = objective.response, REDUCTIONS[objective.over_time], objective.sense == "minimize"
    _translates(response)
    row = _row(system, response)
    _centred(system, response)
    norm = response.component == "norm"
    sign = 1.0 if minimized else -1.0
    if over.is_integral:
        raise NoBoundError(f"{over.name} over time is no peak: only peaks and final values are bounded")
    if over.at_end and row.order == 2:
        raise NoBoundError("the acceleration at one instant can be anything: only peaks of it are bounded")
    if over.at_end:
        convex = not norm or minimized
    elif norm or over.is_magnitude:
        convex = over.is_largest and minimized
    else:
        convex = over.is_largest if minimized else over.is_smallest
    if not convex:
        what = f"{objective.sense} the {over.name} of {words(response)}"
        raise NoBoundError(f"{what} is no convex problem, so no bound is known")
    row = replace(row, final=over.at_end)
    if norm or over.is_magnitude:
        return row, sign
    return replace(row, by_component=True, matrix=sign * row.matrix, known=_scaled(row.known, sign)), sign


def limits_of(system: System, constraints: tuple[object, ...]) -> Limits:
    """The limits of the system's load case, as far as they can be counted."""
    found = Limits()
    own = [row for row in constraints if isinstance(row, ResponseRow) and row.load_case == system.load_case.name]
    turns = [_note_angle(system, row, found) for row in own]
    for row, turn in zip(own, turns, strict=True):
        text = f"{row.over_time} of {words(row.response)} {_SENSES[row.sense]} {row.bound:g}"
        if turn:
            found.counted.append(f"{text} (as far as it turns)")
            continue
        try:
            rows, remark = _limit_rows(system, row, found.turns)
        except NoBoundError as reason:
            found.left_out.append(f"{text} ({reason})")
            continue
        found.rows += [replace(each, words=text) for each in rows]
        found.counted.append(f"{text} ({remark})" if remark else text)
    return found


_SENSES = {"limit": "at most", "equals": "equal to", "at_least": "at least"}


def _translates(response: Response) -> None:
    kind = kind_of(response)
    if kind.is_energy:
        raise NoBoundError("stored energy depends on what the members are: no bound over all members is known")
    if response.body is None:
        raise NoBoundError(
            f"a {response.kind.replace('_', ' ')} depends on which members share the load: only the motion of centres "
            "of mass is bounded"
        )
    if not kind.of_point:
        raise NoBoundError("an angle depends on where forces act: only the motion of centres of mass is bounded")


def _centred(system: System, response: Response) -> None:
    assert response.body is not None
    at = response.at_local or (0.0, 0.0)
    if response.body not in system.angles and math.hypot(*at) > 0.0:
        raise NoBoundError(
            f"the point is not the centre of mass of {response.body}, which may turn: not linear in forces"
        )
    if response.relative_to not in system.angles:
        raise NoBoundError(f"{response.relative_to} may turn, and what is seen from it turns with it")


def _row(system: System, response: Response) -> Bounded:
    """The motion of the body's centre of mass, along the axes of a body that does not turn (else along global ones)."""
    assert response.body is not None
    if response.since == "settled":
        raise NoBoundError("it counts from where the scene has settled, which depends on the design")
    other = response.relative_to or GROUND
    angle = system.angles.get(other, 0.0)
    c, s = math.cos(angle), math.sin(angle)
    rotation = np.array([[c, s], [-s, c]])  # global to the observer's axes
    matrix = rotation @ (system.at(response.body) - system.at(other))
    if response.component in ("x", "y"):
        matrix = matrix[["x", "y"].index(response.component)][None]
    order = kind_of(response).order
    start = matrix @ system.start if order == 0 else np.zeros(len(matrix))
    zero = Cubics(system.times, np.zeros((len(system.times) - 1, len(matrix), 4)))
    return Bounded(order, matrix, zero.minus(start), None)


def _limit_rows(system: System, row: ResponseRow, turns: dict[str, float]) -> tuple[list[Bounded], str]:
    """The limit as rows with a radius, and a remark where it had to be widened. Raises NoBoundError."""
    response, over = row.response, REDUCTIONS[row.over_time]
    if not kind_of(response).of_point:
        raise NoBoundError("not a matter of the motion of centres of mass")
    if over.is_integral:
        raise NoBoundError("neither a peak nor a final value")
    made = _row(system, response)
    if over.at_end and made.order == 2:
        raise NoBoundError("one instant says nothing of an acceleration")
    made = replace(made, final=over.at_end)
    norm = response.component == "norm"
    above = row.sense in ("limit", "equals") and (over.is_largest or over.at_end)
    below = not norm and row.sense in ("at_least", "equals") and (over.is_smallest or over.at_end)
    if not above and not below:
        raise NoBoundError("not convex")
    wider, made, remark = _widened(system, response, made, turns)
    rows = []
    if above and (norm or over.is_magnitude):
        rows.append(replace(made, radius=row.bound + wider))
    elif above:
        rows.append(replace(made, radius=row.bound + wider, by_component=True))
    if below:
        turned = replace(made, matrix=-made.matrix, known=_scaled(made.known, -1.0))
        rows.append(replace(turned, radius=-row.bound + wider, by_component=True))
    return rows, remark


def _widened(system: System, response: Response, row: Bounded, turns: dict[str, float]) -> tuple[float, Bounded, str]:
    """By how much the centre of mass may exceed what its point may not, the row then meant, and a remark.

    A point s of a body that has turned by psi is displaced by its centre and by (R - 1) s, of length
    2 |s| sin(psi / 2). Seen from a body that turns, the norm of a displacement still tells the distance from that
    body's centre: |c + d| <= |c| + |d|.
    """
    assert response.body is not None
    arm = math.hypot(*(response.at_local or (0.0, 0.0)))
    if response.body in system.angles:
        arm = 0.0
    other = response.relative_to or GROUND
    if row.order > 0 and (arm > 0.0 or other not in system.angles):
        raise NoBoundError("not linear in forces, because of rotation")
    wider = arm_travel(arm, turns.get(response.body, math.pi))
    remark = f"widened by {wider:g} m, as far as its point may turn" if wider > 0.0 else ""
    if other in system.angles:
        return wider, row, remark
    if response.component != "norm":
        raise NoBoundError(f"{other} may turn, and its axes with it")
    if system.case.solver.settle:
        raise NoBoundError(f"{other} may turn, and the distance from it at the start depends on the design")
    away = float(np.hypot(*(row.matrix @ system.start)))
    wider = away + 2.0 * math.hypot(*(response.at_local or (0.0, 0.0)))
    plain = replace(row, known=row.known.minus(-(row.matrix @ system.start)))
    return wider, plain, f"as {other} may turn, only as a largest distance of the centres of mass"


def arm_travel(arm: float, turn: float) -> float:
    """The largest displacement that turning by at most `turn` gives a point at the distance `arm`, m."""
    return 2.0 * arm * math.sin(0.5 * min(turn, math.pi))


def _note_angle(system: System, row: ResponseRow, found: Limits) -> bool:
    """Whether a row limits how far a body turns against one that does not; then it is noted."""
    response = row.response
    kind = kind_of(response)
    if not kind.is_position or kind.of_point or not REDUCTIONS[row.over_time].is_magnitude or row.sense == "at_least":
        return False
    if response.relative_to not in system.angles or response.body is None:
        return False
    start = {body.name: body.angle for body in system.load_case.bodies}
    # the response is the difference of angles, not its change; the start keeps the limit, too
    apart = (
        row.bound
        if system.case.solver.settle
        else abs(start[response.body] - system.angles[response.relative_to or GROUND])
    )
    reach = row.bound + min(row.bound, apart)
    found.turns[response.body] = min(found.turns.get(response.body, math.inf), reach)
    return True


def _scaled(cubics: Cubics, factor: float) -> Cubics:
    return Cubics(cubics.times, factor * cubics.coefficients)
