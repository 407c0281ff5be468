"""Writing: whole or not at all, by one process at a time, at a sensible rate."""

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from mdstopo.store import atomic
from mdstopo.store.atomic import remove_leftovers, replace_file
from mdstopo.store.checkpoint import INTERVAL, Checkpointer
from mdstopo.store.lock import Lock
from mdstopo.store.store_errors import InUseError, StoreError, WriteError


def test_a_write_that_fails_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.h5"
    replace_file(path, b"old")

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(WriteError, match=r"a\.h5: cannot be written: No space left on device"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.h5"]


def test_a_file_is_flushed_before_it_replaces_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order = []
    fsync, move = os.fsync, os.replace
    monkeypatch.setattr(atomic.os, "fsync", lambda fd: (order.append("flush"), fsync(fd))[1])
    monkeypatch.setattr(atomic.os, "replace", lambda a, b: (order.append("replace"), move(a, b))[1])
    replace_file(tmp_path / "a.h5", b"new")
    assert order == ["flush", "replace", "flush"]
    assert (tmp_path / "a.h5").read_bytes() == b"new"


def test_new_files_obey_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        replace_file(tmp_path / "a.h5", b"x")
    finally:
        os.umask(before)
    assert (tmp_path / "a.h5").stat().st_mode & 0o777 == 0o640


def test_a_directory_that_is_gone_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match="No such file or directory"):
        replace_file(tmp_path / "gone" / "a.h5", b"x")


def test_leftovers_of_this_file_are_removed_and_nothing_else(tmp_path: Path) -> None:
    for name in (".a.h5.123-beef.tmp", ".b.h5.123-beef.tmp", "a.h5", "notes.tmp"):
        (tmp_path / name).write_bytes(b"")
    assert remove_leftovers(tmp_path / "a.h5") == 1
    assert sorted(os.listdir(tmp_path)) == [".b.h5.123-beef.tmp", "a.h5", "notes.tmp"]


HOLDER = textwrap.dedent(
    """
    import sys, time
    from pathlib import Path
    from mdstopo.store.lock import Lock
    with Lock(Path(sys.argv[1])):
        print("held", flush=True)
        time.sleep(60)
    """
)


def hold(path: Path) -> subprocess.Popen[str]:
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    assert holder.stdout.readline() == "held\n"
    return holder


def test_a_second_writer_is_refused_with_the_first_ones_pid_until_that_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    holder = hold(path)
    try:
        with (
            pytest.raises(InUseError, match=rf"a\.h5 is in use by process {holder.pid}$") as refusal,
            Lock(path),
        ):
            pass
        assert refusal.value.pid == holder.pid
        assert refusal.value.host == os.uname().nodename
    finally:
        holder.send_signal(signal.SIGKILL)
        holder.communicate()
    with Lock(path):  # the dead holder's file is still there, and is no obstacle
        pass
    assert os.listdir(tmp_path) == []


def test_a_lock_file_with_the_pid_of_a_living_stranger_is_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / ".a.h5.lock").write_text(f"{os.getppid()} {os.uname().nodename}\n")
    with Lock(tmp_path / "a.h5"):
        assert (tmp_path / ".a.h5.lock").read_text().split()[0] == str(os.getpid())


def test_a_lock_excludes_within_one_process_too(tmp_path: Path) -> None:
    with Lock(tmp_path / "a.h5"), pytest.raises(InUseError, match=str(os.getpid())), Lock(tmp_path / "a.h5"):
        pass
    with Lock(tmp_path / "a.h5"):
        pass


def test_a_lock_where_no_file_can_be_made_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="no file can be made in"), Lock(tmp_path / "file" / "a.h5"):
        pass


class Clock:
    """A clock that tests turn."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def run_for(seconds: float, iteration: float, cost: float, expected: float = 0.0) -> tuple[Checkpointer, float]:
    """Iterate on a made-up clock; the checkpointer and the most work that a kill could have lost."""
    clock, lost, saved_at = Clock(), 0.0, [0.0]

    def save() -> None:
        clock.now += cost
        saved_at[0] = clock.now

    saver = Checkpointer(save, expected, clock)
    while clock.now < seconds:
        clock.now += iteration
        # Just before the iteration's state is safe: all since the last save would go, the writing included.
        lost = max(lost, clock.now + cost - saved_at[0] if saver.offer() else clock.now - saved_at[0])
    return saver, lost


def test_fast_iterations_lose_at_most_half_a_second() -> None:
    saver, lost = run_for(20.0, iteration=0.002, cost=0.01)
    assert lost <= 0.5
    assert saver.count <= 20.0 / (INTERVAL - 0.01)


def test_an_iteration_longer_than_the_interval_is_saved_each_time() -> None:
    saver, _ = run_for(20.0, iteration=1.0, cost=0.01)
    assert saver.count >= 19


def test_writing_never_takes_longer_than_the_work_it_saves() -> None:
    for cost in (0.3, 1.0, 4.0):
        saver, _ = run_for(60.0, iteration=0.01, cost=cost, expected=cost)
        assert saver.count >= 1
        assert saver.count * cost <= 60.0 / 2.0


def test_the_first_checkpoint_of_a_large_case_waits_for_work_worth_it() -> None:
    clock = Clock()
    saver = Checkpointer(lambda: None, 5.0, clock)
    clock.now = 9.0
    assert not saver.offer()
    clock.now = 10.5
    assert saver.offer()


def test_a_checkpoint_that_cannot_be_written_is_told_and_does_not_end_the_work() -> None:
    def save() -> None:
        raise WriteError("the disk is full")

    clock = Clock()
    said: list[str] = []
    saver = Checkpointer(save, clock=clock, notify=said.append)
    for _ in range(2):
        clock.now += 2.0 * INTERVAL
        assert saver.offer()
    assert said == ["no checkpoint: the disk is full"] * 2
    clock.now += 2.0 * INTERVAL
    with pytest.raises(WriteError):
        Checkpointer(save, clock=Clock()).offer(urgent=True)


@pytest.mark.parametrize("how", ["symbolic", "dangling", "hard"])
def test_a_lock_is_never_another_file(how: str, tmp_path: Path) -> None:
    """What a link in its place points to would be emptied."""
    precious, lock = tmp_path / "precious", tmp_path / ".a.h5.lock"
    if how != "dangling":
        precious.write_text("mine")
    if how == "hard":
        lock.hardlink_to(precious)
    else:
        lock.symlink_to(precious)
    with (
        pytest.raises(StoreError, match=r"\.a\.h5\.lock: cannot be the lock on a\.h5: .*remove it"),
        Lock(tmp_path / "a.h5"),
    ):
        pass
    assert precious.exists() == (how != "dangling")
    assert how == "dangling" or precious.read_text() == "mine"


def test_a_pipe_in_the_place_of_a_lock_is_a_sentence(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / ".a.h5.lock")
    with pytest.raises(StoreError, match="no plain file"), Lock(tmp_path / "a.h5"):
        pass


@pytest.mark.parametrize("content", [b"\xff\xfe\0\n", b"9" * 9999, "² host".encode(), b""])
def test_whatever_is_in_a_lock_file_nobody_stumbles_over_it(content: bytes, tmp_path: Path) -> None:
    lock = tmp_path / ".a.h5.lock"
    with Lock(tmp_path / "a.h5"):
        lock.write_bytes(content)
        with pytest.raises(InUseError, match="in use by another process"), Lock(tmp_path / "a.h5"):
            pass
    lock.write_bytes(content)
    with Lock(tmp_path / "a.h5"):
        assert lock.read_text().split()[0] == str(os.getpid())


def test_a_folder_with_the_name_of_a_leftover_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / ".a.h5.folder.tmp").mkdir()
    assert remove_leftovers(tmp_path / "a.h5") == 0
    assert (tmp_path / ".a.h5.folder.tmp").is_dir()
