"""How many points and members memory holds, so that too many are refused before they are made."""

from __future__ import annotations

import os
from pathlib import Path

BYTES_PER_MEMBER = 200
"""What a member costs from reading to result: indices, length, cost, and the optimiser's vectors."""
BYTES_PER_POINT = 100
SHARE_OF_STEPS = 8
"""The steps of one simulation, all of which are kept, may take one part in this many of the memory."""
LEAST_GROWTH = 1.05
"""Room for steps that would grow by less than this stays as it is."""
_UNKNOWN = 8 * 2**30
_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def total_memory() -> int:
    """Bytes that this process may use at most: the machine's, or the container's where that is less."""
    try:
        total = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # not on Windows
        total = _UNKNOWN
    for name in _LIMITS:
        try:
            total = min(total, int(Path(name).read_text()))
        except (OSError, ValueError):
            continue
    return total


def most_floats() -> int:
    """How many numbers the history of the steps of one simulation may have."""
    return total_memory() // (8 * SHARE_OF_STEPS)


def room_factor(floats: int) -> float:
    """By how much the arrays for steps, of so many numbers, grow when they are full: at most twofold; 1 where memory
    ends."""
    factor = min(2.0, most_floats() / floats)
    return factor if factor >= LEAST_GROWTH else 1.0
