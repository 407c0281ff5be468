"""Runs in stages: `design.power` as a list, each optimum the start of the next."""

import json
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

import mdstopo
from mdstopo.case.design.stages import stage_case, stage_count
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.session.outcome import Outcome
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus
from tests.result_files import assert_same_files

#: a body on springs all around it, pushed to the side and turned
SCENE = """
format: 1
time: {end: 0.2}
bodies: {unit: {mass: 2, inertia: 0.05, position: [0, 0]}}
points:
  inner: {body: unit, grid: {rectangle: {center: [0, 0], size: [0.2, 0.2], count: 4}}}
  outer: {body: ground, grid: {rectangle: {center: [0, 0], size: [1, 1], count: 8}}}
members: {web: {from: inner, to: outer, law: {type: spring, stiffness: 900, damping: 4}}}
loads: [{body: unit, force: [60, 20], moment: 3}]
design: {initial: 0.3, power: 1}
objectives: {sway: {response: {displacement: {body: unit, at: [0.1, 0.1]}}, over_time: max}}
constraints: [{volume: all, limit: 6}]
optimizer: {max_iterations: 25, tolerance: 1e-6}
"""


def staged(power: str = "[1, 3]", **changes: object) -> Case:
    case = read_case(SCENE.replace("power: 1}", f"power: {power}}}"))
    return replace(case, optimizer=replace(case.optimizer, **changes))


def grey(outcome: Outcome) -> int:
    return int(np.count_nonzero((outcome.alpha > 0.05) & (outcome.alpha < 0.95)))


def stop_after(count: int):
    reached: list[int] = []
    return {"on_iteration": lambda progress: reached.append(0), "stop_requested": lambda: len(reached) >= count}


def test_a_higher_power_in_a_second_stage_leaves_fewer_members_between():
    alone, at_once, both = (run_session(staged(power, max_iterations=80)) for power in ("1", "3", "[1, 3]"))
    assert grey(alone) >= 2
    assert grey(both) == 0
    assert both.constraints[0] <= 1e-9
    # with the last power from the start, another and worse design is found
    assert alone.objectives["sway"] < both.objectives["sway"] < 0.8 * at_once.objectives["sway"]


def test_stages_are_two_runs_by_hand_to_the_bit():
    case = staged()
    both = run_session(case)
    first = run_session(staged("1"))
    second = run_session(staged("3"), initial=first.alpha)
    assert both.alpha.tobytes() == second.alpha.tobytes()
    assert both.objectives == second.objectives
    assert both.initial_objectives == second.initial_objectives
    assert both.evaluations == first.evaluations + second.evaluations
    assert both.iterations == first.iterations + second.iterations
    for name in ("objectives", "kkt", "change", "constraints", "accepted", "combined"):
        by_hand = np.concatenate([first.history[name], second.history[name]])
        assert both.history[name].tobytes() == by_hand.tobytes(), name
    rows = [len(each.history["combined"]) for each in (first, second)]
    assert both.history["stage"].tolist() == [0] * rows[0] + [1] * rows[1]
    assert both.history["evaluations"].tolist() == list(range(1, sum(rows) + 1))
    assert mdstopo.evaluate(case, both.alpha).objectives == both.objectives


def test_a_list_of_one_and_a_number_are_the_same_case_and_have_no_stages():
    one, other = staged("[3]"), staged("3")
    assert stage_count(one) == 1
    assert one.members == other.members
    assert "stage" not in run_session(replace(one, optimizer=replace(one.optimizer, max_iterations=2))).history


def test_shorter_lists_stay_at_their_last_and_groups_left_out_at_1():
    text = SCENE.replace(
        "members: {web: {from: inner, to: outer, law: {type: spring, stiffness: 900, damping: 4}}}",
        "members:\n"
        + "".join(f"  {name}: {{from: inner, to: outer, law: {{type: spring, stiffness: 9}}}}\n" for name in "abcd"),
    ).replace("power: 1}", "power: {a: [1, 2, 4], b: [1.5, 3], c: 2}}")
    case = read_case(text)
    assert [group.power for group in case.members] == [4, 3, 2, 1]
    assert [[g.power for g in stage_case(case, k).members] for k in range(stage_count(case))] == [
        [1, 1.5, 2, 1],
        [2, 3, 2, 1],
        [4, 3, 2, 1],
    ]


def test_a_run_that_is_stopped_anywhere_in_any_stage_and_resumed_is_the_same_to_the_bit(tmp_path):
    case = staged("[1, 2, 3]", max_iterations=4)
    whole = run_session(case, path=tmp_path / "whole.h5")
    rows = len(whole.history["combined"])
    assert whole.iterations == rows - 3
    assert set(whole.history["stage"].tolist()) == {0, 1, 2}
    for count in range(1, rows):
        place = tmp_path / f"{count}.h5"
        stopped = run_session(case, path=place, **stop_after(count))
        assert stopped.status is RunStatus.INTERRUPTED
        assert len(stopped.history["combined"]) == count
        resumed = run_session(case, path=place, resume=True)
        assert resumed.iterations == whole.iterations
        assert_same_files(tmp_path / "whole.h5", place)


def test_starts_go_through_the_stages_alike_on_any_number_of_processes_and_resumed(tmp_path):
    case = staged("[1, 3]", max_iterations=4, starts=3)
    run_session(case, path=tmp_path / "one.h5")
    run_session(case, path=tmp_path / "two.h5", workers=2)
    run_session(case, path=tmp_path / "parts.h5", **stop_after(13))
    with h5py.File(tmp_path / "parts.h5") as file:
        assert file["starts/status"][()].astype(str).tolist() == ["max_iterations", "running", "not_begun"]
    run_session(case, path=tmp_path / "parts.h5", resume=True, workers=2)
    assert_same_files(tmp_path / "one.h5", tmp_path / "two.h5")
    assert_same_files(tmp_path / "one.h5", tmp_path / "parts.h5")


def test_the_best_design_is_the_last_stages_however_low_objectives_were_before():
    outcome = run_session(staged("[1, 3]"))
    history = outcome.history
    last = history["combined"][history["stage"] == 1]
    assert np.nanmin(history["combined"]) < last.min()
    assert outcome.objectives["sway"] == last.min()


def test_parameters_of_laws_go_on_from_stage_to_stage():
    text = SCENE.replace(
        "power: 1}",
        "power: [1, 3], variables: {k: {group: web, parameter: damping, lower: 1, upper: 9}}}",
    )
    case = read_case(text)
    case = replace(case, optimizer=replace(case.optimizer, max_iterations=5))
    both = run_session(case)
    first = run_session(stage_case(case, 0))
    own = np.concatenate([first.alpha, first.variables["k"]])
    second = run_session(stage_case(case, 1), initial=own)
    assert both.alpha.tobytes() == second.alpha.tobytes()
    assert both.variables["k"].tolist() == second.variables["k"].tolist()
    assert both.variables["k"][0] != 4.0


def test_another_list_is_another_case_when_resuming(tmp_path):
    from mdstopo.store.store_errors import DifferentCaseError

    run_session(staged("[1, 3]", max_iterations=3), path=tmp_path / "a.h5", **stop_after(2))
    for other in ("3", "[1, 2, 3]"):
        with pytest.raises(DifferentCaseError, match=r"design\.power"):
            run_session(staged(other, max_iterations=3), path=tmp_path / "a.h5", resume=True)


@pytest.mark.parametrize(
    ("power", "path", "words"),
    [
        ("[]", "design.power", "needed are at least 1 powers"),
        ("[0, 1]", "design.power[0]", "found 0"),
        ("[1, two]", "design.power[1]", "two"),
        ("[3, 1]", "design.power[1]", "found 1, allowed is > 3, the power before it"),
        ("{web: [1, 1]}", "design.power.web[1]", "found 1, allowed is > 1, the power before it"),
        ("{web: []}", "design.power.web", "needed are at least 1 powers"),
        ("[0.5, 1], lower: 0", "design.lower", "allowed is > 0 where power is below 1 (here 0.5)"),
    ],
)
def test_lists_that_mean_nothing_are_refused_with_their_place(power, path, words):
    with pytest.raises(CaseError) as refused:
        staged(power)
    assert [(each.path_key, words in each.message) for each in refused.value.mistakes] == [(path, True)]
    assert refused.value.mistakes[0].line == 10


def test_what_has_no_stages_is_refused_by_name():
    several = SCENE.replace("power: 1}", "power: [1, 3]}").replace(
        "objectives: {", "combine: {weights: {sway: 1, e: 1}}\nobjectives: {e: {response: energy, over_time: max}, "
    )
    with pytest.raises(
        CaseError, match=r"design.power: found a list of 2 powers, allowed is one .* several objectives"
    ):
        read_case(several)
    uncertain = SCENE.replace("power: 1}", "power: [1, 3]}") + (
        "uncertainty: {variables: {push: {key: 'loads[0].force[0]', normal: {mean: 60, deviation: 5}}}}\n"
    )
    with pytest.raises(CaseError, match=r"design.power: found a list of 2 powers, allowed is one .* uncertain values"):
        read_case(uncertain)


def test_commands_tell_the_stages_and_refuse_with_status_2(tmp_path):
    place = tmp_path / "web.yaml"
    place.write_text(SCENE.replace("power: 1}", "power: {web: [1, 3]}}"))

    def call(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([sys.executable, "-m", "mdstopo", *words], capture_output=True, text=True, check=False)

    told = call("check", str(place))
    assert "2 stages of a run, by design.power" in told.stdout, told.stderr
    assert json.loads(call("check", "--json", str(place)).stdout)["stages"] == [{"web": 1.0}, {"web": 3.0}]
    made = str(tmp_path / "web.h5")
    done = json.loads(call("run", "--json", str(place), "--out", made).stdout)
    counted = f"{done['iterations']} iterations in 2 stages, {done['evaluations']} evaluations"
    assert counted in call("show", made).stdout
    assert json.loads(call("show", "--json", made).stdout)["iterations"] == done["iterations"]
    refused = call("check", str(place), "--set", "design.power=[3, 1]")
    assert refused.returncode == 2
    assert "design.power[1]" in refused.stderr


def test_each_run_of_a_sweep_goes_through_the_stages(tmp_path):
    from mdstopo.front.run_sweep import run_sweep

    place = tmp_path / "web.yaml"
    place.write_text(SCENE.replace("power: 1}", "power: [1, 3]}"))
    swept = run_sweep(place, {}, {"optimizer.max_iterations": "2,4"}, path=tmp_path / "s.h5", workers=1)
    for each, most in zip(swept.found, (2, 4), strict=True):
        alone = run_session(staged(max_iterations=most))
        assert each.alpha.tobytes() == alone.alpha.tobytes()
        assert each.evaluations == alone.evaluations == 2 * (most + 1)


def test_a_design_made_in_stages_is_finalized_at_the_last_power():
    from mdstopo.finalize.keep import restricted

    case = staged()
    assert [(g.power, g.powers) for g in restricted(case, np.arange(5), case.initial).members] == [(3.0, ())]


def test_a_stage_that_fails_ends_the_run_and_says_which(monkeypatch):
    from mdstopo.evaluators import make_engine
    from mdstopo.optimizer.problem import Sample
    from mdstopo.status import Status

    class Broken:
        def __init__(self, case: Case) -> None:
            self._engine = make_engine(case)
            self._bad = case.power[0] == 2.0

        def __getattr__(self, name: str):
            return getattr(self._engine, name)

        def problem(self):
            problem = self._engine.problem()
            if self._bad:
                problem.evaluate = lambda x, gradient=True: Sample(float("nan"), status=Status.NON_FINITE)
            return problem

    case = staged("[1, 2, 3]", max_iterations=3)
    outcome = run_session(case, engine=Broken)
    assert outcome.status is RunStatus.FAILED
    assert outcome.reason.startswith("stage 2 of 3: the initial design cannot be evaluated")
    assert outcome.history["stage"].tolist() == [0, 0, 0, 0, 1]
    assert np.isnan(outcome.history["objectives"][-1]).all()
