"""What a file may be replaced by, and which run may be resumed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mdstopo.case.model import Case, OptimizerSettings, SolverSettings, SpringLaw
from mdstopo.case.reader import load_case
from mdstopo.starts.callbacks import ignore
from mdstopo.store.admit import admit, admit_resume, prepare_place
from mdstopo.store.output_file import output_file
from mdstopo.store.result_reader import read_result
from mdstopo.store.same_case import describe, differences
from mdstopo.store.set_keys import without_set_keys
from mdstopo.store.store_errors import DamagedError, DifferentCaseError, StoreError, UnfinishedError
from mdstopo.store.stored_case import case_of

MakeResult = Callable[..., Path]


def test_a_finished_file_is_replaced_with_a_notice(make_result: MakeResult, case: Case, notices: list[str]) -> None:
    admit(make_result("max_iterations"), case, "run", False, notices.append)
    assert len(notices) == 1
    assert "is replaced" in notices[0]


def test_an_unfinished_file_is_refused_unless_overwriting(
    make_result: MakeResult, case: Case, notices: list[str]
) -> None:
    for status in ("running", "interrupted"):
        path = make_result(status)
        with pytest.raises(UnfinishedError, match=r"--resume continues it, --overwrite starts anew"):
            admit(path, case, "run", False, notices.append)
        assert notices == []
        admit(path, case, "run", True, notices.append)
        assert notices.pop().endswith("is overwritten")


def test_what_is_no_result_is_not_replaced(
    make_result: MakeResult, case: Case, notices: list[str], tmp_path: Path
) -> None:
    foreign = tmp_path / "thesis.h5"
    foreign.write_text("years of work")
    with pytest.raises(DamagedError, match="--overwrite replaces it"):
        admit(foreign, case, "run", False, notices.append)
    with pytest.raises(StoreError, match="holds a result of `simulate`"):
        admit(make_result(kind="simulate"), case, "run", False, notices.append)


def test_the_case_file_is_never_replaced(case: Case, notices: list[str], tmp_path: Path) -> None:
    path = tmp_path / "probe.yaml"
    path.write_text(case.text)
    with pytest.raises(StoreError, match="this is the case file"):
        admit(path, replace(case, path=path), "run", True, notices.append)


def test_an_absent_file_needs_no_words(case: Case, notices: list[str], tmp_path: Path) -> None:
    admit(tmp_path / "new.h5", case, "run", False, notices.append)
    assert notices == []


def test_a_place_is_made_ready_through_links_and_missing_directories(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link.h5").symlink_to(tmp_path / "real" / "a.h5")
    assert prepare_place(tmp_path / "link.h5") == (tmp_path / "real" / "a.h5").resolve()
    prepare_place(tmp_path / "new" / "deep" / "a.h5")
    assert (tmp_path / "new" / "deep").is_dir()
    with pytest.raises(StoreError, match="a directory"):
        prepare_place(tmp_path / "real")
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be made"):
        prepare_place(tmp_path / "file" / "sub" / "a.h5")


def test_resuming_nothing_begins_with_a_notice(case: Case, notices: list[str], tmp_path: Path) -> None:
    assert admit_resume(tmp_path / "new.h5", case, notices.append) is None
    assert "starts from the beginning" in notices[0]


def test_a_run_is_resumed_with_other_limits(make_result: MakeResult, case: Case, notices: list[str]) -> None:
    changed = replace(case, optimizer=OptimizerSettings(max_iterations=500, tolerance=1e-3, starts=8))
    view = admit_resume(make_result("interrupted"), changed, notices.append)
    assert view is not None
    assert view.status == "interrupted"
    assert notices == []


def test_text_that_means_the_same_is_the_same_case(make_result: MakeResult, case: Case, notices: list[str]) -> None:
    rewritten = replace(case, text="# a remark\n" + case.text, sha256="0" * 64, path=Path("elsewhere.yaml"))
    assert admit_resume(make_result("running"), rewritten, notices.append) is not None


def test_a_run_of_another_command_is_not_resumed(make_result: MakeResult, case: Case, notices: list[str]) -> None:
    with pytest.raises(StoreError, match="cannot be resumed"):
        admit_resume(make_result(kind="gradient"), case, notices.append)


def belts(case: Case, **changes: Any) -> Case:
    return replace(case, members=(replace(case.members[0], **changes), case.members[1]))


@pytest.mark.parametrize(
    ("change", "keys"),
    [
        (lambda c: belts(c, laws=(SpringLaw(stiffness=226.0),)), ("members.belts.law.stiffness",)),
        (lambda c: belts(c, initial=0.2), ("design.initial.belts",)),
        (lambda c: replace(c, solver=SolverSettings(tolerance=1e-9)), ("solver.tolerance",)),
        (lambda c: replace(c, optimizer=OptimizerSettings(seed=1)), ("optimizer.seed",)),
        (lambda c: replace(c, load_cases=(replace(c.load_cases[0], end=0.3),)), ("time.end",)),
        (lambda c: replace(c, load_cases=(replace(c.load_cases[0], gravity=(0.0, -9.81)),)), ("gravity",)),
        (lambda c: replace(c, bodies=(replace(c.bodies[0], mass=61.0), c.bodies[1])), ("bodies.torso.mass",)),
        (
            lambda c: replace(c, constraints=(replace(c.constraints[0], sense="limit"),)),
            ("constraints[0].sense",),
        ),
        (lambda c: replace(c, title="another"), ("title",)),
    ],
)
def test_a_changed_case_is_refused_by_the_keys_that_differ(
    change: Callable[[Case], Case],
    keys: tuple[str, ...],
    make_result: MakeResult,
    case: Case,
    notices: list[str],
) -> None:
    with pytest.raises(DifferentCaseError, match=keys[0].replace("[", r"\[")) as refusal:
        admit_resume(make_result("running"), change(case), notices.append)
    assert refusal.value.keys == keys


def test_a_key_that_is_gone_counts_as_a_difference(case: Case) -> None:
    smaller = replace(case, members=case.members[:1])
    assert all(
        key.startswith("members.gürtel.") or key.startswith("design.") for key in differences(describe(case), smaller)
    )
    assert differences(describe(case), smaller)
    assert not differences(describe(case), case)


@pytest.mark.parametrize("kind", ["simulate", "gradient"])
def test_the_file_of_a_command_has_the_case_with_what_set_has_changed(tmp_path: Path, kind: str) -> None:
    case = load_case("cases/fig6.yaml", {"time.end": "0.05", "title": "another title"})
    with output_file(tmp_path / "a.h5", case, kind, overwrite=False, notify=ignore) as file:
        file.write("converged", "done", {}, {"integrator": "gauss"})
    view = read_result(tmp_path / "a.h5")
    again = case_of(view)
    assert (again.load_cases[0].end, again.title) == (0.05, "another title")
    assert without_set_keys(view.settings) == {"integrator": "gauss"}
