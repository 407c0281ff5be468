"""What other programs are given of scenes in space is what the case says, and the way back gives the same case."""

import json

import numpy as np
import pytest

from mdstopo.case.reader import read_case


@pytest.fixture(autouse=True)
def _benchmarks(monkeypatch):
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))


def content(name):
    from benchmarks.peers import scenes

    return scenes.spatial_pair() if name == "pair" else scenes.spatial_ring()


@pytest.mark.parametrize("name", ["pair", "ring"])
def test_a_scene_in_space_survives_the_way_through_arrays(name, tmp_path):
    from benchmarks.peers.ours_space import case_of
    from benchmarks.peers.problem import Problem
    from benchmarks.peers.space_problem import SpatialProblem
    from benchmarks.peers.translate import spatial_problem_of

    problem = spatial_problem_of(read_case(content(name)))
    problem.save(tmp_path / "problem.npz")
    stored = Problem.load(tmp_path / "problem.npz")
    assert isinstance(stored, SpatialProblem)
    again = spatial_problem_of(read_case(json.dumps(case_of(stored))))
    for field in ("mass", "inertia", "start", "turn", "force", "groups", "first", "hinges"):
        assert np.array_equal(getattr(again, field), getattr(problem, field)) or np.allclose(
            getattr(again, field), getattr(problem, field), rtol=0.0, atol=1e-12
        ), field
    for field in ("p", "q", "at", "length", "stiffness"):
        assert np.abs(getattr(again, field) - getattr(problem, field)).max(initial=0.0) <= 1e-12, field
    assert (again.end, again.peak) == (problem.end, problem.peak)


@pytest.mark.parametrize(("name", "bodies", "members", "joints"), [("pair", 2, 1020, 0), ("ring", 10, 1000, 11)])
def test_scenes_in_space_are_as_large_as_they_say_and_store_nothing_at_the_start(name, bodies, members, joints):
    from benchmarks.peers.translate import spatial_problem_of

    problem = spatial_problem_of(read_case(content(name)))
    assert (problem.bodies, problem.members, len(problem.hinges)) == (bodies, members, joints)
    ones = np.ones(members)
    assert problem.energy(ones, problem.pose) == pytest.approx(0.0, abs=1e-20)
    moved = problem.pose
    moved[0, :3] += [0.01, -0.02, 0.03]
    assert problem.energy(ones, moved) > 0.01
    assert problem.energy(2.0 * ones, moved) == pytest.approx(2.0 * problem.energy(ones, moved))


def test_the_joints_of_the_ring_fit():
    from benchmarks.peers.space_problem import spatial_world
    from benchmarks.peers.translate import spatial_problem_of

    problem = spatial_problem_of(read_case(content("ring")))
    for bodies, ends in zip(problem.hinges.tolist(), problem.at, strict=True):
        one, two = (spatial_world(problem.pose, body, at[None])[0] for body, at in zip(bodies, ends, strict=True))
        assert one == pytest.approx(two, abs=1e-13)


def test_what_is_not_at_rest_or_has_other_joints_is_not_for_peers():
    from benchmarks.peers.translate import NotForPeersError, spatial_problem_of

    document = json.loads(content("ring"))
    document["bodies"]["b0"]["angular_velocity"] = [0, 0, 1]
    with pytest.raises(NotForPeersError, match="at rest"):
        spatial_problem_of(read_case(json.dumps(document)))
    document = json.loads(content("ring"))
    document["joints"][0] |= {"type": "universal", "axes": [[1, 0, 0], [0, 1, 0]]}
    with pytest.raises(NotForPeersError, match="only spherical joints"):
        spatial_problem_of(read_case(json.dumps(document)))


@pytest.mark.parametrize("name", ["jax", "casadi"])
def test_installed_peers_find_a_peak_inside_in_space(name):
    import mdstopo
    from benchmarks.peers.race import Entry, Field, race
    from benchmarks.peers.scenes import spatial_pair
    from benchmarks.peers.table import PEERS_IN_SPACE
    from benchmarks.peers.translate import spatial_problem_of
    from mdstopo.bench.reference import Reference

    if PEERS_IN_SPACE[name].missing():
        pytest.skip(f"{name} is not installed")
    case = read_case(spatial_pair(along=4, line=3, stiffness=3000.0), overrides={"solver.tolerance": "1e-11"})
    alpha = np.linspace(0.1, 1.0, case.n_design)
    exact = mdstopo.evaluate(case, alpha)
    (peak,) = exact.peaks["G"]
    assert 0.14 < peak.time < 0.16
    course = Field(spatial_problem_of(case), [alpha], [Reference(peak.value, exact.gradients["G"])])
    setting = {"steps": 12} if name == "jax" else {"tolerance": 1e-9}
    ((found,),) = race(course, [Entry(name, setting)], rounds=1, seconds=0.0, peers=PEERS_IN_SPACE)
    assert found.value_error < 1e-6
    assert found.gradient_error < 1e-5


def test_casadi_in_fixed_steps_has_the_energy_and_the_gradient_of_the_ring():
    pytest.importorskip("casadi")
    import mdstopo
    from benchmarks.peers import casadi_space
    from benchmarks.peers.translate import spatial_problem_of

    document = json.loads(content("ring"))
    for points in document["points"].values():
        points["grid"]["list"] = points["grid"]["list"][::4]
    case = read_case(json.dumps(document), overrides={"solver.tolerance": "1e-10"})
    alpha = np.linspace(0.1, 1.0, case.n_design)
    exact = mdstopo.evaluate(case, alpha)
    objective = casadi_space.make(spatial_problem_of(case), steps=16)
    value, slopes = objective(alpha, True)
    assert value == pytest.approx(exact.objectives["G"], rel=1e-9)
    assert objective(alpha, False) == (pytest.approx(value, rel=1e-14), None)
    largest = np.abs(exact.gradients["G"]).max()
    assert np.abs(slopes - exact.gradients["G"]).max() < 1e-7 * largest
