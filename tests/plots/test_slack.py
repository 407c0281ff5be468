"""What a picture says of belts that are slack, and of coordinates that are held."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.scenery import start_state
from mdstopo.plots.slack import member_lines, spare_length
from mdstopo.plots.symbol_marks import _all_of, draw_marks, marks_at
from mdstopo.plots.symbols import symbols

BELT = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [1, 0], velocity: [0, 2], angular_velocity: 3}}
members:
  belts: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [1, 0]}, law: {type: gap, stiffness: 5, LAW}}
motions:
  - {body: a, MOTION}
"""


def case_of(law: str = "gap: 0.02", motion: str = "x: {velocity: 0}") -> object:
    text = BELT.replace("LAW", law).replace("MOTION", motion)
    return read_case(text if motion else text.partition("motions:")[0])


@pytest.mark.parametrize(
    ("law", "spare"),
    [
        ("gap: 0.02", 0.02),
        ("gap: 0", 0.0),
        ("free_length: 1.1", 0.1),
        ("free_length: 1.1, gap: 0.05", 0.15),
        ("free_length: 0.9", 0.0),
        ("gap: 0.02, side: compression", 0.0),
    ],
)
def test_a_belt_is_slack_by_what_it_is_longer_than_its_ends_are_apart(law: str, spare: float) -> None:
    case = case_of(law, "")
    assert spare_length(case, case.members[0], start_state(case)) == pytest.approx([spare], abs=1e-12)


def test_a_slack_belt_hangs_down_and_is_about_as_long_as_it_is() -> None:
    case = case_of("gap: 0.02", "")
    (line,), slack = member_lines(case, case.members[0], start_state(case), lambda places: places, np.array([0]))
    assert slack.tolist() == [True]
    assert line[[0, -1]].tolist() == [[0.0, 0.0], [1.0, 0.0]]
    assert line[1:-1, 1].max() < 0.0
    assert np.linalg.norm(np.diff(line, axis=0), axis=1).sum() == pytest.approx(1.02, abs=2e-3)
    moved = start_state(case)
    moved[0] += 0.05  # pulled taut
    (line,), slack = member_lines(case, case.members[0], moved, lambda places: places, np.array([0]))
    assert slack.tolist() == [False]
    assert np.abs(line[:, 1]).max() == 0.0


@pytest.mark.parametrize(
    ("motion", "kinds"),
    [
        ("x: {velocity: 0}", ["held"]),
        ("x: {acceleration: 0}", ["held"]),
        ("y: {acceleration: 0}", ["motion"]),  # it moves on as it starts
        ("x: {velocity: {table: [[0, 0], [1, 2]]}}", ["motion"]),
        ("x: {position: {table: [[0, 1], [0.3, 1], [0.6, 1], [1, 1]]}}", ["held"]),
        ("x: {acceleration: 0}, angle: {acceleration: 0}", ["held", "turning"]),
        ("x: {acceleration: 1}, angle: {velocity: 3}", ["motion", "turning"]),
    ],
)
def test_what_is_held_is_told_from_what_moves(motion: str, kinds: list[str]) -> None:
    assert [each.kind for each in symbols(case_of(motion=motion))] == kinds


def test_a_rotation_that_is_held_has_a_symbol_of_its_own() -> None:
    case = read_case(BELT.replace(", angular_velocity: 3", "").replace("LAW", "gap: 0").replace(
        "MOTION", "angle: {velocity: 0}"))  # fmt: skip
    assert [each.kind for each in symbols(case)] == ["unturned"]


def test_in_space_a_slack_belt_hangs_along_gravity_whatever_the_view() -> None:
    text = BELT.partition("motions:")[0].replace("LAW", "gap: 0.02").replace("[0, 0]", "[0, 0, 0]")
    text = text.replace("[1, 0]", "[1, 0, 0]").replace("[0, 2]", "[0, 2, 0]").replace("angular_velocity: 3, ", "")
    text = text.replace(", angular_velocity: 3", "").replace("inertia: 1", "inertia: [1, 1, 1]")
    case = read_case(text.replace("format: 1", "format: 1\ndimension: 3\ngravity: [0, 0, -9.8]"))
    for axes, hangs in (([0, 1], False), ([0, 2], True)):  # from above, and from the front
        lines, slack = member_lines(
            case, case.members[0], start_state(case), lambda at, a=axes: at[:, a], np.array([0])
        )
        assert slack.tolist() == [True]
        assert bool(lines[0, 1:-1, 1].max() < 0.0) is hangs
        assert hangs or np.abs(lines[..., 1]).max() == 0.0


def test_the_legend_shows_a_symbol_as_it_is_where_the_view_has_it_end_on() -> None:
    from matplotlib.figure import Figure

    axis = Figure().subplots()
    case = read_case(BELT.replace(", angular_velocity: 3", "").replace("LAW", "gap: 0").replace(
        "MOTION", "x: {velocity: 0}"))  # fmt: skip
    end_on = marks_at(case, symbols(case), start_state(case), lambda places: np.zeros((len(places), 2)), 1.0)
    draw_marks(axis, end_on)
    (handle,), (label,) = axis.get_legend_handles_labels()
    assert label == "held coordinate"
    assert np.array_equal(handle.get_marker().vertices, _all_of(glyphs()["held"]).vertices)


@pytest.mark.parametrize(
    ("motion", "way", "size"),
    [
        ("x: {acceleration: {table: [[0, 0], [0.5, -8], [1, 0]]}}", [-1.0, 0.0], 1.0),
        ("y: {velocity: 2}", [0.0, 1.0], 1.0),
        ("y: {acceleration: {formula: 'sin(6*t) - 1'}}", [0.0, -1.0], 1.0),
        ("x: {position: 1 - 0.2*t^2}", [-1.0, 0.0], 1.0),
        ("y: {acceleration: 0}", [0.0, 1.0], 1.0),  # as it moves at the start
        ("y: {velocity: 2 - 3*t}", [0.0, 1.0], 1.0),  # braking, as a velocity and as an acceleration
        ("y: {acceleration: -3}", [0.0, -1.0], 1.0),
        ("y: {velocity: {table: [[0, 2], [1, 2], [5, -50]]}}", [0.0, 1.0], 1.0),  # the load case ends at 1 s
        ("y: {velocity: {table: [[-1, -50], [0, 2], [2, 5]]}}", [0.0, 1.0], 1.0),
        (
            "y: {position: {table: [[0, 0], [2, 1.6], [4, -11.2], [6, -52.8]]}}",
            [0.0, 1.0],
            1.0,
        ),  # no row within it but the first
        ("angle: {velocity: 3}", None, 1.0),
        ("angle: {acceleration: -3}", None, -1.0),
    ],
)
def test_the_arrow_of_a_prescribed_motion_has_the_sign_of_what_is_prescribed_where_it_is_largest(
    motion: str, way: list[float] | None, size: float
) -> None:
    (symbol,) = [each for each in symbols(case_of(motion=motion)) if each.kind in ("motion", "turning")]
    assert (symbol.way if way is None else symbol.way.tolist()) == way
    assert symbol.size == size
