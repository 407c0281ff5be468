"""A case and one of its load cases, compiled into the arrays of a general scene (`GeneralModel`), once."""

from collections.abc import Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mdstopo.case.methods.over_time import REDUCTIONS, ReductionKind
from mdstopo.case.model import GROUND, Case, LoadCase, MemberGroup, Response, ResponseRow
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.case.text.errors import CaseError
from mdstopo.compiler.threads import allowed
from mdstopo.general.model.general_model import MEMBER_EXCESS, MEMBER_FREE_LENGTH, ROW, GeneralModel, without_numbers
from mdstopo.general.responses import general_responses
from mdstopo.general.scene.dimension import Dimension, Frames, Pairs, dimension_of, in_frame
from mdstopo.general.scene.driven_integrals import integration_times
from mdstopo.general.scene.drives import Drives, drives, drives_all, motion_times
from mdstopo.general.scene.expression_rows import expression_codes, expression_data
from mdstopo.general.scene.extent import size_of
from mdstopo.general.scene.layout import arrange, undetermined
from mdstopo.general.scene.timed_loads import kink_times, mistake_of, parts_of, timed_loads
from mdstopo.general.scene.timed_switches import switch_times
from mdstopo.general.scene.variables import (
    adds_damping,
    along,
    as_computed,
    each_member,
    has_damping,
    lasting_times,
    varied,
    watched_times,
)
from mdstopo.integrators.integrator_choice import has_coarse_steps
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.mechanics.kinematics.timed import ADDRESS
from mdstopo.mechanics.laws import law_table
from mdstopo.mechanics.laws.spring import NEAR_AT
from mdstopo.scene.bodies import distances, stands_as
from mdstopo.scene.compile_scene import near_of, with_arms
from mdstopo.scene.family import beyond_springs
from mdstopo.scene.grid_members import row_of, short_row_of
from mdstopo.scene.origin import ends_of
from mdstopo.scene.other_kernels import include_kernels
from mdstopo.scene.refusals import rows_of_responses
from mdstopo.scene.signal_segments import breakpoints, segment_values
from mdstopo.scene.springs_model import VECTOR, FloatArray, IndexArray


@dataclass(frozen=True)
class GeneralScene:
    """One load case, ready to be computed.

    load_case; model: the arrays; bodies: names in the order of the state, ground last; n_bodies: without it; damped:
    whether anything depends on velocity; skipped: what was left out, and why; redundant: joints with rows that others
    imply; responses, reductions: what is evaluated and how, objectives first, in the case's order; kinematics: how
    bodies move; contacts: each in words.
    """

    load_case: LoadCase
    model: GeneralModel
    bodies: tuple[str, ...]
    n_bodies: int
    damped: bool
    skipped: tuple[str, ...]
    redundant: tuple[str, ...]
    responses: tuple[Response, ...]
    reductions: tuple[ReductionKind, ...]
    kinematics: Kinematics
    contacts: tuple[str, ...] = ()

    @cached_property
    def n(self) -> int:
        """The number of freedoms of all bodies."""
        return self.kinematics.freedoms * self.n_bodies

    @property
    def degrees_of_freedom(self) -> int:
        """The number of free coordinates, less that of the independent rows of joints."""
        return int(self.model.free.sum()) - int(self.model.size[0])


def evaluated_in(case: Case, load_case: str) -> tuple[tuple[Response, ...], tuple[ReductionKind, ...]]:
    """The responses that are evaluated in a load case, and how each is reduced: of objectives, then of constraints,
    each in the case's order."""
    found = [(o.response, o.over_time) for o in case.objectives if o.load_case == load_case]
    rows = [row for row in case.constraints if isinstance(row, ResponseRow) and row.load_case == load_case]
    found += [(row.response, row.over_time) for row in rows]
    return tuple(r for r, _ in found), tuple(REDUCTIONS[o] for _, o in found)


def compile_general(case: Case, load_case: LoadCase) -> GeneralScene:
    """The arrays of one load case, for the kernels of general scenes."""
    case = as_computed(case)
    include_kernels(case)
    dimension = dimension_of(case)
    bodies = dimension.kinematics
    names = (*(body.name for body in case.bodies), GROUND)
    index = {name: i for i, name in enumerate(names)}
    each = bodies.freedoms
    n = each * len(names)
    home, frames = dimension.home(load_case, len(names)), dimension.frames(load_case)
    mass, v0 = _masses_and_velocities(load_case, dimension, home)
    times = breakpoints(load_case, _more_times(case, load_case, dimension))
    made = drives(load_case, times, dimension, dimension.stated(home), v0, home)
    _refuse_impacts(case, load_case, bodies, made, times)
    free = np.ones(n, dtype=np.int64)
    free[-each:] = 0
    free[made.driven] = 0

    pairs: Pairs = {}
    moved = None if stands_as(case, load_case) else home
    members = _members(case, dimension, frames, moved, index, pairs, times)
    bushing_pair, bushing = dimension.bushings(case, index, pairs, home)
    joint, joint_par = _joints(case, dimension, frames, index, pairs, home)
    contact_pair, contact, contact_words = dimension.contacts(case, index, pairs, frames)
    held = {body for pair in pairs for body in pair}
    for i in range(len(names) - 1):
        if i not in held:
            pairs.setdefault((len(names) - 1, i), len(pairs))
    pair = np.array(list(pairs), dtype=np.int64).reshape(-1, 2)
    reach = _reach(case, dimension, index, pairs, members)
    np.maximum.at(reach, contact_pair, dimension.reaches(contact))
    reach = with_arms(reach, size_of(case))
    loads = dimension.loads(load_case, index, times, frames)
    timed = timed_loads(parts_of(load_case, lambda load: dimension.timed(load, frames), index), times)
    responses, reductions = evaluated_in(case, load_case.name)
    response, response_par, curves = _responses(case, dimension, frames, responses, index, members["curves"])
    members["curves"] = curves
    steady = [dimension.joint_kernels(type(each)).steady for each in case.joints]
    layout = arrange(case, joint, joint_par, steady, free, mass, home, pair, bodies)
    if layout.redundant and any(each.joint for _, row in rows_of_responses(case) for each in row.response.parts):
        open_forces = undetermined([each.name for each in case.joints], joint, joint_par, free, home, bodies)
        _refuse_redundant(case, load_case, {*layout.redundant, *open_forces})
    damped = bodies.turns_couple or _damped(case, responses, reductions)
    by_order_8 = damped or _switches(case)
    entries = varied(case, members["block"])
    model = GeneralModel(
        free=free, mass=mass, q0=np.tile(bodies.at_home, len(names)), v0=v0, home=home, pair=pair, reach=reach,
        **members, times=times, **loads._asdict(), **timed._asdict(),
        driven_par=made.formulas, driven_mode=made.modes, bushing_pair=bushing_pair, bushing=bushing,
        driven=made.driven, drive=made.cubics, drive_frame=made.frames, drive_turn=made.turns,
        joint=joint, joint_par=joint_par, **layout.fields(),
        size=np.array(
            [
                *layout.size, int(by_order_8), len(layout.schur_constant), bodies.load_slopes, bodies.attitude,
                allowed() if len(case.load_cases) == 1 else 1, bodies.pose_size,
            ], np.int64,
        ),
        response=response, response_par=response_par, contact_pair=contact_pair, contact=contact,
        varied=entries, along=along(entries), **without_numbers(),
    )  # fmt: skip
    skipped = _skipped(case, load_case, dimension, damped)
    return GeneralScene(
        load_case, model, names, len(names) - 1, damped, skipped, layout.redundant, responses, reductions, bodies,
        contact_words,
    )  # fmt: skip


def _masses_and_velocities(
    load_case: LoadCase, dimension: Dimension, home: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Masses and start velocities (n,) of all bodies; home (n_body, n_home): where they stand, ground last."""
    each = dimension.kinematics.freedoms
    mass, v0 = np.ones(each * len(home)), np.zeros(each * len(home))
    for i, body in enumerate(load_case.bodies):
        own = slice(each * i, each * (i + 1))
        mass[own] = dimension.masses(body)
        v0[own] = dimension.velocities(body, home[i])
    return mass, v0


def _more_times(case: Case, load_case: LoadCase, dimension: Dimension) -> list[float]:
    """Times at which steps end beside rows of tables of loads (s)."""
    kinks_of_formulas = kink_times(case, load_case)
    return (
        kinks_of_formulas
        + integration_times(case, load_case, kinks_of_formulas)
        + lasting_times(case, has_coarse_steps(case.solver))
        + motion_times(load_case, dimension)
        + watched_times(case, load_case)
        + switch_times(*evaluated_in(case, load_case.name), load_case)
    )


def _refuse_impacts(case: Case, load_case: LoadCase, bodies: Kinematics, made: Drives, times: FloatArray) -> None:
    """A driven position that jumps is no motion; a velocity that does needs an infinite force in a joint (CaseError).

    case, load_case: the scene.
    bodies: how they move.
    made: what is driven. times (n_seg + 1,): ends of the segments (s).
    """
    driven, drive = made.driven, made.cubics
    formulas = set(np.flatnonzero(made.formulas[:, ADDRESS]).tolist())
    names = [body.name for body in case.bodies]
    jointed = {name for joint in case.joints for name in joint.bodies}
    h = np.diff(times)[:-1, None]
    c = drive[:-1]
    reached = c[..., 0] + h * (c[..., 1] + h * (c[..., 2] + h * c[..., 3]))
    leap = np.abs(drive[1:, :, 0] - reached)
    # what rounding is relative to; at all ends of segments they may be zero
    steps = np.diff(times)[:, None, None] ** np.arange(4)
    extent = np.abs(steps * drive[..., :4]).max(axis=(0, 2), initial=0.0) + 1e-300
    before = c[..., 1] + h * (2.0 * c[..., 2] + 3.0 * h * c[..., 3])
    jump = np.abs(drive[1:, :, 1] - before)
    size = np.abs(steps[..., :3] * drive[..., 1:4]).max(axis=(0, 2), initial=0.0) + 1e-300
    mistakes = []
    for i, d in enumerate(driven.tolist()):
        name = names[d // bodies.freedoms]
        leaps = len(jump) > 0 and leap[:, i].max() > 1e-9 * extent[i] and i in formulas
        if leaps:
            when = times[1 + int(leap[:, i].argmax())]
            message = f"the prescribed position of {name} jumps at t = {when:g} s"
            mistakes.append(mistake_of(case, load_case, "motions", message))
        elif name in jointed and len(jump) and jump[:, i].max() > 1e-9 * size[i]:
            when = times[1 + int(jump[:, i].argmax())]
            message = f"the prescribed velocity of {name} jumps at t = {when:g} s, but it is jointed: that is an impact"
            mistakes.append(mistake_of(case, load_case, "motions", message))
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))


def _refuse_redundant(case: Case, load_case: LoadCase, redundant: Set[str]) -> None:
    """A joint that shares what it carries with others has no force of its own to evaluate (CaseError). redundant: the
    names of these."""
    mistakes = []
    for path, row in rows_of_responses(case):
        names = [each.joint for each in row.response.parts if each.joint in redundant]
        if row.load_case == load_case.name and names:
            mistakes.append(
                case.marks.mistake(
                    f"{path}.response",
                    f"joint {names[0]} shares its load with joints that repeat each other at the start; "
                    "its forces are not determined",
                )
            )
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))


def _row_of(group: MemberGroup, one_block: bool) -> int:
    """ROW of a group's blocks (`general.model.general_model`); one_block: whether all members are in one."""
    if not one_block:
        return 0
    return row_of(group, elastic=True)[1] or -short_row_of(group)


def _members(
    case: Case,
    dimension: Dimension,
    frames: Frames,
    home: FloatArray | None,
    index: dict[str, int],
    pairs: Pairs,
    times: FloatArray,
) -> dict[str, Any]:
    """Blocks of one law each: a group with a list of laws has as many, which share its design variables.

    A law of which each member has a parameter of its own has a block for each member.

    case, dimension, frames: the case, and what belongs to its dimension.
    home: where bodies stand if not where the lengths of members were measured.
    index: number of each body.
    pairs: takes the pairs that members connect.
    times (n_seg + 1,): ends of the segments (s).
    """
    d = dimension.point
    blocks, powers, rows, active, level, columns = [], [], [], [], [], []
    curves: list[float] = []
    springs_alone = not beyond_springs(case)
    first = start = 0
    segments = len(times) - 1
    for number, group in enumerate(case.members):
        first_body, second_body, p_local, q_local = ends_of(group)
        p_local, q_local = in_frame(frames, first_body, p_local), in_frame(frames, second_body, q_local)
        pair = pairs.setdefault((index[first_body], index[second_body]), len(pairs))
        length = group.length
        if home is not None:
            first_ends = dimension.places(home, index[first_body], p_local)
            length = distances(dimension.places(home, index[second_body], q_local) - first_ends)
        for place, record in enumerate(group.laws):
            rest = getattr(record, "free_length", None)
            kernels, code = law_table.kernels_of(type(record)), law_table.code_of(type(record))
            begin = -np.inf if record.active_from is None else record.active_from
            until = np.inf if record.active_until is None else record.active_until
            middle = 0.5 * (times[:-1] + times[1:])
            known = np.zeros((segments, 2)) if kernels.signal is None else segment_values(kernels.signal(record), times)
            parts = np.arange(len(group))[:, None] if each_member(case, group, place) else np.arange(len(group))[None]
            # rows of a grid share their first ends, which a turned group has on the ground
            row = _row_of(group, one_block=len(parts) == 1) if first_body == group.body_from else 0
            for part in parts:
                count = len(part)
                padded = -(-count // VECTOR) * VECTOR
                member = np.zeros((2 * d + 2, padded))
                member[:d, :count], member[d : 2 * d, :count] = p_local[part].T, q_local[part].T
                free = group.length[part] if rest is None else np.full(count, rest)
                member[MEMBER_FREE_LENGTH, :count] = free
                member[MEMBER_EXCESS, :count] = (length[part] - free) * (length[part] + free)
                variable = first + int(part[0]) if group.design else -1
                blocks.append([pair, start, start + padded, code, variable, count, number, int(part[0]), row])
                rows.append(law_table.parameters(record, curves))
                if springs_alone:  # elsewhere zeros: elongations always come from displacements
                    rows[-1][NEAR_AT : NEAR_AT + 2] = near_of(group, q_local[part], row > 0)
                powers.append(group.power)
                columns.append(member)
                active.append((middle > begin) & (middle < until))
                level.append(known)
                start += padded
        first += len(group) if group.design else 0
    return {
        "block": np.array(blocks, dtype=np.int64).reshape(-1, ROW + 1),
        "law": np.array(rows, dtype=np.float64).reshape(-1, law_table.PARAMETERS),
        "active": np.array(active, dtype=np.int64).reshape(-1, segments).T.copy(),
        "level": np.array(level, dtype=np.float64).reshape(-1, segments, 2).transpose(1, 0, 2).copy(),
        "power": np.array(powers, dtype=np.float64),
        "member": np.concatenate(columns, axis=1) if columns else np.zeros((2 * d + 2, 0)),
        "curves": np.array(curves, dtype=np.float64),
    }


def _joints(
    case: Case, dimension: Dimension, frames: Frames, index: dict[str, int], pairs: Pairs, home: FloatArray
) -> tuple[IndexArray, FloatArray]:
    """Codes, bodies, pair and rows (n_joint, 5), and parameters of each joint (`GeneralModel.joint`, `joint_par`).

    case, dimension, frames: the case, and what belongs to its dimension.
    index: number of each body.
    pairs: takes the pairs that joints connect.
    home (n_body, n_home): where bodies stand.
    """
    codes, rows = [], []
    for joint in case.joints:
        a, b = (index[name] for name in joint.bodies)
        pair = pairs.setdefault((a, b), len(pairs))
        kind = type(joint)
        codes.append([dimension.joint_code(kind), a, b, pair, dimension.joint_kernels(kind).rows])
        rows.append(dimension.joint_row(joint, home, a, b, frames))
    return (
        np.array(codes, dtype=np.int64).reshape(-1, 5),
        np.array(rows, dtype=np.float64).reshape(len(rows), -1) if rows else np.zeros((0, 1)),
    )


def _reach(
    case: Case, dimension: Dimension, index: dict[str, int], pairs: Pairs, members: dict[str, Any]
) -> FloatArray:
    """(n_pair,): the largest distance of an attachment point from its centre of mass, m.

    Of members those on the second body of the pair count, of joints and bushings those on both.
    """
    reach = np.zeros(len(pairs))
    on_second = members["member"][dimension.point : 2 * dimension.point].T
    for pair, start, stop, *_ in members["block"].tolist():
        reach[pair] = max(reach[pair], float(distances(on_second[start:stop]).max()))
    ties: tuple[Any, ...] = (*case.joints, *case.bushings)
    for tie in ties:
        a, b = (index[name] for name in tie.bodies)
        pair = pairs[a, b]
        ends = distances(np.array([tie.at_second, tie.at_first], dtype=np.float64))
        reach[pair] = max(reach[pair], *ends.tolist())
    return reach


def _responses(
    case: Case,
    dimension: Dimension,
    frames: Frames,
    responses: tuple[Response, ...],
    index: dict[str, int],
    curves: FloatArray,
) -> tuple[IndexArray, FloatArray, FloatArray]:
    """The columns (n_resp, 6) and numbers of each response (`GeneralModel.response`, `response_par`), and the data of
    laws with those of expressions behind them. Responses that expressions are of stand behind the others.

    case, dimension, frames: the case, and what belongs to its dimension.
    responses: of objectives and constraints.
    index: number of each body.
    curves: data of laws.
    """
    codes, rows = [], []
    parts = [part for response in responses for _, part in response.of]
    data, first = curves.tolist(), len(responses)
    groups = [group.name for group in case.members]
    named = [joint.name for joint in case.joints]
    for response in (*responses, *parts):
        if response.of:
            codes.append(expression_codes(response, first))
            rows.append([float(len(data)), *[0.0] * (dimension.response_par - 1)])
            data += expression_data(response)
            first += len(response.of)
            continue
        record = kind_of(response)
        code = general_responses.code_of(record)
        body = index[response.body or GROUND]
        reference = index[response.relative_to or GROUND]
        component = dimension.components[response.component or "norm"]
        subject = 0
        if response.group is not None:
            subject = groups.index(response.group)
        if response.joint is not None:
            subject = named.index(response.joint)
            if not dimension.has_norm(type(case.joints[subject])):
                component = dimension.components["x"]
        codes.append([code, body, reference, component, record.order, subject])
        rows.append(dimension.response_row(response, frames))
    par = np.array(rows, dtype=np.float64).reshape(-1, dimension.response_par)
    return np.array(codes, dtype=np.int64).reshape(-1, 6), par, np.array(data, dtype=np.float64)


def _damped(case: Case, responses: tuple[Response, ...], reductions: tuple[ReductionKind, ...]) -> bool:
    """Whether anything depends on velocity: then the steps' stages need velocities that are right."""
    looks = any(
        reduction.is_integral and kind_of(each).depends_on_rate
        for response, reduction in zip(responses, reductions, strict=True)
        for each in response.parts
    )
    return has_damping(case) or adds_damping(case) or looks or bool(case.joints)


def _switches(case: Case) -> bool:
    """Whether a member may switch: a step that ends at a switch ends on the polynomial of the method of order 8."""
    return bool(case.contacts) or any(law_table.may_switch(law) for group in case.members for law in group.laws)


def _skipped(case: Case, load_case: LoadCase, dimension: Dimension, damped: bool) -> tuple[str, ...]:
    """What is left out of the computation because nothing needs it, and why, in words."""
    notes = []
    if not damped:
        notes.append("velocity terms: nothing depends on velocity")
    if not case.joints:
        notes.append("multipliers: there are no joints")
    notes += [
        f"equations of motion of {motion.body}: its motion is prescribed"
        for motion in load_case.motions
        if drives_all(motion, dimension)
    ]
    fixed = sum(len(group) for group in case.members if not group.design)
    if fixed:
        notes.append(f"design gradient of {fixed} members that are no design variables")
    return tuple(notes)
