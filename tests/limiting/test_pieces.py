"""The pieces of a bound: known functions, directions of members, what they carry, how far a body travels."""

import numpy as np
import pytest
from scipy.optimize import linprog

from mdstopo.limiting.compare import gap
from mdstopo.limiting.force_limits import cone_of, restrictions, travel
from mdstopo.limiting.known import with_second_derivative
from mdstopo.limiting.response import limits_of
from mdstopo.limiting.system import System

from .scenes import SPRING, case_of, peak


def system_of(case):
    system = System(case, case.load_cases[0])
    return system, limits_of(system, case.constraints)


def test_known_functions_have_the_second_derivative_and_the_start_asked_for():
    times = np.array([0.0, 0.3, 1.0])
    values = np.array([[[2.0, 1.0]], [[-1.0, 4.0]]])
    found = with_second_derivative(times, values, np.array([3.0]), np.array([-2.0]))
    assert found.at(np.array([0.0]))[0, 0] == 3.0
    assert found.at(np.array([0.0]), 1)[0, 0] == -2.0
    t = np.linspace(0.0, 1.0, 11)
    expected = np.where(t < 0.3, 2.0 + t, -1.0 + 4.0 * (t - 0.3))
    np.testing.assert_allclose(found.at(t, 2)[:, 0], expected, atol=1e-12)
    early, late = found.at_ends(times[:-1], times[1:], 2)
    np.testing.assert_allclose([early[:, 0], late[:, 0]], [[2.0, -1.0], [2.3, 1.8]])
    for order in (0, 1):
        close = found.at(np.array([0.3 - 1e-9, 0.3]), order)[:, 0]
        assert close[0] == pytest.approx(close[1], abs=1e-7)


def test_the_cone_holds_all_sums_of_the_directions_and_little_else():
    rng = np.random.default_rng(3)
    for _ in range(200):
        middle = rng.uniform(-np.pi, np.pi)
        middles, halves = middle + rng.uniform(-0.7, 0.7, 5), rng.uniform(0.0, 0.3, 5)
        cone = cone_of((middles + np.pi) % (2 * np.pi) - np.pi, halves, np.eye(2))
        angles = middles + halves * rng.uniform(-1.0, 1.0, (50, 5))
        share = rng.uniform(0.0, 1.0, (50, 5))
        sums = np.stack([(share * np.cos(angles)).sum(axis=1), (share * np.sin(angles)).sum(axis=1)], axis=1)
        assert (sums @ cone.T >= -1e-12).all()
        for angle, side in (((middles - halves).min(), -1.0), ((middles + halves).max(), 1.0)):
            out = angle + side * 0.01
            assert (cone @ [np.cos(out), np.sin(out)]).min() < 0.0


def test_directions_all_around_have_no_cone():
    around = np.linspace(-np.pi, np.pi, 4)[:-1]
    assert cone_of(around, np.zeros(3), np.eye(2)) is None
    assert cone_of(np.array([0.0, np.pi]), np.full(2, 0.1), np.eye(2)) is None
    assert cone_of(np.array([0.0]), np.array([1.6]), np.eye(2)) is None


def test_along_a_slide_only_the_sign_is_left():
    along = np.array([[1.0, 0.0]])
    assert cone_of(np.array([0.5, -0.9]), np.full(2, 0.1), along).tolist() == [[1.0]]
    assert cone_of(np.array([2.5, -2.5]), np.full(2, 0.1), along).tolist() == [[-1.0]]
    assert cone_of(np.array([0.5, -1.5]), np.full(2, 0.1), along) is None


@pytest.mark.parametrize("power", [1, 2])
def test_what_members_carry_is_the_best_that_the_volume_row_allows(power):
    """At mu = 1 the linear program of alpha; at mu = 2 not below what alphas can make."""
    grid = {"body": "ground", "grid": {"line": {"from": [-1, -1], "to": [-1, 1], "count": 6}}}
    law = {"type": "pulse", "peak": 40, "rate": 10, "time": 0.1}
    weak = {"type": "actuator", "proportional": 100, "limit": 15}
    load = {"body": "load", "at": [0, 0]}
    members = {
        "strong": {"from": "posts", "to": load, "law": law, "cost": "length"},
        "weak": {"from": "posts", "to": load, "law": weak, "cost": 0.2},
    }
    case = case_of(
        points={"posts": grid},
        members=members,
        design={"initial": 0.1, "lower": 0.01, "upper": 0.8, "power": power},
        constraints=[{"volume": "all", "limit": 2.5}],
    )
    row = restrictions(*system_of(case)).rows[0]
    single = np.repeat([40.0, 15.0], 6)
    found = linprog(-single, [case.cost], [2.5], bounds=[(0.01, 0.8)] * 12)
    if power == 1:
        assert row.radius * 10.0 == pytest.approx(-found.fun, rel=1e-9)
        return
    rng = np.random.default_rng(0)
    alpha = rng.uniform(0.01, 0.8, (4000, 12)) ** rng.uniform(0.2, 5.0, (4000, 1))
    alpha = np.clip(alpha * np.minimum(1.0, 2.5 / (alpha @ case.cost))[:, None], 0.0, 0.8)
    assert row.radius * 10.0 >= (alpha**2 @ single).max()


def test_variables_count_with_the_strongest_value_that_they_may_have():
    law = {"type": "actuator", "proportional": 100, "limit": 15}
    design = {"variables": {"most": {"group": "tie", "parameter": "limit", "lower": 1, "upper": 70}}}
    row = restrictions(*system_of(case_of(law=law, design=design))).rows[0]
    assert row.radius * 10.0 == pytest.approx(70.0)


def test_members_without_limit_restrict_nothing():
    assert restrictions(*system_of(case_of())).rows == []


def test_travel_comes_from_norms_from_both_components_and_from_slides():
    slide = {"type": "prismatic", "bodies": ["ground", "load"], "at": [0, 0], "axis": [0.6, 0.8]}
    along_x = peak("displacement", "x", "max_abs", limit=0.3)
    up, down = peak("displacement", "y", "max", limit=0.4), peak("displacement", "y", "min", at_least=-0.1)
    for sections, expected in (
        ({"constraints": [peak("displacement", limit=0.2)]}, 0.2),
        ({"constraints": [along_x]}, np.inf),
        ({"constraints": [along_x, up, down]}, 0.5),
        ({"constraints": [along_x], "joints": [slide]}, 0.5),
        ({"constraints": [up]}, np.inf),
        ({"constraints": [peak("displacement", over="final", limit=0.2)]}, np.inf),
    ):
        system, limits = system_of(case_of(**sections))
        assert travel(system, limits, "load", "ground") == pytest.approx(expected)


def test_bodies_that_cannot_turn_are_found_through_joints():
    bodies = {name: {"mass": 1, "inertia": 1, "position": [k, 0]} for k, name in enumerate("abcd")}
    tie = {"from": {"body": "ground", "at": [-1, 0]}, "to": {"body": "d", "at": [3, 0]}, "law": SPRING}
    case = case_of(
        bodies=bodies,
        members={"tie": tie},
        joints=[
            {"type": "fixed", "bodies": ["b", "c"]},
            {"type": "prismatic", "bodies": ["ground", "b"], "at": [1, 0], "axis": [0, 1]},
            {"type": "revolute", "bodies": ["c", "d"], "at": [2.5, 0]},
        ],
        motions=[{"body": "a", "angle": {"velocity": 0.5}}],
        objectives={"G": peak("acceleration", body="d")},
    )
    assert set(System(case, case.load_cases[0]).angles) == {"ground", "b", "c"}


def test_the_gap_is_a_share_of_the_best():
    assert gap(20.0, 25.0) == pytest.approx(0.2)
    assert gap(-3.0, -4.0, -1.0) == pytest.approx(0.25)
    assert gap(0.0, 0.0) == 0.0
    assert gap(None, 1.0) is None
    assert gap(-1.0, 0.0) is None
