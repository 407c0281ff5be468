"""The motion of a design as a glTF scene: a node for every body and member, an animation for every load case."""

from collections.abc import Iterator
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from mdstopo._version import __version__
from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.plots.acting import NOT_ACTING, acts_in
from mdstopo.plots.beside import side_places
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.scenery import Floats, ends_at, start_state
from mdstopo.plots.solids import Solid, convex, joined, solid
from mdstopo.plots.source import Source
from mdstopo.plots.style import COLOURS, ink
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.thickness import FAINT, families, strongest, thickness
from mdstopo.plots.triangles import triangles
from mdstopo.plots.views import upright
from mdstopo.plots.windows_of_laws import is_timed
from mdstopo.report.gltf_file import INDICES, LINES, POINTS, TRIANGLES, VERTICES, GltfFile
from mdstopo.scene.quaternions import product, quaternions_of

#: members that are drawn, the thickest first
MOST_MEMBERS = 1000
#: between two frames no body turns by more (rad); frames of an animation, at least and at most
MOST_TURN, FEWEST_FRAMES, MOST_FRAMES = 0.2, 121, 4001
#: up to how much turn within a step of the integrator (rad) cubics between its ends may be taken; and by how much of
#: the scene's size, or of a radian, these may be off
SMOOTH, CUBIC_ERROR = 0.8, 2e-4
#: shares of the scene's size: radius of the thickest member, of the thinnest, of one that does not act, and of joints
THICK, THIN, IDLE, JOINT = 0.006, 0.001, 0.0005, 0.012
#: share of the scene's size between the axes of members of the same two points: the thickest do not touch
BESIDE = 2.5 * THICK
#: below this share of its length a member is seen end on
END_ON = 0.2
#: sides of a member's tube; corners up to which faces are cut from one corner
SIDES, FAN = 8, 4
_UP = np.array([0.0, 1.0, 0.0])
_NEUTRAL, _CONTACT = "#555555", "#8A8A8A"


class Poses(NamedTuple):
    """A motion for an animation. t (T,) from 0 on in s; q (T, n): a trajectory's states; of bodies place (T, B, 3) and
    turn (T, B, 4), w x y z."""

    t: Floats
    q: Floats
    place: Floats
    turn: Floats


def motion_file(source: Source, slower: float = 1.0) -> tuple[bytes, int]:
    """The glTF file of a motion, and how many members were left out of it. slower: by this factor the animations
    are."""
    return _Scene(source, slower).file()


class _Scene:
    """A file in the making."""

    def __init__(self, source: Source, slower: float) -> None:
        self.source, self.case, self.slower = source, source.case, slower
        self.out = GltfFile(f"mdstopo {__version__}")
        self.names = [*(body.name for body in self.case.bodies), GROUND]
        start = start_state(self.case)
        self.first = _poses(self.case, np.zeros(1), start[None])
        shapes = {name: _shape(self.case, name) for name in self.names}
        cloud = [_lifted(self.case, ends_at(self.case, group, start)).reshape(-1, 3) for group in self.case.members]
        cloud += [self.first.place[0], *(shape.corners for shape in shapes.values())]
        self.size = max(float(np.linalg.norm(np.ptp(np.concatenate(cloud), axis=0))), 1e-9)
        self.motions = {name: _motion(source, name, CUBIC_ERROR * self.size) for name in source.load_cases}
        self.shapes = shapes
        self.touched = surfaces_of(self.case) if self.case.dimension > 2 else []
        #: by node: where it is in every load case, to be animated
        self.moving: dict[int, dict[str, dict[str, Floats]]] = {}

    def file(self) -> tuple[bytes, int]:
        children = [self._body(k, name) for k, name in enumerate(self.names)]
        self._joints(children)
        members, left_out = self._members()
        root = self.out.add("nodes", name=self.source.title, rotation=_xyzw(_standing(self.case)))
        self.out.parts["nodes"][root]["children"] = [*children, *members]
        self.out.add("scenes", name=self.source.title, nodes=[root])
        for name, poses in self.motions.items():
            self._animation(name, poses)
        return self.out.binary(), left_out

    def _body(self, number: int, name: str) -> int:
        entry: dict[str, Any] = {"name": name}
        colour = _NEUTRAL if name == GROUND else COLOURS[(number + 2) % len(COLOURS)]
        primitives = [*self._primitives(self.shapes[name], self._points(name), colour), *self._surfaces(name)]
        if primitives:
            entry["mesh"] = self.out.add("meshes", name=name, primitives=primitives)
        if name != GROUND:
            entry |= {
                "translation": self.first.place[0, number].tolist(),
                "rotation": _xyzw(self.first.turn[0, number]),
            }
        node = self.out.add("nodes", **entry)
        if name != GROUND:
            self.moving[node] = {
                case: {"translation": poses.place[:, number], "rotation": poses.turn[:, number]}
                for case, poses in self.motions.items()
            }
        return node

    def _surfaces(self, name: str) -> Iterator[dict[str, Any]]:
        """Lines of the surfaces of a body that points may touch."""
        lines = [line for each in self.touched if each.body == name for line in each.lines]
        if lines:
            ends = np.concatenate([np.stack([line[:-1], line[1:]], axis=1).reshape(-1, 3) for line in lines])
            place = self.out.numbers(ends, VERTICES, bounds=True)
            yield {"attributes": {"POSITION": place}, "mode": LINES, "material": self._material(_CONTACT, 1.0)}

    def _points(self, name: str) -> Floats:
        pieces = [grid.local for grid in self.case.points.values() if grid.body == name]
        return _lifted(self.case, np.concatenate(pieces)) if pieces else np.zeros((0, 3))

    def _primitives(self, shape: Solid, points: Floats, colour: str) -> Iterator[dict[str, Any]]:
        """Faces that one can see through, edges, points."""
        if shape.faces:
            yield self._faces(shape, self._material(colour, 0.35))
        solid_colour = self._material(colour, 1.0)
        if shape.edges:
            place = self.out.numbers(shape.corners, VERTICES, bounds=True)
            order = self.out.numbers(np.array(shape.edges).ravel(), INDICES)
            yield {"attributes": {"POSITION": place}, "indices": order, "mode": LINES, "material": solid_colour}
        if len(points):
            place = self.out.numbers(points, VERTICES, bounds=True)
            yield {"attributes": {"POSITION": place}, "mode": POINTS, "material": solid_colour}

    def _faces(self, shape: Solid, material: int) -> dict[str, Any]:
        """Triangles; every face has corners of its own, so that its edges are sharp."""
        places, normals, order, count = [], [], [], 0
        for face in shape.faces:
            corners = shape.corners[list(face)]
            area = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
            places.append(corners)
            normals.append(np.tile(area / max(float(np.linalg.norm(area)), 1e-300), (len(face), 1)))
            order += [(count + a, count + b, count + c) for a, b, c in _cut(corners)]
            count += len(face)
        attributes = {
            "POSITION": self.out.numbers(np.concatenate(places), VERTICES, bounds=True),
            "NORMAL": self.out.numbers(np.concatenate(normals), VERTICES),
        }
        indices = self.out.numbers(np.array(order).ravel(), INDICES)
        return {"attributes": attributes, "indices": indices, "mode": TRIANGLES, "material": material}

    def _material(self, colour: str, cover: float) -> int:
        """A colour; stated ones are those of a screen, a file holds linear ones."""
        screen = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        linear = np.where(screen <= 0.04045, screen / 12.92, ((screen + 0.055) / 1.055) ** 2.4)
        base = {"baseColorFactor": [*linear.tolist(), cover], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        more: dict[str, Any] = {"doubleSided": True} | ({"alphaMode": "BLEND"} if cover < 1.0 else {})
        return self.out.add("materials", pbrMetallicRoughness=base, **more)

    def _joints(self, bodies: list[int]) -> None:
        """Balls on the first body of each."""
        if not self.case.joints:
            return
        mesh = self.out.add("meshes", name="joint", primitives=[self._faces(_ball(), self._material("#222222", 1.0))])
        for joint in self.case.joints:
            place = _lifted(self.case, np.array([joint.at_first]))[0]
            scale = [JOINT * self.size] * 3
            node = self.out.add("nodes", name=f"joint {joint.name}", mesh=mesh, translation=place.tolist(), scale=scale)
            self.out.parts["nodes"][bodies[self.names.index(joint.bodies[0])]].setdefault("children", []).append(node)

    def _members(self) -> tuple[list[int], int]:
        """Tubes from end to end; how many that could be seen are left out."""
        nodes: list[int] = []
        shares, named = thickness(self.source).shares, families(self.case)
        order = list(dict.fromkeys(named))
        some = strongest(shares, MOST_MEMBERS)
        every = zip(self.case.members, shares, some, side_places(self.case, some), named, strict=True)
        for group, share, chosen, side, family in every:
            if not len(chosen):
                continue
            own = COLOURS[order.index(family) % len(COLOURS)]
            primitive = self._faces(_tube(), self._material(own, 1.0))
            mesh = self.out.add("meshes", name=group.name, primitives=[primitive])
            radius = self.size * (THIN + (THICK - THIN) * share)
            drawn = (chosen, radius[chosen], BESIDE * self.size * side)
            first = self._tubes(group, drawn, self.first.q)
            moved = {name: self._tubes(group, drawn, poses.q) for name, poses in self.motions.items()}
            acts = self._acts(group, chosen)
            for i, member in enumerate(chosen.tolist()):
                own_acts = {name: each[:, i] for name, each in acts.items()}
                own_first = tuple(part[0, i] for part in first)
                own_moved = {name: tuple(part[:, i] for part in parts) for name, parts in moved.items()}
                shown = mesh, f"{group.name} {member}", float(share[member])
                nodes += self._tube_nodes(shown, own_first, own_moved, own_acts)
        there = sum(int((share > FAINT).sum()) for share in shares)
        return nodes, there - sum(len(chosen) for chosen in some)

    def _acts(self, group: MemberGroup, chosen: NDArray[np.int64]) -> dict[str, NDArray[np.bool_]]:
        """(T, K) of each load case: which of some members (K,) of a group act at the times of its motion."""
        if not is_timed(self.case, group):
            return {name: np.ones((len(poses.t), len(chosen)), dtype=bool) for name, poses in self.motions.items()}
        windows = self.source.windows[group.name][chosen]
        return {
            name: acts_in(windows, self.case.load_case(name).start + poses.t) for name, poses in self.motions.items()
        }

    def _tube_nodes(
        self,
        shown: tuple[int, str, float],
        first: tuple[Floats, ...],
        moved: dict[str, tuple[Floats, ...]],
        acts: dict[str, NDArray[np.bool_]],
    ) -> Iterator[int]:
        """The node of a member, of no size while the member does not act, and then one that is thin and grey.

        shown: its mesh, its name, its share of the thickest. first: translation (3,), rotation (4,) and scale (3,)
        before any motion, at which it is drawn as one that acts; moved: the same (T, ...) in each load case; acts (T,):
        whether it acts there.
        """
        mesh, name, share = shown
        place, turn, scale = first
        looks: list[tuple[int, str, Floats, dict[str, NDArray[np.bool_]], float | None]]
        looks = [(mesh, name, scale, acts, None)]
        if not all(each.all() for each in acts.values()):
            idle = {case: ~each for case, each in acts.items()}
            looks.append((self._idle, f"{name}, {NOT_ACTING}", np.zeros(3), idle, IDLE * self.size))
        for own_mesh, own_name, own_scale, there, radius in looks:
            node = self.out.add(
                "nodes", name=own_name, mesh=own_mesh, translation=place.tolist(), rotation=_xyzw(turn),
                scale=own_scale.tolist(), extras={"share": share},
            )  # fmt: skip
            self.moving[node] = {}
            for case, (places, turns, scales) in moved.items():
                sizes = scales if radius is None else scales * [0.0, 1.0, 0.0] + np.array([radius, 0.0, radius])
                own = {"translation": places, "rotation": turns, "scale": sizes * there[case][:, None]}
                self.moving[node][case] = own
            yield node

    @cached_property
    def _idle(self) -> int:
        """The mesh of members that do not act."""
        primitive = self._faces(_tube(), self._material(ink("middle"), 1.0))
        return self.out.add("meshes", name=NOT_ACTING, primitives=[primitive])

    def _tubes(
        self, group: MemberGroup, drawn: tuple[NDArray[np.int64], Floats, Floats], states: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """What makes tubes of members at states (T, n), as `_stretched`. drawn: of a group the members (M,), their
        radii, and by how much each is beside the line between its ends."""
        chosen, radius, shift = drawn
        ends = _lifted(self.case, np.stack([ends_at(self.case, group, q)[chosen] for q in states]))
        if np.any(shift):
            ends = ends + (shift[:, None] * _sideways(ends, _toward(self.case)))[:, :, None]
        return _stretched(ends, radius)

    def _animation(self, name: str, poses: Poses) -> None:
        if len(poses.t) < 2:
            return
        times = self.out.numbers(self.slower * poses.t, bounds=True)
        samplers: list[dict[str, Any]] = []
        channels: list[dict[str, Any]] = []
        for node, motions in self.moving.items():
            for path, values in motions[name].items():
                told = np.roll(_continuous(values), -1, axis=1) if path == "rotation" else values
                samplers.append({"input": times, "output": self.out.numbers(told), "interpolation": "LINEAR"})
                channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
        if channels:
            extras = {"start": float(self.case.load_case(name).start), "slower": self.slower}
            self.out.add("animations", name=name, samplers=samplers, channels=channels, extras=extras)


def _motion(source: Source, load_case: str, allowed: float) -> Poses:
    """The motion at even times, close enough for the turns of bodies.

    Between the steps that the file has, cubic polynomials with their rates; where bodies turn too far within a step,
    where these polynomials may be off by more than `allowed` (m) or CUBIC_ERROR (rad), and where the file has no motion
    of the design, it is simulated again.
    """
    case = source.case
    stored = source.view.under(f"trajectories/{load_case}")
    found = None
    if stored and "v" in stored and "a" in stored and len(stored["t"]) > 1:
        t, q, v, a = (np.asarray(stored[name], dtype=np.float64) for name in ("t", "q", "v", "a"))
        turned = float((_spins(case, v)[:-1] * np.diff(t)[:, None]).max(initial=0.0))
        if turned <= SMOOTH and _cubics_suffice(case, (t, q, v, a), allowed):
            found = CubicHermiteSpline(t, q, _slopes(case, q, v))
    if found is None:
        motion = source.engine.trajectory(source.design, load_case)
        t, v = motion.t, motion.v
        if len(t) < 2:
            return _poses(case, np.zeros(1), motion.q[:1])
        times = _even(case, t, v)
        return _poses(case, times, motion.at(times).q)
    times = _even(case, t, v)
    return _poses(case, times, found(times))


def _cubics_suffice(case: Case, states: tuple[Floats, Floats, Floats, Floats], allowed: float) -> bool:
    """Whether the cubics through coordinates and their rates differ little from the quintics that keep their second
    derivatives, too.

    states: times (T,), coordinates, velocities, accelerations. allowed: how far apart they may be in places (m); in
    turns it is CUBIC_ERROR (rad).
    """
    t, q, v, a = states
    slope, bend = _slopes(case, q, v), _second_slopes(case, q, v, a)
    h = np.diff(t)[:, None]
    mean = np.diff(q, axis=0) / h
    first = (6.0 * mean - 4.0 * slope[:-1] - 2.0 * slope[1:]) / h  # the cubics' second derivatives at both ends
    last = (-6.0 * mean + 2.0 * slope[:-1] + 4.0 * slope[1:]) / h
    # at the middle of a step; the largest difference is a tenth more at most
    apart = h**2 / 64.0 * (np.abs(bend[:-1] - first) + np.abs(bend[1:] - last))
    # an entry of a quaternion changes by half of the angle at most
    own = [allowed] * 2 + [CUBIC_ERROR] if case.dimension == 2 else [allowed] * 3 + [0.5 * CUBIC_ERROR] * 4
    return bool(np.all(apart <= np.tile(own, len(case.bodies))))


def _even(case: Case, t: Floats, v: Floats) -> Floats:
    """Even times from the first to the last of steps, as many as bodies with the rates v need."""
    turned = float((_spins(case, v)[:-1] * np.diff(t)[:, None]).sum(axis=0).max(initial=0.0))
    count = int(np.clip(np.ceil(turned / MOST_TURN) + 1, FEWEST_FRAMES, MOST_FRAMES))
    return np.linspace(t[0], t[-1], count)


def _spins(case: Case, v: Floats) -> Floats:
    """(T, B) how fast bodies turn, rad/s."""
    count = len(case.bodies)
    if case.dimension == 2:
        return np.abs(v.reshape(len(v), count, 3)[:, :, 2])
    return np.asarray(np.linalg.norm(v.reshape(len(v), count, 6)[:, :, 3:], axis=2))


def _slopes(case: Case, q: Floats, v: Floats) -> Floats:
    """dq/dt; of the quaternion of a body with the global angular velocity w it is (0, w) times it, by two."""
    if case.dimension == 2:
        return v
    slopes = np.empty_like(q)
    for b in range(len(case.bodies)):
        rate = v[:, 6 * b : 6 * b + 6]
        slopes[:, 7 * b : 7 * b + 3] = rate[:, :3]
        spin = np.concatenate([np.zeros((len(v), 1)), rate[:, 3:]], axis=1)
        slopes[:, 7 * b + 3 : 7 * b + 7] = 0.5 * product(spin, q[:, 7 * b + 3 : 7 * b + 7])
    return slopes


def _second_slopes(case: Case, q: Floats, v: Floats, a: Floats) -> Floats:
    """d2q/dt2; of the quaternion e of a body with the angular velocity w and acceleration w' it is
    (0, w') e / 2 + (0, w) (0, w) e / 4."""
    if case.dimension == 2:
        return a
    second = np.empty_like(q)
    none = np.zeros((len(q), 1))
    for b in range(len(case.bodies)):
        turn = q[:, 7 * b + 3 : 7 * b + 7]
        spin, change = (np.concatenate([none, each[:, 6 * b + 3 : 6 * b + 6]], axis=1) for each in (v, a))
        second[:, 7 * b : 7 * b + 3] = a[:, 6 * b : 6 * b + 3]
        second[:, 7 * b + 3 : 7 * b + 7] = 0.5 * product(change, turn) + 0.25 * product(spin, product(spin, turn))
    return second


def _poses(case: Case, times: Floats, q: Floats) -> Poses:
    count = len(case.bodies)
    own = q.reshape(len(q), count, -1).copy()
    if case.dimension == 2:
        turn = np.zeros((len(q), count, 4))
        turn[..., 0], turn[..., 3] = np.cos(0.5 * own[..., 2]), np.sin(0.5 * own[..., 2])
        place = np.concatenate([own[..., :2], np.zeros((len(q), count, 1))], axis=2)
        return Poses(times - times[0], q, place, turn)
    own[..., 3:] /= np.linalg.norm(own[..., 3:], axis=2, keepdims=True)
    return Poses(times - times[0], own.reshape(len(q), -1), own[..., :3], own[..., 3:])


def _lifted(case: Case, points: Floats) -> Floats:
    """Points (..., d) in space; those of a plane lie at z = 0."""
    if case.dimension > 2:
        return points
    return np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1)


def _shape(case: Case, body: str) -> Solid:
    """What is drawn of a body; of areas with holes only the border."""
    if case.dimension > 2:
        return solid(case, body)
    parts = [Solid(np.zeros((0, 3)))]
    for shape in planar_shapes(case, body):
        for area in shape.areas:
            face = tuple(range(len(area)))
            sides = tuple((k, (k + 1) % len(area)) for k in face)
            parts.append(Solid(_lifted(case, area), (face,) if len(shape.areas) == 1 else (), sides))
        parts += [
            Solid(_lifted(case, line), (), tuple((k, k + 1) for k in range(len(line) - 1)))
            for line in (*shape.lines, *shape.arms)
        ]
    return joined(parts)


def _cut(corners: Floats) -> list[tuple[int, int, int]]:
    """The triangles of a face; those with up to four corners are convex."""
    if len(corners) <= FAN:
        return [(0, k, k + 1) for k in range(1, len(corners) - 1)]
    return triangles(corners)


def _standing(case: Case) -> Floats:
    """The quaternion that turns the case's axes so that up is y, as the format has it."""
    if case.dimension == 2:
        return np.array([1.0, 0.0, 0.0, 0.0])
    right, away, up = upright(case)
    return quaternions_of(np.array([right, up, -away]))


def _toward(case: Case) -> Floats:
    """Unit vector to an eye that sees members beside each other: before a plane, in space in front of and above it."""
    if case.dimension == 2:
        return np.array([0.0, 0.0, 1.0])
    _, away, up = upright(case)
    return np.asarray((up - away) / np.sqrt(2.0))


def _left(along: Floats, toward: Floats) -> Floats:
    """(M, 3) at right angles to unit vectors along members, to the left as an eye in the direction `toward` sees them;
    where this eye sees one end on, as another eye does."""
    left = np.cross(toward, along)
    end_on = np.linalg.norm(left, axis=1) < END_ON
    left[end_on] = np.cross(np.roll(toward, 1), along[end_on])
    return left


def _sideways(ends: Floats, toward: Floats) -> Floats:
    """(T, M, 3) unit vectors at right angles to members with ends (T, M, 2, 3): of `_left` at the first of the times,
    then turned with the members as little as these turn. Zero until a member has a length."""
    way = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(way, axis=2, keepdims=True)
    along = way / np.where(length > 0.0, length, 1.0)
    left = np.zeros_like(way[0])
    found = np.empty_like(way)
    for k, each in enumerate(along):
        left = left - (left * each).sum(axis=1, keepdims=True) * each
        lost = ~left.any(axis=1)
        left[lost] = _left(each[lost], toward)
        size = np.linalg.norm(left, axis=1, keepdims=True)
        left = left / np.where(size > 0.0, size, 1.0)
        found[k] = left
    return found


def _stretched(ends: Floats, radius: Floats) -> tuple[Floats, Floats, Floats]:
    """Translation (T, M, 3), rotation (T, M, 4) and scale (T, M, 3) that make the tube reach between ends (T, M, 2, 3).

    The rotation is the shortest one from y to the member; opposite to y it is half a turn about x.
    """
    way = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(way, axis=2)
    along = way / np.where(length > 0.0, length, 1.0)[..., None]
    turn = np.concatenate([1.0 + along[..., 1:2], np.cross(_UP, along)], axis=2)
    size = np.linalg.norm(turn, axis=2)
    turn = np.where((size > 1e-6)[..., None], turn / np.maximum(size, 1e-6)[..., None], [0.0, 1.0, 0.0, 0.0])
    wide = np.broadcast_to(radius, length.shape)
    return ends[:, :, 0], turn, np.stack([wide, length, wide], axis=2)


def _continuous(turns: Floats) -> Floats:
    """Quaternions (T, 4) with the signs for which each is next to the one before."""
    flips = np.where(np.einsum("tk,tk->t", turns[1:], turns[:-1]) < 0.0, -1.0, 1.0)
    return np.asarray(turns * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


def _xyzw(quaternion: Floats) -> list[float]:
    """The order of the format."""
    return [float(value) for value in np.roll(quaternion, -1)]


def _tube() -> Solid:
    """A tube of radius 1 from y = 0 to y = 1."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = np.stack([np.cos(angle), np.zeros(SIDES), np.sin(angle)], axis=1)
    return convex(np.concatenate([ring, ring + _UP]))


def _ball() -> Solid:
    """An icosahedron in the unit sphere."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    signs = [(a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    corners = np.array([np.roll([0.0, a, b], k) for k in range(3) for a, b in signs])
    return convex(corners / np.linalg.norm(corners[0]))
