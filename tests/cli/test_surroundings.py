"""Streams that are closed or full, letters that cannot be printed, folders that are gone: sentences, no tracebacks."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from mdstopo.cli.group import run_group
from mdstopo.cli.output import harmless
from mdstopo.report.report_page import page
from mdstopo.store.result_reader import read_result

SMALL = """
format: 1
title: {title}
time: {{end: 0.1}}
bodies: {{mass: {{mass: 1, inertia: 1, position: [0, 1]}}}}
points:
  foot: {{body: ground, grid: {{list: [[0, 0], [1, 0]]}}}}
  top: {{body: mass, grid: {{list: [[0, 1], [0.2, 1]]}}}}
members:
  springs: {{from: foot, to: top, law: {{type: spring, stiffness: 100}}}}
gravity: [0, -9.81]
design: {{initial: 0.5}}
objectives: {{G: {{response: energy, over_time: max}}}}
constraints: [{{volume: all, fraction: 0.5}}]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text(SMALL.format(title="Prüfstück"), encoding="utf-8")
    return tmp_path


def shell(line: str, **env: str) -> tuple[int, str, str]:
    """Status, output and errors of a line of sh in which $M is the program."""
    done = subprocess.run(
        ["sh", "-c", line],
        env={**os.environ, "M": f"{sys.executable} -m mdstopo", "PYTHONPATH": os.getcwd() + "/none", **env},
        capture_output=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")


@pytest.mark.parametrize("words", ["check a.yaml", "check a.yaml --json", "--help", "--version", "schema"])
@pytest.mark.parametrize(("where", "why"), [(">&-", "Bad file descriptor"), ("> /dev/full", "No space left on device")])
def test_an_output_that_cannot_be_written_is_a_sentence(words: str, where: str, why: str) -> None:
    status, _, err = shell(f"$M {words} {where}")
    told = [line for line in err.splitlines() if not line.startswith("compiling ")]
    assert (status, told) == (1, [f"the output could not be written: {why}"])


@pytest.mark.parametrize(
    ("words", "where", "status"),
    [
        ("check none.yaml", "2>&-", 2),
        ("check none.yaml", "2> /dev/full", 2),
        ("check a.yaml --unknown", "2> /dev/full", 2),
        ("check a.yaml", ">&- 2>&-", 1),
    ],
)
def test_errors_that_nobody_reads_change_no_status(words: str, where: str, status: int) -> None:
    assert shell(f"$M {words} {where}") == (status, "", "")


def test_what_is_said_never_ends_up_in_a_file() -> None:
    """The first file that is opened gets the number of a stream that is closed."""
    status, _, _ = shell("$M run a.yaml --out r.h5 >&- 2>&- <&-")
    assert status == 1
    assert read_result("r.h5").status == "converged"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_letters_that_cannot_be_printed_are_spelt(encoding: str) -> None:
    status, out, err = shell("$M check a.yaml", PYTHONIOENCODING=encoding)
    assert (status, err) == (0, "")
    assert {"ascii": r"Pr\xfcfst\xfcck", "latin-1": "Pr\ufffdfst\ufffdck", "utf-8": "Prüfstück"}[encoding] in out
    status, out, _ = shell("$M check a.yaml --json", PYTHONIOENCODING=encoding)
    assert "fst" in json.loads(out)["title"]


def test_files_whose_names_are_no_text_can_be_used() -> None:
    status, out, err = shell(
        "cp a.yaml \"$(printf 'b\\377').yaml\" && $M run \"$(printf 'b\\377').yaml\" --out \"$(printf 'r\\377').h5\""
    )
    assert (status, err.count("Traceback")) == (0, 0)
    assert r"r\udcff.h5" in out
    assert read_result(os.fsdecode(b"r\xff.h5")).case_path == os.fsdecode(b"b\xff.yaml")
    status, _, err = shell("$M show \"$(printf 'r\\377').h5\"")
    assert (status, err) == (0, "")
    for words in (["export", "--csv"], ["export", "--json"], ["report"]):
        assert run_group([*words, os.fsdecode(b"r\xff.h5")]) == 0


def test_a_folder_that_is_gone_is_a_sentence(tmp_path: Path) -> None:
    for words, said in (("check a.yaml", "no such file"), (f"run {tmp_path}/a.yaml", "there is no such place")):
        status, _, err = shell(f"mkdir gone && cd gone && rmdir ../gone && $M {words}")
        assert status == 2
        assert said in err
        assert "Traceback" not in err


@pytest.mark.parametrize("title", [r'"a\0b"', r'"\e[31mred\e]0;name\a\x9b2J\x7f"', '"<!--<script></script>{data}"'])
def test_titles_are_told_and_never_obeyed(title: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("t.yaml").write_text(SMALL.format(title=title))
    assert run_group(["run", "t.yaml", "--out", "t.h5"]) == 0
    for words in (
        ["check", "t.yaml"],
        ["show", "t.h5"],
        ["show", "--json", "t.h5"],
        ["report", "t.h5"],
        ["export", "--json", "t.h5"],
    ):
        assert run_group(words) == 0
    said = capsys.readouterr()
    assert not [letter for letter in said.out + said.err if letter in "\0\x1b\a\x9b\x7f"]
    assert read_result("t.h5").title == json.loads(Path("t.json").read_text())["title"]
    html = Path("t.html").read_text()
    assert "<!--<script" not in html
    assert html.count("</script>") == 2


def test_what_reorders_letters_is_shown_as_it_is_written() -> None:
    assert harmless("a\u202eb\u2066c\r\nd\te") == "a\\u202eb\\u2066c\\u000d\nd\te"


def test_the_page_takes_nothing_in_the_data_for_a_place_of_its_own() -> None:
    text = page({"title": "{style}{script}", "dimension": 2, "case": "{data}</script><!--<script>"})
    start = text.index('type="application/json">') + len('type="application/json">')
    assert json.loads(text[start : text.index("</script>", start)]) == {
        "title": "{style}{script}",
        "dimension": 2,
        "case": "{data}</script><!--<script>",
    }
    assert "<title>{style}{script}</title>" in text


@pytest.mark.parametrize("words", ["report", "export --json", "export --csv"])
@pytest.mark.parametrize("goal", ["r.h5", "a.yaml", "link"])
def test_neither_the_case_nor_the_result_is_replaced(words: str, goal: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["run", "a.yaml", "--out", "r.h5", "--quiet"]) == 0
    Path("link").symlink_to("a.yaml")
    before = Path("r.h5").read_bytes(), Path("a.yaml").read_bytes()
    assert run_group([*words.split(), "r.h5", "--out", goal]) == 2
    assert before == (Path("r.h5").read_bytes(), Path("a.yaml").read_bytes())
    assert "Traceback" not in capsys.readouterr().err


def test_a_page_that_cannot_be_written_leaves_the_old_one(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run_group(["run", "a.yaml", "--out", "r.h5", "--quiet"]) == 0
    Path("r.html").write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert run_group(["report", "r.h5"]) == 1
    assert run_group(["export", "--json", "r.h5"]) == 1
    assert Path("r.html").read_text() == "old"
    assert sorted(each.name for each in Path().iterdir()) == ["a.yaml", "r.h5", "r.html"]


def test_a_terminal_that_is_closed_is_heard_and_nohup_respected() -> None:
    code = (
        "import signal, sys; sys.argv[1:] = ['--version']\n"
        "from mdstopo import cli\n"
        "cli._end = lambda status: print(signal.getsignal(signal.SIGHUP) is signal.SIG_IGN, flush=True)\n"
        "cli.main()\n"
    )
    Path("ask.py").write_text(code)
    ask = f"{sys.executable} ask.py | tail -1"
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN  # where the tests themselves are run by nohup
    assert shell(ask)[1] == f"{ignored}\n"
    assert shell(f"trap '' HUP; {ask}")[1] == "True\n"
    assert signal.SIGHUP
