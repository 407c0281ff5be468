"""Words and numbers at the end of runs that begin or pass where a method is easily misled."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from mdstopo.optimizer import safeguards
from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import FeasibleSet, Trial, lower_bound, residual
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.state import State
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus
from tests.optimizer.toys import Toy, failing


def ended(problem, **options):
    problem.competes = True
    return run(Gsao(problem, settings(**options)))


def test_a_first_design_that_cannot_be_left_is_judged_by_its_limits() -> None:
    """x <= 1 and x >= 2 from x = 1: no step lowers U or the excess, and the run has to say so."""
    problem = Toy(lambda x: (-x, -np.ones((1, 1))), [1.0], 0.0, 1.0, constraints=lambda x: (2.0 - x, -np.ones((1, 1))))
    state = ended(problem)
    assert state.status is RunStatus.FAILED
    assert "no design near this one keeps the limits" in state.reason


def test_short_steps_to_an_equality_do_not_end_in_untrue_words() -> None:
    """A circle to be reached in steps of 0.001: rows from elsewhere forbade what is left, and designs that keep it
    lie 0.003 away."""
    center, slope = np.array([0.83886073, 0.35585191]), np.array([0.71556786, 1.20599045])
    square = float(((np.array([0.34642495, 0.4153254]) - center) ** 2).sum())

    def objective(x):
        value = np.exp(3.0 * slope @ x)
        return np.array([value]), (3.0 * value * slope)[None]

    def on_circle(x):
        c, g = ((x - center) ** 2).sum() / square - 1.0, 2.0 * (x - center) / square
        return np.array([c, -c]), np.array([g, -g])

    problem = Toy(objective, [0.51939, 0.80318], 0.0, 1.0, constraints=on_circle)
    state = ended(problem, overrides={"move_limit": 0.001}, max_iterations=75)
    assert state.best_violation <= 1e-6
    assert state.status is not RunStatus.FAILED


def test_a_smooth_minimum_inside_the_bounds_converges_although_its_gradient_vanishes() -> None:
    def bowl(x):
        away = x - [0.4, 0.6]
        return np.array([1.0 + away[0] ** 2 + 3.0 * away[1] ** 2]), np.array([[2.0 * away[0], 6.0 * away[1]]])

    for competes in (False, True):
        problem = Toy(bowl, [0.9, 0.1], 0.0, 1.0)
        problem.competes = competes
        state = ended(problem)
        assert state.status is RunStatus.CONVERGED
        assert np.allclose(state.best_alpha, [0.4, 0.6], atol=1e-5)


def distance(x):
    """How far x is from (0.4, 0.6), which has no slope there; its direction where it is not."""
    away = x - [0.4, 0.6]
    length = float(np.hypot(*away))
    return np.array([length]), (away / length if length > 0.0 else np.array([0.0, 1.0]))[None]


def test_what_has_come_to_the_least_that_is_possible_has_converged() -> None:
    problem = Toy(distance, [0.9, 0.1], 0.0, 1.0)
    assert ended(problem).status is RunStatus.STALLED
    problem.objective_bound = 0.0
    state = ended(problem)
    assert state.status is RunStatus.CONVERGED
    assert "cannot be below 0" in state.reason
    assert state.best_objective < 1e-6


def test_a_run_that_still_falls_when_its_iterations_are_used_up_has_not_converged() -> None:
    def steep(x):
        away = x[0] - 0.3
        return np.array([1e-8 + away**4]), np.array([[4.0 * away**3]])

    problem = Toy(steep, [1.0], 0.0, 1.0)
    problem.objective_bound = 0.0
    state = ended(problem, max_iterations=13)
    assert state.best_objective < 1e-6 * state.history.objective[0]
    assert state.status is RunStatus.MAX_ITERATIONS


def test_a_bound_that_is_not_reached_makes_nothing_converge() -> None:
    """The same beside a limit that keeps x_0 below 0.3, where no slope is zero: as good as without a bound."""
    limit = LinearRows(np.array([[1.0, 0.0]]), np.array([0.3]), np.array([False]))
    ends = []
    for least in (-np.inf, 0.0):
        problem = Toy(distance, [0.1, 0.1], 0.0, 1.0, limit)
        problem.objective_bound = least
        ends.append(ended(problem))
    assert ends[0].reason == ends[1].reason
    assert ends[1].best_objective > 0.09


def test_the_residual_is_relative_to_the_highest_row_and_not_to_a_steeper_one_that_does_not_compete() -> None:
    """Row 1, far below, is a hundred thousand times as steep: x_0 has half of its range to go nevertheless."""
    slopes = np.array([[1e-3, 0.0], [0.0, 100.0]])
    problem = Toy(lambda x: (np.array([1.0, 0.5]) + slopes @ x, slopes), [0.5, 0.0], 0.0, 1.0)
    problem.competes = True
    assert Gsao(problem, settings()).start().kkt > 0.1


def test_rows_that_do_not_compete_do_not_make_the_residual_larger_than_it_is() -> None:
    """A flat row 1e-10 below the highest makes the design all but optimal. The highest alone would lead so far that
    the third row, far below, stops it and seems to compete."""
    slope = np.array([[1e-4, 0.0], [0.0, 0.0], [-80.0, 80.0]])
    value = np.array([1.0, 1.0 - 1e-10, 0.2])
    rows = Bundle.of(Sample(1.0, value, slope), np.arange(3))
    space = FeasibleSet(np.zeros(2), np.ones(2), LinearRows.none(2), np.ones(2))
    assert residual(rows, np.full(2, 0.5), space, np.zeros(0), 1e-3) < 2e-6


def test_what_is_told_of_a_converged_run_is_the_design_that_has_converged() -> None:
    """A design that breaks its limit within the tolerance is lower, and no optimum."""
    problem = Toy(
        lambda x: (-x.sum(keepdims=True), -np.ones((1, 2))), [0.1, 0.2], 0.0, 1.0,
        constraints=lambda x: (np.array([x @ x - 0.5]), 2.0 * x[None]),
    )  # fmt: skip
    state = ended(problem)
    assert state.status is RunStatus.CONVERGED
    assert np.array_equal(state.best_alpha, state.alpha)
    assert state.best_objective == state.objective


def rounded(constant, seed=0, n=8):
    """The length of one linear quantity with a constant in its square: smooth, but bent within sqrt(constant) of its
    least value, which is that."""
    rng = np.random.default_rng(seed)
    slope, level = rng.uniform(0.2, 1.0, n), rng.uniform(0.05, 0.3)

    def functions(x):
        away = slope @ x - level
        value = np.sqrt(away**2 + constant)
        return np.array([value]), (away / value * slope)[None]

    return Toy(functions, np.full(n, 0.4), 0.0, 1.0)


def test_an_optimum_that_bends_on_a_small_scale_has_converged_where_slopes_beside_it_leave_nothing_to_gain() -> None:
    """The slope at the design is steep until next to the optimum, so that the residual is large at the best of designs
    that can be told apart."""
    for seed, constant in enumerate((1e-6, 1e-8)):
        state = ended(rounded(constant, seed))
        assert state.status is RunStatus.CONVERGED
        assert state.kkt > 1e-4
        assert "leave at most" in state.reason
        assert 0.0 <= state.best_objective - np.sqrt(constant) <= 1e-9 * np.sqrt(constant)


def test_what_is_left_to_gain_is_never_less_than_what_a_convex_objective_lies_above_its_optimum() -> None:
    told = []
    for seed in (0, 24, 28):
        problem = rounded(1e-6, seed)
        problem.competes = True
        optimizer = Gsao(problem, settings())

        def look(state, optimizer=optimizer) -> None:
            state = state.copy()
            state.resets = 1  # as if rows from far off had been dropped
            to_gain = optimizer.bundle.most_to_gain(state)
            told.append(to_gain / state.objective)
            assert to_gain >= state.objective - 1e-3 - 1e-15 * state.objective

        run(optimizer, on_iteration=look)
    assert max(told) > 0.5
    assert min(told) < 1e-8


def test_the_bound_of_a_model_holds_for_any_multipliers_and_is_its_least_value_for_the_best() -> None:
    """Against linear programming."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        n, k = 6, 9
        group = np.concatenate([[0, 0, 0], rng.integers(0, 3, k - 3)])
        value, slope = rng.normal(size=k), rng.normal(size=(k, n))
        rows = Bundle(
            np.stack([value, np.zeros(k)], axis=1), slope, np.zeros((k, 0)), np.full(k, np.nan), group,
            np.ones(k, bool), np.zeros(k, int), np.zeros(k),
        )  # fmt: skip
        penalty, x = rng.uniform(0.5, 2.0, 2), rng.uniform(0.2, 0.8, n)
        linear = LinearRows(np.ones((1, n)), np.array([x.sum()]), np.array([False]))
        space = FeasibleSet(np.zeros(n), np.ones(n), linear, np.ones(n))
        # by d, z, s: minimise z + penalty s
        one = np.zeros((k, 3))
        one[np.arange(k), group] = -1.0
        found = linprog(
            [*np.zeros(n), 1.0, *penalty],
            np.block([[slope, one], [np.ones((1, n)), np.zeros((1, 3))]]),
            [*-value, 0.0],
            bounds=[*zip(-x, 1.0 - x, strict=True), (None, None), (0.0, None), (0.0, None)],
        )
        best = -found.ineqlin.marginals
        trial = Trial(x + found.x[:n], best[:k], best[k:], np.zeros(3), 0.0, True)
        assert lower_bound(rows, trial, x, space, penalty) == pytest.approx(found.fun, abs=1e-12)
        for _ in range(5):
            other = replace(trial, multipliers=rng.uniform(size=k), linear=rng.normal(size=1))
            assert lower_bound(rows, other, x, space, penalty) <= found.fun + 1e-12


def test_nothing_is_told_of_what_is_left_before_rows_from_far_off_were_dropped() -> None:
    problem = rounded(1e-6)
    problem.competes = True
    optimizer = Gsao(problem, settings())
    state = optimizer.start()
    assert state.resets == 0
    assert optimizer.bundle.most_to_gain(state) == np.inf


def test_a_run_that_ends_although_something_is_left_to_gain_has_not_converged() -> None:
    """Steps that gain less than half count as none: short ones end the run far above the optimum."""
    state = ended(rounded(1e-6), overrides={"decrease_tolerance": 0.5, "trust_start": 1e-4, "trust_grow": 1.0})
    assert state.best_objective > 2e-3
    assert state.status is RunStatus.STALLED


def two_wells(level=0.0):
    """min x_0 where c = (x_0^2 - 1)^2 - 0.15 x_0 + 0.2 |x_1| + level is not positive: with level 0 only around x_0 = 1.

    Around x_0 = -1 lies another least c, which is positive.
    """

    def limits(x):
        well, slope = (x[0] ** 2 - 1.0) ** 2 - 0.15 * x[0] + level, 4.0 * x[0] * (x[0] ** 2 - 1.0) - 0.15
        return well + 0.2 * x[1] * np.array([1.0, -1.0]), np.array([[slope, 0.2], [slope, -0.2]])

    return Toy(lambda x: (x[:1].copy(), np.array([[1.0, 0.0]])), [-0.3, 0.5], -2.0, 2.0, constraints=limits)


def least_of_wells():
    """The least values of c, without its level, on the left and on the right."""
    places = np.sort(np.roots([4.0, 0.0, -4.0, -0.15]).real)
    left, right = ((x**2 - 1.0) ** 2 - 0.15 * x for x in (places[0], places[2]))
    return left, right


@pytest.mark.parametrize("first", [[-0.3, 0.5], [-0.5, -1.0], [-0.2, 0.1]])
def test_a_least_violation_in_one_place_does_not_end_a_run_where_designs_elsewhere_keep_the_limits(first) -> None:
    problem = two_wells()
    problem.initial = np.array(first)
    state = ended(problem)
    assert state.far_design_tried
    assert state.status is RunStatus.CONVERGED
    edge = min(x.real for x in np.roots([1.0, 0.0, -2.0, -0.15, 1.0]) if abs(x.imag) < 1e-9)
    assert np.allclose(state.best_alpha, [edge, 0.0], atol=1e-5)
    assert len(problem.evaluated) <= 50


@pytest.mark.parametrize("first", [-0.3, 0.3])
def test_of_two_searches_that_find_no_design_within_the_limits_the_lesser_violation_is_told(first) -> None:
    problem = two_wells(0.3)
    problem.initial = np.array([first, 0.5])
    state = ended(problem)
    assert state.far_design_tried
    assert state.status is RunStatus.FAILED
    left, right = least_of_wells()
    assert left > right > -0.3
    assert np.isclose(state.best_plain, 0.3 + right, rtol=1e-6)
    assert f"{0.3 + right:.3g} of its bound" in state.reason


def test_a_second_search_whose_first_design_cannot_be_evaluated_leaves_the_least_violation_as_it_is() -> None:
    problem = two_wells()
    once = ended(problem)
    begun = next(k for k, x in enumerate(problem.evaluated) if x[0] > 0.0)
    state = ended(failing(two_wells(), {begun}))
    assert once.status is RunStatus.CONVERGED
    assert state.status is RunStatus.FAILED
    assert state.evaluations == begun + 1
    assert np.isclose(state.best_plain, least_of_wells()[0], rtol=1e-6)


def test_a_run_that_is_stopped_before_a_second_search_goes_on_as_if_it_had_not_been() -> None:
    problem = two_wells()
    problem.competes = True
    optimizer = Gsao(problem, settings())
    state = stored = optimizer.start()
    while state.running:
        state = optimizer.step(state)
        if state.trial_is_far_design:
            stored = State.from_arrays(state.to_arrays())
    assert stored.trial_is_far_design
    # states of older files have tried no design far off
    older = {name: each for name, each in optimizer.start().to_arrays().items() if name != "far_design_tried"}
    assert not State.from_arrays(older).far_design_tried
    resumed = run(optimizer, stored)
    assert resumed.evaluations == state.evaluations
    assert np.array_equal(resumed.alpha, state.alpha)


def test_where_limits_do_not_bend_one_design_far_off_is_all_that_is_tried_beside_their_least_violation() -> None:
    """A convex violation that is least inside the bounds: there is no lesser one."""

    def limits(x):
        slopes = np.array([[1.0, 2.0], [-1.0, 0.0], [0.0, -1.0]])
        return slopes @ x + np.array([-1.0, 0.6, 0.6]), slopes

    problem = Toy(lambda x: (x[:1].copy(), np.array([[1.0, 0.0]])), [0.1, 0.9], 0.0, 1.0, constraints=limits)
    state = ended(problem)
    assert state.status is RunStatus.FAILED
    assert state.far_design_tried
    assert not state.history.accepted[-1]
    assert np.isclose(state.best_plain, 0.2)  # three rows with the multipliers 1/4, 1/4 and 1/2
    assert len(problem.evaluated) <= 6


@pytest.mark.parametrize("equal", [False, True])
def test_limits_that_are_too_tight_on_a_volume_row_that_leaves_no_other_design_end_as_failed(equal) -> None:
    """The nearest design to one far off is the iterate itself: a uniform one on a row that counts all alike."""

    def limits(x):
        return np.array([0.8 - x.sum()]), -np.ones((1, len(x)))

    for n in (1, 4):
        problem = Toy(
            lambda x: (x[:1].copy(), np.eye(len(x))[:1]), np.full(n, 0.4 / n), 0.0, 1.0, constraints=limits,
            linear=LinearRows(np.ones((1, n)), np.array([0.4]), np.array([equal])),
        )  # fmt: skip
        state = ended(problem)
        assert state.status is RunStatus.FAILED
        assert "keeps the limits" in state.reason


def test_a_bound_takes_a_constraint_that_carries_nothing_whatever_it_costs() -> None:
    rows = Bundle(
        np.array([[0.5, 0.0], [-0.2, 0.0]]), np.array([[1.0], [2.0]]), np.zeros((2, 0)), np.full(2, np.nan),
        np.array([0, 1]), np.ones(2, bool), np.zeros(2, int), np.zeros(2),
    )  # fmt: skip
    space = FeasibleSet(np.zeros(1), np.ones(1), LinearRows.none(1), np.ones(1))
    trial = Trial(np.zeros(1), np.array([1.0, 0.0]), np.zeros(0), np.zeros(2), 0.0, True)
    assert lower_bound(rows, trial, np.array([0.3]), space, np.array([5.0])) == pytest.approx(0.2)


@pytest.mark.parametrize("size", [1e160, 1e300])
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("limited", [False, True])
def test_numbers_whose_squares_are_none_end_a_run_with_their_size(size: float, count: int, limited: bool) -> None:
    def functions(x):
        return np.full(count, size * x.sum()), np.full((count, len(x)), size)

    start = np.full(3, 0.5)
    if limited:
        problem = Toy(lambda x: (-x[:1], -np.eye(3)[:1]), start, 0.0, 1.0, constraints=functions)
    else:
        problem = Toy(functions, start, 0.0, 1.0)
    state = ended(problem)
    assert state.status is RunStatus.FAILED
    assert f"{1.5 * size:.2g}, too large to go on with" in state.reason


@pytest.mark.parametrize(("objective", "to_gain", "said"), [(0.0, 0.0, ""), (2.0, np.inf, ""), (-2.0, 2e-5, "1e-05")])
def test_what_is_left_is_told_as_a_share_where_there_is_one(objective: float, to_gain: float, said: str) -> None:
    state = Gsao(Toy(lambda x: (np.array([objective]), np.ones((1, 1))), [0.5], 0.0, 1.0), settings()).start()
    told = safeguards._left(state, to_gain)
    assert bool(told) == bool(said)
    assert said in told
