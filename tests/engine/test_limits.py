"""Where the engine has to say no, or look closer: fixed steps, fast turns, memory, motions through zero length."""

import numpy as np
import pytest

from mdstopo import evaluate, simulate
from mdstopo.status import Status
from tests.engine.scenes import random_design, random_scene, read, spring_scene

LOADED = {"loads": [{"body": "mass", "force": [30.0, 0.0]}]}


def test_a_fixed_step_that_is_far_too_large_is_refused_with_what_half_of_it_changes():
    case = read(spring_scene(end=30.0, **LOADED), integrator="generalized_alpha", step=2.0)
    found = evaluate(case)
    assert found.status is Status.STEP_TOO_LARGE
    assert "half of 2 s changes the largest " in found.message
    assert not found.gradients
    motion = simulate(case)
    assert motion.status is Status.STEP_TOO_LARGE
    assert motion.t[-1] == 30.0


@pytest.mark.parametrize("step", [0.05, 0.01])  # a half and a tenth of a radian
def test_a_fixed_step_that_resolves_the_motion_is_taken_at_its_word(step):
    case = read(spring_scene(end=3.0, **LOADED), integrator="generalized_alpha", step=step)
    assert evaluate(case).status.ok
    assert simulate(case).status.ok


def test_fixed_windows_are_solved_where_rounding_of_the_positions_is_all_that_is_left():
    # the bodies stand far from the origin for what they move by in a window: iterations go on and on at that rounding
    scene = random_scene(25, "free_length", "jumps", "power", "preload", "reversed", bodies=9)
    step = (scene["time"]["end"] - 0.05) / 300
    case = read(scene, integrator="gauss", step=step)
    design = random_design(case, 1025)
    found = evaluate(case, design)
    assert found.status.ok, found.message
    exact = evaluate(read(scene, integrator="runge_kutta", tolerance=1e-11), design)
    assert found.objectives["G"] == pytest.approx(exact.objectives["G"], rel=1e-9)
    slope = exact.gradients["G"]
    assert np.abs(found.gradients["G"] - slope).max() <= 1e-8 * np.abs(slope).max()


def test_fixed_steps_that_damp_out_a_fast_vibration_are_not_suspected():
    scene = spring_scene(end=3.0, **LOADED)
    scene["bodies"]["tip"] = {"mass": 1.0, "inertia": 1.0, "position": [2.0, 0.0]}
    scene["members"]["stiff"] = {
        "from": {"body": "mass", "at": [1.0, 0.0]}, "to": {"body": "tip", "at": [2.0, 0.0]},
        "law": {"type": "spring", "stiffness": 1e10},
    }  # fmt: skip
    assert simulate(read(scene, integrator="generalized_alpha", step=0.01)).status.ok


def rotor(driven, over_time, **solver):
    """A rotor at 100 rad/s, too heavy to feel the spring off its centre, in 20 turns."""
    scene = {
        "time": {"end": 20 * 2 * np.pi / 100.0},
        "bodies": {"rotor": {"mass": 1e12, "inertia": 1e12, "position": [0.0, 0.0]}},
        "members": {
            "spring": {
                "from": {"body": "ground", "at": [2.0, 0.0]}, "to": {"body": "rotor", "at": [1.0, 0.0]},
                "law": {"type": "spring", "stiffness": 3.0},
            }
        },
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": "energy", "over_time": over_time}},
    }  # fmt: skip
    if driven:
        rest = {"velocity": 0.0}
        scene["motions"] = [{"body": "rotor", "x": rest, "y": rest, "angle": {"velocity": 100.0}}]
    else:
        scene["bodies"]["rotor"]["angular_velocity"] = 100.0
    return read(scene, **solver)


@pytest.mark.parametrize("over_time", ["mean", "max"])
@pytest.mark.parametrize(("driven", "integrator"), [(True, "runge_kutta"), (False, "runge_kutta"), (False, "gauss")])
def test_what_turns_without_feeling_it_is_looked_at_all_the_way_round(driven, integrator, over_time):
    angle = 2 * np.pi * np.arange(1000) / 1000
    energy = 1.5 * (np.sqrt(5 - 4 * np.cos(angle)) - 1) ** 2
    exact = energy.mean() if over_time == "mean" else 6.0
    found = evaluate(rotor(driven, over_time, integrator=integrator, tolerance=1e-8))
    assert found.status.ok
    assert found.objectives["G"] == pytest.approx(exact, rel=1e-7)
    assert found.gradients["G"] == pytest.approx([exact], rel=1e-7)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_steps_that_memory_does_not_hold_are_too_many(integrator, monkeypatch):
    monkeypatch.setattr("mdstopo.case.memory.most_floats", lambda: 0)
    found = evaluate(read(spring_scene(end=5000.0, **LOADED), integrator=integrator))
    assert found.status is Status.STEP_LIMIT
    assert "the fastest body is mass" in found.message


def test_a_motion_through_zero_length_under_force_says_so():
    scene = spring_scene(end=1.0)
    scene["bodies"]["mass"]["velocity"] = [-20.0, 0.0]
    for integrator in ("gauss", "runge_kutta", "generalized_alpha"):
        motion = simulate(read(scene, integrator=integrator))
        assert motion.status is Status.ZERO_LENGTH
        assert "group spring" in motion.message


def test_a_narrow_pulse_is_followed_by_fixed_steps():
    law = {"type": "pulse", "peak": 1e5, "rate": 1e10, "time": 0.4}
    scene = spring_scene(end=1.0, objectives={"G": {"response": {"velocity": {"body": "mass"}}, "over_time": "final"}})
    scene["members"]["spring"]["law"] = law
    found = evaluate(read(scene, integrator="generalized_alpha", step=0.01))
    assert found.objectives["G"] == pytest.approx(1e5 * np.sqrt(np.pi / 1e10) / 2.0, rel=1e-4)


def test_compiled_cases_do_not_keep_gigabytes_of_steps(monkeypatch):
    from mdstopo import api

    monkeypatch.setattr(api, "_HELD", 1)
    monkeypatch.setattr(api, "_compiled", type(api._compiled)())
    cases = [read(spring_scene(end=end, **LOADED)) for end in (1.0, 2.0, 3.0)]
    for case in cases:
        assert evaluate(case).status.ok
    assert list(api._compiled) == [id(cases[-1])]
