"""A case and one of its load cases, compiled into the arrays that the kernels need (`Model`), once.

What a scene lacks is absent from the arrays: no ground without a member tied to it, no damping columns read where
nothing is damped, loads through the centre of mass folded into one table of generalised forces.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mdstopo.case.model import GROUND, Case, LoadCase, MemberGroup, SpringLaw
from mdstopo.scene.grid_members import row_of
from mdstopo.scene.loads import Loads, generalised_loads
from mdstopo.scene.origin import ends_of
from mdstopo.scene.signal_segments import breakpoints
from mdstopo.scene.springs_model import (
    BLOCK,
    DAMPING,
    EXCESS,
    HOME,
    HOME_ANGLE,
    HOME_COS,
    HOME_SIN,
    KIND,
    L0,
    MEMBER,
    QX,
    QY,
    START,
    STIFFNESS,
    STOP,
    VECTOR,
    WIDTH,
    FloatArray,
    IndexArray,
    Model,
)

ELASTIC, VISCOUS = 0, 1


@dataclass(frozen=True)
class Scene:
    """One load case, ready to be computed.

    model: the arrays; bodies: names in the order of the state (ground last, where it is there); n_bodies: those
    that move; damped: whether any force depends on velocity; skipped: what was left out, and why.
    """

    load_case: LoadCase
    model: Model
    bodies: tuple[str, ...]
    n_bodies: int
    damped: bool
    skipped: tuple[str, ...]
    #: there are no joints, so none with rows that others imply
    redundant: tuple[str, ...] = ()

    @cached_property
    def n(self) -> int:
        """The number of coordinates of all moving bodies."""
        return 3 * self.n_bodies

    @property
    def degrees_of_freedom(self) -> int:
        """The number of free coordinates; there are no joints."""
        return self.n

    @property
    def start(self) -> float:
        return self.load_case.start

    @property
    def end(self) -> float:
        return self.load_case.end


#: share of the longest member by which bodies may have moved for elongations to come from displacements
NEAR_HOME = 0.01


@dataclass(frozen=True)
class Members:
    """The arrays that all load cases have in common, as in `Model`: pairs (n, 2), blocks, powers, `near`, member
    arrays; and the shortest initial length of each block."""

    pairs: IndexArray
    block: IndexArray
    power: FloatArray
    near: FloatArray
    member: FloatArray
    shortest: FloatArray


def compile_members(case: Case, index: dict[str, int]) -> Members:
    """Blocks, pairs and member arrays. index: body name to its place in the state."""
    pairs: dict[tuple[int, int], int] = {}
    blocks, powers, first = [], [], 0
    start = 0
    for group in case.members:
        law = _spring(group)
        count = len(group)
        kind = VISCOUS if law.damping > 0.0 or law.preload != 0.0 else ELASTIC
        width, length = row_of(group, kind == ELASTIC)
        first_body, second_body, _, _ = ends_of(group, as_stated=width > 0)
        pair = pairs.setdefault((index[first_body], index[second_body]), len(pairs))
        places = count // length * width if length else count
        stop = start + -(-places // VECTOR) * VECTOR
        blocks.append([pair, start, stop, kind, first if group.design else -1, count, width, length])
        powers.append(group.power)
        first += count if group.design else 0
        start = stop
    member = np.zeros((MEMBER, start))
    for group, block in zip(case.members, blocks, strict=True):
        _fill(group, block, member)
    near = [
        near_of(group, member[[QX, QY], block[START] : block[STOP]].T, block[WIDTH] > 0)
        for group, block in zip(case.members, blocks, strict=True)
    ]
    return Members(
        pairs=np.array(list(pairs), dtype=np.int64).reshape(-1, 2),
        block=np.array(blocks, dtype=np.int64).reshape(-1, BLOCK),
        power=np.array(powers, dtype=np.float64),
        member=member,
        shortest=np.array([float(group.length.min()) for group in case.members]),
        near=np.array(near).reshape(-1, 2),
    )


def near_of(group: MemberGroup, second_ends: FloatArray, in_rows: bool) -> list[float]:
    """A row of `Model.near`: how far bodies may have moved for elongations to come from displacements.

    second_ends (M, 2): in the axes of their body (m). in_rows: whether members are summed by the rows of a grid.

    That is a share of the longest member: beyond it displacements are no more accurate than lengths.

    In grids, whose kernels do not ask which is shorter, no end has moved by more than half of the shortest member.
    """
    far = NEAR_HOME * float(group.length.max())
    if in_rows:
        far = min(far, 0.25 * float(group.length.min()))
    reach = float(np.hypot(*second_ends.T).max())
    return [far**2, min(far / max(reach, 1e-300), 1.0) ** 2]


def _fill(group: MemberGroup, block: list[int], member: FloatArray) -> None:
    """Write the members of a group into the padded arrays member (MEMBER, M_padded)."""
    law = _spring(group)
    _, start, stop, _, _, count, width, length = block
    shape = (count // length, length) if width else (1, count)
    rows = member[:, start : start + shape[0] * (width or count)].reshape(MEMBER, shape[0], -1)
    own = rows[:, :, : shape[1]]
    _, _, p_local, q_local = ends_of(group, as_stated=width > 0)
    own[0:2] = p_local.T.reshape(2, *shape)
    own[2:4] = q_local.T.reshape(2, *shape)
    own[L0] = (group.length if law.free_length is None else np.full(count, law.free_length)).reshape(shape)
    own[EXCESS] = (group.length.reshape(shape) - own[L0]) * (group.length.reshape(shape) + own[L0])
    own[STIFFNESS:MEMBER] = np.array([law.stiffness, law.damping, law.preload])[:, None, None]
    # what is between and behind them is the last one once more: no place has a length of its own
    rows[:STIFFNESS, :, shape[1] :] = own[:STIFFNESS, :, -1:]
    member[:STIFFNESS, start + rows[0].size : stop] = own[:STIFFNESS, -1, -1:]


def _spring(group: MemberGroup) -> SpringLaw:
    """The one law that the engine knows; anything else has been refused by name (`scene.refusals`)."""
    (law,) = group.laws
    if not isinstance(law, SpringLaw):
        raise TypeError(f"{group.name}: no kernel for the law {law.type!r}")
    return law


def state_order(case: Case) -> tuple[str, ...]:
    """Bodies as declared, and ground after them where a member is tied to it or a body has no member at all."""
    names = tuple(body.name for body in case.bodies)
    held = {name for group in case.members for name in (group.body_from, group.body_to)}
    return (*names, GROUND) if GROUND in held or set(names) - held else names


def home_of(load_case: LoadCase, count: int) -> FloatArray:
    """(count, HOME): where the bodies of a load case start, and ground behind them."""
    home = np.zeros((count, HOME))
    for row, body in zip(home, load_case.bodies, strict=False):
        row[:3] = *body.position, body.angle
    home[:, HOME_COS], home[:, HOME_SIN] = np.cos(home[:, HOME_ANGLE]), np.sin(home[:, HOME_ANGLE])
    return home


def compile_scene(case: Case, load_case: LoadCase, shared: Members) -> Scene:
    """The arrays of one load case; `shared` are those of `compile_members`."""
    names = state_order(case)
    index = {name: i for i, name in enumerate(names)}
    n_bodies = len(load_case.bodies)
    inv_mass = np.zeros(3 * len(names))
    v0, home = np.zeros_like(inv_mass), home_of(load_case, len(names))
    for i, body in enumerate(load_case.bodies):
        inv_mass[3 * i : 3 * i + 3] = 1.0 / body.mass, 1.0 / body.mass, 1.0 / body.inertia
        v0[3 * i : 3 * i + 3] = *body.velocity, body.angular_velocity

    pairs, reach, shortest = _watched_pairs(names, shared)
    times = breakpoints(load_case)
    loads = generalised_loads(load_case, index, times)
    block, member = shared.block, shared.member
    damped = bool(np.any(member[DAMPING] > 0.0))
    model = Model(
        inv_mass=inv_mass,
        q0=np.zeros_like(v0),
        v0=v0,
        home=home,
        pair=pairs,
        reach=reach,
        shortest=shortest,
        block=block,
        power=shared.power,
        near=shared.near,
        member=member,
        times=times,
        **loads._asdict(),
    )
    for array in model:
        if isinstance(array, np.ndarray):
            array.flags.writeable = False
    return Scene(load_case, model, names, n_bodies, damped, _skipped(case, names, damped, times, loads, block))


def _watched_pairs(names: tuple[str, ...], shared: Members) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Pairs that members connect, then each body without members against ground: errors are measured on pairs."""
    pairs = [tuple(pair) for pair in shared.pairs.tolist()]
    held = {body for pair in pairs for body in pair}
    ground = len(names) - 1
    pairs += [(ground, i) for i in range(len(names)) if i not in held and i != ground]
    reach, shortest = np.zeros(len(pairs)), np.full(len(pairs), np.inf)
    for (pair, start, stop, *_), length in zip(shared.block.tolist(), shared.shortest, strict=True):
        q = shared.member[2:4, start:stop]
        shortest[pair] = min(shortest[pair], length)
        reach[pair] = max(reach[pair], float(np.sqrt(np.max(np.einsum("ij,ij->j", q, q)))))
    longest = float(shortest[np.isfinite(shortest)].max(initial=0.0))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), with_arms(reach, longest), shortest


def with_arms(reach: FloatArray, size: float) -> FloatArray:
    """`Model.reach` (n_pair,) where pairs without an arm have that of the pair with the longest one, m.

    What measures turns has to grow with the scene: a length of its own would tie accuracy to the unit of length.

    reach (n_pair,): 0 where all attachment points are centres of mass.
    size: what they get where no pair has an arm; 1 m if it is 0, too.
    """
    longest = float(reach.max(initial=0.0))
    return np.where(reach > 0.0, reach, longest or size or 1.0)


def _skipped(
    case: Case,
    names: tuple[str, ...],
    damped: bool,
    times: FloatArray,
    loads: Loads,
    block: IndexArray,
) -> tuple[str, ...]:
    """What the arrays of a scene leave out, and why: a sentence each.

    case: the case.
    names: bodies in the order of the state.
    damped: whether any force depends on velocity.
    times (n_seg + 1,): ends of the segments of the loads (s).
    loads: of the load case.
    block (n_block, BLOCK): as of `Model`.
    """
    notes = []
    if not damped:
        notes.append("velocity terms: nothing is damped")
    if GROUND not in names:
        notes.append("ground: no member is tied to it")
    if len(times) == 2:
        notes.append("kinks in time: all loads are smooth")
    if not len(loads.load_body):
        notes.append("load stiffness: no load turns with a body or acts off its centre of mass")
    if not any(kind == VISCOUS for kind in block[:, KIND].tolist()):
        notes.append("damping and preload columns of the members")
    fixed = sum(len(group) for group in case.members if not group.design)
    if fixed:
        notes.append(f"design gradient of {fixed} members that are no design variables")
    return tuple(notes)
