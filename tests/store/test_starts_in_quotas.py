"""Several starts in quotas: a resumed run decides as an uninterrupted one; who was dropped stays dropped."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fakes import FakeEngineWithEvaluations, hand_made_case, limited
from test_session import assert_same_files, stop_after

from mdstopo.session import quotas
from mdstopo.session.outcome import Outcome
from mdstopo.session.run import run_session

STARTS = 6


def go(path: Path, iterations: int = 50, **options: Any) -> Outcome:
    case = limited(hand_made_case(), iterations, starts=STARTS)
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
    assert all(state.iteration in quotas.QUOTAS and "dropped after" in state.reason for state in dropped)
    assert 1 <= sum(state.iteration == 50 for state in states) <= STARTS // 3 + 1
    assert not states[straight[0].best_start].dropped


@pytest.mark.parametrize("asked", [7, 30, 70, 125, 150])
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
