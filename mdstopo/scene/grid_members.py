"""Which members join every point of one grid with every point of another, and where they are in the arrays.

Such members lie in rows, one for each point of the first grid, and a row is padded to whole vectors. Then kernels need
not turn the points of the second grid once for each member, and sum most of what a tangent has by columns
(`mechanics.laws.spring_grid`).
"""

from math import lcm

import numpy as np

from mdstopo.case.model import MemberGroup
from mdstopo.compiler.vector import WIDE
from mdstopo.scene.springs_model import CHUNK, COUNT, LENGTH, START, WIDTH, IndexArray

#: places in a row at least: fewer vectors than two are not worth a row's own sums
NARROWEST = 2 * WIDE
#: places for each member at most: kernels for grids take some 0.7 of the others' time for a place (`active_members`
#: weighs members of grids and others by the same share), and padding costs memory and the passes that know no grids too
WASTE = 1.25
#: rows at least, whose sums a column shares
FEWEST_ROWS = 4
#: vectors of several rows at least that have their columns in common
TOGETHER = 2
#: a stride of so many numbers puts all rows into the same few lines of a cache
STRIDE = 128


def row_of(group: MemberGroup, elastic: bool) -> tuple[int, int]:
    """How many places and members a row of the grid of members has; zeros where kernels for grids cannot be used, or
    would not pay."""
    length = _members_of_a_row(group)
    width = -(-length // WIDE) * WIDE
    if width % STRIDE == 0:
        width += WIDE
    few = len(group) < FEWEST_ROWS * length
    if not elastic or few or not NARROWEST <= width <= min(WASTE * length, CHUNK):
        return 0, 0
    return (width, length) if _is_grid(group, length) else (0, 0)


def short_row_of(group: MemberGroup) -> int:
    """Members of a row where vectors with members of several rows have their columns in common; 0 where few would."""
    length = _members_of_a_row(group)
    together = TOGETHER * lcm(length, WIDE)
    return length if len(group) >= together and _is_grid(group, length) else 0


def _members_of_a_row(group: MemberGroup) -> int:
    """How many members behind each other begin where the first one does."""
    other = np.flatnonzero(group.from_index != group.from_index[0])
    return int(other[0]) if len(other) else len(group)


def _is_grid(group: MemberGroup, length: int) -> bool:
    """Whether members join every point of one grid with every point of another, in rows of so many."""
    if len(group) % length:
        return False
    p, q = group.from_index.reshape(-1, length), group.to_index.reshape(-1, length)
    return bool((p == p[:, :1]).all() and (q == q[0]).all())


def places_of(block: list[int]) -> IndexArray:
    """(COUNT,) where the members of a row of `Model.block` are in the padded arrays."""
    count, width, length = block[COUNT], block[WIDTH], block[LENGTH]
    index = np.arange(count, dtype=np.int64)
    if width:
        index += index // length * (width - length)
    return index + block[START]
