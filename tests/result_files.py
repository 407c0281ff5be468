"""What tests of runs and fronts share: stopping them, and comparing the result files that they leave."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

#: the last parts of the names of datasets that differ between two runs of one case
WALL_TIMES = ("seconds", "created", "command")


def stop_after(iterations: int) -> Callable[[], bool]:
    """Stops after so many iterations: it is asked once before the first one, and after each."""
    asked = iter(range(10**6))
    return lambda: next(asked) > iterations


def datasets_of(path: Path | str) -> dict[str, Any]:
    """Every dataset of a result file but wall times, by its path."""
    found: dict[str, Any] = {}

    def visit(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and name.rpartition("/")[2] not in WALL_TIMES:
            found[name] = node[()]

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return found


def assert_same_files(one: Path | str, other: Path | str) -> None:
    """Every dataset, root attribute and setting equal to the bit, wall times aside."""
    with h5py.File(one, "r") as a, h5py.File(other, "r") as b:
        assert dict(a.attrs) == dict(b.attrs)
        assert dict(a["settings"].attrs) == dict(b["settings"].attrs)
    first, second = datasets_of(one), datasets_of(other)
    assert first.keys() == second.keys()
    for name, x in first.items():
        y = second[name]
        assert np.asarray(x).shape == np.asarray(y).shape, name
        same = x == y if isinstance(x, bytes) else np.asarray(x).tobytes() == np.asarray(y).tobytes()
        assert same, name
