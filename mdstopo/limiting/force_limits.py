"""What the members of a case cannot do, as rows of the linear program.

For a body b, let E be the directions in which only members and known loads act on it: not those of prescribed
coordinates, nor across a slide. There E (m a - load) = E F, with F the sum of the members' forces, and

    strength    |E F| is at most what all members together can carry, if each has a law that is limited;
    pull, push  E F lies in the cone of the members' directions, if each can only pull (push). Directions are known as
                far as the limits let the body travel and turn;
    slack       E F = 0 until the first slack is used up. The body's motion until then is known.

Each is dropped where it is not certain, which leaves more forces and so a lower bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.arrays import Signal, TimeFormula
from mdstopo.case.laws.law import Ranges
from mdstopo.case.model import (
    Case,
    Law,
    MemberGroup,
    Table,
    VolumeRow,
)
from mdstopo.limiting.known import Cubics, Floats, with_second_derivative
from mdstopo.limiting.response import Bounded, Limits, arm_travel
from mdstopo.limiting.system import Row, System, turned

#: cells in which the motion without members is followed until the first slack is used up
_CELLS = 2000


@dataclass
class Restrictions:
    """Linear restrictions on the members' forces, and a sentence on each; more: times at which cells have to end."""

    rows: list[Bounded] = field(default_factory=list)
    counted: list[str] = field(default_factory=list)
    more: list[float] = field(default_factory=list)


def restrictions(system: System, limits: Limits) -> Restrictions:
    """What is certain of the members' forces on all bodies of a load case."""
    found = Restrictions()
    for name in system.names:
        directions = _directions(system, name)
        load = [system.load_on(name, axis) for axis in (0, 1)]
        if not len(directions) or load[0] is None or load[1] is None:
            continue
        groups = [group for group in system.case.members if len(group) and name in (group.body_from, group.body_to)]
        if not groups:
            continue
        acceleration = np.stack([each for each in load if each is not None], axis=1) / system.mass(name)
        known = with_second_derivative(system.times, -acceleration, np.zeros(2), np.zeros(2)).mapped(directions)
        force = Bounded(2, directions @ system.at(name), known, None)  # E F / m
        _limit_strength(system, name, groups, force, found)
        if not system.case.solver.settle:
            _limit_direction(system, name, groups, force, directions, limits, found)
            _wait_for_slack(system, name, groups, force, directions, found)
    return found


def _directions(system: System, name: str) -> Floats:
    """(r, 2) orthonormal: E."""
    held = [np.eye(2)[axis] for axis in system.driven_axes(name)]
    for joint in system.case.joints:
        if name not in joint.bodies:
            continue
        if joint.slide is None or joint.bodies[0] not in system.angles:
            return np.zeros((0, 2))
        axis = turned(joint.slide, system.angles[joint.bodies[0]])
        held.append(np.array([-axis[1], axis[0]]))
    if any(name in bushing.bodies for bushing in system.case.bushings) or any(
        name in (contact.body, contact.edge_body) for contact in system.case.contacts
    ):
        return np.zeros((0, 2))
    if not held:
        return np.eye(2)
    _, s, vt = np.linalg.svd(np.array(held))
    return np.asarray(vt[int((s > 1e-9).sum()) :])


# -- strength


def _limit_strength(system: System, name: str, groups: list[MemberGroup], force: Bounded, found: Restrictions) -> None:
    single = [_strength(system.case, group) for group in groups]
    if any(each is None for each in single):
        return
    total = _most(system.case, groups, [each for each in single if each is not None])
    found.rows.append(Bounded(2, force.matrix, force.known, total / system.mass(name), words=f"members of {name}"))
    found.counted.append(f"all members on {name} together carry at most {total:g} N")


def _strength(case: Case, group: MemberGroup) -> float | None:
    """The largest force of a whole member of a group, N; None where it has no limit."""
    total = 0.0
    for index, law in enumerate(group.laws):
        if _follows(case, group, index):
            return None
        most = law.strength(_ranges(case, group, index))
        if most is None:
            return None
        total += most
    return total


def _follows(case: Case, group: MemberGroup, index: int) -> bool:
    """Whether numbers of a law follow from design variables that are defined names: then nothing is certain of it."""
    laws = () if case.follows is None else case.follows.of_kind("law")
    return any((number.group, number.law) == (group.name, index) for number in laws)


def _ranges(case: Case, group: MemberGroup, index: int) -> Ranges:
    """Between what the numbers of a law are."""

    def between(parameter: str) -> tuple[float, float]:
        return _range(case, group, index, parameter, getattr(group.laws[index], parameter))

    return between


def _range(case: Case, group: MemberGroup, index: int, parameter: str, stated: float) -> tuple[float, float]:
    """The lowest and highest value of a law's parameter: its own, or the bounds of the variable in its place."""
    for each in case.variables:
        own = group.name in each.groups and each.laws[each.groups.index(group.name)] == index
        if own and each.parameter == parameter:
            return each.lower, each.upper
    return stated, stated


def _most(case: Case, groups: list[MemberGroup], single: list[float]) -> float:
    """The largest sum of alpha^mu f over the members of some groups, each volume row by itself considered, N."""
    rows = [
        row
        for row in case.constraints
        if isinstance(row, VolumeRow) and row.sense in ("limit", "equals") and not np.any(row.prices)
    ]
    return min(_spend(case, groups, single, row) for row in (None, *rows))


def _spend(case: Case, groups: list[MemberGroup], single: list[float], row: VolumeRow | None) -> float:
    """The continuous knapsack: at mu >= 1, alpha^mu is at most upper^(mu - 1) alpha."""
    slices = case.group_slices
    fixed, worth, price, room = 0.0, [], [], []
    budget = math.inf if row is None else row.bound - float(row.coefficients @ case.lower)
    for group, force in zip(groups, single, strict=True):
        if not group.design:
            fixed += force * len(group)
            continue
        if row is None or group.power < 1.0:
            fixed += force * group.upper**group.power * len(group)
            continue
        steepness = force * group.upper ** (group.power - 1.0)
        fixed += steepness * group.lower * len(group)
        worth.append(np.full(len(group), steepness))
        price.append(row.coefficients[slices[group.name]])
        room.append(np.full(len(group), group.upper - group.lower))
    if row is None or not worth:
        return fixed
    w, p, r = np.concatenate(worth), np.concatenate(price), np.concatenate(room)
    free = p <= 0.0
    total = fixed + float(w[free] @ r[free])
    w, p, r = w[~free], p[~free], r[~free]
    order = np.argsort(-w / p, kind="stable")
    spent = np.cumsum(p[order] * r[order])
    # what is left of the budget when it is each one's turn
    share = np.clip((budget - (spent - p[order] * r[order])) / np.maximum(p[order] * r[order], 1e-300), 0.0, 1.0)
    return total + float((w[order] * r[order]) @ share)


# -- members that only pull, or only push


def _limit_direction(
    system: System,
    name: str,
    groups: list[MemberGroup],
    force: Bounded,
    directions: Floats,
    limits: Limits,
    found: Restrictions,
) -> None:
    """Add the row that members which only pull, or only push, exert forces within a cone; where that is certain.

    system: the bodies as the linear program sees them.
    name: the body's.
    groups: of members that are tied to it.
    force: E F over the body's mass, of the members' forces F (m/s²).
    directions (r, 2): E, in which only members and known loads act on the body.
    limits: how far bodies travel (m) and turn (rad).
    found: takes the row and a sentence.
    """
    middles, halves = [], []
    for group in groups:
        sign = _side(system.case, group)
        other = group.body_to if group.body_from == name else group.body_from
        if sign == 0 or other not in system.angles:
            return
        own = group.p_local if group.body_from == name else group.q_local
        away = (group.q_world - group.p_world) * (1.0 if group.body_from == name else -1.0)
        arm = np.zeros(len(group)) if name in system.angles else np.hypot(*own.T)
        turn = arm * arm_travel(1.0, limits.turns.get(name, math.pi))
        moved = travel(system, limits, name, other) + turn
        length = np.hypot(*away.T)
        if not np.all(moved < length):
            return
        middles.append(np.arctan2(sign * away[:, 1], sign * away[:, 0]))
        halves.append(np.arcsin(moved / length))
    cone = cone_of(np.concatenate(middles), np.concatenate(halves), directions)
    if cone is None:
        return
    # n . F >= 0 for both normals
    rows = -cone @ force.matrix
    known = force.known.mapped(-cone)
    found.rows.append(Bounded(2, rows, known, 0.0, by_component=True, words=f"members of {name}"))
    found.counted.append(f"members on {name} only pull, or only push, in directions known within its travel")


def cone_of(middles: Floats, halves: Floats, directions: Floats) -> Floats | None:
    """(c, r) rows n with n . (E F) >= 0 for all sums F of vectors whose angles are within middles +- halves.

    directions (r, 2): E. None where the sums are not within a half-plane.
    """
    if len(directions) == 1:
        line = math.atan2(directions[0, 1], directions[0, 0])
        off = np.abs((middles - line + math.pi) % (2.0 * math.pi) - math.pi)
        if np.all(off + halves <= 0.5 * math.pi):
            return np.array([[1.0]])
        if np.all(off - halves >= 0.5 * math.pi):
            return np.array([[-1.0]])
        return None
    # a gap between the arcs has to be wider than a half turn; once round, so that arcs over the full turn are seen
    first = (middles - halves) % (2.0 * math.pi)
    order = np.argsort(first, kind="stable")
    starts = np.concatenate([first[order], first[order] + 2.0 * math.pi])
    reach = np.maximum.accumulate(starts + 2.0 * np.tile(halves[order], 2))
    gaps = starts[len(first) :] - reach[len(first) - 1 : -1]
    widest = int(np.argmax(gaps))
    if gaps[widest] <= math.pi:
        return None
    low, high = starts[len(first) + widest], reach[len(first) - 1 + widest]
    normals = np.array([[-math.sin(low), math.cos(low)], [math.sin(high), -math.cos(high)]])
    return np.asarray(normals @ directions.T)


def _side(case: Case, group: MemberGroup) -> int:
    """+1 where members of a group only pull, -1 where they only push, 0 where neither is certain."""
    if any(_follows(case, group, index) for index in range(len(group.laws))):
        return 0
    sides = {law.side_of_force(_ranges(case, group, index)) for index, law in enumerate(group.laws)}
    return sides.pop() if len(sides) == 1 else 0


def travel(system: System, limits: Limits, name: str, other: str) -> float:
    """The largest displacement of a body's centre of mass against another's that the limits allow, m; may be infinite.

    From the rows of displacement between the two that hold at all times, and from slides between them.
    """
    between = system.at(name) - system.at(other)
    strips: list[tuple[Floats, float, float]] = []  # normal, the least and the largest of what it sees
    radius = math.inf
    for row in limits.rows:
        if row.order > 0 or row.final or row.radius is None:
            continue
        seen, rest = np.linalg.lstsq(between.T, row.matrix.T, rcond=None)[0].T, 0.0
        rest = float(np.abs(seen @ between - row.matrix).max())
        centre = float(np.abs(row.matrix @ system.start + row.known.coefficients[0, :, 0]).max())
        if rest > 1e-12 or centre > 1e-9 * (1.0 + float(np.abs(system.start).max())):
            continue
        if len(seen) == 2:
            radius = min(radius, row.radius)
        else:
            strips.append((seen[0], -math.inf if row.by_component else -row.radius, row.radius))
    for joint in system.case.joints:
        if joint.slide is not None and set(joint.bodies) == {name, other} and joint.bodies[0] in system.angles:
            axis = turned(joint.slide, system.angles[joint.bodies[0]])
            strips.append((np.array([-axis[1], axis[0]]), 0.0, 0.0))
    return min(radius, _box(strips))


def _box(strips: list[tuple[Floats, float, float]]) -> float:
    """The largest norm within strips low <= n . y <= high that have two different normals; infinite otherwise."""
    merged: list[tuple[Floats, float, float]] = []
    for normal, low, high in strips:
        for i, (other, low_2, high_2) in enumerate(merged):
            sign = float(normal @ other)
            if abs(abs(sign) - 1.0) < 1e-12:
                a, b = (low, high) if sign > 0.0 else (-high, -low)
                merged[i] = other, max(low_2, a), min(high_2, b)
                break
        else:
            merged.append((normal, low, high))
    best = math.inf
    for i, (first, low, high) in enumerate(merged):
        for second, low_2, high_2 in merged[:i]:
            if not all(map(math.isfinite, (low, high, low_2, high_2))):
                continue
            corners = np.array([[a, b] for a in (low, high) for b in (low_2, high_2)])
            best = min(best, float(np.hypot(*np.linalg.solve(np.array([first, second]), corners.T)).max()))
    return best


# -- slack


def _wait_for_slack(
    system: System, name: str, groups: list[MemberGroup], force: Bounded, directions: Floats, found: Restrictions
) -> None:
    """Add the row that no member acts on a body before the first slack is used up, where all its members have slack.

    system: the bodies as the linear program sees them.
    name: the body's.
    groups: of members that are tied to it.
    force: E F over the body's mass, of the members' forces F (m/s²).
    directions (r, 2): E, in which only members and known loads act on the body.
    found: takes the row, a sentence, and the time when it ends (s).
    """
    others = {group.body_to if group.body_from == name else group.body_from for group in groups}
    slacks = []
    for group in groups:
        least = _slack(system.case, group, system.load_case.start)
        if least <= 0.0:
            return
        own = group.p_local if group.body_from == name else group.q_local
        arm = 0.0 if name in system.angles else float(np.hypot(*own.T).max())
        other = group.body_to if group.body_from == name else group.body_from
        slacks.append((other, least, arm, _begins(system.case, group, system.load_case.start)))
    if not all(other in system.angles for other in others):
        return
    until = _first_action(system, name, slacks, force, directions)
    if until <= system.load_case.start:
        return
    found.rows.append(Bounded(2, force.matrix, force.known, 0.0, until=until, words=f"slack of {name}"))
    found.counted.append(f"no member acts on {name} before {until:.6g} s, when its slack is used up")
    found.more.append(until)


def _slack(case: Case, group: MemberGroup, start: float) -> float:
    """By how much a member of the group has at least to change its length before any of its laws acts, m.

    Infinite where all of them begin to act later than the start; what acts at once has none.
    """
    least = math.inf
    for index, law in enumerate(group.laws):
        if _follows(case, group, index):
            return 0.0
        if _from(case, group, index, law) > start:
            continue
        slack = law.slack(_ranges(case, group, index), group.length)
        if slack is None:
            return 0.0
        least = min(least, float(slack.min()))
    return least


def _begins(case: Case, group: MemberGroup, start: float) -> float:
    """When the first of the laws that begin after the start begins to act, s; infinite where none does."""
    times = [_from(case, group, index, law) for index, law in enumerate(group.laws)]
    return min((t for t in times if t > start), default=math.inf)


def _from(case: Case, group: MemberGroup, index: int, law: Law) -> float:
    return -math.inf if law.active_from is None else _range(case, group, index, "active_from", law.active_from)[0]


def _first_action(
    system: System,
    name: str,
    slacks: list[tuple[str, float, float, float]],
    force: Bounded,
    directions: Floats,
) -> float:
    """A time before which no member acts on the body: it moves as loads and what holds it alone move it.

    Between samples a function is nearer to the chord than an eighth of the squared cell times its second derivative.
    """
    load_case = system.load_case
    alone = System(
        system.case,
        load_case,
        tuple(system.times.tolist()),
        tuple(_as_loaded(system, name, direction, force, i) for i, direction in enumerate(directions)),
    )
    latest = min(load_case.end, *(begins for *_, begins in slacks))
    if any(np.abs((system.at(name) - system.at(other)) @ alone.free).max(initial=0.0) > 1e-9 for other, *_ in slacks):
        return load_case.start  # the motion is not known
    t = np.unique(np.concatenate([np.linspace(load_case.start, latest, _CELLS), system.times]))
    t = t[t <= latest]
    until = load_case.start
    for _ in range(3):
        if len(t) < 2:
            break
        without = _without_members(system, alone, name, slacks, t)
        stop = len(without) if without.all() else int(np.argmin(without))
        until = float(t[stop])
        if stop == len(without):
            break
        t = np.linspace(until, float(t[stop + 1]), 50)  # closer to when it is
    return until


def _without_members(
    system: System, alone: System, name: str, slacks: list[tuple[str, float, float, float]], t: Floats
) -> NDArray[np.bool_]:
    """(T - 1,) of each cell: whether no slack is used up within it."""
    turn = _turn(system, name, t)
    without = np.ones(len(t) - 1, dtype=np.bool_)
    for other, slack, arm, _ in slacks:
        between = system.at(name) - system.at(other)
        moved = alone.known.mapped(between)
        distance = np.hypot(*(moved.at(t) - between @ system.start).T)
        ends = moved.at_ends(t[:-1], t[1:], 2)
        bend = np.maximum(np.hypot(*ends[0].T), np.hypot(*ends[1].T)) * np.diff(t) ** 2 / 8.0
        turns = 2.0 * arm * np.sin(0.5 * np.minimum(turn[1:], math.pi))
        without &= np.maximum(distance[:-1], distance[1:]) + bend + turns < slack * (1.0 - 1e-9)
    return without


def _as_loaded(system: System, name: str, direction: Floats, force: Bounded, i: int) -> Row:
    """The equation: along a direction the body moves as its loads move it."""
    vector = direction @ system.at(name)
    second = -2.0 * force.known.coefficients[:, i, 2], -6.0 * force.known.coefficients[:, i, 3]
    values = np.stack(second, axis=1)[:, None]
    start, rate = np.array([vector @ system.start]), np.array([vector @ system.rate])
    cubics: Cubics = with_second_derivative(system.times, values, start, rate)
    return Row(vector, cubics.coefficients[:, 0])


def _turn(system: System, name: str, t: Floats) -> Floats:
    """(T,) by how much at most the body has turned without members, rad."""
    body = next(each for each in system.load_case.bodies if each.name == name)
    motion = next((each for each in system.load_case.motions if each.body == name), None)
    if motion is not None and motion.angle is not None:
        return np.full(len(t), 0.0 if name in system.angles else math.pi)
    moment = 0.0
    for load in system.load_case.loads:
        if load.body == name:
            arm = math.hypot(*load.at_local)
            moment += _size(load.moment) + arm * math.hypot(_size(load.force[0]), _size(load.force[1]))
    past = t - system.load_case.start
    return np.asarray(abs(body.angular_velocity) * past + 0.5 * moment / body.inertia * past**2)


def _size(signal: Signal) -> float:
    assert not isinstance(signal, TimeFormula), "of loads that are formulas of time no bound is known"
    return float(np.abs(signal.values).max()) if isinstance(signal, Table) else abs(signal)
