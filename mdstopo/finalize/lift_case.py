"""The case in space of a planar one: its plane is z = 0, or any other through the origin.

Bodies have the same moment of inertia about all axes and body axes that start as the plane's, so that a planar motion
stays in the plane and coordinates of a body keep their numbers. Pins become hinges about the normal of the plane.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, Signal, Table, TimeFormula
from mdstopo.case.geometry.start_rotations import about_axis
from mdstopo.case.joints import JOINTS
from mdstopo.case.joints.joints_in_space import SPATIAL_JOINTS
from mdstopo.case.keys.definitions import SECTION
from mdstopo.case.keys.number_rows import Signals
from mdstopo.case.keys.signals import UnaddedSignalsError, combined
from mdstopo.case.methods.over_time import DEFAULT_REDUCTION, REDUCTIONS
from mdstopo.case.model import GROUND, Case
from mdstopo.case.responses.response_kinds import RESPONSES
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.overrides import node_of, steps_of
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import inside, shown
from mdstopo.case.text.yaml_text import text_of
from mdstopo.finalize.document import Plain, content_of


def lifted(case: Case, axis: tuple[float, float, float] = (0.0, 0.0, 1.0), angle: float = 0.0) -> str:
    """The text of the case in space.

    axis, angle (rad): the turn that brings the plane z = 0 to where the scene shall lie. Raises CaseError with all that
    cannot be lifted, and StoreError where an included file cannot be read any more.
    """
    return text_of(_Lift(case, axis, angle).content())


class _Lift:
    """One case on its way: where its plane lies, and what cannot go along."""

    def __init__(self, case: Case, axis: tuple[float, float, float], angle: float) -> None:
        self.case = case
        self.is_tilted = angle != 0.0
        self.turn = {"axis": list(axis), "angle": angle}
        #: (3, 3): its columns are the plane's x, its y, and its normal
        self.plane = about_axis(axis, angle) if self.is_tilted else np.eye(3)
        self.refused: list[tuple[str, str]] = []

    def content(self) -> Plain:
        """The document. Raises CaseError."""
        if self.case.dimension != 2:
            self.refuse("dimension", "is 3: the case is in space already")
            self.tell()
        old = content_of(self.case)
        self.names(old)
        self.tell()
        new: Plain = {"format": old.pop("format"), "dimension": 3}
        for key, value in old.items():
            if key not in ("dimension", "fit") and value is not None:
                new[key] = self.sections().get(key, _as_it_is)(value, key)
        if new.get("uncertainty"):
            new["uncertainty"] = self.uncertainty(new["uncertainty"], content_of(self.case), new)
        self.tell()
        return new

    def tell(self) -> None:
        """Raise CaseError where anything is refused."""
        if self.refused:
            marks = self.case.marks
            mistakes = [marks.mistake(path, f"{words}: it cannot be lifted") for path, words in self.refused]
            raise CaseError(mistakes, str(self.case.path or "<text>"))

    def names(self, old: Plain) -> None:
        """Refuse names that vary where numbers that follow from them would be none, or several added up, in space."""
        if self.case.follows is None:
            return
        if SECTION not in old:
            words = "varies, and is no name any more where points follow from one or members have values of their own"
            for each in self.case.defined_variables:
                self.refuse(f"design.variables.{each.name}.of", words)
            return
        for number in self.case.follows.of_kind("scene"):
            is_scalar = number.key.endswith((".mass", ".inertia"))
            if ".loads[" in f".{number.key}":
                self.refuse(number.key, "follows from a name that varies, and a load in space is read as numbers")
            elif self.is_tilted and not is_scalar:
                self.refuse(number.key, "follows from a name that varies, and in a tilted plane is no single number")

    def sections(self) -> dict[str, Callable[[Any, str], Any]]:
        """What becomes of the value of a key; of others nothing does."""
        return {
            "gravity": lambda value, _: self.vector(value),
            "bodies": self.each(self.body),
            "joints": self.each(self.joint),
            "bushings": self.each(self.bushing),
            "contacts": self.each(self.contact),
            "motions": self.each(self.motion),
            "points": self.each(self.points),
            "members": self.each(self.group),
            "loads": self.each(self.load),
            "load_cases": self.each(self.load_case),
            "objectives": self.each(self.reduced_response),
            "constraints": self.each(self.reduced_response),
        }

    def refuse(self, path: str, words: str) -> None:
        """Note what cannot be lifted."""
        self.refused.append((path, words))

    @staticmethod
    def each(lift: Callable[[Any, str], Any]) -> Callable[[Any, str], Any]:
        """The parts of a list or of a mapping by names."""

        def lifted_parts(value: Any, path: str) -> Any:
            if isinstance(value, Mapping):
                return {name: lift(part, inside(path, name)) for name, part in value.items()}
            return [lift(part, f"{path}[{index}]") for index, part in enumerate(value)]

        return lifted_parts

    # Vectors.

    def vector(self, pair: Any, frame: str = "global") -> list[float]:
        """A vector in the plane; a body's own axes are those of the plane."""
        if frame == "body" or not self.is_tilted:
            return [*pair, 0]
        return _plain(self.plane[:, :2] @ np.array(pair, dtype=np.float64))

    def normal(self, size: float = 1, frame: str = "global") -> list[float]:
        """A vector along the normal."""
        if frame == "body" or not self.is_tilted:
            return [0, 0, size]
        return _plain(self.plane[:, 2] * size)

    def signals(self, value: Any, matrix: FloatArray, path: str) -> Any:
        """What a planar quantity over time is in space."""
        try:
            found = combined(matrix, read_signals(value, ("x", "y")[: matrix.shape[1]]))
        except UnaddedSignalsError as error:
            self.refuse(path, f"a tilted plane would add {error}")
            return value
        if any(isinstance(each, TimeFormula) for each in found):
            return [_stated(each) for each in found]
        if not isinstance(found[0], Table):
            return list(found)
        columns = [found[0].times, *(each.values[:, 0] for each in found if isinstance(each, Table))]
        return {"table": np.column_stack(columns).tolist()}

    # Sections.

    def body(self, old: Plain, path: str) -> Plain:
        """Its inertia is that of a ball: in the plane only the moment about the normal counts."""
        new: Plain = {}
        # where it does not state its angle, a motion may have done so
        name = path.removeprefix("bodies.")
        start = next((each.angle for each in self.case.bodies if each.name == name), 0.0)
        turns = [{"axis": [0, 0, 1], "angle": start}] if start != 0.0 and "angle" not in old else []
        for key, value in old.items():
            if key == "inertia":
                new[key] = [value] * 3
            elif key in ("position", "velocity"):
                new[key] = self.vector(value)
            elif key == "angular_velocity":
                new[key] = self.normal(value)
            elif key == "angle":
                turns = [{"axis": [0, 0, 1], "angle": value}]
            elif key == "outline":
                new[key] = self.outline(name)
            else:
                new[key] = value
        turns += [self.turn] if self.is_tilted else []
        return {**new, "orientation": turns} if turns else new

    def outline(self, body: str) -> list[Plain]:
        """The same areas, flat: a circle is the polygon that is drawn of it, a path one for each of its lines."""
        return [
            {"polygon": [[x, y, 0] for x, y in each.corners[list(face)].tolist()], "frame": "body"}
            for each in self.case.body(body).outline
            for face in each.faces
        ]

    def joint(self, old: Plain, path: str) -> Plain:
        """A pin turns about the normal; what is on ground and states no point is where the plane has it."""
        kind = JOINTS[old["type"]]
        if kind.type not in SPATIAL_JOINTS:
            self.refuse(path, "what becomes of this joint in space is not known")
        new = {key: value for key, value in old.items() if key != "at"}
        at = old.get("at")
        if at is None and old["bodies"][1] == GROUND:
            at = [0, 0]
        if at is not None:
            new["at"] = self.place(at)
        if "axis" in old:
            new["axis"] = self.vector(old["axis"])
        if kind.turns_about_normal:
            new["axis"] = self.normal()
        return new

    def place(self, at: Any) -> Any:
        """A point, one of each body, or a list of two."""
        if isinstance(at, Mapping):
            return {body: self.vector(point) for body, point in at.items()}
        return [self.vector(point) for point in at] if isinstance(at[0], list) else self.vector(at)

    def bushing(self, old: Plain, path: str) -> Plain:
        """Along the normal it is as stiff as along x, and against tipping as against turning in the plane."""
        new = {**old, "at": self.place(old["at"])}
        for key in ("stiffness", "damping"):
            if key in old:
                x, y, turn = old[key]
                new[key] = [x, y, x, turn, turn, turn]
                if x != y and self.is_tilted and old["bodies"][0] == GROUND:
                    self.refuse(inside(path, key), "along axes of ground it differs, and the plane's are tilted")
        return new

    def motion(self, old: Plain, path: str) -> Plain:
        """A driven angle is a rotation about the normal; only in the plane z = 0 are x and y coordinates in space."""
        for axis in ("x", "y"):
            if self.is_tilted and axis in old:
                self.refuse(inside(path, axis), "in a tilted plane it is no single coordinate")
        new = {key: value for key, value in old.items() if key != "angle"}
        if "angle" in old:
            ((kind, value),) = old["angle"].items()
            if kind == "position":
                value = self.since_start(value, old["body"])
            new["rotation"] = {"axis": self.normal(), kind: value}
        return new

    def since_start(self, value: Any, body: str) -> Plain:
        """Angles over time less the angle at the start: a rotation in space counts from there."""
        start = next(each.angle for each in self.case.bodies if each.name == body)
        (table,) = read_signals(value, ("x",))
        if isinstance(table, TimeFormula):
            shifted: Plain = _stated(table.shifted(-start))
            return shifted
        assert isinstance(table, Table)
        return {"table": np.column_stack([table.times, table.values[:, 0] - start]).tolist()}

    def points(self, old: Plain, path: str) -> Plain:
        """The grids in the plane."""
        frame, grid = _frame(old), old["grid"]
        lift = self.grid
        new = {**old, "grid": [lift(each, frame) for each in grid] if isinstance(grid, list) else lift(grid, frame)}
        if old.get("movable") is not None:
            new["movable"] = {"within": self.region(old["movable"]["within"], frame, f"{path}.movable.within")}
        return new

    def region(self, old: Plain, frame: str, path: str) -> Plain:
        """Where points may move: a line or a rectangle of the plane."""
        ((kind, keys),) = old.items()
        if kind == "around":
            self.refuse(inside(path, kind), "in space points that may move around where they are leave the plane")
            return old
        if kind == "line":
            return {kind: {end: self.vector(keys[end], frame) for end in ("from", "to")}}
        axes = [self.vector([1, 0], frame), self.vector([0, 1], frame)]
        return {kind: {**keys, "center": self.vector(keys["center"], frame), "axes": axes}}

    def grid(self, old: Plain, frame: str) -> Plain:
        """One grid; a lattice in a tilted plane becomes a part of that."""
        ((kind, keys),) = old.items()
        if kind == "list":
            return {kind: [self.vector(point, frame) for point in keys]}
        if kind == "line":
            ends = {end: self.vector(keys[end], frame) for end in ("from", "to")}
            return {kind: {**ends, "count": keys["count"]}}
        if kind == "lattice":
            return self.lattice(keys, frame)
        new = {**keys, "center": self.vector(keys["center"], frame)}
        if kind == "rectangle":
            new["axes"] = [self.vector([1, 0], frame), self.vector([0, 1], frame)]
        else:
            new["normal"], new["start"] = self.normal(frame=frame), self.vector([1, 0], frame)
        return {kind: new}

    def lattice(self, keys: Plain, frame: str) -> Plain:
        """A lattice of one layer, or where it is tilted a part of the plane."""
        (x0, y0), (x1, y1), count = keys["from"], keys["to"], keys["count"]
        if frame == "body" or not self.is_tilted:
            return {"lattice": {"from": [x0, y0, 0], "to": [x1, y1, 0], "count": [*count, 1]}}
        sides = [[x1 - x0, 0], [0, y1 - y0]]
        if all(any(side) for side in sides):
            edges = [self.vector(side) for side in sides]
            return {"plane": {"corner": self.vector([x0, y0]), "edges": edges, "count": count}}
        # Without one of the edges it is a line of points, which a lattice in the plane may be.
        xs, ys = np.linspace(x0, x1, count[0]), np.linspace(y0, y1, count[1])
        return {"list": [self.vector([x, y]) for y in ys.tolist() for x in xs.tolist()]}

    def group(self, old: Plain, path: str) -> Plain:
        """Ends given in place are lifted; grids are by themselves."""
        del path
        new = dict(old)
        for end in ("from", "to"):
            if isinstance(old[end], Mapping):
                new[end] = {**old[end], "at": self.vector(old[end]["at"], _frame(old[end]))}
        return new

    def contact(self, old: Plain, path: str) -> Plain:
        """An edge becomes a rectangle that is as wide as long; the free side is on the left of the edge."""
        del path
        on = old["on"]
        frame, ends = _frame(on), [np.array(on[end], dtype=np.float64) for end in ("from", "to")]
        rectangle = {
            "center": self.vector((0.5 * (ends[0] + ends[1])).tolist(), frame),
            "axes": [self.vector((ends[1] - ends[0]).tolist(), frame), self.normal(-1, frame)],
            "size": [float(np.hypot(*(ends[1] - ends[0])))] * 2,
        }
        rest = {key: value for key, value in on.items() if key not in ("from", "to")}
        return {**old, "on": {**rest, "rectangle": rectangle}}

    def load(self, old: Plain, path: str) -> Plain:
        """Forces stay in the plane, couples are along its normal."""
        frame = _frame(old)
        axes = np.eye(3) if frame == "body" else self.plane
        new = dict(old)
        for key in ("force", "acceleration"):
            if key in old:
                new[key] = self.signals(old[key], axes[:, :2], inside(path, key))
        for key in ("moment", "angular_acceleration"):
            if key in old:
                new[key] = self.signals(old[key], axes[:, 2:], inside(path, key))
        if "at" in old:
            new["at"] = self.vector(old["at"], frame)
        return new

    def load_case(self, old: Plain | None, path: str) -> Plain:
        """Its gravity, loads and motions."""
        lifts = {key: self.sections()[key] for key in ("gravity", "loads", "motions")}
        return {key: lifts.get(key, _as_it_is)(value, inside(path, key)) for key, value in (old or {}).items()}

    def reduced_response(self, old: Plain, path: str) -> Plain:
        """An objective or a constraint."""
        response = old.get("response")
        if not isinstance(response, Mapping):
            return old
        ((word, keys),) = response.items()
        over_time = old.get("over_time", DEFAULT_REDUCTION)
        return {**old, "response": self.response(word, keys, over_time, inside(path, "response"))}

    def response(self, word: str, keys: Plain, over_time: str, path: str) -> Plain:
        """A response; seen from ground in a tilted plane only what has no direction there."""
        kind, here = RESPONSES[word], inside(path, word)
        from_ground = self.is_tilted and keys.get("relative_to", GROUND) == GROUND
        if not kind.kernels:  # an expression of others
            return {word: {**keys, "of": self.parts(keys["of"], over_time, inside(here, "of"))}}
        if kind.is_component:
            if kind.is_position and self.angle_at_start(keys) != 0.0:
                words = "it is not 0 at the start, from which a rotation in space counts"
                self.refuse(here, words)
            component = "norm" if from_ground else "z"
            if from_ground and not REDUCTIONS[over_time].ignores_sign:
                words = f"in a tilted plane only its size is a component, and over_time {over_time} needs its sign"
                self.refuse(here, words)
            return {kind.in_space: {**keys, "component": component}}
        if not kind.of_point:
            if not kind.in_space:
                self.refuse(here, "what becomes of this response in space is not known")
            return {kind.in_space or word: keys}
        if from_ground and keys.get("component", "norm") != "norm":
            self.refuse(inside(here, "component"), "in a tilted plane it is no single component")
        return {word: {**keys, "at": self.vector(keys["at"], _frame(keys))} if "at" in keys else keys}

    def parts(self, stated: Plain, over_time: str, path: str) -> Plain:
        """The responses that an expression is of."""
        lifted: Plain = {}
        for name, part in stated.items():
            if isinstance(part, Mapping):
                ((word, keys),) = part.items()
                lifted[name] = self.response(word, keys, over_time, inside(path, name))
            else:
                lifted[name] = part
        return lifted

    def angle_at_start(self, keys: Plain) -> float:
        """By what angle a body is turned at the start against the one that it is seen from, rad."""
        angles = {body.name: body.angle for body in self.case.bodies} | {GROUND: 0.0}
        return float(angles[keys["body"]] - angles[keys.get("relative_to", GROUND)])

    def uncertainty(self, section: Plain, old: Plain, new: Plain) -> Plain:
        """The same numbers are uncertain, where they stand in space; one that is several numbers there is refused."""

        def moved(numbers: Plain, path: str) -> Plain:
            return {self.number(key, value, old, new, path): value for key, value in numbers.items()}

        lifted_section = dict(section)
        if section.get("parameters"):
            lifted_section["parameters"] = moved(section["parameters"], "uncertainty.parameters")
        if section.get("scenarios"):
            lifted_section["scenarios"] = {
                name: {**scenario, "set": moved(scenario["set"], f"uncertainty.scenarios.{name}.set")}
                if scenario.get("set")
                else scenario
                for name, scenario in section["scenarios"].items()
            }
        return lifted_section

    def number(self, key: str, value: Any, old: Plain, new: Plain, path: str) -> str:
        """The key path in space of a number of the planar case; value: what it varies by, or becomes."""
        steps = steps_of(key)
        planar, spatial = _at(old, steps), _at(new, steps)
        if isinstance(planar, bool) or not isinstance(planar, int | float) or isinstance(value, list):
            self.refuse(path, f"{shown(key)} is no number of the case")
        elif spatial == planar and (isinstance(steps[-1], str) or self.same_row(old, new, steps)):
            return key
        elif spatial == [0, 0, planar] and not self.is_tilted:
            return f"{key}[2]"
        elif steps[-1] == "inertia" and spatial == [planar] * 3:
            return f"{key}[2]"  # the others do nothing: all turns are about the body's z
        else:
            self.refuse(path, f"{shown(key)} is no single number in space")
        return key

    def same_row(self, old: Plain, new: Plain, steps: list[str | int]) -> bool:
        """Whether the list that a number stands in is the same, or a vector that has got a zero off the plane."""
        before, behind = _at(old, steps[:-1]), _at(new, steps[:-1])
        return bool(before == behind or (not self.is_tilted and behind == [*before, 0]))


def _stated(signal: Signal) -> Any:
    """A constant or a formula of time, as a case file has it; a table of one quantity."""
    if isinstance(signal, Table):
        return {"table": np.column_stack([signal.times, signal.values]).tolist()}
    if not isinstance(signal, TimeFormula):
        return signal
    text = signal.text if signal.scale == 1.0 else f"{signal.scale!r} * ({signal.text})"
    text = text if signal.offset == 0.0 else f"{text} + {signal.offset!r}"
    return {"formula": text, "parameters": dict(signal.parameters)} if signal.parameters else text


def read_signals(value: Any, names: tuple[str, ...]) -> tuple[Signal, ...]:
    """The signals of a quantity over time, which has been read before without a mistake."""
    reading = Reading(Path())
    read: tuple[Signal, ...] = Signals(names, formula=True).read(node_of(value, ""), "", reading)
    assert not reading.mistakes
    return read


def _at(content: Any, steps: list[str | int]) -> Any:
    """What stands at a key path, None where there is nothing."""
    for step in steps:
        if isinstance(step, str) and isinstance(content, Mapping):
            content = content.get(step)
        elif isinstance(step, int) and isinstance(content, list) and 0 <= step < len(content):
            content = content[step]
        else:
            return None
    return content


def _as_it_is(value: Any, path: str) -> Any:
    del path
    return value


def _frame(keys: Plain) -> str:
    """What coordinates are measured in; those of ground are global ones."""
    return "global" if keys["body"] == GROUND else str(keys.get("frame", "global"))


def _plain(vector: FloatArray) -> list[float]:
    """Its numbers; -0 is 0."""
    found: list[float] = (vector + 0.0).tolist()
    return found
