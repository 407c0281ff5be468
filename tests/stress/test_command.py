"""`mdstopo stress` and what it rests on: choice of scenes, verdicts, scenes that hang, the documentation's page."""

import json
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mdstopo.case.reader import read_case
from mdstopo.cli.group import run_group
from mdstopo.stress import judge, registry, scene_watch, stress_page
from mdstopo.stress.scene import Outcome, Refused, Scene
from tests.stress.fake_scenes import open_fakes

PAGE = Path(__file__).parents[2] / "docs" / "stress.md"


def scene(**changes: object) -> Scene:
    """One that is read and not computed."""
    data = {"time": {"end": 1}, "bodies": {"a": {"mass": 1, "inertia": 1, "position": [0, 0]}}}
    return replace(Scene("one", "nothing", data, lambda _: 0.0, bound=0.1), **changes)  # type: ignore[arg-type]


def refused(_: object) -> float:
    raise Refused("the joints have become singular: joint hip")


def crashing(_: object) -> float:
    raise KeyError("nobody")


@pytest.mark.parametrize(
    ("changes", "outcome", "ok"),
    [
        ({}, "right", True),
        ({"measure": lambda _: 0.2}, "wrong", False),
        ({"measure": lambda _: float("nan")}, "not finite", False),
        ({"measure": lambda _: (0.05, "late by 1 s")}, "right", True),
        ({"measure": refused}, "refused", False),
        ({"measure": refused, "refusal": ("singular", "joint hip")}, "refused", True),
        ({"measure": refused, "refusal": ("singular", "joint knee")}, "refused", False),
        ({"refusal": ("singular",)}, "wrong", False),
        ({"measure": crashing}, "crashes", False),
        ({"data": {"time": {"end": 1}, "bodies": {}, "members": 3}, "refusal": ("members",)}, "refused", True),
    ],
)
def test_verdicts(changes: dict[str, object], outcome: str, ok: bool) -> None:
    found = judge.judge(scene(**changes))
    assert (found.outcome, found.ok) == (outcome, ok)


def test_names_are_unique_and_every_case_that_is_to_be_computed_is_read() -> None:
    every = [each for family in registry.FAMILIES for each in registry.scenes_of(family)]
    assert len({each.name for each in every}) == len(every) > 100
    for each in every:
        if each.expected == "right":
            read_case(each.text)


def test_scenes_are_chosen_by_family_name_and_beginning() -> None:
    assert {each.name for each in registry.chosen(["steps"], long=False)} >= {"step-too-small", "tolerance-2"}
    assert registry.chosen(["pulse-1e12"], long=False)[0].name == "pulse-1e12"
    assert not any(each.long for each in registry.chosen([], long=False))
    assert any(each.long for each in registry.chosen([], long=True))
    with pytest.raises(KeyError, match="weather"):
        registry.chosen(["weather"], long=False)


@pytest.fixture
def watching(monkeypatch: pytest.MonkeyPatch) -> Iterator[scene_watch.Watch]:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    monkeypatch.setattr(scene_watch, "compiled", lambda: True)
    with scene_watch.Watch(open_fakes) as found:
        yield found


def test_a_scene_that_hangs_is_ended_and_the_next_one_computed(watching: scene_watch.Watch) -> None:
    began = time.perf_counter()
    first, second = watching.outcomes([scene(name="hangs", limit=2.0), scene(name="two")])
    assert (first.outcome, second.outcome) == ("hangs", "right")
    assert time.perf_counter() - began < 55.0


def test_a_process_that_ends_is_a_crash(watching: scene_watch.Watch) -> None:
    first, second = watching.outcomes([scene(name="ends"), scene(name="two")])
    assert (first.outcome, second.outcome) == ("crashes", "right")
    assert first.message == "the process ended with 3"


def test_the_command_prints_a_table_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["stress", "step-too-small", "tolerance-2"]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"step-too-small +generalized_alpha +refused", printed)
    assert "2 of 2 scenes end as they have to" in printed
    assert run_group(["stress", "tolerance-2", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["scenes"]
    assert (found["outcome"], found["ok"]) == ("refused", True)


def test_cases_are_written_as_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["stress", "periods", "--cases", str(tmp_path)]) == 0
    assert "2 cases" in capsys.readouterr().out
    assert run_group(["check", "--quiet", str(tmp_path / "periods-10000-gauss.yaml")]) == 0


def test_an_unknown_scene_is_a_mistake_with_the_nearest_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["stress", "pulsse"]) == 2
    assert "did you mean" in capsys.readouterr().err


def test_the_page_has_every_scene() -> None:
    named = set(re.findall(r"^\| `([\w.+-]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE))
    assert named == set(registry.scenes())


def test_a_row_of_the_page_has_one_line() -> None:
    found = Outcome(scene(), "refused", None, "<text>:3:4: one\n  two | three", 0.1)
    text = stress_page.markdown_of([replace(found, scene=registry.scenes()["tolerance-2"])])
    (row,) = [line for line in text.splitlines() if "tolerance-2" in line]
    assert "3:4: one two \\| three" in row
