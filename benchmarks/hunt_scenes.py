"""Random mixed scenes as case documents, and the same scenes seen differently: moved, turned, mirrored, renamed.

All bodies begin unturned, and everything is drawn in one order of random numbers, so that a change (`Change`) of the
way in which a scene is written leaves the scene itself what it was.
"""

from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np

from mdstopo.case.methods.over_time import REDUCTIONS

#: laws that some parameter of can vary, and which
VARIED = {
    "spring": ("stiffness", "preload"),
    "gap": ("stiffness", "gap"),
    "cubic": ("stiffness", "cubic"),
    "pulse": ("peak", "rate", "time"),
    "actuator": ("proportional", "derivative", "target"),
    "crush": ("stiffness", "force", "gap"),
    "inerter": ("inertance",),
}
LAWS = ("spring", "damped", "gap", "stop", "cubic", "curve", "pulse", "table", "actuator", "limited", "inerter", "two")
REDUCTION_NAMES = tuple(REDUCTIONS)
#: the end of every scene, s
END = 0.8


@dataclass(frozen=True)
class Change:
    """Another way to write the same scene: units of force (and with it of mass), a place, a turn, a mirror, names."""

    force: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0
    mirror: bool = False
    swap: bool = False
    prefix: str = ""

    def vector(self, x: float, y: float) -> list[float]:
        """A direction of the scene."""
        y = -y if self.mirror else y
        return [cos(self.turn) * x - sin(self.turn) * y, sin(self.turn) * x + cos(self.turn) * y]

    def point(self, x: float, y: float) -> list[float]:
        """A place of the scene."""
        u, v = self.vector(x, y)
        return [u + self.shift[0], v + self.shift[1]]

    def spin(self, w: float) -> float:
        """What turns counter-clockwise."""
        return -w if self.mirror else w

    def name(self, body: str) -> str:
        """A body's (or a group's) name."""
        return body if body == "ground" else self.prefix + body


CHANGES = {
    "moved by (3, -2) m": Change(shift=(3.0, -2.0)),
    "turned by 0.7": Change(turn=0.7),
    "mirrored": Change(mirror=True),
    "ends swapped": Change(swap=True),
    "renamed": Change(prefix="other_"),
    "in sevenths of a newton": Change(force=7.0),
}


def scene(seed: int, change: Change = Change()) -> dict[str, Any]:
    """The document of a random scene."""
    rng = np.random.default_rng(seed)

    def draw(low: float, high: float) -> float:
        return float(np.round(rng.uniform(low, high), 6))

    count = int(rng.integers(1, 4))
    names = [f"b{i}" for i in range(count)]
    places = {"ground": (0.0, 0.0)} | {
        name: (1.3 * i + draw(-0.2, 0.2), draw(-0.4, 0.4)) for i, name in enumerate(names)
    }
    document: dict[str, Any] = {"format": 1, "gravity": change.vector(0.0, -9.81), "time": {"end": END}}
    document["bodies"] = {}
    for name in names:
        velocity, spin = (draw(-1.0, 1.0), draw(-1.0, 1.0)), draw(-1.0, 1.0)
        document["bodies"][change.name(name)] = {
            "mass": change.force * draw(0.5, 4.0),
            "inertia": change.force * draw(0.1, 1.0),
            "position": change.point(*places[name]),
            "velocity": change.vector(*velocity),
            "angular_velocity": change.spin(spin),
        }
    _held(document, names, places, rng, draw, change)
    _groups(document, names, places, rng, draw, change)
    levels = [draw(-8.0, 8.0) * change.force for _ in range(4)]
    if rng.random() < 0.5:
        rows = [[t, change.spin(level)] for t, level in zip((0.0, 0.2, 0.5, END), levels, strict=True)]
        document["loads"] = [{"body": change.name(names[-1]), "moment": {"table": rows}}]
    more = Source(np.random.default_rng([seed, 1]))
    if more.rng.random() < 0.35:
        _contacts(document, names, places, more, change)
    if more.rng.random() < 0.25:
        _legs(document, names, places, more, change)
    if more.rng.random() < 0.4:
        vary_parameters(document, more, change)
    _objectives(document, names, places, rng, draw, change)
    return document


class Source:
    """Random numbers of what was added to scenes later: they leave what older seeds drew as it was."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def __call__(self, low: float, high: float) -> float:
        """A number with six decimal places."""
        return float(np.round(self.rng.uniform(low, high), 6))


def _contacts(document: dict[str, Any], names: list[str], places: Any, draw: Source, change: Change) -> None:
    """Points of a body above an edge of the ground, or of another body, some of them beside it."""
    chain = ["ground", *names]
    falls, holds = draw.rng.choice(len(chain), 2, replace=False).tolist()
    if falls == 0 or draw.rng.random() < 0.6:
        falls, holds = falls or holds, 0
    x, y = places[chain[falls]]
    feet = [(x + draw(-0.4, 0.4), y - draw(0.1, 0.4)) for _ in range(int(draw.rng.integers(1, 3)))]
    low = min(foot[1] for foot in feet) - draw(0.02, 0.3)
    left, right, rise = x - draw(0.3, 1.5), x + draw(0.3, 1.5), draw(-0.02, 0.02)
    # left of the way from left to right is above; mirrored, it is so on the way back
    edge = [change.point(left, low - rise), change.point(right, low)]
    begin, end = edge[::-1] if change.mirror else edge
    document.setdefault("points", {})["feet"] = {
        "body": change.name(chain[falls]), "grid": {"list": [change.point(*foot) for foot in feet]}
    }  # fmt: skip
    contact = {
        "name": "floor",
        "points": "feet",
        "on": {"body": change.name(chain[holds]), "from": begin, "to": end},
        "stiffness": change.force * draw(300.0, 3000.0),
        "damping": change.force * draw(2.0, 30.0),
        "friction": draw(0.1, 0.5) if draw.rng.random() < 0.6 else 0.0,
        "slip": draw(0.05, 0.3),
    }
    if draw.rng.random() < 0.3:
        contact["damping"] = 0.0
    document["contacts"] = [contact]


def _legs(document: dict[str, Any], names: list[str], places: Any, draw: Source, change: Change) -> None:
    """A group that is crushed for good."""
    chain = ["ground", *names]
    a, b = sorted(draw.rng.choice(len(chain), 2, replace=False).tolist())
    members = int(draw.rng.integers(1, 3))
    x, y = places[chain[b]]
    ends: list[list[list[float]]] = [[], []]
    for _ in range(members):
        near, way, length = (x + draw(-0.4, 0.4), y + draw(-0.4, 0.4)), draw(0.0, 6.28), draw(0.8, 1.6)
        ends[0].append(change.point(near[0] + length * cos(way), near[1] + length * sin(way)))
        ends[1].append(change.point(*near))
    points = document.setdefault("points", {})
    points["top"] = {"body": change.name(chain[a]), "grid": {"list": ends[0]}}
    points["foot"] = {"body": change.name(chain[b]), "grid": {"list": ends[1]}}
    stiffness, force = change.force * draw(200.0, 1500.0), change.force * draw(4.0, 25.0)
    law = {"type": "crush", "stiffness": stiffness, "force": force, "gap": draw(0.0, 0.05)}
    law["side"] = "tension" if draw.rng.random() < 0.5 else "compression"
    way_from, way_to = ("foot", "top") if change.swap else ("top", "foot")
    document["members"][change.prefix + "legs"] = {"from": way_from, "to": way_to, "connect": "pairs", "law": law}


def vary_parameters(document: dict[str, Any], draw: Source, change: Change) -> None:
    """Parameters of laws that are design variables, at the values that the laws have."""
    groups = [name for name, group in document["members"].items() if isinstance(group["law"], dict)]
    found: dict[str, Any] = {}
    for name in draw.rng.permutation(groups)[:2].tolist():
        law = document["members"][name]["law"]
        there = [parameter for parameter in VARIED.get(law["type"], ()) if law.get(parameter, 0.0) != 0.0]
        if not there:
            continue
        parameter = str(draw.rng.choice(there))
        value = law[parameter]
        row = {"group": name, "parameter": parameter, "lower": 0.5 * value, "upper": 1.5 * value}
        if draw.rng.random() < 0.4:
            row["each"] = "member"
        found[f"{change.prefix}of_{parameter}_{len(found)}"] = row
    if found:
        document["design"]["variables"] = found


def _held(document: dict[str, Any], names: list[str], places: Any, rng: Any, draw: Any, change: Change) -> None:
    """Joints between bodies in a row, or one of them driven."""
    joints = []
    chain = ["ground", *names]
    kinds = rng.choice(["none", "none", "revolute", "distance", "prismatic"], size=len(names))
    driven = rng.random() < 0.2
    for i, kind in enumerate(kinds):
        first, second = chain[i], chain[i + 1]
        x, y = places[second]
        x, y = x - draw(0.2, 0.5), y + draw(-0.3, 0.3)
        u, v = draw(0.3, 0.9), draw(-0.6, 0.6)
        if kind == "none" or (driven and second == names[0]):
            continue
        bodies = [change.name(first), change.name(second)]
        row: dict[str, Any] = {"name": f"j{i}", "type": str(kind), "bodies": bodies}
        if kind == "distance":
            row["at"] = [change.point(x - u, y + v), change.point(x, y)]
        else:
            row["at"] = change.point(x, y)
        if kind == "prismatic":
            row["axis"] = change.vector(u, v)
        joints.append(row)
    if joints:
        document["joints"] = joints
        for body in document["bodies"].values():  # what is jointed starts from rest
            body["velocity"], body["angular_velocity"] = [0.0, 0.0], 0.0
    if driven:
        rows = [(t, draw(-5.0, 5.0), draw(-5.0, 5.0), draw(-3.0, 3.0)) for t in (0.0, 0.3, END)]
        ahead = [[t, *change.vector(x, y), change.spin(w)] for t, x, y, w in rows]
        tables = [{"acceleration": {"table": [[row[0], row[i]] for row in ahead]}} for i in (1, 2, 3)]
        document["motions"] = [{"body": change.name(names[0]), **dict(zip(("x", "y", "angle"), tables, strict=True))}]


def random_law(kind: str, draw: Any, force: float) -> Any:
    """A law of the format; force: the unit."""
    k, c, f = force * draw(20.0, 120.0), force * draw(0.5, 4.0), force * draw(3.0, 12.0)
    gap, side, free = draw(0.01, 0.1), "tension" if draw(0.0, 1.0) < 0.5 else "compression", draw(0.1, 0.7)
    match kind:
        case "spring":
            return {"type": "spring", "stiffness": k, "preload": 0.3 * f}
        case "damped":
            return {"type": "spring", "stiffness": k, "damping": c}
        case "gap":
            return {"type": "gap", "stiffness": k, "gap": gap, "side": side}
        case "stop":
            return {"type": "gap", "stiffness": k, "damping": c, "gap": gap, "side": side, "clip": free < 0.4}
        case "cubic":
            return {"type": "cubic", "stiffness": k, "cubic": 10.0 * k}
        case "curve":
            heights = np.cumsum([f, 0.5 * f, 0.2 * k * gap, k * free, 0.3 * k * free])
            rows = [-0.5, -0.2, 0.0, 0.5 * free, free]
            return {"type": "curve", "curve": [[x, float(h - heights[2])] for x, h in zip(rows, heights, strict=True)]}
        case "pulse":
            return {"type": "pulse", "peak": f, "rate": 60.0, "time": free}
        case "table":
            return {"type": "table", "table": [[0.0, 0.2 * f], [free, f], [END, -0.5 * f]]}
        case "actuator":
            return {"type": "actuator", "proportional": k, "derivative": c, "target": gap}
        case "limited":
            return {"type": "actuator", "proportional": k, "derivative": c, "target": gap, "limit": f}
        case "inerter":
            return {"type": "inerter", "inertance": 0.3 * c}
    return [{"type": "spring", "stiffness": k, "damping": c}, {"type": "table", "table": [[0.0, f], [END, 0.0]]}]


def _groups(document: dict[str, Any], names: list[str], places: Any, rng: Any, draw: Any, change: Change) -> None:
    document["members"] = {}
    chain = ["ground", *names]
    for i in range(int(rng.integers(2, 4))):
        a, b = sorted(rng.choice(len(chain), 2, replace=False).tolist())
        kind = "damped" if i == 0 else str(rng.choice(LAWS))
        members = int(rng.integers(1, 4))
        middle = places[chain[b]]
        ends: list[list[list[float]]] = [[], []]
        for _ in range(members):
            near = (middle[0] + draw(-0.5, 0.5), middle[1] + draw(-0.5, 0.5))
            way = draw(0.0, 6.28)
            length = draw(0.8, 2.0)
            ends[0].append(change.point(near[0] + length * cos(way), near[1] + length * sin(way)))
            ends[1].append(change.point(*near))
        first, second = ({"body": change.name(chain[n]), "grid": {"list": ends[s]}} for s, n in ((0, a), (1, b)))
        points = document.setdefault("points", {})
        points[f"p{i}"], points[f"q{i}"] = first, second
        way_from, way_to = (f"q{i}", f"p{i}") if change.swap else (f"p{i}", f"q{i}")
        law = random_law(kind, draw, change.force)
        document["members"][change.prefix + f"g{i}"] = {"from": way_from, "to": way_to, "connect": "pairs", "law": law}
    document["design"] = {"initial": 0.7, "lower": 0.01, "power": 1.5 if rng.random() < 0.3 else 1}


def _objectives(document: dict[str, Any], names: list[str], places: Any, rng: Any, draw: Any, change: Change) -> None:
    body = names[int(rng.integers(len(names)))]
    at = change.point(places[body][0] + draw(-0.3, 0.3), places[body][1] + draw(-0.3, 0.3))
    body = change.name(body)
    groups = list(document["members"])
    held = [joint["name"] for joint in document.get("joints", []) if joint["type"] != "prismatic"]
    choices: list[Any] = [
        "energy",
        {"displacement": {"body": body, "at": at}},
        {"velocity": {"body": body, "at": at}},
        {"acceleration": {"body": body, "at": at}},
        {"angle": {"body": body}},
        {"angular_velocity": {"body": body}},
        *({"member_force": {"group": group}} for group in groups),
        *({"joint_force": {"joint": joint}} for joint in held),
    ]
    document["objectives"] = {}
    for i, place in enumerate(rng.permutation(len(choices))[:3].tolist()):
        response = choices[place]
        signed = isinstance(response, dict) and ("angle" in response or "angular_velocity" in response)
        over_time = str(rng.choice(("max_abs", "rms") if signed else REDUCTION_NAMES))
        document["objectives"][f"R{i}"] = {"response": response, "over_time": over_time}
    names_of = list(document["objectives"])
    document["combine"] = {"weights": dict.fromkeys(names_of, 1.0), "normalize": False}
