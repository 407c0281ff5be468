"""Members that hardly stretch, against closed forms: elongations come from what bodies have moved since the start.

Loads that begin at once on springs as long as at the start: a linear oscillator, whose peak is twice the static
deflection.
"""

import numpy as np
import pytest

from mdstopo.engine import Evaluator
from tests.engine.scenes import read

STIFFNESS, MASS, INERTIA = 1e8, 2.0, 0.3
#: how far from the origin, and the largest elongation; members are 1 m long
PLACES = pytest.mark.parametrize(("far", "elongation"), [(0.0, 1e-8), (1e4, 1e-4), (1e6, 1e-8), (-1e4, 1e-10)])
ADAPTIVE = pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])


def at(far, *place):
    return [far + place[0], 3.0 * far + place[1]]


def held(far, elongation, slide, angle=0.6, joint=False, response="energy"):
    """A mass on a member at an angle, and on a slide or a member that keep it there; pulled along the member."""
    c, s = np.cos(slide), np.sin(slide)
    force = 0.5 * elongation * STIFFNESS
    scene = {
        "time": {"end": float(3.0 * np.pi / np.sqrt(STIFFNESS / MASS))},
        "bodies": {"mass": {"mass": MASS, "inertia": INERTIA, "position": at(far, c, s), "angle": angle}},
        "members": {
            "rod": {
                "from": {"body": "ground", "at": at(far, 0.0, 0.0)}, "to": {"body": "mass", "at": at(far, c, s)},
                "law": {"type": "spring", "stiffness": STIFFNESS},
            },
        },
        "loads": [{"body": "mass", "force": [float(force * c), float(force * s)]}],
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": response, "over_time": "max"}},
    }  # fmt: skip
    if joint:
        slider = {"type": "prismatic", "bodies": ["ground", "mass"], "at": at(far, 0.0, 0.0)}
        scene["joints"] = [{**slider, "axis": [float(c), float(s)]}]
    return scene


def lever(far, elongation, response="energy"):
    """A body on a pin, and a member across at its end; a moment turns it. Far off, along the axes (`held`)."""
    angle, reach = 0.7, 1.5
    axis = np.exp(1j * angle) if far == 0.0 else 1.0 + 0.0j
    across = 1j * axis
    centre, end, foot = (at(far, z.real, z.imag) for z in (0.5 * axis, reach * axis, reach * axis - across))
    moment = 0.5 * elongation * STIFFNESS * reach
    rate = np.sqrt(STIFFNESS * reach**2 / (INERTIA + MASS * 0.25))
    return {
        "time": {"end": float(3.0 * np.pi / rate)},
        "bodies": {"arm": {"mass": MASS, "inertia": INERTIA, "position": centre, "angle": angle}},
        "joints": [{"type": "revolute", "bodies": ["ground", "arm"], "at": at(far, 0.0, 0.0)}],
        "members": {
            "rod": {
                "from": {"body": "ground", "at": foot}, "to": {"body": "arm", "at": end},
                "law": {"type": "spring", "stiffness": STIFFNESS},
            },
        },
        "loads": [{"body": "arm", "moment": float(moment)}],
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": response, "over_time": "max"}},
    }  # fmt: skip


def check(scene, elongation, bound, **solver):
    """Value, gradient and their estimates; peak energy and force are 2 F^2/(k alpha) and 2 F."""
    evaluator = Evaluator(read(scene, **solver))
    design = np.ones(1)
    found = evaluator.with_errors(design, evaluator.evaluate(design))
    assert found.status.ok, found.message
    force = scene["objectives"]["G"]["response"] != "energy"
    peak = STIFFNESS * elongation
    value = peak if force else 0.5 * peak * elongation
    slope = 0.0 if force else -value
    error = found.errors["G"]
    off, tilted = abs(found.objectives["G"] - value), float(np.abs(found.gradients["G"] - slope).max())
    assert off <= bound * value
    assert tilted <= 10.0 * bound * value
    # an estimate of rounding is a draw: most are within a factor of ten, and none may be below a hundredth
    assert off <= 100.0 * error.value + 1e-13 * value
    assert tilted <= 100.0 * error.gradient + 1e-12 * value
    assert error.value <= 100.0 * bound * value


@PLACES
@ADAPTIVE
def test_a_mass_on_a_stiff_member(far, elongation, integrator):
    # off the axes coordinates of the ends are rounded, so the member pulls beside its centre by some eps X
    slide = 0.0 if far else 0.4
    check(held(far, elongation, slide), elongation, 1e-11, integrator=integrator, tolerance=1e-11)


@PLACES
@pytest.mark.parametrize("response", ["energy", {"member_force": {"group": "rod"}}])
def test_a_mass_on_a_stiff_member_and_a_slide(far, elongation, response):
    scene = held(far, elongation, 0.4, joint=True, response=response)
    check(scene, elongation, 1e-9, integrator="runge_kutta", tolerance=1e-11)


@pytest.mark.parametrize(("far", "elongation"), [(0.0, 1e-8), (1e4, 1e-7), (1e6, 1e-8), (-1e4, 1e-10)])
@pytest.mark.parametrize("response", ["energy", {"member_force": {"group": "rod"}}])
def test_a_body_that_is_turned_on_a_pin(far, elongation, response):
    check(lever(far, elongation, response), elongation, 1e-9, integrator="runge_kutta", tolerance=1e-11)


@pytest.mark.parametrize("scene", [held, lever])
def test_fixed_steps_find_the_same_at_every_scale(scene):
    """The methods are linear in a linear oscillator: of its energy over the square of the load nothing changes."""

    def relative(far, elongation):
        data = scene(far, elongation, 0.0) if scene is held else scene(far, elongation)
        step = data["time"]["end"] / 300.0
        found = Evaluator(read(data, integrator="generalized_alpha", step=step)).evaluate(np.ones(1))
        assert found.status.ok
        size = 0.5 * STIFFNESS * elongation**2
        return found.objectives["G"] / size, found.gradients["G"][0] / size

    values, slopes = zip(*(relative(*each) for each in ((0.0, 1e-7), (0.0, 1e-9), (1e4, 1e-8))), strict=True)
    assert values[0] == pytest.approx(1.0, abs=1e-3)
    assert values[1:] == pytest.approx([values[0]] * 2, rel=1e-9)
    assert slopes[1:] == pytest.approx([slopes[0]] * 2, rel=1e-8)


@ADAPTIVE
def test_bodies_that_move_together_lose_only_digits_of_what_they_share(integrator):
    """Two masses, pulled apart, while both move by 1 mm: 1e5 elongations."""
    elongation, shift = 1e-8, 1e-3
    end = 3.0 * np.pi / np.sqrt(2.0 * STIFFNESS / MASS)
    speed = float(shift / end)
    body = {"mass": MASS, "inertia": INERTIA, "velocity": [speed, 2.0 * speed]}
    force = 0.5 * elongation * STIFFNESS
    scene = {
        "time": {"end": float(end)},
        "bodies": {"one": {**body, "position": [0.0, 0.0]}, "two": {**body, "position": [1.0, 0.0]}},
        "members": {
            "rod": {
                "from": {"body": "one", "at": [0.0, 0.0]}, "to": {"body": "two", "at": [1.0, 0.0]},
                "law": {"type": "spring", "stiffness": STIFFNESS},
            },
        },
        "loads": [{"body": "one", "force": [-force, 0.0]}, {"body": "two", "force": [force, 0.0]}],
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": "energy", "over_time": "max"}},
    }  # fmt: skip
    check(scene, elongation, 1e-9, integrator=integrator, tolerance=1e-11)


@ADAPTIVE
def test_a_free_length_of_its_own_is_strain_from_the_start(integrator):
    """A mass let go from a member that is longer than its free length by a billionth."""
    strain = 1e-9
    scene = held(0.0, 0.0, 0.0)
    del scene["loads"]
    scene["members"]["rod"]["law"]["free_length"] = 1.0 - strain
    exact = 1.0 - (1.0 - strain)
    found = Evaluator(read(scene, integrator=integrator, tolerance=1e-11)).evaluate(np.ones(1))
    assert found.objectives["G"] == pytest.approx(0.5 * STIFFNESS * exact**2, rel=1e-9)
