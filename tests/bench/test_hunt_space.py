"""The second model of scenes in space is right where closed forms tell, and its scenes are the same however written."""

import json

import numpy as np
import pytest

from mdstopo.case.reader import read_case

QUICK = 0.2


@pytest.fixture(autouse=True)
def _benchmarks(monkeypatch):
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))


def solved(document, alpha=(), values=None):
    from benchmarks.hunt_space_model import SpatialModel

    found = SpatialModel(document, np.array(alpha, dtype=float), values)
    found.solve()
    return found


def body(**more):
    own = {"mass": 2.0, "inertia": [1.0, 2.0, 3.0], "position": [0.3, 0.2, 0.1]}
    own |= {"orientation": {"quaternion": [0.8, 0.0, 0.6, 0.0]}, "velocity": [0.0, 0.0, 0.0]}
    return own | {"angular_velocity": [0.0, 0.0, 0.0]} | more


def alone(end, **more):
    return {
        "gravity": [0.0, 0.0, 0.0],
        "time": {"end": end},
        "bodies": {"a": body(**more)},
        "members": {},
        "design": {"power": 1},
    }


def test_a_free_body_turns_with_jacobis_period():
    """J (1, 2, 3), omega (1, 1, 1) in its own axes: the shared reference of tests/published."""
    period = 6.422703084225694
    turn = np.array([[0.28, 0.0, 0.96], [0.0, 1.0, 0.0], [-0.96, 0.0, 0.28]])
    document = alone(period, angular_velocity=(turn @ np.ones(3)).tolist())
    scene = solved(document)
    y = scene.pieces[-1](period)
    assert scene.turns(y[:7])[0].T @ y[10:] == pytest.approx(np.ones(3), abs=1e-10)


JOINTS = {
    "spherical": {},
    "revolute": {"axis": [0.0, 1.0, 0.5]},
    "universal": {"axes": [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]},
    "prismatic": {"axis": [1.0, 0.0, -1.0]},
    "cylindrical": {"axis": [1.0, 0.5, -1.0]},
    "planar": {"normal": [1.0, 0.0, 1.0]},
    "distance": {},
}


@pytest.mark.parametrize("kind", JOINTS)
def test_joints_do_no_work_and_hold(kind):
    at = [[0.0, 0.0, 0.9], [0.3, 0.4, 0.1]] if kind == "distance" else [0.0, 0.0, 0.9]
    document = alone(0.5) | {"gravity": [0.0, 0.0, -9.81]}
    document["joints"] = [{"name": "j", "type": kind, "bodies": ["ground", "a"], "at": at, **JOINTS[kind]}]
    scene = solved(document)
    energies = []
    for t in (0.0, 0.5):
        y = scene.pieces[-1](t)
        omega = scene.turns(y[:7])[0].T @ y[10:]
        kinetic = 0.5 * (2.0 * y[7:10] @ y[7:10] + omega @ (np.array([1.0, 2.0, 3.0]) * omega))
        energies.append(kinetic + 2.0 * 9.81 * y[2])
        rows = np.array([row for row, _ in scene._rows_of(scene.joints[0], y[:7], y[7:])])
        assert rows @ y[7:] == pytest.approx(np.zeros(len(rows)), abs=1e-11)
    assert kinetic > 0.5
    assert energies[1] == pytest.approx(energies[0], abs=1e-10)


def test_a_body_on_a_hinge_pulls_with_weight_and_centripetal_force():
    """Straight down, w = 1.5 about y, r = 1: m g + m w^2 r, and no moment about a principal axis."""
    own = {"position": [0.0, 0.0, -1.0], "orientation": {"quaternion": [1.0, 0.0, 0.0, 0.0]}}
    document = alone(0.5, **own, angular_velocity=[0.0, 1.5, 0.0]) | {"gravity": [0.0, 0.0, -9.81]}
    document["bodies"]["a"]["velocity"] = [-1.5, 0.0, 0.0]
    document["joints"] = [
        {"name": "j", "type": "revolute", "bodies": ["ground", "a"], "at": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0]}
    ]
    scene = solved(document)
    force, moment = scene._reaction("j", 0.0, scene.pieces[0](0.0))
    assert force == pytest.approx([0.0, 0.0, -2.0 * (9.81 + 1.5**2)], abs=1e-12)
    assert moment == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_bushing_keeps_its_energy_without_damping():
    document = alone(0.5, angular_velocity=[0.5, -2.0, 1.0], velocity=[0.4, 0.0, -0.3])
    stiffness = [50.0, 80.0, 120.0, 4.0, 6.0, 9.0]
    document["bushings"] = [
        {"bodies": ["ground", "a"], "at": [0.5, 0.0, 0.3], "stiffness": stiffness, "damping": [0.0] * 6}
    ]
    from scipy.spatial.transform import Rotation

    scene = solved(document)
    energies = []
    for t in (0.0, 0.5):
        y = scene.pieces[-1](t)
        turn = scene.turns(y[:7])[0]
        omega = turn.T @ y[10:]
        d = scene.point("a", [0.5, 0.0, 0.3]).seen(y[:7], y[7:])[0] - [0.5, 0.0, 0.3]
        theta = Rotation.from_matrix(turn @ scene.turns0[0].T).as_rotvec()
        stored = 0.5 * np.array(stiffness) @ np.concatenate([d, theta]) ** 2
        kinetic = 0.5 * (2.0 * y[7:10] @ y[7:10] + omega @ (np.array([1.0, 2.0, 3.0]) * omega))
        energies.append(kinetic + stored)
    assert stored > 0.1
    assert energies[1] == pytest.approx(energies[0], abs=1e-10)


def test_a_point_on_a_slope_slides_as_friction_lets_it():
    """It begins at its depth of rest, thrown along the slope: g (sin - mu cos) slow it down; the body does not turn."""
    sine, cosine, mu, depth = 0.28, 0.96, 0.5, 2.0 * 9.81 * 0.96 / 1e5
    normal, down = np.array([-sine, 0.0, cosine]), np.array([-cosine, 0.0, -sine])
    start = -depth * normal
    own = {"position": start.tolist(), "velocity": (3.0 * down).tolist(), "inertia": [1.0, 1.0, 1.0]}
    document = alone(0.4, **own) | {"gravity": [0.0, 0.0, -9.81]}
    document["points"] = {"feet": {"body": "a", "grid": {"list": [start.tolist()]}}}
    surface = {"body": "ground", "plane": {"at": [0.0, 0.0, 0.0], "normal": normal.tolist()}}
    document["contacts"] = [
        {"points": "feet", "on": surface, "stiffness": 1e5, "damping": 10.0, "friction": mu, "slip": 1e-3}
    ]
    scene = solved(document)
    speed = scene.objective({"velocity": {"body": "a", "at": start.tolist()}}, "final")[0]
    assert speed == pytest.approx(3.0 + 0.4 * 9.81 * (sine - mu * cosine), rel=1e-5)


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_a_scene_written_in_another_way_is_the_same_to_the_second_model(seed):
    from benchmarks.hunt_space_scenes import CHANGES, Rewriter, covariant, scene

    def quick(change=None):
        document = scene(seed) if change is None else scene(seed, change)
        return solved(document | {"time": {"end": QUICK}}, np.linspace(0.5, 1.0, 12), varied(document))

    document = scene(seed)
    y = quick().pieces[-1](QUICK)
    for change in CHANGES.values():
        assert covariant(document, change)
        again, rewriter = quick(change).pieces[-1](QUICK), Rewriter(change)
        n = len(document["bodies"])
        for b in range(n):
            assert again[7 * b : 7 * b + 3] == pytest.approx(rewriter.point(y[7 * b : 7 * b + 3]), abs=1e-9)
            at = 7 * n + 6 * b
            assert again[at : at + 3] == pytest.approx(rewriter.vector(y[at : at + 3]), abs=1e-8)
            assert again[at + 3 : at + 6] == pytest.approx(rewriter.spin(y[at + 3 : at + 6]), abs=1e-8)


def varied(document):
    return {
        name: np.full(9, document["members"][row["group"]]["law"][row["parameter"]])
        for name, row in document["design"].get("variables", {}).items()
    }


@pytest.mark.parametrize("first", [0, 20])
def test_scenes_are_cases(first):
    """Twenty each, read as cases: a scene that is refused would look at nothing."""
    from benchmarks.hunt_space_scenes import scene

    for seed in range(first, first + 20):
        assert read_case(json.dumps(scene(seed))).dimension == 3
