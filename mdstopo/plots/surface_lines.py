"""Surfaces that points of other bodies may touch, as lines that are drawn of them."""

from typing import NamedTuple

import numpy as np

from mdstopo.case.model import GROUND, Case, Surface, SurfaceContact
from mdstopo.plots.scenery import Floats, points_of, start_state
from mdstopo.scene.point_positions import points_at

#: parts of a side of a plane or a rectangle; corners of a circle; circles and lines along a cylinder
PARTS, CORNERS, CIRCLES, SPOKES = 4, 32, 3, 8


class SurfaceLines(NamedTuple):
    """The lines, (n, 3) each, of a surface, in coordinates of its body. endless: of a plane, drawn in part."""

    body: str
    lines: list[Floats]
    endless: bool


def surfaces_of(case: Case) -> list[SurfaceLines]:
    """Of every contact the surface; of planes a square of the scene's size at the start, of cylinders what fits."""
    if not case.contacts:
        return []
    q = start_state(case)[None]
    cloud = np.concatenate([points_at(case, name, points_of(case, name), q)[0] for name in _names(case)])
    middle = 0.5 * (cloud.min(axis=0) + cloud.max(axis=0))
    size = max(float(np.linalg.norm(cloud.max(axis=0) - cloud.min(axis=0))), 1e-9)
    found = []
    for contact in case.contacts:
        assert isinstance(contact, SurfaceContact)
        centre = _local(case, contact.edge_body, middle)
        lines = _LINES[contact.surface.shape](contact.surface, centre, size)
        found.append(SurfaceLines(contact.edge_body, lines, contact.surface.shape == "plane"))
    return found


def _names(case: Case) -> list[str]:
    return [*(body.name for body in case.bodies), GROUND]


def _local(case: Case, name: str, place: Floats) -> Floats:
    """A global place at the start in coordinates of a body."""
    if name == GROUND:
        return place
    body = case.body(name)
    return np.asarray((place - np.array(body.position)) @ body.rotation)


def _grid(middle: Floats, first: Floats, second: Floats) -> list[Floats]:
    """Lines along both sides of a parallelogram with these halves of sides (3,)."""
    shares = np.linspace(-1.0, 1.0, PARTS + 1)
    one = [np.array([middle + s * first - second, middle + s * first + second]) for s in shares]
    return one + [np.array([middle + s * second - first, middle + s * second + first]) for s in shares]


def _circle(middle: Floats, first: Floats, second: Floats) -> Floats:
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)[:, None]
    return np.asarray(middle + np.cos(angle) * first + np.sin(angle) * second)


def _plane(surface: Surface, centre: Floats, size: float) -> list[Floats]:
    first, second, normal = surface.axes
    middle = centre - float(normal @ (centre - np.array(surface.place))) * normal
    return _grid(middle, 0.5 * size * first, 0.5 * size * second)


def _rectangle(surface: Surface, centre: Floats, size: float) -> list[Floats]:
    del centre, size
    one, two = surface.sizes
    return _grid(np.array(surface.place), one * surface.axes[0], two * surface.axes[1])


def _sphere(surface: Surface, centre: Floats, size: float) -> list[Floats]:
    del centre, size
    arms = surface.sizes[0] * surface.axes
    return [_circle(np.array(surface.place), arms[k], arms[(k + 1) % 3]) for k in range(3)]


def _cylinder(surface: Surface, centre: Floats, size: float) -> list[Floats]:
    radius, length = surface.sizes
    first, second, axis = surface.axes
    along = float(axis @ (centre - np.array(surface.place)))
    start, end = max(0.0, min(along - size, length)), min(length, max(along + size, 0.0))
    ends = [np.array(surface.place) + at * axis for at in (start, end)]
    circles = [_circle(at, radius * first, radius * second) for at in np.linspace(ends[0], ends[1], CIRCLES)]
    angles = np.linspace(0.0, 2.0 * np.pi, SPOKES, endpoint=False)
    arms = [radius * (np.cos(angle) * first + np.sin(angle) * second) for angle in angles]
    return circles + [np.array([ends[0] + arm, ends[1] + arm]) for arm in arms]


_LINES = {"plane": _plane, "rectangle": _rectangle, "sphere": _sphere, "cylinder": _cylinder}
