"""SVGs that move have the symbols of still pictures, where these are and as large at each time, all of them whole."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.plots.moving_svg import POINT, Timing, moving_svg
from mdstopo.plots.scenery import Floats, start_state
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import ink
from mdstopo.plots.symbol_marks import marks_at
from mdstopo.plots.symbols import every_symbol, symbols
from mdstopo.plots.thickness import Thickness

pytest.importorskip("matplotlib")

SVG = "{http://www.w3.org/2000/svg}"
#: a crank that turns by its joint, with a load that goes with it and comes late, and a link; a rim with a hole
CASE = """
format: 1
gravity: [0, -9.81]
time: {end: 2}
bodies:
  crank: {mass: 1, inertia: 1, position: [0, 0], outline: [{polygon: [[-1, -1], [1, -1], [1, 1], [-1, 1]]}]}
  rod: {mass: 1, inertia: 1, position: [3, 0]}
joints:
  - {type: revolute, bodies: [ground, crank], at: [0, 0]}
  - {type: distance, bodies: [crank, rod], at: [[1, 0], [3, 0]]}
loads:
  - {body: crank, at: [1, 1], frame: body, force: [{table: [[0, 0], [1, 0], [1.01, 5], [2, 5]]}, 0]}
points: {foot: {body: rod, grid: {list: [[3, -0.5], [3.2, -0.5]]}}}
contacts: [{points: foot, on: {body: ground, from: [-1, -0.7], to: [5, -0.7]}, stiffness: 1e4}]
"""
TIMES = np.linspace(0.0, 2.0, 5)


def drawn(text: str, turning: float) -> tuple[Stage, Floats, str]:
    """The scene with its first body turned by so much per second, its states and its SVG."""
    case = read_case(text)
    states = np.tile(start_state(case), (len(TIMES), 1))
    states[:, 2] += turning * TIMES
    view = SimpleNamespace(arrays={}, path=Path("none.h5"))
    source: Any = SimpleNamespace(case=case, alpha=np.ones(case.n_design), view=view, title="a < b")
    stage = Stage(source, states, "default", TIMES.tolist())
    return stage, states, moving_svg(stage, Thickness((), ""), states, Timing("default", TIMES, 4.0))


def at_frame(said: str, number: int) -> list[tuple[str, Floats]]:
    """Lines and rings of an SVG at one of its frames: their colour, and their corners in pixels."""
    found: list[tuple[str, Floats]] = []

    def value(node: ElementTree.Element, name: str) -> str:
        for move in node:
            if move.get("attributeName") == name:
                return move.get("values", "").split(";")[number]
        own = node.get(name, "")
        return own if name != "transform" else own[own.find("(") + 1 : -1]

    def follow(node: ElementTree.Element, turn: Floats, shift: Floats) -> None:
        if node.tag == f"{SVG}g":
            numbers = np.array([float(each) for each in value(node, "transform").split(",")])
            if len(numbers) == 2:
                shift = shift + turn @ numbers
            else:
                c, s = np.cos(np.radians(numbers[0])), np.sin(np.radians(numbers[0]))
                turn = turn @ np.array([[c, -s], [s, c]])
        elif node.tag == f"{SVG}polyline":
            corners = np.array([[float(x) for x in each.split(",")] for each in value(node, "points").split()])
            found.append((node.get("stroke", ""), corners @ turn.T + shift))
        elif node.tag == f"{SVG}circle":
            found.append(("ring", shift + np.zeros((1, 2))))
        for child in node:
            follow(child, turn, shift)

    follow(ElementTree.fromstring(said), np.eye(2), np.zeros(2))
    return found


@pytest.mark.parametrize("turning", [0.0, 2.0])
def test_symbols_are_where_those_of_still_pictures_are_at_each_time(turning: float) -> None:
    stage, states, said = drawn(CASE, turning)
    ground = -0.7
    for k, (t, q) in enumerate(zip(TIMES.tolist(), states, strict=True)):
        lines = at_frame(said, k)
        rings = [corners[0] for colour, corners in lines if colour == "ring"]
        assert len(rings) == 2
        edge = max(
            (line for _, line in lines if len(line) == 2 and not np.ptp(line[:, 1])),
            key=lambda line: np.ptp(line[:, 0]),
        )
        scale = np.ptp(edge[:, 0]) / 6.0
        origin = np.array([edge[0, 0] + scale, edge[0, 1] + scale * ground])
        assert rings[1][0] - rings[0][0] == pytest.approx(0.2 * scale, abs=0.2)
        marks = marks_at(stage.case, symbols(stage.case, "default", t), q, lambda places: places, 1.0)
        for mark in marks:
            for place in (mark.place, mark.place if mark.end is None else mark.end):
                for stroke in mark.strokes:
                    wanted = origin + scale * place * [1.0, -1.0] + POINT * stroke * [1.0, -1.0]
                    near = [line for _, line in lines if len(line) == len(wanted)]
                    assert min(np.abs(line - wanted).max() for line in near) < 1.0
        assert len(marks) == (3 if t > 1.0 else 2)
        # two arrows: that of the load, and that of gravity
        head, _ = (line for colour, line in lines if len(line) == 4 and colour == ink())
        assert (np.ptp(head, axis=0).max() > 1.0) == (t > 1.0)


def test_all_symbols_are_whole_at_all_times() -> None:
    *_, said = drawn(CASE, 2.0)
    width, height = (float(each) for each in re.search(r'viewBox="0 0 (\d+) (\d+)"', said).groups())  # type: ignore[union-attr]
    for k in range(len(TIMES)):
        corners = np.concatenate([line for _, line in at_frame(said, k)])
        assert (corners >= -0.5).all()
        assert (corners <= [width + 0.5, height + 0.5]).all()


def test_a_load_has_one_place_among_symbols_at_all_times_and_no_size_while_it_does_not_act() -> None:
    case = read_case(CASE)
    every = [every_symbol(case, "default", t) for t in TIMES.tolist()]
    assert {tuple((each.kind, each.body) for each in some) for some in every} == {
        (("revolute", "ground"), ("distance", "crank"), ("load", "crank"), ("moment", "crank"))
    }
    assert [some[2].size for some in every] == [0.0, 0.0, 0.0, 1.0, 1.0]
    assert [len(symbols(case, "default", t)) for t in TIMES.tolist()] == [2, 2, 2, 3, 3]


def test_an_area_with_a_hole_is_filled_around_it_and_a_narrow_scene_is_no_long_picture() -> None:
    hole = "[{path: {d: 'M-1 -1 h2 v2 h-2 z M-0.5 -0.5 v1 h1 v-1 z'}}]"
    text = re.sub(r"outline: .*\]\}\]", f"outline: {hole}", CASE)
    *_, said = drawn(text, 2.0)
    (area,) = re.findall(r'<path [^>]*fill-rule="evenodd"[^>]*>', said)
    assert area.count("M") == area.count("Z") == 2
    *_, said = drawn(CASE.replace("position: [3, 0]", "position: [0, -60]"), 0.0)
    width, height = (int(each) for each in re.search(r'viewBox="0 0 (\d+) (\d+)"', said).groups())  # type: ignore[union-attr]
    assert height < 760
    assert width >= 300
