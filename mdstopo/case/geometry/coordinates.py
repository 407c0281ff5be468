"""Which coordinates can be computed with."""

from __future__ import annotations

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.text.reading import Reading

LARGEST_COORDINATE = 1e150
"""Lengths and coordinates above it overflow when they are squared."""


def in_range(values: FloatArray, path: str, reading: Reading) -> bool:
    """Whether all coordinates can be computed with; notes the mistake where not."""
    if values.size and not (np.abs(values) < LARGEST_COORDINATE).all():
        reading.mistake(path, f"a coordinate is not below {LARGEST_COORDINATE:g} m: too large to compute with")
        return False
    return True
