"""A scene as arrays: what one load case needs to be computed, and nothing else.

n_b bodies have n = 3 n_b coordinates q: what x, y and psi of each have changed by since the start. `ground` is the
last body, with infinite mass, where a member is tied to it; it is absent otherwise. Members live in blocks of one law
and one pair of bodies, structure of arrays; blocks are padded to a multiple of the vector width with members of no
stiffness, and so is each row of a block that joins every point of one grid with every point of another (`scene.grids`).
Loads are linear in time within a segment, and the integrators land on the ends of segments, so a kernel never asks on
which side of a kink it stands. All arrays are read-only; everything is a run-time value, so a changed case compiles
nothing anew.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

#: rows of `Model.member`
PX, PY, QX, QY, L0, EXCESS, STIFFNESS, DAMPING, PRELOAD = range(9)
MEMBER = 9
#: columns of `Model.home`: x, y, psi, and cos and sin of psi
HOME_X, HOME_Y, HOME_ANGLE, HOME_COS, HOME_SIN = range(5)
HOME = 5
#: columns of `Model.block`, and how many there are
PAIR, START, STOP, KIND, DESIGN, COUNT, WIDTH, LENGTH = range(8)
BLOCK = 8
#: blocks are padded to a multiple of this
VECTOR = 16
#: members of one tile, few enough that all rows stay in the first-level cache while several poses pass over them
TILE = 512
#: members of one chunk, and how many there must be in all before they are summed in chunks
CHUNK = 8 * TILE
MANY = 4 * CHUNK
#: rows of a grid that a tile has, where there are so many
ROWS = 16
#: of a model that is not `packed`
NO_CHUNK = np.zeros((0, 3), dtype=np.int64)


class Springs(NamedTuple):
    """What a pass over the members needs of a `Model`: few arrays, because handing over many takes its time."""

    block: IndexArray
    member: FloatArray
    chunk: IndexArray
    threads: int
    near: FloatArray


class Model(NamedTuple):
    """What is constant during every evaluation of one load case.

    ============  ================  =====================================================================
    inv_mass      (n,)              1/m, 1/m, 1/J of each body; 0 for ground
    q0, v0        (n,)              state at the start: what bodies have moved since home, which is nothing; velocities
    home          (n / 3, 5)        x, y, psi of each body where its q is zero, cos and sin of that psi
    pair          (n_pair, 2)       the two bodies of each pair that members connect: P's, then Q's
    reach         (n_pair,)         largest distance of an attachment point from its centre of mass, m
    shortest      (n_pair,)         shortest initial length of a member, m (inf without members)
    block         (n_block, 8)      pair, start, stop (padded), kind of law, first design variable or -1, count;
                                    of a grid: places in a row, members in a row (otherwise 0)
    power         (n_block,)        mu of Eq. 12
    near          (n_block, 2)      squares of the shift (m^2) and of the turn up to which elongations come from
                                    displacements (`mechanics.laws.spring.hardly_moved`)
    member        (9, M_padded)     P, Q in body frames; free length l0; L^2 - l0^2 of the length L at home; stiffness,
                                    damping, preload at alpha = 1
    times         (n_seg + 1,)      start, kinks of the loads, end
    force         (n_seg, n, 2)     generalised load at the segment's start, slope in time; with gravity
    load_body     (n_load,)         loads whose effect depends on the body's rotation: which body,
    load_follows  (n_load,)         1 where the force turns with it, 0 where it keeps its global direction,
    load_arm      (n_load, 2)       point of attack in body coordinates,
    load_force    (n_seg, n_load, 2, 2)   and components, value and slope
    chunk         (n_chunk, 3)      block, start, stop of the parts that passes take: whole blocks of few members
    threads                         that share a pass, if it is worth it; 0 of few members, in whole blocks. Chunk and
                                    threads come from `packing`
    ============  ================  =====================================================================
    """

    inv_mass: FloatArray
    q0: FloatArray
    v0: FloatArray
    home: FloatArray
    pair: IndexArray
    reach: FloatArray
    shortest: FloatArray
    block: IndexArray
    power: FloatArray
    near: FloatArray
    member: FloatArray
    times: FloatArray
    force: FloatArray
    load_body: IndexArray
    load_follows: IndexArray
    load_arm: FloatArray
    load_force: FloatArray
    chunk: IndexArray = NO_CHUNK
    threads: int = 0
