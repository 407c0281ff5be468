"""The campaign that kills and damages: a short one, and that it would notice."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from benchmarks import damage


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "case.yaml").write_text(damage.CASE)
    return tmp_path


def test_a_few_kills_and_damages_lose_nothing(folder: Path) -> None:
    killed = damage.kills(folder, 6, 2)
    assert killed.rows[-1][-1] == "yes", killed.rows
    assert [int(row[2]) for row in killed.rows[:-1]] == [3, 3, 2]
    found = damage.damages(folder, 12, 12, 12, 0)
    assert found.rows[-1][-1] == "yes", found.rows
    assert [int(row[1]) for row in found.rows[:-1]] == [12, 12, 12, 0]


def test_every_way_to_end_is_told_from_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = tmp_path / "log"

    def fails() -> None:
        raise ValueError("a mistake")

    def crashes() -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    ends = {"harmless": lambda: 0, "refused": lambda: 2, "wrong": lambda: 3, "traceback": fails, "crash": crashes}
    for name, work in ends.items():
        assert damage._outcome(*damage.apart(work, log), log) == name
    monkeypatch.setattr(damage, "LIMIT", 0.1)
    assert damage._outcome(*damage.apart(lambda: __import__("time").sleep(60), log), log) == "hang"


def test_damages_change_something() -> None:
    rng, data = np.random.default_rng(2), bytes(range(1, 256)) * 40
    assert all(damage.damaged(data, rng) != data for _ in range(300))
