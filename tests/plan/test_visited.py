"""Designs that were visited on the way: which belong to the front, and where they appear."""

import csv
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.cli.group import run_group
from mdstopo.front.directions import weights_of_first
from mdstopo.front.run_front import Ask, run_front
from mdstopo.plan import visited
from mdstopo.plan.front_measures import dominated, scaled
from mdstopo.plan.visited import FAR_BELOW_LINE, GAP, SLIVER, even_spacing
from mdstopo.status import RunStatus
from mdstopo.store.result_reader import read_result
from tests.front.support import CASE
from tests.plan.test_plan import GRID, carried_out, convex, request, solver


def belonging(points, table, spacing, width=1.0):
    """That of a front from 0 to the width in every objective."""
    nothing = np.zeros(table.shape[1])
    return visited.belonging(points, table, nothing, nothing + width, spacing)


LINE = np.array([[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]])


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(CASE)


def test_what_dominates_a_point_belongs_to_the_front_however_near_it_is() -> None:
    near = np.array([[0.499, 0.499], [0.6, 0.6], [0.4995, 0.4980]])
    assert belonging(LINE, near, spacing=10.0) == [2]  # the better of two that are better than the same point


def test_what_is_far_from_every_point_and_not_dominated_fills_a_gap() -> None:
    table = np.array([[0.25, 0.74], [0.26, 0.73], [0.49, 0.5], [0.25, 1.01], [0.75, 0.76]])
    found = belonging(LINE, table, spacing=0.3)
    assert found == [2, 0]  # the third is below the middle point; the first is a little farther off than the second
    assert belonging(LINE, table[:2], spacing=0.6) == [0]
    assert belonging(LINE, table[:2], spacing=1.0) == []


def test_the_upper_side_of_a_gap_is_left_empty() -> None:
    """Far from both ends, and not dominated, but better than one of them by next to nothing."""
    ends = np.array([[0.0, 1.0], [1.0, 0.0]])
    assert belonging(ends, np.array([[0.97, 0.9]]), spacing=0.1) == []
    assert belonging(ends, np.array([[0.4, 0.7]]), spacing=0.1) == [0]


def test_what_lies_below_the_line_belongs_to_the_front_however_near_a_point_is() -> None:
    """The first, near a steep end, gives up little of one objective for a quarter of the other (as in a mooring's
    front); the second is above the line, the third hardly below it, the fourth beyond the end."""
    steep = np.array([[0.0, 1.0], [0.24, 0.24], [1.0, 0.0]])
    table = np.array([[0.022, 0.74], [0.022, 0.95], [0.17, 0.45], [-0.01, 1.02]])
    spacing = even_spacing(3, 2)
    assert np.linalg.norm(steep[0] - table[0]) < GAP * spacing
    assert belonging(steep, table, spacing) == [0]
    assert belonging(steep[:, ::-1], table[:, ::-1], spacing) == [0]


def test_the_first_one_taken_bends_the_line() -> None:
    """What lies below the new line by less than a twentieth of a spacing is left out."""
    ends = np.array([[0.0, 1.0], [1.0, 0.0]])
    table = np.array([[0.31, 0.45], [0.22, 0.53], [0.44, 0.34]])
    assert belonging(ends, table, 2.0) == [1]  # the deepest
    assert belonging(ends, table, 0.9) == [2, 1]  # the third is the farthest from the ends


def test_of_three_objectives_what_lies_below_the_triangles_belongs() -> None:
    corners = np.eye(3)
    middle = np.full((1, 3), 1 / 3)
    points = np.concatenate([corners, middle])
    table = np.array([[0.5, 0.1, 0.1], [0.1, 0.5, 0.3], [0.55, 0.45, 0.1]])
    assert belonging(points, table, 2.0) == [0]
    assert belonging(corners[:2], table, 2.0) == []  # no surface
    line = np.array([[1.0, 0.0, 0.5], [0.5, 0.5, 0.5], [0.0, 1.0, 0.5]])
    assert belonging(line, table[2:], 2.0) == []  # no surface either


def test_a_cloud_of_designs_does_not_flood_the_front() -> None:
    """However many there are: what is taken is half of a spacing from all others, the rest is nearer to one of them."""
    share = np.linspace(0.0, 1.0, 1001)
    cloud = np.stack([share, (1.0 - share) ** 2], axis=1)
    ends = cloud[[0, -1]]
    spacing = even_spacing(11, 2)
    found = belonging(ends, cloud, spacing)
    points = np.concatenate([ends, cloud[found]])
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 10.0 * np.eye(len(points))
    assert apart.min() > GAP * spacing
    assert len(found) <= 2 * 11
    lower = cloud[share < 0.9]  # beyond, the curve is flat, and its designs hardly better than its end
    assert np.linalg.norm(lower[:, None] - points[None], axis=2).min(axis=1).max() <= GAP * spacing


def test_points_of_other_scales_and_of_more_objectives_are_alike() -> None:
    scale = np.array([1e6, 1e-3])
    table = np.array([[0.25, 0.74], [0.6, 0.6]])
    assert belonging(LINE * scale, table * scale, 0.3, scale) == belonging(LINE, table, 0.3) == [0]
    corners = np.eye(3)
    inside = np.array([[0.3, 0.3, 0.3], [0.2, 0.6, 0.2], [2.0, 1.0, 1.0]])
    assert belonging(corners, inside, 0.1) == [0, 1]
    assert belonging(corners, inside, 1.0) == [0]


def test_the_spacing_of_an_even_front() -> None:
    assert even_spacing(21, 2) == pytest.approx(np.sqrt(2.0) / 20)
    assert even_spacing(15, 3) == even_spacing(11, 3) == pytest.approx(np.sqrt(2.0) / 4)


def test_nothing_belongs_to_no_front() -> None:
    assert belonging(np.zeros((0, 2)), LINE, 0.1) == []
    assert belonging(LINE, np.zeros((0, 2)), 0.1) == []


def on_the_way(designs, solve=None, at=(0,)):
    """A solver that has been at designs before its ends in tasks for some points, and finds them when it goes again."""
    solve = solve or solver(convex, GRID)

    def going(task):
        if task.iterate >= 0:
            alpha = np.array(designs[task.iterate])
            found = solve(replace(task, start=alpha, iterate=-1))
            return replace(
                found, alpha=alpha, objectives=convex(alpha), status=RunStatus.VISITED, iterate=task.iterate,
                visited=np.zeros((0, 2)),
            )  # fmt: skip
        found = solve(task)
        if task.point not in at:
            return found
        seen = [convex(np.array(each)) for each in designs]
        violations = np.array([0.0 if len(each) == 1 else 1.0 for each in designs] + [0.0])
        return replace(found, visited=np.array([*seen, found.objectives]), violations=violations)

    return going


def test_a_gap_between_weights_is_filled_by_what_was_visited() -> None:
    """Weights give points far apart; a solve has been between them."""
    weights = weights_of_first([0.1, 0.15, 0.9])
    front, _ = carried_out(request(weights, "weighted_sum"), on_the_way([(0.8,), (0.5,), (0.88,)]))
    assert [each.alpha[0] for each in front.further] == [0.5]
    assert front.further[0].status == "visited"
    assert (front.further[0].point, front.further[0].iterate) == (0, 1)
    assert [each.alpha[0] for each in front.points] == pytest.approx([0.9, 0.85, 0.1], abs=1e-3)


def test_what_breaks_a_limit_fills_no_gap() -> None:
    weights = weights_of_first([0.1, 0.15, 0.9])
    front, _ = carried_out(request(weights, "weighted_sum"), on_the_way([(0.5, 0.0)]))  # by on_the_way's marks
    assert front.further == ()


def test_a_point_that_ends_worse_than_what_another_has_visited_starts_again_from_that() -> None:
    """The solves for the middle see little; one for its neighbour has been at the middle's optimum."""
    weights = weights_of_first([0.0, 0.25, 0.5, 1.0])
    whole, blind = solver(convex, GRID), solver(convex, GRID[GRID[:, 0] > 0.7])

    def solve(task):
        return whole(task) if task.point != 2 or task.start[0] == 0.5 else blind(task)

    front, _ = carried_out(request(weights, "weighted_sum"), on_the_way([(0.5,)], solve, at=(1,)))
    assert front.points[2].alpha[0] == pytest.approx(0.5, abs=3e-4)
    assert front.points[2].status == "converged"
    alone, _ = carried_out(request(weights, "weighted_sum"), solve)
    assert alone.points[2].alpha[0] > 0.7


def test_the_design_of_an_iterate_is_what_its_solve_had_there(capsys: pytest.CaptureFixture[str]) -> None:
    """On the engine: its values are those of the visit, it keeps the limits, and no point is better in everything."""
    outcome = run_front(read_case(CASE), Ask(weights_of_first([0.0, 0.25, 0.5, 0.75, 1.0])), workers=1)
    assert outcome.front is not None
    assert outcome.front.further
    points = np.array([each.objectives for each in outcome.front.points])
    for each in outcome.front.further:
        seen = np.concatenate([found.visited for found in outcome.tasks if found.point == each.point])
        assert np.abs(seen / each.objectives - 1.0).max(axis=1).min() <= 1e-12
        assert each.violation <= 1e-6
        assert not dominated(np.concatenate([points, each.objectives[None]]))[-1]


def everything_visited(view) -> np.ndarray:
    seen = np.concatenate([np.asarray(each) for each in view.under("pareto/visited").values()])
    return seen[np.isfinite(seen).all(axis=1)]


@pytest.mark.parametrize("method", ["weighted_exponential", "nbi", "nc"])
def test_no_visited_design_beats_the_front_or_lies_alone_in_a_gap_of_it(method: str) -> None:
    run_front(read_case(CASE), Ask(weights_of_first(np.linspace(0, 1, 5).tolist()), method), path=Path("f.h5"))
    view = read_result("f.h5")
    front = np.concatenate([view.array(f"pareto/{name}") for name in ("objectives", "further/objectives")
                            if f"pareto/{name}" in view.arrays])  # fmt: skip
    beaten = dominated(front)
    flags = [view.arrays.get(f"pareto/{name}", np.zeros(0)) for name in ("dominated", "further/dominated")]
    assert np.array_equal(np.concatenate(flags), beaten)
    ideal, nadir = view.array("pareto/utopia")[0], view.array("pareto/maxima")[0]
    seen = everything_visited(view)
    assert not dominated(np.concatenate([front[~beaten], seen]))[: len(front[~beaten])].any()
    line = scaled(front[~beaten], ideal, nadir)
    line = line[np.argsort(line[:, 0])]
    for values in seen[~dominated(seen)]:
        below = scaled(values[None], ideal, nadir)[0]
        for (x, y), (dx, dy) in ((left, right - left) for left, right in pairwise(line)):
            # how far along both axes at once the design would have to move to meet the line, and where it would
            share = (below[0] - below[1] - x + y) / (dx - dy)
            deep = ((y - below[1]) * dx - (x - below[0]) * dy) / (dx - dy)
            assert not 0.0 < share < 1.0 or deep <= FAR_BELOW_LINE * even_spacing(5, 2) * (1.0 + 1e-9)
        way = scaled(front, ideal, nadir) - scaled(values[None], ideal, nadir)
        apart = np.linalg.norm(way, axis=1)
        sliver = way.max(axis=1) < SLIVER * apart
        assert sliver.any() or apart.min() <= GAP * even_spacing(5, 2) * (1.0 + 1e-9)


def test_further_points_are_in_the_file_and_every_command_knows_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["pareto", "probe.yaml", "--weights", "0:1:0.25", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    count = len(content["further"]["objectives"])
    assert count >= 1
    assert len(content["objectives"]) == 5
    path = content["path"]
    view = read_result(path)
    first = view.array("pareto/further/alpha")[0]
    assert view.array("pareto/further/violation").max() <= 1e-6
    assert run_group(["show", path]) == 0
    said = capsys.readouterr().out
    assert f"point 5: iterate {view.array('pareto/further/iterate')[0]} on the way to" in said
    assert said.count(" visited") >= count
    assert run_group(["simulate", "probe.yaml", "--alpha", f"{path}:5", "--out", "s.h5", "--quiet"]) == 0
    assert np.array_equal(read_result("s.h5").alpha, first)
    assert run_group(["simulate", "probe.yaml", "--alpha", f"{path}:{5 + count}"]) == 2
    assert f"the front has 0 to {4 + count}" in capsys.readouterr().err
    assert run_group(["export", path, "--csv", "--quiet"]) == 0
    with Path(path).with_suffix(".csv").joinpath("front.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows[5:]] == ["visited"] * count
    assert float(rows[5]["objectives G1"]) == content["further"]["objectives"][0][0]
    with Path(path).with_suffix(".csv").joinpath("members.csv").open() as file:
        assert [float(row["alpha_point_5"]) for row in csv.DictReader(file)] == first.tolist()
    assert run_group(["report", path, "--quiet"]) == 0
    page = Path(path).with_suffix(".html").read_text()
    assert page.count('"visited"') >= count
    pytest.importorskip("matplotlib")
    assert run_group(["plot", path, "layout", "--point", "5", "--out", "l.svg", "--quiet"]) == 0
    assert run_group(["plot", path, "front", "--out", "f.svg", "--quiet"]) == 0
    assert run_group(["pareto", "probe.yaml", "--resume", "--quiet"]) == 0
    again = read_result(path)
    assert len(again.array("pareto/weights")) == 5
    assert np.array_equal(again.array("pareto/further/alpha"), view.array("pareto/further/alpha"))
