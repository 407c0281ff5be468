"""Gauss collocation of general scenes in a plane: against explicit steps, the springs' own, space, and differences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.evaluators import evaluator_of
from mdstopo.finalize.lift_case import lifted
from tests.robust.scenes import read, uncertain

from .support import design_of, load, slopes

FIG6 = Path(__file__).parents[2] / "cases" / "fig6.yaml"
#: two bodies on springs and ground
PAIR: dict[str, Any] = {
    "format": 1,
    "gravity": [0, -9.81],
    "time": {"end": 0.6},
    "bodies": {
        "a": {"mass": 3, "inertia": 0.5, "position": [0, 0], "angular_velocity": 1.5},
        "b": {"mass": 2, "inertia": 0.3, "position": [1.2, 0.3], "velocity": [0.4, -0.3], "angular_velocity": -2},
    },
    "points": {
        "pa": {"body": "a", "grid": {"list": [[0.3, 0.2], [0.2, -0.3], [0.1, 0.1]]}},
        "pb": {"body": "b", "grid": {"list": [[1.0, 0.5], [1.1, 0.1]]}},
        "pg": {"body": "ground", "grid": {"list": [[-1, 0], [0, 2], [2, -1]]}},
    },
    "members": {
        "tie": {"from": "pa", "to": "pb", "law": {"type": "spring", "stiffness": 120}},
        "hold": {"from": "pa", "to": "pg", "law": {"type": "spring", "stiffness": 60}},
    },
    "design": {"initial": 0.5},
    "objectives": {
        "speed": {"response": {"velocity": {"body": "b", "component": "x"}}, "over_time": "final"},
        "turn": {"response": {"angle": {"body": "a"}}, "over_time": "final"},
    },
    "combine": {"method": "weighted_sum", "weights": {"speed": 1, "turn": 1}},
}


def case_of(content: dict[str, Any], **solver: Any) -> Any:
    return read_case(yaml.safe_dump({**content, "solver": {"integrator": "gauss", **solver}}, sort_keys=False))


def largest(difference: np.ndarray, of: np.ndarray) -> float:
    """The largest entry of a difference, relative to the largest of what it is one of."""
    return float(np.abs(difference).max() / np.abs(of).max())


def test_all_responses_through_all_smooth_laws_are_those_of_explicit_steps_with_gradients_both_ways() -> None:
    case, explicit = (load("smooth", integrator=name, tolerance=1e-12) for name in ("gauss", "runge_kutta"))
    alpha = design_of(case)
    found, other = mdstopo.evaluate(case, alpha), mdstopo.evaluate(explicit, alpha)
    direct = mdstopo.evaluate(case, alpha, method="direct")
    assert found.status.ok, found.message
    assert found.work["steps"] < other.work["steps"] / 3
    for name, gradient in found.gradients.items():
        assert found.objectives[name] == pytest.approx(other.objectives[name], rel=1e-11), name
        assert largest(gradient - other.gradients[name], gradient) < 2e-8, name  # as far as peaks are located
        assert largest(gradient - direct.gradients[name], gradient) < 1e-13, name


def test_gradients_of_all_responses_are_slopes() -> None:
    case = load("smooth", integrator="gauss")
    alpha = design_of(case)
    found = mdstopo.evaluate(case, alpha)
    direction = np.random.default_rng(5).normal(size=case.n_design) * alpha
    for name, slope in slopes(case, alpha, direction, 1e-3).items():
        gradient = found.gradients[name]
        assert abs(slope - gradient @ direction) < 1e-7 * np.abs(gradient * direction).max(), name


def test_the_gradient_is_that_of_the_discrete_motion_however_long_windows_are() -> None:
    case, exact = case_of(PAIR, step=0.3), mdstopo.evaluate(case_of(PAIR, tolerance=1e-11))
    alpha = np.array(case.initial)
    found = mdstopo.evaluate(case, alpha)
    direction = np.random.default_rng(1).normal(size=case.n_design) * alpha
    for name, slope in slopes(case, alpha, direction, 1e-3).items():
        gradient = found.gradients[name]
        assert abs(slope - gradient @ direction) < 2e-9 * np.abs(gradient * direction).max(), name
    assert abs(found.objectives["speed"] / exact.objectives["speed"] - 1.0) > 1e-7


def test_windows_of_seven_nodes_are_of_order_fourteen() -> None:
    """Root mean squares over designs, as errors of one change their sign."""
    lengths = 0.6 / np.array([2, 3, 4, 5])
    reference = case_of(PAIR, tolerance=1e-13)
    designs = np.random.default_rng(4).uniform(0.3, 0.7, (8, reference.n_design))
    exact = _ends(reference, designs)
    errors = [np.sqrt(np.mean((_ends(case_of(PAIR, step=float(h)), designs) - exact) ** 2)) for h in lengths]
    order = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
    assert order == pytest.approx(14.0, abs=1.5), errors


def _ends(case: Any, designs: np.ndarray) -> np.ndarray:
    """The bodies' coordinates at the end for each design."""
    return np.array([mdstopo.simulate(case, alpha).q[-1] for alpha in designs])


@pytest.mark.parametrize("over_time", ["max", "mean"])
def test_springs_are_those_of_their_own_kernels(over_time: str) -> None:
    case = mdstopo.load_case(FIG6, overrides={"solver.tolerance": "1e-11", "objectives.G.over_time": over_time})
    alpha = np.random.default_rng(2).uniform(0.01, 1.0, case.n_design)
    own, general = Evaluator(case), Evaluator(case, beyond="a test")
    assert own.integrator == general.integrator == "gauss"
    expected, found = own.evaluate(alpha), general.evaluate(alpha)
    assert found.objectives["G"] == pytest.approx(expected.objectives["G"], rel=1e-13)
    assert largest(found.gradients["G"] - expected.gradients["G"], expected.gradients["G"]) < 1e-12


def test_a_scene_in_a_tilted_plane_in_space_is_what_it_is_in_the_plane() -> None:
    content = {**PAIR, "objectives": {**PAIR["objectives"], "speed": {"response": "energy", "over_time": "max"}}}
    content["objectives"]["turn"] = {"response": {"velocity": {"body": "b"}}, "over_time": "max"}
    planar = case_of(content, tolerance=1e-10)
    spatial = read_case(lifted(planar, (1.0, 0.4, -0.2), 0.7))
    alpha = np.random.default_rng(2).uniform(0.1, 1.0, planar.n_design)
    one, two = mdstopo.evaluate(planar, alpha), mdstopo.evaluate(spatial, alpha)
    assert spatial.solver.integrator == "gauss"
    for name, gradient in one.gradients.items():
        assert two.objectives[name] == pytest.approx(one.objectives[name], rel=1e-10)
        assert largest(two.gradients[name] - gradient, gradient) < 1e-8


def test_a_body_that_turns_many_times_is_followed_in_fixed_and_in_adaptive_windows() -> None:
    """A wheel on a spring at its rim: its energy stays; windows of a whole turn are no more accurate than they are."""
    content = {
        "format": 1,
        "time": {"end": 1},
        "bodies": {"wheel": {"mass": 2, "inertia": 0.5, "position": [0, 0], "angular_velocity": 60}},
        "members": {
            "tie": {
                "from": {"body": "ground", "at": [0, 3]},
                "to": {"body": "wheel", "at": [0.2, 0]},
                "law": {"type": "spring", "stiffness": 20},
            }
        },
        "objectives": {"x": {"response": {"velocity": {"body": "wheel", "at": [0.2, 0]}}, "over_time": "max"}},
    }
    for solver, allowed in (({"tolerance": 1e-9}, 1e-9), ({"step": 0.11}, 1e-3)):
        case = case_of(content, **solver)
        motion, looking = mdstopo.simulate(case), case_of({**content, "objectives": {}}, **solver)
        assert motion.status.ok, motion.message
        total = 0.5 * (2 * (motion.v[:, :2] ** 2).sum(axis=1) + 0.5 * motion.v[:, 2] ** 2)
        place = motion.q[:, :2] + 0.2 * np.stack([np.cos(motion.q[:, 2]), np.sin(motion.q[:, 2])], axis=1)
        stretch = np.hypot(*(place - [0, 3]).T) - np.hypot(0.2, 3)
        total += 0.5 * 20 * looking.initial[0] * stretch**2
        assert np.abs(total / total[0] - 1.0).max() < allowed


def test_an_uncertain_case_has_the_measures_of_explicit_steps() -> None:
    looking = {"G": {"response": {"displacement": {"body": "torso", "relative_to": "vehicle"}}, "over_time": "max"}}
    section, found = uncertain({"measure": "mean_deviation", "factor": 1}, sample=4), []
    for name in ("gauss", "runge_kutta"):
        case = read(section, solver={"integrator": name, "tolerance": 1e-11}, objectives=looking)
        found.append(evaluator_of(case).evaluate(np.full(case.n_design, 0.3)))
    one, other = found
    assert one.objectives["G"] == pytest.approx(other.objectives["G"], rel=1e-10)
    assert largest(one.gradients["G"] - other.gradients["G"], other.gradients["G"]) < 1e-8


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ({"joints": [{"type": "revolute", "bodies": ["b", "ground"], "at": [1.2, 0.3]}]}, "joints"),
        ({"members": {"tie": {**PAIR["members"]["tie"], "law": {"type": "gap", "stiffness": 1}}}}, "the law gap"),
        (
            {"members": {"tie": {**PAIR["members"]["tie"], "law": {"type": "inerter", "inertance": 1}}}},
            "the law inerter",
        ),
    ],
)
def test_what_it_does_not_carry_is_refused_by_name_and_auto_takes_runge_kutta(more: dict[str, Any], what: str) -> None:
    with pytest.raises(CaseError) as refused:
        Evaluator(case_of({**PAIR, **more}))
    assert f"solver.integrator: gauss does not compute {what}; runge_kutta does" in str(refused.value)
    assert Evaluator(case_of({**PAIR, **more}, integrator="auto")).integrator == "runge_kutta"


def test_auto_takes_it_for_free_bodies_and_says_why() -> None:
    case = load("smooth")
    chosen = Evaluator(replace(case, solver=replace(case.solver, integrator="auto")))
    assert chosen.integrator == "gauss"
    assert "fewest passes over the members" in chosen.integrator_reason


#: two bodies between springs, one of which is damped
DAMPED = {
    **PAIR,
    "members": {
        **PAIR["members"],
        "stay": {"from": "pb", "to": "pg", "law": {"type": "spring", "stiffness": 80, "damping": 1}},
    },
}


def test_auto_takes_explicit_or_implicit_steps_where_dampers_hold_windows_short() -> None:
    chosen = {}
    for damping in (1.0, 500.0, 1e6):
        text = yaml.safe_dump({**DAMPED, "solver": {"tolerance": 1e-5}}).replace("damping: 1", f"damping: {damping}")
        chosen[damping] = Evaluator(read_case(text), in_background=False)
    assert chosen[1.0].integrator == "gauss"
    assert chosen[500.0].integrator == "runge_kutta"
    assert "windows of collocation short" in chosen[500.0].integrator_reason
    assert chosen[1e6].integrator == "esdirk"
    assert chosen[1.0].evaluate(np.array(chosen[1.0].case.initial)).work["steps_held_short"] < 50


def test_bodies_that_are_tied_to_nothing_leave_every_evaluation_the_same_to_the_bit() -> None:
    """Pairs without members have sums, too: what memory held before does not stand in them."""
    loose = {"mass": 4, "inertia": 0.6, "position": [2, 1], "velocity": [0.5, 0.9], "angular_velocity": 0.7}
    content = {
        **PAIR,
        "bodies": {**PAIR["bodies"], "loose": loose},
        "loads": [{"body": "b", "force": {"table": [[0, 0, 0], [0.1, 6, 4], [0.1, -5, 3], [0.6, 0, 0]]}}],
        "objectives": {
            **PAIR["objectives"],
            "away": {"response": {"displacement": {"body": "loose", "component": "y"}}, "over_time": "final"},
        },
        "combine": {"method": "weighted_sum", "weights": {"speed": 1, "turn": 1, "away": 1}},
    }
    random = np.random.default_rng(7)
    found = set()
    for k in range(24):
        # arrays of many lengths come and go, so that the next ones are handed what these held
        junk = [np.full(int(random.integers(1, 4000)), (1e3, 1e-3, 7.0, -1.0)[k % 4]) for _ in range(200)]
        del junk
        result = mdstopo.evaluate(case_of(content, tolerance=1e-9))
        found.add((tuple(result.objectives.values()), tuple(np.concatenate(list(result.gradients.values())))))
    assert len(found) == 1
    other = mdstopo.evaluate(case_of(content, integrator="runge_kutta", tolerance=1e-10))
    for name, value in other.objectives.items():
        assert result.objectives[name] == pytest.approx(value, rel=1e-8)
