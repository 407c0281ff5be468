"""cos - 1 and sin of a turn against series of many digits, which lose none of a small one."""

from decimal import Decimal, localcontext

import numpy as np
import pytest

from mdstopo.mechanics.kinematics.planar_poses import small_turn


def series(angle):
    """cos - 1 and sin."""
    term, sums = Decimal(1), [Decimal(-1), Decimal(0)]
    for k in range(80):
        sums[k % 2] += term * (-1) ** (k // 2)
        term *= angle / (k + 1)
    return sums


@pytest.mark.parametrize("size", [1e-12, 1e-4, 0.5, 3.0, 10.0])
def test_small_turns_keep_their_digits(size):
    angles = size * np.concatenate([np.random.default_rng(3).uniform(-1.0, 1.0, 40), [1.0, -1.0]])
    with localcontext() as context:
        context.prec = 60
        for angle in angles.tolist():
            for value, right in zip(small_turn.py_func(angle), series(Decimal(angle)), strict=True):
                assert abs(Decimal(value) - right) <= 4 * Decimal(float(np.spacing(abs(float(right)))))


def test_no_turn_is_none():
    assert small_turn.py_func(0.0) == (0.0, 0.0)
