"""What moving an end of a member does to its length and to its row: beside differences, in a plane and in space."""

from types import SimpleNamespace

import numpy as np
import pytest

from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from tests.space.in_python import by_numbers, in_python, same, scene, state

__all__ = ["in_python"]


def planar_scene():
    random = np.random.default_rng(7)
    angle = random.normal(size=3)
    home = np.column_stack([random.normal(size=(3, 2)), angle, np.cos(angle), np.sin(angle)])
    member = np.concatenate([random.normal(size=(4, 2)), np.ones((2, 2))])
    return SimpleNamespace(home=home, pair=np.array([[0, 1], [2, 0]]), member=member)


def planar_state():
    return np.random.default_rng(8).normal(size=(3, 9))


def seen(kinematics, model, i, q, v, a):
    """Length, its rate, its second derivative, and the row of member i of pair i."""
    kernels, width = kinematics.kernels, 2 * kinematics.freedoms
    row, other, rates, bias = np.empty(width), np.empty(width), np.empty(width), np.empty(1)
    length = kernels["inerter_row"](model, q, v, i, i, row, bias)
    _, rate = kernels["member_rows"](model, i, i, q, v, other, rates)
    same(row, other)
    each = kinematics.freedoms
    places = np.concatenate([np.arange(each * b, each * (b + 1)) for b in model.pair[i]])
    return np.array([length, rate, bias[0] + row @ a[places], *row])


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("i", [0, 1])
@pytest.mark.parametrize(
    ("kinematics", "make", "moving"), [(PLANAR, planar_scene, planar_state), (SPATIAL, scene, state)]
)
def test_slopes_by_an_end_are_differences(kinematics, make, moving, i, side):
    model, (q, v, a) = make(), moving()
    d = 2 if kinematics is PLANAR else 3
    end = slice(side * d, (side + 1) * d)
    start = model.member[end, i].copy()

    def at(point):
        model.member[end, i] = point
        return seen(kinematics, model, i, q, v, a)

    expected = by_numbers(at, start)
    second = at(start)[2]
    along = np.random.default_rng(9).normal(size=4)
    row = np.empty(2 * kinematics.freedoms)
    found = kinematics.kernels["end_slopes"](model, i, i, side, along, q, v, a, row)
    same([*found[:3], *row], expected @ along[:d], 1e-8)
    same(found[3], second)


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("kinematics", [PLANAR, SPATIAL])
def test_a_member_without_length_has_no_slopes(kinematics):
    d = 2 if kinematics is PLANAR else 3
    home = np.zeros((2, 21))
    home[:, 3] = 1.0
    if kinematics is SPATIAL:
        home[:, 3:12] = home[:, 12:21] = np.eye(3).ravel()
    model = SimpleNamespace(home=home, pair=np.array([[0, 1]]), member=np.zeros((2 * d + 2, 1)))
    q, v = np.tile(kinematics.at_home, 2), np.ones(2 * kinematics.freedoms)
    row = np.ones(2 * kinematics.freedoms)
    assert kinematics.kernels["end_slopes"](model, 0, 0, 1, np.ones(4), q, v, v, row) == (0.0, 0.0, 0.0, 0.0)
    assert not row.any()
