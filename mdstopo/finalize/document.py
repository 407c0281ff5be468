"""The case of a final system, from the document of the case that it was designed in.

Each member kept is a group of one, its points given in place, its law multiplied by alpha^mu and its cost by alpha; so
alpha is 1. Parameters of laws that were variables are numbers; fixed members that differ in them are groups of one,
too. All else stays as the user wrote it, with what --set changed, and included files written out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.mesh_files import is_mesh
from mdstopo.case.keys.definitions import SECTION, with_numbers
from mdstopo.case.keys.number_rows import rows_in
from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import Case, MemberGroup, VolumeRow
from mdstopo.case.objects.frames import Frames
from mdstopo.case.reader import measured
from mdstopo.case.responses.response_units import constrained
from mdstopo.case.scene.dimensions import frames_of
from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node, parse
from mdstopo.case.text.overrides import apply_overrides
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import inside
from mdstopo.finalize.apart import free_name
from mdstopo.finalize.names import following_law, kept_expressions
from mdstopo.finalize.parameter_values import Given, bound_of, differ, given, with_valid_times, with_values
from mdstopo.finalize.scaled_laws import scaled_law
from mdstopo.store.store_errors import StoreError

Plain = dict[str, Any]


def content_of(case: Case) -> Plain:
    """The document that a case was read from, with what --set changed and the rows of included files in place.

    Expressions are replaced by their values, except those of names that were design variables. Raises StoreError where
    an included file cannot be read any more or has changed since, and where defined names are uncertain: the numbers
    that replace expressions would not follow them.
    """
    root = parse(case.text.removeprefix("\ufeff"), lambda _mistake: None)
    assert root is not None  # it has been read before
    root, _ = apply_overrides(root, case.overrides, lambda _mistake: None)
    _refuse_uncertain_names(case)
    kept, defined = kept_expressions(root, case)
    root = with_numbers(root, Reading(Path()), kept)
    if not defined:
        root.entries.pop(SECTION, None)
    content = _plain(root, _files(case), measured(root), "")
    assert isinstance(content, dict)
    return {**content, SECTION: defined} if defined else content


def _refuse_uncertain_names(case: Case) -> None:
    uncertainty = case.uncertainty
    if uncertainty is None:
        return
    keys = [number.key for number in uncertainty.numbers]
    keys += [key for scenario in uncertainty.scenarios for key in scenario.values]
    if found := [key for key in keys if key == SECTION or key.startswith(f"{SECTION}.")]:
        raise StoreError(
            f"{case.path or case.name}: {found[0]} is uncertain, and expressions would become numbers that do not "
            "follow it; state what is uncertain of the numbers themselves"
        )


def final_content(
    content: Plain, case: Case, places: Sequence[tuple[str, int]], design: FloatArray
) -> tuple[Plain, list[str]]:
    """The final case as plain values, and sentences about what of the old one it cannot say.

    content: of the old case. case: the old one with only the members kept. places (K,): the group of each and its place
    there. design (K + P,): their sizes, and the values of variables; members of size 0 are left out.
    """
    alpha = design[: case.n_design]
    fixed = _fixed(case)
    names = _names(case, fixed, places, alpha)
    sized: dict[str, list[str]] = {group: [] for group, _ in places}
    for (group, _), name in zip(places, names, strict=True):
        if name:
            sized[group].append(name)
    groups = {group: own for group, own in fixed.items() if own != [group]} | sized
    told: list[str] = []
    members = _members(content, case, names, fixed, design)
    final: Plain = {}
    for key, value in content.items():
        if key in ("design", "combine", "fit"):
            continue
        if key == "members":
            final[key] = members
            final["design"] = _design(case, names) if any(names) else None
        elif key == "points":
            used = _used_points(content, members)
            final[key] = {name: _grid(case, name, grid) for name, grid in (value or {}).items() if name in used}
        elif key == "objectives":
            final[key] = _objectives(value or {}, groups, told)
            final["combine"] = _combine(content.get("combine"), final[key])
        elif key == "constraints":
            final[key] = _constraints(value or [], case, groups, sized, design, told)
        else:
            final[key] = value
    return {key: value for key, value in final.items() if value not in (None, {}, [])}, told


def _plain(node: Node, files: Mapping[str, Any], known: Mapping[str, float], path: str) -> Any:
    """A node as plain values; known: by path, those of numbers with units."""
    if node.kind == SCALAR:
        return known.get(path, node.scalar())
    if node.kind == SEQUENCE:
        return [_plain(item, files, known, f"{path}[{i}]") for i, item in enumerate(node.items)]
    assert node.kind == MAPPING
    if set(node.entries) == {"file"}:
        name = node.entries["file"][1]
        if name.kind == SCALAR and name.text in files:
            return files[name.text]
    return {key: _plain(value, files, known, inside(path, key)) for key, (_, value) in node.entries.items()}


def _files(case: Case) -> Plain:
    """Rows of each included file, by its path as written."""
    folder = Path() if case.path is None else case.path.parent
    found: Plain = {}
    for name, digest in case.files.items():
        if is_mesh(name):
            continue  # it stays a file
        try:
            data = (folder / name).read_bytes()
        except OSError as error:
            raise StoreError(f"{folder / name}: cannot be read: {error.strerror}") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise StoreError(f"{folder / name}: it has changed while it was being read")
        found[name] = rows_in(data.decode("utf-8-sig"))
    return found


def _fixed(case: Case) -> dict[str, list[str]]:
    """Groups without design variables, each with the groups that it becomes: itself, or one for each member."""
    taken = {group.name for group in case.members if not group.design}
    return {
        group.name: [free_name(group.name, i, taken) for i in range(len(group))]
        if differ(case, group)
        else [group.name]
        for group in case.members
        if not group.design
    }


def _names(
    case: Case, fixed: Mapping[str, list[str]], places: Sequence[tuple[str, int]], alpha: FloatArray
) -> list[str]:
    """The group of each member: <its group>_<its place there>; empty where it has no size."""
    taken = {*fixed, *(name for own in fixed.values() for name in own)}
    found = []
    for (group, place), size, power in zip(places, alpha.tolist(), case.power.tolist(), strict=True):
        name = free_name(group, place, taken)
        found.append(name if size**power > 0.0 else "")
    return found


def _members(
    content: Plain, case: Case, names: Sequence[str], fixed: Mapping[str, list[str]], design: FloatArray
) -> Plain:
    frames = frames_of(case)
    values = design[case.n_design :]
    members: Plain = {}
    first = 0
    for group in case.members:
        if not group.design:
            own = fixed[group.name]
            if own == [group.name] and group.name in content["members"]:
                stated = content["members"][group.name]
                members[group.name] = _at_values(stated, given(case, group, 0, values), case)
                continue
            for i, name in enumerate(own):
                laws = _laws(case, group, i, 1.0, values)
                members[name] = {**_ends(group, i, frames), "law": laws, "design": False}
            continue
        for i in range(len(group)):
            name, size = names[first + i], float(design[first + i])
            if name:
                laws = _laws(case, group, i, size**group.power, values, content["members"].get(group.name))
                members[name] = {**_ends(group, i, frames), "law": laws, "cost": size * float(group.cost[i])}
        first += len(group)
    return members


def _at_values(stated: Plain, values: Given, case: Case) -> Plain:
    """A group as the user wrote it, with parameters of its laws in place."""
    if not values:
        return stated
    laws = stated["law"] if isinstance(stated["law"], list) else [stated["law"]]
    found = [with_valid_times({**law, **values.get(place, {})}, case) for place, law in enumerate(laws)]
    return {**stated, "law": found if isinstance(stated["law"], list) else found[0]}


def _laws(
    case: Case, group: MemberGroup, i: int, factor: float, values: FloatArray, stated: Plain | None = None
) -> Plain | list[Plain]:
    """The laws of a member with its size and its parameters in them.

    case, group, i: the case, a group of it, and the place of the member there.
    factor: its size to its power. values (P,): of the variables.
    stated: the group in the document, with expressions that are kept; None: none are.
    """
    laws = with_values(group.laws, given(case, group, i, values))
    found = [with_valid_times(scaled_law(law, factor), case) for law in laws]
    if stated is not None:
        found = [following_law(stated["law"], k, laws[k], each, factor) for k, each in enumerate(found)]
    return found[0] if len(found) == 1 else found


def _ends(group: MemberGroup, i: int, frames: Frames) -> Plain:
    p, q = int(group.from_index[i]), int(group.to_index[i])
    return {
        "from": _end(group.body_from, group.from_local[p : p + 1], group.from_world[p : p + 1], frames),
        "to": _end(group.body_to, group.to_local[q : q + 1], group.to_world[q : q + 1], frames),
    }


def _end(body: str, local: FloatArray, world: FloatArray, frames: Frames) -> Plain:
    """A point in place: global, or in the frame of its body where only that gives the same body coordinates."""
    if np.array_equal(frames.to_local(body, world), local):
        return {"body": body, "at": world[0].tolist()}
    return {"body": body, "at": local[0].tolist(), "frame": "body"}


def _design(case: Case, names: Sequence[str]) -> Plain:
    """alpha = 1, fixed there: members stay design members, so that energies and volumes count them."""
    powers = {name: mu for name, mu in zip(names, case.power.tolist(), strict=True) if name and mu != 1.0}
    return {"initial": 1, "lower": 1, "upper": 1, **({"power": powers} if powers else {})}


def _grid(case: Case, name: str, stated: Plain) -> Plain:
    """A point grid as the file states it; where its points could move, a list of where they have come to."""
    if stated.get("movable") is None:
        return stated
    points = case.points[name].local if stated.get("frame", "global") == "body" else case.points[name].world
    kept = {key: value for key, value in stated.items() if key != "movable"}
    return {**kept, "grid": {"list": points.tolist()}}


def _used_points(content: Plain, members: Plain) -> set[str]:
    ends = [entry[key] for entry in members.values() for key in ("from", "to")]
    contacts = [contact["points"] for contact in content.get("contacts") or []]
    return {end for end in [*ends, *contacts] if isinstance(end, str)}


def _objectives(stated: Plain, groups: Mapping[str, list[str]], told: list[str]) -> Plain:
    found: Plain = {}
    for name, objective in stated.items():
        versions = _versions(objective, groups)
        if len(versions) == 1:
            found[name] = versions[0]
        else:
            told.append(f"the objective {name} is left out: {_reason(versions)}")
    return found


def _versions(stated: Plain, groups: Mapping[str, list[str]]) -> list[Plain]:
    """An objective or constraint, once for each group that its `member_force` is now about: of the group that it names
    each member kept is a group of its own."""
    response = stated["response"]
    if isinstance(response, dict) and "expression" in response:
        return [{**stated, "response": made} for made in _expressions(response["expression"], groups)]
    return [{**stated, "response": made} for made in _forces(response, groups)]


def _forces(response: Any, groups: Mapping[str, list[str]]) -> list[Any]:
    """A response, once for each group that its `member_force` is now about; as it is where it has none."""
    looks = isinstance(response, dict) and "member_force" in response
    group = str(response["member_force"]["group"]) if looks else ""
    return [{"member_force": {"group": name}} for name in groups[group]] if group in groups else [response]


def _expressions(stated: Plain, groups: Mapping[str, list[str]]) -> list[Plain]:
    """An expression of responses in a list; an empty list where no member of a group that it is about is kept."""
    versions = {name: _forces(part, groups) for name, part in stated["of"].items()}
    if not all(versions.values()):
        return []
    return [{"expression": {**stated, "of": {name: parts[0] for name, parts in versions.items()}}}]


def _reason(versions: list[Plain]) -> str:
    if versions:
        return "it looks at one group, and each member kept is a group of its own"
    return "no member that it looks at is kept"


def _combine(stated: Plain | None, objectives: Plain) -> Plain | None:
    if stated is None or not objectives:
        return None
    weights = {name: stated["weights"][name] for name in objectives}
    if not any(weights.values()):
        weights = dict.fromkeys(weights, 1)
    return {**stated, "weights": weights}


def _constraints(
    stated: list[Plain],
    case: Case,
    groups: Mapping[str, list[str]],
    sized: Mapping[str, list[str]],
    design: FloatArray,
    told: list[str],
) -> list[Plain]:
    """The constraints of the final case, in those members that it has.

    stated: the constraints as the file has them.
    case: the one of the file, with only the members kept.
    groups: by name of a group there, those that its members have become, of groups that do not stay as they are.
    sized: the same of groups with design members alone.
    design (K + P,): sizes of the members kept, and values of variables.
    told: takes a sentence for each constraint that is left out.
    """
    found: list[Plain] = []
    for i, (entry, row) in enumerate(zip(stated, case.constraints, strict=True)):
        if not isinstance(row, VolumeRow):
            versions = _versions(entry, groups)
            if len(versions) == 1 or (versions and row.sense == "limit" and REDUCTIONS[row.over_time].is_largest):
                found += versions
            else:
                told.append(f"constraints[{i}] ({constrained(case, row)}) is left out: {_reason(versions)}")
            continue
        volume = entry["volume"]
        named = sized if volume == "all" else [volume] if isinstance(volume, str) else volume
        names = [name for group in named for name in sized.get(group, [])]
        if names:
            bound = bound_of(row, case.n_design, design)
            found.append({"volume": "all" if volume == "all" else names, row.sense: bound})
        else:
            told.append(f"constraints[{i}] ({constrained(case, row)}) is left out: {_empty(row)}")
    return found


def _empty(row: VolumeRow) -> str:
    if np.any(row.prices):
        return "all that it sums up are parameters of laws, which are numbers now"
    return "no member that it sums up is kept"
