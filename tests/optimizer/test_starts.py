"""Independent starts: seeded and feasible."""

import numpy as np

from mdstopo.optimizer.driver import Gsao, run
from mdstopo.optimizer.presets import settings
from mdstopo.optimizer.projection import satisfied
from mdstopo.optimizer.starts import best_run, random_feasible

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


def test_failed_and_missing_runs_are_never_the_best():
    runs = []
    for index in (1, 2):
        optimizer = Gsao(make(), settings(max_iterations=3))
        runs.append(run(optimizer, optimizer.start(random_feasible(make(), 0, index))))
    lower = int(runs[1].best_objective < runs[0].best_objective)
    assert best_run(runs, 1e-6) == lower
    assert best_run([None, *runs], 1e-6) == 1 + lower
