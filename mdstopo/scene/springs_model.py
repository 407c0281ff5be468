"""A scene as arrays: what one load case needs to be computed, and nothing else.

n_b bodies have n = 3 n_b coordinates q: what x, y and psi of each have changed by since the start. `ground` is the
last body, with infinite mass, where a member is tied to it; it is absent otherwise. Members live in blocks of one law
and one pair of bodies, structure of arrays; blocks are padded to a multiple of the vector width with members of no
stiffness, and so is each row of a block that joins every point of one grid with every point of another
(`scene.grid_members`). Loads are linear in time within a segment, and the integrators land on the ends of segments, so
a kernel never asks on which side of a kink it stands. All arrays are read-only; everything is a run-time value, so a
changed case compiles nothing anew.
"""

from typing import Annotated, NamedTuple

import numpy as np

from mdstopo.compiler.fields import Field
from mdstopo.compiler.fields import FloatArray as FloatArray
from mdstopo.compiler.fields import IndexArray as IndexArray

#: rows of `Model.member`
PX, PY, QX, QY, L0, EXCESS, STIFFNESS, DAMPING, PRELOAD = range(9)
MEMBER = 9
#: rows of the strengths: stiffness, damping, preload of each member times alpha^mu (N/m, N s/m, N)
SCALED_STIFFNESS, SCALED_DAMPING, SCALED_PRELOAD = range(3)
#: columns of `Model.home`: x, y, psi, and cos and sin of psi
HOME_X, HOME_Y, HOME_ANGLE, HOME_COS, HOME_SIN = range(5)
HOME = 5
#: columns of `Model.block`, and how many there are
PAIR, START, STOP, KIND, DESIGN, COUNT, WIDTH, LENGTH = range(8)
BLOCK = 8
#: columns of `Model.chunk`
CHUNK_BLOCK, CHUNK_START, CHUNK_STOP = range(3)
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


#: fields that both models have, `Model` and `general.model.general_model.GeneralModel`
StartCoordinates = Annotated[FloatArray, Field("n", "coordinates at the start: moved since home (m, rad)")]
StartVelocities = Annotated[FloatArray, Field("n", "velocities at the start (m/s, rad/s)")]
Home = Annotated[FloatArray, Field(f"n // 3, {HOME}", "x, y, psi of each body where its q is zero; cos, sin of psi")]
Reach = Annotated[
    FloatArray, Field("n_pair", "largest distance of an attachment point from its centre of mass; see `with_arms` (m)")
]
Power = Annotated[FloatArray, Field("n_block", "mu of Eq. 12")]
Force = Annotated[
    FloatArray, Field("n_seg, n, 2", "generalised load at the segment's start, its slope; with gravity (N, N m)")
]
LoadBody = Annotated[IndexArray, Field("n_load", "of loads whose effect depends on a body's rotation: the body")]
LoadFollows = Annotated[
    IndexArray,
    Field("n_load", "1 where the load turns with it, else 0; in space 2 where its moment is an angular acceleration"),
]
LoadArm = Annotated[FloatArray, Field("n_load, n_arm", "point of attack in the body's frame (m)")]
LoadForce = Annotated[
    FloatArray,
    Field("n_seg, n_load, n_push, 2", "components of the force, in space of the moment too: value and slope (N, N m)"),
]


class Springs(NamedTuple):
    """The few arrays of a `Model` that a pass over the members needs: handing over many takes time."""

    block: IndexArray
    member: FloatArray
    chunk: IndexArray
    threads: int
    near: FloatArray


class Model(NamedTuple):
    """What is constant during every evaluation of one load case."""

    inv_mass: Annotated[FloatArray, Field("n", "1/m, 1/m, 1/J of each body (1/kg, 1/(kg m²)); 0 for ground")]
    q0: StartCoordinates
    v0: StartVelocities
    home: Home
    pair: Annotated[IndexArray, Field("n_pair, 2", "the two bodies of each pair that members connect: P's, then Q's")]
    reach: Reach
    shortest: Annotated[
        FloatArray, Field("n_pair", "shortest initial length of a member (m), infinite without members")
    ]
    block: Annotated[
        IndexArray,
        Field(
            f"n_block, {BLOCK}",
            "pair, start, stop (padded), kind of law, first design variable or -1, members; of a grid: places in a "
            "row, members in a row (otherwise 0)",
        ),
    ]
    power: Power
    near: Annotated[
        FloatArray,
        Field(
            "n_block, 2",
            "squares of the shift (m²) and of the turn up to which elongations come from displacements "
            "(`mechanics.laws.spring.is_near`)",
        ),
    ]
    member: Annotated[
        FloatArray,
        Field(
            f"{MEMBER}, padded",
            "P, Q in body frames (m); free length l0 (m); L² - l0² of the length L at home (m²); stiffness (N/m), "
            "damping (N s/m), preload (N) at alpha = 1",
            on_a_line=True,
        ),
    ]
    times: Annotated[FloatArray, Field("n_seg + 1", "start, kinks of the loads, end (s)")]
    force: Force
    load_body: LoadBody
    load_follows: LoadFollows
    load_arm: LoadArm
    load_force: LoadForce
    chunk: Annotated[
        IndexArray,
        Field(
            "n_chunk, 3",
            "block, start, stop of the parts that passes take: whole blocks of few members (`packing.chunks_of`)",
        ),
    ] = NO_CHUNK
    threads: Annotated[
        int, Field("", "that share a pass, if it is worth it; 0 of few members, in whole blocks (`packing.pack`)")
    ] = 0
