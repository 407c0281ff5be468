"""The plan on problems whose fronts are known, without mechanics."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo.front.directions import lattice, weights_of_first
from mdstopo.plan.front_measures import neighbour_gaps
from mdstopo.plan.front_plan import NoEndError, Planner, Request, Starts
from mdstopo.plan.solve_task import Found
from mdstopo.status import RunStatus


def solver(objectives, candidates, reach=np.inf, broken=()):
    """Solves a task exactly among the candidates (K, N) that lie within reach of its start."""

    def solve(task):
        near = [x for x in candidates if np.linalg.norm(x - task.start) <= reach]
        one = task.scalarisation
        table = np.array([objectives(x) for x in near])
        values = one.values(table) + 1e3 * one.excesses(table)
        best = near[int(np.argmin(values))] if near else task.start
        failed = task.point in broken
        g = np.full(len(objectives(best)), np.nan) if failed else objectives(best)
        status = RunStatus.FAILED if failed else RunStatus.CONVERGED
        word = "it is broken" if failed else "found"
        return Found(
            point=task.point,
            key="",
            alpha=best,
            objectives=g,
            combined=min(values, default=0.0),
            status=status,
            reason=word,
            evaluations=1,
            kkt=0.0,
            violation=0.0,
            visited=g[None],
        )

    return solve


def carried_out(request, solve):
    planner = Planner(request)
    rounds = planner.rounds()
    tasks = next(rounds)
    sizes = []
    while True:
        sizes.append(len(tasks))
        try:
            tasks = rounds.send([solve(task) for task in tasks])
        except StopIteration as end:
            return end.value, sizes


def request(directions, method, signs=None, start=(0.5,), **changes):
    m = directions.shape[1]
    starts = Starts(np.array(start, dtype=np.float64))
    values = {"exponent": 2.0, "normalize": True, "iterations": 10} | changes
    return Request(directions, method, signs=np.ones(m) if signs is None else signs, starts=starts, **values)


GRID = np.linspace(0.0, 1.0, 4001)[:, None]


def convex(x):
    return np.array([x[0] ** 2, (1.0 - x[0]) ** 2])


def concave(x):
    return np.array([1.0 - (1.0 - x[0]) ** 2, 1.0 - x[0] ** 2])


def test_weights_find_their_points_on_a_convex_front():
    weights = weights_of_first(np.linspace(0, 1, 11).tolist())
    front, sizes = carried_out(request(weights, "weighted_sum"), solver(convex, GRID))
    # w x^2 + (1 - w)(1 - x)^2 is least at x = 1 - w
    assert [p.alpha[0] for p in front.points] == pytest.approx((1.0 - weights[:, 0]).tolist(), abs=3e-4)
    assert front.utopia == pytest.approx([0, 0], abs=1e-7)
    assert front.maxima == pytest.approx([1, 1], abs=1e-7)
    assert sizes[:2] == [2, 2]


@pytest.mark.parametrize("method", ["nbi", "nc", "weighted_min_max"])
def test_concave_fronts_are_reached_by_what_does_not_weigh_a_sum(method):
    directions = weights_of_first(np.linspace(0, 1, 11).tolist())
    front, _ = carried_out(request(directions, method), solver(concave, GRID))
    points = np.array([p.objectives for p in front.points])
    assert len(np.unique(points.round(6), axis=0)) >= 10
    if method != "weighted_min_max":
        gaps = neighbour_gaps(points)
        assert gaps.max() <= 1.6 * gaps.min()


def test_what_is_maximised_is_handled_by_its_sign():
    weights = weights_of_first([0.0, 0.5, 1.0])

    def mirrored(x):
        return np.array([1.0, -1.0]) * convex(x)

    solve = solver(convex, GRID)

    def raw(task):
        found = solve(task)
        return replace(found, objectives=mirrored(found.alpha))

    front, _ = carried_out(request(weights, "weighted_sum", signs=np.array([1.0, -1.0])), raw)
    assert front.points[1].alpha[0] == pytest.approx(0.5, abs=3e-4)
    assert front.utopia == pytest.approx([0.0, 0.0], abs=1e-7)
    assert front.maxima == pytest.approx([1.0, -1.0], abs=1e-7)


def test_points_that_see_little_are_helped_by_their_neighbours():
    """Each solve sees only what is near its start; exchange carries good designs along the front all the same."""
    weights = weights_of_first(np.linspace(0, 1, 21).tolist())
    front, _ = carried_out(request(weights, "weighted_sum", start=(0.9,)), solver(convex, GRID, reach=0.3))
    assert [p.alpha[0] for p in front.points] == pytest.approx((1.0 - weights[:, 0]).tolist(), abs=3e-3)


def test_utopia_that_was_only_a_local_optimum_is_brought_up_to_date():
    """The first solves of objective 0 stop at a local optimum; the sweep finds better, and says what it used."""
    weights = weights_of_first([0.0, 0.5, 0.9, 1.0])

    def bumpy(x):
        return np.array([x[0] ** 2 if x[0] < 0.4 else 0.2 + x[0], (1.0 - x[0]) ** 2])

    solve = solver(bumpy, GRID)
    local = solver(bumpy, GRID[GRID[:, 0] >= 0.4])
    front, _ = carried_out(request(weights, "weighted_exponential"), lambda t: (local if t.point == -1 else solve)(t))
    assert front.utopia[0] < 0.1
    assert front.points[3].objectives[0] < 0.1


def test_a_front_of_three_objectives_is_covered():
    directions = lattice(3, 15)
    corners = np.eye(3)
    grid = lattice(3, 1000)

    def distances(x):
        return ((x - corners) ** 2).sum(axis=1)

    front, sizes = carried_out(request(directions, "nbi", start=(1 / 3, 1 / 3, 1 / 3)), solver(distances, grid))
    points = np.array([p.objectives for p in front.points])
    assert len(np.unique(points.round(3), axis=0)) == 15
    assert sizes[:2] == [3, 6]
    weighted, _ = carried_out(
        request(directions, "weighted_sum", start=(1 / 3, 1 / 3, 1 / 3), normalize=False), solver(distances, grid)
    )
    # sum w |x - c|^2 is least at x = sum w c
    assert np.abs(np.array([p.alpha for p in weighted.points]) - directions).max() <= 0.03


def test_a_point_that_fails_fails_alone():
    weights = weights_of_first(np.linspace(0, 1, 5).tolist())
    front, _ = carried_out(request(weights, "weighted_sum"), solver(convex, GRID, broken=(2,)))
    assert [p.status.value for p in front.points] == ["converged", "converged", "failed", "converged", "converged"]
    assert front.points[2].reason == "it is broken"


def test_objectives_that_agree_are_measured_in_their_own_unit():
    """Both are least at one design: utopia and maxima are one point, and no width to measure in."""

    def agreeing(x):
        return np.array([x[0] ** 2, 1.0 + 2.0 * x[0] ** 2])

    asked = request(weights_of_first([0.0, 0.5, 1.0]), "weighted_exponential")
    front, _ = carried_out(asked, solver(agreeing, GRID))
    assert front.utopia.tolist() == [0.0, 1.0]
    assert front.maxima.tolist() == [1.0, 2.0]
    assert [point.alpha[0] for point in front.points] == [0.0, 0.0, 0.0]


def test_without_an_end_there_is_no_front():
    weights = weights_of_first([0.0, 1.0])
    front, _ = carried_out(request(weights, "weighted_sum"), solver(convex, GRID, broken=(-2,)))
    assert front.ends[1] is front.ends[0]  # the best that is known of the objective that failed alone
    with pytest.raises(NoEndError) as caught:
        carried_out(request(weights, "weighted_sum"), solver(convex, GRID, broken=(-1, -2)))
    assert caught.value.place == 0


def test_the_same_results_make_the_same_plan():
    weights = weights_of_first(np.linspace(0, 1, 9).tolist())
    runs = [carried_out(request(weights, "nbi"), solver(concave, GRID, reach=0.4)) for _ in range(2)]
    assert runs[0][1] == runs[1][1]
    assert all(np.array_equal(a.alpha, b.alpha) for a, b in zip(runs[0][0].points, runs[1][0].points, strict=True))


def test_designs_that_violate_constraints_come_last_and_are_no_ends():
    """Half of the candidates are infeasible and better; they move neither utopia nor any point."""

    def solve(task):
        found = solver(convex, GRID)(task)
        if task.point >= 0 and task.point % 2:
            return replace(found, objectives=found.objectives - 0.5, violation=0.3)
        return found

    front, _ = carried_out(request(weights_of_first(np.linspace(0, 1, 7).tolist()), "weighted_sum"), solve)
    assert front.utopia == pytest.approx([0, 0], abs=1e-7)
    assert all(point.violation == 0.0 for point in front.points[::2])


def test_utopia_that_moves_late_is_what_the_points_end_with():
    """A better end is in nobody's reach but that of the points near it: utopia must follow what they find."""
    start = np.array([0.9])
    front, _ = carried_out(
        request(weights_of_first(np.linspace(0, 1, 9).tolist()), "weighted_sum", start=start),
        solver(convex, GRID, reach=0.3),
    )
    lowest = np.min([point.objectives for point in front.points], axis=0)
    assert front.utopia == pytest.approx(lowest, abs=2e-3)
