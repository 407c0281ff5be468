"""Lengths in whole vectors."""

from mdstopo.compiler.jit import part
from mdstopo.compiler.vector import lanes


@part
def whole_vectors(count: int) -> int:
    """count rounded up to a multiple of `lanes()`."""
    return (count + lanes() - 1) // lanes() * lanes()
