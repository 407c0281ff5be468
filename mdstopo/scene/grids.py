"""Which members join every point of one grid with every point of another, and where they are in the arrays.

Such members lie in rows, one for each point of the first grid, and a row is padded to whole vectors. Then kernels need
not turn the points of the second grid once for each member, and sum most of what a tangent has by columns
(`mechanics.laws.spring_grid`).
"""

import numpy as np

from mdstopo.case.model import MemberGroup
from mdstopo.compiler.vector import WIDE
from mdstopo.scene.model import CHUNK, COUNT, LENGTH, START, WIDTH, IndexArray

#: places in a row at least: fewer vectors than two are not worth a row's own sums
NARROWEST = 2 * WIDE
#: places for each member at most: kernels for grids take some 0.7 of the others' time for a place (`active_members`
#: weighs members of grids and others by the same share), and padding costs memory and the passes that know no grids too
WASTE = 1.25
#: rows at least, whose sums a column shares
FEWEST = 4
#: a stride of so many numbers puts all rows into the same few lines of a cache
STRIDE = 128


def row_of(group: MemberGroup, elastic: bool) -> tuple[int, int]:
    """Places and members of a row; zeros where kernels for grids cannot be used, or would not pay."""
    p, q = group.from_index, group.to_index
    other = np.flatnonzero(p != p[0])
    length = int(other[0]) if len(other) else len(p)
    width = -(-length // WIDE) * WIDE
    if width % STRIDE == 0:
        width += WIDE
    rows = len(p) // length
    if not elastic or len(p) % length or rows < FEWEST or not NARROWEST <= width <= min(WASTE * length, CHUNK):
        return 0, 0
    p, q = p.reshape(rows, length), q.reshape(rows, length)
    whole = np.array_equal(p, np.broadcast_to(p[:, :1], p.shape)) and np.array_equal(q, np.broadcast_to(q[0], q.shape))
    return (width, length) if whole else (0, 0)


def places_of(block: list[int]) -> IndexArray:
    """(COUNT,) where the members of a row of `Model.block` are in the padded arrays."""
    count, width, length = block[COUNT], block[WIDTH], block[LENGTH]
    index = np.arange(count, dtype=np.int64)
    if width:
        index += index // length * (width - length)
    return index + block[START]
