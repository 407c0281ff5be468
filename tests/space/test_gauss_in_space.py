"""Gauss collocation in space: its order, its gradients, long motions, a planar scene, and what it refuses."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.finalize.lift_case import lifted
from tests.general.support import slopes

from .support import attitudes, load

FIG6 = Path(__file__).parents[2] / "cases" / "fig6.yaml"
#: two bodies on springs and ground, without damping
PAIR: dict[str, Any] = {
    "format": 1,
    "dimension": 3,
    "gravity": [0, 0, -9.81],
    "time": {"end": 0.6},
    "bodies": {
        "a": {"mass": 3, "inertia": [0.3, 0.5, 0.6], "position": [0, 0, 0], "angular_velocity": [1, -2, 0.5]},
        "b": {
            "mass": 2,
            "inertia": [[0.4, 0.05, 0], [0.05, 0.2, 0.03], [0, 0.03, 0.3]],
            "position": [1.2, 0.3, 0.2],
            "orientation": {"axis": [1, 2, 3], "angle": 0.7},
            "velocity": [0.4, -0.3, 0.2],
            "angular_velocity": [-1, 1, 3],
        },
    },
    "points": {
        "pa": {"body": "a", "grid": {"list": [[0.3, 0.2, -0.1], [0.2, -0.3, 0.1], [0.1, 0.1, 0.4]]}},
        "pb": {"body": "b", "grid": {"list": [[1.0, 0.5, 0.2], [1.1, 0.1, 0.5], [1.3, 0.2, -0.1]]}},
        "pg": {"body": "ground", "grid": {"list": [[-1, 0, 1], [0, 2, 1], [2, -1, -1], [1, 0, 2]]}},
    },
    "members": {
        "tie": {"from": "pa", "to": "pb", "law": {"type": "spring", "stiffness": 120}},
        "hold": {"from": "pa", "to": "pg", "law": {"type": "spring", "stiffness": 60}},
    },
    "design": {"initial": 0.5},
    "objectives": {
        "G": {"response": "energy", "over_time": "max"},
        "speed": {"response": {"velocity": {"body": "b", "component": "x"}}, "over_time": "final"},
        "turn": {"response": {"rotation": {"body": "a", "component": "z"}}, "over_time": "final"},
    },
}


def case_of(content: dict[str, Any], **solver: Any) -> Any:
    own = {**content, "solver": {"integrator": "gauss", **solver}}
    if len(content.get("objectives", {})) > 1:
        own["combine"] = {"method": "weighted_sum", "weights": dict.fromkeys(content["objectives"], 1)}
    return read_case(yaml.safe_dump(own, sort_keys=False))


def test_windows_of_seven_nodes_are_of_order_fourteen() -> None:
    """States, responses and gradients at the end: root mean squares over designs, as errors of one change their sign.

    Between windows that are too long and rounding there is room for a factor of three in length only.
    """
    lengths = 0.6 / np.array([3, 4, 5, 6, 8])
    reference = case_of(PAIR, tolerance=1e-13)
    designs = np.random.default_rng(4).uniform(0.3, 0.7, (8, reference.n_design))
    exact = _at_the_end(reference, designs)
    found = [_at_the_end(case_of(PAIR, step=float(h)), designs) for h in lengths]
    orders = {}
    for name, wanted in exact.items():
        errors = [np.sqrt(np.mean((each[name] - wanted) ** 2)) for each in found]
        orders[name] = np.polyfit(np.log(lengths), np.log(errors), 1)[0]
    assert np.abs(np.array(list(orders.values())) - 14.0).max() < 1.7, orders
    assert np.mean(list(orders.values())) == pytest.approx(14.0, abs=0.7), orders


def _at_the_end(case: Any, designs: np.ndarray) -> dict[str, np.ndarray]:
    """States, responses and gradients at the end of the motion, by name, for each design."""
    looked: dict[str, list[Any]] = {}
    for alpha in designs:
        motion, found = mdstopo.simulate(case, alpha), mdstopo.evaluate(case, alpha)
        here = {"q": motion.q[-1], "v": motion.v[-1]}
        for name in ("speed", "turn"):
            here |= {name: found.objectives[name], f"gradient of {name}": found.gradients[name]}
        for name, value in here.items():
            looked.setdefault(name, []).append(value)
    return {name: np.array(each) for name, each in looked.items()}


def test_gradients_of_all_responses_through_all_smooth_laws_are_slopes() -> None:
    case = load("free", integrator="gauss")
    rng = np.random.default_rng(3)
    alpha = np.array(case.initial) * rng.uniform(0.7, 1.3, case.n_design)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, alpha, method="direct")
    direction = rng.normal(size=case.n_design) * alpha
    differences = slopes(case, alpha, direction, 1e-3)
    for name, gradient in found.gradients.items():
        size = np.abs(gradient).max()
        assert size > 0.0, name
        assert abs(differences[name] - gradient @ direction) < 1e-7 * np.abs(gradient * direction).max(), name
        assert np.abs(direct.gradients[name] - gradient).max() < 1e-12 * size, name


def test_the_gradient_is_that_of_the_discrete_motion_however_long_windows_are() -> None:
    case = case_of(PAIR, step=0.3)
    exact = mdstopo.evaluate(case_of(PAIR, tolerance=1e-11))
    alpha = np.array(case.initial)
    found = mdstopo.evaluate(case, alpha)
    direction = np.random.default_rng(1).normal(size=case.n_design) * alpha
    differences = slopes(case, alpha, direction, 1e-3)
    for name, gradient in found.gradients.items():
        assert abs(differences[name] - gradient @ direction) < 2e-9 * np.abs(gradient * direction).max(), name
    assert abs(found.objectives["speed"] - exact.objectives["speed"]) > 1e-5 * abs(exact.objectives["speed"])


def test_slopes_by_pairs_are_the_dense_ones() -> None:
    """Three scenes beside each other have more bodies than are multiplied as dense matrices; the first is the same."""
    alone = case_of(PAIR, tolerance=1e-11)
    content = copy.deepcopy(PAIR)
    for copied in ("1", "2"):
        for part in ("bodies", "points", "members"):
            for name, value in PAIR[part].items():
                content[part][name + copied] = copy.deepcopy(value)
        for name in PAIR["points"]:
            if name != "pg":
                content["points"][name + copied]["body"] += copied
        for name in PAIR["members"]:
            for end in ("from", "to"):
                content["members"][name + copied][end] += copied
    content["objectives"] = {name: PAIR["objectives"][name] for name in ("speed", "turn")}
    many = case_of(content, tolerance=1e-11)
    n = alone.n_design
    one, three = mdstopo.evaluate(alone), mdstopo.evaluate(many)
    direct = mdstopo.evaluate(many, method="direct")
    for name in content["objectives"]:
        assert three.objectives[name] == pytest.approx(one.objectives[name], rel=1e-10)
        size = np.abs(one.gradients[name]).max()
        assert np.abs(three.gradients[name][:n] - one.gradients[name]).max() < 1e-9 * size
        assert np.abs(three.gradients[name][n:]).max() < 1e-12 * size
        assert np.abs(three.gradients[name] - direct.gradients[name]).max() < 1e-12 * size


@pytest.mark.parametrize("tolerance", ["1e-6", "1e-10"])
def test_a_planar_scene_in_a_tilted_plane_is_what_it_is_in_the_plane(tolerance: str) -> None:
    planar = mdstopo.load_case(FIG6, overrides={"solver.tolerance": tolerance})
    spatial = read_case(lifted(planar, (1.0, 0.4, -0.2), 0.7))
    one, two = Evaluator(planar), Evaluator(spatial)
    assert one.integrator == two.integrator == "gauss"
    alpha = np.random.default_rng(2).uniform(0.01, 1.0, planar.n_design)
    a, b = one.evaluate(alpha), two.evaluate(alpha)
    allowed = max(1e-10, float(tolerance))
    assert b.objectives["G"] == pytest.approx(a.objectives["G"], rel=allowed)
    assert np.abs(a.gradients["G"] - b.gradients["G"]).max() < 10.0 * allowed * np.abs(a.gradients["G"]).max()


def test_energy_stays_over_many_vibrations() -> None:
    inertia = [np.diag(PAIR["bodies"]["a"]["inertia"]), np.array(PAIR["bodies"]["b"]["inertia"])]
    total = []
    for end in (1.0, 20.0):
        objectives = {"G": {"response": "energy", "over_time": "final"}}
        case = case_of({**PAIR, "time": {"end": end}, "objectives": objectives}, tolerance=1e-10)
        motion = mdstopo.simulate(case)
        energy = mdstopo.evaluate(case).objectives["G"]
        for body, mass in enumerate((3.0, 2.0)):
            v = motion.v[-1][6 * body : 6 * body + 6]
            own = attitudes(motion.q[-1:], body)[0].inv().apply(v[3:])
            energy += 0.5 * mass * v[:3] @ v[:3] + 0.5 * own @ inertia[body] @ own
            energy += 9.81 * mass * motion.q[-1][7 * body + 2]
        total.append(energy)
    assert abs(total[1] - total[0]) < 1e-8 * abs(total[0])


def test_a_body_turns_thousands_of_times() -> None:
    """Its angular momentum and its energy stay, about the axis of the largest moment of inertia and some wobble."""
    rates = np.array([1.0, 2.0, 6300.0])
    inertia = np.array([1.0, 2.0, 3.0])
    content = {
        "format": 1,
        "dimension": 3,
        "time": {"end": 1.0},
        "bodies": {
            "body": {"mass": 1, "inertia": inertia.tolist(), "position": [0, 0, 0], "angular_velocity": rates.tolist()}
        },
    }
    motion = mdstopo.simulate(case_of(content, tolerance=1e-10))
    assert motion.status.ok, motion.message
    last = motion.at([0.0, 1.0])
    turns = attitudes(last.q, 0)
    own = turns.inv().apply(last.v[:, 3:])
    momentum = turns.apply(inertia * own)
    assert np.abs(momentum[1] - inertia * rates).max() < 1e-7 * np.abs(inertia * rates).max()
    assert inertia @ own[1] ** 2 == pytest.approx(inertia @ rates**2, rel=1e-9)


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ({"joints": [{"type": "spherical", "bodies": ["a", "ground"], "at": [0, 0, 0]}]}, "joints"),
        ({"members": {"tie": {**PAIR["members"]["tie"], "law": {"type": "gap", "stiffness": 1}}}}, "the law gap"),
        (
            {"members": {"tie": {**PAIR["members"]["tie"], "law": {"type": "inerter", "inertance": 1}}}},
            "the law inerter",
        ),
    ],
)
def test_what_it_does_not_carry_is_refused_by_name_and_auto_takes_runge_kutta(more: dict[str, Any], what: str) -> None:
    content = {**PAIR, **more}
    if "joints" in more:
        content["bodies"] = {**PAIR["bodies"], "a": {**PAIR["bodies"]["a"], "angular_velocity": [0, 0, 0]}}
    with pytest.raises(CaseError) as refused:
        Evaluator(case_of(content))
    assert f"solver.integrator: gauss does not compute {what}; runge_kutta does" in str(refused.value)
    assert Evaluator(case_of(content, integrator="auto")).integrator == "runge_kutta"
