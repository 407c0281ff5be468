"""The command line itself: fast help, exit statuses, sentences in place of tracebacks, quiet pipes."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mdstopo.case.keys.records import Record
from mdstopo.case.schema.key_tables import places
from mdstopo.case.schema.schema_case import FORMAT
from mdstopo.case.schema.schema_space import SPACE_FORMAT
from mdstopo.cli.commands import COMMANDS, help_text
from mdstopo.cli.group import cli, run_group

HEAVY = ("numpy", "numba", "scipy", "h5py", "rich", "yaml")


def mdstopo(*words: str, **options: object) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "mdstopo", *words], capture_output=True, text=True, check=False, **options
    )


def imported_by(words: list[str]) -> set[str]:
    """Top-level modules that are loaded once the program has run with these words."""
    script = (
        "import sys, atexit\n"
        "atexit.register(lambda: print(*{name.partition('.')[0] for name in sys.modules}, file=sys.stderr))\n"
        f"sys.argv = ['mdstopo', *{words!r}]\n"
        "from mdstopo.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return set(done.stderr.split())


def test_help_and_version_load_nothing_heavy_not_even_click() -> None:
    for words in ([], ["--help"], ["--version"]):
        assert imported_by(words).isdisjoint({*HEAVY, "click"}), words


def test_the_help_of_a_command_loads_nothing_heavy() -> None:
    """All commands in turn in one process: the first one that loads something is told."""
    script = (
        "import sys\n"
        "from mdstopo.cli.commands import COMMANDS\n"
        "from mdstopo.cli.group import run_group\n"
        "for name in COMMANDS:\n"
        "    assert run_group([name, '--help']) == 0\n"
        "    print(name, *{module.partition('.')[0] for module in sys.modules}, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = [line.split() for line in done.stderr.splitlines()]
    assert [name for name, *_ in loaded] == list(COMMANDS)
    for name, *modules in loaded:
        assert set(modules).isdisjoint(HEAVY), name


def test_every_command_of_the_table_exists_and_the_help_names_it() -> None:
    context = cli.make_context("mdstopo", ["run"], resilient_parsing=True)
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        assert command.name == name
        assert name in help_text()
    assert cli.get_command(context, "pip") is None


def test_a_misspelt_command_is_refused_with_the_nearest_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["simulat"]) == 2
    assert "did you mean `simulate`?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["run"], "Missing argument 'CASE'"),
        (["run", "a.yaml", "--stats", "2"], "No such option"),
        (["run", "a.yaml", "--starts", "0"], "not in the range"),
        (["run", "a.yaml", "--set", "solver.step"], "is not KEY=VALUE"),
        (["run", "a.yaml", "--resume", "--overwrite"], "exclude each other"),
        (["run", "absent.yaml"], "absent.yaml:1:1: there is no such file"),
        (["check", "absent.yaml"], "there is no such file"),
        (["show", "absent.h5"], "absent.h5: cannot be read: No such file"),
    ],
)
def test_bad_input_is_status_2_and_a_sentence_on_standard_error(
    words: list[str],
    sentence: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_group(words) == 2
    said = capsys.readouterr()
    assert sentence in said.err
    assert said.out == ""
    assert list(tmp_path.iterdir()) == []


def test_all_mistakes_of_a_case_are_listed_and_nothing_is_written(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text(
        "format: 1\ntime: {end: -1}\nbodys: {}\nbodies: {a: {mass: 0, inertia: 1, position: [0, 0]}}\n"
    )
    for name in ("run", "check", "simulate", "gradient"):
        assert run_group([name, "bad.yaml"]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        lines = said.err.strip().splitlines()
        assert len(lines) >= 3, name
        assert all(line.startswith("bad.yaml:") for line in lines), name
    assert os.listdir() == ["bad.yaml"]


def test_the_schema_is_json_and_goes_to_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert run_group(["schema", "--out", str(tmp_path / "s.json")]) == 0
    assert json.loads((tmp_path / "s.json").read_text(encoding="utf-8")) == printed
    assert all("bodies" in printed["else"][part]["properties"] for part in ("then", "else"))  # in space, in the plane
    assert run_group(["schema", "--out", str(tmp_path / "no" / "s.json")]) == 2


@pytest.mark.parametrize(("words", "case"), [([], FORMAT), (["--space"], SPACE_FORMAT)])
def test_every_key_of_a_section_is_told_in_plain_words(
    words: list[str], case: Record, capsys: pytest.CaptureFixture[str]
) -> None:
    for section, part in places(case).items():
        if not part:
            continue
        assert run_group(["schema", section or "case", *words]) == 0
        told = capsys.readouterr().out
        for place in part:
            assert all(f"\n  {key.name}: " in told for key in place.record.keys), place.path
            assert not place.path or place.record.doc.replace("`", "")[:25] in told, place.path
        assert not re.search(r"<br>|&[gl]t;|`|\]\(", told), section


def test_a_section_that_there_is_not_is_told_with_those_that_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["schema", "objectivs"]) == 2
    assert "no section 'objectivs'; there are case, time, bodies, " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("word", "sections"), [("laws", ("members",)), ("spring", ("members",)), ("joint_moment", ("objectives",))]
)
def test_a_word_that_stands_below_a_section_is_told_with_that(
    word: str, sections: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_group(["schema", word]) == 2
    told = capsys.readouterr().err
    assert f"no section '{word}'; it is among the keys of " in told
    for section in sections:
        assert f"`mdstopo schema {section}`" in told


def test_a_word_of_cases_in_space_is_told_with_sections_of_these(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["schema", "spherical", "--space"]) == 2
    assert "`mdstopo schema joints --space`" in capsys.readouterr().err


def test_keys_in_space_are_asked_for_with_a_section(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["schema", "--space"]) == 2
    assert "--space goes with a SECTION" in capsys.readouterr().err


def test_a_reader_that_leaves_early_is_no_error() -> None:
    for words in ("schema", "--help"):
        line = f"{sys.executable} -m mdstopo {words} | true; echo ${{PIPESTATUS[0]}}"
        done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True)
        assert done.stderr == ""
        assert done.stdout == "0\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_anything_is_computed_is_status_3_without_traceback(number: signal.Signals) -> None:
    script = (
        "import os, sys\n"
        "import mdstopo.cli.commands as commands\n"
        f"commands.help_text = lambda: os.kill(os.getpid(), {int(number)}) or input()\n"
        "sys.argv = ['mdstopo']\n"
        "from mdstopo.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert done.stderr == "interrupted\n"
