"""Rows that compete: limits, many pieces, several constraints, restoration, what is said at the end, resumed runs."""

import numpy as np
import pytest

from mdstopo.optimizer.bundle import MOST_ROWS, Bundle
from mdstopo.optimizer.bundle_method import PATIENCE
from mdstopo.optimizer.competing_rows import Trial
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


@pytest.mark.parametrize("penalty", [1e9, 1e15, 1e30])
def test_penalties_that_were_raised_ever_more_leave_the_residual_as_it_is(penalty):
    """A residual of 2.9e6 was told of a design next to its optimum, where violations were rounding."""
    a, b = np.array([1.0, 4.0, 2.0]), np.array([4.0, 1.0, 3.0])

    def limits(x):
        rows = np.array([a @ x**2 - 1.0, b @ x**2 - 1.0, x.sum() - 5.0])
        return rows, np.stack([2.0 * a * x, 2.0 * b * x, np.ones(3)])

    problem = Toy(lambda x: (np.array([-x.sum()]), -np.ones((1, 3))), [0.1] * 3, 0.0, 1.0, constraints=limits)
    problem.competes = True
    optimizer = Gsao(problem, settings(max_iterations=200, tolerance=1e-12))
    state = optimizer.start()
    while state.running and state.iteration < 6:
        state = optimizer.step(state)
    told = []
    for factor in (1.0, penalty):
        tried = state.copy()
        tried.kkt, tried.penalty = float("nan"), factor * np.maximum(state.penalty, 1.0)
        optimizer._method(tried).propose(tried)
        told.append(tried.kkt)
    assert told[0] < 1.0
    assert told[1] == pytest.approx(told[0], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("start", [0.0, 0.3])
def test_penalties_stay_where_the_model_cannot_lower_what_violations_cost(start):
    """Two limits that no step keeps together, one ten times as steep: no penalty trades one violation for the other.

    The sum of the violations falls where x does, but what they cost falls where x rises. Penalties rose to 5**8 times
    what they were for it, and the steps that followed saw nothing of the objective.
    """

    def limits(x):
        return np.array([1.0 - x[0], 1.0 + 2.0 * x[0] - 10.0 * x[1]]), np.array([[-1.0, 0.0], [2.0, -10.0]])

    problem = Toy(
        lambda x: (np.array([x[1]]), np.array([[0.0, 1.0]])), [start, 0.0], [-1.0, 0.0], [1.0, 0.01], constraints=limits
    )
    problem.competes = True
    optimizer = Gsao(problem, settings(max_iterations=200))
    state = optimizer.start()
    state.restoring = False
    method = optimizer._method(state)
    method.begin(state)
    before = state.penalty.copy()
    method.propose(state)
    assert before.max() > 0.0
    assert (state.penalty <= 10.0 * before).all()


def test_what_is_left_of_a_violation_below_its_penalty_is_rounding():
    """Rows of constraints carry all of the penalty where these are violated, and less where they are kept."""
    problem = Toy(
        lambda x: (np.array([-x[0]]), np.array([[-1.0]])), [0.5], 0.0, 1.0,
        constraints=lambda x: (np.array([x[0] - 0.2, 0.5 - x[0]]), np.array([[1.0], [-1.0]])),
    )  # fmt: skip
    rows = Bundle.of(problem.evaluate(np.array([0.5])), np.arange(1))
    levels, penalty = np.array([-0.3, 1e-7, 0.2]), np.array([1e3, 4.0])
    trial = Trial(np.array([0.3]), np.array([1.0, 2.0, 4.0]), np.zeros(0), levels, 0.0, True)
    assert trial.carried(rows, 2).tolist() == [2.0, 4.0]
    assert trial.violates(rows, penalty, 1e-9).tolist() == [False, True]
    assert trial.violates(rows, np.array([2.0, 4.0]), 1e-9).tolist() == [True, True]
    assert trial.violates(rows, np.array([2.0, 4.0]), 1e-6).tolist() == [False, True]


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
    monkeypatch.setattr("mdstopo.optimizer.bundle.ROOM_FOR_ROWS", 8e4)
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


def test_beside_many_own_rows_there_is_room_for_what_trials_have_shown():
    """More own rows than there is room for: others stay that carried a multiplier last, and the newest of them."""
    rng = np.random.default_rng(2)
    many = MOST_ROWS + 20
    own = Bundle.of(Sample(1.0, rng.uniform(-1.0, 1.0, many), rng.normal(size=(many, 3))), np.arange(many))
    lows = np.linspace(0.9, -3.0, MOST_ROWS)
    seen = Bundle.of(Sample(0.9, lows, np.tile([0.0, 0.0, 2.0], (MOST_ROWS, 1))), np.arange(MOST_ROWS)).moved(
        np.zeros(3), 0.1
    )
    seen.age[-5:] = 1
    kept = seen.joined(own).thinned()
    assert int(kept.own.sum()) == many
    assert kept.subset(~kept.own).values() == pytest.approx(lows[-5 - MOST_ROWS // 2 : -5])
    few = seen.joined(own.subset(np.arange(8))).thinned()
    assert len(few) == MOST_ROWS
    assert few.subset(~few.own).values() == pytest.approx(lows[3:-5])


def test_of_a_rejected_trial_those_rows_enter_that_are_nearest_to_what_stood_in_the_way():
    """Rows of an objective, of a limit that is broken and of one that holds: by what is missing, over the slope."""
    gradients = np.array([[2.0, 0.0], [0.0, 1.0]])
    sample = Sample(
        3.0, np.array([3.0, 1.0]), gradients, np.array([0.5, 0.1, -0.3]), np.ones((3, 2)), np.array([0, 0, 1])
    )
    trial = Bundle.of(sample, np.arange(2))
    assert trial.below() == pytest.approx([0.0, 2.0, 0.0, 0.4, 0.3])
    n = MOST_ROWS // 4 + 3
    many = Bundle.of(Sample(0.0, -np.arange(float(n)), np.ones((n, 2))), np.arange(n))
    before = Bundle.of(Sample(5.0, np.array([5.0, 4.0]), gradients), np.arange(2))
    before.own[0] = False
    joined = before.with_rejected(many.moved(np.zeros(2), 0.1), many.below()[::-1])
    assert joined.values().tolist() == [5.0, *(-np.arange(3.0, n)), 4.0]
    assert joined.own.tolist() == [False] * (n - 2) + [True]


@pytest.mark.parametrize(("steepness", "most"), [(0.0, 12), (10.0, 100)])
def test_steps_along_a_curved_limit_are_not_made_short_by_what_they_violate(steepness, most):
    """The example of N. Maratos (1978), whose good steps raise objective and violation both. The optimum is (1, 0)."""

    def limits(x):
        return np.array([x @ x - 1.0, 1.0 - x @ x]), np.stack([2.0 * x, -2.0 * x])

    def objective(x):
        return np.array([steepness * (x @ x - 1.0) - x[0]]), (2.0 * steepness * x - [1.0, 0.0])[None]

    problem = Toy(objective, [np.cos(2.0), np.sin(2.0)], -2.0, 2.0, constraints=limits)
    problem.competes = True
    state = ended(problem, tolerance=1e-8)
    assert state.status is RunStatus.CONVERGED
    assert state.best_alpha == pytest.approx([1.0, 0.0], abs=1e-4)
    assert len(problem.evaluated) <= most


def test_what_was_seen_to_bend_is_known_while_limits_are_restored_and_after():
    problem = Toy(
        lambda x: (x[:1].copy(), np.array([[1.0, 0.0]])), [1.0, 1.0], -2.0, 2.0,
        constraints=lambda x: (np.array([x[0] + 1.0, x[1] + 1.0]), np.eye(2)),
    )  # fmt: skip
    problem.competes = True
    optimizer = Gsao(problem, settings())
    state = optimizer.start()
    state.concavity = np.array([7.0, 0.5, 2.0])
    method = optimizer.bundle
    state.small = PATIENCE
    assert method.begin_anew(state, stuck=True)
    assert state.restoring
    assert state.concavity.tolist() == [2.0]
    state.concavity = np.array([3.0])
    state.violation = 0.0
    state.constraint_rows = -np.ones(2)
    assert method.begin_anew(state, stuck=False)
    assert not state.restoring
    assert state.concavity.tolist() == [0.0, 3.0, 3.0]
