"""Places in arrays, of which compiled code is to know that they are not counted from the end."""

import numpy as np

from mdstopo.compiler.jit import part


@part
def index(i: int) -> np.uint64:
    """A place that is not negative: else every access has code for counting from the end, and loops over places read
    and write number by number in the place of vectors."""
    return np.uint64(i)
