"""README, and the pages that tell of the whole, say what is true: cases, commands, options, names, paths, numbers."""

from __future__ import annotations

import re
import shutil
from importlib import import_module
from pathlib import Path

import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.cli.commands import COMMANDS
from mdstopo.scene.refusals import refusals

from .pages import DOCS, PAGES, ROOT, data
from .pages import blocks as fenced
from .test_pages import check_console

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(mark: str) -> list[str]:
    """The fenced blocks of the README that stand below a mark."""
    return re.findall(rf"<!-- {mark} -->\n```\w+\n(.*?)```", README, re.DOTALL)


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_readme_is_short_and_has_a_picture_that_exists() -> None:
    assert len(README.splitlines()) <= 120
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", README)
    assert pictures
    for picture in pictures:
        drawn = (ROOT / picture).read_text(encoding="utf-8")
        assert len(drawn) < 100_000, "a picture at the front stays small"
        assert "<script" not in drawn
        assert "://" not in drawn.replace("http://www.w3.org/2000/svg", "")


def test_links_of_the_files_at_the_front_lead_somewhere() -> None:
    for name in ("README.md", "CONTRIBUTING.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        links = [link for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]
        assert links, name
        for link in links:
            assert (ROOT / link.partition("#")[0]).is_file(), f"{name}: {link}"


@pytest.mark.parametrize("snippet", blocks("runs"))
def test_readme_python_runs_and_gives_what_it_says(
    snippet: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(compile(snippet, "README.md", "exec"), names)
    first, second = capsys.readouterr().out.strip().splitlines()
    assert first == "(1020,)"
    assert second.split()[0] in ("converged", "max_iterations")
    assert names["result"].objectives["G"] < 7.0


def test_readme_has_five_lines_of_python_and_one_case() -> None:
    (snippet,) = blocks("runs")
    assert len(snippet.splitlines()) == 5
    assert len(blocks("case")) == 1


def test_the_readme_shows_the_case_that_make_run_optimises() -> None:
    (text,) = blocks("case")
    case, made = read_case(text), mdstopo.load_case(ROOT / "cases" / "fig6.yaml")
    assert data(text) == data((ROOT / "cases" / "fig6.yaml").read_text(encoding="utf-8"))
    assert case.n_design == made.n_design == 1020
    assert refusals(case) == []
    assert "CASE ?= cases/fig6.yaml" in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_readme_shows_what_the_command_prints(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "cases", tmp_path / "cases")
    (shown,) = [block for block in fenced(README) if block.language == "console"]
    check_console(DOCS / "README.md", shown, tmp_path)


def test_the_case_with_much_in_it_can_be_evaluated() -> None:
    (block,) = [block for block in fenced(page("case.md")) if block.title == "cart.yaml"]
    case = read_case(block.text)
    assert case.n_design == 6 * 5
    assert refusals(case) == []
    assert mdstopo.evaluate(case).status.ok


def test_the_table_of_commands_names_all_and_no_others() -> None:
    part = page("commands.md").partition("## At a glance")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `mdstopo ([a-z]+)\b", part, re.MULTILINE) == list(COMMANDS)


@pytest.mark.parametrize("name", ["README.md", *sorted(path.relative_to(ROOT).as_posix() for path in PAGES)])
def test_options_that_pages_name_exist(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    found = re.findall(r"`?mdstopo ([a-z]+)\b([^`\n]*)", text) + re.findall(r"`(gradient) (--[a-z-]+)`", text)
    for command, rest in found:
        used = re.findall(r"(?<![\w-])--[a-z][a-z-]*", rest)
        if not used:
            continue
        known = import_module(f"mdstopo.cli.{command}").command
        parts = [known, *getattr(known, "commands", {}).values()]
        options = {text for part in parts for parameter in part.params for text in parameter.opts}
        assert set(used) - {"--help"} <= options, f"{command}: {set(used) - options}"


def test_pages_name_every_integrator_sensitivity_and_preset() -> None:
    from mdstopo.api import METHODS as SENSITIVITIES
    from mdstopo.case.methods.integrators import INTEGRATORS
    from mdstopo.settings.optimizer_presets import PRESETS

    heading = re.search(r"^\| \| (`.*) \|$", page("theory/integrators.md"), re.MULTILINE)
    assert heading is not None
    assert sorted(re.findall(r"`([a-z_]+)`", heading[1])) == sorted(INTEGRATORS)
    methods = page("theory/sensitivities.md").partition("## Four methods")[2].partition("\n## ")[0]
    assert sorted(re.findall(r"^\| `([a-z_]+)` \|", methods, re.MULTILINE)) == sorted(set(SENSITIVITIES) - {"auto"})
    presets = page("theory/optimiser.md").partition("| preset |")[2].partition("\n\n")[0]
    assert sorted(re.findall(r"^\| `([a-z_]+)` \|", presets, re.MULTILINE)) == sorted(PRESETS)


def test_paths_that_the_architecture_names_exist() -> None:
    named = set(re.findall(r"`(?:mdstopo/)?([\w/]+(?:\.py|/))`", page("architecture.md")))
    assert len(named) > 40
    lost = [name for name in named if not any((ROOT / place / name).exists() for place in ("", "mdstopo"))]
    assert lost == []


def test_the_architecture_names_every_folder() -> None:
    folders = {path.name for path in (ROOT / "mdstopo").iterdir() if (path / "__init__.py").exists()}
    named = set(re.findall(r"`([\w]+)/`", page("architecture.md")))
    assert folders - named == set()


def test_make_targets_that_are_named_exist() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    told = "\n".join([README, (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), page("performance.md")])
    named = set(re.findall(r"(?:^|`|  )make ([a-z-]+)\b", told, re.MULTILINE))
    assert {"run", "test", "lint", "types", "bench", "readme"} <= named <= targets


def test_every_measured_table_has_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.__main__ import NAMED, PAGES, SECTIONS
    from benchmarks.readme import replace_block

    assert set(PAGES) <= set(SECTIONS) - set(NAMED)
    for name, place in PAGES.items():
        copy = tmp_path / "page.md"
        copy.write_text((ROOT / place).read_text(encoding="utf-8"), encoding="utf-8")
        replace_block(copy, name, f"the new {name}")
        assert f"<!-- benchmarks: {name} -->\n\nthe new {name}\n\n<!-- end -->" in copy.read_text(encoding="utf-8")
        with pytest.raises(ValueError, match="has no block"):
            replace_block(copy, "weather", "fine")


def test_the_five_rows_of_the_readme_are_those_of_the_measured_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.__main__ import SECTIONS
    from benchmarks.readme import five_rows

    rows = five_rows(page("performance.md"), page("comparison.md"))
    assert len(rows.splitlines()) == 2 + 5
    assert f"<!-- benchmarks: five rows -->\n\n{rows}\n\n<!-- end -->" in README
    assert set(re.findall(r"SECTIONS=(\w+)", rows)) <= set(SECTIONS)
    with pytest.raises(KeyError, match="A hanging chain"):
        five_rows(page("performance.md").replace("| 1000 ", "| 1001 "), page("comparison.md"))


def test_what_the_architecture_says_is_in_a_file_is_there() -> None:
    pairs = re.findall(r"((?:`\w+`(?:, | and )?)+) in `([\w/]+\.py)`", page("architecture.md"))
    assert len(pairs) > 25
    for names, place in pairs:
        source = (ROOT / "mdstopo" / place).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"^\s*(?:def|class) {name}\b|^\s*{name} = ", source, re.MULTILINE), f"{name} in {place}"


def test_the_page_on_python_gives_what_it_says(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(compile(fenced(page("python.md"))[0].text, "python.md", "exec"), names)
    first, second, third = capsys.readouterr().out.strip().rsplit("\n", 2)
    assert names["motion"].at([0.05, 0.1]).q.shape == (2, 6)
    assert first.startswith("0.2 ")
    assert second.endswith("(1020,)")
    assert third.split()[0] in ("converged", "max_iterations")
    assert names["result"].objectives["G"] < 7.0
