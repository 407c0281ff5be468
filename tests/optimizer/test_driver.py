"""The loop as a whole: it descends, stops for a stated reason, survives failures, and resumes to the bit."""

import itertools

import numpy as np
import pytest

from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import reopen, run
from mdstopo.optimizer.nearest_feasible import InfeasibleRows
from mdstopo.optimizer.problem import LinearRows
from mdstopo.optimizer.state import State
from mdstopo.settings.optimizer_presets import PRESETS, settings
from mdstopo.status import RunStatus, Status

from .toys import Toy, compliance, compliance_problem, failing, two_peaks, volume

STRICT = {"decrease_tolerance": 0.0, "change_tolerance": 0.0}


def optimum_of_compliance(weights, bound):
    """x ~ sqrt(w) clipped to the bounds, by bisection."""
    low, high = 1e-9, 1e9
    for _ in range(300):
        middle = np.sqrt(low * high)
        x = np.clip(np.sqrt(weights / middle), 1e-3, 1.0)
        low, high = (middle, high) if x.sum() > bound else (low, middle)
    return np.clip(np.sqrt(weights / high), 1e-3, 1.0)


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_every_preset_solves_the_compliance_problem(preset):
    problem, weights = compliance_problem()
    state = run(Gsao(problem, settings(preset, max_iterations=200)))
    best = np.sum(weights / optimum_of_compliance(weights, 6.0))
    assert state.best_objective == pytest.approx(best, rel=1e-4)
    assert abs(state.best_alpha.sum() - 6.0) < 1e-12


@pytest.mark.parametrize("preset", ["default", "oc", "mma"])
def test_converged_means_a_small_residual_and_says_so(preset):
    problem, _ = compliance_problem()
    state = run(Gsao(problem, settings(preset, STRICT, max_iterations=500, tolerance=1e-5)))
    assert state.status == "converged"
    assert state.kkt <= 1e-5
    assert "KKT residual" in state.reason


def test_tied_peaks_are_found_tied():
    problem, a, b = two_peaks()
    state = run(Gsao(problem, settings(max_iterations=100)))
    best = 0.25 * np.sum((a - b) ** 2)
    assert state.best_objective == pytest.approx(best, rel=1e-6)
    rows, _ = problem.functions(state.best_alpha)
    assert rows[0] == pytest.approx(rows[1], rel=1e-6)


def test_following_only_the_highest_peak_is_worse():
    """Why competing peaks are rows: with one row the maximum of two functions zigzags."""
    results = {}
    for peaks in (1, 4):
        problem, _, _ = two_peaks()
        results[peaks] = run(Gsao(problem, settings(overrides={"peaks": peaks}, max_iterations=25))).best_objective
    assert results[4] < 0.999 * results[1]


def test_the_best_design_is_never_worse_than_any_evaluated():
    problem, _ = compliance_problem(seed=3)
    for preset in PRESETS:
        state = run(Gsao(problem, settings(preset, max_iterations=30)))
        assert state.best_objective == min(state.history.objective)
        assert problem.evaluate(state.best_alpha).objective == state.best_objective


def test_trust_region_accepts_only_decreases():
    rng = np.random.default_rng(8)
    k = rng.uniform(1, 9, 15)

    def functions(x):
        return np.array([np.sum(np.sin(k * x * 3) + x**2)]), (3 * k * np.cos(k * x * 3) + 2 * x)[None, :]

    state = run(Gsao(Toy(functions, np.full(15, 0.5), 0.0, 1.0), settings(max_iterations=40)))
    taken = [f for f, ok in zip(state.history.objective, state.history.accepted, strict=True) if ok]
    assert not all(state.history.accepted)
    assert all(later < earlier for earlier, later in itertools.pairwise(taken))
    assert state.objective == taken[-1] == state.best_objective


def test_iterates_respect_bounds_and_volume_rows():
    problem, _ = compliance_problem(equal=True)
    problem.linear = LinearRows(
        np.stack([np.ones(30), np.r_[np.ones(10), np.zeros(20)], np.zeros(30)]),
        np.array([6.0, 1.5, 0.0]),
        np.array([True, False, False]),
    )
    run(Gsao(problem, settings(max_iterations=30)))
    for x in problem.evaluated:
        assert np.all(x >= problem.lower)
        assert np.all(x <= problem.upper)
        assert abs(x.sum() - 6.0) < 1e-12
        assert x[:10].sum() < 1.5 + 1e-12


def test_an_infeasible_start_is_projected():
    problem, _ = compliance_problem()
    problem.initial = np.full(30, 0.9)
    state = Gsao(problem, settings()).start()
    assert abs(state.alpha.sum() - 6.0) < 1e-12
    problem.linear = volume(30, 31.0, True)
    with pytest.raises(InfeasibleRows):
        Gsao(problem, settings()).start()


def test_crossed_bounds_are_refused():
    problem, _ = compliance_problem()
    problem.lower = problem.lower + 2.0
    with pytest.raises(ValueError, match="lower bound"):
        Gsao(problem, settings())


@pytest.mark.parametrize("n", [1, 2])
def test_very_few_variables(n):
    problem = Toy(compliance(np.ones(n)), np.full(n, 0.3), 0.1, 1.0)
    state = run(Gsao(problem, settings()))
    assert state.status == "converged"
    np.testing.assert_allclose(state.best_alpha, 1.0, atol=1e-6)


def test_all_variables_fixed_converges_at_once():
    problem = Toy(compliance(np.ones(4)), np.full(4, 0.3), 0.3, 0.3)
    state = run(Gsao(problem, settings()))
    assert state.status == "converged"
    assert state.evaluations == 1
    assert np.array_equal(state.best_alpha, np.full(4, 0.3))


def test_zero_gradient_converges_at_once():
    problem = Toy(lambda x: (np.ones(1), np.zeros((1, 4))), np.full(4, 0.3), 0.0, 1.0, volume(4, 1.2, True))
    state = run(Gsao(problem, settings()))
    assert state.status == "converged"
    assert state.evaluations == 1


def test_nonlinear_constraints_are_met_from_an_infeasible_start():
    n = 10

    def inside_ball(x):
        return np.array([np.sum((x - 0.8) ** 2) - 0.05]), 2 * (x - 0.8)[None, :]

    problem = Toy(
        lambda x: (np.array([np.sum(x)]), np.ones((1, n))), np.full(n, 0.2), 0.0, 1.0, constraints=inside_ball
    )
    state = run(Gsao(problem, settings(max_iterations=100)))
    assert state.best_violation < 1e-6
    assert state.best_objective == pytest.approx(n * 0.8 - np.sqrt(n * 0.05), rel=1e-5)
    assert np.asarray(state.history.nonlinear).shape == (len(state.history), 1)


@pytest.mark.parametrize(
    ("preset", "n", "most"),
    [("default", 5, 30), ("default", 20, 30), ("default", 100, 30), ("slp", 5, 60), ("slp", 20, 60)],
)
def test_the_optimiser_follows_a_curved_limit(preset, n, most):
    """From a point on a sphere along it to the lowest: steps violate the limit in second order, and must not shrink."""
    rng = np.random.default_rng(3)
    slope = rng.uniform(-1.0, 1.0, n)
    slope /= np.linalg.norm(slope)
    away = rng.normal(size=n)
    radius = 0.45

    def sphere(x):
        return np.array([np.sum((x - 0.5) ** 2) - radius**2]), 2.0 * (x - 0.5)[None, :]

    problem = Toy(
        lambda x: (np.array([10.0 + slope @ x]), slope[None, :].copy()),
        0.5 + radius * away / np.linalg.norm(away),
        0.0,
        1.0,
        constraints=sphere,
    )
    state = run(Gsao(problem, settings(preset, max_iterations=most)))
    assert state.best_violation <= 1e-6
    assert state.best_objective == pytest.approx(10.0 + slope.sum() / 2.0 - radius, abs=1e-4)


def test_a_constraint_that_cannot_be_met_ends_at_the_least_violation():
    problem = Toy(
        lambda x: (np.array([np.sum(x)]), np.ones((1, 3))),
        np.full(3, 0.2),
        0.0,
        1.0,
        constraints=lambda x: (np.array([4.0 - np.sum(x)]), -np.ones((1, 3))),
    )
    state = run(Gsao(problem, settings(max_iterations=60)))
    np.testing.assert_allclose(state.best_alpha, 1.0, atol=1e-6)
    assert state.best_violation == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_where_no_design_keeps_a_limit_the_one_that_misses_it_least_is_kept(seed: int) -> None:
    """Its gradient vanishes there: as a change of a variable the violation is large."""
    least = np.random.default_rng(seed).uniform(0.2, 0.8, 3)

    def limit(x):
        return np.array([0.3 + np.sum((x - least) ** 2)]), 2.0 * (x - least)[None, :]

    problem = Toy(
        lambda x: (np.array([1.0 + np.sum(x)]), np.ones((1, 3))), np.full(3, 0.5), 0.0, 1.0, constraints=limit
    )
    state = run(Gsao(problem, settings(max_iterations=30)))
    seen = [float(limit(x)[0][0]) for x in problem.evaluated]
    assert state.best_plain == min(seen)
    assert float(limit(state.best_alpha)[0][0]) == min(seen)


# Failures.


def test_a_failed_evaluation_is_a_rejected_step_and_the_run_goes_on():
    problem, weights = compliance_problem()
    state = run(Gsao(failing(problem, {2, 3}), settings(max_iterations=200)))
    best = np.sum(weights / optimum_of_compliance(weights, 6.0))
    assert state.best_objective == pytest.approx(best, rel=1e-4)
    assert np.isnan(state.history.objective[2:4]).all()
    assert state.history.accepted[2:4] == [False, False]
    assert len(state.history.info["objectives"]) == len(state.history)
    assert np.isnan(state.history.info["objectives"][2]).all()


@pytest.mark.parametrize("preset", ["default", "mma"])
def test_steps_shrink_towards_the_iterate_while_evaluations_fail(preset):
    problem, _ = compliance_problem()
    failing(problem, {1, 2, 3})
    state = run(Gsao(problem, settings(preset, max_iterations=3)))
    moves = [np.abs(x - problem.evaluated[0]).max() for x in problem.evaluated[1:]]
    assert moves[1] <= 0.51 * moves[0]
    assert moves[2] <= 0.51 * moves[1]
    assert np.array_equal(state.alpha, problem.evaluated[0])
    assert state.status == "max_iterations"


def test_a_run_whose_evaluations_keep_failing_gives_up_with_the_reason_and_the_best():
    problem, _ = compliance_problem()
    state = run(Gsao(failing(problem, set(range(3, 100))), settings(overrides={"failures": 3}, max_iterations=99)))
    assert state.status == "failed"
    assert Status.ZERO_LENGTH.value in state.reason
    assert "belts[3]" in state.reason
    assert state.evaluations == 3 + 4
    assert state.best_objective == min(f for f in state.history.objective if np.isfinite(f))


def test_a_failed_start_fails_the_run():
    problem, _ = compliance_problem()
    state = run(Gsao(failing(problem, {0}), settings()))
    assert state.status == "failed"
    assert "initial design" in state.reason
    assert np.array_equal(state.best_alpha, state.alpha)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_gradient_that_is_not_finite_is_a_failed_evaluation(bad):
    problem, weights = compliance_problem()
    inner, count = problem.functions, iter(range(1000))

    def functions(x):
        rows, gradients = inner(x)
        if next(count) == 1:
            gradients = gradients.copy()
            gradients[0, 3] = bad
        return rows, gradients

    problem.functions = functions
    state = run(Gsao(problem, settings(max_iterations=200)))
    best = np.sum(weights / optimum_of_compliance(weights, 6.0))
    assert state.history.accepted[1] is False
    assert state.history.failure[:3] == ["", Status.NON_FINITE.value, ""]
    assert np.isfinite(state.gradients).all()
    assert state.best_objective == pytest.approx(best, rel=1e-4)


# Stops, state and resuming.


def test_the_iteration_limit_counts_evaluations_after_the_first():
    problem, _ = compliance_problem()
    state = run(Gsao(problem, settings(max_iterations=3, tolerance=0.0)))
    assert state.status == "max_iterations"
    assert state.evaluations == len(problem.evaluated) == 4
    assert "3 iterations" in state.reason
    none = run(Gsao(problem, settings(max_iterations=0)))
    assert none.status == "max_iterations"
    assert none.evaluations == 1


def test_small_decreases_twice_running_end_a_run_as_stalled_where_the_residual_is_larger_than_asked_for():
    problem, _ = compliance_problem()
    overrides = {"decrease_tolerance": 0.01, "bundle": False}
    state = run(Gsao(problem, settings(overrides=overrides, max_iterations=99, tolerance=0.0)))
    assert state.status == "stalled"
    assert "residual" in state.reason
    assert state.iteration < 99


def test_a_run_that_has_ended_takes_no_step():
    problem, _ = compliance_problem()
    optimizer = Gsao(problem, settings(max_iterations=1, tolerance=0.0))
    with pytest.raises(ValueError, match="has ended"):
        optimizer.step(run(optimizer))


def test_history_has_a_row_for_each_evaluation():
    problem, _ = compliance_problem()
    state = run(Gsao(problem, settings(max_iterations=7, tolerance=0.0)))
    arrays = state.history.to_arrays()
    assert arrays["evaluations"].tolist() == list(range(1, 9))
    assert arrays["constraints"].shape == (8, 1)
    assert arrays["info/objectives"].shape == (8, 1)
    assert np.all(np.diff(arrays["seconds"]) >= 0)
    assert arrays["change"][0] == 0
    origin = problem.evaluated[0]
    for x, taken, change in zip(problem.evaluated, arrays["accepted"], arrays["change"], strict=True):
        assert change == np.abs(x - origin).max()
        origin = x if taken else origin


def same(a: State, b: State) -> None:
    """Equal to the bit, wall time apart."""
    left, right = a.to_arrays(), b.to_arrays()
    assert left.keys() == right.keys()
    for name in left:
        if "seconds" not in name:
            assert left[name].dtype == right[name].dtype, name
            assert left[name].tobytes() == right[name].tobytes(), name


@pytest.mark.parametrize("preset", sorted(PRESETS))
@pytest.mark.parametrize("k", [0, 1, 2, 5])
def test_resuming_from_stored_arrays_is_exact(preset, k):
    problem, _, _ = two_peaks()
    optimizer = Gsao(problem, settings(preset, max_iterations=12, tolerance=0.0))
    straight = run(optimizer)
    state = optimizer.start()
    for _ in range(k):
        state = optimizer.step(state)
    arrays = {name: np.array(array) for name, array in state.to_arrays().items()}
    resumed = State.from_arrays(arrays)
    same(resumed, state)
    same(run(Gsao(problem, settings(preset, max_iterations=12, tolerance=0.0)), resumed), straight)


def test_why_evaluations_failed_is_kept_with_a_state_and_older_states_have_no_reasons():
    problem, _ = compliance_problem()
    optimizer = Gsao(failing(problem, {2}), settings(max_iterations=4, tolerance=0.0))
    state = run(optimizer)
    words = f"{Status.ZERO_LENGTH.value} (belts[3])"
    assert state.history.failure == ["", "", words, "", ""]
    arrays = state.to_arrays()
    same(State.from_arrays(arrays), state)
    del arrays["history/failure"]
    assert State.from_arrays(arrays).history.failure == [""] * 5


def test_a_raised_limit_continues_a_finished_run_exactly():
    problem, _ = compliance_problem()
    short = run(Gsao(problem, settings(max_iterations=4, tolerance=0.0)))
    longer = Gsao(problem, settings(max_iterations=9, tolerance=0.0))
    reopened = reopen(longer, State.from_arrays(short.to_arrays()))
    assert reopened.status is RunStatus.RUNNING
    same(run(longer, reopened), run(longer))


def test_a_missing_array_is_named():
    problem, _ = compliance_problem()
    arrays = Gsao(problem, settings()).start().to_arrays()
    del arrays["shift"]
    with pytest.raises(KeyError, match="shift"):
        State.from_arrays(arrays)


def test_states_of_files_that_do_not_name_their_optimiser_are_those_of_gsao():
    problem, _ = compliance_problem()
    state = Gsao(problem, settings()).start()
    arrays = state.to_arrays()
    del arrays["optimizer"]
    same(State.from_arrays(arrays), state)


def test_an_interruption_between_iterations_loses_nothing():
    problem, _ = compliance_problem()
    optimizer = Gsao(problem, settings(max_iterations=10, tolerance=0.0))
    seen = []
    half = run(optimizer, on_iteration=seen.append, stop_requested=lambda: len(seen) == 4)
    assert half.running
    assert half.iteration == 3
    same(run(optimizer, half), run(optimizer))


def test_states_are_not_changed_by_later_steps():
    problem, _ = compliance_problem()
    optimizer = Gsao(problem, settings(max_iterations=10, tolerance=0.0))
    first = optimizer.start()
    before = {name: array.tobytes() for name, array in first.to_arrays().items()}
    run(optimizer, first)
    assert before == {name: array.tobytes() for name, array in first.to_arrays().items()}
