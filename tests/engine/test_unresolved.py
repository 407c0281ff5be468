"""Energies that rounding of lengths leaves no digits are refused; small ones and none at all are not."""

import numpy as np
import pytest

from mdstopo import evaluate
from mdstopo.case.reader import read_case
from mdstopo.status import Status
from mdstopo.stress.scene import Scene
from mdstopo.stress.scenes_of_stiffness import chain, modes

INTEGRATORS = pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])


def read(data):
    return read_case(Scene("one", "", data, lambda _: 0.0, bound=0.1).text)


@INTEGRATORS
@pytest.mark.parametrize("apart", [0.0, 1.0])
def test_a_spring_that_stretches_by_a_trillionth_has_its_digits(integrator, apart):
    """1e12 N/m: pulled apart by 1 N it stretches by 1e-12 m, and the bodies have moved by nanometres."""
    found = evaluate(read(chain(1e12, 2e-4, apart, integrator=integrator, tolerance=1e-10)))
    near, elongation = modes(1.0, 1e12, 2e-4, apart)
    assert found.status.ok
    assert found.objectives["G"] == pytest.approx(0.5 * near**2 + 0.5e12 * elongation**2, rel=1e-8)


@INTEGRATORS
def test_a_spring_whose_elongation_is_rounding_is_named(integrator):
    """The same while both bodies fly by 20 m: what they have moved is known to some 1e-15 m."""
    scene = chain(1e12, 2e-4, 1.0, integrator=integrator, tolerance=1e-8)
    for body in scene["bodies"].values():
        body["velocity"] = [0.0, 1e5]
    del scene["members"]["soft"]
    found = evaluate(read(scene))
    assert found.status is Status.UNRESOLVED
    assert "member 0 of group stiff" in found.message
    assert np.isnan(found.objectives["G"])
    assert found.gradients == {}


@INTEGRATORS
def test_an_elongation_of_a_millionth_of_a_millimetre_is_no_reason_to_refuse(integrator):
    end = 300.0 / np.sqrt(2e12)
    found = evaluate(read(chain(1e12, end, 1e3, integrator=integrator, tolerance=1e-8)))
    assert found.status.ok
    near, elongation = modes(1.0, 1e12, end, 1e3)
    assert found.objectives["G"] == pytest.approx(0.5 * near**2 + 0.5e12 * elongation**2, rel=1e-4)


def tied(stiffness, integrator):
    """Two bodies that fall tied together."""
    body = {"mass": 1.0, "inertia": 1.0}
    ties = {"from": {"body": "a", "at": [0.0, 0.0]}, "to": {"body": "b", "at": [1.3, 0.7]}}
    return {
        "gravity": [1.0, -9.81],
        "time": {"end": 1.0},
        "bodies": {"a": {**body, "position": [0.0, 0.0]}, "b": {**body, "position": [1.3, 0.7]}},
        "members": {"tie": {**ties, "law": {"type": "spring", "stiffness": stiffness}}},
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": "energy", "over_time": "max"}},
        "solver": {"integrator": integrator},
    }


@INTEGRATORS
def test_bodies_that_fall_tied_together_store_nothing_and_are_not_suspected(integrator):
    """However far they fall: what rounding stores stands for nothing."""
    found = evaluate(read(tied(1e4, integrator)))
    assert found.status.ok
    assert abs(found.objectives["G"]) < 1e-18


@INTEGRATORS
def test_where_rounding_makes_stiff_ties_vibrate_nothing_large_is_told(integrator):
    """Roundings of some thousand steps add up to more than one: then it is said that no digit is left."""
    found = evaluate(read(tied(1e8, integrator)))
    assert found.status == Status.UNRESOLVED or abs(found.objectives["G"]) < 1e-15
