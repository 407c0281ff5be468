"""Driven linkages with candidate springs and dampers, as case documents.

The input turns as prescribed, so that no degree of freedom is left: the motion is the same for every design, and each
force that a joint or a member carries is affine in alpha. So the least largest force under limits on other forces and a
volume row is a cone program (`benchmarks.optimum.cone`).

A linkage is drawn at its start: points, links through points, sliders. Velocities at the start follow from the joints.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Document = dict[str, Any]

#: mass of a link per metre in kg/m, of a slider in kg
LINE_MASS, SLIDER_MASS = 3.0, 1.5


@dataclass(frozen=True)
class Linkage:
    """A linkage at its start.

    points: name -> place. links: name -> names of the points through which it goes; the first one is driven. pins:
    name -> two bodies and the point that they share. sliders: name -> the point at which a slider is guided along x.
    speed: of the driven link in rad/s; turns: how many of its turns are simulated.
    """

    points: Mapping[str, tuple[float, float]]
    links: Mapping[str, tuple[str, ...]]
    pins: Mapping[str, tuple[str, str, str]]
    sliders: Mapping[str, str] = field(default_factory=dict)
    speed: float = 12.0
    turns: float = 1.0

    @property
    def driven(self) -> str:
        """The link that turns as prescribed."""
        return next(iter(self.links))

    def centre(self, body: str) -> Floats:
        """A body's centre of mass: the mean of its points."""
        names = self.links[body] if body in self.links else (self.sliders[body],)
        return np.array(np.round(np.mean([self.points[name] for name in names], axis=0), 12))

    def bodies(self) -> dict[str, Document]:
        """Bodies with the velocities that the joints and the drive leave them."""
        names = [*self.links, *self.sliders]
        motion = self._velocities(names)
        out = {}
        for i, name in enumerate(names):
            mass, inertia = self._inertia(name)
            out[name] = {
                "mass": mass,
                "inertia": inertia,
                "position": self.centre(name).tolist(),
                "velocity": np.round(motion[3 * i : 3 * i + 2], 12).tolist(),
                "angular_velocity": round(float(motion[3 * i + 2]), 12),
            }
        return out

    def joints(self) -> list[Document]:
        """Pins and guides."""
        pins = [
            {"name": name, "type": "revolute", "bodies": [first, second], "at": list(self.points[at])}
            for name, (first, second, at) in self.pins.items()
        ]
        guides = [
            {"name": f"{name}_guide", "type": "prismatic", "bodies": ["ground", name], "at": list(self.points[at]),
             "axis": [1, 0]}
            for name, at in self.sliders.items()
        ]  # fmt: skip
        return pins + guides

    def _inertia(self, body: str) -> tuple[float, float]:
        """Mass, and moment of inertia: of a rod, of lumps at the corners of a plate, of a small block."""
        if body in self.sliders:
            return SLIDER_MASS, 2e-3
        corners = np.array([self.points[name] for name in self.links[body]])
        arms = corners - corners.mean(axis=0)
        length = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
        mass = LINE_MASS * length
        share = 1.0 / 3.0 if len(corners) == 2 else 0.5
        return round(mass, 12), round(float(mass * share * np.mean(np.sum(arms**2, axis=1))), 12)

    def _velocities(self, names: Sequence[str]) -> Floats:
        """vx, vy, omega of each body, from as many linear equations."""
        place = {name: 3 * i for i, name in enumerate(names)}
        rows: list[Floats] = []
        right: list[float] = []

        def at(body: str, point: Floats) -> Floats:
            block = np.zeros((2, 3 * len(names)))
            if body != "ground":
                i, arm = place[body], point - self.centre(body)
                block[:, i : i + 3] = [[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]]
            return block

        for first, second, name in self.pins.values():
            point = np.array(self.points[name])
            rows.extend(at(second, point) - at(first, point))
            right += [0.0, 0.0]
        for slider in self.sliders:
            for k in (1, 2):
                rows.append(np.eye(3 * len(names))[place[slider] + k])
                right.append(0.0)
        rows.append(np.eye(3 * len(names))[place[self.driven] + 2])
        right.append(self.speed)
        matrix = np.array(rows)
        if matrix.shape[0] != matrix.shape[1]:
            raise ValueError(f"{matrix.shape[0]} equations for {matrix.shape[1]} velocities: not one degree of freedom")
        return np.asarray(np.linalg.solve(matrix, np.array(right)))


FOUR_BAR = Linkage(
    points={"a": (0, 0), "b": (0, 0.2), "c": (0.55, 0.5), "d": (0.6, 0)},
    links={"crank": ("a", "b"), "coupler": ("b", "c"), "rocker": ("d", "c")},
    pins={
        "A": ("ground", "crank", "a"),
        "B": ("crank", "coupler", "b"),
        "C": ("coupler", "rocker", "c"),
        "D": ("rocker", "ground", "d"),
    },
)

SLIDER_CRANK = Linkage(
    points={"a": (0, 0), "b": (0, 0.15), "c": (0.5, 0)},
    links={"crank": ("a", "b"), "rod": ("b", "c")},
    pins={"A": ("ground", "crank", "a"), "B": ("crank", "rod", "b"), "C": ("rod", "piston", "c")},
    sliders={"piston": "c"},
)

#: Watt's second chain: two four-bars, the rocker of the first is the input of the second
WATT = Linkage(
    points={**FOUR_BAR.points, "e": (0.85, 0.4), "f": (1.35, 0.55),
            "g": (1.35, 0)},
    links={"crank": ("a", "b"), "coupler": ("b", "c"), "rocker": ("d", "c", "e"), "rod": ("e", "f"),
           "lever": ("g", "f")},
    pins={
        **FOUR_BAR.pins,
        "E": ("rocker", "rod", "e"),
        "F": ("rod", "lever", "f"),
        "G": ("lever", "ground", "g"),
    },
    speed=9.0,
)  # fmt: skip

#: Watt's first chain: the second loop floats on the coupler and the rocker of the first
WATT_FLOATING = Linkage(
    points={**FOUR_BAR.points, "e": (0.25, 0.65), "h": (0.8, 0.45),
            "f": (0.6, 0.9)},
    links={"crank": ("a", "b"), "coupler": ("b", "c", "e"), "rocker": ("d", "c", "h"), "rod": ("e", "f"),
           "lever": ("h", "f")},
    pins={
        **FOUR_BAR.pins,
        "E": ("coupler", "rod", "e"),
        "F": ("rod", "lever", "f"),
        "H": ("lever", "rocker", "h"),
    },
    speed=9.0,
)  # fmt: skip

#: Stephenson's third chain: a dyad from the coupler to the ground
STEPHENSON = Linkage(
    points={**FOUR_BAR.points, "e": (0.3, 0.7), "f": (0.95, 1.05),
            "g": (1.25, 0.3)},
    links={"crank": ("a", "b"), "coupler": ("b", "c", "e"), "rocker": ("d", "c"), "rod": ("e", "f"),
           "lever": ("g", "f")},
    pins={
        **FOUR_BAR.pins,
        "E": ("coupler", "rod", "e"),
        "F": ("rod", "lever", "f"),
        "G": ("lever", "ground", "g"),
    },
    speed=9.0,
)  # fmt: skip

#: a four-bar whose coupler pushes a slider
SIX_BAR_SLIDER = Linkage(
    points={**FOUR_BAR.points, "e": (0.3, 0.7), "f": (1.1, 0.7)},
    links={"crank": ("a", "b"), "coupler": ("b", "c", "e"), "rocker": ("d", "c"), "rod": ("e", "f")},
    pins={
        **FOUR_BAR.pins,
        "E": ("coupler", "rod", "e"),
        "F": ("rod", "ram", "f"),
    },
    sliders={"ram": "f"},
    speed=9.0,
)


def on_link(linkage: Linkage, link: str, count: int, ends: tuple[int, int] = (0, 1)) -> Document:
    """Points along a link, from one of its points to another, the ends included."""
    first, last = (linkage.points[linkage.links[link][i]] for i in ends)
    return {"body": link, "grid": {"line": {"from": list(first), "to": list(last), "count": count}}}


def anchors(low: tuple[float, float], high: tuple[float, float], count: tuple[int, int]) -> Document:
    """A lattice of points on the ground."""
    return {"body": "ground", "grid": {"lattice": {"from": list(low), "to": list(high), "count": list(count)}}}


def joint(name: str, what: str = "joint_force") -> Document:
    """The response of a joint."""
    return {what: {"joint": name}}


def largest(response: Document, **more: Any) -> Document:
    """Its largest value over time."""
    return {"response": response, "over_time": "max", **more}


@dataclass(frozen=True)
class Candidates:
    """What a linkage may be tied with: points and groups of members, by name, and rows on their volume."""

    points: Document
    members: Document
    volumes: Sequence[Document]


def document(
    linkage: Linkage,
    title: str,
    candidates: Candidates,
    objectives: Sequence[str],
    limits: Mapping[str, float],
    **more: Any,
) -> Document:
    """The case document of a linkage with candidate members; objectives, limits: forces, named as in `_limits`."""
    return {
        "format": 1,
        "title": title,
        "gravity": [0, -9.81],
        "time": {"end": round(linkage.turns * 2.0 * np.pi / linkage.speed, 12)},
        "bodies": linkage.bodies(),
        "joints": linkage.joints(),
        "motions": [{"body": linkage.driven, "angle": {"velocity": linkage.speed}}],
        "points": candidates.points,
        "members": candidates.members,
        "design": {"initial": 0.3, "lower": 0.0, "upper": 1.0},
        "objectives": _objectives(objectives),
        "constraints": [*candidates.volumes, *_limits(limits)],
        "optimizer": {"max_iterations": 200},
        **more,
    }


def _spring(stiffness: float, **more: float) -> Document:
    return {"type": "spring", "stiffness": stiffness, **more}


def _limits(limits: Mapping[str, float], **more: Any) -> list[Document]:
    """Limits on forces: of joints by their capital letters, of groups of members by their names."""
    rows = []
    for name, limit in limits.items():
        joint_load = name.split("/")
        response = joint(joint_load[0]) if name[0].isupper() else {"member_force": {"group": name}}
        row = largest(response, limit=limit, **more)
        rows.append(row if len(joint_load) == 1 else {**row, "load_case": joint_load[1]})
    return rows


def _objectives(names: Sequence[str]) -> Document:
    return {f"F{i}": {k: v for k, v in row.items() if k != "limit"} for i, row in
            enumerate(_limits(dict.fromkeys(names, 0.0)), 1)}  # fmt: skip


def four_bar(objectives: Sequence[str], limits: Mapping[str, float], fraction: float = 0.3, **more: Any) -> Document:
    """45 springs from the ground to the coupler and, taut from the start, to the rocker."""
    own = FOUR_BAR
    points = {
        "coupler": on_link(own, "coupler", 3),
        "rocker": on_link(own, "rocker", 2),
        "anchors": anchors((-0.3, -0.4), (1.1, 1.0), (3, 3)),
    }
    members = {
        "springs": {"from": "anchors", "to": "coupler", "law": _spring(300)},
        "taut": {"from": "anchors", "to": "rocker", "min_length": 0.1, "law": _spring(300, free_length=0.3)},
    }
    candidates = Candidates(points, members, [{"volume": "all", "fraction": fraction}])
    return document(own, "Driven four-bar", candidates, objectives, limits, **more)


def slider_crank(objectives: Sequence[str], limits: Mapping[str, float], **more: Any) -> Document:
    """32 springs from the ground to the rod."""
    own = SLIDER_CRANK
    points = {"rod": on_link(own, "rod", 4), "anchors": anchors((-0.4, -0.4), (0.9, 0.4), (4, 2))}
    members = {"springs": {"from": "anchors", "to": "rod", "law": _spring(400)}}
    candidates = Candidates(points, members, [{"volume": "all", "fraction": 0.3}])
    return document(own, "Driven slider-crank", candidates, objectives, limits, **more)


def watt(objectives: Sequence[str], limits: Mapping[str, float], **more: Any) -> Document:
    """42 springs from the ground to coupler, lever and rocker of Watt's second chain; the material is spent."""
    own = WATT
    points = {
        "coupler": on_link(own, "coupler", 2),
        "rocker": on_link(own, "rocker", 2, (1, 2)),
        "lever": on_link(own, "lever", 3),
        "anchors": anchors((-0.2, -0.5), (1.6, 1.0), (3, 2)),
    }
    members = {
        "springs": {"from": "anchors", "to": "coupler", "law": _spring(200)},
        "levers": {"from": "anchors", "to": "lever", "min_length": 0.1, "law": _spring(200)},
        "rockers": {"from": "anchors", "to": "rocker", "law": _spring(200, free_length=0.4)},
    }
    candidates = Candidates(points, members, [{"volume": "all", "equals": 12}])
    return document(own, "Watt's six-bar", candidates, objectives, limits, **more)


def watt_floating(objectives: Sequence[str], limits: Mapping[str, float], **more: Any) -> Document:
    """34 springs: from the ground to coupler and rod of Watt's first chain, and between coupler and lever."""
    own = WATT_FLOATING
    points = {
        "coupler": on_link(own, "coupler", 2),
        "rod": on_link(own, "rod", 3),
        "lever": on_link(own, "lever", 2),
        "anchors": anchors((-0.3, -0.3), (1.2, 1.3), (3, 2)),
    }
    members = {
        "springs": {"from": "anchors", "to": "coupler", "law": _spring(200)},
        "rods": {"from": "anchors", "to": "rod", "law": _spring(200)},
        "cross": {"from": "coupler", "to": "lever", "law": _spring(300, free_length=0.3)},
    }
    candidates = Candidates(points, members, [{"volume": "all", "fraction": 0.4}, {"volume": ["cross"], "limit": 2}])
    return document(own, "Watt's six-bar, floating", candidates, objectives, limits, **more)


def stephenson(objectives: Sequence[str], limits: Mapping[str, float], **more: Any) -> Document:
    """42 springs from the ground to coupler, rod and lever of Stephenson's third chain."""
    own = STEPHENSON
    points = {
        "coupler": on_link(own, "coupler", 2),
        "rod": on_link(own, "rod", 3),
        "lever": on_link(own, "lever", 2),
        "anchors": anchors((-0.3, -0.3), (1.2, 1.3), (3, 2)),
    }
    members = {
        "springs": {"from": "anchors", "to": "coupler", "law": _spring(200)},
        "rods": {"from": "anchors", "to": "rod", "law": _spring(200)},
        "levers": {"from": "anchors", "to": "lever", "min_length": 0.05, "law": _spring(300)},
    }
    candidates = Candidates(points, members, [{"volume": "all", "fraction": 0.3}])
    return document(own, "Stephenson's six-bar", candidates, objectives, limits, **more)


def six_bar_slider(objectives: Sequence[str], limits: Mapping[str, float], **more: Any) -> Document:
    """40 springs from the ground to coupler and rod of a four-bar that pushes a slider."""
    own = SIX_BAR_SLIDER
    points = {
        "coupler": on_link(own, "coupler", 2),
        "rod": on_link(own, "rod", 3),
        "anchors": anchors((-0.4, -0.3), (1.3, 1.3), (4, 2)),
    }
    members = {
        "springs": {"from": "anchors", "to": "coupler", "law": _spring(200)},
        "rods": {"from": "anchors", "to": "rod", "law": _spring(200)},
    }
    candidates = Candidates(points, members, [{"volume": "all", "fraction": 0.3}])
    return document(own, "Six-bar with a slider", candidates, objectives, limits, **more)
