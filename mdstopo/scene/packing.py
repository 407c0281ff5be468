"""A model as two flat arrays, because every array handed to a compiled function costs about a microsecond.

`pack` lays the arrays of a `Model` one after the other; `unpack`, compiled into every kernel that is called from
Python, gives the same `Model` back as views. The first integers are the sizes.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np

from mdstopo.compiler.jit import part
from mdstopo.compiler.threads import allowed
from mdstopo.scene.model import (
    BLOCK,
    CHUNK,
    HOME,
    MANY,
    MEMBER,
    ROWS,
    START,
    STOP,
    WIDTH,
    FloatArray,
    IndexArray,
    Model,
)

#: numbers in a line of the cache
_LINE = 8
#: integers before the arrays
SIZES = 8


class Packed(NamedTuple):
    """ints: sizes, pair, block, load_body, load_follows, chunk; floats: the rest, in the order of `Model`."""

    ints: IndexArray
    floats: FloatArray


def pack(model: Model, threads: int | None = None) -> Packed:
    """Flatten a model. threads: that share a pass over very many members; default `threads.allowed`.

    The arrays are not flagged read-only, although nothing writes to them: the flag is part of an array's type, and
    every kernel would be compiled twice.
    """
    chunk = chunks_of(model.block)
    most = allowed() if threads is None else threads
    sizes = [
        len(model.inv_mass),
        len(model.pair),
        len(model.block),
        model.member.shape[1],
        len(model.times) - 1,
        len(model.load_body),
        len(chunk),
        most if many_members(model.block) else 0,
    ]
    ints = np.concatenate(
        [np.array(sizes, dtype=np.int64)]
        + [a.ravel() for a in (model.pair, model.block, model.load_body, model.load_follows, chunk)]
    ).astype(np.int64)
    before = [
        model.inv_mass,
        model.q0,
        model.v0,
        model.home.ravel(),
        model.reach,
        model.shortest,
        model.power,
        model.near.ravel(),
    ]
    gap = -sum(len(a) for a in before) % _LINE  # members begin on a line of the cache
    after = [model.member, model.times, model.force, model.load_arm, model.load_force]
    parts = [np.asarray(a, dtype=np.float64).ravel() for a in (*before, np.zeros(gap), *after)]
    floats = aligned((sum(len(part) for part in parts),))
    np.concatenate(parts, out=floats)
    return Packed(ints, floats)


def chunks_of(block: IndexArray) -> IndexArray:
    """(n_chunk, 3) block, start, stop of each chunk, in order: whole blocks where there are few members.

    Of grids chunks are whole rows, and several: what belongs to rows and columns is found once in each.
    """
    chunks = []
    many = many_members(block)
    for k, (start, stop, width) in enumerate(block[:, [START, STOP, WIDTH]].tolist()):
        most = CHUNK if width == 0 else max(CHUNK // width, ROWS) * width
        if not many:
            most = stop - start
        cuts = [*range(start, stop - max(width - 1, 0), most), stop]
        chunks += [(k, *ends) for ends in itertools.pairwise(cuts)]
    return np.array(chunks, dtype=np.int64).reshape(-1, 3)


def many_members(block: IndexArray) -> bool:
    """Whether blocks are cut into chunks, which threads may share."""
    return len(block) > 0 and bool(block[-1, 2] > MANY)


def aligned(shape: tuple[int, ...]) -> FloatArray:
    """An array of zeros that begins on a line of the cache: a wide vector across two costs twice."""
    count = math.prod(shape)
    room = np.zeros(count + _LINE)
    first = -room.ctypes.data // 8 % _LINE
    return room[first : first + count].reshape(shape)


@part
def unpack(ints, floats):
    """The `Model` whose arrays are views of the packed ones."""
    n = ints[0]
    n_pair = ints[1]
    n_block = ints[2]
    padded = ints[3]
    n_seg = ints[4]
    n_load = ints[5]
    n_chunk = ints[6]
    i = SIZES
    pair = ints[i : i + 2 * n_pair].reshape((n_pair, 2))
    i += 2 * n_pair
    block = ints[i : i + BLOCK * n_block].reshape((n_block, BLOCK))
    i += BLOCK * n_block
    load_body = ints[i : i + n_load]
    i += n_load
    load_follows = ints[i : i + n_load]
    i += n_load
    chunk = ints[i : i + 3 * n_chunk].reshape((n_chunk, 3))
    inv_mass = floats[0:n]
    q0 = floats[n : 2 * n]
    v0 = floats[2 * n : 3 * n]
    f = 3 * n
    home = floats[f : f + n // 3 * HOME].reshape((n // 3, HOME))
    f += n // 3 * HOME
    reach = floats[f : f + n_pair]
    f += n_pair
    shortest = floats[f : f + n_pair]
    f += n_pair
    power = floats[f : f + n_block]
    f += n_block
    near = floats[f : f + 2 * n_block].reshape((n_block, 2))
    f += 2 * n_block
    f += -f % _LINE
    member = floats[f : f + MEMBER * padded].reshape((MEMBER, padded))
    f += MEMBER * padded
    times = floats[f : f + n_seg + 1]
    f += n_seg + 1
    force = floats[f : f + 2 * n_seg * n].reshape((n_seg, n, 2))
    f += 2 * n_seg * n
    load_arm = floats[f : f + 2 * n_load].reshape((n_load, 2))
    f += 2 * n_load
    load_force = floats[f : f + 4 * n_seg * n_load].reshape((n_seg, n_load, 2, 2))
    return Model(
        inv_mass, q0, v0, home, pair, reach, shortest, block, power, near, member, times, force, load_body,
        load_follows, load_arm, load_force, chunk, ints[7],
    )  # fmt: skip
