"""Result files from anybody: nothing outside the file is read, nothing larger than it, and no damage goes unseen."""

import struct
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from mdstopo.store import writing
from mdstopo.store.contents import Contents
from mdstopo.store.image import encode
from mdstopo.store.result_reader import read_result
from mdstopo.store.seal import lookup3, right_superblock
from mdstopo.store.store_errors import DamagedError, UnreadableError
from mdstopo.store.untrusted import check_heaps
from mdstopo.store.writing import read_back

MakeResult = Callable[..., Path]


def external_link(file: h5py.File, folder: Path) -> None:
    with h5py.File(folder / "other.h5", "w") as other:
        other["secret"] = np.arange(6.0)
    file["design/other"] = h5py.ExternalLink(folder / "other.h5", "secret")


def soft_link(file: h5py.File, folder: Path) -> None:
    file["design/other"] = h5py.SoftLink("/members/p")


def twice(file: h5py.File, folder: Path) -> None:
    file["design/other"] = file["design/alpha"]


def circle(file: h5py.File, folder: Path) -> None:
    file["design/again"] = file["design"]


def doubled_groups(file: h5py.File, folder: Path) -> None:
    """Forty groups, each twice in the one before: a million million ways to the last one."""
    group = file.create_group("sensitivities")
    for _ in range(40):
        inner = group.create_group("a")
        group["b"] = inner
        group = inner


def external_dataset(file: h5py.File, folder: Path) -> None:
    (folder / "secret").write_bytes(bytes(48))
    file.create_dataset("design/other", (6,), "f8", external=[(folder / "secret", 0, 48)])


def virtual_dataset(file: h5py.File, folder: Path) -> None:
    with h5py.File(folder / "other.h5", "w") as other:
        other["secret"] = np.arange(6.0)
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource(folder / "other.h5", "secret", (6,))
    file.create_virtual_dataset("design/other", layout)


def bomb(file: h5py.File, folder: Path) -> None:
    file.create_dataset("design/other", (1 << 24,), "f8", chunks=(1 << 20,), compression="gzip", data=None)


def never_written(file: h5py.File, folder: Path) -> None:
    file.create_dataset("design/other", (1 << 40,), "f8", chunks=(1 << 20,))


def of_records(file: h5py.File, folder: Path) -> None:
    file["design/other"] = np.zeros(3, dtype=[("a", "f8"), ("b", "i4")])


HOSTILE = [
    (external_link, "a link to another place"),
    (soft_link, "a link to another place"),
    (twice, "under another name"),
    (circle, "under another name"),
    (doubled_groups, "groups within groups"),
    (external_dataset, "lies in another file"),
    (virtual_dataset, "lies in another file"),
    (bomb, "is compressed"),
    (never_written, "larger than the file"),
    (of_records, "neither numbers nor text"),
]


@pytest.mark.parametrize(("change", "words"), HOSTILE, ids=lambda each: getattr(each, "__name__", ""))
def test_what_leads_out_of_the_file_or_beyond_it_is_refused(
    change: Callable[[h5py.File, Path], None], words: str, make_result: MakeResult, tmp_path: Path
) -> None:
    path = make_result()
    with h5py.File(path, "r+") as file:
        change(file, tmp_path)
    with pytest.raises(DamagedError, match=rf"probe\.h5: .*{words}"):
        read_result(path)


def test_what_others_add_beside_is_not_looked_at(make_result: MakeResult) -> None:
    path = make_result()
    with h5py.File(path, "r+") as file:
        file["my notes"] = "good"
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "x")
    view = read_result(path)
    assert view.title == "Prüfstück"
    assert "my notes" not in view.texts


def test_a_pipe_is_no_result_and_is_not_waited_for(tmp_path: Path) -> None:
    import os

    os.mkfifo(tmp_path / "pipe.h5")
    with pytest.raises(Exception, match="no file on a disk"):
        read_result(tmp_path / "pipe.h5")


def test_every_flipped_bit_of_a_sealed_file_is_found(make_result: MakeResult) -> None:
    path = make_result()
    whole = path.read_bytes()
    rng = np.random.default_rng(3)
    places = [*rng.integers(0, len(whole), 200).tolist(), *range(len(whole) - 40, len(whole))]
    for place in places:
        broken = bytearray(whole)
        broken[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(broken)
        with pytest.raises(DamagedError):
            read_result(path)


def legacy(path: Path) -> None:
    """Make a result as earlier versions wrote it: texts of variable length, no seal."""
    with h5py.File(path, "r+") as file:
        for name in ("case", "resume/case", "files/pulses/p.csv"):
            text = file[name].asstr()[()]
            del file[name]
            file[name] = text


def test_files_of_earlier_versions_are_read(make_result: MakeResult) -> None:
    path = make_result()
    before = read_result(path)
    legacy(path)
    after = read_result(path)
    assert after.texts == before.texts
    assert after.settings == before.settings
    assert after.title == before.title


def test_a_heap_of_texts_that_hdf5_would_never_leave_is_refused(make_result: MakeResult) -> None:
    path = make_result()
    legacy(path)
    data = bytearray(path.read_bytes())
    check_heaps(bytes(data))
    start = data.find(b"GCOL\x01")
    for size in (0, 8, 1 << 60):
        broken = data[:]
        struct.pack_into("<HH4xQ", broken, start + 16, 0, 0, size)  # free space of this size
        path.write_bytes(broken)
        with pytest.raises(DamagedError, match="heap of texts"):
            read_result(path)


def test_the_superblock_gets_the_checksum_that_hdf5_gives() -> None:
    assert lookup3(b"Four score and seven years ago") == 0x17770551  # from the author's own test
    assert lookup3(b"") == 0xDEADBEEF
    image = encode({"": {}}, {"design/alpha": np.ones(3)})
    assert struct.unpack_from("<I", image, 44)[0] == lookup3(image[:44])


def test_the_image_of_an_open_file_is_made_readable(tmp_path: Path) -> None:
    """HDF5 1.14 clears the flag of a file open for writing but keeps the checksum made with it."""
    image = encode({"": {}}, {"design/alpha": np.ones(3)})
    flagged = image[:11] + b"\5" + image[12:44]
    stale = image[:44] + struct.pack("<I", lookup3(flagged)) + image[48:]
    path = tmp_path / "a.h5"
    path.write_bytes(stale)
    with pytest.raises(OSError, match="checksum"):
        h5py.File(path, "r")
    path.write_bytes(right_superblock(stale))
    with h5py.File(path, "r") as file:
        assert file["design/alpha"][()].tolist() == [1.0, 1.0, 1.0]


def test_what_cannot_be_read_back_replaces_nothing(
    make_result: MakeResult, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As with a library that writes what it cannot read."""
    from tests.fakes import hand_made_case

    path = make_result()
    before = path.read_bytes()
    contents = Contents.begun(hand_made_case(), "run", "", {"design/alpha": np.ones(6)})
    good = writing.result_image
    broken: Callable[..., bytes] = lambda *given: good(*given).replace(b"OHDR", b"OHDX")  # noqa: E731
    monkeypatch.setattr(writing, "result_image", broken)
    with pytest.raises(UnreadableError, match=r"cannot be read back .*h5py \d"):
        writing.write_result(path, contents)
    assert path.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_another_number_than_was_written_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(encode({"": {}}, {"design/alpha": np.ones(3), "case": "text"}))
    read_back(path, {"design/alpha": np.ones(3), "case": "text"})
    for wrong in ({"design/alpha": np.zeros(3)}, {"design/alpha": np.ones(4)}, {"case": "test"}, {"absent": "x"}):
        with pytest.raises(UnreadableError):
            read_back(path, wrong)


def test_texts_that_hdf5_cannot_hold_are_written_with_a_mark(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(encode({"": {"title": "a\0b"}}, {"warnings": ["c\0d", "file\udcff"]}))
    with h5py.File(path, "r") as file:
        assert file.attrs["title"] == "a\N{REPLACEMENT CHARACTER}b"
        assert file["warnings"].asstr()[0] == "c\N{REPLACEMENT CHARACTER}d"
