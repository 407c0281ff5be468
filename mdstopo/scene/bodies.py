"""Bodies at the start, in a plane or in space: their axes, and where their points are."""

import math
from typing import Any

import numpy as np

from mdstopo.case.model import Case, LoadCase
from mdstopo.scene.springs_model import FloatArray


def axes_of(body: Any) -> FloatArray:
    """(d, d): the columns are the body's axes in global coordinates at the start; body: of either dimension."""
    if hasattr(body, "rotation"):
        return np.asarray(body.rotation)
    c, s = math.cos(body.angle), math.sin(body.angle)
    return np.array([[c, -s], [s, c]])


def placed(body: Any, local: FloatArray) -> FloatArray:
    """Global places (n, d) at the start of points (n, d) of a body."""
    moved: FloatArray = local @ np.ascontiguousarray(axes_of(body).T) + np.array(body.position)
    return moved


def is_spatial(case: Case) -> bool:
    """Whether the bodies of a case move in space, not in a plane."""
    return case.dimension > 2


def stands_as(one: LoadCase | Case, other: LoadCase | Case) -> bool:
    """Whether two load cases have their bodies in the same places at the start."""
    places = ([(*body.position, *axes_of(body).ravel().tolist()) for body in each.bodies] for each in (one, other))
    return next(places) == next(places)


def distances(points: FloatArray) -> FloatArray:
    """Lengths (n,) of vectors (n, d), without overflow on the way."""
    return np.asarray(np.hypot.reduce(points, axis=-1))
