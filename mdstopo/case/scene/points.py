"""Point grids at the start: their points in the coordinates of their bodies and in global ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.memory import BYTES_PER_POINT, total_memory
from mdstopo.case.model import PointGrid
from mdstopo.case.objects.frames import Frames
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import count_text, inside


def build_points(sections: Any, frames: Frames, reading: Reading) -> dict[str, PointGrid]:
    """The grids of points by name, without those that cannot be made; mistakes are noted."""
    grids: dict[str, PointGrid] = {}
    for name, fields in (sections or {}).items():
        grid = None if fields is BAD else _build_grid(name, fields, frames, reading)
        if grid is not None:
            grids[name] = grid
    return grids


def _build_grid(name: str, fields: Fields, frames: Frames, reading: Reading) -> PointGrid | None:
    parts = fields["grid"] if isinstance(fields["grid"], list) else [fields["grid"]]
    if fields["body"] not in frames.bodies or not fields.good("frame"):
        return None
    kinds = []
    for part in parts:
        if part is BAD:
            return None
        stated = [kind for kind in part.stated if part[kind] is not BAD]
        if len(stated) != 1 or (isinstance(part[stated[0]], Fields) and not part[stated[0]].good()):
            return None
        kinds.append((stated[0], part[stated[0]]))
    geometry = frames.geometry
    checked = [geometry.check_grid(kind, grid, reading) for kind, grid in kinds]  # all, so that all is told
    if not all(checked):
        return None
    path = inside(fields.path, "grid")
    count = sum(geometry.grid_count(kind, grid) for kind, grid in kinds)
    most = total_memory() // BYTES_PER_POINT
    if count > most:
        reading.mistake(path, f"{count_text(count)} points are more than memory holds; allowed are {count_text(most)}")
        return None
    points = np.concatenate([geometry.grid_points(kind, grid) for kind, grid in kinds])
    local, world = frames.both(fields["body"], points, fields["frame"])
    if not (in_range(local, path, reading) and in_range(world, path, reading)):
        return None
    return PointGrid(name, fields["body"], local, world)
