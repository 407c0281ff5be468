"""Processes that are started here end with the one that started them, and take modules from where they should."""

import os
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from mdstopo import children
from mdstopo.children import command

PLACE = Path(children.__file__).parent.parent
PARENT = textwrap.dedent(
    """
    import subprocess, sys, time
    child = subprocess.Popen([sys.executable, "child.py"], stdin=subprocess.PIPE)
    print(child.pid, flush=True)
    time.sleep(60)
    """
)
CHILD = textwrap.dedent(
    """
    import sys, time
    from mdstopo.children import end_with_parent
    end_with_parent(sys.stdin.buffer)
    time.sleep(60)
    """
)


def is_running(pid: int) -> bool:
    """Whether there is such a process that has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks Linux for its processes")
def test_a_child_ends_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "child.py").write_text(CHILD)
    parent = subprocess.Popen([sys.executable, "-c", PARENT], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    time.sleep(0.3)
    assert is_running(child)
    parent.kill()
    parent.communicate()
    until = time.monotonic() + 30
    while is_running(child) and time.monotonic() < until:
        time.sleep(0.05)
    assert not is_running(child)


def test_a_child_that_is_done_ends_by_itself(tmp_path: Path) -> None:
    quick = CHILD.replace("time.sleep(60)", "sys.exit(3)")
    child = subprocess.Popen([sys.executable, "-c", quick], stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.wait(timeout=60) == 3  # while its input is open
    assert child.communicate()[1] == ""


def test_modules_of_the_current_folder_are_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('taken')")
    monkeypatch.chdir(tmp_path)
    assert "-P" in command("mdstopo")
    done = subprocess.run([*command("mdstopo"), "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    done = subprocess.run([*command("mdstopo"), "check", "none.yaml"], capture_output=True, text=True, check=False)
    assert "no such file" in done.stderr


def test_a_child_has_the_package_of_its_parent_where_another_copy_is_installed(tmp_path: Path) -> None:
    """A checkout is found through the first entry of sys.path, of which a child knows nothing."""
    copy = tmp_path / "checkout" / "mdstopo"
    copy.mkdir(parents=True)
    (copy / "__init__.py").touch()
    (copy / "children.py").write_bytes(Path(children.__file__).read_bytes())
    (copy / "whose.py").write_text("import sys; print(__name__, __file__, *sys.argv[1:])")
    program = (
        f"import subprocess, sys; sys.path.insert(0, {str(copy.parent)!r}); "
        "from mdstopo.children import command; subprocess.run(command('mdstopo.whose', 'a', 'b'), check=True)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["__main__", str(copy / "whose.py"), "a", "b"]


def test_where_the_package_is_in_the_current_folder_it_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(PLACE)
    assert "-P" not in command("mdstopo")


def test_a_folder_that_is_gone_is_no_hindrance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    os.rmdir(tmp_path / "gone")
    assert command("mdstopo.compile_responses", "gauss")[-3:] == [str(PLACE), "mdstopo.compile_responses", "gauss"]


def test_vectors_are_those_of_the_processor_that_numba_compiles_for(tmp_path: Path) -> None:
    """NUMBA_ENABLE_AVX=0 takes AVX-512 away, whose instructions LLVM then cannot make."""
    asked = "import mdstopo.compiler.vector_lowering as v; print(v._AVX512, v._LANES)"
    done = subprocess.run(
        [sys.executable, "-c", asked],
        env={**os.environ, "NUMBA_ENABLE_AVX": "0"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "False 4\n"
