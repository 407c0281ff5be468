"""The benchmark of the optimiser: its problems, what it knows of them, and how it judges a run."""

import json

import numpy as np
import pytest

from benchmarks.optimum import problems
from benchmarks.optimum.kkt import Rows, residual
from benchmarks.optimum.measure import excess, value_of
from benchmarks.optimum.problems import Problem
from mdstopo import evaluate, simulate


def rows(peaks, slopes, x, lower=0.0, upper=1.0, c=(), c_slopes=(), A=(), b=(), equal=()):
    """Rows of one objective at x."""
    x, n = np.asarray(x, dtype=float), len(x)
    peaks = np.asarray(peaks, dtype=float)
    A = np.array(A, dtype=float).reshape(len(b), n)
    return Rows(
        peaks - peaks.max(), np.array(slopes, dtype=float), np.zeros(len(peaks), dtype=int), np.array(c, dtype=float),
        np.array(c_slopes, dtype=float).reshape(len(c), n), A @ x - np.array(b), A, np.array(equal, dtype=bool),
        x - lower, upper - x,
    )  # fmt: skip


def test_the_residual_vanishes_where_competing_peaks_balance():
    # max(x + y, 2 - x - y, x - y) is least, 1, wherever x + y = 1 and x <= 1.
    found = residual(rows([1.0, 1.0, 0.0], [[1, 1], [-1, -1], [1, -1]], [0.5, 0.5]))
    assert found.scaled < 1e-8
    assert found.objective == pytest.approx([0.5, 0.5, 0.0], abs=1e-8)


def test_the_residual_counts_constraints_volume_rows_and_bounds():
    # Least -x - 2 y under x + y = 1, x >= 0.2: at (0.2, 0.8) the multipliers of both rows are 1 and 2.
    at = [0.2, 0.8]
    found = residual(rows([-1.8], [[-1, -2]], at, c=[0.0], c_slopes=[[-1, 0]], A=[[1, 1]], b=[1], equal=[True]))
    assert found.scaled < 1e-8
    assert found.constraints == pytest.approx([1.0])
    assert found.linear == pytest.approx([2.0])
    # the same with the bound in place of the constraint
    assert residual(rows([-1.8], [[-1, -2]], at, lower=0.2, A=[[1, 1]], b=[1], equal=[True])).scaled < 1e-8


def test_the_residual_is_that_of_a_step_against_the_gradient():
    assert residual(rows([1.0], [[2.0, -0.5]], [0.5, 0.5])).scaled == pytest.approx(0.5, rel=0.1)
    assert residual(rows([1.0], [[2.0, -0.2]], [0.0, 0.5])).scaled == pytest.approx(0.1, rel=0.1)
    # an inactive constraint may not carry a multiplier for nothing
    slack = residual(rows([1.0], [[1.0, 0.0]], [0.5, 0.5], c=[-0.2], c_slopes=[[-1.0, 0.0]]))
    assert 0.1 < slack.scaled < 0.5


def test_every_linkage_has_a_known_optimum_or_a_least_violation():
    kept = json.loads(problems.EXACT.read_text())
    assert len(problems.convex()) >= 10
    for problem in problems.convex():
        assert kept[problem.name]["digest"] == problem.digest, f"make exact.json anew: {problem.name}"
        assert (problem.exact is None) == (problem.violation > 0.0)
    assert sum(problem.exact is None for problem in problems.convex()) >= 3


@pytest.fixture(scope="module")
def four_bar():
    return next(each for each in problems.convex() if each.name == "four-bar tight")


def test_forces_of_a_driven_linkage_are_affine_in_alpha(four_bar):
    case = four_bar.case()
    rng = np.random.default_rng(3)
    one, other = rng.random((2, case.n_design))
    times = np.linspace(0.0, simulate(case, one).t[-1], 50)
    forces = [simulate(case, alpha).at(times).lam for alpha in (one, other, 0.5 * (one + other))]
    assert np.abs(forces[2] - 0.5 * (forces[0] + forces[1])).max() < 1e-6 * np.abs(forces[2]).max()


def test_the_cone_program_agrees_with_a_second_method_and_has_no_residual(four_bar):
    pytest.importorskip("cvxpy")
    pytest.importorskip("clarabel")
    from benchmarks.optimum.cone import exact

    case = four_bar.case()
    found = exact(case)
    assert found.value == pytest.approx(four_bar.exact, rel=1e-5)
    alpha = np.clip(found.alpha, case.lower, case.upper)
    check = evaluate(case, alpha)
    assert value_of(case, check.objectives) == pytest.approx(found.value, rel=1e-5)
    assert excess(case, check.constraints) < 1e-5


def test_a_far_start_is_within_the_bounds_and_the_same_each_time():
    for problem in problems.all():
        first, again = problem.starts()["far"], problem.starts()["far"]
        case = problem.case()
        assert np.array_equal(first, again)
        assert first.shape == (case.space.length,)
        alpha = first[: case.n_design]
        assert np.all((alpha >= case.lower) & (alpha <= case.upper))


def test_an_untrue_word_is_found():
    from benchmarks.optimum.runs import Run, untrue

    problem = Problem("p", "convex", "{}", 10.0, 0.0)
    said = {"problem": "p", "start": "default", "iterations": 50, "value": 10.0, "excess": 0.0, "evaluations": 9,
            "reached": 9, "status": "converged", "reason": "", "kkt": 1e-7, "stated": 1e-7, "untrue": "",
            "seconds": 1.0, "alpha": np.zeros(1), "visited": ()}  # fmt: skip
    assert not untrue(problem, Run(**said), 1e-6)
    assert "residual" in untrue(problem, Run(**{**said, "kkt": 1e-2}), 1e-6)
    assert "limit" in untrue(problem, Run(**{**said, "excess": 1e-2}), 1e-6)
    assert "above" in untrue(problem, Run(**{**said, "value": 11.0}), 1e-6)
    failed = {**said, "status": "failed", "reason": "no design was found that keeps the constraints", "excess": 0.3}
    assert "infeasible" in untrue(problem, Run(**failed), 1e-6)
    impossible = Problem("p", "convex", "{}", None, 0.3)
    assert not untrue(impossible, Run(**failed), 1e-6)
    far = {**failed, "reason": "infeasible: least excess 90 %", "excess": 0.9}
    assert "least" in untrue(impossible, Run(**far), 1e-6)
    assert not untrue(problem, Run(**{**said, "status": "stalled", "kkt": 0.1}), 1e-6)


def test_the_dynamic_problems_are_many_and_can_be_computed():
    assert len(problems.dynamic()) >= 15
    for problem in problems.dynamic():
        case = problem.case()
        found = evaluate(case, gradient=False)
        assert found.status.ok, problem.name
        assert np.isfinite(value_of(case, found.objectives))
    assert any(
        problem.case().n_design >= 1000 and len(problem.case().constraints) == 3 for problem in problems.dynamic()
    )


def test_improvements_are_feasible_and_counted_over_all_starts():
    from benchmarks.optimum.race import improvements, within

    visited = [(1, 5.0, 0.1), (2, 6.0, 0.0), (3, 7.0, 0.0), (4, 4.0, 0.0)]
    found = improvements(visited, before=10)
    assert found == [(12, 6.0), (14, 4.0)]
    assert within(found, 4.0) == 14
    assert within(found, 5.95) == 12
    assert within(found, 3.0) is None


@pytest.mark.parametrize("name", ["belts two stops", "belts product", "machine"])
def test_what_other_optimisers_get_has_the_gradients_of_its_rows(name):
    from benchmarks.optimum.other_solvers import Smooth

    problem = next(each for each in problems.dynamic() if each.name == name)
    smooth = Smooth(problem.case(), budget=50)
    x = smooth.space.reduce(smooth.case.start)
    v = smooth.begin(x)
    rows, slopes = smooth.inequalities(v)
    value, slope = smooth.objective(v)
    along = np.random.default_rng(1).standard_normal(len(v))
    h = 1e-6
    ahead, behind = smooth.inequalities(v + h * along)[0], smooth.inequalities(v - h * along)[0]
    assert (ahead - behind) / (2.0 * h) == pytest.approx(slopes @ along, rel=2e-3, abs=2e-3)
    change = smooth.objective(v + h * along)[0] - smooth.objective(v - h * along)[0]
    assert change / (2.0 * h) == pytest.approx(slope @ along, rel=1e-4)
    assert rows[: len(rows)].shape == (len(slopes),)
    assert np.isfinite(value)
    assert len(smooth.visited) == 3


def test_what_other_optimisers_visit_is_counted_and_ends_with_the_budget():
    from benchmarks.optimum.other_solvers import Smooth, SpentError

    problem = next(each for each in problems.dynamic() if each.name == "isolator")
    smooth = Smooth(problem.case(), budget=2)
    v = smooth.begin(np.array([0.3, 0.2]))
    smooth.inequalities(v)
    smooth.inequalities(v)
    smooth.inequalities(v + 0.1)
    assert [count for count, _, _ in smooth.visited] == [1, 2]
    with pytest.raises(SpentError):
        smooth.inequalities(v + 0.2)


@pytest.mark.parametrize(("method", "module"), [("SLSQP", "nlopt"), ("IPOPT", "casadi")])
def test_other_optimisers_find_the_isolator(method, module):
    pytest.importorskip(module)
    from benchmarks.optimum.other_solvers import attempt

    problem = next(each for each in problems.dynamic() if each.name == "isolator")
    case = problem.case()
    visited = attempt(case, method, case.space.reduce(case.start), 60)
    assert min(value for _, value, over in visited if over < 1e-5) == pytest.approx(problem.exact, rel=1e-4)


def test_the_best_that_is_known_is_that_of_everybody(monkeypatch):
    from benchmarks.optimum import race

    problem = Problem("p", "dynamic", "{}")
    methods = {"A": {"improvements": [[3, 9.0], [7, 8.0]]}, "B": {"improvements": []}}
    monkeypatch.setattr(race, "other_solvers_of", lambda _: {"methods": methods, "ours": 7.5})
    assert race.best_known(problem) == 7.5
    monkeypatch.setattr(race, "other_solvers_of", lambda _: {"methods": methods, "ours": None})
    assert race.best_known(problem) == 8.0
    monkeypatch.setattr(race, "other_solvers_of", lambda _: None)
    assert race.best_known(problem) is None


def test_an_application_is_judged_by_its_limits_and_the_best_of_its_starts(monkeypatch):
    from types import SimpleNamespace

    from benchmarks.optimum import acceptance

    values = iter([(1.0, 0.0), (1.01, 0.0), (0.5, 0.1)])

    def optimized(case, initial=None, starts=1):
        value, over = next(values)
        if initial is not None:
            assert initial.shape == (case.n_design,)
        return SimpleNamespace(
            objectives={each.name: value for each in case.objectives},
            constraints=np.array([over * abs(row.bound) for row in case.constraints]),
            evaluations=10, status="converged",
        )  # fmt: skip

    monkeypatch.setattr(acceptance, "optimize", optimized)
    (table,) = acceptance.applications(("tiedown",))
    assert [row[-1] for row in table.rows] == ["yes", "yes", "NO"]
    values = iter([(18.0, 0.0), (5.9, 0.0), (36.0, 0.0)])
    (table,) = acceptance.eight_starts()
    assert [row[-1] for row in table.rows] == ["yes", "yes", "NO"]
