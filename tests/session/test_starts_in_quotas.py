"""Several starts in quotas: a resumed run decides as an uninterrupted one; who was dropped stays dropped."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mdstopo.session.outcome import Outcome
from mdstopo.session.run_session import run_session
from mdstopo.starts import quotas
from mdstopo.store.result_reader import read_result
from tests.fakes import FakeEngineWithEvaluations, hand_made_case, limited
from tests.result_files import assert_same_files, stop_after

STARTS = 6


def go(path: Path, iterations: int = 50, starts: int = STARTS, **options: Any) -> Outcome:
    case = limited(hand_made_case(), iterations, starts=starts)
    return run_session(case, path=path, engine=FakeEngineWithEvaluations, **options)


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    path = tmp_path_factory.mktemp("quotas") / "straight.h5"
    return go(path), path


def test_starts_that_lag_are_dropped_at_a_quota_and_a_third_goes_on(straight: tuple[Outcome, Path]) -> None:
    states = [state for state in straight[0].states if state is not None]
    assert len(states) == STARTS
    dropped = [state for state in states if state.dropped]
    assert dropped
    decided = (*range(quotas.TRIAL + 1), *quotas.LOOKS, *quotas.LATER_LOOKS, *quotas.QUOTAS)
    assert all(state.iteration in decided and "dropped after" in state.reason for state in dropped)
    assert 1 <= sum(state.iteration == 50 for state in states) <= STARTS // 3 + 1
    assert not states[straight[0].best_start].dropped


@pytest.mark.parametrize("asked", [7, 30, 45, 70, 100, 125, 150])
def test_a_run_that_is_stopped_anywhere_goes_on_as_if_it_had_not_been(
    asked: int, straight: tuple[Outcome, Path], tmp_path: Path
) -> None:
    path = tmp_path / "resumed.h5"
    assert go(path, stop_requested=stop_after(asked)).status == "interrupted"
    go(path, resume=True)
    assert_same_files(straight[1], path)


def test_who_was_dropped_stays_dropped_when_the_limit_is_raised(straight: tuple[Outcome, Path], tmp_path: Path) -> None:
    path = tmp_path / "raised.h5"
    path.write_bytes(straight[1].read_bytes())
    before = straight[0].states
    after = go(path, 60, resume=True).states
    for old, new in zip(before, after, strict=True):
        assert old is not None
        assert new is not None
        assert new.dropped == old.dropped
        assert new.iteration == (old.iteration if old.dropped else 60)


def test_equal_optima_are_told_once_best_first_with_all_their_evaluations(straight: tuple[Outcome, Path]) -> None:
    first, other = straight[0].states[0], straight[0].states[2]
    assert first is not None
    assert other is not None
    twin = replace(first, evaluations=9)
    worse = replace(other, best_objective=first.best_objective + 1.0)
    found = quotas.distinct([worse, first, None, twin], 1e-6)
    assert [each.starts for each in found] == [(1, 3), (0,)]
    assert found[0].evaluations == first.evaluations + 9
    assert found[0].objective < found[1].objective


@pytest.mark.parametrize(
    ("before", "asked", "again"),
    [(1, None, True), (1, 2, False), (1, 9, True), (4, None, True), (9, None, True), (9, 15, False), (9, 170, True)],
)
def test_a_run_resumed_with_another_number_of_starts_ends_as_one_that_had_so_many_from_the_beginning(
    before: int, asked: int | None, again: bool, straight: tuple[Outcome, Path], tmp_path: Path
) -> None:
    """Whatever it had reached before: all, or stopped before, between and beyond the quotas. again: whether a start
    had gone on beyond the trial, so that it begins anew."""
    path = tmp_path / "resumed.h5"
    told: list[str] = []
    go(path, starts=before, **({} if asked is None else {"stop_requested": stop_after(asked)}))
    go(path, resume=True, notify=told.append)
    assert_same_files(straight[1], path)
    assert any("from the beginning" in line for line in told) == again


def test_a_run_resumed_with_one_start_takes_over_the_first_wherever_it_is(tmp_path: Path) -> None:
    go(tmp_path / "one.h5", starts=1)
    for starts in (3, 6):
        go(tmp_path / "fewer.h5", starts=starts, overwrite=True)
        told: list[str] = []
        go(tmp_path / "fewer.h5", starts=1, resume=True, notify=told.append)
        assert told == []
        assert_same_files(tmp_path / "one.h5", tmp_path / "fewer.h5")


def test_starts_that_a_run_with_more_of_them_would_have_alike_are_taken_over(tmp_path: Path) -> None:
    case = limited(hand_made_case(), 60, starts=8)
    old = go(tmp_path / "old.h5", 60, starts=4, stop_requested=stop_after(17)).states
    found = quotas.carried_over(case, [*old, *[None] * 4], 4)
    for index, (before, after) in enumerate(zip(old, found, strict=False)):
        # the fourth of four begins at the best of the others
        kept = before is not None and before.iteration <= quotas.TRIAL and index < 3
        assert (after is not None) == kept
        assert after is None or before is None or (after.running and after.alpha.tobytes() == before.alpha.tobytes())
    assert [each is not None for each in found] == [False, True, True, *[False] * 5]


def test_starts_that_are_not_needed_do_not_begin_and_the_run_has_ended_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever was found is enough: the two that would begin at the best design do not. Its file is that of a run that
    was stopped on the way and resumed, also when it had come to the end of the first quota."""
    monkeypatch.setattr(quotas, "UNFOUND", float("inf"))
    path, parts = tmp_path / "whole.h5", tmp_path / "parts.h5"
    whole = go(path)
    assert [state is None for state in whole.states] == [False] * 4 + [True] * 2
    assert whole.status == "max_iterations"
    assert read_result(path).lines("starts/status")[-2:] == ("not_begun",) * 2
    go(parts, stop_requested=stop_after(40))
    for asked in (30, 20, 5):
        go(parts, resume=True, stop_requested=stop_after(asked))
    go(parts, resume=True)
    assert_same_files(path, parts)
    assert go(path, resume=True).status == "max_iterations"
