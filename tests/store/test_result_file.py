"""Result files: what is written is read back, and what is no whole result is refused with a sentence."""

import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from mdstopo.case.model import Case
from mdstopo.store.contents import case_part, sensitivity_part
from mdstopo.store.image import encode
from mdstopo.store.result_reader import read_result
from mdstopo.store.store_errors import DamagedError, StoreError

MakeResult = Callable[..., Path]


def test_the_file_has_the_paths_and_attributes_of_the_contract(make_result: MakeResult, case: Case) -> None:
    with h5py.File(make_result(), "r") as file:
        assert int(file.attrs["format"]) == 1
        assert file.attrs["case_sha256"] == case.sha256
        assert file.attrs["status"] == "converged"
        assert file.attrs["mdstopo"] == "0.1.0"
        assert file["case"].asstr()[()] == case.text
        assert file["files/pulses/p.csv"].asstr()[()] == "ab" * 32
        assert file["members/p"].shape == file["members/q"].shape == (8, 2)
        assert list(file["members/group"].asstr()[:]) == ["belts"] * 6 + ["gürtel"] * 2
        assert file["members/design"][:].tolist() == [True] * 6 + [False] * 2
        assert file["members/p"][4].tolist() == [0.25, -0.25]
        assert file["members/q"][4].tolist() == [0.0, -1.0]
        assert file["design/alpha"].shape == (6,)


def test_text_is_stored_as_utf8(make_result: MakeResult) -> None:
    with h5py.File(make_result(), "r") as file:
        for name in ("case", "members/group", "warnings", "objectives"):
            assert h5py.check_string_dtype(file[name].dtype).encoding == "utf-8", name


@pytest.mark.parametrize(
    "array",
    [
        np.array([np.pi, -0.0, np.nan, np.inf, 5e-324]),
        np.array(1.0 / 3.0),
        np.array(7, dtype=np.int64),
        np.zeros((0, 6)),
        np.array([], dtype=np.int64),
        np.array([True, False]),
        np.array(True),
        np.arange(12, dtype=np.uint8).reshape(3, 4),
        np.random.default_rng(1).normal(size=(2, 3, 5)),
    ],
    ids=str,
)
def test_arrays_come_back_bit_for_bit(array: np.ndarray, make_result: MakeResult, tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    path.write_bytes(encode({"": {}}, {"optimizer/0/x": array}))
    with h5py.File(path, "r") as file:
        back = np.asarray(file["optimizer/0/x"][()])
    assert back.dtype == array.dtype
    assert back.shape == array.shape
    assert back.tobytes() == array.tobytes()


def test_a_view_gives_back_what_was_written(make_result: MakeResult, case: Case) -> None:
    view = read_result(make_result())
    assert view.case_text == case.text
    assert view.title == "Prüfstück"
    assert view.alpha.tolist() == np.linspace(0.1, 0.6, 6).tolist()
    assert view.settings == {"seed": 3}
    assert view.provenance["python"].count(".") == 2
    assert view.under("iterations")["objectives"].shape == (2, 1)
    assert view.lines("members/group")[-1] == "gürtel"
    assert view.finished


def test_groups_can_be_left_unread(make_result: MakeResult) -> None:
    view = read_result(make_result(), leave_out=("optimizer", "members"))
    assert not view.under("optimizer")
    assert not view.under("members")
    assert view.alpha.shape == (6,)


@pytest.mark.parametrize(("status", "finished"), [("running", False), ("interrupted", False), ("failed", True)])
def test_only_running_and_interrupted_runs_are_unfinished(status: str, finished: bool, make_result: MakeResult) -> None:
    assert read_result(make_result(status)).finished is finished


def test_every_truncation_is_refused_with_a_sentence(make_result: MakeResult, tmp_path: Path) -> None:
    whole = make_result().read_bytes()
    path = tmp_path / "cut.h5"
    for length in {*range(0, len(whole), 397), 1, 7, 8, 9, len(whole) - 1}:
        path.write_bytes(whole[:length])
        with pytest.raises(DamagedError, match=r"cut\.h5: (damaged|not a result)"):
            read_result(path)


def attempt(path: Path) -> tuple[str, bytes]:
    """Why a file is refused, or the design in it."""
    try:
        return "", read_result(path).alpha.tobytes()
    except DamagedError as error:
        return str(error), b""


def test_flipped_bytes_are_refused_or_harmless_never_a_traceback(make_result: MakeResult, tmp_path: Path) -> None:
    path = make_result()
    whole, good = path.read_bytes(), read_result(path)
    rng = np.random.default_rng(5)
    refused = 0
    for place in rng.integers(8, len(whole), 150):
        broken = bytearray(whole)
        broken[place] ^= 0xFF
        path.write_bytes(broken)
        sentence, alpha = attempt(path)
        refused += bool(sentence)
        assert "\n" not in sentence
        assert alpha in (b"", good.alpha.tobytes())
    assert refused > 10


def test_a_foreign_hdf5_file_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1.0
    with pytest.raises(DamagedError, match="not a result file of mdstopo"):
        read_result(tmp_path / "other.h5")


def test_another_kind_of_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.h5").write_text("format: 1\n")
    with pytest.raises(DamagedError, match="is no HDF5 file"):
        read_result(tmp_path / "x.h5")
    with pytest.raises(StoreError, match="No such file"):
        read_result(tmp_path / "absent.h5")
    with pytest.raises(StoreError, match="Is a directory"):
        read_result(tmp_path)


def test_a_later_format_is_refused_by_its_number(make_result: MakeResult) -> None:
    path = make_result()
    with h5py.File(path, "r+") as file:
        file.attrs["format"] = 2
    with pytest.raises(DamagedError, match="written in format 2"):
        read_result(path)


def test_a_missing_dataset_is_named(make_result: MakeResult) -> None:
    path = make_result()
    with h5py.File(path, "r+") as file:
        del file["design/alpha"]
    with pytest.raises(DamagedError, match="design/alpha"):
        _ = read_result(path).alpha


def test_sensitivities_stand_below_their_method_where_there_are_several() -> None:
    gradient = np.ones(3)
    assert set(sensitivity_part({"G": gradient})) == {"sensitivities/G"}
    assert set(sensitivity_part({"G": gradient}, "adjoint")) == {"sensitivities/adjoint/G"}


def test_the_same_result_makes_the_same_bytes(case: Case) -> None:
    parts = case_part(case)
    first = encode({"": {"format": 1}}, parts)
    time.sleep(1.1)  # HDF5 would keep in which second an object was made
    assert encode({"": {"format": 1}}, parts) == first
