"""Where steps have to end for integrals, and what it takes to find out."""

import json

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.general.over_time.nested_rules import nested_rules
from mdstopo.general.over_time.quadrature_breakpoints import halves


def of_gauss(count):
    """Gauss's rule of so many nodes, with a better one."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nested_rules(tuple((nodes + 1) / 2), tuple(weights / 2))


def test_rounding_is_not_halved_on_and_on():
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 1.0, 11)
    found = halves(t, t, lambda places, _: rng.normal(size=(len(places), 1)), of_gauss(5), 1e-9, np.zeros(1))
    assert len(found) < 1000


def test_integrands_are_halved_together_as_each_by_itself():
    t = np.linspace(0.0, 1.0, 6)

    def values(places, *kinks):
        time = (places[:, 0] + places[:, 1]) / 5
        return np.stack([np.hypot(time - kink, 1e-3) for kink in kinks], axis=1)

    def found(*kinks):
        return halves(t, t, lambda places, _: values(places, *kinks), of_gauss(5), 1e-8, np.zeros(len(kinks)))

    both, apart = found(0.31, 0.72), [found(0.31), found(0.72)]
    assert min(map(len, apart)) > 5
    assert set(both) == set(apart[0]) | set(apart[1])


@pytest.mark.parametrize("span", [1e-3, 1.0, 1e3])
def test_what_counts_as_nothing_does_not_depend_on_how_long_the_motion_is(span):
    t = np.linspace(0.0, span, 6)

    def values(places, _):
        return 1e-6 * np.abs((places[:, 0] + places[:, 1]) / 5 - 0.33)[:, None]

    mean = 1e-6 * 0.27
    assert halves(t, t, values, of_gauss(5), 1e-8, np.array([0.5 * mean]))
    assert not halves(t, t, values, of_gauss(5), 1e-8, np.array([2.0 * mean]))


def pendulum(objectives):
    """A pendulum that starts level and pulls at a spring."""
    case = {
        "format": 1, "time": {"end": 2.0}, "gravity": [0, -9.81],
        "bodies": {"pendulum": {"mass": 2, "inertia": 0.1, "position": [0.5, 0]}},
        "joints": [{"type": "revolute", "bodies": ["ground", "pendulum"], "at": [0, 0]}],
        "members": {"spring": {
            "from": {"body": "pendulum", "at": [1, 0]}, "to": {"body": "ground", "at": [1, 1]},
            "law": {"type": "spring", "stiffness": 100.0}}},
        "objectives": objectives,
    }  # fmt: skip
    if len(objectives) > 1:
        case["combine"] = {"weights": dict.fromkeys(objectives, 1.0), "normalize": False}
    return read_case(json.dumps(case))


def test_two_means_take_hardly_more_samples_than_one():
    def samples(*names):
        aims = {
            name: {"response": {"acceleration": {"body": "pendulum", "component": name}}, "over_time": "rms"}
            for name in names
        }
        found = Evaluator(pendulum(aims)).evaluate(np.ones(1), gradient=False)
        assert found.status.ok
        return found.work["sums_of_samples"] / found.work["steps"]

    one, two = samples("x"), samples("x", "y")
    assert two < 1.3 * one
    assert one < 14


def test_values_of_several_responses_at_once_are_those_of_each_by_itself():
    responses = {
        "place": {"displacement": {"body": "pendulum"}},
        "speed": {"velocity": {"body": "pendulum", "component": "y"}},
        "push": {"acceleration": {"body": "pendulum", "component": "x"}},
        "pin": {"joint_force": {"joint": 0}},
        "pull": {"member_force": {"group": "spring"}},
        "store": "energy",
        "sum": {"expression": {"formula": "abs(a) + e", "of": {
            "a": {"angular_velocity": {"body": "pendulum"}}, "e": "energy"}}},
    }  # fmt: skip
    evaluator = Evaluator(pendulum({name: {"response": each} for name, each in responses.items()}))
    assert evaluator.evaluate(np.ones(1)).status.ok
    driver = evaluator.driver("default")
    js = np.arange(len(responses))
    rng = np.random.default_rng(3)
    places = np.column_stack([rng.integers(0, driver.count, 40), rng.uniform(0.0, 1.0, 40)])
    places[:6, 1] = [0.0, 1.0, 0.0, 1.0, 1.0, 0.0]
    for exact in (False, True):
        for some in (js, js[:2], js[2:3]):
            together = driver.values_at(some, places, driver.count, exact=exact)
            apart = [driver.sample_response(int(j), places, exact, driver.count)[2][:, 0] for j in some]
            np.testing.assert_allclose(together.T, apart, rtol=1e-10, atol=1e-10)
