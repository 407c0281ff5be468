"""A model as two flat arrays, because every array handed to a compiled function costs about a microsecond.

`pack` lays the arrays of a `Model` one after the other; `unpack`, compiled into every kernel that is called from
Python, gives the same `Model` back as views. The first integers are the sizes.
"""

import itertools
from typing import NamedTuple

import numpy as np

from mdstopo.compiler.fields import Fields, views_of
from mdstopo.compiler.jit import part
from mdstopo.compiler.threads import allowed
from mdstopo.scene.springs_model import CHUNK, MANY, ROWS, START, STOP, WIDTH, FloatArray, IndexArray, Model

#: the fields of a model, of which the first integers are the sizes
FIELDS = Fields(Model)


class Packed(NamedTuple):
    """A model as flat integers and flat floats."""

    ints: IndexArray
    floats: FloatArray


def pack(model: Model, threads: int | None = None) -> Packed:
    """Flatten a model. threads: that share a pass over very many members; default `threads.allowed`.

    The arrays are not flagged read-only, although nothing writes to them: the flag is part of an array's type, and
    every kernel would be compiled twice.
    """
    most = allowed() if threads is None else threads
    shared = most if many_members(model.block) else 0
    return Packed(*FIELDS.packed(model._replace(chunk=chunks_of(model.block), threads=shared)))


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
    return len(block) > 0 and bool(block[-1, STOP] > MANY)


@views_of(FIELDS, Model, part)
def unpack(ints, floats):
    """The `Model` whose arrays are views of the packed ones."""
