"""The bundle method's subproblem with very many variables: optimal by certificates of its own, whatever the sample."""

import numpy as np
import pytest

from mdstopo.compiler.threads import VARIABLE
from mdstopo.optimizer import conic, wide_numbers
from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import FeasibleSet
from mdstopo.optimizer.curvature import Curvature, learnt
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.stack import Stack
from mdstopo.optimizer.state import State
from mdstopo.optimizer.wide import Measures, Space
from mdstopo.optimizer.wide_curvature import compact, known_curvature
from mdstopo.optimizer.wide_interior import CURVED, EQUAL, LIMIT, LINE
from mdstopo.optimizer.wide_program import FEW_IN_DOUBT, Region, Room, WideProgram, solve
from mdstopo.optimizer.wide_rows import Pool, WideModel
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus
from tests.optimizer.toys import volume

N = 12_000


def program(seed, n=N, lines=4, limits=2, linear=1, pairs=0, h=1e-3, trust=0.3, smooth=False):
    """Lines of random slopes, as many linear rows (the first an equality), steps with their changes of gradients."""
    rng = np.random.default_rng(seed)
    x = np.where(rng.random(n) < 0.3, 0.0, rng.random(n))
    if smooth:
        at, k = np.linspace(0.0, 7.0, n), np.arange(lines)[:, None]
        slopes = np.sin((k + 1) * at + seed) * np.exp(np.cos(3 * k + at))
    else:
        slopes = rng.normal(size=(lines, n)) * np.exp(rng.normal(size=n))
    slopes[0] -= 1.0
    costs = rng.uniform(0.5, 2.0, (linear, n))
    steps = rng.normal(size=(pairs, n))
    changes = steps + 0.3 * rng.normal(size=(pairs, n))
    pool = np.concatenate([slopes, costs, steps, changes])
    kind = np.array([LINE] * lines + [EQUAL, LIMIT, LIMIT][:linear] + [CURVED] * (2 * pairs))
    group = np.concatenate([np.minimum(np.arange(lines), limits), np.zeros(linear + 2 * pairs, dtype=np.int64)])
    offset = np.zeros(len(pool))
    offset[:lines] = 0.01 * np.sqrt(n) * rng.normal(size=lines)
    M, products = np.zeros((len(pool), len(pool))), np.zeros((2 * pairs, 2 * pairs))
    if pairs:
        products = pool[lines + linear :] @ pool[lines + linear :].T
        SS, SY = steps @ steps.T, steps @ changes.T
        L = np.tril(SY, -1)
        M[lines + linear :, lines + linear :] = np.block([[SS / h, L / h], [L.T / h, -np.diag(np.diag(SY))]])
    region = Region(x, np.zeros(n), np.ones(n), np.ones(n), np.array([trust, np.inf, h, 1.0, 0.0]))
    return WideProgram(region, pool, np.arange(len(pool)), offset, kind, group, np.full(limits, 3.0), M, products)


def value(problem, d):
    """What a step costs, without curvature that was learnt."""
    lines = problem.kind == LINE
    rows = (problem.offset + problem.pool @ d)[lines]
    levels = [rows[problem.group[lines] == j].max(initial=-np.inf) for j in range(len(problem.penalty) + 1)]
    h = problem.region.box(slice(None))[2]
    return levels[0] + problem.penalty @ np.maximum(levels[1:], 0.0) + 0.5 * float(h @ d**2)


def bound(problem, theta):
    """The least that any step can cost, by the Lagrangian at multipliers that are allowed."""
    low, high, h = problem.region.box(slice(None))
    lines = problem.kind == LINE
    totals = np.bincount(problem.group[lines], weights=theta[lines], minlength=len(problem.penalty) + 1)
    assert totals[0] == pytest.approx(1.0, abs=1e-9)
    assert np.all(totals[1:] <= problem.penalty * (1.0 + 1e-9))
    assert np.all(theta[lines | (problem.kind == LIMIT)] >= 0.0)
    r = theta @ problem.pool
    d = np.clip(-r / h, low, high)
    return theta @ problem.offset + float((r * d + 0.5 * h * d**2).sum())


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize(
    "sizes",
    [{"lines": 1, "limits": 0}, {}, {"lines": 8, "linear": 2}, {"h": 1.0}, {"h": 100.0, "trust": 1.0}, {"linear": 0},
     {"h": 1e-9, "trust": 0.01}],
)  # fmt: skip
def test_no_step_costs_less_than_the_one_that_is_found(sizes, smooth):
    """The gap between its cost and the Lagrangian's bound, which holds whatever the solver, is next to none."""
    problem = program(3, smooth=smooth, **sizes)
    found = solve(problem, Room.of(N))
    assert found.solved
    d = found.trial - problem.region.x
    low, high, _ = problem.region.box(slice(None))
    assert np.all((d >= low - 1e-15) & (d <= high + 1e-15))
    linear = (problem.offset + problem.pool @ d)[problem.kind != LINE]
    kinds = problem.kind[problem.kind != LINE]
    assert np.all(np.where(kinds == EQUAL, np.abs(linear), linear) < 1e-9 * N)
    size = np.abs(problem.pool[0]).sum()
    assert abs(value(problem, d) - bound(problem, found.theta)) < 1e-10 * size
    assert found.change == pytest.approx(problem.pool @ d, abs=1e-9 * size)


@pytest.mark.parametrize(("h", "pairs"), [(1.0, 2), (10.0, 3), (0.1, 1)])
def test_learnt_curvature_counts_as_it_does_with_few_variables(h, pairs):
    n = 3_000
    problem = program(5, n, lines=5, pairs=pairs, h=h)
    found = solve(problem, Room.of(n))
    assert found.solved
    low, high, own = problem.region.box(slice(None))
    curved = problem.kind == CURVED
    Z, inner = problem.pool[curved], np.linalg.inv(problem.M[np.ix_(curved, curved)])
    directions, turn = np.linalg.qr(Z.T)
    weight, vectors = np.linalg.eigh(-turn @ inner @ turn.T)
    B = Curvature(own, directions @ vectors, weight)
    free, nothing = high > low, np.zeros((0, int((high > low).sum())))
    lines = conic.Lines(problem.offset[:5], problem.pool[:5, free], problem.group[:5])
    norms = conic.Norms(np.zeros((0, 2)), nothing, nothing, np.zeros(0), np.zeros(0, dtype=np.int64))
    row = LinearRows(problem.pool[5:6, free], np.zeros(1), np.ones(1, dtype=np.bool_))
    expected = conic.solve(conic.Program(low[free], high[free], lines, norms, problem.penalty, row, B.restricted(free)))
    d = np.zeros(n)
    d[free] = expected.d
    assert np.abs(found.trial - problem.region.x - d).max() < 1e-4
    assert found.theta[:5] == pytest.approx(expected.lines, abs=1e-6)
    step = found.trial - problem.region.x
    costs = [value(problem, each) - 0.5 * float(own @ each**2) + 0.5 * each @ B.times(each) for each in (step, d)]
    assert costs[0] <= costs[1] + 1e-7 * abs(costs[1])
    assert found.curved == pytest.approx(0.5 * step @ B.times(step), rel=1e-9)


def test_variables_that_no_sample_shows_are_found():
    """A few that outweigh all others, between those of the sample."""
    problem = program(7, lines=3)
    rare = np.array([5, 6_007, 9_001])
    problem.pool[:3, rare] *= 1e4
    problem.pool[3, rare] = 300.0
    found = solve(problem, Room.of(N))
    assert found.solved
    d = found.trial - problem.region.x
    assert abs(value(problem, d) - bound(problem, found.theta)) < 1e-10 * np.abs(problem.pool[0]).sum()


def test_where_all_variables_are_alike_all_are_in_doubt():
    problem = program(8, lines=2, limits=1)
    problem.pool[:2] = np.array([[-1.0], [0.5]])
    problem.pool[2] = 1.0
    problem.region.x[:] = 0.5
    found = solve(problem, Room.of(N))
    d = found.trial - problem.region.x
    assert found.solved
    assert len(found.few.which) > FEW_IN_DOUBT
    assert abs(value(problem, d) - bound(problem, found.theta)) < 1e-10 * N


def test_a_program_without_a_feasible_step_is_not_said_to_be_solved():
    problem = program(9)
    problem.offset[4] = 10.0 * N
    assert not solve(problem, Room.of(N)).solved


@pytest.mark.parametrize("pairs", [0, 2])
def test_threads_change_no_bit(pairs, monkeypatch):
    monkeypatch.setattr(wide_numbers, "SHARED", 1)
    problem = program(11, n=40_000, pairs=pairs, h=1.0)
    found = []
    for threads in ("1", "2", "3"):
        monkeypatch.setenv(VARIABLE, threads)
        found.append(solve(problem, Room.of(40_000)))
    for other in found[1:]:
        assert np.array_equal(found[0].trial, other.trial)
        assert np.array_equal(found[0].theta, other.theta)
        assert found[0].curved == other.curved


def test_curvature_from_products_is_that_from_vectors():
    rng = np.random.default_rng(12)
    n, m = 400, 3
    unit = np.exp(0.3 * rng.normal(size=n))
    for bent in (0.0, -2.0):  # the second is damped
        steps = rng.normal(size=(m, n))
        changes = steps * np.exp(rng.normal(size=n)) + bent * steps
        expected = learnt(steps, changes, 1e-5).scaled(1.0 / unit, 1.0)
        Z = np.concatenate([steps / unit, changes / unit])
        products = (Z * unit**2) @ Z.T
        sigma = known_curvature(products, m, 1e-5)
        found = compact(products, m, sigma)
        assert found is not None
        x = rng.normal(size=n)
        B = sigma / unit**2 * x - Z.T @ np.linalg.solve(found, Z @ x)
        assert pytest.approx(expected.times(x), rel=1e-9, abs=1e-9) == B


def test_a_pool_holds_what_was_asked_for_last():
    pool, unit = Pool(50), np.full(1, 2.0)
    rows = [np.full(50, float(k)) for k in range(45)]
    for some in (range(8), range(30), range(20, 45), range(5), (3, 44, 3)):
        asked = [(rows[k], k % 2 == 1) for k in some]
        places = pool.places(asked, unit)
        for (row, over), place in zip(asked, places, strict=True):
            assert np.array_equal(pool.rows[place], row / 4.0 if over else row)


class Limited:
    """min c x under two limits, on a sum and on the square of one, and one volume row."""

    competes = True

    def __init__(self, n=N, seed=0, tight=0.9):
        rng = np.random.default_rng(seed)
        self.c = -np.exp(rng.normal(size=n))
        self.a, self.b = rng.uniform(0.5, 1.5, (2, n)) * np.exp(rng.normal(size=(2, n)))
        self.initial, self.lower, self.upper = np.full(n, 0.3), np.zeros(n), np.ones(n)
        self.linear = volume(n, 0.4 * n)
        self.most = tight * np.array([0.4 * self.a.sum(), 0.4 * self.b.sum()])
        self.count = 0

    def evaluate(self, x, gradient=True):
        self.count += 1
        shares = np.array([self.a @ x, self.b @ x]) / self.most
        limits = shares ** [1.0, 2.0] - 1.0
        slopes = np.stack([self.a, 2.0 * shares[1] * self.b]) / self.most[:, None]
        return Sample(float(self.c @ x), np.array([self.c @ x]), self.c[None], limits, slopes)


def test_very_many_variables_under_two_limits_end_at_the_optimum():
    """Lagrange's bound, with the multipliers that were found, is the value."""
    problem = Limited()
    state = run(Gsao(problem, settings(max_iterations=60)))
    assert state.uses_bundle
    assert state.status is RunStatus.CONVERGED
    assert problem.count < 40
    x = state.best_alpha
    assert np.all((x >= 0.0) & (x <= 1.0))
    assert float(x.sum()) <= 0.4 * N * (1.0 + 1e-13)
    assert problem.evaluate(x).constraint_rows.max() <= 1e-6
    assert state.best_objective == pytest.approx(_least(problem), rel=1e-5)


def _least(problem, rounds=1_500):
    """The largest Lagrangian's bound, by the ellipsoid method: no gradients of ours, no solver of ours."""

    def at(y):
        q = problem.c + y[0] * problem.a / problem.most[0] + y[1] * problem.b / problem.most[1] + y[2] / (0.4 * N)
        x = np.where(q < 0.0, 1.0, 0.0)
        g = np.array([problem.a @ x / problem.most[0], problem.b @ x / problem.most[1], x.sum() / (0.4 * N)]) - 1.0
        return float(problem.c @ x) + float(y @ g), g

    scale = np.abs(problem.c).sum()
    y, E = np.full(3, 0.1 * scale), np.eye(3) * scale**2
    best = -np.inf
    for _ in range(rounds):
        if y.min() < 0.0:
            g = np.zeros(3)
            g[int(y.argmin())] = 1.0
        else:
            found, g = at(y)
            best = max(best, found)
        Eg = E @ g
        size = float(np.sqrt(g @ Eg))
        if y.min() >= 0.0 and size < 1e-7 * abs(best):  # the bound cannot be higher than this one by more
            break
        y = y + Eg / size / 4.0
        E = 9.0 / 8.0 * (E - 0.5 * np.outer(Eg, Eg) / size**2)
    return best


def test_a_run_of_very_many_goes_on_to_the_bit():
    optimizer = Gsao(Limited(), settings(max_iterations=9))
    states = [optimizer.start()]
    while states[-1].running:
        states.append(optimizer.step(states[-1]))
    for k in (0, len(states) // 2, len(states) - 2):
        resumed = run(Gsao(Limited(), settings(max_iterations=9)), State.from_arrays(states[k].to_arrays()))
        for name, array in resumed.to_arrays().items():
            if "seconds" not in name:
                assert np.array_equal(array, states[-1].to_arrays()[name], equal_nan=array.dtype.kind == "f"), name


def test_gradients_of_very_many_are_never_copied():
    optimizer = Gsao(Limited(), settings(max_iterations=6))
    state = optimizer.start()
    for _ in range(4):
        state = optimizer.step(state)
    slope = state.bundle.slope
    assert isinstance(slope, Stack)
    assert any(row.base is state.constraint_gradients or row is state.constraint_gradients for row in slope.rows)
    assert len(slope) <= 8


def test_limits_that_no_design_keeps_are_told():
    problem = Limited(tight=0.9)
    problem.most = np.array([problem.most[0], -1.0])
    problem.evaluate = _at_least(problem)
    state = run(Gsao(problem, settings(max_iterations=60)))
    assert state.status is RunStatus.FAILED
    assert "keeps the limits" in state.reason


def _at_least(problem):
    """Limits of which one asks for less of the first sum and the other for more of it than there can be."""
    a, most = problem.a, 0.4 * problem.a.sum()

    def evaluate(x, gradient=True):
        share = float(a @ x) / most
        limits, slopes = np.array([share - 0.5, 0.8 - share]), np.stack([a, -a]) / most
        return Sample(float(problem.c @ x), np.array([problem.c @ x]), problem.c[None], limits, slopes)

    return evaluate


def test_a_gradient_that_has_turned_far_teaches_curvature_where_the_objective_is_smooth():
    rng = np.random.default_rng(4)
    here = rng.normal(size=N)
    there = 0.1 * rng.normal(size=N) - here
    lower, upper, linear = np.zeros(N), np.ones(N), volume(N, 0.5 * N)
    model = WideModel(FeasibleSet(lower, upper, linear, upper), Measures(Space.of(lower, upper, linear)))
    old, new = (Bundle.of(Sample(1.0, np.ones(1), slope[None]), np.arange(1)) for slope in (here, there))
    step = rng.normal(size=N)
    found = model.gradient_change(old, new, step, np.ones(1), smooth=True)
    assert found == pytest.approx(there - here, rel=1e-12)
    assert model.gradient_change(old, new, step, np.ones(1), smooth=False) is None
