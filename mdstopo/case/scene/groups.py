"""Member groups: grids joined, filters applied, laws read."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray, Table
from mdstopo.case.laws.law import numbers
from mdstopo.case.memory import BYTES_PER_MEMBER, total_memory
from mdstopo.case.model import GROUND, LAWS, Candidates, Law, MemberGroup, PointGrid
from mdstopo.case.objects.frames import Frames
from mdstopo.case.scene.candidates import ROUNDING, allowed_lengths, coincident, lengths_between
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import count_text, inside, number_text
from mdstopo.case.value import Value, frozen

CHUNK = 1 << 18
MOST_CANDIDATES = 10**10
"""Pairs that filters may try, or that may be priced; more would take minutes."""
PRICED = "priced"


@frozen
class _End(Value):
    """The points at one end. text: what they are called; grid: their name, empty for a point in place."""

    body: str
    local: FloatArray
    world: FloatArray
    text: str
    grid: str


@frozen
class _Pairs(Value):
    """Candidates after the filters; zero: of how many the ends coincide, and the first of them."""

    from_index: IndexArray
    to_index: IndexArray
    length: FloatArray
    zero: int
    first_zero: tuple[int, int]


def build_groups(
    sections: Any, points: dict[str, PointGrid], frames: Frames, reading: Reading
) -> dict[str, MemberGroup]:
    """The groups of members by name, without those that cannot be made; the design's numbers are filled in later."""
    groups: dict[str, MemberGroup] = {}
    left = total_memory() // BYTES_PER_MEMBER
    for name, fields in (sections or {}).items():
        if fields is BAD:
            continue
        laws = build_laws(fields, reading)
        group = _build_group(name, fields, laws, points, frames, reading, left)
        if group is not None:
            left -= len(group)
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


def _build_group(
    name: str,
    fields: Fields,
    laws: tuple[Law, ...] | None,
    points: dict[str, PointGrid],
    frames: Frames,
    reading: Reading,
    left: int,
) -> MemberGroup | None:
    """A group of members; None where it cannot be made, with the mistakes noted.

    name: the group's.
    fields: the group in the file.
    laws: of its members; None where they could not be read.
    points: the point grids by name.
    frames: where the bodies stand at the start.
    reading: takes the mistakes.
    left: for how many members there is memory.
    """
    path = fields.path
    first = _end(fields, "from", points, frames, reading)
    second = _end(fields, "to", points, frames, reading)
    limits_good = fields.good("min_length", "max_length")
    low, high = fields["min_length"], fields["max_length"]
    if limits_good and high is not None and low > high:
        message = f"found {number_text(high)}, allowed is at least min_length {number_text(low)}"
        reading.mistake(inside(path, "max_length"), message)
        limits_good = False
    if first is None or second is None:
        return None
    if first.body == second.body:
        reading.mistake(path, f"both ends are on {first.body!r}; a member joins two bodies")
        return None
    if not (limits_good and fields.good("connect", "candidates")):
        return None
    if fields["candidates"] == PRICED:
        return _priced_group(name, fields, laws, first, second, frames, reading)
    pairs = _connect(first, second, fields["connect"], low, high, path, reading, left)
    if pairs is None:
        return None
    if pairs.zero:
        _note_zero(pairs.zero, pairs.first_zero, first, path, reading)
        return None
    if not len(pairs.length):
        _note_empty(first, second, path, reading)
        return None
    if laws is None or not fields.good("cost", "design"):
        return None
    if not _in_range(laws, pairs.length, (first.body, second.body), frames, path, reading):
        return None
    cost = pairs.length if fields["cost"] == "length" else np.full(len(pairs.length), fields["cost"])
    if not math.isfinite(float(cost.sum())):
        reading.mistake(inside(path, "cost"), "the sum over the group is too large for a number")
        return None
    return MemberGroup(
        name,
        first.body,
        second.body,
        first.local,
        second.local,
        first.world,
        second.world,
        pairs.from_index,
        pairs.to_index,
        pairs.length,
        laws,
        cost,
        fields["design"],
        from_points=first.grid,
        to_points=second.grid,
        cost_by_length=fields["cost"] == "length",
    )


def _note_zero(count: int, first_zero: tuple[int, int], first: _End, path: str, reading: Reading) -> None:
    """The mistake that ends of members coincide. first: the points P."""
    at = ", ".join(f"{value:g}" for value in first.world[first_zero[0]])
    reading.mistake(
        path,
        f"{count_text(count)} of the members would have zero length, the first from P "
        f"{first_zero[0]} to Q {first_zero[1]} at [{at}]; move the points or set min_length",
    )


def _note_empty(first: _End, second: _End, path: str, reading: Reading) -> None:
    """The mistake that no member is within the stated lengths, with the distances that there are."""
    least, most = math.inf, 0.0
    for point in first.world:  # one by one: all distances at once may be too many for the memory
        apart = lengths_between(point, second.world)
        least, most = min(least, float(apart.min())), max(most, float(apart.max()))
    reading.mistake(
        path, f"min_length and max_length leave no member; the points are {least:.4g} to {most:.4g} m apart"
    )


def _priced_group(
    name: str,
    fields: Fields,
    laws: tuple[Law, ...] | None,
    first: _End,
    second: _End,
    frames: Frames,
    reading: Reading,
) -> MemberGroup | None:
    """A group whose members are priced, none of them built yet; None where it cannot be made, with the mistakes noted.

    name: the group's.
    fields: the group in the file.
    laws: of its members; None where they could not be read.
    first, second: the points at the two ends.
    frames: where the bodies stand at the start.
    reading: takes the mistakes.
    """
    path = fields.path
    if fields["connect"] == "pairs":
        reading.mistake(inside(path, "candidates"), "found priced, allowed with `connect: pairs` is enumerated")
        return None
    if fields["design"] is False:
        reading.mistake(inside(path, "candidates"), "found priced, allowed with `design: false` is enumerated")
        return None
    count = len(first.world) * len(second.world)
    if count > MOST_CANDIDATES:
        most = count_text(MOST_CANDIDATES)
        reading.mistake(path, f"{count_text(count)} candidates are more than can be priced; allowed are {most}")
        return None
    scale = float(max(np.abs(first.world).max(), np.abs(second.world).max()))
    shortest, longest = allowed_lengths(fields["min_length"], fields["max_length"], scale)
    if fields["min_length"] == 0.0:
        zero, first_zero = coincident(first.world, second.world, ROUNDING * scale)
        if zero:
            _note_zero(zero, first_zero, first, path, reading)
            return None
    if laws is None or not fields.good("cost", "design"):
        return None
    size = float(np.linalg.norm(np.ptp(np.concatenate([first.world, second.world]), axis=0)))
    if not _in_range(laws, np.array([size]), (first.body, second.body), frames, path, reading):
        return None
    cost = None if fields["cost"] == "length" else float(fields["cost"])
    if not math.isfinite((size if cost is None else cost) * count):
        reading.mistake(inside(path, "cost"), "the sum over the group is too large for a number")
        return None
    none = np.zeros(0, dtype=np.intp)
    return MemberGroup(
        name,
        first.body,
        second.body,
        first.local,
        second.local,
        first.world,
        second.world,
        none,
        none,
        np.zeros(0),
        laws,
        np.zeros(0),
        True,
        candidates=Candidates(count, shortest, longest, cost),
        from_points=first.grid,
        to_points=second.grid,
        cost_by_length=cost is None,
    )


def _end(fields: Fields, key: str, points: dict[str, PointGrid], frames: Frames, reading: Reading) -> _End | None:
    end = fields[key]
    if isinstance(end, str):
        grid = points.get(end)
        return None if grid is None else _End(grid.body, grid.local, grid.world, end, end)
    if end is BAD or not end.good() or end["body"] not in frames.bodies:
        return None
    local = frames.local_point(end["body"], end["at"], end["frame"], inside(end.path, "at"), reading)
    if local is BAD:
        return None
    _, world = frames.point(end["body"], end["at"], end["frame"])
    return _End(end["body"], np.array([local]), np.array([world]), "the point", "")


def _connect(
    first: _End,
    second: _End,
    connect: str,
    low: float,
    high: float | None,
    path: str,
    reading: Reading,
    left: int,
) -> _Pairs | None:
    """Join points to members and apply the filters; None where that gives too many, with the mistake noted.

    first, second: the points at the two ends.
    connect: `pairs` joins points of equal number, `all` each to each.
    low, high: the lengths that the filters let pass (m); high may be None.
    path: where the group stands in the file.
    reading: takes the mistakes.
    left: for how many members there is memory.
    """
    n_p, n_q = len(first.world), len(second.world)
    if connect == "pairs" and n_p != n_q:
        message = f"{first.text} has {n_p:,} points and {second.text} {n_q:,}; pairs need equal counts"
        reading.mistake(inside(path, "connect"), message)
        return None
    candidates = n_p if connect == "pairs" else n_p * n_q
    filtered = low > 0.0 or high is not None
    most = MOST_CANDIDATES if filtered else left
    if candidates > most:
        what = "more than can be filtered" if filtered else "more than memory holds"
        reading.mistake(path, f"{count_text(candidates)} members are {what}; allowed are {count_text(most)}")
        return None
    scale = max(np.abs(first.world).max(), np.abs(second.world).max())
    if not filtered and connect == "all":
        # The common case without temporaries of the candidates' size.
        length = np.empty(candidates)
        for start, stop, i, j in _chunks(n_p, n_q, connect):
            length[start:stop] = lengths_between(first.world[i], second.world[j])
        from_index = np.repeat(np.arange(n_p, dtype=np.intp), n_q)
        to_index = np.tile(np.arange(n_q, dtype=np.intp), n_p)
        return _checked(from_index, to_index, length, scale)
    kept: list[tuple[IndexArray, IndexArray, FloatArray]] = []
    count = 0
    shortest, longest = allowed_lengths(low, high, scale)
    for _, _, i, j in _chunks(n_p, n_q, connect):
        lengths = lengths_between(first.world[i], second.world[j])
        keep = (lengths >= shortest) & (lengths <= longest)
        if low > 0.0:
            keep &= lengths > 0.0
        kept.append((i[keep], j[keep], lengths[keep]))
        count += int(keep.sum())
        if count > left:
            message = f"more than {count_text(left)} members pass the filters: more than memory holds"
            reading.mistake(path, message)
            return None
    i, j, length = (np.concatenate(parts) for parts in zip(*kept, strict=True))
    return _checked(i, j, length, scale)


def _chunks(n_p: int, n_q: int, connect: str) -> Any:
    """(start, stop, i, j) over all candidates in order, CHUNK at a time."""
    total = n_p if connect == "pairs" else n_p * n_q
    for start in range(0, total, CHUNK):
        stop = min(start + CHUNK, total)
        member = np.arange(start, stop, dtype=np.intp)
        yield (start, stop, member, member) if connect == "pairs" else (start, stop, *np.divmod(member, n_q))


def _checked(i: IndexArray, j: IndexArray, length: FloatArray, scale: float) -> _Pairs:
    zero = np.flatnonzero(length <= ROUNDING * scale)
    first = (int(i[zero[0]]), int(j[zero[0]])) if len(zero) else (0, 0)
    return _Pairs(i, j, length, len(zero), first)


def _in_range(
    laws: tuple[Law, ...],
    length: FloatArray,
    bodies: tuple[str, str],
    frames: Frames,
    path: str,
    reading: Reading,
) -> bool:
    """Whether forces, energies and accelerations of the whole group stay finite; notes parameters that are too large.

    laws: of the members.
    length (n,): of the members at the start (m).
    bodies: names of the two that they join.
    frames: the bodies, with their masses (kg) and inertias (kg m²).
    path: where the group stands in the file.
    reading: takes the mistakes.
    """
    longest = max(float(length.max()), 1.0)
    masses = [frames.geometry.least(frames.bodies[name]) for name in bodies if name != GROUND]
    worst = len(length) * longest * longest / min([1.0, *masses])
    good = True
    for index, law in enumerate(laws):
        if not numbers(type(law)):
            continue
        for key in type(law).__dataclass_fields__:
            value = getattr(law, key)
            if isinstance(value, float) and not math.isfinite(value * worst):
                # A list of laws has indices in its key paths, a single law has none.
                where = inside(path, "law")
                single = inside(where, key)
                several = inside(f"{where}[{index}]", key)
                at = several if reading.has_place(several) else single
                message = f"found {number_text(value)}: the group's forces are too large for a number"
                reading.mistake(at, message)
                good = False
    return good
