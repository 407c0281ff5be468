"""What a well-formed case becomes: units, defaults, merged load cases, resolved rows."""

from __future__ import annotations

import math
import pickle
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.model import (
    Body,
    GapLaw,
    Load,
    OptimizerSettings,
    PrismaticJoint,
    ResponseRow,
    SolverSettings,
    SpringLaw,
    Table,
    VolumeRow,
)
from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError

from .scenes import EVERYTHING, SMALL, changed, mistakes, small

CASES = Path(__file__).parents[2] / "cases"


@pytest.mark.parametrize("path", sorted(CASES.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_cases_of_the_project_are_read_without_a_warning(path: Path) -> None:
    case = load_case(path)
    assert case.warnings == ()
    assert case.n_design == 1020 or not path.stem.startswith("fig")
    assert case.name == path.stem
    assert case.is_optimizable


def test_fig6_is_the_scene_of_the_paper() -> None:
    case = load_case(CASES / "fig6.yaml")
    torso, vehicle = case.bodies
    assert (torso.mass, torso.inertia, vehicle.mass, vehicle.inertia) == (60, 10, 2000, 6000)
    (load,) = case.load_cases[0].loads
    assert (load.force, load.moment) == ((2000 * 9.8, 0.0), 6000 * 20.0)
    assert case.load_cases[0].gravity == (0.0, -9.8)
    (row,) = case.constraints
    assert isinstance(row, VolumeRow)
    assert (row.bound, row.sense, row.coefficients.sum()) == (102.0, "equals", 1020.0)
    np.testing.assert_array_equal(case.initial, np.full(1020, 0.1))


def test_defaults_are_filled_in() -> None:
    case = small()
    assert case.bodies[0] == Body("a", 2.0, 3.0, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, frozenset())
    assert case.members[0].laws[0] == SpringLaw(stiffness=225.0, damping=0.0, free_length=None, preload=0.0)
    (load_case_,) = case.load_cases
    assert (load_case_.name, load_case_.gravity, load_case_.start, load_case_.end) == (
        "default",
        (0.0, 0.0),
        0.0,
        0.2,
    )
    assert case.solver == SolverSettings()
    assert case.optimizer == OptimizerSettings()
    (objective,) = case.objectives
    assert (objective.over_time, objective.load_case, objective.sense) == ("max", "default", "minimize")
    assert case.title == ""
    assert {f: set(getattr(case, f)) for f in ("initial", "lower", "upper", "power")} == {
        "initial": {0.1}, "lower": {0.001}, "upper": {1.0}, "power": {1.0},
    }  # fmt: skip


def test_the_settings_have_the_defaults_of_their_classes() -> None:
    case = small(("loads:", "optimizer: {}\nsolver: {}\nloads:"))
    assert case.solver == SolverSettings()
    assert case.optimizer == OptimizerSettings()


def test_a_case_without_design_objectives_and_constraints_has_alpha_one() -> None:
    text = SMALL[: SMALL.index("objectives:")]
    case = read_case(text)
    np.testing.assert_array_equal(case.initial, np.ones(6))
    assert not case.is_optimizable
    np.testing.assert_array_equal(read_case(text + "design: {}\n").initial, np.full(6, 0.1))


def test_everything_in_the_format_is_read() -> None:
    case = read_case(EVERYTHING)
    assert [joint.name for joint in case.joints] == ["hip", "1", "2", "3", "4"]
    slider = case.joints[1]
    assert isinstance(slider, PrismaticJoint)
    # The axis rides on the first body, which is turned by 0.5.
    assert slider.axis == pytest.approx((math.cos(0.5), -math.sin(0.5)))
    assert case.joints[2].at_second == (0.0, 0.0)
    assert case.bushings[0].stiffness == (1e5, 1e5, 200.0)
    belts, single = case.members
    assert (belts.initial, belts.lower, single.design) == (0.2, 0.001, False)
    assert [law.type for law in single.laws] == [
        "gap", "cubic", "curve", "pulse", "table", "actuator", "inerter",
    ]  # fmt: skip
    gap = single.laws[0]
    assert isinstance(gap, GapLaw)
    assert (gap.side, gap.clip, gap.active_from, gap.active_until) == ("compression", True, 0.1, 0.2)
    assert case.n_design == len(belts)
    assert case.group_slices == {"belts": slice(0, len(belts))}
    assert case.combine is not None
    assert case.combine.weights == {"G1": 0.25, "G2": 0.25, "G3": 0, "G4": 0.5, "G5": 0, "G6": 0}
    _, fraction, at_least, angle = case.constraints
    assert isinstance(fraction, VolumeRow)
    assert (fraction.sense, fraction.bound) == ("limit", pytest.approx(0.1 * belts.cost.sum()))
    assert isinstance(at_least, VolumeRow)
    assert at_least.sense == "at_least"
    assert isinstance(angle, ResponseRow)
    assert (angle.over_time, angle.load_case, angle.bound) == ("max_abs", "rotation", 0.05)
    assert case.optimizer.options == {"move_limit": 0.3}


def test_load_cases_add_loads_replace_gravity_times_by_key_and_motions_whole() -> None:
    case = read_case(EVERYTHING)
    rotation, translation = case.load_cases
    assert (rotation.gravity, rotation.start, rotation.end) == ((0.0, 0.0), 0.0, 0.1)
    assert (translation.gravity, translation.end) == ((0.0, -9.8), 0.2)
    assert len(rotation.loads) == len(translation.loads) == 5
    assert rotation.loads[:4] == translation.loads[:4]
    assert rotation.loads[4] == Load("b", moment=6000.0 * 20)
    assert [m.body for m in translation.motions] == ["c", "d"]
    common, own = rotation.motions[0], translation.motions[0]
    assert common.angle is not None
    assert own.angle is None  # the body's entry is replaced whole


def test_a_start_velocity_that_is_not_stated_is_taken_from_the_motion() -> None:
    motion = "motions: [{body: a, x: {velocity: {table: [[0, 3], [1, 4]]}}, angle: {velocity: -2}}]\n"
    case = small(("loads:", motion + "loads:"))
    body = case.load_cases[0].bodies[0]
    assert (body.velocity, body.angular_velocity) == ((3.0, 0.0), -2.0)
    stated = ("position: [0, 0]", "position: [0, 0], velocity: [1, 0]")
    (mistake,) = mistakes(changed(SMALL, ("loads:", motion + "loads:"), stated))
    assert mistake.path_key == "motions[0].x.velocity"


def test_a_start_angle_that_is_not_stated_is_taken_from_the_motion() -> None:
    rows = "[[0, 0.5], [0.1, 0.6], [0.15, 0.7], [0.2, 0.8]]"
    motion = f"motions: [{{body: a, angle: {{position: {{table: {rows}}}}}}}]\n"
    case = small(("loads:", motion + "loads:"), ("[0, 1]]", "[0, 1]]"))
    assert case.bodies[0].angle == 0.5
    np.testing.assert_allclose(case.points["p"].local[1], [math.sin(0.5), math.cos(0.5)])
    own = f"load_cases: {{one: {{}}, two: {{{motion.strip()}}}}}\n"
    found = mistakes(
        changed(SMALL, ("loads:", own + "loads:"), ("{response: energy}", "{response: energy, load_case: one}"))
    )
    assert [m.path_key for m in found] == ["load_cases.two.motions[0]"]


def test_the_start_slope_of_a_position_table_is_the_splines() -> None:
    # A cubic is its own not-a-knot spline.
    times = [0.0, 0.03, 0.1, 0.14, 0.2]
    rows = [[t, 2 * t - 3 * t**2 + 5 * t**3] for t in times]
    case = small(("loads:", f"motions: [{{body: a, x: {{position: {rows}}}}}]\nloads:"))
    assert case.load_cases[0].bodies[0].velocity[0] == pytest.approx(2.0, rel=1e-12)


def test_loads_take_tables_whole_or_by_component() -> None:
    force = "force: {table: [[0, 1, 2], [1, 3, 4]]}"
    case = small(("force: [1, 0]", force))
    fx, fy = case.load_cases[0].loads[0].force
    assert isinstance(fx, Table)
    assert isinstance(fy, Table)
    assert (fx.times.tolist(), fx.values.tolist(), fy.values.tolist()) == ([0, 1], [[1], [3]], [[2], [4]])
    same = small(("force: [1, 0]", "force: [[0, 1, 2], [1, 3, 4]]"))
    assert same.load_cases[0].loads == case.load_cases[0].loads
    mixed = small(("force: [1, 0]", "force: [{table: [[0, 1], [1, 3]]}, 7]")).load_cases[0].loads[0]
    assert mixed.force == (fx, 7.0)
    scaled = small(("force: [1, 0]", "acceleration: [{table: [[0, 1], [1, 3]]}, 7]")).load_cases[0].loads[0]
    assert scaled.force == (Table(fx.times, fx.values * 4.0), 28.0)


def test_where_a_load_acts_rides_on_the_body() -> None:
    turned = ("position: [2, 0]", "position: [2, 0], angle: 1.5707963267948966")
    load = small(turned, ("force: [1, 0]", "force: [1, 0], at: [2, 1]")).load_cases[0].loads[0]
    assert load.at_local == pytest.approx((1.0, 0.0))
    load = small(turned, ("force: [1, 0]", "force: [1, 0], at: [2, 1], frame: body")).load_cases[0].loads[0]
    assert (load.at_local, load.frame) == ((2.0, 1.0), "body")


@pytest.mark.parametrize(
    ("section", "path"),
    [
        ("solver: {integrator: gauss, spectral_radius: 0.5}", "solver.spectral_radius"),
        ("solver: {step: 0.01, tolerance: 1e-6}", "solver.tolerance"),
        ("solver: {assemble: true}", "solver.assemble"),
        ("combine: {weights: {G: 1}, method: weighted_sum, exponent: 3}", "combine.exponent"),
        ("combine: {weights: {G: 1}, method: weighted_product, normalize: true}", "combine.normalize"),
    ],
)
def test_an_option_that_the_method_ignores_is_a_warning(section: str, path: str) -> None:
    case = small(("loads:", f"{section}\nloads:"))
    (warning,) = case.warnings
    assert warning.path_key == path
    assert warning.line == SMALL[: SMALL.index("loads:")].count("\n") + 1


def test_weights_are_scaled_without_overflow() -> None:
    two = "  G: {response: energy}\n  H: {response: energy}\ncombine: {weights: {G: 1e308, H: 1e308}}"
    case = small(("  G: {response: energy}", two))
    assert case.combine is not None
    assert case.combine.weights == {"G": 0.5, "H": 0.5}


def test_all_the_material_of_the_bounds_may_be_spent_exactly() -> None:
    # 6 x 0.001 is not 0.006 in doubles.
    assert small(("equals: 3", "equals: 0.006")).constraints
    assert small(("equals: 3", "equals: 6")).constraints


def test_a_case_cannot_be_changed_and_a_copy_of_it_neither() -> None:
    case = read_case(EVERYTHING)
    for copy in (case, pickle.loads(pickle.dumps(case))):
        assert copy == case
        for array in (
            copy.members[0].length,
            copy.members[0].from_index,
            copy.points["edge"].local,
            copy.initial,
        ):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1
        with pytest.raises(FrozenInstanceError):
            copy.title = "other"
        with pytest.raises(TypeError):
            copy.points["x"] = copy.points["edge"]
    assert replace(case, title="other").title == "other"


def test_marks_tell_places_and_fall_back_on_what_encloses() -> None:
    case = read_case(SMALL)
    assert case.marks["members.belts.law.stiffness"] == (10, 58)
    assert case.marks["members.belts.law.damping"] == case.marks["members.belts.law"]
    assert case.marks["solver.step"] == (1, 1)


def test_an_error_survives_pickling_so_that_workers_can_raise_it() -> None:
    with pytest.raises(CaseError) as caught:
        read_case("format: 3")
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert copy.mistakes == caught.value.mistakes


def test_reading_imports_no_scipy() -> None:
    import subprocess
    import sys

    code = (
        "import sys; from mdstopo.case.reader import load_case; "
        f"load_case({str(CASES / 'fig6.yaml')!r}); "
        "assert not [m for m in ('scipy', 'numba', 'h5py', 'difflib') if m in sys.modules]"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("solver", "warns"),
    [
        ("integrator: auto", True),
        ("integrator: gauss", True),
        ("integrator: auto, sensitivity: iterative", False),
        ("integrator: generalized_alpha", False),
    ],
)
def test_a_spectral_radius_is_ignored_unless_generalized_alpha_makes_the_steps(solver: str, warns: bool) -> None:
    case = small(("objectives:", f"solver: {{{solver}, spectral_radius: 0.9}}\nobjectives:"))
    found = [each.path_key for each in case.warnings]
    assert found == (["solver.spectral_radius"] if warns else [])


def test_a_stated_start_may_differ_from_a_prescribed_one_by_rounding_of_what_the_motion_moves_by() -> None:
    """The prescribed start is 0, so that its own size allows no difference."""
    motion = "[{body: a, x: {position: {table: [[0, 0], [0.1, 1], [0.15, 2], [0.2, 4]]}}}]"
    text = changed(SMALL, ("loads:", f"motions: {motion}\nloads:"))
    near, far = (changed(text, ("position: [0, 0]", f"position: [{x}, 0]")) for x in ("1.0e-9", "1.0e-5"))
    assert read_case(near).bodies[0].position == (1e-9, 0.0)
    (mistake,) = mistakes(far)
    assert mistake.path_key.startswith("motions[0].x.position")
    assert "they must agree" in mistake.message
