"""Runs: stopped, killed and resumed ones end where straight ones end, to the bit."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mdstopo.case.model import Case, VolumeRow
from mdstopo.case.text.errors import CaseError
from mdstopo.cli.group import run_group
from mdstopo.session.outcome import Outcome, Progress
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus, Status
from mdstopo.store import atomic
from mdstopo.store.result_reader import read_result
from mdstopo.store.store_errors import DamagedError, DifferentCaseError, InUseError, UnfinishedError, WriteError
from mdstopo.workers.worker_pool import WorkerError
from tests.fakes import DyingEngine, DyingOnceEngine, FakeEngineWithEvaluations, hand_made_case, limited
from tests.result_files import assert_same_files, stop_after


def go(case: Case, path: Path | None, **options: Any) -> Outcome:
    return run_session(case, path=path, engine=FakeEngineWithEvaluations, **options)


def test_a_run_writes_the_iterations_the_contract_names(case: Case, tmp_path: Path) -> None:
    outcome = go(limited(case, 7), tmp_path / "a.h5")
    assert outcome.status is RunStatus.MAX_ITERATIONS
    view = read_result(tmp_path / "a.h5")
    columns = view.under("iterations")
    assert columns["objectives"].shape == columns["peak_time"].shape == (8, 1)
    assert columns["constraints"].shape == (8, 1)
    for name in ("combined", "change", "evaluations", "seconds"):
        assert columns[name].shape == (8,), name
    assert columns["evaluations"].tolist() == list(range(1, 9))
    assert columns["change"][0] == 0.0
    assert view.alpha.shape == (6,)
    assert columns["combined"].min() == outcome.objectives["G"] < outcome.initial_objectives["G"]
    assert np.abs(columns["constraints"]).max() < 1e-9
    assert view.under("sensitivities")["G"].shape == (6,)
    assert view.under("trajectories/default")["q"].shape == (5, 6)
    assert view.settings["integrator_reason"] == "made up"
    assert (view.settings["seed"], view.settings["max_iterations"]) == (0, 7)
    assert not view.under("starts")


@pytest.mark.parametrize("first", [0, 1, 6])
def test_a_stopped_run_resumes_to_the_bit(first: int, case: Case, tmp_path: Path) -> None:
    case = limited(case, 12)
    straight = go(case, tmp_path / "straight.h5")
    stopped = go(case, tmp_path / "resumed.h5", stop_requested=stop_after(first))
    assert stopped.status is RunStatus.INTERRUPTED
    assert stopped.iterations == first
    assert read_result(tmp_path / "resumed.h5").status == "interrupted"
    resumed = go(case, tmp_path / "resumed.h5", resume=True)
    assert resumed.alpha.tobytes() == straight.alpha.tobytes()
    assert_same_files(tmp_path / "straight.h5", tmp_path / "resumed.h5")


def test_a_finished_run_goes_on_when_the_limit_is_raised(case: Case, tmp_path: Path) -> None:
    go(limited(case, 12), tmp_path / "straight.h5")
    go(limited(case, 5), tmp_path / "resumed.h5")
    go(limited(case, 12), tmp_path / "resumed.h5", resume=True)
    assert_same_files(tmp_path / "straight.h5", tmp_path / "resumed.h5")


def test_resuming_what_is_finished_changes_nothing(case: Case, tmp_path: Path) -> None:
    go(limited(case, 5), tmp_path / "a.h5")
    before = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "b.h5").write_bytes(before)
    assert go(limited(case, 5), tmp_path / "b.h5", resume=True).status is RunStatus.MAX_ITERATIONS
    assert_same_files(tmp_path / "a.h5", tmp_path / "b.h5")


def test_starts_are_stored_and_resume_whatever_was_done(case: Case, tmp_path: Path) -> None:
    pytest.importorskip("mdstopo.optimizer.start_families")
    case = limited(case, 4, starts=3)
    straight = go(case, tmp_path / "straight.h5")
    go(case, tmp_path / "resumed.h5", stop_requested=stop_after(7))
    go(case, tmp_path / "resumed.h5", resume=True)
    assert_same_files(tmp_path / "straight.h5", tmp_path / "resumed.h5")
    starts = read_result(tmp_path / "straight.h5").under("starts")
    assert starts["objectives"].shape == (3, 1)
    assert starts["alpha"].shape == (3, 6)
    assert straight.best_start == int(np.argmin(starts["objectives"][:, 0]))
    assert straight.evaluations == 14  # one is dropped after three iterations
    more = go(limited(case, 4, starts=4), tmp_path / "resumed.h5", resume=True)
    assert more.evaluations > 14
    whole = go(limited(case, 4, starts=4), tmp_path / "whole.h5")
    assert whole.alpha.tobytes() == more.alpha.tobytes()
    assert_same_files(tmp_path / "whole.h5", tmp_path / "resumed.h5")


def test_the_first_design_can_be_given_and_is_remembered(case: Case, tmp_path: Path) -> None:
    case, initial = limited(case, 6), np.linspace(0.05, 0.15, 6)
    go(case, tmp_path / "straight.h5", initial=initial)
    go(case, tmp_path / "resumed.h5", initial=initial, stop_requested=stop_after(2))
    go(case, tmp_path / "resumed.h5", resume=True)
    assert_same_files(tmp_path / "straight.h5", tmp_path / "resumed.h5")
    with pytest.raises(DifferentCaseError, match="another --alpha"):
        go(case, tmp_path / "resumed.h5", resume=True, initial=initial[::-1])


def test_a_first_design_that_breaks_the_rows_is_replaced_with_a_notice(case: Case, notices: list[str]) -> None:
    outcome = go(limited(case, 1), None, initial=np.full(6, 0.2), notify=notices.append)
    assert len(notices) == 1
    assert "replaced by the nearest one" in notices[0]
    assert outcome.history["constraints"][0] == pytest.approx(0.0, abs=1e-12)


def test_a_first_design_of_the_wrong_shape_is_an_error(case: Case) -> None:
    for wrong in (np.ones(5), np.ones((6, 1)), np.full(6, np.nan)):
        with pytest.raises(ValueError, match="6 finite numbers"):
            go(case, None, initial=wrong)
    with pytest.raises(ValueError, match="at least 1"):
        go(case, None, starts=0)


def test_workers_that_have_nothing_to_do_are_noticed(case: Case, notices: list[str]) -> None:
    go(limited(case, 1), None, workers=4, notify=notices.append)
    assert notices == ["one start needs one process: the other workers are not used"]


def test_rows_without_any_design_are_a_mistake_of_the_case(case: Case) -> None:
    rows = (
        VolumeRow(("belts",), np.ones(6), 0.6, "equals"),
        VolumeRow(("belts",), np.ones(6), 0.9, "equals"),
    )
    with pytest.raises(CaseError, match="constraints"):
        go(replace(case, constraints=rows), None)


def test_an_unfinished_run_is_refused_and_kept(case: Case, tmp_path: Path) -> None:
    case = limited(case, 12)
    go(case, tmp_path / "a.h5", stop_requested=stop_after(3))
    before = (tmp_path / "a.h5").read_bytes()
    with pytest.raises(UnfinishedError):
        go(case, tmp_path / "a.h5")
    with pytest.raises(DifferentCaseError, match=r"optimizer\.seed"):
        go(limited(case, 12, seed=4), tmp_path / "a.h5", resume=True)
    assert (tmp_path / "a.h5").read_bytes() == before
    assert go(case, tmp_path / "a.h5", overwrite=True).iterations == 12


def test_a_state_that_is_not_whole_is_refused(case: Case, tmp_path: Path) -> None:
    go(limited(case, 12), tmp_path / "a.h5", stop_requested=stop_after(3))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file["optimizer/0/trust"]
    with pytest.raises(DamagedError, match=r"not whole.*trust"):
        go(limited(case, 12), tmp_path / "a.h5", resume=True)


def test_a_run_that_fails_keeps_its_best_design_and_says_why(case: Case, tmp_path: Path) -> None:
    outcome = run_session(
        limited(case, 40),
        path=tmp_path / "a.h5",
        engine=lambda case: FakeEngineWithEvaluations(case, fail_from=5),
    )
    assert outcome.status is RunStatus.FAILED
    assert "not finite" in outcome.reason
    view = read_result(tmp_path / "a.h5")
    assert view.status == "failed"
    assert view.alpha.tobytes() == outcome.alpha.tobytes()
    failed = np.flatnonzero(np.isnan(view.under("iterations")["objectives"][:, 0]))
    assert failed.tolist() == list(range(3, len(view.under("iterations")["objectives"])))
    assert view.array("failures/iterate").tolist() == failed.tolist()
    assert set(view.lines("failures/reason")) == {Status.NON_FINITE.value}


def test_show_tells_which_iterates_failed_and_why_in_one_line(case: Case, tmp_path: Path, capsys) -> None:
    run_session(limited(case, 6), path=tmp_path / "a.h5", engine=partial(FakeEngineWithEvaluations, fail_from=5))
    assert run_group(["show", str(tmp_path / "a.h5")]) == 0
    assert f"iterates 3, 4, 5, 6 failed: {Status.NON_FINITE.value}\n" in capsys.readouterr().out


def test_a_run_without_failures_keeps_none(case: Case, tmp_path: Path) -> None:
    go(limited(case, 3), tmp_path / "a.h5")
    assert not read_result(tmp_path / "a.h5").lines("failures/reason")


def test_a_first_design_that_fails_ends_the_run_with_a_reason(case: Case, tmp_path: Path) -> None:
    outcome = run_session(
        case, path=tmp_path / "a.h5", engine=lambda case: FakeEngineWithEvaluations(case, fail_from=1)
    )
    assert outcome.status is RunStatus.FAILED
    assert read_result(tmp_path / "a.h5").under("iterations")["objectives"].shape == (1, 1)


def test_what_cannot_be_optimised_is_refused_by_name(case: Case) -> None:
    with pytest.raises(CaseError, match="objectives: an optimisation needs"):
        go(replace(case, objectives=()), None)
    with pytest.raises(CaseError, match="members: an optimisation needs"):
        go(replace(case, members=case.members[1:], constraints=()), None)


def test_progress_is_told_of_every_iteration(case: Case) -> None:
    told: list[Progress] = []
    go(limited(case, 5), None, on_iteration=told.append)
    assert [progress.iteration for progress in told] == [0, 1, 2, 3, 4, 5]
    assert all(progress.best <= progress.objective for progress in told)
    assert told[-1].evaluations == 6


def test_a_full_disk_in_mid_run_is_noticed_and_at_the_end_an_error(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, notices: list[str]
) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(WriteError, match="No space left"):
        run_session(
            limited(case, 5),
            path=tmp_path / "a.h5",
            notify=notices.append,
            engine=lambda case: FakeEngineWithEvaluations(case, delay=0.2),
        )
    assert any("no checkpoint" in notice for notice in notices)


# Processes.


def start(path: Path, iterations: int, delay: float, *words: str) -> subprocess.Popen[str]:
    script = Path(__file__).parent / "fake_run.py"
    return subprocess.Popen(
        [sys.executable, str(script), str(path), str(iterations), str(delay), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )


def wait_for_iteration(process: subprocess.Popen[str], iteration: int) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        if int(line) >= iteration:
            return
    raise AssertionError("the run ended early")


def test_a_killed_run_resumes_to_the_bit_and_loses_half_a_second(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    process = start(path, 60, 0.02)
    wait_for_iteration(process, 45)
    with pytest.raises(InUseError, match=f"process {process.pid}"):
        go(limited(hand_made_case(), 60), path)
    process.send_signal(signal.SIGKILL)
    rest = process.communicate()[0].split()
    reached = int(rest[-1]) if rest else 45
    saved = read_result(path)
    assert saved.status == "running"
    lost = reached - (len(saved.under("iterations")["combined"]) - 1)
    assert lost * 0.021 <= 0.6
    resumed = go(limited(hand_made_case(), 60), path, resume=True)
    straight = go(limited(hand_made_case(), 60), tmp_path / "straight.h5")
    assert resumed.alpha.tobytes() == straight.alpha.tobytes()
    assert_same_files(path, tmp_path / "straight.h5")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5", "straight.h5"]


def test_workers_change_nothing(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    case = limited(case, 5, starts=3)
    one = go(case, tmp_path / "one.h5", workers=1)
    two = go(case, tmp_path / "two.h5", workers=2)
    assert one.evaluations == two.evaluations == 16  # one is dropped after three iterations
    assert_same_files(tmp_path / "one.h5", tmp_path / "two.h5")


def test_workers_stop_when_asked_and_resume_to_the_bit(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    case = limited(case, 40, starts=2)
    engine = partial(FakeEngineWithEvaluations, delay=0.02)
    seen: list[Progress] = []
    stopped = run_session(
        case,
        path=tmp_path / "a.h5",
        workers=2,
        engine=engine,
        on_iteration=seen.append,
        stop_requested=lambda: len(seen) > 0,
    )
    assert stopped.status is RunStatus.INTERRUPTED
    assert 0 < stopped.iterations < 80
    go(case, tmp_path / "a.h5", resume=True)
    go(case, tmp_path / "straight.h5")
    assert_same_files(tmp_path / "a.h5", tmp_path / "straight.h5")


def test_where_no_worker_survives_what_was_reached_is_kept(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    with pytest.raises(WorkerError, match=r"pid \d+\) ended unexpectedly"):
        run_session(limited(case, 40, starts=2), path=tmp_path / "a.h5", workers=2, engine=DyingEngine)
    view = read_result(tmp_path / "a.h5")
    assert view.status == "interrupted"
    assert "ended unexpectedly" in view.reason


def test_a_start_whose_worker_dies_goes_on_in_another_one_to_the_bit(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, notices: list[str]
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    case = limited(case, 12, starts=2)
    engine = partial(DyingOnceEngine, mark=str(tmp_path / "died"))
    run_session(case, path=tmp_path / "a.h5", workers=2, engine=engine, notify=notices.append)
    assert (tmp_path / "died").exists()
    assert [words.partition(" (pid")[0] for words in notices] == ["a worker process"]
    go(case, tmp_path / "straight.h5")
    assert_same_files(tmp_path / "a.h5", tmp_path / "straight.h5")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_after_the_iteration(number: signal.Signals, tmp_path: Path) -> None:
    process = start(tmp_path / "a.h5", 1000, 0.02)
    wait_for_iteration(process, 3)
    began = time.perf_counter()
    process.send_signal(number)
    words = process.communicate()[0].split()
    assert time.perf_counter() - began < 5.0
    assert process.returncode == 0
    assert words[-1] == "interrupted"
    view = read_result(tmp_path / "a.h5")
    assert view.status == "interrupted"
    assert len(view.under("iterations")["combined"]) - 1 == int(["3", *words][-2])


class GrazingAtTheEnd(FakeEngineWithEvaluations):
    """An engine whose final design touches only just."""

    def evaluate(self, *args: Any, **options: Any) -> Any:
        found: Any = super().evaluate(*args, **options)
        found.status, found.message = Status.GRAZING, "member 3 of group belts"
        return found


def test_what_a_final_design_lacks_is_one_warning_with_the_member(tmp_path: Path) -> None:
    outcome = run_session(limited(hand_made_case(), 2), path=tmp_path / "a.h5", engine=GrazingAtTheEnd)
    (told,) = (each for each in outcome.warnings if "member 3" in each)
    assert told == f"the sensitivities of the final design: {Status.GRAZING.value}: member 3 of group belts"
