"""The choice of sizes by branch and bound, on problems that are formulas: beside all choices, stopped, resumed."""

import itertools

import numpy as np
import pytest

from mdstopo.optimizer.interface import make, run
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.session import size_search
from mdstopo.session.size_search import Catalogued, SizeSearch, Within
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import Status


@pytest.fixture(autouse=True)
def small_searches(monkeypatch):
    """Few choices are fewer here, so that branch and bound has something to do in little time."""
    monkeypatch.setattr(size_search, "FEW_CHOICES", 1000)


class Springs:
    """Loads on chains of springs: U = sum_r f_r^2 / (a_r . x), convex in x; a limit or an equality on a . x."""

    competes = False

    def __init__(self, seed, n, bound, equal=False, loads=3):
        rng = np.random.default_rng(seed)
        self.share = rng.uniform(0.2, 1.0, (loads, n)) * (rng.uniform(size=(loads, n)) < 0.7) + 1e-3
        self.load = rng.uniform(0.5, 2.0, loads)
        self.initial, self.lower, self.upper = np.full(n, 0.3), np.full(n, 0.0), np.ones(n)
        cost = rng.uniform(0.5, 1.5, n)
        self.linear = LinearRows(cost[None], np.array([bound * cost.sum()]), np.array([equal]))

    def evaluate(self, x, gradient=True):
        stiff = self.share @ x + 0.05
        value = float(np.sum(self.load**2 / stiff))
        slope = -(self.load**2 / stiff**2) @ self.share
        return Sample(value, np.array([value]), slope[None], np.zeros(0), np.zeros((0, len(x))), status=Status.OK)


def solve(problem, x):
    optimizer = make(problem, settings("default", {}, max_iterations=200, tolerance=1e-8))
    return run(optimizer, optimizer.start(x))


def search_of(problem, sizes, prices=None, others=0):
    n = len(problem.initial) - others
    begin = solve(problem, problem.initial).best_alpha
    own = tuple(np.array(sizes) for _ in range(n))
    catalogued = Catalogued(np.arange(n), own, own if prices is None else tuple(np.array(prices) for _ in range(n)))
    return SizeSearch(problem, catalogued, begin, solve, 1e-8)


def brute(problem, sizes, prices=None):
    best = np.inf
    paid = dict(zip(sizes, sizes if prices is None else prices, strict=True))
    cost_of, bound = problem.linear.A[0], problem.linear.b[0]
    short = cost_of.max() * max(np.diff(list(paid.values()))) if problem.linear.equal[0] else np.inf
    for choice in itertools.product(sizes, repeat=len(problem.initial)):
        x, cost = np.array(choice), np.array([paid[size] for size in choice])
        if bound * (1 - 1e-9) - short <= cost_of @ cost <= bound * (1 + 1e-9):
            best = min(best, problem.evaluate(x).objective)
    return best


def never():
    return False


def nothing(found):
    del found


@pytest.mark.parametrize("seed", range(6))
def test_branch_and_bound_finds_the_best_of_all_choices(seed):
    problem, sizes = Springs(seed, 7, 0.4, equal=seed % 2 == 0), [0.0, 0.4, 1.0]
    assert len(sizes) ** 7 > size_search.FEW_CHOICES
    found = search_of(problem, sizes).run(never, nothing)
    assert found.finished
    assert not found.exhaustive
    assert found.objective == pytest.approx(brute(problem, sizes), rel=1e-12)
    assert found.bound == found.objective
    assert found.evaluations < 3**7
    assert set(found.x.tolist()) <= set(sizes)


@pytest.mark.parametrize("prices", [[0.0, 0.55, 1.0], [0.0, 0.2, 1.0]], ids=["cheaper in bulk", "dearer in bulk"])
def test_prices_stand_in_volume_rows_in_the_place_of_sizes(prices):
    problem, sizes = Springs(11, 7, 0.45), [0.0, 0.4, 1.0]
    found = search_of(problem, sizes, prices).run(never, nothing)
    assert found.objective == pytest.approx(brute(problem, sizes, prices), rel=1e-12)


def test_few_choices_are_all_evaluated():
    problem, sizes = Springs(3, 5, 0.4), [0.0, 0.5, 1.0]
    found = search_of(problem, sizes).run(never, nothing)
    assert found.exhaustive
    assert found.finished
    assert found.nodes == 0
    assert found.objective == pytest.approx(brute(problem, sizes), rel=1e-14)
    assert found.evaluations <= 3**5


def test_what_else_varies_is_optimised_with_every_choice():
    problem, sizes = Springs(5, 4, 0.5), [0.0, 1.0]
    found = search_of(problem, sizes, others=1).run(never, nothing)
    best = np.inf
    for choice in itertools.product(sizes, repeat=3):
        lower, upper = problem.lower.copy(), problem.upper.copy()
        lower[:3] = upper[:3] = choice
        if problem.linear.A[0] @ lower > problem.linear.b[0]:
            continue
        best = min(best, solve(Within(problem, [0], lower, upper, problem.linear), lower).best_objective)
    assert found.objective == pytest.approx(best, rel=1e-7)
    assert 0.0 < found.x[3] <= 1.0


def test_a_search_that_is_stopped_goes_on_to_the_same_choice():
    problem, sizes = Springs(2, 7, 0.4), [0.0, 0.4, 1.0]
    whole = search_of(problem, sizes).run(never, nothing)
    first, seen = search_of(problem, sizes), []
    part = first.run(lambda: len(seen) >= 3, seen.append)
    assert not part.finished
    assert part.x is not None
    assert part.bound <= whole.objective <= part.objective
    second = search_of(problem, sizes)
    second.restore(first.to_arrays())
    resumed = second.run(never, nothing)
    assert np.array_equal(resumed.x, whole.x)
    assert (resumed.nodes, resumed.evaluations) == (whole.nodes, whole.evaluations)


def test_a_search_that_is_stopped_among_the_last_neighbours_goes_on_to_the_same_choice():
    class Waves(Springs):
        """With many local optima."""

        def evaluate(self, x, gradient=True):
            sample = super().evaluate(x, gradient)
            w = np.array([3.0, -4.0, 5.0, -6.0])
            value, slope = sample.objective + 1.5 * np.sin(w @ x), sample.gradients + 1.5 * np.cos(w @ x) * w
            return Sample(value, np.array([value]), slope, np.zeros(0), np.zeros((0, 4)), status=Status.OK)

    problem, sizes, asked, seen = Waves(3, 4, 0.45), [0.0, 0.2, 0.4, 0.6, 0.8, 1.0], [], []
    assert len(sizes) ** 4 > size_search.FEW_CHOICES

    def ask():
        asked.append(0)
        return False

    whole = search_of(problem, sizes).run(ask, seen.append)
    among_nodes = len(seen) - 1
    assert len(asked) > among_nodes + 20
    for share in (0.3, 0.9):
        calls = itertools.count()
        stopped = int(among_nodes + share * (len(asked) - among_nodes))
        first = search_of(problem, sizes)
        assert not first.run(lambda calls=calls, stopped=stopped: next(calls) >= stopped, nothing).finished
        second = search_of(problem, sizes)
        second.restore(first.to_arrays())
        resumed = second.run(never, nothing)
        assert np.array_equal(resumed.x, whole.x)
        assert (resumed.nodes, resumed.evaluations, resumed.exchanged) == (
            whole.nodes,
            whole.evaluations,
            whole.exchanged,
        )
        older = search_of(problem, sizes)
        older.restore({name: each for name, each in first.to_arrays().items() if name != "beginnings"})
        assert older.run(never, nothing).finished


def test_nothing_is_chosen_where_no_choice_keeps_the_rows():
    problem = Springs(4, 8, 0.1)
    found = search_of(problem, [0.5, 0.7, 1.0]).run(never, nothing)
    assert found.finished
    assert found.x is None
    assert found.objective == np.inf


def test_a_search_ends_where_no_member_is_kept_and_another_optimum_is_met():
    problem, calls = Springs(5, 4, 0.5), []

    def solve_anew(within, x):
        state = solve(within, x)
        calls.append(state.best_objective)
        if len(calls) == 3:  # behind both of the relaxation: that of the one choice there is
            state.best_objective *= 1.01
        return state

    none = Catalogued(np.zeros(0, dtype=np.int64), (), ())
    found = SizeSearch(problem, none, problem.initial, solve_anew, 1e-8).run(never, nothing)
    assert found.finished
    assert found.objective == 1.01 * calls[2]


def test_a_limit_that_is_no_line_is_kept():
    class Limited(Springs):
        def evaluate(self, x, gradient=True):
            sample = super().evaluate(x, gradient)
            row = np.array([0.6 - x[0] * x[1]])
            slope = np.zeros((1, len(x)))
            slope[0, :2] = -x[1], -x[0]
            return Sample(sample.objective, sample.rows, sample.gradients, row, slope, status=Status.OK)

    problem = Limited(6, 4, 0.8)
    found = search_of(problem, [0.0, 0.5, 1.0]).run(never, nothing)
    assert found.x[0] * found.x[1] >= 0.6
