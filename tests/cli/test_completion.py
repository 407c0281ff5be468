"""What a shell is offered when TAB is pressed."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mdstopo.cli.commands import COMMANDS
from mdstopo.cli.completion import SHELLS
from mdstopo.cli.group import run_group

#: env runs programs, not functions: so does the script of click
AS_BASH = """
printf '#!/bin/sh\\nexec "{python}" -m mdstopo "$@"\\n' > "$HOME/mdstopo"; chmod +x "$HOME/mdstopo"; PATH="$HOME:$PATH"
eval "$(mdstopo completion bash)"
complete=$(complete -p mdstopo | sed 's/.*-F \\([^ ]*\\).*/\\1/')
"""
ASKED = """
COMP_WORDS=({words}); COMP_CWORD={place}; COMPREPLY=()
$complete mdstopo
printf '%s ' "${{COMPREPLY[@]}}"; echo
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Cases, results and other files, some of them in folders."""
    monkeypatch.chdir(tmp_path)
    for name in (
        "cases/a.yaml",
        "cases/b.yml",
        "cases/note.txt",
        "results/deep/run.h5",
        "results/deep/alpha.npy",
        "x.py",
    ):
        place = Path(name)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.touch()
    return tmp_path


def completed(*lines: list[str]) -> list[list[str]]:
    """The choices of each line in a bash that has read the script, the last word being typed."""
    script = AS_BASH.format(python=sys.executable)
    for words in lines:
        quoted = " ".join(f"'{word}'" for word in ("mdstopo", *words))
        script += ASKED.format(words=quoted, place=len(words))
    environment = {**os.environ, "HOME": os.getcwd()}
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, env=environment)
    assert done.stderr == ""
    return [line.split() for line in done.stdout.splitlines()]


def question(words: str, place: int) -> dict[str, str]:
    """What bash's script asks the program with."""
    return {"_MDSTOPO_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(place)}


def offered(words: str, place: int) -> list[str]:
    """Types and values of the choices, by the program's commands in this process."""
    said = io.TextIOWrapper(io.BytesIO(), "utf-8")
    with pytest.MonkeyPatch.context() as changed, contextlib.redirect_stdout(said):
        for name, value in question(words, place).items():
            changed.setenv(name, value)
        with pytest.raises(SystemExit, match="0"):
            run_group([])
    return said.buffer.getvalue().decode().split()


def test_bash_completes_commands_options_values_and_files():
    choices = {
        ("",): list(COMMANDS),
        ("si",): ["simulate"],
        ("run", "--o"): ["--out", "--overwrite"],
        ("gradient", "--method", ""): ["adjoint", "direct", "iterative", "constant_load"],
        ("completion", "f"): ["fish"],
        ("check", "ca"): ["cases/a.yaml", "cases/b.yml", "cargo", "catch"],  # the last two come with it
    }
    assert completed(*map(list, choices)) == list(choices.values())


def test_cases_results_and_designs_are_offered_by_their_endings():
    assert offered("mdstopo run cases/", 2) == ["plain,cases/a.yaml", "plain,cases/b.yml"]
    assert offered("mdstopo show res", 2) == ["plain,results/deep/run.h5"]
    assert offered("mdstopo run cases/a.yaml --alpha r", 4) == [
        "plain,results/deep/alpha.npy",
        "plain,results/deep/run.h5",
    ]
    assert offered("mdstopo check ", 2) == ["plain,cases/", "plain,results/"]
    assert offered("mdstopo check nothing", 2) == []
    assert "plain,layout" in offered("mdstopo plot results/deep/run.h5 l", 3)
    assert offered("mdstopo sweep s", 2) == ["plain,set"]


def test_names_that_a_shell_must_quote_are_left_to_the_shell():
    Path("two words.yaml").touch()
    assert offered("mdstopo run t", 2) == ["file,t", "plain,tiedown", "plain,touchdown"]
    assert offered("mdstopo run ~/", 2) == ["file,~/"]


def test_hidden_files_are_offered_where_a_dot_is_typed():
    Path(".hidden.yaml").touch()
    assert "plain,.hidden.yaml" not in offered("mdstopo run ", 2)
    assert offered("mdstopo run .h", 2) == ["plain,.hidden.yaml"]


def test_completing_loads_nothing_heavy():
    for words, place in (("mdstopo s", 1), ("mdstopo run cases/", 2)):
        done = subprocess.run(
            [sys.executable, "-X", "importtime", "-m", "mdstopo"],
            capture_output=True,
            text=True,
            env={**os.environ, **question(words, place)},
            check=True,
        )
        assert done.stdout
        loaded = done.stderr
        assert not {name for name in ("numpy", "numba", "h5py", "rich", "yaml") if f" {name}\n" in loaded}


@pytest.mark.parametrize("shell", SHELLS)
def test_there_is_a_script_for_every_shell(shell, capsys):
    assert run_group(["completion", shell]) == 0
    said = capsys.readouterr()
    assert f"_MDSTOPO_COMPLETE={shell}_complete" in said.out
    assert said.err == ""


def test_another_shell_is_refused(capsys):
    assert run_group(["completion", "csh"]) == 2
    assert "'csh' is not one of" in capsys.readouterr().err
