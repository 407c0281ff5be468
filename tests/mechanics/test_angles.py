"""Cosine and sine of angles against series of many digits."""

from decimal import Decimal, localcontext

import numpy as np
import pytest

from mdstopo.compiler.jit import entry
from mdstopo.mechanics.angles import FAR, QUARTER, cos_sin

PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459")


@entry
def both(angles, out):
    """cos and sin of every angle."""
    for i in range(angles.shape[0]):
        out[i, 0], out[i, 1] = cos_sin(angles[i])


def exact(angle):
    """cos and sin, from their series at the angle less whole turns."""
    turns = (angle / (2 * PI)).to_integral_value()
    x, term, sums = angle - turns * 2 * PI, Decimal(1), [Decimal(0)] * 2
    for k in range(60):
        sums[k % 2] += term * (-1) ** (k // 2)
        term *= x / (k + 1)
    return sums


@pytest.mark.parametrize("size", [1e-9, 1.0, 10.0, 1e3, FAR])
def test_they_are_right_to_rounding(size):
    rng = np.random.default_rng(3)
    quarters = np.rint(np.linspace(-size, size, 9)) * (np.pi / 2) * np.array([1, 1 + 1e-15, 1 - 1e-9] * 3)
    angles = np.concatenate([rng.uniform(-size, size, 300), np.clip(quarters, -size, size), [size, -size, 0.0]])
    found = np.zeros((len(angles), 2))
    both(angles, found)
    with localcontext() as context:
        context.prec = 60
        for angle, own in zip(angles.tolist(), found, strict=True):
            for value, right in zip(own.tolist(), exact(Decimal(angle)), strict=True):
                assert abs(Decimal(value) - right) <= 3 * Decimal(float(np.spacing(abs(float(right)))))


def test_a_quarter_turn_is_whole_in_its_parts():
    with localcontext() as context:
        context.prec = 60
        assert abs(sum(map(Decimal, QUARTER)) - PI / 2) < Decimal("1e-36")
    for each in QUARTER[:2]:  # so few digits that products with whole numbers of quarter turns are exact
        mantissa = int(np.frexp(each)[0] * 2**53)
        assert mantissa % 2 ** (53 - 33) == 0
        assert FAR / QUARTER[0] < 2 ** (53 - 33)


def test_what_is_far_or_no_angle_is_left_to_the_library():
    angles = np.array([1e7, -3e12, 1.0000001 * FAR, np.nan, np.inf])
    found = np.zeros((5, 2))
    both(angles, found)
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(found, np.stack([np.cos(angles), np.sin(angles)], axis=1))
