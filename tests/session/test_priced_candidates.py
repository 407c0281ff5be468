"""Candidates that are priced: the optimum of all of them, with few of them built; files, stops and refusals."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.scene import candidates
from mdstopo.case.scene.candidates import coincident, with_members
from mdstopo.case.text.errors import CaseError
from mdstopo.cli.group import run_group
from mdstopo.engine import Evaluator
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.plan import pricing, pricing_rounds
from mdstopo.plan.pricing_rounds import COLUMNS
from mdstopo.scene.refusals import refusals
from mdstopo.session.outcome import Outcome
from mdstopo.session.run_session import run_session
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus, Status
from mdstopo.store.result_reader import read_result
from mdstopo.store.stored_case import case_of
from tests.reading import case_from
from tests.result_files import assert_same_files, stop_after

MOUNTS, FRAME = 16, 40


def engine(candidates: str = "priced", **changes: Any) -> dict[str, Any]:
    """An engine that is pushed and turned, on struts to a frame."""
    times = np.linspace(0.0, 0.1, 9)
    force = np.stack([times, 300 * np.sin(np.pi * times / 0.1), 200 * np.sin(0.5 * np.pi * times / 0.1)], axis=1)
    moment = np.stack([times, 60 * np.sin(1.5 * np.pi * times / 0.1)], axis=1)
    scene = {
        "format": 1,
        "time": {"end": 0.1},
        "bodies": {"engine": {"mass": 10, "inertia": 0.5, "position": [0, 0]}},
        "points": {
            "mounts": {
                "body": "engine",
                "grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], "count": MOUNTS}},
            },
            "frame": {
                "body": "ground",
                "grid": {"rectangle": {"center": [0.1, 0.05], "size": [2, 1.6], "count": FRAME}},
            },
        },
        "members": {
            "struts": {
                "from": "mounts", "to": "frame", "law": {"type": "spring", "stiffness": 2000},
                "candidates": candidates,
            },
        },
        "loads": [{"body": "engine", "force": {"table": force.tolist()}, "moment": {"table": moment.tolist()}}],
        "design": {"initial": 0.1, "lower": 0, "upper": 1},
        "objectives": {"G": {"response": "energy", "over_time": "max"}},
        "constraints": [{"volume": "all", "limit": 40}],
    }  # fmt: skip
    return scene | changes


def stiff(candidates: str = "priced") -> dict[str, Any]:
    """The same on stiff struts, which it deforms slowly: one basin."""
    scene = engine(candidates, objectives={"G": {"response": "energy", "over_time": "mean"}})
    scene["members"]["struts"]["law"]["stiffness"] = 20000
    return scene


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs begin with some 40 of the 640 candidates, and a few enter at once."""
    monkeypatch.setattr(candidates, "START_SET", 40)
    monkeypatch.setattr(pricing, "MOST_ENTERING", 20)


def by_points(outcome: Outcome) -> dict[tuple[int, int], float]:
    (group,) = outcome.case.members
    pairs = zip(group.from_index.tolist(), group.to_index.tolist(), strict=True)
    return {pair: value for pair, value in zip(pairs, outcome.alpha.tolist(), strict=True) if value > 0.0}


def test_the_optimum_is_that_of_all_candidates(few: None) -> None:
    priced, whole = run_session(case_from(stiff())), run_session(case_from(stiff("enumerated")))
    assert priced.status is whole.status is RunStatus.CONVERGED
    assert priced.pricing is not None
    assert priced.pricing.candidates == MOUNTS * FRAME == whole.case.n_design
    assert priced.pricing.rounds > 1
    assert priced.case.n_design < 200
    assert abs(priced.objectives["G"] / whole.objectives["G"] - 1.0) <= 1e-6
    assert priced.pricing.best <= 1e-6
    assert "no one of 640 candidates would lower G by more than 1e-06 of it" in priced.reason
    assert "to first order" in priced.reason
    mine, theirs = by_points(priced), by_points(whole)
    assert max(abs(mine.get(pair, 0.0) - theirs.get(pair, 0.0)) for pair in mine | theirs) < 0.02


def test_no_round_ends_higher_and_members_leave(few: None, tmp_path: Path) -> None:
    run_session(case_from(stiff()), path=tmp_path / "a.h5")
    table = read_result(tmp_path / "a.h5").under("candidates/rounds")
    assert set(table) == set(COLUMNS)
    assert np.all(np.diff(table["objective"]) <= 1e-9 * table["objective"][0])
    assert table["left"].sum() > 0
    assert np.array_equal(np.diff(table["members"]), (table["entered"] - table["left"])[:-1])
    assert np.all(table["best"][:-1] > 0)
    assert table["best"][-1] <= 1e-6


def test_gains_foretell_what_a_little_of_a_candidate_changes(few: None) -> None:
    case = case_from(engine())
    evaluator = Evaluator(case)
    x = np.full(case.n_design, 0.25)
    found = pricing.price(case, evaluator.problem(), x)
    assert found is not None
    i, j = (each[:1] for each in found.pairs["struts"])
    (group,) = case.members
    larger = with_members(case, {"struts": (np.append(group.from_index, i), np.append(group.to_index, j))})
    alpha, step = np.append(x, 0.0), 1e-4
    values = [Evaluator(larger).evaluate(alpha + step * k * (np.arange(len(alpha)) == len(x)), False).objectives["G"]
              for k in (0, 1, 2)]  # fmt: skip
    slope = (-1.5 * values[0] + 2.0 * values[1] - 0.5 * values[2]) / step
    _, rows, linear = pricing._multipliers(evaluator.problem(), evaluator.problem().evaluate(x), x)
    assert rows[0] == pytest.approx(1.0)
    assert found.best * values[0] == pytest.approx(-(slope + linear[0]), rel=1e-6)


def test_with_all_candidates_built_none_gains(few: None) -> None:
    candidates.START_SET = 10**6
    outcome = run_session(case_from(engine()))
    assert outcome.case.n_design == MOUNTS * FRAME
    assert outcome.pricing is not None
    assert (outcome.pricing.rounds, outcome.pricing.best, outcome.pricing.together) == (1, 0.0, 0.0)


@pytest.mark.parametrize("first", [1, 20, 45])
def test_a_stopped_run_resumes_to_the_bit(first: int, few: None, tmp_path: Path) -> None:
    case = case_from(engine())
    straight = run_session(case, path=tmp_path / "straight.h5")
    assert straight.iterations > 45
    stopped = run_session(case, path=tmp_path / "resumed.h5", stop_requested=stop_after(first))
    assert stopped.status is RunStatus.INTERRUPTED
    resumed = run_session(case, path=tmp_path / "resumed.h5", resume=True)
    assert resumed.alpha.tobytes() == straight.alpha.tobytes()
    assert resumed.reason == straight.reason
    assert_same_files(tmp_path / "straight.h5", tmp_path / "resumed.h5")
    again = run_session(case, path=tmp_path / "resumed.h5", resume=True)
    assert again.pricing == straight.pricing
    assert_same_files(tmp_path / "straight.h5", tmp_path / "resumed.h5")


def test_the_file_holds_the_members_that_entered(few: None, tmp_path: Path) -> None:
    outcome = run_session(case_from(engine()), path=tmp_path / "a.h5")
    view = read_result(tmp_path / "a.h5")
    case = case_of(view)
    assert case.n_design == outcome.case.n_design == len(view.alpha) == len(view.array("members/p"))
    assert np.array_equal(case.members[0].p_world, view.array("members/p"))
    found = Evaluator(case).evaluate(view.alpha)
    assert found.objectives["G"] == outcome.objectives["G"]
    assert np.array_equal(view.array("sensitivities/G"), found.gradients["G"])


def test_commands_take_the_file_of_a_run(few: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "e.json").write_text(json.dumps(engine()))
    case, result = str(tmp_path / "e.json"), str(tmp_path / "e.h5")

    def call(*words: str) -> str:
        status, said = run_group(list(words)), capsys.readouterr()
        assert status == 0, said.err
        return said.out

    assert "struts: 640 candidates, priced; 40 of them" in call("check", case)
    assert re.search("candidates +640, [0-9]+ rounds", call("run", case, "--out", result))
    assert "rounds" in call("show", result)
    call("gradient", case, "--alpha", result, "--out", str(tmp_path / "g.h5"))
    call("plot", result, "design", "--out", str(tmp_path / "d.svg"))
    call("report", result, "--out", str(tmp_path / "r.html"))
    call("finalize", result, "--threshold", "0.01", "--out", str(tmp_path / "f.yaml"))
    told = json.loads(call("run", case, "--out", result, "--json", "--quiet"))
    assert told["pricing"]["candidates"] == 640
    assert told["pricing"]["best"] <= 1e-6


def jointed(candidates: str = "priced") -> dict[str, Any]:
    """The same on a hinge, its swing and the pull of its stay limited."""
    scene = stiff(candidates)
    scene["joints"] = [{"type": "revolute", "bodies": ["ground", "engine"], "at": [0.1, 0.2]}]
    scene["members"]["stay"] = {
        "from": {"body": "engine", "at": [0.25, -0.25]}, "to": {"body": "ground", "at": [0.5, -0.8]},
        "law": {"type": "spring", "stiffness": 20000}, "design": False,
    }  # fmt: skip
    swing = {"angle": {"body": "engine"}}
    scene["objectives"] = {"G": {"response": swing, "over_time": "rms"}}
    scene["constraints"] = [
        {"volume": "all", "limit": 12},
        {"response": {"member_force": {"group": "stay"}}, "over_time": "max", "limit": 30},
    ]
    return scene


def two_objectives(candidates: str = "priced") -> dict[str, Any]:
    """The same on stiff struts, pushed in one load case, and turned in another."""
    scene = stiff(candidates)
    (load,) = scene.pop("loads")
    scene["load_cases"] = {
        "push": {"loads": [{"body": "engine", "force": load["force"]}]},
        "turn": {"loads": [{"body": "engine", "moment": load["moment"]}]},
    }
    energy = {"response": "energy", "over_time": "mean"}
    scene["objectives"] = {"P": {**energy, "load_case": "push"}, "T": {**energy, "load_case": "turn"}}
    return scene | {"combine": {"weights": {"P": 1, "T": 2}}}


def uncertain(candidates: str = "priced") -> dict[str, Any]:
    """The same on stiff struts whose stiffness is uncertain, as the load's point of attack is."""
    parameters = {
        "members.struts.law.stiffness": {"uniform": {"from": 15000, "to": 25000}},
        "loads[0].at[0]": {"uniform": {"from": -0.1, "to": 0.1}},
    }
    scene = stiff(candidates)
    scene["loads"][0]["at"] = [0.01, 0]
    return scene | {
        "uncertainty": {
            "parameters": parameters, "sample": 4, "validation": 0,
            "objectives": {"G": {"measure": "mean_deviation", "factor": 1}},
        },
    }  # fmt: skip


@pytest.mark.parametrize("scene", [jointed, uncertain], ids=lambda scene: scene.__name__)
def test_the_optimum_is_that_of_all_candidates_whatever_the_case(scene: Any, few: None) -> None:
    priced, whole = run_session(case_from(scene())), run_session(case_from(scene("enumerated")))
    assert priced.status is whole.status is RunStatus.CONVERGED, (priced.reason, whole.reason)
    assert priced.pricing is not None
    assert priced.pricing.rounds > 1
    assert priced.case.n_design < 250
    assert abs(priced.objectives["G"] / whole.objectives["G"] - 1.0) <= 1e-6
    assert "no one of 640 candidates would lower G by more than 1e-06 of it" in priced.reason


def symmetric(candidates: str = "priced") -> dict[str, Any]:
    """The stiff engine on struts to the left and to the right, each with the alpha of its mirror image."""
    scene = stiff(candidates) | {"points": {}, "members": {}}
    for side, sign in (("left", -1), ("right", 1)):
        lines = {"mounts": ([0.25, -0.25], [0.25, 0.25], 8), "frame": ([1, -0.8], [1.2, 0.9], 20)}
        for name, (begin, end, count) in lines.items():
            ends = {"from": [sign * begin[0], begin[1]], "to": [sign * end[0], end[1]]}
            body = "engine" if name == "mounts" else "ground"
            scene["points"][f"{name}_{side}"] = {"body": body, "grid": {"line": ends | {"count": count}}}
        scene["members"][side] = {
            "from": f"mounts_{side}", "to": f"frame_{side}", "law": {"type": "spring", "stiffness": 20000},
            "candidates": candidates,
        }  # fmt: skip
    scene["design"]["mirrored"] = [["left", "right"]]
    return scene


def other_lengths(scene: dict[str, Any]) -> None:
    """Have members cost their lengths, and those on the right longer than their images."""
    for group in scene["members"].values():
        group["cost"] = "length"
    scene["points"]["frame_right"]["grid"]["line"]["to"] = [1.2, 1]


def test_mirror_images_are_priced_together(few: None) -> None:
    priced, whole = run_session(case_from(symmetric())), run_session(case_from(symmetric("enumerated")))
    assert priced.status is whole.status is RunStatus.CONVERGED, (priced.reason, whole.reason)
    assert priced.pricing is not None
    assert priced.pricing.rounds > 1
    assert priced.pricing.candidates == whole.case.n_design == 320
    assert priced.case.n_design < 200
    assert abs(priced.objectives["G"] / whole.objectives["G"] - 1.0) <= 1e-6
    left, right = priced.case.members
    assert np.array_equal(left.from_index, right.from_index)
    assert np.array_equal(left.to_index, right.to_index)
    assert np.array_equal(*np.split(priced.alpha, 2))


def largest_gain(outcome: Outcome, whole: Case) -> float:
    """The largest gain of a candidate that is not built, relative to U, from the gradient of all of them."""
    built = Evaluator(outcome.case)
    scalarisation = None
    if outcome.case.combine is not None:
        weights = [outcome.case.combine.weights[each.name] for each in outcome.case.objectives]
        scalarisation = Scalarisation("weighted_sum", np.array(weights))
    problem = built.problem(scalarisation)
    found = pricing.price(outcome.case, problem, outcome.alpha)
    assert found is not None
    group, every = outcome.case.members[0], whole.members[0]
    places = group.from_index * len(every.to_local) + group.to_index
    x = np.zeros(whole.n_design)
    x[places] = outcome.alpha
    other = Evaluator(whole).problem(scalarisation)
    sample = other.evaluate(x)
    slopes = pricing.slopes_with(found, pricing.gradients_of(sample), places) + found.linear @ other.linear.A
    return float((-slopes[x == 0.0]).max() / abs(sample.objective))


def test_where_the_result_says_that_no_candidate_gains_none_does(few: None) -> None:
    weights = {"method": "weighted_sum", "weights": {"P": 1, "T": 2}, "normalize": False}
    scene = two_objectives() | {"combine": weights}
    outcome = run_session(case_from(scene))
    assert outcome.status is RunStatus.CONVERGED
    assert "no one of 640 candidates would lower U by more than 1e-06 of it" in outcome.reason
    assert largest_gain(outcome, case_from(scene | {"members": stiff("enumerated")["members"]})) <= 1.01e-6


def test_where_none_of_members_with_slack_gains_none_does(few: None) -> None:
    scene = stiff()
    scene["members"]["struts"]["law"] = {"type": "gap", "stiffness": 20000, "gap": 0.0005}
    for k, at in enumerate(([-1, 0.1], [1, 0.3], [0.1, -1])):
        scene["members"][f"stay{k}"] = {
            "from": {"body": "engine", "at": [0.2 * at[0], 0.2]}, "to": {"body": "ground", "at": at},
            "law": {"type": "spring", "stiffness": 3000, "damping": 20}, "design": False,
        }  # fmt: skip
    scene["objectives"] = {"G": {"response": {"displacement": {"body": "engine"}}, "over_time": "max"}}
    outcome = run_session(case_from(scene))
    assert outcome.status is RunStatus.CONVERGED
    assert "no one of 640 candidates would lower G by more than 1e-06 of it" in outcome.reason
    scene["members"]["struts"]["candidates"] = "enumerated"
    assert largest_gain(outcome, case_from(scene)) <= 1.01e-6


def test_the_optimum_of_one_objective_is_priced_by_its_own_kernels(few: None) -> None:
    scene = stiff()
    scene["objectives"] |= {"A": {"response": {"acceleration": {"body": "engine"}}, "over_time": "max"}}
    scene |= {"combine": {"method": "weighted_sum", "weights": {"G": 0.5, "A": 0.5}}}
    scene["optimizer"] = {"max_iterations": 4, "tolerance": 0.01}  # soon no candidate gains more
    outcome = run_session(case_from(scene))  # G alone is the energy of springs between free bodies, with A it is not
    assert outcome.pricing is not None
    assert outcome.pricing.rounds >= 1


def test_several_starts_go_on_from_the_best_of_them(few: None, tmp_path: Path) -> None:
    material = [{"volume": "all", "equals": 40}]
    case = case_from(engine(optimizer={"starts": 3}, constraints=material))
    several = run_session(case, path=tmp_path / "straight.h5")
    assert several.pricing is not None
    assert several.pricing.rounds > 1
    assert several.pricing.best <= 1e-6
    for after in (2, several.iterations - 3):
        path = tmp_path / f"resumed{after}.h5"
        assert run_session(case, path=path, stop_requested=stop_after(after)).status is RunStatus.INTERRUPTED
        assert run_session(case, path=path, resume=True).reason == several.reason
        assert_same_files(tmp_path / "straight.h5", path)


REFUSED = [
    ({"design": {"initial": 0.1}}, "design.lower", "found 0.001 for 'struts', allowed is 0"),
    ({"design": {"lower": 0, "power": 2}}, "design.power", "found 2 for 'struts', allowed is 1"),
    ({"design": {"lower": 0, "shared": ["struts"]}}, "members.struts.candidates", "design.shared"),
    ({"solver": {"sensitivity": "direct"}}, "members.struts.candidates", "adjoint, not direct"),
    ({"solver": {"settle": True}}, "members.struts.candidates", "static settling"),
]


@pytest.mark.parametrize(("changes", "key", "words"), REFUSED, ids=[words for _, _, words in REFUSED])
def test_what_does_not_go_with_prices_is_refused_before_anything_is_compiled(
    changes: dict[str, Any], key: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def begun(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(subprocess, "Popen", begun)
    case = case_from(engine(**changes))
    (mistake,) = refusals(case)
    assert mistake.path_key == key
    assert words in mistake.message
    with pytest.raises(CaseError, match=words):
        run_session(case)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda scene: scene["members"]["right"].update(candidates="enumerated"), "those of the other are not"),
        (
            lambda scene: scene["members"]["right"].update(cost=2),
            "costs, min_length and max_length have to be the same",
        ),
        (
            lambda scene: scene["points"]["mounts_right"]["grid"]["line"].update(count=9),
            "from has 8 points in one and 9 in",
        ),
        (other_lengths, "are no mirror images"),
        (
            lambda scene: scene["members"]["right"].update({"from": "frame_right", "to": "mounts_right"}),
            "from has 8 points in one and 20 in",
        ),
    ],
)
def test_groups_that_are_no_mirror_images_are_mistakes(change: Any, words: str) -> None:
    scene = symmetric()
    change(scene)
    with pytest.raises(CaseError, match="'left' and 'right' cannot be priced together") as told:
        case_from(scene)
    assert words in str(told.value)


@pytest.mark.parametrize(
    ("group", "words"),
    [
        ({"connect": "pairs"}, "members.struts.candidates: found priced, allowed with `connect: pairs`"),
        ({"design": False}, "members.struts.candidates: found priced, allowed with `design: false`"),
        ({"candidates": "listed"}, "members.struts.candidates: found the text 'listed'"),
    ],
)
def test_groups_that_cannot_be_priced_are_mistakes(group: dict[str, Any], words: str) -> None:
    scene = engine()
    scene["members"]["struts"] |= group
    with pytest.raises(CaseError, match="candidates") as told:
        case_from(scene)
    assert words in str(told.value)


def test_a_share_of_candidates_that_are_priced_is_a_mistake() -> None:
    with pytest.raises(CaseError, match="a share of all candidates of struts is not known"):
        case_from(engine(constraints=[{"volume": "all", "fraction": 0.1}]))


def test_a_start_set_suffices_for_what_is_to_be_spent() -> None:
    case = case_from(engine(constraints=[{"volume": "all", "equals": 300}]))
    assert case.constraints[0].coefficients.sum() >= 600


def test_ends_that_meet_are_found_among_all_candidates() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.uniform(-1, 1, (3000, 2)), rng.uniform(-1, 1, (2500, 2))
    assert coincident(first, second, 1e-12) == (0, (0, 0))
    second[1000], second[7] = first[2999] + 1e-14, first[2000]
    assert coincident(first, second, 1e-12) == (2, (2000, 7))
    lattice = np.stack(np.meshgrid(np.arange(50.0), np.arange(40.0)), axis=-1).reshape(-1, 2)
    assert coincident(lattice, lattice, 1e-12) == (2000, (0, 0))


def test_candidates_are_priced_where_a_member_only_just_touches(few: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Slopes hold on one side there, which optimisers go on with."""
    case = case_from(engine())
    problem: Any = Evaluator(case).problem()
    x = np.full(case.n_design, 0.25)
    whole, evaluation = pricing.price(case, problem, x), problem.evaluation
    monkeypatch.setattr(problem, "evaluation", lambda x: evaluation(x)._replace(status=Status.GRAZING))
    found = pricing.price(case, problem, x)
    assert whole is not None
    assert found is not None
    assert found.best == whole.best > 0.0


@pytest.mark.parametrize("ended", [RunStatus.CONVERGED, RunStatus.FAILED])
def test_what_candidates_gain_is_not_told_by_slopes_with_which_built_members_are_at_no_optimum(
    few: None, monkeypatch: pytest.MonkeyPatch, ended: RunStatus
) -> None:
    """As on one side of a kink; here at a design that is none."""
    monkeypatch.setattr(pricing_rounds, "MOST_ROUNDS", 1)
    case = case_from(engine())
    problem = Evaluator(case).problem()
    state = Gsao(problem, settings(max_iterations=1)).start()
    state.status = ended
    rounds = pricing_rounds.Rounds(case)
    assert not rounds.go_on(problem, state)
    status, reason = rounds.conclude(state)
    assert status is (RunStatus.FAILED if ended is RunStatus.FAILED else RunStatus.STALLED)
    assert "whether one of 640 candidates would lower G is not known" in reason


def test_members_that_finalize_keeps_of_a_priced_run_stay_the_same(few: None, tmp_path: Path) -> None:
    """Their points make other pairs, too, which are no candidates any more."""
    case = tmp_path / "engine.yaml"
    case.write_text(json.dumps(engine()))
    result = tmp_path / "engine.h5"
    assert run_group(["run", str(case), "--out", str(result), "--quiet"]) == 0
    view = read_result(result)
    (group,) = case_of(view).members
    kept = np.sort(np.argsort(-view.alpha, kind="stable")[:6])
    assert run_group(["finalize", str(result), "--keep", "6", "--quiet"]) == 0
    final = read_case((tmp_path / "engine.final.yaml").read_text())
    ends = [(each.from_world[0].tolist(), each.to_world[0].tolist()) for each in final.members]
    assert ends == [
        (group.from_world[i].tolist(), group.to_world[j].tolist())
        for i, j in zip(group.from_index[kept], group.to_index[kept], strict=True)
    ]
