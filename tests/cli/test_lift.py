"""`mdstopo lift`: the case in space of a planar one reads back as the same scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mdstopo
from mdstopo.case.arrays import Signal, Table, TimeFormula
from mdstopo.case.geometry.start_rotations import about_axis
from mdstopo.case.model import Case
from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.cli.group import run_group
from mdstopo.finalize.lift_case import lifted
from tests.tiers import examples

CASES = Path(__file__).parents[2] / "cases"
PLANAR = """\
format: 1
title: planar
gravity: [0, -9.8]
time: {start: 0, end: 0.2}
bodies:
  a: {mass: 60, inertia: 10, position: [1, 2], angle: 0.5, angular_velocity: 3}
  b: {mass: 20, inertia: 6, position: [0, -1], angle: 0.5, velocity: [0.25, 0.5]}
joints:
  - {name: hip, type: revolute, bodies: [a, ground], at: [0, 0.25]}
  - {type: prismatic, bodies: [a, b], at: {a: [1, 0], b: [1, 0]}, axis: [2, 1]}
  - {type: fixed, bodies: [a, ground]}
  - {type: distance, bodies: [a, b], at: [[0, 0], [1, 0]]}
points:
  edge: {body: a, frame: body, grid: {rectangle: {center: [0, 0], size: [0.5, 0.25], count: 7}}}
  many:
    body: b
    grid:
      - {list: [[0, 1], [2, 3]]}
      - {line: {from: [-1, -0.8], to: [-1, 0.8], count: 3}}
      - {arc: {center: [0, 0], radius: 1, from: 3.14, to: 0, count: 9}}
      - {circle: {center: [0, 0], radius: 2, count: 5}}
      - {rectangle: {center: [1, 5], size: [0.5, 0.25], count: 7}}
      - {lattice: {from: [0, 0], to: [1, 3], count: [3, 4]}}
      - {lattice: {from: [7, 0], to: [7, 3], count: [1, 4]}}
  fixed: {body: ground, frame: body, grid: {list: [[9, 9]]}}
members:
  belts: {from: edge, to: many, law: {type: spring, stiffness: 225}}
  single:
    from: {body: ground, at: [0, 1]}
    to: {body: a, at: [0.1, 0], frame: body}
    design: false
    law: {type: gap, stiffness: 1}
  last: {from: fixed, to: edge, law: {type: spring, stiffness: 1}}
loads:
  - {body: a, force: [10, 1], at: [0, 0], moment: 3}
  - {body: b, acceleration: [9.8, 0], angular_acceleration: 20}
  - {body: a, force: {table: [[0, 1, 2], [0.1, 3, 4]]}, moment: {table: [[0, 1], [1, 2]]}, frame: body, at: [1, 0]}
  - {body: b, force: [{table: [[0, 1], [0.1, 1], [0.1, 5]]}, 3], moment: [[0, 1], [1, 2]]}
  - {body: b, force: ["10*t", {formula: "a*t + 1", parameters: {a: 3}}], angular_acceleration: "2*t"}
load_cases:
  one: {loads: [{body: b, angular_acceleration: 20}], gravity: [1, 0]}
  two: {time: {end: 0.1}}
objectives:
  G1: {response: energy, load_case: one}
  G2: {response: {displacement: {body: a, at: [1, 3]}}, load_case: one}
  G3: {response: {angle: {body: a, relative_to: b}}, load_case: one}
  G4: {response: {angular_velocity: {body: a}}, load_case: one, over_time: max_abs}
  G5: {response: {joint_force: {joint: hip}}, load_case: one}
  G6: {response: {velocity: {body: a, relative_to: b, component: x}}, load_case: one}
  G7:
    response: {expression: {formula: "u + w^2", of: {u: energy, w: {angular_velocity: {body: a, relative_to: b}}}}}
    load_case: one
combine: {weights: {G1: 1, G2: 1, G3: 1, G4: 1, G5: 1, G6: 1, G7: 1}}
constraints:
  - {volume: all, fraction: 0.1}
  - {response: {member_force: {group: belts}}, load_case: two, limit: 5}
"""
SPOTS = [((0.0, 0.0, 1.0), 0.0), ((1.0, 0.0, 0.0), 1.5707963267948966), ((1.0, -2.0, 0.5), 0.7)]


def same_scene(planar: Case, spatial: Case, plane: np.ndarray) -> None:
    """Everything of the planar scene stands in the plane; its columns are x, y and the normal."""
    xy = plane[:, :2]
    for old, new in zip(planar.bodies, spatial.bodies, strict=True):
        c, s = np.cos(old.angle), np.sin(old.angle)
        np.testing.assert_allclose(new.position, xy @ np.array(old.position), atol=1e-14)
        np.testing.assert_allclose(new.velocity, xy @ np.array(old.velocity), atol=1e-14)
        np.testing.assert_allclose(new.angular_velocity, plane[:, 2] * old.angular_velocity, atol=1e-14)
        np.testing.assert_allclose(new.rotation, plane @ [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-14)
        assert new.inertia.tolist() == np.diag([old.inertia] * 3).tolist()
    for old, new in zip(planar.members, spatial.members, strict=True):
        np.testing.assert_allclose(new.length, old.length, rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(new.p_world, old.p_world @ xy.T, atol=1e-13)
        np.testing.assert_allclose(new.q_local[:, :2], old.q_local @ flat(old.body_to, plane), atol=1e-13)
        np.testing.assert_array_equal(new.cost, old.cost)
    for old, new in zip(planar.joints, spatial.joints, strict=True):
        assert (new.type, new.name, new.bodies) == (old.type, old.name, old.bodies)
        np.testing.assert_allclose(new.at_first[:2], np.array(old.at_first) @ flat(old.bodies[0], plane), atol=1e-13)
        np.testing.assert_allclose(new.at_second[:2], np.array(old.at_second) @ flat(old.bodies[1], plane), atol=1e-13)
    for old, new in zip(planar.load_cases, spatial.load_cases, strict=True):
        assert (new.name, new.start, new.end) == (old.name, old.start, old.end)
        np.testing.assert_allclose(new.gravity, xy @ np.array(old.gravity), atol=1e-14)
        for one, other in zip(old.loads, new.loads, strict=True):
            axes = np.eye(3) if one.frame == "body" else plane
            for time in (0.0, 0.05, 0.1, 0.15):
                force = axes[:, :2] @ [at(each, time) for each in one.force]
                np.testing.assert_allclose([at(each, time) for each in other.force], force, rtol=1e-14, atol=1e-13)
            couple = axes[:, 2] * at(one.moment, 0.05)
            turning = other.angular_acceleration
            scale = 1.0 if turning is None else planar.body(one.body).inertia
            found = [scale * at(each, 0.05) for each in turning or other.moment]
            np.testing.assert_allclose(found, couple, rtol=1e-14, atol=1e-13)


def flat(body: str, plane: np.ndarray) -> np.ndarray:
    """From planar coordinates of a body to the first two in space: those of ground are global."""
    return plane[:2, :2].T if body == "ground" else np.eye(2)


def at(signal: Signal, time: float) -> float:
    """A signal at a time, right-continuous."""
    if isinstance(signal, TimeFormula):
        return signal.at(time)
    if not isinstance(signal, Table):
        return signal
    t, x = signal.times, signal.values[:, 0]
    k = int(np.searchsorted(t, time, side="right")) - 1
    if k == len(t) - 1:
        return float(x[-1])
    return float(x[k] + (x[k + 1] - x[k]) * (time - t[k]) / (t[k + 1] - t[k]))


@pytest.mark.parametrize("spot", SPOTS)
def test_the_case_in_space_is_the_same_scene(spot: tuple[tuple[float, float, float], float]) -> None:
    planar = read_case(PLANAR)
    spatial = read_case(lifted(planar, *spot))
    assert spatial.dimension == 3
    same_scene(planar, spatial, about_axis(*spot))
    assert [each.name for each in spatial.objectives] == [each.name for each in planar.objectives]
    responses = {each.name: each.response for each in spatial.objectives}
    assert (responses["G3"].kind, responses["G3"].component) == ("rotation", "z")
    assert responses["G4"].component == ("norm" if spot[1] else "z")
    assert responses["G6"].component == "x"
    assert [(name, each.kind, each.component) for name, each in responses["G7"].of] == [
        ("u", "energy", None),
        ("w", "angular_velocity", "z"),
    ]
    assert spatial.constraints[0] == planar.constraints[0]
    assert spatial.joints[0].axes_first[0] @ spatial.bodies[0].rotation.T == pytest.approx(about_axis(*spot)[:, 2])


@given(axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1), angle=st.floats(0.01, 6))
@settings(max_examples=examples(6, 15), deadline=None, derandomize=True)
def test_any_plane_has_the_same_scene(axis: tuple[float, float, float], angle: float) -> None:
    planar = read_case(PLANAR)
    same_scene(planar, read_case(lifted(planar, axis, angle)), about_axis(axis, angle))


@pytest.mark.parametrize("name", ["fig6", "fig7", "catch", "lander", "mooring", "isolator"])
def test_cases_of_the_project_are_lifted(name: str) -> None:
    planar = load_case(CASES / f"{name}.yaml", {"solver.integrator": "auto"})
    same_scene(planar, read_case(lifted(planar)), np.eye(3))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("position: [0, -1], angle: 0.5", "position: [0, -1]", "response.angle: it is not 0 at the start"),
    ],
)
def test_what_cannot_be_lifted_is_refused_at_its_place(old: str, new: str, message: str) -> None:
    with pytest.raises(CaseError) as refused:
        lifted(read_case(PLANAR.replace(old, new, 1), path="x.yaml"))
    assert message in str(refused.value)


#: of the planar scene of Figure 6, with the mass, a moment of inertia, a component and a turning load uncertain
UNCERTAIN = """
format: 1
time: {end: 0.2}
bodies:
  a: {mass: 60, inertia: 10, position: [0, 0]}
  b: {mass: 200, inertia: 60, position: [0, -1], angle: 0.1}
members: {s: {from: {body: a, at: [0, 0]}, to: {body: b, at: [0, -0.5]}, law: {type: spring, stiffness: 500}}}
loads:
  - {body: b, acceleration: [9.8, 1], angular_acceleration: {table: [[0, 20], [0.2, 5]]}, frame: body}
  - {body: a, moment: 3}
uncertainty:
  parameters: {NUMBER: {normal: {deviation: 0.1}}}
  scenarios: {one: {probability: 0.5}, two: {probability: 0.5, set: {members.s.law.stiffness: 700}}}
  sample: 4
objectives: {G: {response: energy}}
solver: {integrator: runge_kutta}
"""


@pytest.mark.parametrize(
    ("number", "in_space"),
    [
        ("bodies.a.mass", "bodies.a.mass"),
        ("bodies.a.inertia", "bodies.a.inertia[2]"),
        ("loads[0].acceleration[1]", "loads[0].acceleration[1]"),
        ("loads[1].moment", "loads[1].moment[2]"),
        ("loads[0].angular_acceleration.table[1][1]", ""),
        ("bodies.b.angle", ""),
    ],
)
def test_uncertain_numbers_are_the_same_in_space(number: str, in_space: str) -> None:
    planar = read_case(UNCERTAIN.replace("NUMBER", f'"{number}"'))
    if not in_space:
        with pytest.raises(CaseError, match="is no single number in space"):
            lifted(planar)
        return
    spatial = read_case(lifted(planar))
    assert planar.uncertainty is not None
    assert spatial.uncertainty is not None
    assert [each.key for each in spatial.uncertainty.numbers] == [in_space]
    one, two = (mdstopo.evaluate(case, gradient=False) for case in (planar, spatial))
    assert two.objectives["G"] == pytest.approx(one.objectives["G"], rel=1e-5)


TABLE = "[[0, 0.5], [0.1, 0.9], [0.2, 0.4], [0.3, 0]]"


@pytest.mark.parametrize("spot", SPOTS)
@pytest.mark.parametrize(
    ("body", "motion"),
    [
        ("angle: 0.5, angular_velocity: 3", "velocity: {table: [[0, 3], [0.1, 5]]}"),
        ("angle: 0.5, angular_velocity: 3", "acceleration: 7"),
        ("velocity: [0, 0]", f"position: {{table: {TABLE}}}"),
        ("velocity: [0, 0]", "position: '0.5 + 4*t^2'"),
    ],
)
def test_a_driven_angle_turns_about_the_normal(
    spot: tuple[tuple[float, float, float], float], body: str, motion: str
) -> None:
    text = PLANAR.replace("angle: 0.5, angular_velocity: 3", body)
    text = text.replace("points:\n", f"motions: [{{body: a, angle: {{{motion}}}}}]\npoints:\n", 1)
    planar = read_case(text)
    spatial = read_case(lifted(planar, *spot))
    plane = about_axis(*spot)
    for old, new in zip(planar.bodies, spatial.bodies, strict=True):
        c, s = np.cos(old.angle), np.sin(old.angle)
        np.testing.assert_allclose(new.rotation, plane @ [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-14)
    (old,), (new,) = planar.load_cases[1].motions, spatial.load_cases[1].motions
    assert old.angle is not None
    assert new.rotation is not None
    np.testing.assert_allclose(new.rotation.axis, plane[:, 2], atol=1e-14)
    (angle,) = new.rotation.angles
    start = 0.5 if old.angle.kind == "position" else 0.0
    assert angle.kind == old.angle.kind
    for time in (0.0, 0.05, 0.15):
        assert at(angle.signal, time) == pytest.approx(at(old.angle.signal, time) - start, abs=1e-15)
    for before, after in zip(planar.load_cases[1].bodies, spatial.load_cases[1].bodies, strict=True):
        np.testing.assert_allclose(after.angular_velocity, plane[:, 2] * before.angular_velocity, atol=1e-12)


def test_what_has_no_component_in_a_tilted_plane_is_refused() -> None:
    text = PLANAR.replace("over_time: max_abs", "over_time: max").replace("at: [1, 3]}", "at: [1, 3], component: y}")
    text = text.replace("points:\n", "motions: [{body: b, x: {velocity: 0.25}}]\npoints:\n", 1)
    assert read_case(lifted(read_case(text))).load_cases[0].motions[0].x is not None
    with pytest.raises(CaseError) as refused:
        lifted(read_case(text), (1, 0, 0), 0.1)
    told = [each.path_key for each in refused.value.mistakes]
    assert told == [
        "motions[0].x",
        "objectives.G2.response.displacement.component",
        "objectives.G4.response.angular_velocity",
    ]
    text = PLANAR.replace("loads:\n", "loads:\n  - {body: a, force: ['10*t', {table: [[0, 0], [1, 1]]}]}\n", 1)
    with pytest.raises(CaseError, match="force: a tilted plane would add a formula and a table: state all as formulas"):
        lifted(read_case(text), (0.6, 0.8, 0), 0.1)


def test_the_command_writes_or_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    planar, out = tmp_path / "p.yaml", tmp_path / "new" / "s.yaml"
    planar.write_text(PLANAR)
    assert run_group(["lift", str(planar), "--tilt", "1", "0", "0", "0.5"]) == 0
    assert read_case(capsys.readouterr().out).dimension == 3
    assert run_group(["lift", str(planar), "--out", str(out)]) == 0
    assert capsys.readouterr().out.splitlines() == [str(out), f"  mdstopo check {out}"]
    assert load_case(out).dimension == 3
    assert run_group(["lift", str(planar), "--out", str(out)]) == 2
    assert f"{out} exists already; it is left as it is" in capsys.readouterr().err
    assert run_group(["lift", str(planar), "--out", str(planar), "--overwrite"]) == 2
    assert planar.read_text() == PLANAR
    capsys.readouterr()
    assert run_group(["lift", str(out)]) == 2
    assert "is 3: the case is in space already: it cannot be lifted" in capsys.readouterr().err
    for wrong in (["0", "0", "0", "1"], ["nan", "0", "1", "1"]):
        assert run_group(["lift", str(planar), "--tilt", *wrong]) == 2
        assert "--tilt" in capsys.readouterr().err
