"""Objectives without peaks: the bundle method goes by their curvature rather than by rows from far off."""

import numpy as np
import pytest
from scipy.optimize import minimize

from mdstopo.case.reader import read_case
from mdstopo.design_problem import DesignProblem
from mdstopo.engine import Evaluator
from mdstopo.optimizer import competing_rows
from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.bundle_method import FARTHEST, LEAST_LEFT, MOST_LEFT, RELIABLE_STEPS, _share_to_least
from mdstopo.optimizer.curvature import learnt
from mdstopo.optimizer.gsao import HAND_OVER, Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import Sample
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus
from tests.optimizer.toys import Toy, shaken_block


def ended(problem, smooth):
    problem.competes, problem.smooth = True, smooth
    return run(Gsao(problem, settings(max_iterations=150)))


@pytest.mark.parametrize(("n", "share", "seed"), [(40, 0.3, 0), (80, 0.3, 1), (80, 0.15, 2)])
def test_a_smooth_objective_converges_in_fewer_evaluations_than_one_of_which_peaks_may_rise(n, share, seed) -> None:
    smooth = ended(shaken_block(n, share, seed), smooth=True)
    careful = ended(shaken_block(n, share, seed), smooth=False)
    assert smooth.status is RunStatus.CONVERGED
    assert smooth.evaluations < 0.85 * careful.evaluations
    assert smooth.best_objective <= careful.best_objective * (1.0 + 1e-8)


def test_the_end_of_a_smooth_objective_is_an_optimum_of_another_method_too() -> None:
    problem = shaken_block(40, 0.3)
    state = ended(problem, smooth=True)

    def value(x):
        sample = problem.evaluate(x)
        return sample.objective, sample.gradients[0]

    row = problem.linear
    limit = {"type": "ineq", "fun": lambda x: float(row.b[0] - row.A[0] @ x), "jac": lambda x: -row.A[0]}
    bounds = [(0.0, 1.0)] * len(problem.lower)
    found = minimize(value, state.best_alpha, jac=True, bounds=bounds, constraints=[limit], method="SLSQP",
                     options={"ftol": 1e-14, "maxiter": 200})  # fmt: skip
    assert found.fun >= state.best_objective * (1.0 - 1e-7)


@pytest.mark.parametrize(("promise", "actual", "share"), [(1.0, -1.0, 0.25), (2.0, -6.0, 0.125)])
def test_a_rejected_step_is_shortened_to_where_the_parabola_through_its_ends_is_least(promise, actual, share) -> None:
    """m(t) = -promise t + (promise - actual) t^2, whose value at 1 is -actual."""
    t = np.linspace(0.0, 1.0, 801)
    assert t[np.argmin((promise - actual) * t**2 - promise * t)] == pytest.approx(share)
    assert _share_to_least(promise, actual) == pytest.approx(share)


def test_a_rejected_step_is_shortened_neither_to_nothing_nor_hardly() -> None:
    assert _share_to_least(1.0, -1e6) == LEAST_LEFT
    assert _share_to_least(1.0, 0.999) == MOST_LEFT
    assert _share_to_least(0.0, 0.0) == MOST_LEFT


def test_rows_from_far_off_are_dropped_but_for_own_ones_and_those_of_other_groups() -> None:
    rows, slopes = np.array([3.0, 2.0]), np.eye(2)
    own = Bundle.of(Sample(3.0, rows, slopes, np.array([0.5]), np.ones((1, 2))), np.arange(2))
    both = own.moved(np.zeros(2), 4.0).joined(own.moved(np.zeros(2), 1.0)).joined(own)
    kept = both.without_far(0, 2.0)
    assert kept.group.tolist() == [1, 0, 0, 1, 0, 0, 1]
    assert kept.distance.tolist() == [4.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]


def test_no_row_of_a_smooth_objective_is_kept_that_was_seen_farther_away_than_some_last_steps() -> None:
    problem = shaken_block(40, 0.3)
    problem.competes, problem.smooth = True, True
    optimizer = Gsao(problem, settings(max_iterations=30))
    state, kept = optimizer.start(), 0
    while state.running:
        before = state
        state = optimizer.step(before)
        rows = state.bundle.subset((state.bundle.group == 0) & ~state.bundle.own)
        step = float(np.linalg.norm(before.trial - before.alpha))
        assert (rows.distance <= FARTHEST * step * (1.0 + 1e-12)).all()
        kept += len(rows)
    assert kept > 0


def test_the_curvature_of_a_smooth_objective_keeps_its_steep_directions() -> None:
    """x^2 + 1e-4 y^2, learnt along x and then along y."""
    steps, changes = np.eye(2), np.diag([2.0, 2e-4])
    assert learnt(steps, changes, 1e-6, scaled_down=False).dense()[0, 0] == pytest.approx(2.0)
    assert learnt(steps[::-1], changes[::-1], 1e-6, scaled_down=True).dense()[1, 1] < 0.1


def test_curvature_is_scaled_down_as_a_whole_but_for_smooth_objectives(monkeypatch) -> None:
    for smooth in (True, False):
        asked = []

        def known(steps, changes, floor, scaled_down, first, asked=asked):
            if len(steps):
                asked.append(scaled_down)
            return learnt(steps, changes, floor, scaled_down, first)

        monkeypatch.setattr(competing_rows, "learnt", known)
        ended(shaken_block(10, 0.3), smooth)
        assert set(asked) == {not smooth}


SCENE = """
format: 1
time: {end: 0.2}
bodies: {block: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0]}}
points:
  wall: {body: ground, grid: {line: {from: [-1, 0], to: [1, 0.2], count: 2}}}
  on_block: {body: block, grid: {line: {from: [0, 0], to: [0.1, 0.1], count: 2}}}
members: {springs: {from: wall, to: on_block, law: {type: spring, stiffness: 10}}}
design: {initial: 0.5, lower: 0, upper: 1}
"""
WAY, FORCE = "{displacement: {body: block, component: x}}", "{member_force: {group: springs}}"


@pytest.mark.parametrize(
    ("response", "over_time", "smooth"),
    [(WAY, "rms", True), (WAY, "integral", True), (WAY, "final", True), (WAY, "max", False), (WAY, "max_abs", False),
     (FORCE, "final", False), (FORCE, "mean", True)],
)  # fmt: skip
def test_objectives_are_smooth_where_no_peak_that_was_not_told_can_rise(response, over_time, smooth) -> None:
    text = f"{SCENE}objectives: {{G: {{response: {response}, over_time: {over_time}}}}}\n"
    assert DesignProblem(Evaluator(read_case(text))).smooth is smooth


def bundles(here, there, multipliers):
    """The bundle of one row of the objective with slope `here`, one from elsewhere, and that of the trial, `there`."""
    slopes = np.array([here, [9.0, 9.0]])
    bundle = Bundle.of(Sample(1.0, np.ones(1), slopes[:1], np.zeros(0), np.zeros((0, 2))), np.arange(1))
    elsewhere = Bundle.of(Sample(1.0, np.ones(1), slopes[1:], np.zeros(0), np.zeros((0, 2))), np.arange(1))
    new = Bundle.of(Sample(1.0, np.ones(1), np.array([there]), np.zeros(0), np.zeros((0, 2))), np.arange(1))
    return bundle.joined(elsewhere.moved(np.ones(2), 1.0)), new, np.array(multipliers)


@pytest.mark.parametrize("multipliers", [[1.0, 0.0], [0.3, 0.7], [0.0, 1.0]])
def test_curvature_is_learnt_from_the_only_row_of_a_smooth_objective_however_its_gradient_turns(multipliers) -> None:
    bundle, new, y = bundles([1.0, 0.0], [-0.5, 2.0], multipliers)
    assert bundle.own.tolist() == [True, False]
    change = competing_rows.gradient_change(bundle, new, np.ones(2), y, smooth=True)
    assert change == pytest.approx([-1.5, 2.0])
    assert competing_rows.gradient_change(bundle, new, np.ones(2), y, smooth=False) is None


def test_rows_whose_gradients_turn_far_are_others_where_a_smooth_objective_has_several() -> None:
    one = Sample(1.0, np.ones(2), np.array([[1.0, 0.0], [0.0, 1.0]]), np.zeros(0), np.zeros((0, 2)))
    other = Sample(1.0, np.ones(2), np.array([[-1.0, 0.1], [0.1, 1.0]]), np.zeros(0), np.zeros((0, 2)))
    bundle, new = (Bundle.of(sample, np.arange(2)) for sample in (one, other))
    change = competing_rows.gradient_change(bundle, new, np.ones(2), np.array([0.25, 0.75]), smooth=True)
    assert change == pytest.approx([0.75 * 0.1, 0.0])


def test_a_curved_valley_is_followed_to_its_end() -> None:
    """Rosenbrock's function of ten numbers, whose gradient turns by more than 60 degrees in most steps."""

    def rows(x):
        z = 2.4 * x - 1.2
        beside, slope = z[1:] - z[:-1] ** 2, np.zeros(len(x))
        slope[1:] += 200.0 * beside
        slope[:-1] -= 400.0 * z[:-1] * beside + 2.0 * (1.0 - z[:-1])
        return np.array([1.0 + float((100.0 * beside**2 + (1.0 - z[:-1]) ** 2).sum())]), 2.4 * slope[None]

    state = ended(Toy(rows, np.full(10, 0.1), 0.0, 1.0), smooth=True)
    assert state.evaluations < 110
    assert state.best_objective == pytest.approx(1.0, abs=1e-9)


def test_a_smooth_energy_goes_on_by_curvature_after_the_separable_model_has_had_its_turn() -> None:
    """The separable model begins where rows do not compete; an objective that may have peaks stays with it."""
    last = {}
    for smooth in (True, False):
        problem = shaken_block(40, 0.3)
        problem.competes, problem.smooth = False, smooth
        optimizer = Gsao(problem, settings(max_iterations=HAND_OVER + 1))
        state, uses = optimizer.start(), []
        while state.running:
            state = optimizer.step(state)
            uses.append(state.uses_bundle)
        assert not any(uses[: HAND_OVER - 1])
        last[smooth] = uses[HAND_OVER - 1 :]
    assert last == {True: [True, True], False: [False, False]}


def valley(n, spread, rounding, seed=0):
    """A quadratic with curvatures from 1 to 1/spread in oblique directions; see `quadratic`."""
    return quadratic(np.logspace(0.0, -np.log10(spread), n), rounding, seed)


def quadratic(curvatures, rounding, seed=0):
    """A quadratic with these curvatures in oblique directions, 1 at its least value inside the bounds.

    rounding: relative, of values, and of gradients in the largest entry, as that of adaptive steps.
    """
    n = len(curvatures)
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
    matrix = (turn * curvatures) @ turn.T
    least = rng.uniform(0.2, 0.8, n)

    def functions(x):
        away = x - least
        slope = matrix @ away
        wave = np.sin(3e6 * x * np.arange(1, n + 1))
        value = (1.0 + 0.5 * away @ slope) * (1.0 + rounding * np.sin(1e7 * x.sum()))
        return np.array([value]), (slope + rounding * np.abs(slope).max() * wave)[None]

    return Toy(functions, rng.uniform(0.05, 0.95, n), 0.0, 1.0)


@pytest.mark.parametrize("rounding", [0.0, 1e-9, 1e-7])
@pytest.mark.parametrize("spread", [1e2, 1e4, 1e7])
@pytest.mark.parametrize("n", [8, 20])
def test_a_smooth_run_that_says_converged_leaves_less_than_its_tolerance(n, spread, rounding) -> None:
    problem = valley(n, spread, rounding)
    problem.competes, problem.smooth = True, True
    state = run(Gsao(problem, settings(max_iterations=400)))
    exact = float(valley(n, spread, 0.0).functions(state.best_alpha)[0][0]) - 1.0
    if not rounding and spread < 1e7:
        assert state.status is RunStatus.CONVERGED
    assert state.status is not RunStatus.CONVERGED or exact < 1e-6


@pytest.mark.parametrize("rounding", [0.0, 1e-9])
@pytest.mark.parametrize(("steep", "flat"), [(1e4, 1e-3), (1e6, 1e-4), (1e3, 1e-6)])
@pytest.mark.parametrize(("n", "stiff"), [(3, 1), (6, 2), (20, 5)])
def test_what_is_flat_behind_what_is_stiff_is_not_taken_for_an_optimum(n, stiff, steep, flat, rounding) -> None:
    """Stiff directions are learnt first, and their curvature promises nothing along flat ones, which have 1e-5 to 1e-3
    of the objective to go."""
    problem = quadratic(np.where(np.arange(n) < stiff, steep, flat), rounding)
    problem.competes, problem.smooth = True, True
    state = run(Gsao(problem, settings(max_iterations=300)))
    exact = float(problem.functions(state.best_alpha)[0][0]) - 1.0
    assert state.status is not RunStatus.CONVERGED or exact < 1e-6


def test_a_flat_optimum_converges_by_the_curvature_that_foretold_the_last_steps() -> None:
    """Its residual is no less than 1e-5: the gradient is rounding, in units that have become as small."""
    problem = valley(20, 1e7, 0.0)
    problem.competes, problem.smooth = True, True
    state = run(Gsao(problem, settings(max_iterations=400)))
    assert state.status is RunStatus.CONVERGED
    assert "the curvature that was learnt had promised" in state.reason
    assert state.kkt > 1e-6
    assert state.least_predicted <= 1e-7 * state.objective


def test_a_long_valley_of_many_variables_is_not_crept_along() -> None:
    """With as many steps as variables to learn curvature from, 300 evaluations left 5e-10 of the objective."""
    problem = valley(60, 1e4, 0.0)
    problem.competes, problem.smooth = True, True
    state = run(Gsao(problem, settings(max_iterations=160)))
    assert state.status is RunStatus.CONVERGED
    assert state.best_objective < 1.0 + 1e-9


def test_a_promise_that_a_step_exceeds_tenfold_counts_no_more() -> None:
    problem = valley(8, 1e4, 0.0)
    problem.competes, problem.smooth = True, True
    optimizer = Gsao(problem, settings(max_iterations=400))
    state = optimizer.start()
    while state.reliable_steps < RELIABLE_STEPS:
        state = optimizer.step(state)
    state.least_predicted = 1e-2 * state.predicted
    after = optimizer.step(state)
    assert after.history.accepted[-1]
    assert after.least_predicted > state.least_predicted
