"""Tables of arrays: what is packed comes back as views, and there is room for what a table says."""

from typing import Annotated, NamedTuple

import numpy as np
import pytest

from mdstopo.compiler.fields import LINE, Field, Fields, FloatArray, IndexArray, aligned, views_of
from mdstopo.compiler.jit import entry, kernel


class Record(NamedTuple):
    mass: Annotated[FloatArray, Field("n", "of each body")]
    pair: Annotated[IndexArray, Field("n_pair, 2", "of bodies")]
    size: Annotated[IndexArray, Field("1", "how many others")]
    member: Annotated[FloatArray, Field("3, padded", "places", on_a_line=True)]
    times: Annotated[FloatArray, Field("n_seg + 1", "of kinks")]
    force: Annotated[FloatArray, Field("n_seg, n", "of loads")]
    other: Annotated[FloatArray, Field("size[0]", "others")]
    threads: Annotated[int, Field("", "how many")] = 0


RECORD = Fields(Record)


@views_of(RECORD, Record, kernel)
def _unpack(ints, floats):
    """The record whose arrays are views."""


@entry
def doubled(ints, floats, out):
    """Sums of all fields, and twice the masses in their place."""
    record = _unpack(ints, floats)
    out[0] = record.mass.sum()
    out[1] = record.pair[1, 0]
    out[2] = record.member[2, 0]
    out[3] = record.times[-1]
    out[4] = record.force[1, 2]
    out[5] = record.other.sum()
    for i in range(record.mass.size):
        record.mass[i] *= 2.0
    return record.threads


def _stub(ints, floats):
    """The record whose arrays are views."""


def made(n: int) -> Record:
    return Record(
        mass=np.arange(1.0, n + 1.0),
        pair=np.array([[0, 1], [7, 2]]),
        size=np.array([2]),
        member=np.arange(15.0).reshape(3, 5),
        times=np.array([0.0, 1.0, 9.0]),
        force=np.arange(2.0 * n).reshape(2, n),
        other=np.array([3.0, 4.0]),
        threads=5,
    )


@pytest.mark.parametrize("n", [3, 4, 8])
def test_kernels_get_back_what_was_packed_as_views(n: int) -> None:
    record = made(n)
    ints, floats = RECORD.packed(record)
    out = np.zeros(6)
    assert doubled(ints, floats, out) == 5
    assert out.tolist() == [record.mass.sum(), 7.0, 10.0, 9.0, n + 2.0, 7.0]
    assert floats[:n].tolist() == (2.0 * record.mass).tolist()


def test_views_are_found_in_python_too() -> None:
    """Before anything is compiled: in a process that finds all its machine code on the disk nothing is."""
    record = made(4)
    fresh = views_of(RECORD, Record, kernel)(_stub)
    found = fresh.py_func(*RECORD.packed(record))  # type: ignore[attr-defined]
    assert all(np.array_equal(one, other) for one, other in zip(found, record, strict=True))
    assert fresh.__name__ == "_stub"
    with pytest.raises(AttributeError, match="_stub has no other"):
        _ = fresh.other  # type: ignore[attr-defined]


def test_sizes_come_first_and_arrays_on_a_line_begin_on_one() -> None:
    ints, floats = RECORD.packed(made(3))
    assert ints[: RECORD.header].tolist() == [3, 2, 5, 2, 5]  # n, n_pair, padded, n_seg, threads
    at = int(np.flatnonzero(floats == 14.0)[0]) - 14
    assert (floats.ctypes.data + 8 * at) % (8 * LINE) == 0
    assert floats[at : at + 15].tolist() == list(range(15))


class Room(NamedTuple):
    state: Annotated[FloatArray, Field("steps + 1, 2, n", "of steps")]
    slope: Annotated[FloatArray, Field("damped, n // 3, 4", "of forces")]
    index: Annotated[IndexArray, Field("steps, 3", "of steps")]


ROOM = Fields(Room, {"n": "limits[0]", "steps": "limits[1]", "damped": "steps if limits[2] != 0 else 0"})


@views_of(ROOM, None, kernel)
def _carve(limits, floats, ints):
    """The arrays as a plain tuple."""


@entry
def ends(limits, floats, ints, out):
    """Write to the last places."""
    state, slope, index = _carve(limits, floats, ints)
    state[-1, -1, -1] = 1.0
    index[-1, -1] = 2
    if slope.size > 0:
        slope[-1, -1, -1] = 3.0
    out[0] = slope.shape[0]


@pytest.mark.parametrize("damped", [0, 1])
def test_there_is_room_for_exactly_what_a_table_says(damped: int) -> None:
    limits, out = np.array([6, 4, damped]), np.zeros(1)
    n_floats, n_ints = ROOM.lengths(limits=limits)
    assert (n_floats, n_ints) == (5 * 2 * 6 + damped * 4 * 2 * 4, 12)
    floats, ints = np.zeros(n_floats), np.zeros(n_ints, dtype=np.int64)
    ends(limits, floats, ints, out)
    assert ints[-1] == 2
    assert floats[-1] == (3.0 if damped else 1.0)
    assert floats[5 * 2 * 6 - 1] == 1.0
    assert out[0] == 4 * damped


def test_an_array_begins_on_a_line_of_the_cache() -> None:
    assert all(aligned((3, k)).ctypes.data % (8 * LINE) == 0 for k in range(1, 20))
