"""A bound for each objective of a case, with the words that say over what."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from mdstopo.case.model import Case
from mdstopo.case.objects.problem_parts import Objective
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.case.responses.response_units import unit_of_value, words
from mdstopo.limiting.force_limits import restrictions
from mdstopo.limiting.program import ImpossibleError, Program
from mdstopo.limiting.response import Limits, NoBoundError, limits_of, objective_row
from mdstopo.limiting.solve_linear_program import UnsolvedError
from mdstopo.limiting.system import System
from mdstopo.scene.bodies import is_spatial
from mdstopo.scene.signal_segments import formulas_of


@dataclass(frozen=True)
class Bound:
    """What no design of a case does better.

    value: in the objective's unit, never above what the best of all members reaches (never below, where the objective
    is maximised); None where theory gives none. why: which members it is over and what it counts, or why there is none.
    """

    value: float | None
    why: str


def bounds(case: Case) -> Mapping[str, Bound]:
    """The bounds of all objectives of a case, by name."""
    return {objective.name: bound(case, objective) for objective in case.objectives}


def bound(case: Case, objective: Objective) -> Bound:
    """The value that no members can do better than, of one objective."""
    if case.uncertainty is not None:
        return Bound(None, "the case has uncertain values: a bound would hold for one sample alone")
    if is_spatial(case):
        return Bound(None, "bounds are known of bodies in a plane alone")
    if case.movable:
        return Bound(
            None, "ends of members are design variables: bounds are known of ends that stay in their body alone"
        )
    if case.follows is not None and any(number.kind != "law" for number in case.follows.numbers):
        return Bound(
            None,
            "more than numbers of laws follows from a design variable that is a defined name: bounds are known of "
            "bodies, points, loads and motions that no design changes",
        )
    load_case = case.load_case(objective.load_case)
    if formulas_of(load_case):
        return Bound(None, "bounds are known of constant and tabulated loads and motions, of formulas of time not")
    try:
        if case.solver.assemble and case.joints:
            raise NoBoundError("solver.assemble moves the start to where joints fit: state a start that fits")
        system = System(case, load_case)
        goal, sign = objective_row(system, objective)
        limits = limits_of(system, case.constraints)
        forces = restrictions(system, limits)
        program = Program(system, [goal, *limits.rows, *forces.rows], forces.more)
        least = program.least()
    except NoBoundError as reason:
        return Bound(None, str(reason))
    except ImpossibleError as found:
        return Bound(None, _impossible(limits, forces.counted, found.excess))
    except UnsolvedError as reason:
        return Bound(None, f"the linear program was not solved: {reason}")
    where = _what(limits, forces.counted, _goal_words(objective))
    if not math.isfinite(least):
        return Bound(None, f"nothing keeps it from falling without end. {where}")
    if not goal.by_component and least <= 0.0:
        least = 0.0
        if not program.is_limited:
            text = f"without a limit on the {_others(objective)} nothing keeps it above 0"
            return Bound(None, f"{text}. {_left_out(limits)}".rstrip(" ."))
    return Bound(sign * least + 0.0, where)


def _goal_words(objective: Objective) -> str:
    return f"{objective.over_time} of {words(objective.response)}"


def _others(objective: Objective) -> str:
    """What has to be limited for the objective to have a bound."""
    response = objective.response
    return f"{'peak acceleration' if kind_of(response).is_position else 'travel'} of {response.body}"


def _what(limits: Limits, forces: list[str], goal: str) -> str:
    """Over which members, and what is counted."""
    text = f"no forces in time, of whatever members between the bodies that the case ties, have a lower {goal}"
    if limits.counted:
        text += f" and keep {', '.join(limits.counted)}"
    if forces:
        text += f"; of the case's own members is used: {', '.join(forces)}"
    rest = _left_out(limits)
    return f"{text}. {rest}" if rest else text


def _left_out(limits: Limits) -> str:
    return f"not counted: {', '.join(limits.left_out)}" if limits.left_out else ""


def _impossible(limits: Limits, forces: list[str], excess: float) -> str:
    text = f"no forces keep all limits: one is exceeded by at least {100.0 * excess:.3g} %"
    parts = [*limits.counted, *forces]
    return f"{text} ({', '.join(parts)})" if parts else text


def unit(objective: Objective) -> str:
    """The unit of the bound of an objective."""
    return unit_of_value(objective)
