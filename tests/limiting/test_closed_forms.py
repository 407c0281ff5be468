"""Bounds beside closed forms: within one per cent below them, never above."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize_scalar

import mdstopo
from mdstopo.limiting.bounds import bounds

from .scenes import SPRING, case_of, peak, sled


def bound_of(case):
    found = bounds(case)["G"]
    assert found.value is not None, found.why
    return found.value


def just_below(found, exact):
    assert found <= exact * (1.0 + 1e-9)
    assert found >= 0.99 * exact


@pytest.mark.parametrize("end", [0.1, 1.0, 40.0])
@pytest.mark.parametrize(("component", "over"), [("x", "max_abs"), ("norm", "max")])
def test_a_velocity_step_needs_half_its_square_over_the_travel(end, component, over):
    """Constant deceleration; 2 D / V = 0.1 s are enough."""
    case = case_of(
        load={"velocity": [2, 0]},
        time={"end": end},
        objectives={"G": peak("acceleration", component, over)},
        constraints=[peak("displacement", component, over, limit=0.1)],
    )
    just_below(bound_of(case), 2.0**2 / (2.0 * 0.1))


def test_a_slanting_velocity_step_needs_the_same():
    case = case_of(load={"velocity": [3, -4]}, constraints=[peak("displacement", limit=0.5)])
    just_below(bound_of(case), 25.0)


def test_a_time_too_short_for_the_stop_asks_for_less():
    """x(T) = D with x' still positive: a = 2 (V T - D) / T^2."""
    case = case_of(load={"velocity": [2, 0]}, time={"end": 0.08}, constraints=[peak("displacement", limit=0.1)])
    just_below(bound_of(case), 2.0 * (2.0 * 0.08 - 0.1) / 0.08**2)


def test_the_least_travel_for_an_acceleration_is_the_same_read_backwards():
    case = case_of(
        load={"velocity": [2, 0]},
        objectives={"G": peak("displacement")},
        constraints=[peak("acceleration", limit=20)],
    )
    just_below(bound_of(case), 0.1)


def test_gravity_and_loads_do_not_matter_to_forces_without_limit():
    case = case_of(
        load={"velocity": [2, 0]},
        gravity=[0, -9.81],
        loads=[{"body": "load", "force": [300, 20], "at": [0, 0.2], "frame": "body"}],
        constraints=[peak("displacement", limit=0.1)],
    )
    just_below(bound_of(case), 20.0)


def test_the_largest_least_value_is_bounded_from_above():
    """Thrown at -2 m/s and never beyond 0.1 m: a T^2 / 2 - 2 T = 0.1 at the end."""
    case = case_of(
        load={"velocity": [-2, 0]},
        objectives={"G": peak("acceleration", "x", "min", sense="maximize")},
        constraints=[peak("displacement", "x", "max", limit=0.1)],
        time={"end": 0.5},
    )
    exact = 2.0 * (0.1 + 2.0 * 0.5) / 0.5**2
    assert exact * (1.0 - 1e-9) <= bound_of(case) <= 1.01 * exact


@pytest.mark.parametrize("start", [0.0, 0.07])
def test_a_rectangular_pulse_of_the_base(start):
    """a / (1 + 2 D / (a tau^2)): the body gains the sled's speed at a constant rate, and lags D behind then."""
    a, tau, travel = 100.0, 0.05, 0.04
    table = [[start, a], [start + tau, a], [start + tau, 0]]
    table = [[start, 0], *table] if start else table
    case = case_of(
        **sled(table), time={"end": 0.6}, constraints=[peak("displacement", relative_to="sled", limit=travel)]
    )
    exact = a / (1.0 + 2.0 * travel / (a * tau**2))
    if start:
        # the load may begin to move before the sled does, by as much as the travel allows
        assert bound_of(case) < 0.99 * exact
        just_below(bound_of(case), independent(table, travel, 0.6, exact))
    else:
        just_below(bound_of(case), exact)


def independent(table, travel, end, guess, cells=600):
    """The best force that is constant in each cell, by cumulative sums: a motion that keeps the limits at all times.

    Between the ends of a cell the displacement is off the chord by at most (|u| + |sled|) h^2 / 8, which is taken off
    the travel: what is found can be reached, so it is an upper bound of what the bound approximates from below.
    """
    t = np.linspace(0.0, end, cells + 1)
    h = t[1]
    times, values = np.array(table).T
    fine = np.linspace(0.0, end, 200_001)
    pulse = np.where(fine < times[0], values[0], np.interp(fine, times, values))
    jumps = np.flatnonzero(np.diff(times) == 0.0)
    for j in jumps:
        pulse = np.where(np.isclose(fine, times[j]), values[j + 1], pulse)
    speed = np.concatenate([[0.0], np.cumsum(0.5 * (pulse[1:] + pulse[:-1])) * fine[1]])
    sled_x = np.interp(t, fine, np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * fine[1]]))
    i, j = np.arange(cells + 1)[:, None], np.arange(cells)[None]
    moved = np.where(j < i, h * h * (i - j - 0.5), 0.0)
    room = travel - (guess + np.abs(values).max()) * h * h / 8.0
    cost = np.zeros(cells + 1)
    cost[-1] = 1.0
    one = np.ones((cells, 1))
    rows = np.vstack([
        np.hstack([moved, np.zeros((cells + 1, 1))]), np.hstack([-moved, np.zeros((cells + 1, 1))]),
        np.hstack([np.eye(cells), -one]), np.hstack([-np.eye(cells), -one]),
    ])  # fmt: skip
    right = np.concatenate([sled_x + room, room - sled_x, np.zeros(2 * cells)])
    found = linprog(cost, rows, right, bounds=[(None, None)] * (cells + 1))
    assert found.status == 0
    return found.fun


@pytest.mark.parametrize(
    "table",
    [
        [[0, 60], [0.05, 60], [0.05, -60], [0.1, -60], [0.1, 0]],
        [[0, 0], [0.04, 120], [0.08, 0]],
        [[0, 80], [0.04, 80], [0.04, 0], [0.1, 0], [0.1, 80], [0.14, 80], [0.14, 0]],
    ],
    ids=["there and back", "triangle", "two"],
)
def test_other_pulses_beside_an_independent_discretisation(table):
    case = case_of(
        **sled(table),
        time={"end": 0.3},
        objectives={"G": peak("acceleration", "x", "max_abs")},
        constraints=[peak("displacement", "x", "max_abs", relative_to="sled", limit=0.03)],
    )
    just_below(bound_of(case), independent(table, 0.03, 0.3, 60.0))


def test_a_rail_turns_a_limit_along_one_axis_into_one_along_the_rail():
    """V^2 / (2 D) with D = 0.1 / cos(phi); without the rail it would be cos(phi)^2 V^2 / (2 * 0.1)."""
    phi, speed = 0.6, 2.0
    axis = [np.cos(phi), np.sin(phi)]
    case = case_of(
        load={"velocity": [speed * axis[0], speed * axis[1]]},
        joints=[{"type": "prismatic", "bodies": ["ground", "load"], "at": [0, 0], "axis": axis}],
        constraints=[peak("displacement", "x", "max_abs", limit=0.1)],
    )
    just_below(bound_of(case), speed**2 * np.cos(phi) / 0.2)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_bodies_that_float_together_share_the_work(angle):
    """Two carriages of which one runs into the other: relative deceleration V^2 / (2 D), shared by the masses."""
    along = np.array([np.cos(angle), np.sin(angle)])
    bodies = {
        "load": {"mass": 10, "inertia": 1, "position": [0, 0], "velocity": (2.0 * along).tolist()},
        "sled": {"mass": 30, "inertia": 1, "position": along.tolist()},
    }
    slides = [
        {"type": "prismatic", "bodies": ["ground", name], "at": body["position"], "axis": along.tolist()}
        for name, body in bodies.items()
    ]
    sections = {
        "bodies": bodies,
        "joints": slides,
        "constraints": [peak("displacement", relative_to="sled", limit=0.1)],
    }
    tie = {"from": {"body": "load", "at": [0, 0]}, "to": {"body": "sled", "at": along.tolist()}, "law": SPRING}
    just_below(bound_of(case_of(**sections, members={"tie": tie})), 20.0 * 30.0 / 40.0)
    # with a member from the ground to the other one, that can do all the work
    post = {**tie, "to": {"body": "ground", "at": along.tolist()}}
    assert bounds(case_of(**sections, members={"tie": tie, "post": post}))["G"].value is None


def test_a_fall_through_the_slack_is_no_member_s_work():
    """Free over s, then stopped within D - s: g s / (D - s)."""
    slack, travel = 0.05, 0.2
    law = {"type": "gap", "stiffness": 5000, "gap": slack, "clip": True}
    tie = {"from": {"body": "ground", "at": [0, 3]}, "to": {"body": "load", "at": [0, 0]}, "law": law}
    sections = {
        "gravity": [0, -9.81],
        "objectives": {"G": peak("acceleration", "y", "max")},
        "constraints": [peak("displacement", "y", "min", at_least=-travel)],
    }
    just_below(bound_of(case_of(**sections, members={"tie": tie})), 9.81 * slack / (travel - slack))
    taut = {**tie, "law": {**law, "gap": 0}}
    # held from the start it has the whole time for the way
    assert bound_of(case_of(**sections, members={"tie": taut})) == pytest.approx(-2.0 * travel, rel=1e-6)


def test_members_that_are_too_weak_let_the_load_go():
    """(L - F) T^2 / (2 m)."""
    law = {"type": "actuator", "proportional": 1e4, "limit": 30}
    case = case_of(
        law=law,
        loads=[{"body": "load", "force": [50, 0]}],
        objectives={"G": peak("displacement")},
        constraints=[],
    )
    just_below(bound_of(case), 0.5 * (50.0 - 30.0) / 10.0)


def test_wires_from_above_do_not_push_down():
    """Lifted by L > m g, held by nothing: (L/m - g) T^2 / 2."""
    law = {"type": "gap", "stiffness": 5000, "gap": 0, "clip": True}
    wires = {
        name: {"from": {"body": "ground", "at": [x, 20]}, "to": {"body": "load", "at": [0, 0]}, "law": law}
        for name, x in (("left", -2), ("right", 2))
    }
    sections = {
        "gravity": [0, -9.81],
        "time": {"end": 0.5},
        "loads": [{"body": "load", "force": [0, 150]}],
        "objectives": {"G": peak("displacement")},
        "constraints": [peak("displacement", limit=1.0)],
    }
    just_below(bound_of(case_of(**sections, members=wires)), 0.5 * (15.0 - 9.81) * 0.25)
    # with a strut that also pushes they could
    strut = {
        "strut": {
            "from": {"body": "ground", "at": [0, -2]},
            "to": {"body": "load", "at": [0, 0]},
            "law": {"type": "spring", "stiffness": 9},
        }
    }
    assert bounds(case_of(**sections, members=wires | strut))["G"].value is None


def test_the_best_spring_and_the_best_damped_one_lie_above():
    """V^2 / D with a spring alone; 0.5205986 V^2 / D at a damping ratio of 0.40397."""

    def product(ratio):
        """Peak acceleration times peak travel of x'' + 2 zeta x' + x = 0 from x = 0, x' = 1."""
        root = np.sqrt(1.0 - ratio**2)
        t = np.linspace(0.0, 8.0, 400_001)
        decay = np.exp(-ratio * t)
        x = decay * np.sin(root * t) / root
        v = decay * (np.cos(root * t) - ratio / root * np.sin(root * t))
        return np.abs(2.0 * ratio * v + x).max() * np.abs(x).max()

    assert product(0.0) == pytest.approx(1.0, abs=1e-9)
    found = minimize_scalar(product, bounds=(0.3, 0.5), method="bounded", options={"xatol": 1e-9})
    assert found.fun == pytest.approx(0.5205986, abs=1e-7)
    assert found.x == pytest.approx(0.40397, abs=1e-5)


def test_a_run_finds_the_best_spring_with_a_damper():
    """The case of the closed form, as it is: stiffness and damping are the variables."""
    case = mdstopo.load_case("cases/isolator.yaml")
    result = mdstopo.optimize(case)
    best = 0.5205986 * 2.0**2 / 0.1
    assert result.objectives["acceleration"] == pytest.approx(best, rel=1e-4)
    stiffness, damping = result.variables["stiffness"][0], result.variables["damping"][0]
    assert damping / (2.0 * np.sqrt(10.0 * stiffness)) == pytest.approx(0.40397, abs=1e-3)
    just_below(bounds(case)["acceleration"].value, 20.0)
