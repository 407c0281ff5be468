"""Defined names as design variables: derivatives by them, of everything that follows from them, and runs with them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import mdstopo
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.finalize.finalize_design import finalize, opened, ready
from mdstopo.finalize.lift_case import lifted
from mdstopo.finalize.names import with_names_fixed
from mdstopo.robust.ensemble import Ensemble
from mdstopo.robust.sample import design_sample
from mdstopo.robust.sampled_case import case_at
from mdstopo.scene.design_map import as_designed
from mdstopo.session.run_session import run_session
from mdstopo.store.result_reader import read_result
from tests.reading import case_of
from tests.variables.support import OBJECTIVES, differences, whole, whole_and_resumed, widths

SCENE = """
format: 1
define: {k: 60, c: "k/30", g: 1, m: 2, v: 0.8, u: 0.5}
time: {end: 0.6}
gravity: [0, "=-g"]
bodies:
  m: {mass: "=m", inertia: "=m*0.15", position: [0, 0], velocity: ["=v", 0.3], angular_velocity: "=v^2/2"}
points:
  p: {body: m, grid: {rectangle: {center: [0, 0], size: ["=k/300", "=u/5"], count: 4}}}
  q: {body: ground, grid: {list: [[1, "=1+u^2"], [2, 0]]}}
loads:
  - {body: m, at: [0.1, "=g/10"], force: ["=g*3", 1]}
  - {body: m, acceleration: {table: [[0, "=g/3", 0], [0.25, 0, 0]]}}
members:
  s: {from: {body: ground, at: [-0.6, 0.5]}, to: {body: m, at: [0.1, 0.1]},
      law: {type: spring, stiffness: "=k*0.7", damping: "=c/2"}}
  t: {from: {body: ground, at: [1, 0]}, to: {body: m, at: [0.1, 0]},
      law: {type: gap, side: compression, stiffness: "=k^2/12", damping: "=c*2", gap: "=k/600"}}
  z: {from: p, to: q, law: {type: spring, stiffness: "=m*k/20"}, cost: length}
design:
  initial: 0.8
  variables:
    stiff: {of: define.k, lower: 10, upper: 100}
    pull: {of: define.g, lower: 0, upper: 3}
    heavy: {of: define.m, lower: 1, upper: 5}
    fast: {of: define.v, lower: -1, upper: 1}
    wide: {of: define.u, lower: 0.1, upper: 1}
"""
SCENE += OBJECTIVES + "  - {volume: z, limit: 50}\n"
#: the body slides in a straight line
JOINT = "joints: [{type: prismatic, bodies: [ground, m], at: [0, 0], axis: [0.8, 0.3]}]\n"
#: two springs, each with a stiffness and a damping, which follow from one name or are variables each by itself
SPRINGS = """
format: 1
define: {k: 60}
time: {end: 0.6}
bodies: {m: {mass: 2, inertia: 0.3, position: [0, 0], velocity: [0.8, 0.3], angular_velocity: 0.4}}
members:
  s: {from: {body: ground, at: [-0.6, 0.5]}, to: {body: m, at: [0.1, 0.1]},
      law: {type: spring, stiffness: "=k*0.7", damping: "=sqrt(k)/8", free_length: "=0.5 + k/200"}}
  t: {from: {body: ground, at: [1, 0]}, to: {body: m, at: [0.1, 0]}, design: false,
      law: {type: spring, stiffness: "=k^2/50", damping: "=k/30"}}
design: {initial: 0.8, variables: {VARIABLES}}
"""
SPRINGS += OBJECTIVES


def check(case: Case, bound: float, size: float = 3e-4) -> None:
    """Adjoint and direct agree, and with differences along each variable."""
    found, other = (mdstopo.evaluate(case, method=method) for method in ("adjoint", "direct"))
    assert found.status.ok, found.message
    names = [*found.objectives, *range(len(case.constraints))]
    own = {name: whole(found, name) * widths(case) for name in names}
    for name in names:
        scale = np.abs(own[name]).max()
        assert np.abs(whole(other, name) * widths(case) - own[name]).max() <= 1e-9 * scale, name
    for variable in case.variables:
        part = case.space.parts[variable.name]
        direction = np.zeros(len(case.start))
        direction[part] = variable.upper - variable.lower
        slopes = differences(case, case.start, direction, size)
        for name in names:
            scale = max(abs(own[name][part][0]), 0.05 * np.abs(own[name][case.n_design :]).max())
            assert abs(own[name][part][0] - slopes[name]) <= bound * scale, (variable.name, name)


def test_a_derivative_by_a_name_is_the_sum_over_all_places_to_the_last_digits() -> None:
    named = mdstopo.evaluate(read_case(SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}")))
    slopes = {
        ("s", "stiffness"): 0.7, ("s", "damping"): 1.0 / (16.0 * np.sqrt(60.0)), ("s", "free_length"): 1.0 / 200.0,
        ("t", "stiffness"): 2.4, ("t", "damping"): 1.0 / 30.0,
    }  # fmt: skip
    apart = ", ".join(
        f"{group}_{name}: {{group: {group}, parameter: {name}, lower: 0.001, upper: 100}}" for group, name in slopes
    )
    each = mdstopo.evaluate(read_case(SPRINGS.replace("VARIABLES", apart)))
    assert named.objectives == each.objectives
    for name, found in named.variable_gradients.items():
        by_place = {where: each.variable_gradients[name]["_".join(where)][0] for where in slopes}
        size = sum(abs(by_place[where] * slope) for where, slope in slopes.items())
        total = sum(by_place[where] * slope for where, slope in slopes.items())
        assert abs(found["k"][0] - total) <= 1e-12 * size
        np.testing.assert_array_equal(named.gradients[name], each.gradients[name])


def test_masses_loads_gravity_and_velocities_are_differentiated_as_free_flight_has_it() -> None:
    text = """
format: 1
define: {m: 2, push: 3, g: 9.81, v: 0.7}
time: {end: 0.5}
gravity: [0, "=-g"]
bodies: {b: {mass: "=m", inertia: 1, position: [0, 0], velocity: ["=v", 0]}}
loads: [{body: b, force: ["=push*m", "=push^2"]}]
design:
  variables:
    heavy: {of: define.m, lower: 1, upper: 5}
    pushed: {of: define.push, lower: 0, upper: 5}
    pulled: {of: define.g, lower: 0, upper: 20}
    fast: {of: define.v, lower: -1, upper: 1}
objectives:
  x: {response: {displacement: {body: b, component: x}}, over_time: final}
  y: {response: {displacement: {body: b, component: y}}, over_time: final}
  mean: {response: {velocity: {body: b, component: y}}, over_time: mean}
  a: {response: {acceleration: {body: b, component: y}}, over_time: final}
combine: {weights: {x: 1, y: 1, mean: 1, a: 1}, normalize: false}
"""
    m, push, t = 2.0, 3.0, 0.5
    expected = {
        "x": [0.0, t**2 / 2.0, 0.0, t],
        "y": [-(push**2) / m**2 * t**2 / 2.0, 2.0 * push / m * t**2 / 2.0, -(t**2) / 2.0, 0.0],
        "mean": [-(push**2) / m**2 * t / 2.0, 2.0 * push / m * t / 2.0, -t / 2.0, 0.0],
        "a": [-(push**2) / m**2, 2.0 * push / m, -1.0, 0.0],
    }
    for method in ("adjoint", "direct"):
        found = mdstopo.evaluate(read_case(text), method=method)
        for name, slopes in expected.items():
            own = [each[0] for each in found.variable_gradients[name].values()]
            np.testing.assert_allclose(own, slopes, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("jointed", [False, True])
def test_every_kind_of_place_is_differentiated(jointed: bool) -> None:
    text = SCENE + JOINT if jointed else SCENE
    text = (
        text.replace('velocity: ["=v", 0.3], angular_velocity: "=v^2/2"', "velocity: [0.8, 0.3]") if jointed else text
    )
    text = text.replace("    fast: {of: define.v, lower: -1, upper: 1}\n", "") if jointed else text
    check(case_of(text, tolerance=1e-11), 1e-6)


def test_points_move_beside_names_that_masses_and_other_points_follow_from() -> None:
    text = SCENE.replace(
        "  q: {body: ground,",
        "  r: {body: ground, grid: {list: [[-1, 1]]}, movable: {within: {around: 0.1}}}\n  q: {body: ground,",
    )
    text = text.replace("s: {from: {body: ground, at: [-0.6, 0.5]}", "s: {from: r")
    check(case_of(text, tolerance=1e-11), 1e-6)


def test_a_name_may_be_used_in_the_loads_of_two_load_cases() -> None:
    text = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}").replace(
        "X: {", "X: {load_case: b, "
    )
    text = text.replace("E: {", "E: {load_case: a, ").replace("M: {", "M: {load_case: b, ")
    text = text.replace("B: {", "B: {load_case: a, ").replace("A: {", "A: {load_case: b, ")
    text = text.replace("  - {response: {angle", "  - {load_case: a, response: {angle")
    text += """load_cases:
  a: {loads: [{body: m, force: ["=k/20", 0]}]}
  b: {loads: [{body: m, force: [0, "=k/30"]}]}
"""
    check(case_of(text, tolerance=1e-11), 1e-6)


def test_a_load_that_is_zero_where_a_name_begins_is_differentiated_all_the_same() -> None:
    text = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}")
    text += 'loads: [{body: m, at: [0.1, "=k/60 - 1"], force: ["=k/20 - 3", 1]}]\n'
    check(case_of(text, tolerance=1e-11), 1e-6)


def test_names_vary_with_fixed_steps_too() -> None:
    text = SPRINGS.replace(
        "VARIABLES", "k: {of: define.k, lower: 10, upper: 100}, h: {of: define.h, lower: 1, upper: 4}"
    )
    text = text.replace("define: {k: 60}", "define: {k: 60, h: 2}").replace("mass: 2", 'mass: "=h"')
    text = text.replace("velocity: [0.8, 0.3]", 'velocity: ["=h*0.4", 0.3]')
    check(case_of(text, integrator="generalized_alpha", step=0.005), 1e-6)


def test_what_else_a_scene_would_move_by_is_refused_with_its_key() -> None:
    moved = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}").replace(
        "position: [0, 0]", 'position: ["=k/600", 0]'
    )
    with pytest.raises(CaseError) as caught:
        Evaluator(read_case(moved))
    (mistake,) = caught.value.mistakes
    assert mistake.path_key == "design.variables.k.of"
    assert mistake.message.startswith(
        "from define.k follows bodies.m.position[0], which changes more of the scene than"
    )
    for load, key in (
        ("force: {formula: ['a*sin(9*t)', '0'], parameters: {a: '=k'}}", "loads[0].force.parameters.a"),
        ("force: {table: [[0, 0, 0], ['=k/200', 1, 0]]}", "loads[0].force.table[1][0]"),
    ):
        timed = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}")
        with pytest.raises(CaseError, match=re.escape(f"from define.k follows {key}, which changes more")):
            Evaluator(read_case(timed + f"loads: [{{body: m, {load}}}]\n"))
    light = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}").replace("mass: 2", 'mass: "=k-20"')
    with pytest.raises(CaseError) as caught:
        Evaluator(read_case(light))
    assert "at k = 10: bodies.m.mass: found -10.0, allowed is a number > 0" in caught.value.mistakes[0].message
    settled = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}").replace(
        "mass: 2", 'mass: "=k/30"'
    )
    with pytest.raises(CaseError, match=r"which does not go with solver\.settle"):
        Evaluator(case_of(settled, settle=True))


def test_a_design_where_a_number_has_no_value_ends_with_a_sentence() -> None:
    case = read_case(SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}").replace(
        '"=k*0.7"', '"=abs(1/(k - 20))"'))  # fmt: skip
    found = mdstopo.evaluate(case, variables={"k": 20.0})
    assert not found.status.usable
    assert found.message == "members.s.law.stiffness has no finite value"


RUN = (
    SCENE.replace("objectives:", "unused:", 1).split("unused:")[0]
    + """
objectives: {X: {response: {displacement: {body: m, at: [0.1, 0.1]}}, over_time: max}}
constraints: [{volume: all, limit: 20}]
optimizer: {max_iterations: 6}
"""
)


def test_a_run_goes_on_to_the_bit_and_shows_what_it_has_found(tmp_path) -> None:  # type: ignore[no-untyped-def]
    case = read_case(RUN)
    once, resumed = whole_and_resumed(case, tmp_path)
    assert once.objectives == resumed.objectives
    assert {name: values.tolist() for name, values in once.variables.items()} == {
        name: values.tolist() for name, values in resumed.variables.items()
    }
    assert once.objectives["X"] < mdstopo.evaluate(case, gradient=False).objectives["X"]
    view = read_result(tmp_path / "whole.h5")
    assert view.under("design/variables").keys() == {"stiff", "pull", "heavy", "fast", "wide"}


def test_names_may_be_all_that_is_designed() -> None:
    text = SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}")
    text = text.replace('damping: "=sqrt(k)/8"', "damping: 1").replace("initial: 0.8, ", "")
    text = text.replace(
        'law: {type: spring, stiffness: "=k*0.7"', 'design: false, law: {type: spring, stiffness: "=k*0.7"'
    )
    case = read_case(text, overrides={"optimizer.max_iterations": "10"})
    case = replace(case, objectives=case.objectives[2:3], combine=None, constraints=())
    assert case.n_design == 0
    outcome = run_session(case)
    assert outcome.objectives["X"] < mdstopo.evaluate(case, gradient=False).objectives["X"]


FINAL = (
    SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100, cost: 0.01}").split("objectives:")[0]
    + """
objectives: {X: {response: {displacement: {body: m, at: [0.1, 0.1]}}, over_time: max}}
constraints: [{volume: all, limit: 1.2}]
optimizer: {max_iterations: 6}
"""
)


def test_a_final_case_has_the_name_as_one_number(tmp_path) -> None:  # type: ignore[no-untyped-def]
    case = read_case(FINAL, path=tmp_path / "springs.yaml")
    (tmp_path / "springs.yaml").write_text(FINAL)
    outcome = run_session(case, path=tmp_path / "springs.h5")
    opened_case, design = opened(read_result(tmp_path / "springs.h5"), {})
    assert (opened_case.variables, opened_case.follows, len(design)) == ((), None, 1)
    kept, reduced = ready(opened_case, design, 1, None)
    done = finalize(opened_case, design, kept, reduced, place=tmp_path / "final.yaml")
    k = float(outcome.variables["k"][0])
    final = read_case(done.text)
    assert f"define: {{k: {k!r}}}" in done.text
    assert '"=k^2/50"' in done.text
    laws = {group.name: group.laws[0] for group in final.members}
    assert laws["t"].stiffness == pytest.approx(k**2 / 50.0, rel=1e-14)  # type: ignore[attr-defined]
    assert laws["s_0"].stiffness == pytest.approx(0.7 * k * done.alpha[0], rel=1e-14)  # type: ignore[attr-defined]
    assert laws["s_0"].free_length == pytest.approx(0.5 + k / 200.0, rel=1e-14)  # type: ignore[attr-defined]
    (row,) = final.constraints
    assert row.bound == pytest.approx(1.2 - 0.01 * k)
    assert done.difference is not None
    assert done.difference < 1e-9
    harder = read_case(done.text, overrides={"define.k": 1.1 * k})
    assert harder.members[0].laws[0].stiffness == pytest.approx(1.1 * 0.7 * k * done.alpha[0])  # type: ignore[attr-defined]


def test_a_lifted_case_keeps_names_that_masses_and_velocities_follow_from() -> None:
    names = "k: {of: define.k, lower: 10, upper: 100}, h: {of: define.h, lower: 1, upper: 4}"
    text = SPRINGS.replace("VARIABLES", names).replace("define: {k: 60}", "define: {k: 60, h: 2}")
    text = text.replace("mass: 2, inertia: 0.3", 'mass: "=h", inertia: "=h/3"').replace("[0.8, 0.3]", '["=h*0.4", 0.3]')
    spatial = read_case(lifted(read_case(text)))
    assert spatial.follows is not None
    there = read_case(lifted(read_case(text)), overrides={"define.h": 3})
    assert there.bodies[0].mass == 3.0
    assert np.array_equal(there.bodies[0].inertia, np.eye(3))
    assert there.bodies[0].velocity == (3 * 0.4, 0.3, 0.0)


@pytest.mark.parametrize(
    ("text", "tilt", "words"),
    [
        (SCENE, 0.0, "design.variables.wide.of: varies, and is no name any more"),
        (SPRINGS + 'loads: [{body: m, force: ["=k", 1]}]\n', 0.0, r"loads\[0\].force\[0\]: follows from a name"),
        (SPRINGS + 'gravity: ["=k", 1]\n', 0.5, r"gravity\[0\]: follows .* in a tilted plane is no single number"),
    ],
)
def test_names_that_a_lifted_case_could_not_follow_are_refused(text: str, tilt: float, words: str) -> None:
    planar = read_case(text.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}"))
    with pytest.raises(CaseError, match=f"{words}.*: it cannot be lifted"):
        lifted(planar, (1.0, 0.0, 0.0), tilt)


def test_other_names_in_the_same_expressions_may_be_uncertain() -> None:
    text = (
        SPRINGS.replace("VARIABLES", "k: {of: define.k, lower: 10, upper: 100}").split("objectives:")[0]
        + """
objectives: {X: {response: {displacement: {body: m, at: [0.1, 0.1]}}, over_time: max}}
uncertainty: {sample: 3, validation: 0, parameters: {define.f: {uniform: {from: 0.5, to: 1.5}}}}
"""
    )
    text = text.replace("define: {k: 60}", "define: {k: 60, f: 1}").replace('"=k^2/50"', '"=f*k^2/50"')
    case = read_case(text)
    assert case.uncertainty is not None
    sample = design_sample(case.uncertainty)
    slopes = []
    for i in range(3):
        there = case_at(case, sample, i)
        assert there.follows is not None
        slopes.append(Evaluator(there).evaluate(there.start).variable_gradients["X"]["k"][0])
    assert len(set(slopes)) == 3
    ensemble = Ensemble(case)
    found = ensemble.evaluate(case.start)
    np.testing.assert_allclose(found.variable_gradients["X"]["k"][0], np.mean(slopes), rtol=1e-12)


def test_the_case_with_its_points_where_a_design_has_them_is_the_same_case() -> None:
    case = case_of(SCENE, tolerance=1e-10)
    design = case.start.copy()
    design[case.n_design :] += [7.0, 0.2, -0.3, 0.1, 0.15]
    there = as_designed(case, design)
    assert not np.array_equal(there.points["p"].local, case.points["p"].local)
    alpha, values = design[: case.n_design], case.space.named(design)
    found, expected = mdstopo.evaluate(there, alpha), mdstopo.evaluate(case, alpha, variables=values)
    np.testing.assert_allclose(list(found.objectives.values()), list(expected.objectives.values()), rtol=1e-12)
    np.testing.assert_allclose(found.constraints, expected.constraints, rtol=1e-12)


def test_a_name_that_lies_beyond_its_bound_by_rounding_is_fixed_at_the_bound() -> None:
    case = read_case(FINAL)
    (named,) = case.defined_variables
    design = case.start.copy()
    design[case.space.parts[named.name]] = np.nextafter(named.upper, np.inf)
    fixed, rest = with_names_fixed(case, design)
    assert (fixed.variables, len(rest)) == ((), case.n_design)
    assert fixed.members[1].laws[0].stiffness == named.upper**2 / 50.0  # type: ignore[attr-defined]
