"""How numbers enter the scene: what is differentiated exactly, what by differences, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from mdstopo.case.objects.fitting import Estimate, FitNumber
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.fit.numbers import Numbers

from .scenes import DROP

SCENE = (
    DROP.replace("define: {v: 1}", "define: {v: 1, k: 30, m: 5}")
    .replace("{mass: 5,", '{mass: "=m",')
    .replace("stiffness: 8000,", 'stiffness: "=k^2 * 10",')
)


def numbers(text: str, **bounds: tuple[float, float]) -> Numbers:
    case = read_case(text)
    built = [FitNumber(key, Estimate(0.5 * (low + high), low, high)) for key, (low, high) in bounds.items()]
    return Numbers(case, built)


@pytest.mark.parametrize(
    ("key", "bounds", "effect", "derivative"),
    [
        ("members.foam.law.stiffness", (1e3, 1e4), "", "exact"),
        ("define.k", (10.0, 50.0), "", "exact"),
        ("define.m", (2.0, 8.0), "balance", "exact"),
        ("define.v", (0.0, 2.0), "balance", "exact"),
        ("bodies.block.mass", (2.0, 8.0), "balance", "exact"),
        ("bodies.block.inertia", (0.05, 0.2), "balance", "exact"),
        ("bodies.block.velocity[0]", (-1.0, 1.0), "balance", "exact"),
        ("bodies.block.angular_velocity", (-1.0, 1.0), "balance", "exact"),
        ("gravity[1]", (-10.0, -9.0), "balance", "exact"),
        ("members.foam.to.at[1]", (-0.1, 0.1), "anything", "differences"),
        ("bodies.block.position[0]", (-0.1, 0.1), "anything", "differences"),
    ],
)
def test_a_number_is_differentiated_as_what_follows_from_it_allows(
    key: str, bounds: tuple[float, float], effect: str, derivative: str
) -> None:
    found = numbers(SCENE, **{key: bounds})
    assert found.effects == (effect,)
    assert found.derivatives == (derivative,)


def test_parameters_in_a_straight_line_need_no_reading() -> None:
    found = numbers(SCENE, **{"members.foam.law.stiffness": (1e3, 1e4), "members.foam.law.gap": (0.01, 0.1)})
    assert found.straight is not None
    x = np.array([2e3, 0.03])
    np.testing.assert_allclose(found.values_at(x), found._read(x), rtol=1e-14)
    np.testing.assert_array_equal(np.sort(found.chain(x), axis=None), [0.0, 0.0, 1.0, 1.0])


def test_a_parameter_that_is_no_straight_line_is_differentiated_by_its_formula() -> None:
    found = numbers(SCENE, **{"define.k": (10.0, 50.0)})
    assert found.straight is None
    x = np.array([20.0])
    np.testing.assert_allclose(found.values_at(x), [4000.0])
    np.testing.assert_allclose(found.chain(x), [[400.0]], rtol=1e-14)
    # at a bound, from one side
    np.testing.assert_allclose(found.chain(np.array([10.0])), [[200.0]], rtol=1e-14)


def test_a_bound_that_the_case_does_not_allow_is_refused_at_its_key() -> None:
    text = DROP.replace("stiffness: {lower: 1000", "stiffness: {lower: -1000")
    case = read_case(text)
    assert case.fit is not None
    with pytest.raises(CaseError) as caught:
        Numbers(case, case.fit.numbers)
    (mistake,) = caught.value.mistakes
    assert mistake.path_key == "fit.estimate.'members.foam.law.stiffness'"
    assert "at -1000: found -1000.0, allowed is a number >" in mistake.message
    assert text.splitlines()[mistake.line - 1].strip().startswith("members.foam.law.stiffness")


def test_the_initial_value_of_a_design_variable_is_what_is_simulated() -> None:
    text = DROP.replace(
        "fit:", "design: {variables: {c: {group: foam, parameter: damping, lower: 1, upper: 90, initial: 33}}}\nfit:"
    ).replace("    members.foam.law.damping: {lower: 0, upper: 200, initial: 40}\n", "")
    case = read_case(text)
    assert case.fit is not None
    found = Numbers(case, case.fit.numbers).case_at(np.array([6000.0, 0.045]))
    assert found.members[0].laws[0].damping == 33.0  # type: ignore[attr-defined]
    assert [each.initial for each in found.variables] == [0.045, 6000.0]


def test_a_parameter_that_is_estimated_itself_does_not_follow_from_a_name() -> None:
    text = SCENE.replace("gap: 0.05", 'gap: "=k^2 / 8000"')
    found = numbers(text, **{"define.k": (10.0, 20.0), "members.foam.law.stiffness": (1e3, 1e4)})
    assert found.straight is None
    chain = dict(zip((name for _, _, name in found.places), found.chain(np.array([20.0, 5e3])), strict=True))
    np.testing.assert_allclose(chain["gap"], [0.005, 0.0], rtol=1e-14)
    np.testing.assert_allclose(chain["stiffness"], [0.0, 1.0], rtol=1e-11)
