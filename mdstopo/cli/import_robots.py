"""Bodies and joints of URDF and MJCF files, as a case in space: bodies as they stand where all joints are at zero."""

import math
import re
import xml.etree.ElementTree as Xml
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.geometry.start_rotations import about_axis
from mdstopo.cli.import_points import ImportedError, mistakes_in
from mdstopo.shown import counted

Floats = NDArray[np.float64]
Plain = dict[str, Any]
#: density of MuJoCo's geoms without one, kg/m^3
DENSITY = 1000.0
_JOINTS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
_MJCF = {"hinge": "revolute", "slide": "prismatic", "ball": "spherical"}
#: what may stand in a body of MJCF, of which some says nothing about masses; other elements may hold bodies or shapes
_IN_BODY = ("body", "inertial", "joint", "freejoint", "geom", "site", "camera", "light")
#: settings of MuJoCo's compiler that change masses, each with the values that do not
_MASSES_AS_STATED = {
    "settotalmass": ("-1",), "boundmass": ("0",), "boundinertia": ("0",), "balanceinertia": ("false",),
    "inertiafromgeom": ("auto", "false"), "inertiagrouprange": ("0 5",),
}  # fmt: skip


@dataclass
class Frame:
    """A place (3,) in m, and a turn (3, 3), whose columns are the axes."""

    place: Floats = field(default_factory=lambda: np.zeros(3))
    turn: Floats = field(default_factory=lambda: np.eye(3))

    def __matmul__(self, inner: "Frame") -> "Frame":
        """The frame `inner`, which is given in this one."""
        return Frame(self.place + self.turn @ inner.place, self.turn @ inner.turn)


@dataclass
class Part:
    """A mass: kg, centre (3,) in m, inertia (3, 3) about it in kg m^2, all along global axes."""

    mass: float = 0.0
    centre: Floats = field(default_factory=lambda: np.zeros(3))
    inertia: Floats = field(default_factory=lambda: np.zeros((3, 3)))

    def __add__(self, other: "Part") -> "Part":
        """Both as one body, by Steiner's theorem."""
        mass = self.mass + other.mass
        if mass == 0.0:
            return Part()
        centre = (self.mass * self.centre + other.mass * other.centre) / mass
        inertia = sum((each.about(centre) for each in (self, other)), np.zeros((3, 3)))
        return Part(mass, centre, inertia)

    def about(self, point: Floats) -> Floats:
        """The inertia (3, 3) of the part about a point."""
        arm = self.centre - point
        return self.inertia + self.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


def _inertial(name: str, mass: float, frame: "Frame", tensor: Floats) -> Part:
    """The stated mass of a body, its inertia (3, 3) along the axes of a frame. ValueError where one is no number."""
    if not (np.isfinite(mass) and np.isfinite(tensor).all()):
        raise ValueError(f"body {name!r}: its mass or its inertia is no number")
    return Part(mass, frame.place, frame.turn @ tensor @ frame.turn.T)


@dataclass
class Tree:
    """Bodies and joints that were found in a file; told: remarks on what of the file is left out."""

    bodies: dict[str, Part] = field(default_factory=dict)
    joints: list[Plain] = field(default_factory=list)
    told: list[str] = field(default_factory=list)
    gravity: list[float] = field(default_factory=lambda: [0.0, 0.0, -9.81])

    def add(self, name: str, part: Part) -> None:
        """Take in a body of a name that no other one has."""
        if name in self.bodies:
            raise ValueError(f"two bodies have the name {name!r} in a case; give one of them another")
        self.bodies[name] = part

    def tell(self, sentence: str) -> None:
        """Note a remark for the user, once."""
        if sentence not in self.told:
            self.told.append(sentence)


def robot_in(path: Path, data: str, fixed: bool = False) -> tuple[Plain, list[str]]:
    """The case of a URDF or MJCF file as plain values, and sentences about what is left out.

    fixed: whether the first body is held to ground where the file does not say. Raises ImportedError.
    """
    try:
        root = Xml.fromstring(data)
    except Xml.ParseError as error:
        raise ImportedError(f"{path}: this is no XML: {error}") from None
    readers: dict[str, Callable[[Xml.Element, Path, bool], Tree]] = {"robot": _urdf, "mujoco": _mjcf}
    if root.tag not in readers:
        raise ImportedError(f"{path}: found <{root.tag}>, allowed is <robot> (URDF) or <mujoco> (MJCF)")
    with mistakes_in(f"{path}"):
        tree = readers[root.tag](root, path, fixed)
    if not tree.bodies:
        raise ImportedError(f"{path}: no body in it has a mass")
    for name, part in tree.bodies.items():
        least = float(np.linalg.eigvalsh(part.inertia).min())
        if part.mass < 0.0 or least < -1e-9 * np.abs(part.inertia).max():  # beyond rounding of turned parts
            found = f"the mass {part.mass:g} kg and the least moment of inertia {least:g} kg m^2"
            raise ImportedError(f"{path}: body {name!r}: found {found}; both have to be > 0")
        if part.mass == 0.0 or least <= 0.0:
            raise ImportedError(f"{path}: body {name!r} has no mass or no inertia, and moves by a joint of its own")
    content: Plain = {
        "format": 1,
        "title": root.get("name") or root.get("model") or path.stem,
        "dimension": 3,
        "gravity": tree.gravity,
        "time": {"end": 1},
        "bodies": {name: _body(part) for name, part in tree.bodies.items()},
    }
    return content | ({"joints": tree.joints} if tree.joints else {}), tree.told


def _body(part: Part) -> Plain:
    inertia = 0.5 * (part.inertia + part.inertia.T)
    return {"mass": part.mass, "inertia": _plain(inertia), "position": _plain(part.centre)}


def _plain(values: Floats) -> list[Any]:
    """Numbers without the dust of rounding."""
    size = float(np.abs(values).max(initial=0.0))
    kept: list[Any] = np.where(np.abs(values) > 1e-15 * size, values, 0.0).tolist()
    return kept


def as_name(text: str) -> str:
    """A text changed to a name that a case may have."""
    word = re.sub(r"[^A-Za-z0-9_-]", "_", text)
    return word if re.match(r"[A-Za-z_]", word) and word not in ("ground", "all", "default") else f"_{word}"


def _vector(text: str | None, default: str, count: int | None = 3) -> Floats:
    """Numbers between blanks; count: how many there have to be, None for any. Raises ValueError."""
    stated = text or default
    try:
        values = np.array([float(each) for each in stated.split()])
    except ValueError:
        raise ValueError(f"found {stated!r}, allowed are numbers") from None
    if count not in (None, len(values)):
        raise ValueError(f"found {stated!r}, allowed are {count} numbers")
    return values


def _euler(angles: Floats, order: str) -> Floats:
    """Turns about axes by the letters in `order`: small ones about axes that the turns before have turned."""
    turn = np.eye(3)
    for angle, letter in zip(angles.tolist(), order, strict=True):
        axis = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]["xyz".index(letter.lower())]
        own = about_axis(axis, angle)
        turn = turn @ own if letter.islower() else own @ turn
    return turn


# URDF


def _urdf(root: Xml.Element, path: Path, fixed: bool) -> Tree:
    links = {link.get("name", ""): link for link in root.findall("link")}
    joints: dict[str, list[Xml.Element]] = {}
    children = set()
    for joint in root.findall("joint"):
        parent, child = (_ends(joint, each, links, path) for each in ("parent", "child"))
        joints.setdefault(parent, []).append(joint)
        children.add(child)
    tops = [name for name in links if name not in children]
    if len(tops) != 1:
        raise ImportedError(f"{path}: found {len(tops)} links without a parent, allowed is one")
    tree = Tree()
    walk = _Urdf(tree, links, joints, path)
    top = tops[0]
    held = "ground" if walk.part(top, Frame()).mass == 0.0 else None
    walk.link(top, Frame(), held)
    shapes = [
        counted(len(root.findall(f"link/{each}")), each)
        for each in ("visual", "collision")
        if root.find(f"link/{each}") is not None
    ]
    if shapes:
        tree.tell(f"shapes are left out ({', '.join(shapes)}): write an `outline` for bodies to be drawn by")
    if held is None and fixed:
        body = next(iter(tree.bodies))
        tree.joints.insert(0, {"type": "fixed", "bodies": ["ground", body], "at": _plain(tree.bodies[body].centre)})
    return tree


def _ends(joint: Xml.Element, which: str, links: dict[str, Xml.Element], path: Path) -> str:
    end = joint.find(which)
    name = "" if end is None else end.get("link", "")
    if name not in links:
        raise ImportedError(f"{path}: joint {joint.get('name')!r}: its {which} {name!r} is no link")
    return name


def _origin(node: Xml.Element | None) -> Frame:
    if node is None:
        return Frame()
    return Frame(_vector(node.get("xyz"), "0 0 0"), _euler(_vector(node.get("rpy"), "0 0 0"), "XYZ"))


@dataclass
class _Urdf:
    """A walk over the links of a URDF file."""

    tree: Tree
    links: dict[str, Xml.Element]
    joints: dict[str, list[Xml.Element]]
    path: Path

    def part(self, name: str, at: Frame) -> Part:
        """The mass of a link whose frame is `at`."""
        inertial = self.links[name].find("inertial")
        mass = None if inertial is None else inertial.find("mass")
        if inertial is None or mass is None:
            return Part()
        own = at @ _origin(inertial.find("origin"))
        stated = inertial.find("inertia")
        xx, yy, zz, xy, xz, yz = (
            float("0" if stated is None else stated.get(f"i{each}", "0"))
            for each in ("xx", "yy", "zz", "xy", "xz", "yz")
        )
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return _inertial(name, float(mass.get("value", "0")), own, tensor)

    def link(self, name: str, at: Frame, body: str | None) -> None:
        """Take in a link and what hangs on it; body: that it is a part of, None for one of its own."""
        part = self.part(name, at)
        if body is None:
            body = as_name(name)
            self.tree.add(body, part)
        elif body != "ground":
            self.tree.bodies[body] = self.tree.bodies[body] + part
        elif part.mass > 0.0:
            where = "it is fixed to a first link without mass, taken for ground"
            self.tree.tell(f"the mass of {name!r} is left out: {where}")
        for joint in self.joints.get(name, ()):
            self.joint(joint, at @ _origin(joint.find("origin")), body)

    def joint(self, joint: Xml.Element, at: Frame, body: str) -> None:
        """Take in a joint and the link behind it."""
        kind, name = joint.get("type", ""), as_name(joint.get("name", "joint"))
        child = joint.find("child")
        assert child is not None  # `_ends` has looked
        if kind == "fixed":
            self.link(child.get("link", ""), at, body)
            return
        own = as_name(child.get("link", ""))
        axis = at.turn @ _vector(None if (node := joint.find("axis")) is None else node.get("xyz"), "1 0 0")
        entry = {"name": name, "bodies": [body, own], "at": _plain(at.place)}
        if kind in _JOINTS:
            self.tree.joints.append({"type": _JOINTS[kind], **entry, "axis": _plain(axis)})
        elif kind == "planar":
            self.tree.joints.append({"type": "planar", **entry, "normal": _plain(axis)})
        elif kind != "floating":
            raise ImportedError(f"{self.path}: joint {joint.get('name')!r}: found the type {kind!r}, which no case has")
        self.link(child.get("link", ""), at, None)
        for left_out in ("limit", "dynamics", "mimic"):
            if joint.find(left_out) is not None:
                self.tree.tell(f"<{left_out}> of joints is left out")


# MJCF


def _mjcf(root: Xml.Element, path: Path, fixed: bool) -> Tree:
    compiler = root.find("compiler")
    settings = {} if compiler is None else compiler.attrib
    world = root.find("worldbody")
    if world is None:
        raise ImportedError(f"{path}: there is no <worldbody>")
    tree = Tree()
    _refuse_what_changes_masses(root, settings, path)
    if (option := root.find("option")) is not None:
        tree.gravity = _vector(option.get("gravity"), "0 0 -9.81").tolist()
    for each in ("default", "tendon", "actuator", "equality", "contact", "sensor"):
        if root.find(each) is not None:
            tree.tell(f"<{each}> is left out")
    walk = _Mjcf(tree, path, settings.get("angle", "degree") == "degree", settings.get("eulerseq", "xyz"))
    walk.refuse_others(world)
    for body in world.findall("body"):
        walk.body(body, Frame(), "ground")
    if fixed and not tree.joints and tree.bodies:
        name = next(iter(tree.bodies))
        tree.joints.append({"type": "fixed", "bodies": ["ground", name], "at": _plain(tree.bodies[name].centre)})
    return tree


def _refuse_what_changes_masses(root: Xml.Element, settings: Mapping[str, str], path: Path) -> None:
    """Refuse what is not read here and makes other bodies, masses or joints of those that are (ImportedError)."""
    if root.find(".//include") is not None:
        raise ImportedError(f"{path}: <include> is not read; put its contents in its place")
    if root.find("default//geom") is not None:
        raise ImportedError(f"{path}: defaults of geoms are not read; write densities and masses where they are used")
    if any(joint.get(key) for joint in root.iterfind("default//joint") for key in ("type", "pos", "axis")):
        raise ImportedError(f"{path}: defaults of joints are not read; write type, pos and axis where they are used")
    for key, usual in _MASSES_AS_STATED.items():
        if settings.get(key, usual[0]) not in usual:
            raise ImportedError(f"{path}: the compiler's {key} is not read; state the masses that it makes")


@dataclass
class _Mjcf:
    """A walk over the bodies of an MJCF file."""

    tree: Tree
    path: Path
    degrees: bool
    order: str

    def frame(self, node: Xml.Element) -> Frame:
        """Where a body, an inertial or a geom is in what it belongs to."""
        place = _vector(node.get("pos"), "0 0 0")
        if node.get("quat"):
            w, x, y, z = _vector(node.get("quat"), "", 4).tolist()
            angle, axis = 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), w), np.array([x, y, z])
            return Frame(place, about_axis(tuple(axis.tolist()), angle) if axis.any() else np.eye(3))
        if node.get("euler"):
            return Frame(place, _euler(self.angle(_vector(node.get("euler"), "")), self.order))
        if node.get("axisangle"):
            *line, angle = _vector(node.get("axisangle"), "", 4).tolist()
            return Frame(place, about_axis(tuple(line), float(self.angle(np.array([angle]))[0])))
        if node.get("xyaxes") or node.get("zaxis"):
            raise ImportedError(f"{self.path}: {node.tag} {node.get('name', '')!r}: xyaxes and zaxis are not read")
        return Frame(place)

    def angle(self, values: Floats) -> Floats:
        """Angles in rad."""
        return np.deg2rad(values) if self.degrees else values

    def refuse_others(self, node: Xml.Element) -> None:
        """Refuse what may hold bodies or shapes and is not read (ImportedError)."""
        for child in node:
            if isinstance(child.tag, str) and child.tag not in _IN_BODY:
                raise ImportedError(f"{self.path}: <{child.tag}> in {node.get('name') or node.tag!r} is not read")

    def body(self, node: Xml.Element, around: Frame, parent: str) -> None:
        """Take in a body, its joint, and the bodies in it."""
        at = around @ self.frame(node)
        self.refuse_others(node)
        name = as_name(node.get("name") or f"body_{len(self.tree.bodies)}")
        part, joints = self.part(node, at), [*node.findall("joint"), *node.findall("freejoint")]
        if not joints:  # it is a part of what it stands in
            name = parent
            if parent != "ground":
                self.tree.bodies[parent] = self.tree.bodies[parent] + part
        else:
            self.tree.add(name, part)
            self.joint(joints, at, parent, name)
        for child in node.findall("body"):
            self.body(child, at, name)

    def joint(self, joints: list[Xml.Element], at: Frame, parent: str, name: str) -> None:
        """Take in the joint of a body."""
        kinds = ["free" if each.tag == "freejoint" else each.get("type", "hinge") for each in joints]
        if len(joints) > 1:
            words = ", ".join(kinds)
            raise ImportedError(f"{self.path}: body {name!r} has {len(joints)} joints ({words}), allowed is one")
        (joint,), (kind,) = joints, kinds
        if kind == "free":
            return
        if kind not in _MJCF:
            raise ImportedError(f"{self.path}: body {name!r}: found a joint of type {kind!r}, which no case has")
        entry: Plain = {"type": _MJCF[kind], "name": as_name(joint.get("name") or f"{name}_joint")}
        entry |= {"bodies": [parent, name], "at": _plain((at @ Frame(_vector(joint.get("pos"), "0 0 0"))).place)}
        if kind != "ball":
            entry["axis"] = _plain(at.turn @ _vector(joint.get("axis"), "0 0 1"))
        self.tree.joints.append(entry)
        for key in ("damping", "stiffness", "armature", "range", "frictionloss"):
            if joint.get(key) is not None:
                self.tree.tell(f"{key} of joints is left out")

    def part(self, node: Xml.Element, at: Frame) -> Part:
        """The mass of a body: stated, or of its geoms."""
        inertial = node.find("inertial")
        if inertial is not None:
            own = at @ self.frame(inertial)
            if inertial.get("fullinertia"):
                xx, yy, zz, xy, xz, yz = _vector(inertial.get("fullinertia"), "", 6).tolist()
                tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            else:
                tensor = np.diag(_vector(inertial.get("diaginertia"), "0 0 0"))
            return _inertial(node.get("name", ""), float(inertial.get("mass", "0")), own, tensor)
        return sum((self.geom(each, at) for each in node.findall("geom")), Part())

    def geom(self, node: Xml.Element, at: Frame) -> Part:
        """The mass of a homogeneous sphere, box, cylinder, capsule or ellipsoid."""
        kind, size = node.get("type", "sphere"), _vector(node.get("size"), "0 0 0", None)
        if node.get("shellinertia", "false") != "false":
            raise ImportedError(f"{self.path}: geom {node.get('name', '')!r}: shells are not read; state an <inertial>")
        own = at @ self.frame(node)
        if node.get("fromto"):
            ends = _vector(node.get("fromto"), "", 6).reshape(2, 3)
            line = ends[1] - ends[0]
            own = at @ Frame(ends.mean(axis=0), _along(line))
            across = [size[0]] * (2 if kind in ("box", "ellipsoid") else 1)
            size = np.array([*across, 0.5 * float(np.linalg.norm(line))])
        if kind not in ("sphere", "box", "cylinder", "capsule", "ellipsoid"):
            raise ImportedError(
                f"{self.path}: geom of type {kind!r} has no mass that is known here; state an <inertial>"
            )
        volume, moments = _solid(kind, size)
        mass = float(node.get("mass") or float(node.get("density") or DENSITY) * volume)
        return Part(mass, own.place, own.turn @ np.diag(mass * moments) @ own.turn.T)


def _along(line: Floats) -> Floats:
    """A turn (3, 3) that brings the z axis along a line."""
    z = line / np.linalg.norm(line)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _solid(kind: str, size: Floats) -> tuple[float, Floats]:
    """Volume (m^3) and principal moments by the mass (3,) (m^2) of a homogeneous solid; sizes as MuJoCo has them."""
    if kind in ("box", "ellipsoid"):
        a2, b2, c2 = (size[:3] ** 2).tolist()
        product, share = float(np.prod(size[:3])), 3.0 if kind == "box" else 5.0
        return (8.0 if kind == "box" else 4.0 / 3.0 * math.pi) * product, np.array([b2 + c2, a2 + c2, a2 + b2]) / share
    r = float(size[0])
    if kind == "sphere":
        return 4.0 / 3.0 * math.pi * r**3, np.full(3, 0.4 * r * r)
    half = float(size[1])
    tube = 2.0 * math.pi * r * r * half
    across, along = r * r / 4.0 + half * half / 3.0, r * r / 2.0
    if kind == "cylinder":
        return tube, np.array([across, across, along])
    # a capsule: a cylinder, and two half spheres whose centres of mass are 3 r / 8 from where they begin
    ball = 4.0 / 3.0 * math.pi * r**3
    side = 0.4 * r * r + half * half + 0.75 * r * half
    total = tube + ball
    return total, np.array([tube * across + ball * side] * 2 + [tube * along + ball * 0.4 * r * r]) / total
