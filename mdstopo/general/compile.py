"""A case and one of its load cases, compiled into the arrays of a general scene (`GeneralModel`), once."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mdstopo.case.errors import CaseError
from mdstopo.case.model import GROUND, Case, LoadCase, Response, ResponseRow
from mdstopo.case.responses import kind_of
from mdstopo.general import responses as responses_of
from mdstopo.general.contact_compile import contact_rows
from mdstopo.general.drives import drives, motion_times
from mdstopo.general.layout import arrange
from mdstopo.general.model import GeneralModel
from mdstopo.general.variables import adds_damping, each_member, lasting_times, varied
from mdstopo.integrators.choice import has_coarse_steps
from mdstopo.mechanics.contact import PX, PY
from mdstopo.mechanics.joints import table as joints
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.laws import table as laws
from mdstopo.scene.compile import home_of
from mdstopo.scene.loads import generalised_loads
from mdstopo.scene.model import EXCESS, HOME_COS, L0, QX, QY, VECTOR, FloatArray, IndexArray
from mdstopo.scene.origin import ends_of
from mdstopo.scene.other_kernels import include_kernels
from mdstopo.scene.signals import breakpoints, segment_values

COMPONENTS = {"x": 0, "y": 1, "norm": 2}


@dataclass(frozen=True)
class GeneralScene:
    """One load case, ready to be computed.

    load_case; model: the arrays; bodies: names in the order of the state, ground last; n_bodies: without it; damped:
    whether anything depends on velocity; skipped: what was left out, and why; redundant: joints with rows that others
    imply; responses, reductions: what is looked at and how, objectives first, in the case's order; contacts: each in
    words; kinematics: how bodies move.
    """

    load_case: LoadCase
    model: GeneralModel
    bodies: tuple[str, ...]
    n_bodies: int
    damped: bool
    skipped: tuple[str, ...]
    redundant: tuple[str, ...]
    responses: tuple[Response, ...]
    reductions: tuple[str, ...]
    contacts: tuple[str, ...] = ()
    kinematics: Kinematics = PLANAR

    @cached_property
    def n(self) -> int:
        """Freedoms of the bodies."""
        return self.kinematics.freedoms * self.n_bodies

    @property
    def degrees_of_freedom(self) -> int:
        """Coordinates that are free, less the independent rows of joints."""
        return int(self.model.free.sum()) - int(self.model.size[0])


def looked_at(case: Case, load_case: str) -> tuple[tuple[Response, ...], tuple[str, ...]]:
    """Responses and reductions of a load case: its objectives, then its constraints, each in the case's order."""
    found = [(o.response, o.over_time) for o in case.objectives if o.load_case == load_case]
    rows = [row for row in case.constraints if isinstance(row, ResponseRow) and row.load_case == load_case]
    found += [(row.response, row.over_time) for row in rows]
    return tuple(r for r, _ in found), tuple(o for _, o in found)


def compile_general(case: Case, load_case: LoadCase) -> GeneralScene:
    """The arrays of one load case."""
    include_kernels(case)
    names = (*(body.name for body in case.bodies), GROUND)
    index = {name: i for i, name in enumerate(names)}
    each = PLANAR.freedoms
    n = each * len(names)
    mass, v0 = np.ones(n), np.zeros(n)
    home = home_of(load_case, len(names))
    for i, body in enumerate(load_case.bodies):
        own = slice(each * i, each * (i + 1))
        mass[own] = body.mass, body.mass, body.inertia
        v0[own] = *body.velocity, body.angular_velocity

    fine = has_coarse_steps(case.solver)
    more = lasting_times(case, fine) + motion_times(load_case)
    times = breakpoints(load_case, more)
    driven, drive = drives(load_case, times, home[:, : PLANAR.coordinates].ravel(), v0)
    _refuse_impacts(case, load_case, driven, drive, times)
    free = np.ones(n, dtype=np.int64)
    free[-each:] = 0
    free[driven] = 0

    pairs: dict[tuple[int, int], int] = {}
    members = _members(case, home if _stands_otherwise(case, load_case) else None, index, pairs, times)
    bushing_pair, bushing = _bushings(case, index, pairs, home)
    joint, joint_par = _joints(case, index, pairs, home)
    contact_pair, contact, contact_words = contact_rows(case, index, pairs)
    held = {body for pair in pairs for body in pair}
    for i in range(len(names) - 1):
        if i not in held:
            pairs.setdefault((len(names) - 1, i), len(pairs))
    pair = np.array(list(pairs), dtype=np.int64).reshape(-1, 2)
    reach = _reach(case, index, pairs, members)
    for p, row in zip(contact_pair.tolist(), contact, strict=True):
        reach[p] = max(reach[p], float(np.hypot(row[PX], row[PY])))
    loads = generalised_loads(load_case, index, times)
    responses, reductions = looked_at(case, load_case.name)
    response, response_par = _responses(case, responses, index)
    layout = arrange(case, joint, joint_par, free, mass, home, pair, PLANAR)
    _refuse_redundant(case, load_case, layout.redundant)
    damped = _damped(case, responses, reductions)
    model = GeneralModel(
        free=free, mass=mass, q0=np.zeros(PLANAR.coordinates * len(names)), v0=v0, home=home, pair=pair, reach=reach,
        **members, times=times, **loads._asdict(), bushing_pair=bushing_pair, bushing=bushing, driven=driven,
        drive=drive, joint=joint,
        joint_par=joint_par, row=layout.row, place=layout.place,
        size=np.array(
            [*layout.size, int(damped), len(layout.steady), PLANAR.rotations, PLANAR.attitude], dtype=np.int64
        ), line=layout.line,
        envelope=layout.envelope, product=layout.product, steady=layout.steady,
        response=response, response_par=response_par, contact_pair=contact_pair, contact=contact,
        varied=varied(case, members["block"]),
    )  # fmt: skip
    return GeneralScene(
        load_case, model, names, len(names) - 1, damped, _skipped(case, load_case, damped), layout.redundant, responses,
        reductions, contact_words,
    )  # fmt: skip


def _refuse_impacts(case: Case, load_case: LoadCase, driven: IndexArray, drive: FloatArray, times: FloatArray) -> None:
    """A driven velocity that jumps would need an infinite force in a joint (CaseError)."""
    names = [body.name for body in case.bodies]
    jointed = {name for joint in case.joints for name in joint.bodies}
    h = np.diff(times)[:-1, None]
    before = drive[:-1, :, 1] + h * (2.0 * drive[:-1, :, 2] + 3.0 * h * drive[:-1, :, 3])
    jump = np.abs(drive[1:, :, 1] - before)
    size = np.abs(drive[:, :, 1]).max(axis=0, initial=0.0) + 1e-300
    mistakes = []
    for i, d in enumerate(driven.tolist()):
        name = names[d // PLANAR.freedoms]
        if name in jointed and len(jump) and jump[:, i].max() > 1e-9 * size[i]:
            when = times[1 + int(jump[:, i].argmax())]
            places = [f"load_cases.{load_case.name}.motions", "motions"]
            path = next((path for path in places if path in case.marks), "motions")
            message = f"the prescribed velocity of {name} jumps at t = {when:g} s, but it is jointed: that is an impact"
            mistakes.append(case.marks.mistake(path, message))
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))


def _refuse_redundant(case: Case, load_case: LoadCase, redundant: tuple[str, ...]) -> None:
    """A joint that others imply has no force of its own to look at (CaseError)."""
    mistakes = []
    rows: list[tuple[str, Any]] = [(f"objectives.{o.name}", o) for o in case.objectives]
    rows += [(f"constraints[{i}]", row) for i, row in enumerate(case.constraints) if isinstance(row, ResponseRow)]
    for path, looked in rows:
        name = looked.response.joint
        if looked.load_case == load_case.name and name in redundant:
            mistakes.append(
                case.marks.mistake(
                    f"{path}.response",
                    f"joint {name} has rows that others imply at the start; what it transmits is not determined",
                )
            )
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))


def _stands_otherwise(case: Case, load_case: LoadCase) -> bool:
    """Whether a load case has its bodies elsewhere at the start than where the members' lengths were measured."""
    places = ([(*body.position, body.angle) for body in bodies] for bodies in (case.bodies, load_case.bodies))
    return next(places) != next(places)


def _lengths_at(home: FloatArray, one: int, two: int, p_local: FloatArray, q_local: FloatArray) -> FloatArray:
    """Lengths (M,) of members between points (M, 2) of two bodies at home."""
    ends = []
    for body, points in ((one, p_local), (two, q_local)):
        x, y, _, c, s = home[body]
        ends.append(np.array([x, y]) + points @ np.array([[c, s], [-s, c]]))
    between = ends[1] - ends[0]
    return np.asarray(np.hypot(between[:, 0], between[:, 1]))


def _members(
    case: Case,
    home: FloatArray | None,
    index: dict[str, int],
    pairs: dict[tuple[int, int], int],
    times: FloatArray,
) -> dict[str, Any]:
    """Blocks of one law each: a group with a list of laws has as many, which share its design variables.

    A law of which each member has a parameter of its own has a block for each member. home: where bodies stand if not
    where the lengths of members were measured.
    """
    blocks, powers, rows, active, level, columns = [], [], [], [], [], []
    curves: list[float] = []
    first = start = 0
    segments = len(times) - 1
    for number, group in enumerate(case.members):
        first_body, second_body, p_local, q_local = ends_of(group)
        pair = pairs.setdefault((index[first_body], index[second_body]), len(pairs))
        length = group.length
        if home is not None:
            length = _lengths_at(home, index[first_body], index[second_body], p_local, q_local)
        for place, record in enumerate(group.laws):
            rest = getattr(record, "free_length", None)
            kernels, code = laws.kernels_of(type(record)), laws.code_of(type(record))
            begin = -np.inf if record.active_from is None else record.active_from
            until = np.inf if record.active_until is None else record.active_until
            middle = 0.5 * (times[:-1] + times[1:])
            known = np.zeros((segments, 2)) if kernels.signal is None else segment_values(kernels.signal(record), times)
            parts = np.arange(len(group))[:, None] if each_member(case, group, place) else np.arange(len(group))[None]
            for part in parts:
                count = len(part)
                padded = -(-count // VECTOR) * VECTOR
                member = np.zeros((6, padded))
                member[0:2, :count], member[2:4, :count] = p_local[part].T, q_local[part].T
                member[L0, :count] = group.length[part] if rest is None else rest
                member[EXCESS, :count] = (length[part] - member[L0, :count]) * (length[part] + member[L0, :count])
                variable = first + int(part[0]) if group.design else -1
                blocks.append([pair, start, start + padded, code, variable, count, number, int(part[0])])
                rows.append(laws.parameters(record, curves))
                powers.append(group.power)
                columns.append(member)
                active.append((middle > begin) & (middle < until))
                level.append(known)
                start += padded
        first += len(group) if group.design else 0
    return {
        "block": np.array(blocks, dtype=np.int64).reshape(-1, 8),
        "law": np.array(rows, dtype=np.float64).reshape(-1, laws.PARAMETERS),
        "active": np.array(active, dtype=np.int64).reshape(-1, segments).T.copy(),
        "level": np.array(level, dtype=np.float64).reshape(-1, segments, 2).transpose(1, 0, 2).copy(),
        "power": np.array(powers, dtype=np.float64),
        "member": np.concatenate(columns, axis=1) if columns else np.zeros((6, 0)),
        "curves": np.array(curves, dtype=np.float64),
    }


def _bushings(
    case: Case, index: dict[str, int], pairs: dict[tuple[int, int], int], home: FloatArray
) -> tuple[IndexArray, FloatArray]:
    """The pair (n_bushing,) and the parameters (n_bushing, 12) of each bushing (`GeneralModel.bushing`)."""
    where, rows = [], []
    for bushing in case.bushings:
        a, b = (index[name] for name in bushing.bodies)
        where.append(pairs.setdefault((a, b), len(pairs)))
        apart = joints.apart_at_home(home, a, b, bushing.at_first, bushing.at_second)
        c, s = home[a, HOME_COS:]
        x, y = c * apart[0] + s * apart[1], c * apart[1] - s * apart[0]
        rows.append([*bushing.at_first, *bushing.at_second, x, y, *bushing.stiffness, *bushing.damping])
    return np.array(where, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(-1, 12)


def _joints(
    case: Case, index: dict[str, int], pairs: dict[tuple[int, int], int], home: FloatArray
) -> tuple[IndexArray, FloatArray]:
    """Codes, bodies, pair and rows (n_joint, 5), and parameters (n_joint, 12), of each joint (`GeneralModel.joint`)."""
    codes, rows = [], []
    for joint in case.joints:
        a, b = (index[name] for name in joint.bodies)
        pair = pairs.setdefault((a, b), len(pairs))
        kind = type(joint)
        codes.append([joints.code_of(kind), a, b, pair, joints.kernels_of(kind).rows])
        rows.append(joints.parameters(joint, home, a, b))
    return (
        np.array(codes, dtype=np.int64).reshape(-1, 5),
        np.array(rows, dtype=np.float64).reshape(-1, joints.WIDTH),
    )


def _reach(
    case: Case,
    index: dict[str, int],
    pairs: dict[tuple[int, int], int],
    members: dict[str, Any],
) -> FloatArray:
    """(n_pair,): the largest distance of an attachment point from its centre of mass, m; 1 where it would be zero.

    Of members those on the second body of the pair count, of joints and bushings those on both.
    """
    reach = np.zeros(len(pairs))
    member = members["member"]
    for pair, start, stop, *_ in members["block"].tolist():
        reach[pair] = max(reach[pair], float(np.hypot(member[QX, start:stop], member[QY, start:stop]).max()))
    ties: tuple[Any, ...] = (*case.joints, *case.bushings)
    for tie in ties:
        a, b = (index[name] for name in tie.bodies)
        pair = pairs[a, b]
        reach[pair] = max(reach[pair], float(np.hypot(*tie.at_second)), float(np.hypot(*tie.at_first)))
    reach[reach == 0.0] = 1.0
    return reach


def _responses(case: Case, responses: tuple[Response, ...], index: dict[str, int]) -> tuple[IndexArray, FloatArray]:
    """The columns (n_resp, 6) and numbers (n_resp, 4) of each response (`GeneralModel.response`)."""
    codes, rows = [], []
    groups = [group.name for group in case.members]
    named = [joint.name for joint in case.joints]
    for response in responses:
        record = kind_of(response)
        code = responses_of.code_of(record)
        body = index[response.body or GROUND]
        reference = index[response.relative_to or GROUND]
        component = COMPONENTS[response.component or "norm"]
        subject = 0
        if response.group is not None:
            subject = groups.index(response.group)
        if response.joint is not None:
            subject = named.index(response.joint)
            if joints.kernels_of(type(case.joints[subject])).force_rows < 2:  # along a line there is no norm
                component = COMPONENTS["x"]
        codes.append([code, body, reference, component, record.order, subject])
        row = [*(response.at_local or ()), *response.numbers]
        rows.append(row + [0.0] * (4 - len(row)))
    return np.array(codes, dtype=np.int64).reshape(-1, 6), np.array(rows, dtype=np.float64).reshape(-1, 4)


def _damped(case: Case, responses: tuple[Response, ...], reductions: tuple[str, ...]) -> bool:
    """Whether anything depends on velocity: then the steps' stages need velocities that are right."""
    forces = any(law.depends_on_rate for group in case.members for law in group.laws)
    bushed = any(any(bushing.damping) for bushing in case.bushings)
    looks = any(
        over_time in ("mean", "rms", "integral") and kind_of(response).depends_on_rate
        for response, over_time in zip(responses, reductions, strict=True)
    )
    return forces or adds_damping(case) or bushed or looks or bool(case.joints) or bool(case.contacts)


def _skipped(case: Case, load_case: LoadCase, damped: bool) -> tuple[str, ...]:
    """What is left out of the computation because nothing needs it, and why, in words."""
    notes = []
    if not damped:
        notes.append("velocity terms: nothing depends on velocity")
    if not case.joints:
        notes.append("multipliers: there are no joints")
    notes += [
        f"equations of motion of {motion.body}: its motion is prescribed"
        for motion in load_case.motions
        if None not in (motion.x, motion.y, motion.angle)
    ]
    fixed = sum(len(group) for group in case.members if not group.design)
    if fixed:
        notes.append(f"design gradient of {fixed} members that are no design variables")
    return tuple(notes)
