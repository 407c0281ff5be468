"""Subproblems in boxes that are very small beside the rows' levels and vectors, as they are next to an optimum."""

import numpy as np
import pytest
from scipy.optimize import linprog

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import FeasibleSet, subproblem
from mdstopo.optimizer.curvature import Curvature
from mdstopo.optimizer.problem import LinearRows, Sample

N, TIED, BELOW = 6, 3, 6


def norms(rng, level):
    """Rows |v + J d| - c with |v| = 1 in any direction: three at the level, others below it."""
    values = level - np.concatenate([np.zeros(TIED), rng.uniform(0.1, 1.0, BELOW)])
    return values, rng.normal(size=(len(values), N)), rng.normal(size=(len(values), N))


def rows_of(seed):
    rng = np.random.default_rng(seed)
    value, slope, across = norms(rng, 5.0)
    limit, limit_slope, limit_across = norms(rng, 0.0)
    sample = Sample(
        value[0], value, slope, across=across, offset=np.full(len(value), 2.0),
        constraint_rows=limit, constraint_gradients=limit_slope, constraint_across=limit_across,
        constraint_offset=np.full(len(limit), 1.0), constraint_groups=np.zeros(len(limit), dtype=np.int64),
    )  # fmt: skip
    return Bundle.of(sample, np.arange(len(value))), rng.uniform(0.3, 0.7, N)


def least_merit_of_lines(rows, width, penalty):
    """The least decrease of the merit in the box, in its width, were all rows lines: a linear program."""
    slope, base = rows.slopes_at(np.zeros(N)), np.where(rows.group == 0, 5.0, 0.0)
    level = np.eye(2)[rows.group]
    found = linprog(
        [*np.zeros(N), 1.0, penalty], np.column_stack([slope, -level]), (base - rows.values()) / width,
        bounds=[(-1.0, 1.0)] * N + [(None, None), (0.0, None)], method="highs",
    )  # fmt: skip
    assert found.success
    return found.fun


@pytest.mark.parametrize("width", [1e-7, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("seed", range(3))
def test_a_subproblem_in_a_tiny_box_is_solved(width, seed):
    """Norms were kept whole there, and their rounding was more than they change in the box."""
    rows, x = rows_of(seed)
    space = FeasibleSet(np.zeros(N), np.ones(N), LinearRows.none(N), np.ones(N))
    penalty, flat = np.array([3.0]), Curvature.diagonal_of(np.full(N, 1e-3))
    trial = subproblem(rows, x, space, (x - width, x + width), penalty, flat)
    assert trial.solved
    merit = (trial.levels[0] - 5.0 + 3.0 * max(trial.levels[1], 0.0)) / width
    rounding = 1e-15 / width
    assert merit == pytest.approx(least_merit_of_lines(rows, width, 3.0), abs=1e-5 + 20.0 * rounding)
    assert trial.multipliers.shape == (len(rows),)
    assert trial.multipliers[rows.group == 0].sum() == pytest.approx(1.0, abs=1e-6)


def test_rows_that_cannot_be_highest_in_a_box_do_not_matter_there():
    rows, _ = rows_of(0)
    kept, left = rows.relevant(np.full(N, 1e-9))
    assert kept.tolist() == ([True] * TIED + [False] * BELOW) * 2
    assert np.isnan(left.offset).all()
    assert left.values() == pytest.approx(rows.values()[kept], abs=1e-15)
    every, same = rows.relevant(np.full(N, 10.0))
    assert every.all()
    assert np.array_equal(same.slope, rows.slope)
    assert np.array_equal(same.offset, rows.offset)
