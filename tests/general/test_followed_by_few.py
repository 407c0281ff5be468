"""Members of a tile that follow from a few: bounds of what all of them do, whatever the few do."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from mdstopo.general.pricing import followed_by_few
from mdstopo.general.pricing.certain_modes import FASTEST, HIGH, LOW, SLOWEST, UNSURE
from mdstopo.general.pricing.sorted_members import CORNERS, SURE
from mdstopo.mechanics.kinematics.kinematics_interface import ELONGATION, RATE
from mdstopo.sensitivity.tile_interpolation import BROAD, COLUMN_NODE, COLUMN_NODES, ROW_NODE, ROW_NODES, SHORT, TALL
from tests.space.in_python import in_python

__all__ = ["in_python"]
#: what rounding is, of values of one or so
ROUNDING = 1e-13


@pytest.fixture
def few(in_python, monkeypatch):
    """A `FewMembers` in Python."""
    fields = followed_by_few.FIELDS
    monkeypatch.setattr(
        followed_by_few, "FewMembers", lambda *arrays: SimpleNamespace(**dict(zip(fields, arrays, strict=True)))
    )
    return followed_by_few.make_few()


def numbers_with(gap, count, at):
    """Numbers of so many points, of which none are there between two."""
    numbers = np.arange(float(count))
    numbers[at:] += gap
    return numbers


def polynomials(numbers, nodes):
    """(places, nodes): those that are 1 at one node and 0 at the others, by another way than the kernels'."""
    return BarycentricInterpolator(numbers[nodes], np.eye(len(nodes)))(numbers)


def farthest(shares):
    """Values at nodes, 0 at the first and the last and 1 in magnitude at others, that go as far as any between them."""
    values = np.sign(shares[np.abs(shares[:, 1:-1]).sum(axis=1).argmax()])
    values[[0, -1]] = 0.0
    return values


@pytest.mark.parametrize("gap", [0, 10])
@pytest.mark.parametrize("tried", range(len(ROW_NODES)))
@pytest.mark.parametrize("level", [0, 3])
def test_elongations_and_rates_of_all_members_are_within_the_bounds_of_their_row_and_of_the_part(
    few, level, tried, gap
):
    rng = np.random.default_rng(level + 10 * tried)
    size = BROAD >> level
    row_numbers, column_numbers = numbers_with(gap, TALL, 7), numbers_with(gap * size // TALL, size, size // 2)
    followed_by_few._fill_columns(column_numbers, 0, level, few)
    followed_by_few._fill_rows(row_numbers, 0, TALL, tried, few)
    by_rows = polynomials(row_numbers, ROW_NODE[tried, : ROW_NODES[tried]])
    by_columns = polynomials(column_numbers, COLUMN_NODE[level])
    sets = rng.uniform(-0.1, 0.1, (TALL, size))
    few.sets[:, 0], few.sets[:, 1] = sets.min(axis=1), sets.max(axis=1)
    count = len(by_rows.T) * COLUMN_NODES
    # one node has what goes farthest, others anything
    values = rng.uniform(-0.1, 0.1, (len(few.works), 2, count))
    values[1] = np.outer(farthest(by_rows), farthest(by_columns)).ravel() * np.array([[1.0], [-1.0]])
    few.works[:, [ELONGATION, RATE], :count] = values
    followed_by_few._bound_all(few)
    followed_by_few._move_rows(TALL, few)
    for m in range(1, len(values)):
        x, rate = (by_rows @ own.reshape(-1, COLUMN_NODES) @ by_columns.T for own in values[m])
        for box in (few.box, few.part_box[None]):
            assert ((box[:, LOW, None] - ROUNDING <= x - sets) & (x - sets <= box[:, HIGH, None] + ROUNDING)).all()
            assert ((box[:, SLOWEST, None] - ROUNDING <= rate) & (rate <= box[:, FASTEST, None] + ROUNDING)).all()


def test_bounds_of_members_whose_elongations_are_linear_in_both_points_are_those_at_the_corners(few):
    rows, columns = np.arange(float(TALL)), np.arange(float(BROAD))
    followed_by_few._fill_columns(columns, 0, 0, few)
    followed_by_few._fill_rows(rows, 0, TALL, 0, few)
    few.sets[:] = np.sort(np.random.default_rng(2).uniform(-0.1, 0.1, (TALL, 2)), axis=1)
    x = 1e-3 * rows[:, None] - 2e-3 * columns + 1e-5 * rows[:, None] * columns
    own = x[np.ix_(ROW_NODE[0, : ROW_NODES[0]], COLUMN_NODE[0])]
    few.works[:, [ELONGATION, RATE], : own.size] = own.ravel()
    followed_by_few._bound_all(few)
    followed_by_few._move_rows(TALL, few)
    for box, each, sets in ((few.box, x, few.sets), (few.part_box[None], x.reshape(1, -1), few.sets.reshape(1, -1))):
        low, high = each.min(axis=1), each.max(axis=1)
        expected = np.transpose([low - sets.max(axis=1), high - sets.min(axis=1), low, high])
        assert np.abs(box - expected).max() <= ROUNDING


@pytest.mark.parametrize("bend", [0.0, 2e-3], ids=["on a line", "bent"])
@pytest.mark.parametrize("level", [0, 2])
def test_groups_of_columns_that_stay_by_bounds_have_no_member_that_leaves_its_mode(few, level, bend):
    rng = np.random.default_rng(level)
    size = BROAD >> level
    columns = np.arange(float(size))
    followed_by_few._fill_columns(columns, 0, level, few)
    followed_by_few._fill_rows(np.arange(float(TALL)), 0, TALL, 0, few)
    share, off = np.arange(TALL)[:, None] / (TALL - 1), 2.0 * columns / (size - 1) - 1.0
    sets = 1e-3 * rng.uniform(size=(TALL, size))
    groups = sets.reshape(TALL, -1, SHORT)
    few.group_set[:, 0, : size // SHORT], few.group_set[:, 1, : size // SHORT] = groups.min(axis=2), groups.max(axis=2)
    few.group_mode[:] = np.where(rng.uniform(size=few.group_mode.shape) < 0.2, UNSURE, 1)
    # elongations and rates go through zero somewhere in most rows, elsewhere at each node of the step
    motion = 0.05 * (off * size / BROAD + 1.6 * share - 0.8) + bend * off**2 + 4e-3 * np.arange(6)[:, None, None]
    values = motion[:, ROW_NODE[0, : ROW_NODES[0]]][..., COLUMN_NODE[level]].reshape(6, 1, -1)
    few.works[:, [ELONGATION, RATE], : values.shape[2]] = values
    followed_by_few._move_rows(TALL, few)
    # the lesser of elongation and of what is left of rate, above zero
    tangent = np.zeros((1, CORNERS, 3))
    tangent[0, ::2], tangent[0, 1::2] = [0.0, 1.0, 0.0], [0.06, 0.0, -1.0]
    sorting = SimpleNamespace(tangent=tangent, tried=np.array([1]))
    margin = np.minimum(motion - sets, 0.06 - motion)[1:].min(axis=0).reshape(TALL, -1, SHORT).min(axis=2)
    sure = [
        [followed_by_few._sure_groups(a, 1, few, sorting) >> g & 1 for g in range(size // SHORT)] for a in range(TALL)
    ]
    sure, alike = np.array(sure) == 1, few.group_mode[:, : size // SHORT] == 1
    assert 0 < sure.sum() < (margin > SURE).sum() < sure.size
    assert not (sure & ((margin <= SURE) | ~alike)).any()
    # bounds are too low by the range of sets and by what a row may be off its line
    assert sure[alike & (margin > 1e-3 + (1.0 + few.between[followed_by_few.BY_COLUMNS]) * bend)].all()
