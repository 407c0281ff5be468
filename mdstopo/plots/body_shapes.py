"""What is drawn of a body where the case has no outline for it, and its outline where it has one.

The area that its points span, where nothing of other bodies lies in it. Otherwise the lines that its points follow, as
the frame of a vehicle, and arms from its centre of mass to the points that follow no line, as a link.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.scenery import Floats, hull, own_points, points_of, start_state
from mdstopo.scene.point_positions import points_at

#: points that a line has at least; how far apart they may be, in distances of the two before; how far its ends may be
#: apart where it is closed
LINE, UNEVEN, CLOSED = 4, 1.6, 1.6
#: points up to which a line is one only where it is straight: four posts around a scene are no fence
FENCE_POINTS = 5
#: arms that a body has at most: more would look like members
MOST_ARMS = 4
#: of the size of a body: what is nearer to its border than that is not within it; what is nearer to a line is on it
BORDER = 1e-6
#: share of the size of all points that a body without points has in pictures, at most
BODY_WITHOUT_POINTS = 0.05


@dataclass(frozen=True)
class Shape:
    """What is drawn of a body, in body coordinates. areas: closed lines (n, d), an area within another is a hole;
    lines: open; arms: two ends.

    border: around points that show no shape, a closed line without an area. thin_arms: whether arms are less than the
    rest of the body, which has an outline or lines: they are thin and dashed.
    """

    areas: list[Floats] = field(default_factory=list)
    lines: list[Floats] = field(default_factory=list)
    arms: list[Floats] = field(default_factory=list)
    border: Floats | None = None
    thin_arms: bool = False


def planar_shapes(case: Case, body: str) -> list[Shape]:
    """What is drawn of a body in the plane: each of its outlines, or one shape from its points."""
    points = own_points(case, body)
    if body != GROUND and case.body(body).outline:
        found = [Shape([each.corners[list(face)] for face in each.faces]) for each in case.body(body).outline]
        arms = _reaching(points, [area for shape in found for area in shape.areas])
        return [*found, Shape(arms=arms, thin_arms=True)] if 0 < len(arms) <= MOST_ARMS else found
    if body != GROUND and len(points):
        area = hull(points)
        if len(area) > 2 and not others_within(case, body, area):
            return [Shape([area])]
    if body != GROUND and not len(points):
        return [Shape([_disc(case, body)])]
    grids = [grid.local for grid in case.points.values() if grid.body == body]
    if body == GROUND:
        return [Shape(lines=[line for grid in grids for line in followed(grid)])]
    return [line_shape(points, grids)]


def _reaching(points: Floats, areas: list[Floats]) -> list[Floats]:
    """Arms (2, 2) from closed lines (n, 2) to the points that lie outside of all of them: a bushing beside a block."""
    size = BORDER * float(np.ptp(np.concatenate(areas), axis=0).max())
    arms = []
    for point in np.unique(points, axis=0):
        nearest = [_nearest(point, area) for area in areas]
        gap = min(nearest, key=lambda place: float(np.linalg.norm(place - point)))
        if np.linalg.norm(gap - point) > size and not any(_is_within(point, area) for area in areas):
            arms.append(np.array([gap, point]))
    return arms


def _nearest(point: Floats, area: Floats) -> Floats:
    """The place (2,) on a closed line (n, 2) that is nearest to a point."""
    way = np.roll(area, -1, axis=0) - area
    share = ((point - area) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-300)
    places = area + np.clip(share, 0.0, 1.0)[:, None] * way
    return np.asarray(places[int(((places - point) ** 2).sum(axis=1).argmin())])


def _is_within(point: Floats, area: Floats) -> bool:
    """Whether a point is inside a closed line (n, 2): a ray from it meets the line an odd number of times."""
    following = np.roll(area, -1, axis=0)
    crosses = (area[:, 1] > point[1]) != (following[:, 1] > point[1])
    a, b = area[crosses], following[crosses]
    x = a[:, 0] + (point[1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return bool((x > point[0]).sum() % 2)


def line_shape(points: Floats, grids: list[Floats]) -> Shape:
    """Lines that grids follow, and arms from the centre of mass to points (n, d) that are on none."""
    lines = [line for grid in grids for line in followed(grid)]
    single = points
    for line in lines:
        away = np.abs(single[:, None] - line[None]).max(axis=2).min(axis=1)
        single = single[away > BORDER * max(1e-300, float(np.ptp(points, axis=0).max()))]
    origin = np.zeros(points.shape[1])
    loose = np.unique(single, axis=0)
    if len(loose) > MOST_ARMS:
        area = hull(loose) if loose.shape[1] == 2 and not lines else None
        return Shape(lines=lines, border=area)
    arms = [np.array([origin, point]) for point in loose if np.any(point)]
    if lines and not arms:  # a frame is joined to its centre of mass where it comes nearest
        every = np.concatenate(lines)
        arms = [np.array([origin, every[int((every**2).sum(axis=1).argmin())]])]
    return Shape(lines=lines, arms=[arm for arm in arms if np.any(arm[1])], thin_arms=bool(lines))


def followed(points: Floats) -> list[Floats]:
    """The lines (n, d) that points follow in their order: each where distances change little from one to the next."""
    if len(points) < LINE:
        return []
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    found, first = [], 0
    for k in range(1, len(gaps) + 1):
        if k < len(gaps) and gaps[k] <= UNEVEN * gaps[k - 1] and gaps[k - 1] <= UNEVEN * gaps[k]:
            continue
        line = points[first : k + 1]
        if len(line) > FENCE_POINTS or (len(line) >= LINE and _is_straight(line)):
            is_closed = 0.0 < np.linalg.norm(line[-1] - line[0]) <= CLOSED * gaps[first:k].max()
            found.append(np.concatenate([line, line[:1]]) if is_closed else line)
            first = k + 1 if k < len(gaps) and gaps[k] > gaps[k - 1] else k
        else:
            first = k
    return found


def _is_straight(line: Floats) -> bool:
    spread = np.linalg.svd(line - line.mean(axis=0), compute_uv=False)
    return bool(spread[1] <= BORDER * spread[0])


def others_within(case: Case, body: str, corners: Floats) -> bool:
    """Whether a point of anything else is inside a body's convex area (n, 2), at the start."""
    state = start_state(case)[None]
    places = points_at(case, body, corners, state)[0]
    edges = np.roll(places, -1, axis=0) - places
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    reach = (normals * places).sum(axis=1) - BORDER * float(np.ptp(places, axis=0).max())
    return any(bool((cloud @ normals.T < reach).all(axis=1).any()) for cloud in others(case, body))


def _told(case: Case, body: str) -> Floats:
    """(K, d) points of a body; its centre of mass where it has none, which may well lie within another body."""
    own = own_points(case, body)
    return own if len(own) else points_of(case, body)


def others(case: Case, body: str) -> list[Floats]:
    """(n, d) global places at the start of the points of each other body and of ground, without those at own points."""
    state = start_state(case)[None]
    names = [name for name in [*(each.name for each in case.bodies), GROUND] if name != body]
    clouds = [np.unique(points_at(case, name, _told(case, name), state)[0], axis=0) for name in names]
    own = np.unique(points_at(case, body, own_points(case, body), state)[0], axis=0)
    near = BORDER * max((float(np.ptp(cloud, axis=0).max()) for cloud in (own, *clouds) if len(cloud)), default=0.0)
    if len(own):
        tree = cKDTree(own)
        clouds = [cloud[tree.query(cloud)[0] > near] for cloud in clouds if len(cloud)]
    return [cloud for cloud in clouds if len(cloud)]


def _disc(case: Case, body: str) -> Floats:
    """A body without points: the disc of equal inertia, J = m r^2 / 2, or a small one where that is large."""
    own = case.body(body)
    every = np.concatenate([*others(case, body), np.array([own.position])])
    radius = float(np.sqrt(2.0 * own.inertia / own.mass))
    size = float(np.ptp(every, axis=0).max())
    radius = min(radius, BODY_WITHOUT_POINTS * size) if size > 0.0 else radius
    angle = 2.0 * np.pi * np.arange(48) / 48
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
