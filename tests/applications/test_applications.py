"""The applications are whole problems, their designs hold, and a short run makes headway."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from benchmarks.applications import APPLICATIONS, HELD, PRESENT, combined, excess, finer, scorer
from benchmarks.forces import strokes, whole_forces
from benchmarks.hand import HANDS, Sizes, alike, even, of_four_legs, places
from benchmarks.motions import DATA, texts
from benchmarks.scenes import CASES
from mdstopo import Case, evaluate, load_case, optimize
from mdstopo.case.arrays import Table
from mdstopo.case.model import CrushLaw, VolumeRow
from mdstopo.design_problem import DesignProblem
from mdstopo.engine import Evaluator
from mdstopo.scene.refusals import refusals
from mdstopo.store.design_files import read_design

#: iterations of a short run, where ten take long
SHORT = {"cargo": 3}
#: the rows on members of the lander's sides
SIDES = ((4, "left"), (5, "right"))


def case_of(name: str, **overrides: object) -> Case:
    return load_case(CASES / f"{name}.yaml", overrides=overrides)


@pytest.mark.parametrize("name", APPLICATIONS)
def test_each_has_several_kinds_of_members_that_cost_and_two_objectives_at_least(name: str) -> None:
    case = case_of(name)
    assert refusals(case) == []
    assert len(case.objectives) >= 2
    assert case.combine is not None
    assert len(case.load_cases) >= 2
    kinds = {(law.type, getattr(law, "side", "")) for group in case.design_groups for law in group.laws}
    assert len(kinds) >= 2 or name == "cargo"  # which has chains alone, athwart and along
    paid = {group for row in case.constraints if isinstance(row, VolumeRow) for group in row.groups}
    assert paid == {group.name for group in case.design_groups}
    assert any(not isinstance(row, VolumeRow) for row in case.constraints)


@pytest.mark.parametrize("name", APPLICATIONS)
def test_a_hand_design_is_made_of_candidates(name: str) -> None:
    case = case_of(name)
    found = places(case, HANDS[name])
    names = [f"{group.name}_" for group in case.design_groups]
    assert all(any(name.startswith(f"{part.split()[0]}_") for name in names) for part, _ in found)
    chosen = [member for _, members in found for member in members]
    assert len(set(chosen)) == len(chosen) > 3


@pytest.mark.parametrize("name", APPLICATIONS)
def test_an_even_design_has_every_candidate_once(name: str) -> None:
    case = case_of(name)
    parts = even(case)
    assert [part for part, _ in parts] == [groups[0].name for groups in alike(case)]
    assert sorted(member for _, members in parts for member in members) == list(range(case.n_design))


def test_a_hand_design_with_a_member_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="no member of chains joins"):
        places(case_of("tiedown"), {"chains": [((0.0, 0.0), (1.0, 1.0))]})


def test_a_part_of_a_hand_design_with_some_of_the_members_that_share_an_alpha_is_refused() -> None:
    case = case_of("touchdown")
    problem = DesignProblem(Evaluator(case), combined(case))
    east = places(case, {"crush upper": of_four_legs(((2.2, 0, 0), (1, 0.2, 2.1)))[:2]})
    with pytest.raises(ValueError, match="crush upper: all members that share an alpha belong to it, or none"):
        Sizes(problem, east)


def test_tables_of_time_are_what_their_formulas_give() -> None:
    made = dict(texts())
    assert made
    for name, text in made.items():
        assert (DATA / name).read_text() == text, name


@pytest.mark.parametrize("name", APPLICATIONS)
def test_the_stored_design_keeps_its_limits_when_computed_a_hundred_times_finer(name: str) -> None:
    case = case_of(name)
    design = read_design(CASES / "designs" / f"{name}.txt", case.n_design)
    fine, start = evaluate(finer(case), design, gradient=False), evaluate(case, gradient=False)
    assert fine.status.ok
    assert excess(case, fine) <= HELD
    assert excess(case, start) > 0.01
    coarse = evaluate(case, design, gradient=False)
    for objective, value in fine.objectives.items():
        assert value == pytest.approx(coarse.objectives[objective], rel=1e-6)


@pytest.mark.parametrize("name", APPLICATIONS)
def test_the_stored_hand_design_has_the_parts_stated_keeps_all_limits_and_is_worse(name: str) -> None:
    case = case_of(name)
    hand, found = (read_design(CASES / "designs" / f"{each}.txt", case.n_design) for each in (f"{name}-hand", name))
    rest = np.ones(case.n_design, dtype=bool)
    for _, members in places(case, HANDS[name]):
        assert np.ptp(hand[members]) == 0.0
        rest[members] = False
    assert np.array_equal(hand[rest], case.lower[rest])
    fine, score = finer(case), scorer(case)
    drawn = evaluate(fine, hand, gradient=False)
    assert excess(case, drawn) <= HELD
    assert score(evaluate(fine, found, gradient=False)) < 0.98 * score(drawn)


@pytest.mark.parametrize("name", APPLICATIONS)
def test_a_short_run_from_the_stated_start_makes_headway(name: str) -> None:
    case = case_of(name, **{"optimizer.max_iterations": SHORT.get(name, 10), "combine.weights": weights(name)})
    result = optimize(case)
    before, after = evaluate(case, gradient=False), evaluate(case, result.alpha, gradient=False)
    assert np.all(result.alpha >= case.lower)
    assert excess(case, after) < 0.5 * excess(case, before)


def weights(name: str) -> dict[str, float]:
    """The first objective alone: no others have to be optimised first."""
    objectives = case_of(name).objectives
    return {objective.name: float(i == 0) for i, objective in enumerate(objectives)}


def test_forces_that_are_written_out_again_agree_with_the_response() -> None:
    design = read_design(CASES / "designs" / "lander.txt", case_of("lander").n_design)
    for looked in ("struts", "crush"):
        limits = {f"constraints[{i}].response": {"member_force": {"group": f"{side}_{looked}"}} for i, side in SIDES}
        case = case_of("lander", **limits)
        found = evaluate(case, design, gradient=False)
        for i, side in SIDES:
            group = next(each for each in case.design_groups if each.name == f"{side}_{looked}")
            own = whole_forces(case, design, group, "level") * design[case.group_slices[group.name]]
            assert own.max() == pytest.approx(found.constraints[i] + case.constraints[i].bound, rel=1e-3)


def test_the_cartridges_of_the_lander_are_crushed_and_stay_so() -> None:
    case = case_of("lander")
    design = read_design(CASES / "designs" / "lander.txt", case.n_design)
    for group in case.design_groups:
        if group.name.endswith("_crush"):
            there = design[case.group_slices[group.name]] >= PRESENT
            assert there.any()
            law = group.laws[0]
            assert isinstance(law, CrushLaw)
            far = strokes(case, design, group, "level")[there]
            assert far.max() > 5 * law.force / law.stiffness
            assert np.all(far < 0.7 * group.length[there])


def test_forces_in_space_that_are_written_out_again_agree_with_the_response() -> None:
    groups = ("struts_wl", "crush_er")
    rows = [
        {"response": {"member_force": {"group": group}}, "over_time": "max", "load_case": "downhill", "limit": 1e4}
        for group in groups
    ]
    case = case_of("touchdown", constraints=rows)
    design = read_design(CASES / "designs" / "touchdown.txt", case.n_design)
    found = evaluate(case, design, gradient=False)
    for i, name in enumerate(groups):
        group = next(each for each in case.design_groups if each.name == name)
        own = whole_forces(case, design, group, "downhill") * design[case.group_slices[name]]
        assert own.max() == pytest.approx(found.constraints[i] + 1e4, rel=1e-3)


def test_the_lander_on_a_slope_stops_no_softer_than_anything_can_and_all_its_legs_are_crushed() -> None:
    """Along the slope's normal the hull has 2.85 m/s to lose, and the travel of its centre of mass is at most that of
    the nozzle and what the tilt adds: v^2 / 2 s bounds the acceleration of every design."""
    case = case_of("touchdown")
    design = read_design(CASES / "designs" / "touchdown.txt", case.n_design)
    shock = evaluate(case, design, gradient=False).objectives["corner"]
    slope, tilt, arm, clear = 0.13963, 0.2, 1.2, 0.51
    speed = 3.05 * np.cos(slope) - 1.22 * np.sin(slope)
    travel = clear + arm * (np.cos(slope) - np.cos(slope + tilt))
    assert shock > speed**2 / (2.0 * travel)
    for groups in alike(case):
        for group in groups if groups[0].name.startswith("crush") else ():
            there = design[case.group_slices[group.name]] >= 0.5
            law = group.laws[0]
            assert isinstance(law, CrushLaw)
            far = max(strokes(case, design, group, each.name)[there].max() for each in case.load_cases)
            assert 5 * law.force / law.stiffness < far < 0.7 * group.length[there].min()


def test_the_pulse_of_the_occupant_has_the_occupant_load_criterion_that_is_published() -> None:
    """Euro NCAP TB027: v is kept for 65 mm seen from the car; then z stops it, within 235 mm more. The car has stopped
    by then, after v^2 / 2a: v t1 + v^2 / 2z - v^2 / 2a = 0.3 m with t1 from a t1^2 / 2 = 65 mm."""
    (motion,) = case_of("occupant").load_case("straight").motions
    assert motion.x is not None
    assert isinstance(motion.x.signal, Table)
    pulse = -motion.x.signal.values[:, 0]
    speed = float(trapezoid(pulse, motion.x.signal.times))
    assert olc(56 / 3.6, 20 * 9.81) / 9.81 == pytest.approx(23.8901345, abs=1e-7)
    assert speed == pytest.approx(56 / 3.6, rel=1e-3)
    assert olc(speed, pulse.max()) == pytest.approx(234.36, rel=2e-3)


def olc(speed: float, deceleration: float) -> float:
    """The occupant load criterion of a rectangular pulse that ends before the occupant stops, in m/s2."""
    flight = np.sqrt(2.0 * 0.065 / deceleration)
    return float(speed**2 / 2.0 / (0.3 + speed**2 / (2.0 * deceleration) - speed * flight))


def test_the_belt_stops_the_chest_no_softer_than_anything_can_and_its_torsion_bars_give_way() -> None:
    """Of a rectangular pulse a with speed v somebody who moves by D in the car feels at least a / (1 + 2 D a / v^2)."""
    case = case_of("occupant")
    design = read_design(CASES / "designs" / "occupant.txt", case.n_design)
    a, v, far = 20 * 9.81, 56 / 3.6, 0.3
    assert evaluate(case, design, gradient=False).objectives["straight"] > a / (1.0 + 2.0 * far * a / v**2)
    for name in ("shoulder", "diagonal"):
        group = next(each for each in case.design_groups if each.name == name)
        there = design[case.group_slices[name]] >= 0.5
        law = group.laws[0]
        assert isinstance(law, CrushLaw)
        assert strokes(case, design, group, "straight")[there].max() > law.gap + 2.0 * law.force / law.stiffness


def test_a_law_that_is_not_written_out_is_refused() -> None:
    case = load_case(CASES / "mooring.yaml")
    group = next(each for each in case.members if each.name == "water_along")
    with pytest.raises(ValueError, match="InerterLaw"):
        whole_forces(case, case.initial, group, "swell")
