"""Points whose coordinates are design variables: gradients, volumes of lengths, runs, finalized designs."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.design.movable import placed
from mdstopo.case.geometry.start_rotations import about_axis
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.finalize.finalize_design import finalize, opened, ready
from mdstopo.finalize.lift_case import lifted
from mdstopo.plots.source import Source
from mdstopo.scene.bodies import stands_as
from mdstopo.scene.moving_volumes import spent
from mdstopo.session.run_session import run_session
from mdstopo.store.result_reader import read_result
from tests.variables.support import OBJECTIVES, differences, whole, whole_and_resumed, widths
from tests.variables.test_parameters import LAWS

SCENE = """
format: 1
time: {end: 0.5}
gravity: [0, -1]
bodies:
  m: {mass: 2, inertia: 0.3, position: [0.2, 0.1], angle: 0.3, velocity: [0.8, 0.3], angular_velocity: 0.4}
JOINTS
points:
  hooks:
    body: ground
    grid: {list: [[-0.6, 0.5], [0.9, 0.1], [0.5, -0.7]]}
    movable: {within: {rectangle: {center: [0, 0], size: [3, 3]}}}
  eyes:
    body: m
    frame: body
    grid: {line: {from: [0.05, -0.1], to: [0.15, 0.1], count: 2}}
    movable: {within: {line: {from: [0, -0.2], to: [0.2, 0.2]}}}
members:
  s: {from: hooks, to: eyes, law: {type: spring, stiffness: 40, damping: 1}}
  t: {from: eyes, to: hooks, law: LAW, cost: length}
design: {initial: 0.8, variables: {VARIABLES}}
"""
SCENE += f"""{OBJECTIVES}  - {{volume: [t], limit: 9}}
solver: {{SOLVER}}
"""
SLIDE = "joints: [{type: prismatic, bodies: [ground, m], at: [0, 0], axis: [0.8, 0.3]}]"


def scene_of(law, jointed=False, solver="tolerance: 1e-11", variables=""):
    text = SCENE.replace("LAW", law).replace("JOINTS", SLIDE if jointed else "").replace("SOLVER", solver)
    text = text.replace("VARIABLES", variables)
    if jointed:
        text = text.replace("angular_velocity: 0.4", "angular_velocity: 0")
    return read_case(text)


def drawn(case):
    """A design with alphas that differ, so that no two members have the same force."""
    design = case.start.copy()
    design[: case.n_design] = np.linspace(0.5, 0.9, case.n_design)
    return design


def check(case, bound, size=2e-4):
    """Gradients along random directions of the coordinates, and of all, are differences; both methods agree."""
    design, named = drawn(case), case.space.named(drawn(case))
    found = mdstopo.evaluate(case, design[: case.n_design], variables=named)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, design[: case.n_design], variables=named, method="direct")
    rng = np.random.default_rng(4)
    for only_points in (True, False):
        direction = 0.2 * rng.normal(size=len(design)) * widths(case)
        direction[: case.n_design] *= 1.0 - only_points
        for name, slope in differences(case, design, direction, size).items():
            gradient = whole(found, name)
            scale = np.abs(gradient * widths(case)).max()
            assert abs(slope - gradient @ direction) <= bound * scale, (name, only_points)
    for name in found.gradients:
        one, two = whole(found, name), whole(direct, name)
        assert two == pytest.approx(one, abs=1e-9 * np.abs(one).max()), name
    return found


@pytest.mark.parametrize("name", list(LAWS))
def test_gradients_by_ends_of_members_of_every_law_are_differences(name):
    case = scene_of(LAWS[name][0])
    assert [each.name for each in case.variables] == ["hooks.x", "hooks.y", "eyes.along"]
    check(case, 1e-8)


@pytest.mark.parametrize("name", ["clipped", "crush", "inerter"])
def test_gradients_by_ends_go_through_joints(name):
    check(scene_of(LAWS[name][0], jointed=True), 1e-8)


def test_gradients_by_ends_go_through_the_equilibrium_of_the_start():
    found = check(
        scene_of(LAWS["gap"][0].replace("gap: 0.1", "gap: 0.01"), solver="settle: true, tolerance: 1e-11"), 1e-7
    )
    assert np.abs(found.variable_gradients["E"]["hooks.y"]).max() > 0.0


def test_gradients_by_ends_are_those_of_fixed_steps():
    check(scene_of(LAWS["spring"][0], solver="integrator: generalized_alpha, step: 0.01, tolerance: 1e-8"), 1e-7)


def test_ends_move_beside_parameters_of_laws():
    case = scene_of(
        "{type: spring, stiffness: 60, damping: 2}",
        variables="k: {group: t, parameter: stiffness, each: member, lower: 10, upper: 100},"
        " l0: {group: t, parameter: free_length, initial: 0.8, lower: 0.5, upper: 1}",
    )
    assert [each.name for each in case.variables] == ["k", "l0", "hooks.x", "hooks.y", "eyes.along"]
    check(case, 1e-8)


def test_bodies_may_begin_elsewhere_than_where_lengths_are_measured():
    case = scene_of(LAWS["spring"][0])
    (load_case,) = case.load_cases
    (body,) = load_case.bodies
    elsewhere = replace(load_case, bodies=(replace(body, position=(0.1, 0.3), angle=0.8),))
    case = replace(case, load_cases=(elsewhere,))
    assert not stands_as(case, elsewhere)
    check(case, 1e-8)


def test_moved_points_are_those_of_a_case_that_states_them():
    case = scene_of(LAWS["clipped"][0])
    design = drawn(case)
    rng = np.random.default_rng(2)
    for each in case.variables:
        part = case.space.parts[each.name]
        design[part] = 0.9 * design[part] + 0.1 * rng.uniform(each.lower, each.upper, each.count)
    moved = mdstopo.evaluate(case, design[: case.n_design], variables=case.space.named(design))
    there = placed(case, design)
    plain = yaml.safe_load(case.text)
    plain["points"] = {
        "hooks": {"body": "ground", "grid": {"list": there.points["hooks"].world.tolist()}},
        "eyes": {"body": "m", "frame": "body", "grid": {"list": there.points["eyes"].local.tolist()}},
    }
    stated = read_case(yaml.safe_dump(plain, sort_keys=False))
    fixed = mdstopo.evaluate(stated, design[: case.n_design])
    assert np.ptp([each.length.sum() for each in (case.members[1], there.members[1])]) > 0.1
    assert there.members[1].cost == pytest.approx(stated.members[1].cost, rel=1e-14)
    for name, value in fixed.objectives.items():
        assert moved.objectives[name] == pytest.approx(value, rel=1e-9), name
    assert moved.constraints == pytest.approx(fixed.constraints, rel=1e-12)


def test_points_that_move_around_where_they_are_move_along_the_axes():
    case = scene_of(LAWS["spring"][0])
    around = "movable: {within: {around: 0.1}}"
    text = case.text.replace("movable: {within: {rectangle: {center: [0, 0], size: [3, 3]}}}", around)
    text = text.replace("movable: {within: {line: {from: [0, -0.2], to: [0.2, 0.2]}}}", around)
    case = read_case(text)
    assert [each.name for each in case.variables] == ["hooks.dx", "hooks.dy", "eyes.dx", "eyes.dy"]
    assert {(each.lower, each.upper) for each in case.variables} == {(-0.1, 0.1)}
    assert not case.start[case.n_design :].any()
    check(case, 1e-8, 1e-2)
    design = case.start.copy()
    design[case.space.parts["eyes.dy"]] = 0.05
    moved = placed(case, design).points["eyes"].local - case.points["eyes"].local
    assert moved == pytest.approx(np.array([[0.0, 0.05], [0.0, 0.05]]), abs=1e-15)


def test_a_scene_far_from_the_origin_has_the_same_gradients():
    text = scene_of(LAWS["spring"][0]).text
    plain = yaml.safe_load(text)
    plain["bodies"]["m"]["position"] = [1024.2, 0.1]
    hooks = plain["points"]["hooks"]
    hooks["grid"]["list"] = [[x + 1024, y] for x, y in hooks["grid"]["list"]]
    hooks["movable"]["within"]["rectangle"]["center"] = [1024, 0]
    plain["objectives"]["X"]["response"]["displacement"]["at"] = [1024.1, 0.1]
    near, far = mdstopo.evaluate(read_case(text)), mdstopo.evaluate(read_case(yaml.safe_dump(plain, sort_keys=False)))
    for name in near.gradients:
        one, two = whole(near, name), whole(far, name)
        assert two == pytest.approx(one, abs=1e-8 * np.abs(one).max()), name


@pytest.mark.parametrize("method", ["iterative", "constant_load"])
def test_other_methods_say_that_they_do_not_differentiate_by_points(method):
    case = scene_of(LAWS["spring"][0])
    with pytest.raises(
        CaseError, match=rf"points\.hooks\.movable: {method} gives no derivatives by coordinates of points"
    ):
        mdstopo.evaluate(case, method=method)


BEAM = """
format: 1
time: {end: 0.2}
bodies:
  load: {mass: 10, inertia: 0.2, position: [0, 0], velocity: [2, 0]}
points:
  eye: {body: load, grid: {list: [[-0.2, 0.1], [-0.2, -0.1]]}}
  wall:
    body: ground
    grid: {list: [[-1, 0.6], [-1, 0.1], [-1, -0.6]]}
    movable: {within: {line: {from: [-1, -1], to: [-1, 1]}}}
members:
  straps: {from: eye, to: wall, law: {type: gap, stiffness: 3000, damping: 20, gap: 0.01}, cost: length}
loads:
  - {body: load, force: [0, 30]}
design: {initial: 0.3, lower: 0, upper: 1}
objectives:
  G: {response: {displacement: {body: load}}, over_time: max}
constraints:
  - {volume: all, limit: 1.8}
"""


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A run that moves points, and its file."""
    place = tmp_path_factory.mktemp("beam") / "r.h5"
    return run_session(read_case(BEAM), path=place), place


def test_a_run_moves_points_and_keeps_the_volume_of_lengths(ran):
    case = read_case(BEAM)
    fixed = read_case(BEAM.replace("    movable: {within: {line: {from: [-1, -1], to: [-1, 1]}}}\n", ""))
    (free, _), bound = ran, run_session(fixed)
    assert free.objectives["G"] < 0.98 * bound.objectives["G"]
    design = np.concatenate([free.alpha, *free.variables.values()])
    there = placed(case, design)
    length = there.members[0].length
    assert float(length @ free.alpha) == pytest.approx(spent(case, case.constraints[0], design), rel=1e-14)
    assert float(length @ free.alpha) <= 1.8 * (1 + 1e-5)
    assert np.abs(there.members[0].length - case.members[0].length).max() > 0.05


def test_a_run_that_is_resumed_ends_where_it_would_have(tmp_path):
    short = read_case(BEAM, overrides={"optimizer.max_iterations": 10})
    whole_run, resumed = whole_and_resumed(short, tmp_path)
    assert np.array_equal(whole_run.variables["wall.along"], resumed.variables["wall.along"])
    assert np.array_equal(whole_run.alpha, resumed.alpha)


def test_a_finalized_design_has_its_points_where_they_came_to(ran, tmp_path):
    outcome, place = ran
    case, design = opened(read_result(place), {})
    assert not case.movable
    assert len(design) == case.n_design
    kept, reduced = ready(case, design, None, 0.05)
    done = finalize(case, design, kept, reduced, place=tmp_path / "final.yaml")
    final = read_case(done.text)
    ends = np.concatenate([group.q_world for group in final.members])
    reached = placed(read_case(BEAM), np.concatenate([outcome.alpha, *outcome.variables.values()])).points["wall"].world
    assert len(ends)
    for end in ends:
        assert np.abs(reached - end).max(axis=1).min() < 1e-12
    assert done.difference is not None
    assert done.difference < 1e-9


def test_pictures_show_points_where_the_design_has_them(ran):
    outcome, place = ran
    source = Source(place)
    assert source.case.points["wall"].world[:, 1] == pytest.approx(outcome.variables["wall.along"] - 1.0, abs=1e-12)
    for case in (source.stated, source.as_stated().case):
        assert np.array_equal(case.points["wall"].world, [[-1, 0.6], [-1, 0.1], [-1, -0.6]])


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 2.0, 0.5)])
def test_a_lifted_case_has_its_points_in_the_same_regions(axis):
    line = "{line: {from: [-1, -1], to: [-1, 1]}}"
    rectangle = "{rectangle: {center: [-1, 0], size: [0.4, 3]}}"
    for within, names in ((line, ["wall.along"]), (rectangle, ["wall.u", "wall.v"])):
        planar = read_case(BEAM.replace(line, within))
        spatial = read_case(lifted(planar, axis, 0.7))
        assert [each.name for each in spatial.variables] == names
        turn = about_axis(axis, 0.7)
        design = [spatial.start.copy(), planar.start.copy()]
        for each, case in zip(design, (spatial, planar), strict=True):
            each[case.n_design :] = [0.5 * (v.lower + v.upper) for v in case.variables for _ in range(v.count)]
        there = placed(planar, design[1]).points["wall"].world
        flat = np.column_stack([there, np.zeros(len(there))])
        assert placed(spatial, design[0]).points["wall"].world == pytest.approx(flat @ turn.T, abs=1e-12)


def test_points_that_move_around_where_they_are_are_not_lifted():
    planar = read_case(BEAM.replace("{line: {from: [-1, -1], to: [-1, 1]}}", "{around: 0.1}"))
    with pytest.raises(CaseError, match=r"points.wall.movable.within.around: .* leave the plane: it cannot be lifted"):
        lifted(planar)


MISTAKES = [
    ("[-1, 0.6]", "[-1.5, 0.6]", "points.wall.movable.within", "point 0 of 'wall' is at [-1.5, 0.6], 0.5 m outside"),
    ("to: [-1, 1]", "to: [-1, -1]", "points.wall.movable.within.line.to", "is where the line begins"),
    ("to: wall", "to: {body: ground, at: [-1, 0]}", "points.wall.movable", "no member begins or ends at these points"),
    ("  G: {", "  variables: {", "objectives.variables", "this name is taken where points are movable"),
    ("line: {from: [-1, -1], to: [-1, 1]}", "box: {from: [0, 0], to: [1, 1]}", "points.wall.movable.within", "box"),
    (
        "cost: length}",
        "cost: length, candidates: priced}",
        "points.wall.movable",
        "the candidates of 'straps' are priced",
    ),
    (
        "design: {initial",
        "contacts: [{points: wall, on: {body: load, from: [2, 0], to: [3, 0]}, stiffness: 1e4}]\ndesign: {initial",
        "points.wall.movable",
        "contacts[0] is of these points",
    ),
]


@pytest.mark.parametrize(
    ("old", "new", "place", "words"), MISTAKES, ids=[each[2] + " " + each[3][:9] for each in MISTAKES]
)
def test_mistakes_are_told_with_their_place(old, new, place, words):
    assert old in BEAM
    with pytest.raises(CaseError) as error:
        read_case(BEAM.replace(old, new, 1))
    assert any(each.path_key.startswith(place) and words in each.message for each in error.value.mistakes), error.value
