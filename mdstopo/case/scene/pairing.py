"""Which points of two grids are joined with each other: the pairs that the filters of a member group leave."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.memory import BYTES_PER_MEMBER, total_memory
from mdstopo.case.model import PointGrid
from mdstopo.case.objects.frames import Frames
from mdstopo.case.scene.candidates import ROUNDING, allowed_lengths, coincident, lengths_between
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import count_text, inside, number_text
from mdstopo.case.value import Value, frozen

CHUNK = 1 << 18
MOST_CANDIDATES = 10**10
"""Pairs that filters may try, or that may be priced; more would take minutes."""


@frozen
class End(Value):
    """The points at one end. text: what they are called; grid: their name, empty for a point in place."""

    body: str
    local: FloatArray
    world: FloatArray
    text: str
    grid: str


@frozen
class Ends(Value):
    """The points P and Q of a group, and which of them are joined.

    path: where the group stands in the file.
    first, second: the points P and Q.
    pairs: whether points of equal number are joined; else each with each.
    low, high: the lengths that the filters let pass (m); high: None for any.
    """

    path: str
    first: End
    second: End
    pairs: bool
    low: float
    high: float | None

    @property
    def candidates(self) -> int:
        """How many members there are before the filters."""
        n_p = len(self.first.world)
        return n_p if self.pairs else n_p * len(self.second.world)

    @property
    def filtered(self) -> bool:
        """Whether lengths are limited."""
        return self.low > 0.0 or self.high is not None

    @property
    def scale(self) -> float:
        """The largest coordinate of a point at the start (m)."""
        return float(max(np.abs(self.first.world).max(), np.abs(self.second.world).max()))

    @property
    def allowed(self) -> tuple[float, float]:
        """The shortest and the longest length that the filters let pass, with their rounding (m)."""
        return allowed_lengths(self.low, self.high, self.scale)

    def chunks(self) -> Iterator[tuple[slice, IndexArray, IndexArray]]:
        """All candidates in order, CHUNK at a time: their places, their points P, their points Q."""
        total, n_q = self.candidates, len(self.second.world)
        for start in range(0, total, CHUNK):
            place = slice(start, min(start + CHUNK, total))
            member = np.arange(place.start, place.stop, dtype=np.intp)
            yield (place, member, member) if self.pairs else (place, *np.divmod(member, n_q))

    def lengths(self, i: IndexArray, j: IndexArray) -> FloatArray:
        """(n,) the distances of points P i from points Q j at the start (m)."""
        return lengths_between(self.first.world[i], self.second.world[j])


@frozen
class Pairs(Value):
    """The members that the filters leave: their points P and Q, and their lengths at the start (m), (M,) each."""

    from_index: IndexArray
    to_index: IndexArray
    length: FloatArray


def read_ends(fields: Fields, points: dict[str, PointGrid], frames: Frames, reading: Reading) -> Ends | None:
    """The ends of a group; None where they cannot be told, with the mistakes noted.

    fields: the group in the file. points: the point grids by name. frames: where the bodies stand at the start.
    """
    path = fields.path
    first, second = (_end(fields, key, points, frames, reading) for key in ("from", "to"))
    good = fields.good("min_length", "max_length")
    low, high = fields["min_length"], fields["max_length"]
    if good and high is not None and low > high:
        message = f"found {number_text(high)}, allowed is at least min_length {number_text(low)}"
        reading.mistake(inside(path, "max_length"), message)
        good = False
    if first is None or second is None:
        return None
    if first.body == second.body:
        reading.mistake(path, f"both ends are on {first.body!r}; a member joins two bodies")
        return None
    if not good or not fields.good("connect"):
        return None
    return Ends(path, first, second, fields["connect"] == "pairs", low, high)


def _end(fields: Fields, key: str, points: dict[str, PointGrid], frames: Frames, reading: Reading) -> End | None:
    """The points at one end of a group; None where they cannot be told. key: `from` or `to`."""
    end = fields[key]
    if isinstance(end, str):
        grid = points.get(end)
        return None if grid is None else End(grid.body, grid.local, grid.world, end, end)
    if end is BAD or not end.good() or end["body"] not in frames.bodies:
        return None
    local = frames.local_point(end["body"], end["at"], end["frame"], inside(end.path, "at"), reading)
    if local is BAD:
        return None
    _, world = frames.point(end["body"], end["at"], end["frame"])
    return End(end["body"], np.array([local]), np.array([world]), "the point", "")


def pairs_of(ends: Ends, built: int, reading: Reading) -> Pairs | None:
    """The members between the ends; None where there are none or too many, or one has no length: the mistake is noted.

    built: how many members other groups have, which need memory, too.
    """
    left = total_memory() // BYTES_PER_MEMBER - built
    if not _can_be_tried(ends, left, reading):
        return None
    pairs = _all_pairs(ends) if not (ends.filtered or ends.pairs) else _filtered(ends, left, reading)
    if pairs is None:
        return None
    zero = np.flatnonzero(pairs.length <= ROUNDING * ends.scale)
    if len(zero):
        _note_zero(len(zero), (int(pairs.from_index[zero[0]]), int(pairs.to_index[zero[0]])), ends, reading)
        return None
    if not len(pairs.length):
        _note_empty(ends, reading)
        return None
    return pairs


def can_be_priced(ends: Ends, reading: Reading) -> bool:
    """Whether all members between the ends can be priced without building them; notes why not."""
    if ends.candidates > MOST_CANDIDATES:
        most = count_text(MOST_CANDIDATES)
        message = f"{count_text(ends.candidates)} candidates are more than can be priced; allowed are {most}"
        reading.mistake(ends.path, message)
        return False
    if ends.low == 0.0:
        zero, first_zero = coincident(ends.first.world, ends.second.world, ROUNDING * ends.scale)
        if zero:
            _note_zero(zero, first_zero, ends, reading)
            return False
    return True


def _can_be_tried(ends: Ends, left: int, reading: Reading) -> bool:
    """Whether there are as many points as `pairs` needs, and not too many candidates; notes what is wrong.

    left: for how many members there is memory.
    """
    n_p, n_q = len(ends.first.world), len(ends.second.world)
    if ends.pairs and n_p != n_q:
        message = f"{ends.first.text} has {n_p:,} points and {ends.second.text} {n_q:,}; pairs need equal counts"
        reading.mistake(inside(ends.path, "connect"), message)
        return False
    most = MOST_CANDIDATES if ends.filtered else left
    if ends.candidates > most:
        what = "more than can be filtered" if ends.filtered else "more than memory holds"
        message = f"{count_text(ends.candidates)} members are {what}; allowed are {count_text(most)}"
        reading.mistake(ends.path, message)
        return False
    return True


def _all_pairs(ends: Ends) -> Pairs:
    """Every point with every point: the common case, without temporaries of the candidates' size."""
    n_p, n_q = len(ends.first.world), len(ends.second.world)
    length = np.empty(ends.candidates)
    for place, i, j in ends.chunks():
        length[place] = ends.lengths(i, j)
    return Pairs(np.repeat(np.arange(n_p, dtype=np.intp), n_q), np.tile(np.arange(n_q, dtype=np.intp), n_p), length)


def _filtered(ends: Ends, left: int, reading: Reading) -> Pairs | None:
    """The pairs whose lengths the filters let pass; None where these are more than `left`, with the mistake noted."""
    kept: list[tuple[IndexArray, IndexArray, FloatArray]] = []
    count = 0
    shortest, longest = ends.allowed
    for _, i, j in ends.chunks():
        lengths = ends.lengths(i, j)
        keep = (lengths >= shortest) & (lengths <= longest)
        if ends.low > 0.0:
            keep &= lengths > 0.0
        kept.append((i[keep], j[keep], lengths[keep]))
        count += int(keep.sum())
        if count > left:
            message = f"more than {count_text(left)} members pass the filters: more than memory holds"
            reading.mistake(ends.path, message)
            return None
    return Pairs(*(np.concatenate(parts) for parts in zip(*kept, strict=True)))


def _note_zero(count: int, first_zero: tuple[int, int], ends: Ends, reading: Reading) -> None:
    """The mistake that ends of members coincide. first_zero: the points P and Q of the first of them."""
    at = ", ".join(f"{value:g}" for value in ends.first.world[first_zero[0]])
    reading.mistake(
        ends.path,
        f"{count_text(count)} of the members would have zero length, the first from P "
        f"{first_zero[0]} to Q {first_zero[1]} at [{at}]; move the points or set min_length",
    )


def _note_empty(ends: Ends, reading: Reading) -> None:
    """The mistake that no member is within the stated lengths, with the distances that there are."""
    least, most = math.inf, 0.0
    for point in ends.first.world:  # one by one: all distances at once may be too many for the memory
        apart = lengths_between(point, ends.second.world)
        least, most = min(least, float(apart.min())), max(most, float(apart.max()))
    reading.mistake(
        ends.path, f"min_length and max_length leave no member; the points are {least:.4g} to {most:.4g} m apart"
    )
