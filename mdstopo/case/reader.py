"""From a case file to a `Case`: parse, check every value, check names, build.

Mistakes are gathered through all of it and raised together; nothing here raises anything else for a bad file.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.design.design_variables import build_shared, build_variables
from mdstopo.case.design.movable import build_movable
from mdstopo.case.keys.definitions import MARK, SECTION, beginning, with_numbers
from mdstopo.case.model import GROUND, Case
from mdstopo.case.objects.fitting import Fit
from mdstopo.case.objects.frames import Frames
from mdstopo.case.objects.plane_or_space import Geometry
from mdstopo.case.scene.candidates import with_start_set
from mdstopo.case.scene.contacts import build_contacts
from mdstopo.case.scene.dimensions import geometry_in
from mdstopo.case.scene.groups import build_groups
from mdstopo.case.scene.links import build_bushings, build_joints, declare_joints
from mdstopo.case.scene.load_case_times import time_spans
from mdstopo.case.scene.load_cases import build_load_cases
from mdstopo.case.scene.motions import build_motions, merged, resolve_starts, start_angle
from mdstopo.case.scene.points import build_points
from mdstopo.case.sections.problem_sections import apply_design, build_combine, build_constraints, build_objectives
from mdstopo.case.sections.settings import build_optimizer, build_solver, warn_assemble
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.extending import KEY, CannotExtendError, extended, text_of_tree
from mdstopo.case.text.file_text import FileTextError, text_in
from mdstopo.case.text.nodes import MAPPING, Node, YamlSyntaxError, parse
from mdstopo.case.text.overrides import apply_overrides
from mdstopo.case.text.reading import BAD, Fields, Reading, found
from mdstopo.case.text.shipped import case_file, names
from mdstopo.case.text.words import inside

_SECTIONS = {
    "body": "bodies",
    "joint": "joints",
    "point grid": "points",
    "member group": "members",
    "load case": "load_cases",
    "objective": "objectives",
}


def load_case(path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Case:
    """The case in a file, every value in SI units, defaults filled in.

    path: of the file; the bare name of a case that comes with the package will do, with or without `.yaml`, where there
    is no such file. overrides: key path -> value, as the command line's ``--set KEY=VALUE``; text is read as YAML.
    Raises CaseError with every mistake that one reading finds, TypeError for overrides that are no mapping.
    """
    overrides = _checked_overrides(overrides)
    place = case_file(Path(path))
    try:
        text, digest = text_in(place)
    except FileTextError as error:
        mistake = error.mistake
        if Path(path).name == str(path) and not os.path.exists(place):
            mistake = Mistake("", f"{mistake.message}; cases that come with mdstopo: {', '.join(names())}", 1, 1)
        raise CaseError([mistake], str(path)) from None
    return read_case(text, path=place, overrides=overrides, sha256=digest)


def read_case(
    text: str,
    *,
    path: str | os.PathLike[str] | None = None,
    overrides: Mapping[str, Any] | None = None,
    sha256: str | None = None,
    without: tuple[str, ...] = (),
) -> Case:
    """The case in `text`; raises CaseError as `load_case`.

    text: the case file.
    path: where the text comes from; included files are relative to it, else to the current folder.
    overrides: as of `load_case`.
    sha256: of the file's bytes, where they are not the text in UTF-8.
    without: sections that are not read.
    """
    return Document(text, path=path, overrides=overrides, sha256=sha256).case(without)


class Document:
    """The text of a case file as a tree of numbers, from which the case is made, perhaps at other numbers.

    text, path, overrides, sha256: as of `read_case`. Raises CaseError where it is no document.
    """

    def __init__(
        self,
        text: str,
        *,
        path: str | os.PathLike[str] | None = None,
        overrides: Mapping[str, Any] | None = None,
        sha256: str | None = None,
    ) -> None:
        overrides = _checked_overrides(overrides)
        self._place = None if path is None else Path(path)
        self._file = "<text>" if path is None else str(path)
        self._sha256 = sha256 or hashlib.sha256(text.encode(errors="replace")).hexdigest()
        reading = self._reading = Reading(Path() if self._place is None else self._place.parent)
        own = _parsed(text, reading, self._file)
        try:
            root = extended(own, self._place, reading)
        except CannotExtendError:
            raise CaseError(reading.mistakes, self._file) from None
        self._text = text if root is own else text_of_tree(root)
        root, self._overrides = apply_overrides(root, overrides, reading.mistakes.append)
        if KEY in root.entries:
            reading.mistake(KEY, "can only be stated in the file", root.entries[KEY][1])
        #: with expressions, and with numbers in their places
        self._written = self._root = beginning(root)
        expressions = any(MARK in each for each in (self._text, *self._overrides.values()))
        if expressions or SECTION in root.entries:
            self._root = with_numbers(self._written, reading)

    @property
    def written(self) -> Node:
        """The whole document as it was written, with its expressions."""
        return self._written

    def case(self, without: tuple[str, ...] = (), at: Mapping[str, float] | None = None) -> Case:
        """The case of the document.

        without: sections that are not read. at: numbers, by their key path, in the place of those that are stated.
        Raises CaseError as `load_case`.
        """
        reading = self._reading.again()
        root = self._root
        if without:
            root = root.at(root.line, root.column)
            root.entries = {key: entry for key, entry in self._root.entries.items() if key not in without}
        if at:
            root, _ = apply_overrides(root, at, reading.mistakes.append)
        reading.mark("", root)
        geometry = geometry_in(root, reading)
        top = geometry.format.read(root, "", reading)
        assert isinstance(top, Fields)
        parts = _build(top, root, self._written, geometry, "design" not in without, reading)
        if top["uncertainty"] is not None:
            from mdstopo.case.sections.uncertainty_section import build_uncertainty  # most cases have none

            parts["uncertainty"] = build_uncertainty(top, parts["constraints"], root, reading)
        if reading.mistakes:
            raise CaseError(reading.mistakes, self._file)
        case = Case(
            title=top["title"],
            path=self._place,
            name="case" if self._place is None else self._place.stem,
            text=self._text,
            sha256=self._sha256,
            overrides=FrozenDict(self._overrides),
            files=FrozenDict(reading.files),
            marks=reading.marks(),
            warnings=tuple(reading.warnings),
            **parts,
        )
        return with_start_set(case) if case.priced_groups else case


def _checked_overrides(overrides: object) -> Mapping[str, Any]:
    """What is to be overrides, if it is a mapping; an empty one for None. Raises TypeError."""
    if overrides is None:
        return {}
    if not isinstance(overrides, Mapping):
        kind = type(overrides).__name__
        raise TypeError(f"overrides: found {kind}, needed is a mapping, such as {{'solver.tolerance': 1e-9}}")
    return overrides


def measured(root: Node) -> dict[str, float]:
    """By key path, the SI values of all numbers of a document that are written with a unit."""
    reading = Reading(Path())
    geometry_in(root, reading).format.read(root, "", reading)
    return reading.measured


def _parsed(text: str, reading: Reading, file: str) -> Node:
    """The document's tree; raises where there is none."""
    try:
        text.encode("utf-8")
        root = parse(text.removeprefix("\ufeff"), reading.mistakes.append)
    except UnicodeEncodeError:
        mistake = Mistake("", "the text has characters that UTF-8 cannot hold", 1, 1)
        raise CaseError([mistake], file) from None
    except YamlSyntaxError as error:
        raise CaseError([*reading.mistakes, error.mistake], file) from None
    if root is None or root.kind != MAPPING:
        what = "nothing" if root is None else found(root)
        line, column = (1, 1) if root is None else (root.line, root.column)
        mistake = Mistake("", f"found {what}, allowed is a mapping that starts with `format: 1`", line, column)
        raise CaseError([*reading.mistakes, mistake], file)
    return root


def _build(
    top: Fields, root: Node, written: Node, geometry: Geometry, varies: bool, reading: Reading
) -> dict[str, Any]:
    """The parts of the case, as far as they can be made; notes every mistake on the way.

    top: the keys of the file as they were read. root: the file, with numbers in the place of expressions; written: with
    its expressions. geometry: of the plane or of space. varies: whether design variables are read. reading: takes the
    mistakes.
    """
    declare_joints(top["joints"], reading)
    _check_references(top, reading)
    times = time_spans(top, reading)
    by_case = merged(top, reading)
    starts = resolve_starts(top, times, by_case, geometry, reading)
    frames = _frames(top, starts, geometry, reading)
    points = build_points(_section(top, "points"), frames, reading)
    made = build_groups(_section(top, "members"), points, frames, reading)
    designed = apply_design(top, made, reading)
    complete = isinstance(top["members"], dict) and len(made) == len(top["members"])
    groups = designed if complete or top["members"] is None else None
    motions = {case: build_motions(by_body, geometry) for case, by_body in by_case.items()}
    variables, follows = build_variables(top, groups, written, reading)
    movable, coordinates = build_movable(top, points, groups, frames, reading) if varies else ((), ())
    variables += coordinates
    warn_assemble(top, reading)
    load_cases = build_load_cases(top, times, motions, starts, frames, reading)
    return {
        "bodies": tuple(body for body in frames.bodies.values() if body.name != GROUND),
        "joints": build_joints(top["joints"], frames, reading),
        "bushings": build_bushings(top["bushings"], frames, reading),
        "contacts": build_contacts(top["contacts"], points, frames, reading),
        "points": FrozenDict(points),
        "members": tuple((designed or {}).values()),
        "load_cases": load_cases,
        "objectives": build_objectives(top, frames, reading),
        "combine": build_combine(top, reading),
        "constraints": build_constraints(top, groups, variables, frames, reading),
        "optimizer": build_optimizer(top["optimizer"], reading),
        "solver": build_solver(top["solver"], times, reading),
        "variables": variables,
        "movable": movable,
        "follows": follows,
        "dimension": geometry.number,
        "fit": _fit(top, root, frames, reading),
        **build_shared(top, groups, reading),
    }


def _fit(top: Fields, root: Node, frames: Frames, reading: Reading) -> Fit | None:
    if top["fit"] is None:
        return None
    from mdstopo.case.sections.fit_section import build_fit  # most cases have none

    return build_fit(top, root, frames, reading)


def _section(top: Fields, key: str) -> dict[str, Any]:
    return top[key] if isinstance(top[key], dict) else {}


def _check_references(top: Fields, reading: Reading) -> None:
    """References into a section that could not be read at all say nothing about themselves."""
    unreadable = {kind for kind, key in _SECTIONS.items() if top[key] is BAD}
    if isinstance(top["joints"], list) and BAD in top["joints"]:
        unreadable.add("joint")
    reading.references = [r for r in reading.references if r.kind not in unreadable]
    reading.check_references()


def _frames(top: Fields, starts: dict[Any, Any], geometry: Geometry, reading: Reading) -> Frames:
    bodies = {GROUND: geometry.ground}
    for name, fields in _section(top, "bodies").items():
        body = geometry.build_body(name, fields, inside("bodies", name), start_angle(name, starts), reading)
        if body is not None:
            bodies[name] = body
    return Frames(bodies, geometry)
