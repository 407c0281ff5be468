"""Rows that compete: limits, many pieces, several constraints, restoration, what is said at the end, resumed runs."""

import numpy as np
import pytest

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import Sample
from mdstopo.optimizer.state import State
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus
from tests.optimizer.toys import Toy, volume


class Forces:
    """The largest of many |r_t + J_t x|, two-vectors or numbers, under a limit on the largest of others.

    Only the highest few are told, as an evaluation tells the highest peaks. Convex, so that every start has one answer.
    """

    competes = True

    def __init__(self, n=12, times=40, limit=None, told=15, cones=True, seed=0):
        rng = np.random.default_rng(seed)
        self.r, self.J = rng.normal(size=(2, times, 2)), rng.normal(size=(2, times, 2, n))
        self.initial, self.lower, self.upper = np.full(n, 0.5), np.zeros(n), np.ones(n)
        self.linear = volume(n, 0.6 * n)
        self.limit, self.told, self.cones = limit, told, cones
        self.count = 0

    def rows(self, which, x):
        vector = self.r[which] + self.J[which] @ x
        size = np.hypot(vector[:, 0], vector[:, 1])
        top = np.argsort(-size, kind="stable")[: self.told]
        unit = vector[top] / size[top, None]
        slope = np.einsum("tc,tcn->tn", unit, self.J[which][top])
        across = np.einsum("tc,tcn->tn", np.stack([-unit[:, 1], unit[:, 0]], axis=1), self.J[which][top])
        return size[top], slope, across

    def evaluate(self, x, gradient=True):
        self.count += 1
        value, slope, across = self.rows(0, x)
        more = {"offset": np.zeros(len(value)), "across": across} if self.cones else {}
        if self.limit is not None:
            size, own, own_across = self.rows(1, x)
            more |= {
                "constraint_rows": size / self.limit - 1.0,
                "constraint_gradients": own / self.limit,
                "constraint_groups": np.zeros(len(size), dtype=np.int64),
            }
            if self.cones:
                more |= {"constraint_offset": np.ones(len(size)), "constraint_across": own_across / self.limit}
        return Sample(float(value[0]), value, slope, **more)

    def level(self, which, x):
        vector = self.r[which] + self.J[which] @ x
        return float(np.hypot(vector[:, 0], vector[:, 1]).max())


def ended(problem, start=None, **options):
    optimizer = Gsao(problem, settings(max_iterations=200, **options))
    return run(optimizer, optimizer.start(start))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("cones", [False, True])
def test_every_start_of_a_convex_problem_ends_at_its_optimum(cones, seed):
    free = ended(Forces(seed=seed, cones=cones))
    limit = 0.9 * Forces(seed=seed).level(1, free.best_alpha)
    found = []
    for start in (None, np.zeros(12), np.random.default_rng(seed).uniform(size=12)):
        problem = Forces(limit=limit, seed=seed, cones=cones)
        state = ended(problem, start)
        assert state.status is RunStatus.CONVERGED
        assert state.kkt <= 1e-6
        assert problem.level(1, state.best_alpha) <= limit * (1.0 + 1e-6)
        found.append(state.best_objective)
    assert found == pytest.approx([found[0]] * 3, rel=1e-5)
    assert found[0] > free.best_objective


def test_cones_take_fewer_evaluations_than_lines():
    counts = []
    for cones in (True, False):
        problem = Forces(cones=cones)
        assert ended(problem).status is RunStatus.CONVERGED
        counts.append(problem.count)
    assert counts[0] < counts[1]


@pytest.mark.parametrize("seed", range(3))
def test_where_no_design_keeps_a_limit_the_least_violation_is_found_and_told(seed):
    least = ended(_turned(Forces(seed=seed))).best_objective
    limit = 0.8 * least
    state = ended(Forces(limit=limit, seed=seed))
    assert state.status is RunStatus.FAILED
    assert "no design near this one keeps the limits" in state.reason
    assert (1.0 + state.best_plain) * limit == pytest.approx(least, rel=1e-4)


def _turned(problem):
    """The problem whose objective is the other's limited response."""
    problem.r, problem.J = problem.r[::-1].copy(), problem.J[::-1].copy()
    return problem


def test_several_constraints_have_a_price_each():
    """min -sum x under two limits on sums of squares: both bind, with multipliers of their own."""
    a, b = np.array([1.0, 4.0]), np.array([4.0, 1.0])

    def limits(x):
        rows = np.array([a @ x**2 - 1.0, b @ x**2 - 1.0])
        return rows, np.stack([2.0 * a * x, 2.0 * b * x])

    problem = Toy(lambda x: (np.array([-x.sum()]), -np.ones((1, 2))), [0.1, 0.1], 0.0, 1.0, constraints=limits)
    state = ended(problem)
    assert state.status is RunStatus.CONVERGED
    assert state.best_alpha == pytest.approx(np.full(2, np.sqrt(0.2)), abs=1e-5)


def test_no_word_is_said_that_the_residual_does_not_bear_out():
    """Whatever the limit on iterations: converged only with a residual within the tolerance."""
    for most in range(12):
        problem = Forces(limit=6.0)
        optimizer = Gsao(problem, settings(max_iterations=most))
        state = run(optimizer)
        if state.status is RunStatus.CONVERGED:
            assert state.kkt <= 1e-6
        elif state.status is RunStatus.MAX_ITERATIONS:
            assert state.iteration == most
            assert "residual" in state.reason


def test_a_resumed_run_equals_an_uninterrupted_one_to_the_bit():
    limit = 5.0
    optimizer = Gsao(Forces(limit=limit), settings(max_iterations=60))
    states = [optimizer.start()]
    while states[-1].running:
        states.append(optimizer.step(states[-1]))
    for k in (0, 2, len(states) // 2, len(states) - 2):
        resumed = State.from_arrays(states[k].to_arrays())
        last = run(Gsao(Forces(limit=limit), settings(max_iterations=60)), resumed)
        for name, array in last.to_arrays().items():
            if "seconds" not in name:
                assert np.array_equal(array, states[-1].to_arrays()[name], equal_nan=array.dtype.kind == "f"), name


def test_a_row_from_elsewhere_says_no_more_of_the_iterate_than_its_own_rows():
    own = Sample(1.0, np.array([1.0]), np.array([[1.0, 0.0]]))
    far = Sample(5.0, np.array([5.0]), np.array([[0.0, 2.0]]))
    rows = Bundle.of(far, np.array([0])).moved(np.array([0.0, -1.0]), 1.0).joined(Bundle.of(own, np.array([0])))
    assert rows.values() == pytest.approx([3.0, 1.0])
    levels = np.array([1.0])
    assert rows.lowered(levels, np.zeros(1)).values() == pytest.approx([1.0, 1.0])
    assert rows.lowered(levels, np.array([0.25])).values() == pytest.approx([0.75, 1.0])
    assert rows.values() == pytest.approx([3.0, 1.0])


def test_a_peak_that_is_seen_again_takes_the_place_of_what_was_seen_before():
    """Earlier rows go where one of the same group has nearly the same slope, whatever the order; others stay."""
    slopes = np.array([[1.0, 0.0], [1.0, 0.05], [0.0, 1.0], [2.0, 0.0]])
    earlier = Bundle.of(Sample(4.0, np.array([4.0, 3.0, 2.0, 1.0]), slopes), np.arange(4)).moved(np.zeros(2), 1.0)
    now = Bundle.of(Sample(5.0, np.array([5.0]), np.array([[1.0, 0.0]])), np.array([0]))
    assert earlier.without_peaks_of(now).values().tolist() == [2.0, 1.0]
    now.group[:] = 1
    assert len(earlier.without_peaks_of(now)) == 4
    assert len(Bundle.empty(2).without_peaks_of(now)) == 0


def test_a_violation_that_steps_along_a_limit_leave_is_not_restored_first():
    """Through a narrow tube along a sine: every step leaves it a little, and goes on."""

    def limits(x):
        off, slope = x[1] - np.sin(8.0 * x[0]), np.array([-8.0 * np.cos(8.0 * x[0]), 1.0])
        return np.array([off, -off]) - 1e-3, np.stack([slope, -slope])

    problem = Toy(lambda x: (np.array([-x[0]]), np.array([[-1.0, 0.0]])), [0.0, 0.0], -2.0, 2.0, constraints=limits)
    problem.competes = True
    state = ended(problem, tolerance=1e-9)
    assert state.status is RunStatus.CONVERGED
    assert state.best_alpha[0] == pytest.approx(2.0)
    assert len(problem.evaluated) <= 80


def test_of_too_many_rows_those_go_that_have_not_been_used(monkeypatch):
    monkeypatch.setattr("mdstopo.optimizer.bundle.ROOM", 8e4)
    n = 10**4
    slope = np.zeros((1, n))
    assert len(Bundle.empty(n)) == 0
    rows = Bundle.of(Sample(0.0, np.zeros(1), slope), np.array([0]))
    rows.own[:] = False
    many = rows
    for k in range(1, 12):
        rows.vector = np.array([[float(k), 0.0]])
        many = many.joined(rows)
    many.age[3] = 9
    thinned = many.thinned()
    assert len(thinned) == 8
    assert 3.0 not in thinned.values()
