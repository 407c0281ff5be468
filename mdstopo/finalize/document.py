"""The case of a final system, from the document of the case that it was designed in.

Each member kept is a group of one, its points given in place, its law multiplied by alpha^mu and its cost by alpha; so
alpha is 1. All else stays as the user wrote it, with what --set changed, and included files written out.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry import Frames
from mdstopo.case.model import GROUND, Body, Case, MemberGroup, VolumeRow
from mdstopo.case.nodes import MAPPING, SCALAR, SEQUENCE, Node, parse
from mdstopo.case.overrides import apply_overrides
from mdstopo.case.rows import rows_in
from mdstopo.finalize.laws import sized
from mdstopo.store.errors import StoreError

Plain = dict[str, Any]
_LARGEST = ("max", "max_abs")


def content_of(case: Case) -> Plain:
    """The document that a case was read from, with what --set changed and the rows of included files in place.

    Raises StoreError where an included file cannot be read any more, or is another than was read.
    """
    root = parse(case.text.removeprefix("\ufeff"), lambda _mistake: None)
    assert root is not None  # it has been read before
    root, _ = apply_overrides(root, case.overrides, lambda _mistake: None)
    content = _plain(root, _files(case))
    assert isinstance(content, dict)
    return content


def final_content(
    content: Plain, case: Case, places: Sequence[tuple[str, int]], alpha: FloatArray
) -> tuple[Plain, list[str]]:
    """The final case as plain values, and sentences about what of the old one it cannot say.

    content: of the old case. case: the old one with only the members kept. places (K,): the group of each and its place
    there. alpha (K,): their sizes; those of size 0 are left out.
    """
    names = _names(case, places, alpha)
    groups: dict[str, list[str]] = {group: [] for group, _ in places}
    for (group, _), name in zip(places, names, strict=True):
        if name:
            groups[group].append(name)
    told: list[str] = []
    members = _members(content, case, names, alpha)
    final: Plain = {}
    for key, value in content.items():
        if key in ("design", "combine"):
            continue
        if key == "members":
            final[key] = members
            final["design"] = _design(case, names)
        elif key == "points":
            used = _used_points(content, members)
            final[key] = {name: grid for name, grid in (value or {}).items() if name in used}
        elif key == "objectives":
            final[key] = _objectives(value or {}, groups, told)
            final["combine"] = _combine(content.get("combine"), final[key])
        elif key == "constraints":
            final[key] = _constraints(value or [], case, groups, told)
        else:
            final[key] = value
    return {key: value for key, value in final.items() if value not in (None, {}, [])}, told


def _plain(node: Node, files: Mapping[str, Any]) -> Any:
    if node.kind == SCALAR:
        return node.scalar()
    if node.kind == SEQUENCE:
        return [_plain(item, files) for item in node.items]
    assert node.kind == MAPPING
    if set(node.entries) == {"file"}:
        name = node.entries["file"][1]
        if name.kind == SCALAR and name.text in files:
            return files[name.text]
    return {key: _plain(value, files) for key, (_, value) in node.entries.items()}


def _files(case: Case) -> Plain:
    """Rows of each included file, by its path as written."""
    folder = Path() if case.path is None else case.path.parent
    found: Plain = {}
    for name, digest in case.files.items():
        try:
            data = (folder / name).read_bytes()
        except OSError as error:
            raise StoreError(f"{folder / name}: cannot be read: {error.strerror}") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise StoreError(f"{folder / name}: it has changed while it was being read")
        found[name] = rows_in(data.decode("utf-8-sig"))
    return found


def _names(case: Case, places: Sequence[tuple[str, int]], alpha: FloatArray) -> list[str]:
    """The group of each member: <its group>_<its place there>; empty where it has no size."""
    taken = {group.name for group in case.members if not group.design}
    found = []
    for (group, place), size, power in zip(places, alpha.tolist(), case.power.tolist(), strict=True):
        name = f"{group}_{place}"
        while name in taken:
            name += "_"
        taken.add(name)
        found.append(name if size**power > 0.0 else "")
    return found


def _members(content: Plain, case: Case, names: Sequence[str], alpha: FloatArray) -> Plain:
    frames = Frames({GROUND: Body(GROUND, 1.0, 1.0, (0.0, 0.0)), **{body.name: body for body in case.bodies}})
    members: Plain = {}
    first = 0
    for group in case.members:
        if not group.design:
            members[group.name] = content["members"][group.name]
            continue
        for i in range(len(group)):
            name, size = names[first + i], float(alpha[first + i])
            if name:
                members[name] = _member(group, i, size, frames)
        first += len(group)
    return members


def _member(group: MemberGroup, i: int, alpha: float, frames: Frames) -> Plain:
    laws = [sized(law, alpha**group.power) for law in group.laws]
    p, q = int(group.from_index[i]), int(group.to_index[i])
    return {
        "from": _end(group.body_from, group.from_local[p : p + 1], group.from_world[p : p + 1], frames),
        "to": _end(group.body_to, group.to_local[q : q + 1], group.to_world[q : q + 1], frames),
        "law": laws[0] if len(laws) == 1 else laws,
        "cost": alpha * float(group.cost[i]),
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


def _used_points(content: Plain, members: Plain) -> set[str]:
    ends = [entry[key] for entry in members.values() for key in ("from", "to")]
    contacts = [contact["points"] for contact in content.get("contacts") or []]
    return {end for end in [*ends, *contacts] if isinstance(end, str)}


def _objectives(stated: Plain, groups: Mapping[str, list[str]], told: list[str]) -> Plain:
    found: Plain = {}
    for name, objective in stated.items():
        versions = _looking(objective, groups)
        if len(versions) == 1:
            found[name] = versions[0]
        else:
            told.append(f"the objective {name} is left out: {_reason(versions)}")
    return found


def _looking(stated: Plain, groups: Mapping[str, list[str]]) -> list[Plain]:
    """What has a response, once for each group that `member_force` has now to look at."""
    response = stated["response"]
    looks = isinstance(response, dict) and "member_force" in response
    group = str(response["member_force"]["group"]) if looks else ""
    if group not in groups:
        return [stated]
    return [{**stated, "response": {"member_force": {"group": name}}} for name in groups[group]]


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


def _constraints(stated: list[Plain], case: Case, groups: Mapping[str, list[str]], told: list[str]) -> list[Plain]:
    found: list[Plain] = []
    for i, (entry, row) in enumerate(zip(stated, case.constraints, strict=True)):
        if not isinstance(row, VolumeRow):
            versions = _looking(entry, groups)
            if len(versions) == 1 or (versions and row.sense == "limit" and row.over_time in _LARGEST):
                found += versions
            else:
                told.append(f"constraints[{i}] is left out: {_reason(versions)}")
            continue
        names = [name for group in row.groups for name in groups[group]]
        if names:
            found.append({"volume": "all" if entry["volume"] == "all" else names, row.sense: row.bound})
        else:
            told.append(f"constraints[{i}] is left out: no member that it sums up is kept")
    return found
