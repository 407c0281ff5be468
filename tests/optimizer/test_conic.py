"""The subproblem of lines and norms: its optimality conditions, checked by themselves, and closed forms."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from mdstopo.optimizer import reduced
from mdstopo.optimizer.conic import Lines, Norms, Program, solve
from mdstopo.optimizer.curvature import Curvature, learnt
from mdstopo.optimizer.problem import LinearRows
from mdstopo.optimizer.reduced import Curved, Rows
from tests.space.in_python import in_python  # noqa: F401  # a fixture
from tests.tiers import examples as examples_of


def no_lines(n):
    return Lines(np.zeros(0), np.zeros((0, n)), np.zeros(0, dtype=np.int64))


def no_norms(n):
    none = np.zeros((0, n))
    return Norms(np.zeros((0, 2)), none, none, np.zeros(0), np.zeros(0, dtype=np.int64))


def program(n, lines, norms, groups, dense, equal, seed):
    rng = np.random.default_rng(seed)
    directions = np.linalg.qr(rng.normal(size=(n, min(n, 3))))[0]
    weight = rng.uniform(0.1, 2.0, directions.shape[1])
    curvature = Curvature(np.full(n, 0.3), directions, weight)
    if dense:
        curvature = Curvature(np.zeros(n), np.zeros((n, 0)), np.zeros(0), curvature.dense())
    return Program(
        -rng.uniform(0.0, 0.2, n),
        rng.uniform(0.01, 0.2, n),
        Lines(rng.normal(size=lines), rng.normal(size=(lines, n)), rng.integers(0, groups, lines)),
        Norms(
            rng.normal(size=(norms, 2)), rng.normal(size=(norms, n)), rng.normal(size=(norms, n)),
            rng.uniform(0.0, 1.0, norms), rng.integers(0, groups, norms),
        ),
        rng.uniform(0.1, 3.0, groups - 1),
        LinearRows(np.ones((1, n)), np.array([0.0 if equal else 0.05]), np.array([equal])),
        curvature,
    )  # fmt: skip


def values(p, d):
    """The rows' values (K,), their gradients (K, N) and groups at d."""
    vector = p.norms.vector + np.stack([p.norms.slope @ d, p.norms.across @ d], axis=1)
    size = np.hypot(vector[:, 0], vector[:, 1])
    unit = vector / size[:, None]
    norms = unit[:, :1] * p.norms.slope + unit[:, 1:] * p.norms.across
    return (
        np.concatenate([p.lines.value + p.lines.slope @ d, size - p.norms.excess]),
        np.concatenate([p.lines.slope, norms]),
        np.concatenate([p.lines.group, p.norms.group]),
    )


@examples(max_examples=examples_of(15, 40), deadline=None)
@given(
    n=st.integers(1, 60),
    lines=st.integers(1, 20),
    norms=st.integers(0, 20),
    groups=st.integers(1, 4),
    dense=st.booleans(),
    equal=st.booleans(),
    seed=st.integers(0, 10**6),
)
def test_the_solution_meets_its_optimality_conditions(n, lines, norms, groups, dense, equal, seed):
    p = program(n, lines, norms, groups, dense, equal, seed)
    p.lines.group[0] = 0  # an objective has a row at least
    found = solve(p)
    assert found.solved
    d, (level, slope, group) = found.d, values(p, found.d)
    multiplier = np.concatenate([found.lines, found.norms])
    size = max(1.0, float(np.abs(slope).max()))
    assert np.all(d >= p.lower)
    assert np.all(d <= p.upper)
    assert abs(multiplier[group == 0].sum() - 1.0) < 1e-6
    excess = float(p.linear.A[0] @ d - p.linear.b[0])
    assert abs(excess) < 1e-7 if equal else excess < 1e-7
    assert equal or found.linear[0] >= 0.0
    gradient = p.curvature.times(d) + multiplier @ slope + found.linear @ p.linear.A
    vector = p.norms.vector + np.stack([p.norms.slope @ d, p.norms.across @ d], axis=1)
    assume(not np.any((np.hypot(vector[:, 0], vector[:, 1]) < 1e-3) & (found.norms > 1e-9)))  # no gradient there
    inside = (d > p.lower + 1e-6) & (d < p.upper - 1e-6)
    assert np.abs(gradient[inside]).max(initial=0.0) < 1e-5 * size
    assert gradient[d <= p.lower].min(initial=0.0) > -1e-5 * size
    assert gradient[d >= p.upper].max(initial=0.0) < 1e-5 * size
    for j in range(groups):
        mine = group == j
        top = max(level[mine].max(initial=-np.inf), 0.0 if j else -np.inf)
        assert np.abs(multiplier[mine] * (level[mine] - top)).sum() < 1e-6 * size
        if j:
            assert multiplier[mine].sum() <= p.penalty[j - 1] * (1.0 + 1e-6)
            if top > 1e-6:
                assert multiplier[mine].sum() == pytest.approx(p.penalty[j - 1], rel=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_norms_are_solved_as_exactly_as_lines(seed):
    """In a small box many norms are all but lines, and nearly all are active in turn: multipliers of active rows are
    no quotients of rounding. A step that is wrong by 1e-9 of the box hides what the next one could gain."""
    rng = np.random.default_rng(seed)
    n, norms, box = 30, 50, 0.02
    vector = rng.normal(size=(norms, 2))
    vector *= 10.0 / np.hypot(vector[:, 0], vector[:, 1])[:, None] * (1.0 + 0.01 * rng.uniform(size=(norms, 1)))
    group = np.arange(norms) % 2
    p = Program(
        np.full(n, -box), np.full(n, box), no_lines(n),
        Norms(vector, rng.normal(size=(norms, n)), rng.normal(size=(norms, n)), 10.0 * group, group),
        np.array([50.0]), LinearRows(np.ones((1, n)), np.zeros(1), np.array([True])),
        Curvature(np.zeros(n), np.zeros((n, 0)), np.zeros(0), 1e-4 * np.eye(n)),
    )  # fmt: skip
    found = solve(p)
    assert found.solved
    assert found.gap < 1e-11
    assert found.residual < 1e-11


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("n", [20, 60])
def test_multipliers_of_active_rows_are_no_quotients_of_rounding(n):
    """Rows whose slack is all but nothing beside their multiplier meet the first two equations of the linear system,
    whether rows (few variables) or variables (many) are eliminated."""
    rng = np.random.default_rng(1)
    count = 30
    rows = Rows(rng.normal(size=(count, n)), np.arange(count) % 2, np.full(count, -1.0),
                np.where(np.arange(count) < 8, 1e-14, 1e4))  # fmt: skip
    D, E, L, A = 10.0 ** rng.uniform(-8, 8, n), np.ones(1), np.zeros(1), np.ones((1, n))
    factor = rng.normal(size=(2, n))
    P = Curved(np.ones(n), factor, np.array([2.0, 0.5]), np.zeros((0, 0)))
    system, solvable = reduced.factor.py_func(P, D, rows, A, L, E)
    assert solvable
    assert (len(system.inverse) > 0) == (n == 60)
    right = [rng.normal(size=size) for size in (n, 2, count, 1)]
    dv, de, dy, da = step = [np.empty_like(x) for x in right]
    reduced.solve.py_func(system, rows, A, *right, *step)
    C = np.zeros((count, 2))
    C[np.arange(count), rows.level] = rows.C
    size = max(1.0, float(np.abs(dy).max()))
    curved = dv + factor.T @ (P.weight * (factor @ dv))
    assert np.abs(curved + D * dv + rows.G.T @ dy + A.T @ da - right[0]).max() < 1e-9 * size
    assert np.abs(np.array([0.0, 1.0]) * de + C.T @ dy - right[1]).max() < 1e-12 * size
    assert np.abs(rows.G @ dv + C @ de - rows.S * dy - right[2]).max() < 1e-9 * size
    assert np.abs(A @ dv - right[3]).max() < 1e-9 * size


def test_no_solution_lies_outside_the_cones():
    """Where a norm's slack is on the boundary to rounding the next step may leave the cone, at no gap."""
    p = program(4, 4, 4, 1, False, False, 14)
    p.lines.group[0] = 0
    found = solve(p)
    _, slope, _ = values(p, found.d)
    multiplier = np.concatenate([found.lines, found.norms])
    gradient = p.curvature.times(found.d) + multiplier @ slope + found.linear @ p.linear.A
    inside = (found.d > p.lower) & (found.d < p.upper)
    assert inside.any()
    assert np.abs(gradient[inside]).max() < 1e-6


@pytest.mark.parametrize("dense", [False, True])
def test_both_ways_to_the_linear_system_give_one_solution(dense):
    one, other = (solve(program(30, 12, 12, 3, way, False, 5)) for way in (False, True))
    assert np.allclose(one.d, other.d, atol=1e-7)


def test_the_least_norm_is_found_where_it_vanishes():
    """|(1 + d_0, 2 d_1)| is least at d = (-1, 0), where it has a kink."""
    norms = Norms(np.array([[1.0, 0.0]]), np.array([[1.0, 0.0]]), np.array([[0.0, 2.0]]), np.zeros(1), np.array([0]))
    flat = Curvature.diagonal_of(np.full(2, 1e-12))
    found = solve(Program(np.full(2, -2.0), np.full(2, 2.0), no_lines(2), norms, np.zeros(0), LinearRows.none(2), flat))
    assert np.allclose(found.d, [-1.0, 0.0], atol=1e-6)
    assert found.level[0] == pytest.approx(0.0, abs=1e-7)


def test_a_limit_that_cannot_be_kept_costs_its_price():
    """Minimise 0 under 1 + d <= e at d >= -0.4: the violation left is 0.6, its multiplier the penalty."""
    lines = Lines(np.array([0.0, 1.0]), np.array([[0.0], [1.0]]), np.array([0, 1]))
    flat = Curvature.diagonal_of(np.full(1, 1e-9))
    found = solve(
        Program(np.array([-0.4]), np.array([0.4]), lines, no_norms(1), np.array([7.0]), LinearRows.none(1), flat)
    )
    assert found.d[0] == pytest.approx(-0.4, abs=1e-8)
    assert found.level[1] == pytest.approx(0.6, abs=1e-7)
    assert found.lines[1] == pytest.approx(7.0, rel=1e-6)


@pytest.mark.parametrize("n", [5, 300])
def test_curvature_is_learnt_from_steps(n):
    """After steps over a quadratic function B s = y of the last one, B is positive definite, also in compact form."""
    rng = np.random.default_rng(2)
    scale = rng.uniform(0.5, 4.0, n)
    steps = rng.normal(size=(6, n))
    B = learnt(steps, steps * scale, 1e-3)
    assert np.allclose(B.times(steps[-1]), steps[-1] * scale, rtol=1e-8, atol=1e-8)
    assert np.linalg.eigvalsh(B.dense()).min() > 0.0


def test_a_steep_last_step_makes_directions_that_nothing_is_known_of_no_steeper_than_others():
    """Four flat directions are known, then a steep one, a sixth is not: it is not taken for a steep one."""
    scale = np.array([1.0, 1.0, 1.0, 1.0, 1000.0])
    steps = np.eye(6)[:5]
    B = learnt(steps, steps * np.append(scale, 1.0), 1e-3).dense()
    assert B[4, 4] == pytest.approx(1000.0)
    assert np.diag(B)[:4].max() <= 1.0 + 1e-9
    assert np.diag(B)[:4].min() >= 0.2
    assert B[5, 5] <= 5.0


@pytest.mark.parametrize("n", [4, 300])
def test_curvature_stays_positive_where_the_function_bends_down(n):
    rng = np.random.default_rng(3)
    steps = rng.normal(size=(5, n))
    B = learnt(steps, -2.0 * steps, 1e-3)
    assert np.linalg.eigvalsh(B.dense()).min() > -1e-12


def test_a_point_that_counts_as_solved_is_kept_where_rounding_undoes_it() -> None:
    p = program(1, 1, 4, 4, False, False, 4)
    p.lines.group[0] = 0
    assert solve(p).solved
