"""Bounds of whole cases: where there is one, where there is none and why, and that no design is beyond one."""

import sys
from pathlib import Path

import numpy as np
import pytest

from mdstopo.limiting.bounds import bounds

from .scenes import SPRING, case_of, peak, sled

ROOT = str(Path(__file__).resolve().parents[2])


def why(**sections):
    found = bounds(case_of(**sections))["G"]
    assert found.value is None
    return found.why


def test_without_a_limit_there_is_no_bound_and_it_says_what_is_missing():
    assert "without a limit on the travel of load" in why(load={"velocity": [2, 0]})
    limit = peak("displacement", limit=1)
    assert "limit on the peak acceleration of load" in why(objectives={"G": peak("displacement")}, constraints=[limit])


@pytest.mark.parametrize(
    ("objective", "word"),
    [
        ({"response": "energy"}, "stored energy depends on what the members are"),
        ({"response": {"member_force": {"group": "tie"}}}, "member force"),
        ({"response": {"angle": {"body": "load"}}}, "an angle depends on where forces act"),
        (peak("acceleration", at=[0.1, 0]), "not the centre of mass of load"),
        (peak("acceleration", over="mean"), "mean over time is no peak"),
        (peak("acceleration", over="final"), "the acceleration at one instant can be anything"),
        (peak("acceleration", "x", "min"), "no convex problem"),
        (peak("acceleration", sense="maximize"), "no convex problem"),
        (peak("acceleration", "x", "max"), "falling without end"),
    ],
)
def test_what_theory_does_not_bound_is_none_with_a_reason(objective, word):
    assert word in why(objectives={"G": objective}, load={"velocity": [2, 0]})


def test_an_observer_that_may_turn_sees_no_bound():
    sections = sled([[0, 50], [0.1, 0]])
    del sections["motions"][0]["angle"]
    aim = {"G": peak("displacement", relative_to="sled")}
    assert "sled may turn" in why(**sections, objectives=aim)


def test_a_case_with_uncertain_values_has_none():
    uncertain = {"parameters": {"bodies.load.mass": {"normal": {"deviation": 1}}}}
    case = {"uncertainty": uncertain, "constraints": [peak("displacement", limit=0.1)]}
    tie = {"from": {"body": "ground", "at": [-1, 0]}, "to": {"body": "load", "at": [0, 0]}, "law": SPRING}
    assert "uncertain" in why(**case, members={"tie": tie})


def test_limits_that_no_force_keeps_are_told_with_the_least_excess():
    """From 2 m/s within 0.1 m at no more than 10 m/s^2; both limits exceeded by a share s: (1 + s)^2 = 2."""
    said = why(
        load={"velocity": [2, 0]},
        objectives={"G": peak("velocity", "x", "final")},
        constraints=[peak("displacement", limit=0.1), peak("acceleration", limit=10)],
    )
    assert "no forces keep all limits" in said
    excess = float(said.partition("at least ")[2].partition(" %")[0]) / 100.0
    assert 0.0 < excess <= np.sqrt(2.0) - 1.0


def test_what_is_counted_and_what_is_not_is_told():
    found = bounds(
        case_of(
            load={"velocity": [2, 0]},
            constraints=[
                peak("displacement", limit=0.1),
                {"response": {"member_force": {"group": "tie"}}, "limit": 5},
            ],
        )
    )["G"]
    assert found.value == pytest.approx(20.0, rel=1e-2)
    counted, _, rest = found.why.partition("not counted")
    assert "displacement of load at most 0.1" in counted
    assert "member force in tie at most 5" in rest


def test_each_load_case_has_the_limits_of_its_own():
    limit = peak("displacement", "x", "max_abs", limit=0.1)
    cases = {"slow": {"time": {"end": 0.04}}, "long": {}}
    aims = {name: peak("acceleration", "x", "max_abs", load_case=case) for name, case in (("A", "slow"), ("B", "long"))}
    rows = [limit | {"load_case": "slow"}, limit | {"load_case": "long", "limit": 0.2}]
    found = bounds(case_of(load={"velocity": [2, 0]}, load_cases=cases, objectives=aims, constraints=rows))
    assert found["A"].value == 0.0  # 0.08 m in all, without any force
    assert found["B"].value == pytest.approx(10.0, rel=1e-2)


@pytest.mark.parametrize(("end", "most", "wide"), [(None, 0.2, 0.1 + 2.0 * 0.5 * np.sin(0.1)), (2, None, 1.1)])
def test_a_limit_off_the_centre_counts_as_far_as_the_body_may_turn(end, most, wide):
    """0.1 m at 0.5 m from the centre, turned by at most 0.2: the centre keeps 0.1 + 2 * 0.5 sin(0.1). Where nothing
    limits the angle the body may turn over."""
    limits = [peak("displacement", at=[0, 0.5], limit=0.1)]
    if most is not None:
        limits.append({"response": {"angle": {"body": "load"}}, "over_time": "max_abs", "limit": most})
    more = {} if end is None else {"time": {"end": end}}
    found = bounds(case_of(load={"velocity": [2, 0]}, constraints=limits, **more))["G"]
    assert 0.99 <= found.value / (4.0 / (2.0 * wide)) <= 1.0 + 1e-9


def test_motion_that_joints_leave_no_freedom_is_bounded_by_itself():
    """On a slide across the sled's way the load has to go along with it."""
    sections = sled([[0, 50], [0.1, 0]])
    slide = {"type": "prismatic", "bodies": ["sled", "load"], "at": [0, 0], "axis": [0, 1]}
    found = bounds(case_of(**sections, joints=[slide], objectives={"G": peak("acceleration", "x", "max_abs")}))["G"]
    assert found.value == pytest.approx(50.0, rel=1e-9)


def test_a_start_that_is_moved_gives_no_bound():
    slide = {"type": "prismatic", "bodies": ["ground", "load"], "at": [0, 0], "axis": [1, 0]}
    assert "solver.assemble" in why(
        joints=[slide], solver={"assemble": True}, constraints=[peak("displacement", limit=0.1)]
    )


@pytest.mark.parametrize("seed", range(14))
def test_no_random_design_is_beyond_the_bound(seed, monkeypatch):
    monkeypatch.syspath_prepend(ROOT)
    from benchmarks.bound import tries

    assert sys.modules["benchmarks.bound"]
    found = list(tries(seed, 24))
    assert found
    for each in found:
        assert each.bound is None or each.bound <= each.best
    assert any(each.bound is not None and each.bound > 0.0 for each in found)


def named(what, **sections):
    """A sled's load in a tie of which something follows from a name that is a design variable."""
    scene = sled([[0, 0], [0.1, 30], [0.2, 0]])
    scene["define"] = {"k": 4000}
    scene["design"] = {"variables": {"size": {"of": "define.k", "lower": 1000, "upper": 9000}}}
    scene["constraints"] = [peak("displacement", "x", "max_abs", relative_to="sled", limit=0.1)]
    scene["objectives"] = {"G": peak("acceleration", "x", "max_abs")}
    if what == "mass":
        scene["bodies"]["load"] |= {"mass": "=k / 400"}
    else:
        scene["members"]["tie"]["law"] = what
    return case_of(**scene, **sections)


def test_a_name_that_decides_numbers_of_laws_alone_leaves_the_bound_as_it_is():
    plain = sled([[0, 0], [0.1, 30], [0.2, 0]])
    plain["constraints"] = [peak("displacement", "x", "max_abs", relative_to="sled", limit=0.1)]
    plain["objectives"] = {"G": peak("acceleration", "x", "max_abs")}
    expected = bounds(case_of(**plain))["G"]
    found = bounds(named({"type": "spring", "stiffness": "=k", "damping": "=k / 200"}))["G"]
    assert expected.value is not None
    assert found.value == pytest.approx(expected.value, rel=1e-9)
    # nothing is certain of a law that follows: the limit of its force is not used
    limited = bounds(named({"type": "actuator", "proportional": 100, "limit": "=k / 4000"}))["G"]
    assert limited.value == pytest.approx(expected.value, rel=1e-9)


def test_a_name_that_decides_a_mass_has_no_bound_and_says_why():
    found = bounds(named("mass"))["G"]
    assert found.value is None
    assert "more than numbers of laws follows" in found.why
