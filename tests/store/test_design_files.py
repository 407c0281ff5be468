"""--alpha FILE: a design is read from three kinds of files; what holds none is refused with a sentence."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mdstopo.store.design_files import read_design
from mdstopo.store.store_errors import StoreError

ALPHA = np.random.default_rng(0).random(6)


def test_each_kind_of_file_gives_the_same_design(tmp_path: Path, make_result: Callable[..., Path]) -> None:
    np.save(tmp_path / "a.npy", ALPHA)
    np.save(tmp_path / "column.npy", ALPHA[:, None])
    np.savetxt(tmp_path / "a.txt", ALPHA, fmt="%.17g", header="a design")
    for name in ("a.npy", "column.npy", "a.txt"):
        assert read_design(tmp_path / name, 6).tobytes() == ALPHA.tobytes(), name
    assert read_design(make_result(), 6).tolist() == np.linspace(0.1, 0.6, 6).tolist()


def test_blanks_commas_and_lines_all_separate_numbers(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("# a design\n1, 0.5\n0.25 0 # rest\n\n1e-3\n")
    assert read_design(tmp_path / "a.txt", 5).tolist() == [1.0, 0.5, 0.25, 0.0, 1e-3]


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.txt", b"0.1 0.2", r"holds 2 values; the case has 3"),
        ("a.txt", b"0.1 zero 0.2", r"a\.txt:1: 'zero' is not a number"),
        ("a.txt", b"0.1\n-0.2\n0.1", r"value 1 \(from 0\) is -0\.2"),
        ("a.txt", b"0.1 nan inf", r"value 1 \(from 0\) is nan, and 1 more"),
        ("a.txt", b"\xff\xfe\x00", r"not a text file"),
        ("a.npy", b"", r"not an array of numbers"),
        ("a.npy", b"\x93NUMPY\x01\x00\x05\x00{bad:", r"not an array of numbers"),
        ("a.npy", b"junk", r"not an array of numbers"),
        ("a.h5", b"junk", r"not a result file"),
        ("a.csv", b"0.1", r"\.npy, \.txt or \.h5"),
    ],
)
def test_what_holds_no_design_is_refused(name: str, content: bytes, sentence: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(StoreError, match=sentence):
        read_design(path, 3)


def test_arrays_that_are_no_real_numbers_are_refused(tmp_path: Path) -> None:
    for array in (np.array(["a", "b"]), np.array([1j, 2.0]), np.array([{}, {}], dtype=object)):
        np.save(tmp_path / "a.npy", array, allow_pickle=True)
        with pytest.raises(StoreError, match="not an array of"):
            read_design(tmp_path / "a.npy", 2)


def test_an_absent_file_is_a_sentence(tmp_path: Path) -> None:
    for suffix in (".npy", ".txt", ".h5"):
        with pytest.raises(StoreError, match="No such file"):
            read_design(tmp_path / f"a{suffix}", 2)
