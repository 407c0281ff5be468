"""Independent starts: seeded, feasible, the same for any number of workers."""

import functools

import numpy as np
import pytest

from mdstopo.optimizer.presets import settings
from mdstopo.optimizer.projection import satisfied
from mdstopo.optimizer.starts import best_run, random_feasible, run_starts

from .toys import Toy, volume


def bumpy(x):
    k = np.linspace(5.0, 9.0, len(x))
    return np.array([np.sum(np.sin(k * x) + 0.3 * x)]), (k * np.cos(k * x) + 0.3)[None, :]


def make(n=8):
    return Toy(bumpy, np.full(n, 0.5), 0.0, 1.0, volume(n, 0.5 * n, True))


def test_random_designs_are_feasible_and_depend_on_seed_and_number_alone():
    problem = make()
    designs = [random_feasible(problem, 0, i) for i in (1, 2)] + [random_feasible(problem, 1, 1)]
    for x in designs:
        assert satisfied(x, problem.linear)
        assert np.all((x >= problem.lower) & (x <= problem.upper))
    assert not np.allclose(designs[0], designs[1])
    assert not np.allclose(designs[0], designs[2])
    assert np.array_equal(designs[1], random_feasible(make(), 0, 2))


def test_the_first_start_is_the_initial_design_and_the_best_is_reported():
    found = run_starts(make, settings(max_iterations=20), 6, seed=3)
    assert np.array_equal(found.runs[0].history.objective[0], make().evaluate(np.full(8, 0.5)).objective)
    values = [state.best_objective for state in found.runs]
    assert found.best == int(np.argmin(values))
    assert found.complete
    assert len({round(v, 6) for v in values}) > 1


def test_workers_change_no_bit():
    here = run_starts(functools.partial(make, 8), settings(max_iterations=10), 3, seed=1)
    there = run_starts(functools.partial(make, 8), settings(max_iterations=10), 3, seed=1, workers=2)
    for a, b in zip(here.runs, there.runs, strict=True):
        assert a.best_alpha.tobytes() == b.best_alpha.tobytes()
        assert a.history.objective == b.history.objective
    assert here.best == there.best


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_set_of_starts_continues_where_it_was(workers):
    limits = settings(max_iterations=10)
    straight = run_starts(make, limits, 4, seed=2)
    done = []
    partly = run_starts(
        make,
        limits,
        4,
        seed=2,
        workers=workers,
        on_start=lambda i, s: done.append(i),
        stop_requested=lambda: len(done) >= 1,
    )
    rest = run_starts(make, limits, 4, seed=2, workers=workers, states=partly.runs)
    assert rest.complete
    for a, b in zip(straight.runs, rest.runs, strict=True):
        assert a.history.objective == b.history.objective


def test_failed_and_missing_runs_are_never_the_best():
    found = run_starts(make, settings(max_iterations=3), 2)
    runs = [None, *found.runs]
    assert best_run(runs, 1e-6) == 1 + found.best
