"""The second model of the hunt is right where closed forms tell, and its scenes are the same however written."""

import math

import numpy as np
import pytest

SWING = {
    "format": 1,
    "gravity": [0.0, 0.0],
    "time": {"end": 2.0},
    "bodies": {
        "a": {"mass": 2.0, "inertia": 1.0, "position": [2.0, 0.0], "velocity": [1.0, 0.0], "angular_velocity": 0.0}
    },
    "points": {
        "p": {"body": "ground", "grid": {"list": [[0.0, 0.0]]}},
        "q": {"body": "a", "grid": {"list": [[2.0, 0.0]]}},
    },
    "members": {"g": {"from": "p", "to": "q", "law": {"type": "spring", "stiffness": 18.0}}},
    "design": {"initial": 1.0, "power": 2},
}


@pytest.fixture
def model(monkeypatch):
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.hunt_model import Model

    def solved(document, alpha=(1.0,), values=None):
        found = Model(document, np.array(alpha), values)
        found.solve()
        return found

    return solved


def test_an_oscillator_swings_as_it_should(model):
    """x = 2 + sin(w t) / w, w^2 = alpha^2 k / m = 36/4."""
    scene = model(SWING, (1.0,))
    w = 3.0
    force = {"member_force": {"group": "g"}}
    place = {"displacement": {"body": "a", "at": [2.0, 0.0]}}
    assert scene.objective(force, "max")[0] == pytest.approx(18.0 / w, rel=1e-10)
    assert scene.objective(force, "min")[0] == pytest.approx(0.0, abs=1e-9)
    assert scene.objective("energy", "max")[0] == pytest.approx(1.0, rel=1e-10)
    assert scene.objective(place, "final")[0] == pytest.approx(abs(math.sin(2 * w)) / w, rel=1e-10)
    # |sin| over [0, 6]: 2 of its first half wave, 1 + cos 6 of the second one
    assert scene.objective(place, "integral")[0] == pytest.approx((3.0 + math.cos(6.0)) / w**2, rel=1e-9)
    square = (1.0 - math.sin(4 * w) / (4 * w)) / w**2
    assert scene.objective(place, "rms")[0] == pytest.approx(math.sqrt(square / 2.0), rel=1e-10)


def test_the_power_of_a_design_scales_its_forces(model):
    scene = model(SWING, (0.5,))
    assert scene.objective({"member_force": {"group": "g"}}, "max")[0] == pytest.approx(1.5 * 2.0, rel=1e-10)


@pytest.mark.parametrize(
    ("law", "x", "rate", "t", "force", "energy"),
    [
        ({"type": "spring", "stiffness": 5.0, "damping": 2.0, "preload": 1.0}, 0.2, 0.3, 0.0, 2.6, 0.1),
        ({"type": "gap", "stiffness": 5.0, "damping": 2.0, "gap": 0.1}, 0.2, 0.3, 0.0, 1.1, 0.025),
        ({"type": "gap", "stiffness": 5.0, "damping": 2.0, "gap": 0.1}, 0.05, 0.3, 0.0, 0.0, 0.0),
        ({"type": "gap", "stiffness": 5.0, "gap": 0.1, "side": "compression"}, -0.2, 0.3, 0.0, -0.5, 0.025),
        ({"type": "gap", "stiffness": 5.0, "damping": 2.0, "gap": 0.1, "clip": True}, 0.2, -3.0, 0.0, 0.0, 0.025),
        ({"type": "cubic", "stiffness": 2.0, "cubic": 10.0}, 0.5, 0.0, 0.0, 2.25, 0.25 + 10.0 / 64.0),
        ({"type": "curve", "curve": [[-1.0, -2.0], [0.0, 0.0], [1.0, 2.0]]}, 1.5, 0.0, 0.0, 3.0, 2.25),
        ({"type": "pulse", "peak": 4.0, "rate": 9.0, "time": 0.5}, 0.0, 0.0, 0.7, 4.0 * math.exp(-0.36), 0.0),
        ({"type": "table", "table": [[0.0, 1.0], [1.0, 3.0]]}, 0.0, 0.0, 0.25, 1.5, 0.0),
        ({"type": "actuator", "proportional": 3.0, "derivative": 1.0, "target": 0.1}, 0.2, 0.5, 0.0, 0.8, 0.0),
        (
            {"type": "actuator", "proportional": 30.0, "target": 0.1, "derivative": 0.0, "limit": 2.0},
            0.3,
            0.5,
            0.0,
            2.0,
            0,
        ),
    ],
)
def test_laws_are_those_of_the_format(model, law, x, rate, t, force, energy):
    from benchmarks.hunt_laws import Law

    found = Law(law)
    found.place(x, rate)
    assert found.force(x, rate, t) == pytest.approx(force, rel=1e-12, abs=1e-15)
    assert found.energy(x) == pytest.approx(energy, rel=1e-12, abs=1e-15)


LEG = {"type": "crush", "stiffness": 100.0, "force": 5.0, "gap": 0.1, "side": "tension"}


def test_a_leg_is_crushed_and_stays_so(model):
    """Drawn out at 1 m/s against 5 N, which is small beside its momentum: then back along its stiffness."""
    from benchmarks.hunt_laws import ACTS, FREE, HELD, Law

    leg = Law(LEG)
    leg.place(0.0, 1.0)
    assert leg.mode == FREE
    assert leg.margin(0.0, 1.0) == pytest.approx(0.1)
    leg.after(0.1, 1.0)
    assert leg.mode == ACTS
    assert leg.force(0.12, 1.0, 0.0) == pytest.approx(2.0)
    leg.after(0.15, 1.0)
    assert leg.mode == HELD
    assert leg.force(0.4, 1.0, 0.0) == 5.0
    assert leg.energy(0.4) == pytest.approx(0.125)
    leg.after(0.4, 0.0)
    assert leg.mode == ACTS
    assert leg.growth == pytest.approx(0.25)
    assert leg.force(0.38, -1.0, 0.0) == pytest.approx(3.0)
    leg.after(0.35, -1.0)
    assert leg.mode == FREE
    assert leg.margin(0.2, -1.0) == pytest.approx(0.15)


def falling(friction, velocity, edge, damping=0.0):
    body = {"mass": 2.0, "inertia": 1e6, "position": [0.0, 1.0], "velocity": velocity, "angular_velocity": 0.0}
    return {
        "gravity": [0.0, -10.0],
        "time": {"end": 1.0},
        "bodies": {"a": body},
        "points": {"feet": {"body": "a", "grid": {"list": [[0.0, 0.8]]}}},
        "members": {},
        "design": {"power": 1},
        "contacts": [
            {
                "points": "feet",
                "on": {"body": "ground", "from": edge[0], "to": edge[1]},
                "stiffness": 800.0,
                "damping": damping,
                "friction": friction,
                "slip": 1e-3,
            }
        ],
    }


def test_what_falls_on_a_floor_bounces_back_as_high(model):
    """From 0.8 m; in contact it swings about the depth m g / k with w^2 = k / m = 400."""
    scene = model(falling(0.0, [0.0, 0.0], [[-1.0, 0.0], [1.0, 0.0]]), ())
    touch, w, sag = 0.4, 20.0, 10.0 / 400.0
    turn = math.pi / 2.0 + math.atan(sag * w / 4.0)  # until the lowest point
    high = scene.objective({"acceleration": {"body": "a", "at": [0.0, 1.0]}}, "max")[0]
    assert high == pytest.approx(w * w * math.hypot(sag, 4.0 / w), rel=1e-9)
    assert [piece.low for piece in scene.pieces] == pytest.approx([0.0, touch, touch + 2.0 * turn / w], rel=1e-9)


def test_what_slides_on_a_floor_is_held_back_by_its_friction(model):
    """It begins at the depth of rest; mu g = 3 m/s^2 slow it down from 5 m/s."""
    document = falling(0.3, [5.0, 0.0], [[-1.0, 0.825], [9.0, 0.825]])
    scene = model(document, ())
    speed = scene.objective({"velocity": {"body": "a", "at": [0.0, 1.0]}}, "final")[0]
    assert speed == pytest.approx(2.0, rel=1e-5)


def test_beyond_the_end_of_an_edge_nothing_holds(model):
    scene = model(falling(0.0, [2.0, 0.0], [[-1.0, 0.0], [0.5, 0.0]]), ())
    place = scene.objective({"displacement": {"body": "a", "at": [0.0, 1.0]}}, "final")[0]
    assert place == pytest.approx(math.hypot(2.0, 5.0), rel=1e-9)


def test_parameters_that_vary_take_the_place_of_the_laws_own(monkeypatch):
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.hunt_model import Model

    rows = {"k": {"group": "g", "parameter": "stiffness", "each": "member"}}
    document = SWING | {"design": {"power": 1, "variables": rows}}
    scene = Model(document, np.array([1.0]), {"k": np.array([72.0])})
    scene.solve()
    assert scene.objective({"member_force": {"group": "g"}}, "max")[0] == pytest.approx(72.0 / 6.0, rel=1e-10)


def test_integrals_know_the_kinks_of_what_they_integrate(monkeypatch):
    """Where another component becomes the largest, and where one leads only briefly between two looks."""
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.hunt_reductions import integral, kinks

    def look(t):
        return np.array([1.0 - 0.5 * (t - 0.5031) ** 2, 1.0 - 1e-6 + 3.0 * (t - 0.5031), -0.2])

    def brief(t):
        return np.array([1.0, 1.0 + 1e-6 - 4.0 * (t - 0.50312) ** 2])

    grid = np.linspace(0.0, 1.0, 101)
    cuts = kinks(look, grid, np.array([look(t) for t in grid]), True)
    assert len(cuts) == 1
    assert look(cuts[0])[0] == pytest.approx(look(cuts[0])[1], abs=1e-13)
    cuts = sorted(kinks(brief, grid, np.array([brief(t) for t in grid]), True))
    half = math.sqrt(1e-6 / 4.0)
    assert cuts == pytest.approx([0.50312 - half, 0.50312 + half], abs=1e-10)
    found = integral(lambda t: float(brief(t).max()), [0.0, *cuts, 1.0])
    assert found - 1.0 == pytest.approx(4.0 / 3.0 * 1e-6 * half, rel=1e-3)


def hanging(joint, velocity=(0.0, 0.0), spin=0.0):
    body = {"mass": 2.0, "inertia": 0.5, "position": [0.0, -1.0], "velocity": list(velocity), "angular_velocity": spin}
    return {
        "gravity": [0.0, -9.81],
        "time": {"end": 1.0},
        "bodies": {"a": body},
        "members": {},
        "design": {"power": 1},
        "joints": [{"name": "j", "bodies": ["ground", "a"], **joint}],
    }


def test_a_pendulum_keeps_its_energy_and_pulls_with_weight_and_centripetal_force(model):
    """At the lowest point the pivot carries m g + m w^2 r, and (m r^2 + J) w^2 / 2 = m g r (1 - cos) on the way up."""
    w = 1.5
    scene = model(hanging({"type": "revolute", "at": [0.0, 0.0]}, (w, 0.0), w), ())
    pull = scene.objective({"joint_force": {"joint": "j"}}, "max")[0]
    assert pull == pytest.approx(2.0 * 9.81 + 2.0 * w * w, rel=1e-9)
    highest = scene.objective({"angle": {"body": "a"}}, "max_abs")[0]
    assert 2.0 * 9.81 * (1.0 - math.cos(highest)) == pytest.approx(0.5 * 2.5 * w * w, rel=1e-9)


def test_a_link_and_a_slide_carry_what_is_theirs(model):
    link = model(hanging({"type": "distance", "at": [[0.0, 0.0], [0.0, -1.0]]}), ())
    assert link.objective({"joint_force": {"joint": "j"}}, "mean")[0] == pytest.approx(2.0 * 9.81, rel=1e-10)
    slope = {"type": "prismatic", "at": [0.0, -1.0], "axis": [1.0, 1.0]}
    slide = model(hanging(slope), ())
    place = {"displacement": {"body": "a", "at": [0.0, -1.0]}}
    assert slide.objective(place, "final")[0] == pytest.approx(0.5 * 9.81 / math.sqrt(2.0), rel=1e-10)


def test_an_inerter_and_a_driven_body_share_the_acceleration(model):
    """A driven body pulls another by an inerter b alone: m a = b (a_driven - a)."""

    def body(x):
        return {"mass": 2.0, "inertia": 1.0, "position": [x, 0.0], "velocity": [0.0, 0.0], "angular_velocity": 0.0}

    table = lambda level: {"acceleration": {"table": [[0.0, level], [1.0, level]]}}  # noqa: E731
    scene = model(
        {
            "gravity": [0.0, 0.0],
            "time": {"end": 1.0},
            "bodies": {"a": body(0.0), "b": body(3.0)},
            "points": {
                "p": {"body": "a", "grid": {"list": [[0.0, 0.0]]}},
                "q": {"body": "b", "grid": {"list": [[3.0, 0.0]]}},
            },
            "members": {"g": {"from": "p", "to": "q", "law": {"type": "inerter", "inertance": 6.0}}},
            "design": {"power": 1},
            "motions": [{"body": "a", "x": table(2.0), "y": table(0.0), "angle": table(0.0)}],
        },
        (0.5,),
    )
    acceleration = {"acceleration": {"body": "b", "at": [3.0, 0.0]}}
    assert scene.objective(acceleration, "final")[0] == pytest.approx(3.0 * 2.0 / 5.0, rel=1e-9)
    assert scene.objective({"member_force": {"group": "g"}}, "mean")[0] == pytest.approx(2.4, rel=1e-9)


def values(document):
    """Of a scene's variables, one for each member: those that the laws have."""
    return {
        name: np.full(9, document["members"][row["group"]]["law"][row["parameter"]])
        for name, row in document["design"].get("variables", {}).items()
    }


@pytest.mark.parametrize("seed", [1, 4, 10, 209])
def test_a_scene_written_in_another_way_is_the_same_to_the_second_model(model, seed):
    from benchmarks.hunt_scenes import CHANGES, scene

    document = scene(seed)
    count = sum(len(document["points"][group["from"]]["grid"]["list"]) for group in document["members"].values())
    alpha = np.linspace(0.5, 1.0, count)
    places = model(document, alpha, values(document)).pieces[-1](0.8)
    for change in CHANGES.values():
        again = model(scene(seed, change), alpha, values(scene(seed, change))).pieces[-1](0.8)
        for at in range(0, len(places) // 2, 3):
            assert again[at : at + 2] == pytest.approx(change.point(*places[at : at + 2]), abs=1e-9)


def test_a_vector_that_passes_zero_is_seen_to_be_zero_there(monkeypatch):
    """A search for the lowest length knows the time to half the digits: 1e-8 of an acceleration were taken for true."""
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.hunt_reductions import kinks

    way = np.array([0.7, -0.4])

    def look(t):
        return way * np.sin(3.0 * (t - 0.3137))

    grid = np.linspace(0.0, 0.8, 41)
    (t,) = kinks(look, grid, np.array([look(each) for each in grid]), False)
    assert np.linalg.norm(look(t)) < 1e-14
