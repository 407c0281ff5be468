"""Fronts and sweeps of cases whose candidates are priced: each point has the members that entered for it."""

import json
from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.scene import candidates
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.front.directions import weights_of_first
from mdstopo.front.run_front import Ask, run_front
from mdstopo.front.run_sweep import run_sweep
from mdstopo.plan import pricing
from mdstopo.plan.priced_designs import in_case, packed, unpacked, with_all
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus
from mdstopo.store.result_reader import read_result
from mdstopo.store.stored_case import case_of
from tests.front.test_fronts import assert_equal
from tests.session.test_priced_candidates import case_from, stiff, symmetric, two_objectives

#: the optimiser comes near soon
LOOSE = {"optimizer": {"tolerance": 1e-4}}


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Solves begin with some 40 of the 640 candidates."""
    monkeypatch.setattr(candidates, "START_SET", 40)
    monkeypatch.setattr(pricing, "MOST_ENTERING", 20)


def asked(count: int = 3) -> Ask:
    return Ask(weights_of_first(np.linspace(0.0, 1.0, count).tolist()))


def test_points_are_optima_of_all_candidates_each_with_its_own_members(tmp_path: Path) -> None:
    case = case_from(two_objectives() | LOOSE)
    priced = run_front(case, asked(), path=tmp_path / "a.h5", workers=1)
    assert priced.status is RunStatus.CONVERGED
    assert priced.front is not None
    for i, point in enumerate(priced.front.points):
        assert point is not None
        assert "no one of 640 candidates would lower U by more than 0.0001 of it" in point.reason
        if i != 1:  # the ends are optima of one objective alone
            alone = two_objectives() | LOOSE | {"combine": {"weights": {"P": float(i == 2), "T": float(i == 0)}}}
            assert point.combined == pytest.approx(run_session(case_from(alone)).combined, rel=1e-4)
    # the file has the members of all points, and no others
    view = read_result(tmp_path / "a.h5")
    built, alpha = case_of(view), view.array("pareto/alpha")
    assert alpha.shape == (3, built.n_design)
    assert np.all((alpha > 0.0).any(axis=0))
    assert not np.all((alpha > 0.0).all(axis=0))
    assert built.n_design == len(view.array("members/p"))
    for row, objectives in zip(alpha, view.array("pareto/objectives"), strict=True):
        found = Evaluator(built).evaluate(row, False).objectives
        assert [found["P"], found["T"]] == pytest.approx(objectives.tolist(), rel=1e-9)


def test_every_point_has_members_together_with_their_mirror_images(tmp_path: Path) -> None:
    scene = symmetric() | LOOSE | {"combine": {"weights": {"G": 1, "T": 1}}}
    scene["objectives"]["T"] = {"response": {"displacement": {"body": "engine", "component": "x"}}, "over_time": "rms"}
    found = run_front(case_from(scene), asked(), path=tmp_path / "a.h5", workers=1)
    assert found.status is RunStatus.CONVERGED
    view = read_result(tmp_path / "a.h5")
    left, right = case_of(view).members
    assert np.array_equal(left.from_index, right.from_index)
    assert np.array_equal(left.to_index, right.to_index)
    for row in view.array("pareto/alpha"):
        assert np.count_nonzero(row) > 0
        assert np.array_equal(*np.split(row, 2))


def test_a_stopped_front_resumes_to_the_bit(tmp_path: Path) -> None:
    case = case_from(two_objectives() | LOOSE)
    run_front(case, asked(), path=tmp_path / "straight.h5", workers=1)
    asks = 0

    def stop() -> bool:
        nonlocal asks
        asks += 1
        return asks > 60

    stopped = run_front(case, asked(), path=tmp_path / "resumed.h5", workers=1, stop_requested=stop)
    assert stopped.status is RunStatus.INTERRUPTED
    run_front(case, asked(), path=tmp_path / "resumed.h5", workers=1, resume=True)
    assert_equal(tmp_path / "straight.h5", tmp_path / "resumed.h5")


def test_several_starts_of_each_point_are_refused() -> None:
    case = case_from(two_objectives() | LOOSE)
    with pytest.raises(CaseError, match="one start of each point of a front, not 2"):
        run_front(case, Ask(asked().directions, starts=2), workers=1)


def test_runs_of_a_sweep_have_members_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "e.json").write_text(json.dumps(stiff() | LOOSE))
    path = tmp_path / "sweep.h5"
    stiffness = {"members.struts.law.stiffness": "20000,40000"}
    outcome = run_sweep(tmp_path / "e.json", {}, stiffness, path=path, workers=1)
    assert outcome.status is RunStatus.CONVERGED
    view = read_result(path)
    for i in range(2):
        first, alpha = view.array(f"sweep/members/{i}/struts/from"), view.array(f"sweep/alpha/{i}")
        assert len(first) == len(alpha) < 200
        assert alpha.min() > 0.0
    assert view.array("sweep/objectives")[1] < view.array("sweep/objectives")[0]


def test_designs_with_members_of_their_own_are_told_as_arrays() -> None:
    scene = stiff()
    scene["members"]["beside"] = {
        "from": "mounts", "to": {"body": "ground", "at": [0, -1]}, "law": {"type": "spring", "stiffness": 9},
    }  # fmt: skip
    case = case_from(scene)
    alpha = np.random.default_rng(2).uniform(0.1, 1.0, case.n_design) * (np.arange(case.n_design) % 3 > 0)
    design = packed(case, alpha)
    alone = with_all(case, [design])
    assert alone.n_design == np.count_nonzero(alpha[: len(case.members[0])]) + len(case.members[1])
    assert np.array_equal(packed(alone, in_case(alone, design)), design)
    built, again = unpacked(case, design)
    assert built.n_design == case.n_design
    assert np.array_equal(again, alpha)
    assert with_all(case, []) is case
