"""Contacts of the points of one body with an edge of another, in space with a surface."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mdstopo.case.geometry.coordinates import in_range
from mdstopo.case.model import AnyContact, Contact, PointGrid
from mdstopo.case.objects.frames import Frames
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, shown


def build_contacts(
    entries: Any, points: dict[str, PointGrid], frames: Frames, reading: Reading
) -> tuple[AnyContact, ...]:
    """The contacts of the case, without those that cannot be made; mistakes are noted."""
    built = []
    named: dict[str, int] = {}
    for index, fields in enumerate(entries if isinstance(entries, list) else ()):
        if fields is BAD:
            continue
        name = fields["name"]
        if isinstance(name, str) and name in named:
            message = f"the name {shown(name)} is given to contacts[{named[name]}] already"
            reading.mistake(inside(fields.path, "name"), message)
        elif isinstance(name, str):
            named[name] = index
        contact = _build(index, fields, points, frames, reading)
        if contact is not None:
            built.append(contact)
    return tuple(built)


def _build(
    index: int, fields: Fields, points: dict[str, PointGrid], frames: Frames, reading: Reading
) -> AnyContact | None:
    on, grid = fields["on"], points.get(fields["points"]) if isinstance(fields["points"], str) else None
    if on is BAD or grid is None or not fields.good() or on["body"] not in frames.bodies:
        return None
    if on["body"] == grid.body:
        path = inside(fields.path, "on")
        reading.mistake(path, f"the points are on {shown(grid.body)} as well; a contact needs two bodies")
        return None
    common = {key: fields[key] for key in ("stiffness", "damping", "friction", "slip")}
    common |= {"name": fields["name"] or str(index), "index": index, "body": grid.body, "points": grid.local}
    return frames.geometry.build_contact(common, on, frames, reading)


def edge_contact(common: dict[str, Any], edge: Fields, frames: Frames, reading: Reading) -> Contact | None:
    """The contact of points with an edge of a body; None where there is no such edge, which is noted.

    common: what contacts with anything have, as fields of `Contact`.
    """
    first, first_world = frames.point(edge["body"], edge["from"], edge["frame"])
    second, second_world = frames.point(edge["body"], edge["to"], edge["frame"])
    if not in_range(np.array([first, second, first_world, second_world]), edge.path, reading):
        return None
    length = math.hypot(second[0] - first[0], second[1] - first[1])
    if not length > 0.0:
        reading.mistake(edge.path, "both ends of the edge coincide; an edge needs a length")
        return None
    return Contact(**common, edge_body=edge["body"], edge_from=first, edge_to=second)
