"""The cache of machine code: only what this user wrote is run, damage means compiling anew, nothing ends a run."""

import ast
import fcntl
import os
import subprocess
import sys
import textwrap
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mdstopo
from mdstopo.compiler import store
from mdstopo.compiler.store import Code
from mdstopo.compiler.trusted import is_private, make_private, read_private
from tests.sources import statements, tree

PACKAGE = Path(mdstopo.__file__).parent


def root_with(stated: Path, monkeypatch: pytest.MonkeyPatch, home: Path) -> Path:
    """Where the cache would be."""
    monkeypatch.setenv("MDSTOPO_CACHE_DIR", str(stated))
    monkeypatch.setenv("XDG_CACHE_HOME", str(home))
    return store.cache_root.__wrapped__()


def test_the_stated_folder_is_made_for_its_owner_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = root_with(tmp_path / "a" / "b", monkeypatch, tmp_path / "home")
    assert found == tmp_path / "a" / "b"
    assert found.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("level", ["cache/inner", "cache", "."])
def test_a_folder_that_others_may_write_to_at_any_level_is_not_used(
    level: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = tmp_path / "base"
    (base / "cache" / "inner").mkdir(parents=True, mode=0o700)
    (base / level).chmod(0o777)
    assert root_with(base / "cache" / "inner", monkeypatch, tmp_path / "home") == tmp_path / "home" / "mdstopo"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")
@pytest.mark.parametrize("level", ["cache/inner", "cache"])
def test_another_users_folder_is_not_used(level: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cache" / "inner").mkdir(parents=True, mode=0o700)
    os.chown(tmp_path / level, 12345, 12345)
    assert root_with(tmp_path / "cache" / "inner", monkeypatch, tmp_path / "home") == tmp_path / "home" / "mdstopo"


def test_where_no_folder_is_private_a_fresh_one_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("stated", "home/mdstopo", f"temporary/mdstopo-{os.getuid()}"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name).chmod(0o777)
    monkeypatch.setattr(store.tempfile, "tempdir", str(tmp_path / "temporary"))
    found = root_with(tmp_path / "stated", monkeypatch, tmp_path / "home")
    assert found.parent == tmp_path / "temporary"
    assert found.name != f"mdstopo-{os.getuid()}"
    assert found.stat().st_mode & 0o777 == 0o700
    assert os.environ["MDSTOPO_CACHE_DIR"] == str(found)  # for the processes that this one starts


def test_a_place_in_a_sticky_folder_is_private() -> None:
    assert not is_private(Path("/tmp").resolve())
    assert make_private(Path("/tmp").resolve() / f"mdstopo-test-{os.getpid()}")
    os.rmdir(Path("/tmp").resolve() / f"mdstopo-test-{os.getpid()}")


def test_a_file_that_others_could_have_written_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.code"
    path.write_bytes(b"x")
    path.chmod(0o600)
    assert read_private(path) == b"x"
    (tmp_path / "link.code").symlink_to(path)
    assert read_private(tmp_path / "link.code") is None
    path.chmod(0o666)
    assert read_private(path) is None
    os.mkfifo(tmp_path / "pipe.code")
    assert read_private(tmp_path / "pipe.code") is None


def test_every_flipped_bit_of_machine_code_on_the_disk_is_found(tmp_path: Path) -> None:
    """The head as well: what it says of lengths and results decides what is run."""
    path = tmp_path / "a.code"
    store.write(path, Code(b"body" * 5, b"glue" * 3, "(fi)"))
    assert store.read(path) == Code(b"body" * 5, b"glue" * 3, "(fi)")
    whole = path.read_bytes()
    for place in range(len(whole)):
        for bit in range(8):
            broken = bytearray(whole)
            broken[place] ^= 1 << bit
            path.write_bytes(broken)
            assert store.read(path) is None, place
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert store.read(path) is None


def test_a_kernel_in_a_new_folder_changes_the_key(tmp_path: Path) -> None:
    (tmp_path / "jit.py").write_text("")
    (tmp_path / "cli").mkdir()
    (tmp_path / "cli" / "talk.py").write_text("")
    before = store._sources(tmp_path)
    (tmp_path / "new" / "deep").mkdir(parents=True)
    (tmp_path / "new" / "deep" / "kernels.py").write_text("")
    assert before == ["./jit.py"]
    assert store._sources(tmp_path) == ["./jit.py", "new/deep/kernels.py"]


@cache
def imports(path: Path) -> set[str]:
    """Modules that a source file imports, and what it takes from them."""
    found = set()
    for node in statements(tree(path)):
        if isinstance(node, ast.Import):
            found |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or "", *(f"{node.module}.{each.name}" for each in node.names)}
    return found


def test_folders_outside_the_key_have_no_kernels_and_give_kernels_nothing() -> None:
    outside = {f"mdstopo.{name.removesuffix('.py')}" for name in store.WITHOUT_KERNELS}
    for path in PACKAGE.glob("**/*.py"):
        taken = imports(path)
        compiles = "mdstopo.compiler.jit" in taken
        if path.relative_to(PACKAGE).parts[0] in store.WITHOUT_KERNELS:
            assert not compiles, path
        elif compiles:
            assert not [name for name in taken for place in outside if f"{name}.".startswith(f"{place}.")], path


def test_nothing_that_kernels_are_made_from_imports_a_folder_outside_the_key() -> None:
    taken: dict[str, set[str]] = {}
    for path in PACKAGE.glob("**/*.py"):
        name = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")
        taken[name] = imports(path)
    reached: set[str] = set()
    ahead = [name for name, found in taken.items() if "mdstopo.compiler.jit" in found]
    assert len(ahead) > 50
    while ahead:
        name = ahead.pop()
        if name not in reached:
            reached.add(name)
            ahead += [each for each in taken[name] if each in taken]
    folders = {name for name in store.WITHOUT_KERNELS if not name.endswith(".py")}
    assert sorted(name for name in reached if name.split(".")[1:2] and name.split(".")[1] in folders) == []


def test_folders_of_other_sources_go_when_they_are_old_or_many(tmp_path: Path) -> None:
    now = time.time()
    for k in range(16):
        folder = tmp_path / f"kernels-{k:02}"
        folder.mkdir()
        (folder / "x.code").write_text("")
        os.utime(folder, (now - k * 60, now - k * 60))
    os.utime(tmp_path / "kernels-03", (now - 40 * 86400, now - 40 * 86400))
    (tmp_path / "mine").mkdir()
    store.remove_old(tmp_path / "kernels-15")
    left = sorted(each.name for each in tmp_path.iterdir())
    assert left == sorted(["mine", "kernels-15", *(f"kernels-{k:02}" for k in range(13) if k != 3)])


def test_a_compiling_process_that_is_halted_is_not_waited_for_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "_PATIENCE", 0.2)
    with (tmp_path / "a.lock").open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with store.alone(tmp_path / "a.code"):
            pass
    assert (tmp_path / "a.lock").exists()  # it is the other's


def test_the_lock_of_the_cache_follows_no_link(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "a.lock").symlink_to(tmp_path / "precious")
    with store.alone(tmp_path / "a.code"):
        pass
    assert (tmp_path / "precious").read_text() == "mine"


MODULE = textwrap.dedent(
    """
    import sys, resource
    from mdstopo.compiler.jit import entry, kernel
    @kernel
    def inner(x):
        return 2.0 * x
    @entry
    def twice(x):
        return inner(x) + x
    if sys.argv[1:] == ["full"]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    print(twice(1.5))
    """
)


def compiled(folder: Path, *words: str) -> None:
    """A process that compiles, or loads, an entry with a kernel in it."""
    (folder / "kernels_of_a_test.py").write_text(MODULE)
    made = subprocess.run(
        [sys.executable, "kernels_of_a_test.py", *words],
        cwd=folder,
        env={**os.environ, "MDSTOPO_CACHE_DIR": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (made.returncode, made.stdout, made.stderr) == (0, "4.5\n", "")


def test_damaged_files_of_the_cache_mean_compiling_anew(tmp_path: Path) -> None:
    compiled(tmp_path)
    kept = [each for each in (tmp_path / "cache").glob("*/*") if each.suffix in (".code", ".kept")]
    assert {each.suffix for each in kept} == {".code", ".kept"}
    rng = np.random.default_rng(1)
    for path, damage in [(path, k) for path in kept for k in (0, 1)]:
        whole = path.read_bytes()
        place = int(rng.integers(len(whole)))
        path.write_bytes([b"", whole[:place] + bytes([whole[place] ^ 16]) + whole[place + 1 :]][damage])
        for other in kept:  # an entry that is there would need no kernel in it
            if other.suffix == ".code":
                other.write_bytes(b"")
        compiled(tmp_path)
    assert all(store.read_checked(path) is not None for path in kept)


def test_a_full_disk_ends_no_run(tmp_path: Path) -> None:
    compiled(tmp_path, "full")
    assert not list((tmp_path / "cache").glob("*/*.code"))
    assert not list((tmp_path / "cache").glob("*/*.tmp"))
