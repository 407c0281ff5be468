"""Responses of a general scene: g(q, v, a, lam, alpha) of Eq. 16, its slopes and its rate.

A response is evaluated at a state whose balance has just been made (`solve_accelerations`), so poses, forces,
accelerations and multipliers are at hand. Of each kind there is a record, `ResponseKernels`; the branches by code are
made from them.
"""

import importlib
from collections.abc import Callable
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np

from mdstopo.case.responses.response_kinds import RESPONSES, ResponseKind
from mdstopo.case.responses.spatial_responses import SPATIAL_RESPONSES
from mdstopo.compiler import store
from mdstopo.compiler.choice_by_code import Listed, chosen
from mdstopo.compiler.jit import by_type, kernel, part
from mdstopo.general.dynamics.accelerations import gather_multipliers, solve_accelerations
from mdstopo.general.dynamics.forces import inerter_force, members_alone
from mdstopo.general.dynamics.members import MODE, SCALE, SET, level_of
from mdstopo.general.model.expressions import (
    BALANCED,
    BY_STATE,
    ENERGETIC,
    EXPRESSION,
    FIRST_PART,
    FORCED,
    KNOWN,
    MARGINS,
    PARTS,
    ROOT,
    SWITCHES,
    TIMED,
    formula_mode,
    formula_value,
    knows,
    numbers_of,
    put_parameters,
)
from mdstopo.general.model.general_model import (
    BODY,
    CODE,
    COMPONENT,
    COUNT,
    ENERGY,
    GROUP,
    INERTER,
    KIND,
    MEMBER_FORCE,
    MEMBER_FREE_LENGTH,
    OFFSET,
    ORDER,
    PAIR,
    REFERENCE,
    START,
    SUBJECT,
    GeneralModel,
)
from mdstopo.general.model.strides import (
    dimensions,
    energy_column,
    is_turning,
    pair_freedoms,
    place_in_joint,
    place_in_pair,
    pull_column,
)
from mdstopo.general.responses.response_kernels import ResponseKernels, VectorKernels
from mdstopo.general.steps.method_interface import derivatives, is_continuous, state_at_offset
from mdstopo.general.steps.step_history import SEGMENT
from mdstopo.mechanics.kinematics.components import ACROSS, NORM, X, Y
from mdstopo.mechanics.kinematics.kinematics_interface import (
    ACROSS_FORCE,
    FORCE,
    MOMENT,
    add_pair_force,
    angle_motion,
    freedoms,
    kinematics_of,
    member_rows,
    most_rows,
    point_motion,
    pose_acceleration,
    retract,
    second_rate,
    stretch_between,
    tilt_motion,
    transmitted,
    turn_motion,
    turn_of,
)
from mdstopo.mechanics.laws.law_table import law, law_by_time, law_is_idle, law_is_timed, law_lacks_rate

F = TypeVar("F", bound=Callable[..., Any])

#: the kernels of responses by their code, column KIND of `GeneralModel.response`; `code_of` fills it
LISTED: Listed[ResponseKernels] = Listed()
#: forces of several members that differ by less than this, relative, are the same force: they share what the largest of
#: them does to derivatives
TIE = 1e-9
#: fraction of a step by which the rate of a response is differenced where it has no formula
RATE_SHIFT = 3e-4


def _chosen_of_bodies(pick: Callable[[ResponseKernels], Any]) -> Callable[[F], F]:
    """`chosen` among the kinds that there are of the model's bodies, in a plane or in space; as a part.

    A kernel of bodies in a plane is not compiled for others, which have not what it asks for.
    """

    def make(stub: F) -> F:
        function = cast(FunctionType, stub)

        def of(where: str) -> Any:
            name = f"{function.__name__}_{where}"
            named = FunctionType(function.__code__.replace(co_name=name), function.__globals__, name)
            named.__doc__, named.__qualname__, named.__module__ = function.__doc__, name, function.__module__
            return chosen(LISTED, lambda each: pick(each) if getattr(each, where) else None, part)(named)

        in_plane, in_space = of("in_plane"), of("in_space")
        by_type(function, "model", lambda model: in_plane if kinematics_of(model).rotations == 1 else in_space)
        return stub

    return make


@chosen(LISTED, lambda each: each.absolute or None, part)
def _is_absolute(kind):
    """Whether responses of a kind are absolute values, or the largest of several."""
    return False


@chosen(LISTED, lambda each: True if each.vector else None, part)
def _is_vector(kind):
    """Whether responses of a kind are a component or the norm of a vector."""
    return False


@chosen(LISTED, lambda each: True if each.needs_accelerations else None, part)
def _needs_accelerations(kind):
    """Whether responses of a kind need more than the state: accelerations, multipliers, sums of forces."""
    return False


@kernel
def needs_balance(model, j):
    """Whether response j needs more than the state: accelerations, multipliers, sums of forces."""
    if model.response[j, KIND] == EXPRESSION:
        return knows(model, j, BALANCED)
    return _needs_accelerations(model.response[j, KIND])


@chosen(LISTED, lambda each: True if each.by_state else None, part)
def _is_by_state(kind):
    """Whether the rate of responses of a kind is g_q v + g_v a (`ResponseKernels.by_state`)."""
    return False


@kernel
def is_plain(model, group):
    """Whether the rates of a group's forces are known as formulas: it has no inerters, and no forces over time of
    unknown slope."""
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] == group and (model.block[k, CODE] == INERTER or law_lacks_rate(model.block[k, CODE])):
            return False
    return True


@kernel
def follows_state(tag, model, j):
    """Whether the rate of response j is g_q v + g_v a along the motion of a method, plus a known slope by time."""
    kind = model.response[j, KIND]
    if kind == MEMBER_FORCE:
        return derivatives(tag) > 1 and is_plain(model, model.response[j, SUBJECT])
    by_state = knows(model, j, BY_STATE) if kind == EXPRESSION else _is_by_state(kind)
    return by_state and model.response[j, ORDER] < derivatives(tag)


@kernel
def kinked(model, j):
    """Whether response j is a norm, an absolute value, or a largest one, which may have kinks in time."""
    if model.response[j, KIND] == EXPRESSION:
        return knows(model, j, ROOT)
    return _is_absolute(model.response[j, KIND]) or is_norm(model, j)


@kernel
def member_force(model, member_state, segment, t, group, i, q, v, a, slopes, own):
    """Force f* of one member of a group, all its laws together, with its slopes.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group, i: the group, and the number of the member in it.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      slopes (3, 2 D): of f* by q, v and a of the two bodies; an inerter's are those by a alone (`_inerter_slopes`).
      own (2, 2 D): scratch.

    Returns f* (N), positive in tension, and the pair of bodies.
    """
    total = 0.0
    pair = 0
    slopes[:] = 0.0
    for k in range(model.block.shape[0]):
        own_i = i - model.block[k, OFFSET]
        if (
            model.block[k, GROUP] != group
            or model.active[segment, k] == 0
            or own_i < 0
            or own_i >= model.block[k, COUNT]
        ):
            continue
        pair = model.block[k, PAIR]
        m = model.block[k, START] + own_i
        scale = member_state[SCALE, m]
        x, rate = member_rows(model, pair, m, q, v, own[0], own[1])
        x -= member_state[SET, m]
        if model.block[k, CODE] == INERTER:
            total += scale * inerter_force(model, k, m, q, v, a, own[0])
            for r in range(pair_freedoms(model)):
                slopes[2, r] += scale * model.law[k, 0] * own[0, r]
            continue
        value = level_of(model, segment, k, t)
        f, by_x, by_rate, _, _ = law(
            model.block[k, CODE], model.law[k], x, rate, int(member_state[MODE, m]), t, value, model.curves,
            model.member[MEMBER_FREE_LENGTH, m],
        )  # fmt: skip
        total += scale * f
        for r in range(pair_freedoms(model)):
            slopes[0, r] += scale * (by_x * own[0, r] + by_rate * own[1, r])
            slopes[1, r] += scale * by_rate * own[0, r]
    return total, pair


@kernel
def group_forces(model, member_state, segment, t, group, q, v, a, out):
    """Forces f* of all members of a group: those of `member_force`, to the bit, without slopes.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group: the group.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      out (M,): f* of each member of the group (N).
    """
    row = np.empty(pair_freedoms(model))
    out[:] = 0.0
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] != group or model.active[segment, k] == 0:
            continue
        p = model.block[k, PAIR]
        turn_one = turn_of(model, model.pair[p, 0], q)
        turn_two = turn_of(model, model.pair[p, 1], q)
        value = level_of(model, segment, k, t)
        first = model.block[k, OFFSET] - model.block[k, START]
        for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
            scale = member_state[SCALE, i]
            if model.block[k, CODE] == INERTER:
                out[first + i] += scale * inerter_force(model, k, i, q, v, a, row)
                continue
            if law_is_idle(model.block[k, CODE], int(member_state[MODE, i])):
                continue
            x, rate = stretch_between(model, p, i, turn_one, turn_two, q, v)
            x -= member_state[SET, i]
            f, _, _, _, _ = law(
                model.block[k, CODE], model.law[k], x, rate, int(member_state[MODE, i]), t, value, model.curves,
                model.member[MEMBER_FREE_LENGTH, i],
            )  # fmt: skip
            out[first + i] += scale * f


@kernel
def group_rates(model, member_state, segment, t, group, q, v, a, rel, out):
    """Forces of `group_forces`, and their rates, of a group that is plain (`is_plain`).

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group: the group.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      rel (n_pair, POSE): relative poses there.
    Out:
      out (2, M): f* of each member of the group (N), and its rate (N/s).
    """
    out[:] = 0.0
    second = np.empty(freedoms(model))
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] != group or model.active[segment, k] == 0:
            continue
        p = model.block[k, PAIR]
        code = model.block[k, CODE]
        turn_one = turn_of(model, model.pair[p, 0], q)
        turn_two = turn_of(model, model.pair[p, 1], q)
        pose_acceleration(model, rel, p, a, second)
        value = level_of(model, segment, k, t)
        first = model.block[k, OFFSET] - model.block[k, START]
        for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
            mode = int(member_state[MODE, i])
            if law_is_idle(code, mode):
                continue
            scale = member_state[SCALE, i]
            x, rate = stretch_between(model, p, i, turn_one, turn_two, q, v)
            x -= member_state[SET, i]
            rest = model.member[MEMBER_FREE_LENGTH, i]
            f, by_x, by_rate, _, _ = law(code, model.law[k], x, rate, mode, t, value, model.curves, rest)
            slope = by_x * rate + law_by_time(code, model.law[k], x, rate, mode, t, model.curves, rest)
            if by_rate != 0.0:
                slope += by_rate * second_rate(model, i, rel[p], second)
            out[0, first + i] += scale * f
            out[1, first + i] += scale * slope


@kernel
def force_by_time(model, member_state, segment, t, group, i, q, v):
    """Slope by time, at a fixed state, of |f*| of one member of a group that is plain (`is_plain`), N/s.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group, i: the group, and the number of the member in it.
      q (n_q,), v (n,): coordinates and velocities.
    """
    timed = False
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] == group and law_is_timed(model.block[k, CODE], model.law[k], model.curves):
            timed = True
    if not timed:
        return 0.0
    total = 0.0
    slope = 0.0
    own = np.empty((2, pair_freedoms(model)))
    for k in range(model.block.shape[0]):
        own_i = i - model.block[k, OFFSET]
        if (
            model.block[k, GROUP] != group
            or model.active[segment, k] == 0
            or own_i < 0
            or own_i >= model.block[k, COUNT]
        ):
            continue
        m = model.block[k, START] + own_i
        x, rate = member_rows(model, model.block[k, PAIR], m, q, v, own[0], own[1])
        x -= member_state[SET, m]
        code, mode, rest = model.block[k, CODE], int(member_state[MODE, m]), model.member[MEMBER_FREE_LENGTH, m]
        value = level_of(model, segment, k, t)
        f, _, _, _, _ = law(code, model.law[k], x, rate, mode, t, value, model.curves, rest)
        total += member_state[SCALE, m] * f
        slope += member_state[SCALE, m] * law_by_time(code, model.law[k], x, rate, mode, t, model.curves, rest)
    return slope if total >= 0.0 else -slope


@kernel
def largest_force(model, member_state, segment, t, group, q, v, a):
    """The number within its group of the member that carries the largest |f*|.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group: the group.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    """
    slopes = np.empty((3, pair_freedoms(model)))
    own = np.empty((2, pair_freedoms(model)))
    best = -1.0
    who = 0
    for i in range(members_of(model, group)):
        f, _ = member_force(model, member_state, segment, t, group, i, q, v, a, slopes, own)
        if abs(f) > best:
            best = abs(f)
            who = i
    return who


@kernel
def members_of(model, group):
    """How many members a group of the model has."""
    count = 0
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] == group:
            count = max(count, model.block[k, OFFSET] + model.block[k, COUNT])
    return count


@kernel
def equal_forces(model, member_state, segment, t, group, q, v, a, largest, tied):
    """Find the members of a group that share the largest |f*|, to TIE.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group: the group.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      largest: the largest |f*| there (N).
    Out:
      tied (M,): numbers of these members, first of all; M is the size of the group.

    Returns how many they are; 1 where all forces are zero, of which none is written.
    """
    slopes = np.empty((3, pair_freedoms(model)))
    own = np.empty((2, pair_freedoms(model)))
    found = 0
    for i in range(members_of(model, group)):
        f, _ = member_force(model, member_state, segment, t, group, i, q, v, a, slopes, own)
        if abs(f) >= (1.0 - TIE) * largest and largest > 0.0:
            tied[found] = i
            found += 1
    return max(found, 1)


@_chosen_of_bodies(lambda each: each.value)
def _value(kind, model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar):
    """Value of a response by its kind (`ResponseKernels.value`).

    kind: code of the response, by which its kernel is chosen; the kernel takes of the others what it asks for.
    model: the compiled scene.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    segment: number of the stretch of time between two breakpoints.
    j: the response.
    who: of a member force the number of the member in its group.
    t: time (s).
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    lam (n_row,): multipliers of the joints.
    workspace: workspace as the balance of this state has left it.
    bars (3, n), row_bar (n_row,): slopes by q, v, a and by lam, zero before.
    """
    return np.nan


@kernel
def _parts_of_expression(model, member_state, segment, j, t, q, v, a, lam, workspace, p, bars, rows):
    """Values and slopes of the responses that expression j is of, at a state whose balance has just been made.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the expression.
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers of the joints.
      workspace: workspace as the balance of this state has left it.
    Out:
      p (numbers_of,): the values, and behind them the parameters of the expression.
      bars (PARTS, 3, n), rows (PARTS, n_row): slopes of each by q, v, a and by lam; zeros before.
    """
    first = model.response[j, FIRST_PART]
    for m in range(model.response[j, PARTS]):
        c = first + m
        if model.response[c, KIND] == MEMBER_FORCE:
            group = model.response[c, SUBJECT]
            p[m] = force_of_one(model, member_state, segment, t, group, 0, q, v, a, np.bool_(True), bars[m])
            continue
        p[m] = _value(
            model.response[c, KIND], model, member_state, segment, c, -1, t, q, v, a, lam, workspace, bars[m], rows[m]
        )
    put_parameters(model, j, p)


@kernel
def _expression_value(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar):
    """Value of expression j, by the chain rule with its slopes.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j, who: the expression, and on which side its switches are (`expressions`).
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers of the joints.
      workspace: workspace as the balance of this state has left it.
    Out:
      bars (3, n), row_bar (n_row,): slopes by q, v, a and by lam, zero before.
    """
    count = model.response[j, PARTS]
    p = np.empty(numbers_of(model, j))
    of_parts = np.zeros((count, 3, v.shape[0]))
    rows = np.zeros((count, row_bar.shape[0]))
    slopes = np.empty(count)
    _parts_of_expression(model, member_state, segment, j, t, q, v, a, lam, workspace, p, of_parts, rows)
    value, _ = formula_value(model, j, who, p, t, slopes)
    for m in range(count):
        if slopes[m] == 0.0:
            continue
        for i in range(3):
            for d in range(v.shape[0]):
                bars[i, d] += slopes[m] * of_parts[m, i, d]
        for r in range(row_bar.shape[0]):
            row_bar[r] += slopes[m] * rows[m, r]
    return value


@kernel
def _expression_numbers(model, member_state, segment, j, t, q, v, a, lam, workspace):
    """Values of what expression j is of, and its parameters (numbers_of,).

    model: the compiled scene.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    segment: number of the stretch of time between two breakpoints.
    j: the expression.
    t: time (s).
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    lam (n_row,): multipliers of the joints.
    workspace: workspace as the balance of this state has left it.
    """
    count = model.response[j, PARTS]
    p = np.empty(numbers_of(model, j))
    bars = np.zeros((count, 3, v.shape[0]))
    rows = np.zeros((count, lam.shape[0]))
    _parts_of_expression(model, member_state, segment, j, t, q, v, a, lam, workspace, p, bars, rows)
    return p


@kernel
def chosen_part(model, member_state, segment, j, who, t, q, v, a, lam, workspace):
    """The member whose force response j is at this state, or the bits of the switches of an expression.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response.
      who: what is asked for; -1: the member with the largest force, and the sides of this state; below -1, of an
        expression: the margin of a switch there (`expressions`).
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers of the joints.
      workspace: workspace as the balance of this state has left it.
    """
    if who >= 0:
        return who
    if model.response[j, KIND] == MEMBER_FORCE:
        return np.int64(largest_force(model, member_state, segment, t, model.response[j, SUBJECT], q, v, a))
    if response_switches(model, j):
        p = _expression_numbers(model, member_state, segment, j, t, q, v, a, lam, workspace)
        return formula_mode(model, j, p, t) + (-1 - who) * MARGINS
    return np.int64(who)


@kernel
def is_chosen(model, j):
    """Whether response j is one of several, by `chosen_part`."""
    return model.response[j, KIND] == MEMBER_FORCE or response_switches(model, j)


@kernel
def response_switches(model, j):
    """Whether response j is an expression with kinks or jumps."""
    return model.response[j, KIND] == EXPRESSION and model.response[j, SWITCHES] > 0


@kernel
def has_energy(model, j):
    """Whether response j is the stored energy, or an expression in which it occurs."""
    kind = model.response[j, KIND]
    return kind == ENERGY or (kind == EXPRESSION and knows(model, j, ENERGETIC))


@kernel
def has_forces(model, j):
    """Whether response j is an expression that has forces of members in it."""
    return model.response[j, KIND] == EXPRESSION and knows(model, j, FORCED)


@kernel
def design_slopes(model, member_state, segment, j, who, t, q, v, a, lam, workspace):
    """(PARTS,): slopes of expression j by what it is of, where some of that depends on the design at fixed motion.

    Nothing, (0,), of other responses.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j, who: the response, and of an expression on which side its switches are.
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers of the joints.
      workspace: workspace as the balance of this state has left it.
    """
    if model.response[j, KIND] != EXPRESSION or not (has_energy(model, j) or has_forces(model, j)):
        return np.empty(0)
    p = _expression_numbers(model, member_state, segment, j, t, q, v, a, lam, workspace)
    slopes = np.empty(model.response[j, PARTS])
    formula_value(model, j, who, p, t, slopes)
    return slopes


@kernel
def energy_weight(model, j, slopes):
    """The slope of response j by the stored energy; slopes: `design_slopes`."""
    if model.response[j, KIND] == ENERGY:
        return 1.0
    weight = 0.0
    for m in range(slopes.shape[0]):
        if model.response[model.response[j, FIRST_PART] + m, KIND] == ENERGY:
            weight += slopes[m]
    return weight


@kernel
def response(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar):
    """Value of response j, with its slopes, at a state whose balance has just been made.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response.
      who: of a member force the number of the member in its group.
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers of the joints.
      workspace: workspace as the balance of this state has left it.
    Out:
      bars (3, n): slopes by q, v and a.
      row_bar (n_row,): slopes by lam.
    """
    bars[:] = 0.0
    row_bar[:] = 0.0
    if model.response[j, KIND] == EXPRESSION:
        return _expression_value(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar)
    return _value(
        model.response[j, KIND], model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar
    )


@kernel
def energy_value(model, workspace, bars):
    """Elastic energy stored in all design members (J); its slopes by q are added to bars (3, n)."""
    value = 0.0
    for p in range(model.pair.shape[0]):
        o = workspace.sums[p]
        value += o[energy_column(model)]
        add_pair_force(model, workspace.rel, p, o, pull_column(model), bars[0])
    return value


@kernel
def members_value(model, member_state, segment, j, who, t, q, v, a, bars):
    """|f*| of one member of a group (N).

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response, which says which group.
      who: number of the member in the group.
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      bars (3, n): slopes by q, v and a, added to.
    """
    group = model.response[j, SUBJECT]
    return force_of_one(model, member_state, segment, t, group, who, q, v, a, np.bool_(False), bars)


@kernel
def force_of_one(model, member_state, segment, t, group, who, q, v, a, signed, bars):
    """The force f* of one member of a group, or its absolute value (N).

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      group, who: the group, and the number of the member in it.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      signed: whether it is the force, tension positive.
    Out:
      bars (3, n): slopes by q, v and a, added to.
    """
    slopes = np.empty((3, pair_freedoms(model)))
    own = np.empty((2, pair_freedoms(model)))
    f, pair = member_force(model, member_state, segment, t, group, who, q, v, a, slopes, own)
    sign = 1.0 if signed or f >= 0.0 else -1.0
    inertial = False
    for i in range(3):
        for c in range(pair_freedoms(model)):
            bars[i, place_in_pair(model, pair, c)] += sign * slopes[i, c]
            inertial = inertial or (i == 2 and slopes[i, c] != 0.0)
    if inertial:
        _inerter_slopes(model, member_state, segment, who, group, sign, q, v, a, bars)
    return sign * f


@kernel
def point_value(model, j, q, v, a, bars):
    """Component or norm of a point's motion, as response j asks.

    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    bars (3, n): slopes by q, v and a are added to it.
    """
    return motion_component(model, j, model.response[j, COMPONENT], q, v, a, bars)


@kernel
def angle_value(model, j, q, v, a, bars):
    """In a plane: an angle, its rate or second derivative, as response j asks.

    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    bars (3, n): slopes by q, v and a are added to it.
    """
    body = model.response[j, BODY]
    return angle_motion(model, model.response[j, ORDER], body, model.response[j, REFERENCE], q, v, a, bars)


@kernel
def turn_value(model, j, q, v, a, bars):
    """In space: how a body has turned, how fast it turns, or the rate of that.

    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    bars (3, n): slopes by q, v and a are added to it.
    """
    body = model.response[j, BODY]
    reference = model.response[j, REFERENCE]
    component = model.response[j, COMPONENT]
    return turn_motion(model, model.response[j, ORDER], component, body, reference, q, v, a, bars)


@kernel
def tilt_value(model, j, q, v, a, bars):
    """In space: the angle by which an axis of a body has tilted.

    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    bars (3, n): slopes by q, v and a are added to it.
    """
    first = dimensions(model)  # behind the place of a point
    axis = model.response_par[j, first:]
    return tilt_motion(model, axis, model.response[j, BODY], model.response[j, REFERENCE], q, v, a, bars)


@kernel
def joint_force_value(model, j, q, lam, bars, row_bar):
    """Norm of the force that a joint transmits (N).

    model: the compiled scene.
    j: the response, which says which joint.
    q (n_q,): coordinates (m, rad).
    lam (n_row,): multipliers of the joints.
    bars (3, n): slopes by q are added to its first row.
    row_bar (n_row,): slopes by lam are written into it.
    """
    return _transmitted(model, j, FORCE, q, lam, bars, row_bar)


@kernel
def joint_moment_value(model, j, q, lam, bars, row_bar):
    """Absolute value, in space the norm, of the moment that a joint transmits (N m).

    model: the compiled scene.
    j: the response, which says which joint.
    q (n_q,): coordinates (m, rad).
    lam (n_row,): multipliers of the joints.
    bars (3, n): slopes by q are added to its first row.
    row_bar (n_row,): slopes by lam are written into it.
    """
    return _transmitted(model, j, MOMENT, q, lam, bars, row_bar)


@kernel
def motion_component(model, j, component, q, v, a, bars):
    """One component of the motion of the point that response j is about.

    model: the compiled scene.
    j: the response.
    component: X, Y, Z, NORM or, in a plane, ACROSS (`components`).
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    bars (3, n): slopes by q, v and a are added to it.
    """
    body = model.response[j, BODY]
    reference = model.response[j, REFERENCE]
    order = model.response[j, ORDER]
    at = model.response_par[j]
    return point_motion(model, order, component, at, at[dimensions(model) :], body, reference, q, v, a, bars)


@kernel
def _transmitted(model, j, which, q, lam, bars, row_bar):
    """What the joint transmits that response j is about, with its slopes (`transmitted`).

    model: the compiled scene.
    j: the response, which says which joint.
    which: FORCE, MOMENT or ACROSS_FORCE.
    q (n_q,): coordinates (m, rad).
    lam (n_row,): multipliers of the joints.
    bars (3, n): slopes by q are added to its first row.
    row_bar (n_row,): slopes by lam are written into it.
    """
    joint = model.response[j, SUBJECT]
    mine = np.empty(most_rows(model))
    by_lam = np.empty(most_rows(model))
    by_q = np.empty(pair_freedoms(model))
    gather_multipliers(model, joint, lam, mine)
    value = transmitted(model, joint, which, q, mine, by_lam, by_q)
    for r in range(most_rows(model)):
        if model.row[joint, r] >= 0:
            row_bar[model.row[joint, r]] = by_lam[r]
    for c in range(pair_freedoms(model)):
        bars[0, place_in_joint(model, joint, c)] += by_q[c]
    return value


@kernel
def is_norm(model, j):
    """Whether response j is the Euclidean norm of a vector."""
    return _is_vector(model.response[j, KIND]) and model.response[j, COMPONENT] == NORM


def has_norm(model: GeneralModel, j: int) -> bool:
    """Whether response j is the norm of a vector; `is_norm`, called from Python."""
    if is_expression(model, j):
        return False
    return LISTED[int(model.response[j, KIND])].vector is not None and int(model.response[j, COMPONENT]) == NORM


def norms_in(model: GeneralModel, j: int) -> list[int]:
    """Those of the responses that expression j is of which are norms of vectors; none where j is no expression."""
    if not is_expression(model, j):
        return []
    first = int(model.response[j, FIRST_PART])
    return [part for part in range(first, first + int(model.response[j, PARTS])) if has_norm(model, part)]


def has_kinks(model: GeneralModel, j: int) -> bool:
    """Whether response j may have kinks in time; `kinked`, called from Python."""
    return is_absolute(model, j) or has_norm(model, j)


def is_absolute(model: GeneralModel, j: int) -> bool:
    """Whether response j is an absolute value, or the largest of several, or an expression that is a root."""
    if is_expression(model, j):
        return bool(model.response[j, KNOWN] & ROOT)
    return LISTED[int(model.response[j, KIND])].absolute


def is_expression(model: GeneralModel, j: int) -> bool:
    """Whether response j is an expression of others."""
    return int(model.response[j, KIND]) == EXPRESSION


def switches_of(model: GeneralModel, j: int) -> int:
    """How many kinks and jumps response j has as an expression."""
    return int(model.response[j, SWITCHES]) if is_expression(model, j) else 0


@_chosen_of_bodies(lambda each: each.vector and each.vector.across)
def _across(kind, model, j, q, v, a, lam, bars, row_bar):
    """In a plane: slopes of the component perpendicular to a response's vector (`VectorKernels.across`).

    kind: code of the response, by which its kernel is chosen; the kernel takes of the others what it asks for.
    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    lam (n_row,): multipliers of the joints.
    bars (3, n), row_bar (n_row,): slopes by q, v, a and by lam, zero before.
    """
    return np.nan


@kernel
def across_slopes(model, j, q, v, a, lam, bars, row_bar):
    """In a plane: slopes of the component perpendicular to the vector whose norm response j is, at fixed direction.

    Constant:
      model: the compiled scene.
    In:
      j: the response, a norm (`is_norm`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      lam (n_row,): multipliers of the joints.
    Out:
      bars (3, n): slopes by q, v and a; zero where the vector is.
      row_bar (n_row,): slopes by lam.
    """
    bars[:] = 0.0
    row_bar[:] = 0.0
    _across(model.response[j, KIND], model, j, q, v, a, lam, bars, row_bar)


@kernel
def motion_across(model, j, q, v, a, bars):
    """Add the slopes of the component of a point's motion that is perpendicular to the vector of this motion.

    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    bars (3, n): slopes by q, v and a are added to it.
    """
    return motion_component(model, j, ACROSS, q, v, a, bars)


@kernel
def joint_force_across(model, j, q, lam, bars, row_bar):
    """Add the slopes of the component perpendicular to the force that a joint transmits.

    model: the compiled scene.
    j: the response, which says which joint.
    q (n,): coordinates (m, rad).
    lam (n_row,): multipliers of the joints.
    bars (3, n): slopes by q are added to its first row.
    row_bar (n_row,): slopes by lam are written into it.
    """
    return _transmitted(model, j, ACROSS_FORCE, q, lam, bars, row_bar)


@_chosen_of_bodies(lambda each: each.vector and each.vector.components)
def _components(kind, model, j, q, v, a, lam, out):
    """In a plane: the vector whose norm response j is, in the frame where it is formed (`VectorKernels.components`).

    kind: code of the response, by which its kernel is chosen; the kernel takes of the others what it asks for.
    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    lam (n_row,): multipliers of the joints.
    out (2,): the vector.
    """


@kernel
def motion_components(model, j, q, v, a, out):
    """Both components of a point's motion.

    model: the compiled scene.
    j: the response.
    q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    out (2,): the components along x and y.
    """
    spare = np.zeros((3, v.shape[0]))
    out[0] = motion_component(model, j, X, q, v, a, spare)
    out[1] = motion_component(model, j, Y, q, v, a, spare)


@kernel
def joint_force_components(model, j, lam, out):
    """Both components of the force that a joint transmits."""
    mine = np.empty(most_rows(model))
    gather_multipliers(model, model.response[j, SUBJECT], lam, mine)
    out[0] = mine[0]
    out[1] = mine[1]


@kernel
def across_rate(tag, model, member_state, history, k, c, j, t, q, v, workspace, a, lam):
    """In a plane: rate in time, within a step, of the component of `across_slopes`; by differences, as in `rated`.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      k, c: number of the step, and the fraction of it at which the state is.
      j: the response, a norm (`is_norm`).
      t: time (s).
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      a (n,), lam (n_row,): scratch.
      workspace: workspace of a balance (`accelerations.Workspace`).
    """
    n = v.shape[0]
    segment = history.index[k, SEGMENT]
    no = np.bool_(False)
    near_q = np.empty(q.shape[0])
    near = np.empty((2, n))
    vector = np.empty(2)
    nearby = np.empty((2, 2))
    solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
    _components(model.response[j, KIND], model, j, q, v, a, lam, vector)
    size = np.hypot(vector[0], vector[1])
    if size == 0.0:
        return 0.0
    here = a.copy()
    apart = RATE_SHIFT * (history.t[k + 1] - history.t[k])
    for side in range(2):
        e = apart if side == 1 else -apart
        state_at_offset(tag, model, history, k, c, e, q, v, here, near_q, near[0])
        solve_accelerations(model, member_state, segment, t + e, near_q, near[0], no, workspace, near[1], lam)
        _components(model.response[j, KIND], model, j, near_q, near[0], near[1], lam, nearby[side])
    x = nearby[1, 0] - nearby[0, 0]
    y = nearby[1, 1] - nearby[0, 1]
    return (vector[0] * y - vector[1] * x) / (2.0 * apart * size)


@kernel
def _inerter_slopes(model, member_state, segment, who, group, sign, q, v, a, bars):
    """Add the slopes by q and v of an inerter's force, by sixth-order differences of its formula: rarely needed.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      who, group: number of the member in its group, and the group.
      sign: what f* is multiplied by before it is differentiated.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      bars (3, n): slopes by q and v are added to its first two rows.
    """
    own = np.empty(pair_freedoms(model))
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] != group or model.block[k, CODE] != INERTER or model.active[segment, k] == 0:
            continue
        if who < model.block[k, OFFSET] or who >= model.block[k, OFFSET] + model.block[k, COUNT]:
            continue
        pair = model.block[k, PAIR]
        i = model.block[k, START] + who - model.block[k, OFFSET]
        for which in range(2):
            for c in range(pair_freedoms(model)):
                d = place_in_pair(model, pair, c)
                size = 2e-3 * model.reach[pair] if which == 0 else 1e-2 * (0.1 + abs(v[d]))
                if which == 0 and is_turning(model, c):
                    size = 2e-3
                slope = 0.0
                for m in range(3):
                    weight = 0.75 if m == 0 else (-0.15 if m == 1 else 1.0 / 60.0)
                    plus = _shifted_force(model, k, i, which, d, (m + 1) * size, q, v, a, own)
                    slope += weight * (plus - _shifted_force(model, k, i, which, d, -(m + 1) * size, q, v, a, own))
                bars[which, d] += sign * member_state[SCALE, i] * slope / size


@kernel
def _shifted_force(model, k, i, which, d, size, q, v, a, row):
    """`inerter_force` at coordinates or velocities of which one is shifted.

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
      which, d, size: 0: coordinates, 1: velocities; the freedom, and by how much it is shifted.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      row (2 D,): scratch.
    """
    shift = np.zeros(v.shape[0])
    if which == 0:
        shift[d] = size
        moved = np.empty(q.shape[0])
        retract(model, q, shift, moved)
        return inerter_force(model, k, i, moved, v, a, row)
    for each in range(v.shape[0]):
        shift[each] = v[each]
    shift[d] = v[d] + size
    return inerter_force(model, k, i, q, shift, a, row)


@kernel
def value_at(model, member_state, segment, t, q, v, j, workspace):
    """Value of response j at a state, in the modes that members are in; of member forces the largest.

    model: the compiled scene.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    segment: number of the stretch of time between two breakpoints.
    t: time (s).
    q (n_q,), v (n,): coordinates and velocities.
    j: the response.
    workspace: workspace of a balance (`accelerations.Workspace`).
    """
    n = model.mass.shape[0]
    q = q.copy()
    v = v.copy()
    a = np.empty(n)
    lam = np.empty(model.size[0])
    bars = np.empty((3, n))
    row_bar = np.empty(model.size[0])
    solve_accelerations(model, member_state, segment, t, q, v, np.bool_(False), workspace, a, lam)
    who = chosen_part(model, member_state, segment, j, np.int64(-1), t, q, v, a, lam, workspace)
    return response(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar)


@kernel
def rated(
    tag, model, member_state, history, k, c, j, who, rates, balanced, t, q, v, workspace, a, lam, bars, row_bar,
    near_q, near, own,
):  # fmt: skip
    """Value of response j and its rate in time at a state within a step.

    Where g depends on q alone, or on q and v and the motion has the accelerations of its balance, the rate is
    dg/dt = g_q v + g_v a (`follows_state`), and for a member's force its slope by time; else it is differenced along
    the method's own motion.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      k, c: number of the step, and the fraction of it at which the state is.
      j: the response; below 0 none is asked for, and only the balance is made.
      who: of a member force the number of the member in its group.
      rates: whether the rate is wanted; else it may be meaningless.
      balanced: whether a and lam are wanted, whatever the response needs; else those of one that needs no balance stay
        what they were.
      t: time (s).
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      a (n,), lam (n_row,): accelerations and multipliers of the state.
      workspace: overwritten.
      bars (3, n), row_bar (n_row,): slopes of the response by q, v, a and by lam.
      near_q (n_q,), near (3, n), own (n_row,): scratch.

    Returns the value, its rate (per s), and how many balances were made.
    """
    n = v.shape[0]
    segment = history.index[k, SEGMENT]
    no = np.bool_(False)
    if j < 0:
        solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
        return np.nan, np.nan, 1
    order = model.response[j, ORDER]
    simple = not rates or follows_state(tag, model, j)
    by_itself = not needs_balance(model, j) and (order == 0 or (order == 1 and not rates))
    stored = is_continuous(tag) and model.response[j, KIND] == ENERGY and simple and not balanced
    made = 0
    if stored:  # sums over the members are all that is needed; other methods have use for the accelerations
        members_alone(model, member_state, segment, t, q, v, workspace)
        made = 1
    elif balanced or not simple or not by_itself:
        solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
        made = 1
    value = response(model, member_state, segment, j, who, t, q, v, a, lam, workspace, bars, row_bar)
    rate = 0.0
    if not rates:
        return value, rate, made
    if simple:
        for d in range(n):
            rate += bars[0, d] * v[d]
        if (order > 0 or needs_balance(model, j)) and not stored:
            for d in range(n):
                rate += bars[1, d] * a[d]
        if model.response[j, KIND] == MEMBER_FORCE:
            rate += force_by_time(model, member_state, segment, t, model.response[j, SUBJECT], who, q, v)
        if model.response[j, KIND] == EXPRESSION and knows(model, j, TIMED):
            p = _expression_numbers(model, member_state, segment, j, t, q, v, a, lam, workspace)
            rate += formula_value(model, j, who, p, t, np.empty(model.response[j, PARTS]))[1]
        return value, rate, made
    apart = RATE_SHIFT * (history.t[k + 1] - history.t[k])
    sides = np.zeros(2)
    for side in range(2):
        e = apart if side == 1 else -apart
        state_at_offset(tag, model, history, k, c, e, q, v, a, near_q, near[1])
        solve_accelerations(model, member_state, segment, t + e, near_q, near[1], no, workspace, near[2], own)
        sides[side] = response(
            model, member_state, segment, j, who, t + e, near_q, near[1], near[2], own, workspace, bars, row_bar
        )
    return value, (sides[1] - sides[0]) / (2.0 * apart), made + 2


# Records


OF_ENERGY = ResponseKernels(value=energy_value, by_state=True)
OF_POINT = ResponseKernels(
    value=point_value,
    vector=VectorKernels(across=motion_across, components=motion_components),
    needs_accelerations=False,
    by_state=True,
)
OF_ANGLE = ResponseKernels(value=angle_value, needs_accelerations=False, by_state=True, in_space=False)
OF_MEMBERS = ResponseKernels(value=members_value, absolute=True)
OF_JOINT_FORCE = ResponseKernels(
    value=joint_force_value,
    vector=VectorKernels(across=joint_force_across, components=joint_force_components),
    absolute=True,
)
OF_JOINT_MOMENT = ResponseKernels(value=joint_moment_value, absolute=True)

OF_TURN = ResponseKernels(
    value=turn_value, vector=VectorKernels(is_turn=True), needs_accelerations=False, by_state=True, in_plane=False
)
OF_TILT = ResponseKernels(value=tilt_value, absolute=True, needs_accelerations=False, by_state=True, in_plane=False)

#: of the responses that are known so far, by where their kernels are
CODES: dict[str, int] = {}


def code_of(kind: ResponseKind) -> int:
    """The code by which kernels know a response."""
    if kind.kernels not in CODES:
        module, _, name = kind.kernels.partition(":")
        CODES[kind.kernels] = LISTED.add(getattr(importlib.import_module(module), name))
        if not module.startswith("mdstopo."):
            store.include(module)
    return CODES[kind.kernels]


for _kind in (*RESPONSES.values(), *SPATIAL_RESPONSES.values()):
    if _kind.kernels.startswith("mdstopo."):  # an expression has none
        code_of(_kind)
LISTED.is_filled = True
