"""Exact gradients of every law, joint, response, reduction and integrator, against differences and each other."""

import numpy as np
import pytest

import mdstopo
from tests.general.support import check_adjoint, check_direct, design_of, load

#: scene, solver settings, step of the differences
SCENES = [
    ("loaded_pendulum", {"tolerance": 1e-10}, 1e-4),
    ("everything", {"tolerance": 1e-10}, 3e-5),
    ("bouncing", {"tolerance": 1e-10}, 1e-5),
    ("loaded_pendulum", {"integrator": "generalized_alpha", "step": 0.002}, 1e-5),
    ("everything", {"integrator": "generalized_alpha", "step": 0.002}, 1e-5),
]


def _name(scene):
    return f"{scene[0]}-{scene[1].get('integrator', 'runge_kutta')}"


@pytest.mark.parametrize("scene", SCENES, ids=_name)
def test_the_adjoint_is_the_derivative_of_what_is_computed(scene):
    name, solver, h = scene
    check_adjoint(load(name, **solver), h, 1e-7)


@pytest.mark.parametrize(
    "scene",
    [*SCENES, ("bouncing", {"integrator": "generalized_alpha", "step": 0.002}, 0.0)],
    ids=_name,
)
def test_direct_and_adjoint_agree(scene):
    name, solver, _ = scene
    check_direct(load(name, **solver))


def test_through_events_generalized_alpha_gives_the_gradient_to_its_own_order():
    """The time of an event is differentiated as that of the motion: what is off falls with the square of the step."""
    exact = mdstopo.evaluate(load("bouncing", tolerance=1e-11), design_of(load("bouncing"))).gradients["E"]
    errors = []
    for step in (0.002, 0.001, 0.0005):
        case = load("bouncing", integrator="generalized_alpha", step=step)
        found = mdstopo.evaluate(case, design_of(case)).gradients["E"]
        errors.append(np.abs(found - exact).max() / np.abs(exact).max())
    assert errors[0] < 1e-2
    assert errors[-1] < errors[0] / 8.0
