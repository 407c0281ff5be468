"""Independent starts: seeded and feasible."""

import numpy as np
import pytest

from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.nearest_feasible import satisfied
from mdstopo.optimizer.start_families import (
    Family,
    begins_at_best,
    best_run,
    design_of_family,
    family_of,
    neighbour,
    random_feasible,
    sparse,
    uniform,
)
from mdstopo.settings.optimizer_presets import settings
from tests.optimizer.toys import Toy, volume


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


def test_families_take_turns_between_the_first_starts_and_those_that_begin_at_the_best():
    families = [family_of(index, 8) for index in range(8)]
    assert families[:2] == [Family.STATED, Family.SOFTENED]
    assert families[2:5] == [Family.RANDOM, Family.SPARSE, Family.UNIFORM]
    assert families[5:] == [Family.NEIGHBOUR, Family.OTHER_FROM, Family.OTHER_TO]
    for starts, last in ((1, 0), (3, 0), (4, 1), (6, 2), (20, 3)):
        assert sum(begins_at_best(family_of(index, starts)) for index in range(starts)) == last


@pytest.mark.parametrize("family", [Family.RANDOM, Family.SPARSE, Family.UNIFORM, Family.NEIGHBOUR, Family.OTHER_TO])
def test_designs_of_every_family_keep_bounds_and_rows_and_can_be_repeated(family):
    problem, best = make(40), np.linspace(0.1, 0.9, 40)
    x = design_of_family(problem, 3, 5, family, best)
    assert satisfied(x, problem.linear)
    assert np.all((x >= problem.lower) & (x <= problem.upper))
    assert np.array_equal(x, design_of_family(make(40), 3, 5, family, best))
    assert not np.array_equal(x, design_of_family(problem, 4, 5, family, best))


def test_stated_and_softened_starts_begin_at_the_problem_s_own_design():
    assert design_of_family(make(), 0, 0, Family.STATED) is None
    assert design_of_family(make(), 0, 1, Family.SOFTENED) is None


def test_the_last_variables_of_a_problem_that_has_even_ones_are_uniform():
    """Whatever the family, they are the numbers that are drawn; without `even` they follow the family."""
    free = Toy(bumpy, np.full(8, 0.5), 0.0, 1.0)
    drawn = uniform(free, 0, 1)
    assert not np.allclose(random_feasible(free, 0, 1)[-3:], drawn[-3:])
    free.even = 3
    for make_design in (random_feasible, sparse):
        x = make_design(free, 0, 1)
        assert np.array_equal(x[-3:], drawn[-3:])
        assert not np.allclose(x[:-3], drawn[:-3])


def test_a_neighbour_has_the_best_design_s_values_most_of_them_in_their_place():
    free, best = Toy(bumpy, np.full(40, 0.5), 0.0, 1.0), np.linspace(0.0, 1.0, 40)
    x = neighbour(free, 0, 1, best)
    assert np.allclose(np.sort(x), best)
    assert 0 < np.count_nonzero(x != best) < 20


def test_where_no_member_s_strength_varies_no_start_is_softened():
    families = [family_of(index, 8, softens=False) for index in range(8)]
    assert Family.SOFTENED not in families
    assert families[0] is Family.STATED
    assert families[2:] == [family_of(index, 8) for index in range(2, 8)]
