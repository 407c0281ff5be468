"""The cargo on a ship's deck: the Code's own example, the ship's motion, and the hand calculation of the designs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.forces import whole_forces
from benchmarks.motions import SHIPS
from benchmarks.scenes import CASES
from benchmarks.securing import (
    ANGLED,
    BASIC,
    MSL,
    PLAIN,
    UNIT,
    VOYAGE,
    Lashing,
    against_tipping,
    athwart,
    external_forces,
    factor_of,
    lashings_of,
    lengthwise,
)
from mdstopo import Case, evaluate, load_case
from mdstopo.case.model import ResponseRow
from mdstopo.store.design_files import read_design


def case_of(**overrides: object) -> Case:
    return load_case(CASES / "cargo.yaml", overrides=overrides)


def lashing(vertical: float, side: int, strength: float = MSL / PLAIN) -> Lashing:
    """Athwart, from the upper edge of the cargo, at a vertical angle in degrees."""
    far = UNIT.height / math.tan(math.radians(vertical))
    half = 0.5 * UNIT.width
    return Lashing(strength, (0.0, side * half, UNIT.height), (0.0, side * (half + far), 0.0))


# The Code's example 1 of Appendix 1.


def test_the_external_forces_of_the_codes_example() -> None:
    assert VOYAGE.factor() == 0.89
    assert [round(each) for each in external_forces(VOYAGE, UNIT)] == [184, 384, 342]


def test_the_factors_of_its_lashings() -> None:
    assert [round(factor_of(math.radians(angle), 0.3), 2) for angle in (40, 10)] == [0.96, 1.04]


def test_the_capacity_of_either_side() -> None:
    # the Code rounds its factors to two digits first, which is worth half a kilonewton
    starboard = [lashing(40, -1)] * 4
    port = [lashing(40, 1)] * 2 + [lashing(10, 1)] * 2
    assert athwart(UNIT, starboard + port, -1) == pytest.approx(412, abs=1)
    assert athwart(UNIT, starboard + port, 1) == pytest.approx(422, abs=1)


def test_the_moments_without_any_lashing() -> None:
    assert round(external_forces(VOYAGE, UNIT)[1] * UNIT.arm) == 691
    assert round(against_tipping(UNIT, [], 1)) == 1216


def test_a_stiff_ship_is_refused() -> None:
    with pytest.raises(ValueError, match="table 4 of the Annex"):
        replace(VOYAGE, gm=2.0).factor()


# What the example does not say.


def test_lashings_hold_at_their_own_side_and_end_only() -> None:
    one = Lashing(100.0, (1.0, 2.0, 2.0), (2.0, 4.0, 0.0))
    friction = UNIT.friction * UNIT.mass * 9.81
    assert athwart(UNIT, [one], -1) == pytest.approx(friction)
    assert lengthwise(UNIT, [one], -1, 0.0) == pytest.approx(friction)
    assert athwart(UNIT, [one], 1) > friction
    assert lengthwise(UNIT, [one], 1, 100.0) == pytest.approx(lengthwise(UNIT, [one], 1, 0.0) - 30.0)


def test_factors_and_lever_are_those_of_the_force_of_a_lashing() -> None:
    """The parts of its force, its friction, and its moment about the lower edge, by vectors."""
    one = Lashing(100.0, (1.0, 2.0, 2.0), (2.5, 4.0, 0.0))
    x, y, z = 100.0 * one.along()
    held = athwart(UNIT, [one], 1), lengthwise(UNIT, [one], 1, 0.0)
    weight = UNIT.friction * UNIT.mass * 9.81
    assert held[0] - weight == pytest.approx(y - UNIT.friction * z)
    assert held[1] - weight == pytest.approx(x - UNIT.friction * z)
    edge = np.array([0.0, -0.5 * UNIT.width, 0.0])
    moment = np.cross(np.subtract(one.lug, edge), (x, y, z))[0]
    assert 100.0 * one.lever(UNIT) == pytest.approx(-moment)


# The ship of the case.


def specific_force(name: str, end: float) -> np.ndarray:
    """(T, 3): what acts on the cargo's centre besides its weight, by mass, along the deck's axes."""
    times = np.linspace(0.0, end, 6001)
    q = np.array([SHIPS[name].moved(t) for t in times])
    turned = Rotation.from_euler("xyz", q[:, 3:])
    place = q[:, :3] + turned.apply([0.0, 0.0, 2.0])
    acceleration = (place[2:] - 2.0 * place[1:-1] + place[:-2]) / times[1] ** 2
    weight = np.array([0.0, 0.0, 9.81])
    return np.asarray(turned[1:-1].inv().apply(acceleration + weight) - weight)


def test_the_ship_has_the_accelerations_of_the_code_at_the_cargo() -> None:
    x, y, z = (VOYAGE.factor() * each for each in BASIC)
    case = case_of()
    rolling, pitching = (specific_force(name, case.load_case(name).end) for name in ("rolling", "pitching"))
    assert np.abs(rolling[:, 1]).max() == pytest.approx(y, rel=0.01)
    assert pitching[:, 0].max() == pytest.approx(x, rel=0.01)
    assert -pitching[:, 2].min() == pytest.approx(z, rel=0.01)


def test_the_cargo_of_the_case_is_that_of_the_code() -> None:
    case = case_of()
    cargo = case.body("cargo")
    assert cargo.mass == 1000.0 * UNIT.mass
    sides = np.square([UNIT.length, UNIT.width, UNIT.height])
    assert np.allclose(np.diag(cargo.inertia), cargo.mass / 12.0 * (sides.sum() - sides), rtol=1e-5)
    assert case.contacts[0].friction == UNIT.friction
    weight = len(case.contacts[0].points) * case.contacts[0].stiffness * 0.0050685
    assert weight == pytest.approx(cargo.mass * 9.81, rel=1e-6)


# The designs.


@pytest.mark.parametrize("design", ["cargo", "cargo-hand"])
def test_the_code_accepts_the_design(design: str) -> None:
    case = case_of()
    chains = lashings_of(case, read_design(CASES / "designs" / f"{design}.txt", case.n_design))
    assert sum(each.strength for each in chains) == pytest.approx(14 * MSL / ANGLED, rel=0.01)
    x, y, z = external_forces(VOYAGE, UNIT)
    for side in (1, -1):
        assert athwart(UNIT, chains, side) > y
        assert lengthwise(UNIT, chains, side, z) > x
        assert against_tipping(UNIT, chains, side) > y * UNIT.arm


def test_forces_written_out_again_agree_with_the_response_in_space() -> None:
    case = case_of()
    design = read_design(CASES / "designs" / "cargo.txt", case.n_design)
    found = evaluate(case, design, gradient=False)
    group = next(each for each in case.design_groups if each.name == "side_fore_port")
    own = whole_forces(case, design, group, "rolling") * design[case.group_slices[group.name]]
    limits = [(i, row) for i, row in enumerate(case.constraints) if isinstance(row, ResponseRow)]
    (i,) = (i for i, row in limits if row.response.group == group.name)
    assert own.max() == pytest.approx(found.constraints[i] + case.constraints[i].bound, rel=1e-3)
