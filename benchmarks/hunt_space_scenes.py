"""Random mixed scenes in space as case documents, and the same scenes moved, turned, mirrored, renamed.

A scene is drawn as it stands (`scene`); `rewritten` makes another document of it, key by key. A mirror turns vectors
over one axis and what turns (angular velocities, moments) over the other two, body axes too.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.hunt_model import Vector
from benchmarks.hunt_scenes import END, LAWS, REDUCTION_NAMES, Change, Source, random_law, vary_parameters
from benchmarks.hunt_space_model import SpatialModel

JOINTS = ("spherical", "revolute", "universal", "prismatic", "cylindrical", "planar", "fixed", "distance")
SURFACES = ("plane", "rectangle", "sphere", "cylinder", "bowl", "pipe")
#: joints that transmit a moment
WITH_MOMENT = ("revolute", "universal", "prismatic", "cylindrical", "planar", "fixed")
KINDS = ("displacement", "velocity", "acceleration", "rotation", "angular_velocity", "angular_acceleration", "tilt")


@dataclass(frozen=True)
class SpatialChange:
    """Another way to write the same scene: units of force (and of mass), a place, a turn, a mirror of x, names."""

    force: float = 1.0
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mirror: bool = False
    swap: bool = False
    prefix: str = ""

    @property
    def axes(self) -> bool:
        """Whether global axes are others, so that components along them are."""
        return self.mirror or any(self.turn)


CHANGES = {
    "moved by (3, -2, 1) m": SpatialChange(shift=(3.0, -2.0, 1.0)),
    "turned": SpatialChange(turn=(0.4, -1.1, 0.7)),
    "mirrored": SpatialChange(mirror=True),
    "ends swapped": SpatialChange(swap=True),
    "renamed": SpatialChange(prefix="other_"),
    "in sevenths of a newton": SpatialChange(force=7.0),
}


class Drawing:
    """A document in the making: names and places of its bodies, and random numbers."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 3])
        self.draw = Source(self.rng)
        self.names = [f"b{i}" for i in range(int(self.rng.integers(1, 4)))]
        self.chain = ["ground", *self.names]
        self.places = {"ground": [0.0, 0.0, 0.0]} | {
            name: [1.3 * i + self.draw(-0.2, 0.2), *self.vector(0.4, 2)] for i, name in enumerate(self.names)
        }
        self.document: dict[str, Any] = {
            "format": 1,
            "dimension": 3,
            "gravity": [0.0, 0.0, -9.81],
            "time": {"end": END},
        }

    def vector(self, size: float, count: int = 3) -> list[float]:
        """Components between -size and size."""
        return [self.draw(-size, size) for _ in range(count)]

    def unit(self) -> Vector:
        """A direction."""
        found = self.rng.normal(size=3)
        return np.asarray(found / np.linalg.norm(found))

    def chance(self, share: float) -> bool:
        """True in this share of cases."""
        return bool(self.rng.random() < share)

    def near(self, body: str, size: float) -> list[float]:
        """A place about a body."""
        return [float(np.round(c + d, 6)) for c, d in zip(self.places[body], self.vector(size), strict=True)]

    def pick(self, choices: Any) -> Any:
        """One of several."""
        return choices[int(self.rng.integers(len(choices)))]


def scene(seed: int, change: SpatialChange = SpatialChange()) -> dict[str, Any]:
    """The document of a random scene."""
    d = Drawing(seed)
    _bodies(d)
    _joints(d)
    _groups(d)
    _loads(d)
    if d.chance(0.35):
        _contacts(d)
    if d.chance(0.3):
        _bushing(d)
    if d.chance(0.4):
        vary_parameters(d.document, d.draw, Change())
    _objectives(d)
    _start(d.document)
    return rewritten(d.document, change)


def _bodies(d: Drawing) -> None:
    d.document["bodies"] = {}
    fast = d.chance(0.25)
    for name in d.names:
        a, b = d.draw(0.1, 0.8), d.draw(0.1, 0.8)
        # no principal moment is larger than the sum of the others; with share 1 the body is flat
        c = abs(a - b) + (a + b - abs(a - b)) * (1.0 if d.chance(0.15) else d.draw(0.1, 0.95))
        axes = Rotation.from_rotvec(d.vector(3.0)).as_matrix()
        tensor = axes @ np.diag([a, b, c * (1.0 - 1e-12)]) @ axes.T
        d.document["bodies"][name] = {
            "mass": d.draw(0.5, 4.0),
            "inertia": [a, b, c] if d.chance(0.3) else (0.5 * (tensor + tensor.T)).tolist(),
            "position": d.places[name],
            "orientation": {"quaternion": np.roll(Rotation.from_rotvec(d.vector(3.0)).as_quat(), 1).tolist()},
            "velocity": d.vector(1.0),
            "angular_velocity": d.vector(12.0 if fast else 1.5),
        }


def _joints(d: Drawing) -> None:
    """Joints between bodies in a row, or one of them driven."""
    joints = []
    driven = d.chance(0.2)
    for i, (first, second) in enumerate(zip(d.chain, d.names, strict=False)):
        kind = d.pick(("none", *JOINTS)) if d.chance(0.7) else "none"
        if kind == "none" or (driven and second == d.names[0]):
            continue
        at = d.near(second, 0.5)
        row: dict[str, Any] = {"name": f"j{i}", "type": kind, "bodies": [first, second]}
        row["at"] = [(np.array(at) + d.draw(0.3, 0.9) * d.unit()).tolist(), at] if kind == "distance" else at
        if kind == "universal":
            one = d.unit()
            two = np.cross(one, d.unit())
            row["axes"] = [one.tolist(), (two / np.linalg.norm(two)).tolist()]
        elif kind in ("revolute", "prismatic", "cylindrical"):
            row["axis"] = d.unit().tolist()
        elif kind == "planar":
            row["normal"] = d.unit().tolist()
        joints.append(row)
    if joints:
        d.document["joints"] = joints
    if driven:
        _motion(d, d.names[0])


def _motion(d: Drawing, name: str) -> None:
    times = (0.0, 0.3, END)

    def ahead(size: float) -> dict[str, Any]:
        return {"acceleration": {"table": [[t, d.draw(-size, size)] for t in times]}}

    motion: dict[str, Any] = {"body": name} | {key: ahead(5.0) for key in ("x", "y", "z")}
    spin = d.document["bodies"][name]["angular_velocity"]
    kind = d.pick(("axis", "angles", "table"))
    if kind == "axis":
        axis, rate = d.unit(), d.draw(-2.0, 2.0)
        motion["rotation"] = {"axis": axis.tolist(), **ahead(8.0)}
        d.document["bodies"][name]["angular_velocity"] = (rate * axis).tolist()
    elif kind == "angles":
        motion["rotation"] = {key: ahead(6.0) for key in ("roll", "pitch", "yaw")}
    else:
        motion["rotation"] = {"angular_velocity": {"table": [[0.0, *spin], *([t, *d.vector(4.0)] for t in times[1:])]}}
    d.document["motions"] = [motion]


def _groups(d: Drawing) -> None:
    d.document["members"], d.document["points"] = {}, {}
    for i in range(int(d.rng.integers(2, 4))):
        a, b = sorted(d.rng.choice(len(d.chain), 2, replace=False).tolist())
        kind = "damped" if i == 0 else str(d.pick((*LAWS, "crush")))
        ends: list[list[list[float]]] = [[], []]
        for _ in range(int(d.rng.integers(1, 4))):
            near = d.near(d.chain[b], 0.5)
            ends[0].append((np.array(near) + d.draw(0.8, 2.0) * d.unit()).tolist())
            ends[1].append(near)
        for end, body, places in zip("pq", (a, b), ends, strict=True):
            d.document["points"][f"{end}{i}"] = {"body": d.chain[body], "grid": {"list": places}}
        law = _crush(d) if kind == "crush" else random_law(kind, d.draw, 1.0)
        d.document["members"][f"g{i}"] = {"from": f"p{i}", "to": f"q{i}", "connect": "pairs", "law": law}
    d.document["design"] = {"initial": 0.7, "lower": 0.01, "power": 1.5 if d.chance(0.3) else 1}


def _crush(d: Drawing) -> dict[str, Any]:
    law = {"type": "crush", "stiffness": d.draw(200.0, 1500.0), "force": d.draw(4.0, 25.0), "gap": d.draw(0.0, 0.05)}
    return law | {"side": "tension" if d.chance(0.5) else "compression"}


def _loads(d: Drawing) -> None:
    loads: list[dict[str, Any]] = []
    if d.chance(0.5):
        rows = [[t, *d.vector(5.0)] for t in (0.0, 0.2, 0.5, END)]
        loads.append({"body": d.names[-1], "moment": {"table": rows}})
    if d.chance(0.4):
        body = d.pick(d.names)
        loads.append({"body": body, "force": d.vector(6.0), "at": d.near(body, 0.4), "moment": d.vector(2.0)})
    if d.chance(0.4):
        load = {"body": d.pick(d.names), "force": d.vector(6.0), "at": d.vector(0.4), "moment": d.vector(2.0)}
        loads.append(load | {"frame": "body"})
    if d.chance(0.3):
        load = {"body": d.pick(d.names), "acceleration": d.vector(3.0), "angular_acceleration": d.vector(5.0)}
        loads.append(load)
    if loads:
        d.document["loads"] = loads


def _contacts(d: Drawing) -> None:
    """Points of a body a little way from a surface of the ground, or of another body, some beyond its ends."""
    falls = d.pick(d.names)
    others = [name for name in d.names if name != falls]
    holds = d.pick(others) if others and d.chance(0.3) else "ground"
    normal = np.array([0.0, 0.0, 1.0]) + np.array(d.vector(0.3))
    normal /= np.linalg.norm(normal)
    centre = np.array(d.places[falls])
    feet = [centre - d.draw(0.1, 0.4) * normal + np.array(d.vector(0.3)) for _ in range(int(d.rng.integers(1, 3)))]
    low = min(float(normal @ foot) for foot in feet) - d.draw(0.01, 0.2)
    at = centre + (low - float(normal @ centre)) * normal
    kind = d.pick(SURFACES)
    axis = np.cross(normal, d.unit())
    axis /= np.linalg.norm(axis)
    reach = max(float(np.linalg.norm(foot - centre)) for foot in feet)
    radius = d.draw(0.4, 1.0)
    if kind in ("bowl", "pipe"):  # inside of what is large enough to hold all the points at the start
        radius, around = reach + d.draw(0.02, 0.3), {"hollow": True}
        middle = centre
    else:
        around = {}
        middle = centre - (reach + radius + d.draw(0.01, 0.1)) * normal
    ends = [(middle + sign * d.draw(0.3, 1.5) * axis).tolist() for sign in (-1.0, 1.0)]
    surface: dict[str, Any] = {
        "plane": {"plane": {"at": at.tolist(), "normal": normal.tolist()}},
        "rectangle": {"rectangle": {
            "center": (at + 0.3 * d.draw(-1.0, 1.0) * axis).tolist(),
            "axes": [axis.tolist(), np.cross(normal, axis).tolist()],
            "size": [d.draw(0.6, 3.0), d.draw(0.6, 3.0)],
        }},
        "sphere": {"sphere": {"center": middle.tolist(), "radius": radius, **around}},
        "cylinder": {"cylinder": {"from": ends[0], "to": ends[1], "radius": radius, **around}},
    }[{"bowl": "sphere", "pipe": "cylinder"}.get(kind, kind)]  # fmt: skip
    d.document["points"]["feet"] = {"body": falls, "grid": {"list": [foot.tolist() for foot in feet]}}
    d.document["contacts"] = [{
        "name": "floor", "points": "feet", "on": {"body": holds, **surface}, "stiffness": d.draw(300.0, 3000.0),
        "damping": d.draw(2.0, 30.0) if d.chance(0.7) else 0.0,
        "friction": d.draw(0.1, 0.5) if d.chance(0.6) else 0.0, "slip": d.draw(0.05, 0.3),
    }]  # fmt: skip


def _bushing(d: Drawing) -> None:
    i = int(d.rng.integers(len(d.names)))
    stiffness = [*(d.draw(20.0, 200.0) for _ in range(3)), *(d.draw(1.0, 10.0) for _ in range(3))]
    damping = [*(d.draw(0.0, 3.0) for _ in range(3)), *(d.draw(0.0, 0.3) for _ in range(3))]
    bodies = [d.names[i], d.chain[i]]  # along the axes of a body, which turn with the scene
    row = {"bodies": bodies, "at": d.near(d.names[i], 0.4), "stiffness": stiffness, "damping": damping}
    d.document["bushings"] = [row]


def _objectives(d: Drawing) -> None:
    groups, joints = list(d.document["members"]), d.document.get("joints", [])
    choices: list[Any] = ["energy", *({"member_force": {"group": group}} for group in groups)]
    choices += [{"joint_force": {"joint": joint["name"]}} for joint in joints]
    choices += [{"joint_moment": {"joint": joint["name"]}} for joint in joints if joint["type"] in WITH_MOMENT]
    for kind in KINDS:
        body = d.pick(d.names)
        keys: dict[str, Any] = {"body": body}
        if d.chance(0.5):
            others = [name for name in d.names if name != body]
            keys |= {"relative_to": d.pick(others)} if others else {}
        if kind == "tilt":
            keys["axis"] = d.unit().tolist()
        else:
            keys["component"] = d.pick(("x", "y", "z", "norm", "norm", "norm"))
        if kind in KINDS[:3]:
            keys["at"] = d.near(body, 0.3)
        choices.append({kind: keys})
    d.document["objectives"] = {
        f"R{i}": {"response": choices[place], "over_time": str(d.pick(REDUCTION_NAMES))}
        for i, place in enumerate(d.rng.permutation(len(choices))[:4].tolist())
    }
    _combine(d.document)


def _combine(document: dict[str, Any]) -> None:
    document["combine"] = {"weights": dict.fromkeys(document["objectives"], 1.0), "normalize": False}


def _start(document: dict[str, Any]) -> None:
    """Velocities at the start as near as joints let them be to those drawn."""
    model = SpatialModel(document, np.ones(100), _values(document))
    kept = {motion["body"] for motion in document.get("motions", [])}
    free = np.repeat([name not in kept for name in model.names], 6)
    rows = np.array([row for joint in model.joints for row, _ in model._rows_of(joint, model.q0, model.v0)])
    if len(rows):
        wrong = rows @ model.v0
        model.v0[free] -= np.linalg.pinv(rows[:, free]) @ wrong
    for name, v in zip(model.names, model.v0.reshape(-1, 6), strict=True):
        document["bodies"][name] |= {"velocity": v[:3].tolist(), "angular_velocity": v[3:].tolist()}


def _values(document: dict[str, Any]) -> dict[str, Vector]:
    rows = document["design"].get("variables", {})
    laws = {name: document["members"][row["group"]]["law"] for name, row in rows.items()}
    return {name: np.full(9, laws[name][row["parameter"]]) for name, row in rows.items()}


class Rewriter:
    """What becomes of vectors, turns and names by a change."""

    def __init__(self, change: SpatialChange) -> None:
        self.change = change
        self.mirror = np.diag([-1.0, 1.0, 1.0]) if change.mirror else np.eye(3)
        self.turn = Rotation.from_rotvec(change.turn).as_matrix()
        self.hand = -1.0 if change.mirror else 1.0

    def vector(self, v: Any) -> list[float]:
        """A direction of the scene."""
        return list((self.turn @ self.mirror @ np.array(v)).tolist())

    def point(self, p: Any) -> list[float]:
        """A place of the scene."""
        return list((np.array(self.vector(p)) + self.change.shift).tolist())

    def spin(self, w: Any) -> list[float]:
        """What turns."""
        return list((self.hand * np.array(self.vector(w))).tolist())

    def own(self, v: Any) -> list[float]:
        """A direction in body axes."""
        return list((self.mirror @ np.array(v)).tolist())

    def table(self, given: Any, rule: Any) -> Any:
        """A vector, or the rows of its table, by a rule."""
        if isinstance(given, dict):
            return {"table": [[row[0], *rule(row[1:])] for row in given["table"]]}
        return rule(given)

    def name(self, body: str) -> str:
        """A body's or a group's name."""
        return body if body == "ground" else self.change.prefix + body


def rewritten(document: dict[str, Any], change: SpatialChange) -> dict[str, Any]:
    """The same scene as another document; components along global axes are left out where those are others."""
    r = Rewriter(change)
    new = dict(document) | {"gravity": r.vector(document["gravity"])}
    new["bodies"] = {r.name(name): _body(body, r) for name, body in document["bodies"].items()}
    new["points"] = {
        name: {"body": r.name(row["body"]), "grid": {"list": [r.point(at) for at in row["grid"]["list"]]}}
        for name, row in document["points"].items()
    }
    new["members"] = {r.name(name): _member(row, r) for name, row in document["members"].items()}
    rules = {"joints": _joint, "loads": _load, "contacts": _contact, "bushings": _bush, "motions": _driven}
    new |= {key: [rule(row, r) for row in document[key]] for key, rule in rules.items() if key in document}
    variables = document["design"].get("variables", {})
    rows = {r.name(name): _variable(row, r) for name, row in variables.items()}
    new["design"] = document["design"] | ({"variables": rows} if rows else {})
    new["objectives"] = {
        name: row | {"response": _response(row["response"], r)}
        for name, row in document["objectives"].items()
        if not (change.axes and _along_axes(row["response"], change))
    }
    _combine(new)
    return new


def _along_axes(response: Any, change: SpatialChange) -> bool:
    """Whether a response is a component that a change makes another."""
    if not isinstance(response, dict):
        return False
    ((kind, keys),) = response.items()
    if kind == "tilt" or keys.get("component", "norm") == "norm":
        return False
    return change.mirror or "relative_to" not in keys


def _body(body: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    quaternion = np.roll(body["orientation"]["quaternion"], -1)
    turn = r.turn @ r.mirror @ Rotation.from_quat(quaternion).as_matrix() @ r.mirror
    inertia = np.array(body["inertia"])
    tensor = r.mirror @ inertia @ r.mirror if inertia.ndim == 2 else inertia
    return {
        "mass": r.change.force * body["mass"],
        "inertia": (r.change.force * tensor).tolist(),
        "position": r.point(body["position"]),
        "orientation": {"quaternion": np.roll(Rotation.from_matrix(turn).as_quat(), 1).tolist()},
        "velocity": r.vector(body["velocity"]),
        "angular_velocity": r.spin(body["angular_velocity"]),
    }


def _member(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    laws = row["law"] if isinstance(row["law"], list) else [row["law"]]
    found = [_in_units(law, r.change.force) for law in laws]
    ends = (row["to"], row["from"]) if r.change.swap else (row["from"], row["to"])
    law = found if isinstance(row["law"], list) else found[0]
    return row | {"from": ends[0], "to": ends[1], "law": law}


#: keys of laws that are forces, or forces per something
FORCES = frozenset(
    ("stiffness", "damping", "preload", "cubic", "peak", "proportional", "derivative", "limit", "inertance", "force")
)


def _in_units(law: dict[str, Any], force: float) -> dict[str, Any]:
    new = {key: force * value if key in FORCES else value for key, value in law.items()}
    for key in ("curve", "table"):
        if key in law:
            new[key] = [[x, force * f] for x, f in law[key]]
    return new


def _variable(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    factor = r.change.force if row["parameter"] in FORCES else 1.0
    return row | {"group": r.name(row["group"]), "lower": factor * row["lower"], "upper": factor * row["upper"]}


def _joint(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    at = [r.point(end) for end in row["at"]] if row["type"] == "distance" else r.point(row["at"])
    new = row | {"bodies": [r.name(body) for body in row["bodies"]], "at": at}
    for key in ("axis", "normal"):
        if key in row:
            new[key] = r.vector(row[key])
    if "axes" in row:
        new["axes"] = [r.vector(axis) for axis in row["axes"]]
    return new


def _load(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    own, unit = row.get("frame") == "body", r.change.force
    new = row | {"body": r.name(row["body"])}
    vector = r.own if own else r.vector
    turning = (lambda m: [r.hand * x for x in r.own(m)]) if own else r.spin
    for key, rule in (("force", vector), ("moment", turning)):
        if key in row:
            new[key] = r.table(row[key], lambda x, rule=rule: [unit * each for each in rule(x)])
    if "at" in row:
        new["at"] = r.own(row["at"]) if own else r.point(row["at"])
    if "acceleration" in row:
        new["acceleration"] = r.table(row["acceleration"], r.vector)
        new["angular_acceleration"] = r.table(row["angular_acceleration"], r.spin)
    return new


def _contact(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    on: dict[str, Any] = {"body": r.name(row["on"]["body"])}
    for shape, keys in row["on"].items():
        if shape == "body":
            continue
        new = dict(keys)
        new |= {key: r.point(keys[key]) for key in ("at", "center", "from", "to") if key in keys}
        if "normal" in keys:
            new["normal"] = r.vector(keys["normal"])
        if "axes" in keys:  # a mirror changes the hand of the two, which says which side is free
            order = (1, 0) if r.change.mirror else (0, 1)
            new["axes"] = [r.vector(keys["axes"][i]) for i in order]
            new["size"] = [keys["size"][i] for i in order]
        on[shape] = new
    unit = r.change.force
    return row | {"on": on, "stiffness": unit * row["stiffness"], "damping": unit * row["damping"]}


def _bush(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    scaled = {key: [r.change.force * value for value in row[key]] for key in ("stiffness", "damping")}
    return row | {"bodies": [r.name(body) for body in row["bodies"]], "at": r.point(row["at"])} | scaled


def _driven(row: dict[str, Any], r: Rewriter) -> dict[str, Any]:
    """Accelerations along axes; a turn by roll, pitch and yaw is of these global axes and stays as it is."""
    tables = [np.array(row[key]["acceleration"]["table"]) for key in ("x", "y", "z")]
    ahead = np.array([r.vector(each) for each in np.stack([table[:, 1] for table in tables], axis=1)])
    times = tables[0][:, 0]
    new = row | {"body": r.name(row["body"])}
    for i, key in enumerate(("x", "y", "z")):
        new[key] = {"acceleration": {"table": np.stack([times, ahead[:, i]], axis=1).tolist()}}
    turn = row["rotation"]
    if "axis" in turn:
        new["rotation"] = turn | {"axis": r.spin(turn["axis"])}
    elif "angular_velocity" in turn:
        new["rotation"] = {"angular_velocity": r.table(turn["angular_velocity"], r.spin)}
    return new


def _response(response: Any, r: Rewriter) -> Any:
    if not isinstance(response, dict):
        return response
    ((kind, keys),) = response.items()
    new = dict(keys)
    if "body" in keys:
        new["body"] = r.name(keys["body"])
    if "relative_to" in keys:
        new["relative_to"] = r.name(keys["relative_to"])
    if "group" in keys:
        new["group"] = r.name(keys["group"])
    if "at" in keys:
        new["at"] = r.point(keys["at"])
    if "axis" in keys:
        new["axis"] = r.vector(keys["axis"])
    return {kind: new}


def covariant(document: dict[str, Any], change: SpatialChange) -> bool:
    """Whether a scene can be written so: a turn by roll, pitch and yaw is one of certain axes."""
    angles = any("roll" in motion["rotation"] for motion in document.get("motions", []))
    return not (change.axes and angles)
