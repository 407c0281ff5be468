"""Member groups: the points that are joined, the laws of what joins them, what they cost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray, Table
from mdstopo.case.laws.law import numbers
from mdstopo.case.model import GROUND, LAWS, Candidates, Law, MemberGroup, PointGrid
from mdstopo.case.objects.frames import Frames
from mdstopo.case.scene.pairing import Ends, can_be_priced, pairs_of, read_ends
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text
from mdstopo.case.value import Value, frozen

PRICED = "priced"


@frozen
class _Stated(Value):
    """A group as the file states it: its name, its keys, its ends, its laws (None where they could not be read)."""

    name: str
    fields: Fields
    ends: Ends
    laws: tuple[Law, ...] | None


def build_groups(
    sections: Any, points: dict[str, PointGrid], frames: Frames, reading: Reading
) -> dict[str, MemberGroup]:
    """The groups of members by name, without those that cannot be made; the design's numbers are filled in later."""
    groups: dict[str, MemberGroup] = {}
    for name, fields in (sections or {}).items():
        if fields is BAD:
            continue
        laws = build_laws(fields, reading)
        ends = read_ends(fields, points, frames, reading)
        if ends is None or not fields.good("candidates"):
            continue
        stated = _Stated(name, fields, ends, laws)
        if fields["candidates"] == PRICED:
            group = _priced(stated, frames, reading)
        else:
            group = _enumerated(stated, sum(map(len, groups.values())), frames, reading)
        if group is not None:
            groups[name] = group
    return groups


def build_laws(fields: Fields, reading: Reading) -> tuple[Law, ...] | None:
    """The laws of a group, or None where one cannot be read."""
    stated = fields["law"]
    laws: list[Law] = []
    for part in stated if isinstance(stated, list) else [stated]:
        if part is BAD or not part.good():
            continue
        start, end = part["active_from"], part["active_until"]
        if start is not None and end is not None and not start < end:
            message = f"found {number_text(end)}, allowed is a time after active_from {number_text(start)}"
            reading.mistake(inside(part.path, "active_until"), message)
            continue
        values = {key: value for key, value in part.items() if key != "type"}
        if isinstance(values.get("table"), np.ndarray):
            values["table"] = Table(values["table"][:, 0], values["table"][:, 1:])
        law = LAWS[part["type"]].made(part, values, reading)
        if law is not None:
            laws.append(law)
    count = len(stated) if isinstance(stated, list) else 1
    return tuple(laws) if len(laws) == count else None


def _enumerated(stated: _Stated, built: int, frames: Frames, reading: Reading) -> MemberGroup | None:
    """A group whose members are all built; None where it cannot be made, with the mistakes noted.

    built: how many members other groups have. frames: where the bodies stand at the start.
    """
    fields = stated.fields
    pairs = pairs_of(stated.ends, built, reading)
    if pairs is None or stated.laws is None or not fields.good("cost", "design"):
        return None
    if not _in_range(stated.laws, pairs.length, stated.ends, frames, reading):
        return None
    cost = pairs.length if fields["cost"] == "length" else np.full(len(pairs.length), fields["cost"])
    if not _cost_in_range(float(cost.sum()), stated, reading):
        return None
    return _group(stated, stated.laws, (pairs.from_index, pairs.to_index), pairs.length, cost)


def _priced(stated: _Stated, frames: Frames, reading: Reading) -> MemberGroup | None:
    """A group whose members are priced, none of them built yet; None where it cannot be made, with the mistakes noted.

    frames: where the bodies stand at the start.
    """
    fields, ends = stated.fields, stated.ends
    if ends.pairs:
        reading.mistake(inside(ends.path, "candidates"), "found priced, allowed with `connect: pairs` is enumerated")
        return None
    if fields["design"] is False:
        reading.mistake(inside(ends.path, "candidates"), "found priced, allowed with `design: false` is enumerated")
        return None
    if not can_be_priced(ends, reading) or stated.laws is None or not fields.good("cost", "design"):
        return None
    size = float(np.linalg.norm(np.ptp(np.concatenate([ends.first.world, ends.second.world]), axis=0)))
    if not _in_range(stated.laws, np.array([size]), ends, frames, reading):
        return None
    cost = None if fields["cost"] == "length" else float(fields["cost"])
    if not _cost_in_range((size if cost is None else cost) * ends.candidates, stated, reading):
        return None
    nobody = np.zeros(0, dtype=np.intp)
    candidates = Candidates(ends.candidates, *ends.allowed, cost)
    return _group(stated, stated.laws, (nobody, nobody), np.zeros(0), np.zeros(0), candidates)


def _group(
    stated: _Stated,
    laws: tuple[Law, ...],
    joined: tuple[IndexArray, IndexArray],
    length: FloatArray,
    cost: FloatArray,
    candidates: Candidates | None = None,
) -> MemberGroup:
    """The group.

    stated: what the file says of it.
    laws: `stated.laws`, known to be there.
    joined: the points P and Q of its members.
    length: of each of them at the start (m).
    cost: of each of them.
    candidates: of a priced group.
    """
    first, second = stated.ends.first, stated.ends.second
    return MemberGroup(
        name=stated.name,
        body_from=first.body,
        body_to=second.body,
        from_local=first.local,
        to_local=second.local,
        from_world=first.world,
        to_world=second.world,
        from_index=joined[0],
        to_index=joined[1],
        length=length,
        laws=laws,
        cost=cost,
        design=stated.fields["design"],
        candidates=candidates,
        from_points=first.grid,
        to_points=second.grid,
        cost_by_length=stated.fields["cost"] == "length",
    )


def _cost_in_range(total: float, stated: _Stated, reading: Reading) -> bool:
    """Whether the cost of a whole group is a number; notes where it is not. total: the sum."""
    if math.isfinite(total):
        return True
    reading.mistake(inside(stated.ends.path, "cost"), "the sum over the group is too large for a number")
    return False


def _in_range(laws: tuple[Law, ...], length: FloatArray, ends: Ends, frames: Frames, reading: Reading) -> bool:
    """Whether forces, energies and accelerations of the whole group stay finite; notes parameters that are too large.

    laws: of the members.
    length (n,): of the members at the start (m).
    ends: which bodies they join.
    frames: the bodies, with their masses (kg) and inertias (kg m²).
    reading: takes the mistakes.
    """
    longest = max(float(length.max()), 1.0)
    bodies = [name for name in (ends.first.body, ends.second.body) if name != GROUND]
    masses = [frames.geometry.least(frames.bodies[name]) for name in bodies]
    worst = len(length) * longest * longest / min([1.0, *masses])
    good = True
    for index, law in enumerate(laws):
        for key in type(law).__dataclass_fields__ if numbers(type(law)) else ():
            value = getattr(law, key)
            if isinstance(value, float) and not math.isfinite(value * worst):
                # A list of laws has indices in its key paths, a single law has none.
                where = inside(ends.path, "law")
                several = inside(f"{where}[{index}]", key)
                at = several if reading.has_place(several) else inside(where, key)
                message = f"found {number_text(value)}: the group's forces are too large for a number"
                reading.mistake(at, message)
                good = False
    return good
