"""What a picture shows is whole: symbols at its edges, members beside each other, names in the legend."""

import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.case.joints import JOINTS, FixedJoint
from mdstopo.case.reader import read_case
from mdstopo.plots.beside import side_places, sideways
from mdstopo.plots.glyphs import glyphs
from mdstopo.plots.layout_plot import draw
from mdstopo.plots.scenery import start_state
from mdstopo.plots.stage import Stage
from mdstopo.plots.symbol_marks import ground_marks, marks_at
from mdstopo.plots.symbols import symbols
from mdstopo.plots.thickness import thickness
from mdstopo.plots.views import views
from mdstopo.plots.window import scale_of, window

matplotlib = pytest.importorskip("matplotlib")

#: the load is at the right edge and points out of the picture, the motion at the left one; two groups share their ends
EDGES = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies:
  a: {mass: 1, inertia: 1, position: [0, 0]}
  b: {mass: 1, inertia: 1, position: [4, 0.3]}
joints: [{type: revolute, bodies: [ground, a], at: [0, 0]}]
members:
  belts: {from: {body: a, at: [0, 0]}, to: {body: b, at: [4, 0.3]}, law: {type: spring, stiffness: 5}}
  chains: {from: {body: b, at: [4, 0.3]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 5}}
  alone: {from: {body: a, at: [0, 0]}, to: {body: b, at: [4, 0.2]}, law: {type: spring, stiffness: 5}}
loads: [{body: b, force: [5, 1]}]
"""
IN_SPACE = """
format: 1
dimension: 3
gravity: [0, -9.81, 0]
time: {end: 1}
bodies: {a: {mass: 1, inertia: [1, 1, 1], position: [0, 0, 0]}}
loads: [{body: a, force: [0, 0, 5]}]
"""


def source_of(text: str) -> Any:
    case = read_case(text)
    view = SimpleNamespace(arrays={}, under=lambda place: {}, path=Path("none.h5"))
    return SimpleNamespace(case=case, alpha=np.ones(case.n_design), view=view, load_cases=("default",))


def boxes_of_symbols(axis: Any) -> list[Any]:
    """Where lines with markers of their own shape are, in pixels."""
    found = []
    for line in axis.lines:
        marker, places = line.get_marker(), line.get_xydata()
        if isinstance(marker, str) or not len(places) or not line.get_clip_on():
            continue
        at = axis.transData.transform(places[0])
        points = marker.vertices * axis.figure.dpi / 72.0
        found.append((at + points.min(axis=0), at + points.max(axis=0)))
    return found


@pytest.mark.parametrize("turned", [False, True])
def test_symbols_at_the_edge_of_a_picture_are_whole(turned: bool) -> None:
    from mdstopo.plots.style import styled

    text = EDGES
    if turned:  # a tall scene, with a load that points down
        text = text.replace("[4, 0.3]", "[0.3, -4]").replace("[4, 0.2]", "[0.2, -4]").replace("[5, 1]", "[1, -5]")
    with styled() as module:
        figure = draw(module, source_of(text))
        figure.canvas.draw()
    (axis,) = figure.axes
    seen = axis.get_window_extent()
    boxes = boxes_of_symbols(axis)
    assert len(boxes) >= 4
    for low, high in boxes:
        assert seen.x0 <= low[0] <= high[0] <= seen.x1
        assert seen.y0 <= low[1] <= high[1] <= seen.y1


def test_a_flat_scene_has_no_empty_space_around_it() -> None:
    from mdstopo.plots.style import styled

    with styled() as module:
        source = source_of(EDGES)
        flat, tall = (
            draw(module, each).get_figheight()
            for each in (source, source_of(EDGES.replace("[4, 0.3]", "[4, 3]").replace("[4, 0.2]", "[4, 2.9]")))
        )
    assert flat < tall - 0.5


def test_a_narrow_scene_stands_in_the_middle_and_its_numbers_do_not_touch() -> None:
    from mdstopo.plots.style import styled

    spring = "{from: {body: ground, at: [0, Y]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 5}}"
    text = f"""
format: 1
time: {{end: 1}}
bodies: {{a: {{mass: 1, inertia: 1e-4, position: [0, 0]}}}}
members:
  upper: {spring.replace("Y", "1")}
  lower: {spring.replace("Y", "-1")}
"""
    with styled() as module:
        figure = draw(module, source_of(text))
        figure.canvas.draw()
    (axis,) = figure.axes
    boxes = [label.get_window_extent() for label in axis.get_xticklabels() if label.get_text()]
    shown = [box for box in boxes if axis.bbox.x0 <= 0.5 * (box.x0 + box.x1) <= axis.bbox.x1]
    assert len(shown) >= 2
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(shown))
    assert abs(sum(axis.get_xlim())) < 0.02 * np.ptp(axis.get_xlim())  # the symbol of ground is not symmetric
    assert axis.get_window_extent().width >= 1.0 * figure.dpi
    assert np.ptp(axis.get_xlim()) / axis.bbox.width == pytest.approx(np.ptp(axis.get_ylim()) / axis.bbox.height)


def test_a_window_stays_near_the_scene_where_a_picture_has_no_room_for_its_symbols() -> None:
    case = read_case(EDGES)
    marks = marks_at(case, symbols(case), start_state(case), lambda places: places, 4.0)
    low, high = window(np.array([[0.0, 0.0], [4.0, 0.3]]), marks, np.array([0.3, 0.3]))
    assert (high - low).max() <= 4.0 * 4.0
    assert (low <= 0.0).all()
    assert (high >= [4.0, 0.3]).all()


def test_the_views_of_space_stay_near_the_scene_where_they_have_no_room_for_their_symbols() -> None:
    from mdstopo.plots.space_layout import _adapted

    case = read_case(IN_SPACE)
    seen = views(case, np.zeros(3), 1.0)
    marks = {
        name: [marks_at(case, symbols(case), start_state(case), view.seen, 1.0, view.signs)]
        for name, view in seen.items()
    }
    _, (low, high), _ = _adapted(seen, (-np.ones(3), np.ones(3)), marks, 60, 0.0)
    assert (high - low).max() <= 4.0 * 2.0
    assert (low <= -1.0).all()
    assert (high >= 1.0).all()


def test_a_window_has_one_scale_and_room_for_what_is_drawn() -> None:
    case = read_case(EDGES)
    marks = marks_at(case, symbols(case), start_state(case), lambda places: places, 4.0)
    cloud, inches = np.array([[0.0, 0.0], [4.0, 0.3]]), np.array([3.0, 2.0])
    low, high = window(cloud, marks, inches)
    scale = scale_of(low, high, inches)
    assert scale == pytest.approx(72.0 * 3.0 / (high - low)[0])
    load = marks[-1]
    assert load.place.tolist() == [4.0, 0.3]
    assert high[0] - 4.0 == pytest.approx((load.reach[1, 0] + 1.5) / scale, rel=1e-3)
    assert (low < cloud.min(axis=0)).all()


def test_two_pictures_that_are_shown_alike_have_one_window_with_the_symbols_of_both() -> None:
    inches = np.array([3.0, 1.0])
    both = [source_of(text) for text in (EDGES, EDGES.replace("force: [5, 1]", "force: [-5, 1], at: [0, 0]"))]
    stages = [Stage(source, start_state(source.case)[None]) for source in both]
    low, high = zip(*(stage.window(inches) for stage in stages), strict=True)
    assert high[0][0] > high[1][0] + 0.1  # only the first has an arrow there
    Stage.show_alike(stages)
    joined = [stage.window(inches) for stage in stages]
    np.testing.assert_array_equal(joined[0], joined[1])
    assert (joined[0][0] <= np.min(low, axis=0) + 1e-3).all()
    assert (joined[0][1] >= np.max(high, axis=0) - 1e-3).all()


def test_two_pictures_of_space_that_are_shown_alike_have_one_eye() -> None:
    both = [source_of(text) for text in (IN_SPACE, IN_SPACE.replace("position: [0, 0, 0]", "position: [1, 0, 0]"))]
    stages = [Stage(source, start_state(source.case)[None]) for source in both]
    place = np.array([[0.2, 0.1, 0.3]])
    assert np.abs(stages[0].seen(place) - stages[1].seen(place)).max() > 0.1
    Stage.show_alike(stages)
    np.testing.assert_array_equal(stages[0].seen(place), stages[1].seen(place))
    inches = np.array([3.0, 1.0])
    np.testing.assert_array_equal(stages[0].window(inches), stages[1].window(inches))


def test_the_symbol_of_ground_lies_below_that_of_a_joint_or_a_bushing_and_nowhere_else() -> None:
    bushing = "bushings: [{bodies: [ground, b], at: [4, 0.3], stiffness: [1e5, 1e5, 200]}]\n"
    case = read_case(EDGES + bushing)
    marks = marks_at(case, symbols(case), start_state(case), lambda places: places, 4.0)
    places = np.array([[0.0, 0.0], [4.0, 0.3], [1.0, 1.0]])
    *below, beside = ground_marks(places, marks, 50.0)
    for kind, place, ground in zip(("revolute", "bushing"), places[:2], below, strict=True):
        (tie,) = (mark for mark in marks if mark.glyph.words == glyphs()[kind].words)
        assert tie.place.tolist() == place.tolist()
        assert ground.reach[1, 1] < tie.reach[0, 1]
    assert beside.below == 0.0


def test_a_joint_without_a_symbol_of_its_own_is_drawn_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(JOINTS, "guide", FixedJoint)
    glyphs.cache_clear()
    try:
        assert glyphs()["guide"].words == "guide joint"
        assert glyphs()["fixed"].strokes[0].tolist() != glyphs()["guide"].strokes[0].tolist()
    finally:
        glyphs.cache_clear()


@pytest.mark.parametrize(("alpha", "words"), [(0.5, "up to 0.5"), (0.2, "up to 0.2")])
def test_a_picture_tells_alpha_itself_and_not_the_share_of_its_range(alpha: float, words: str) -> None:
    source = source_of(EDGES + "design: {initial: 0.3, lower: 0.2, upper: 0.6}\n")
    source.alpha = np.array([0.2, alpha, 0.2])
    assert thickness(source).what == f"alpha, {words}"


def test_members_between_the_same_points_lie_beside_each_other_whichever_end_is_first() -> None:
    case = read_case(EDGES)
    found = side_places(case, [np.arange(len(group)) for group in case.members])
    ways = np.array([[[0.0, 0.0], [4.0, 0.3]], [[4.0, 0.3], [0.0, 0.0]], [[0.0, 0.0], [4.0, 0.2]]])
    shifts = sideways(ways, np.concatenate(found))
    assert shifts[0] == pytest.approx(-shifts[1])
    assert np.linalg.norm(shifts[0]) == pytest.approx(0.5)
    assert shifts[0] @ (ways[0, 1] - ways[0, 0]) == pytest.approx(0.0)
    assert not shifts[2].any()
    alone = side_places(case, [np.arange(1), np.arange(0), np.arange(1)])  # what is not drawn takes no place
    assert [each.tolist() for each in alone] == [[0.0], [], [0.0]]


def test_three_members_between_the_same_points_have_the_middle_and_both_sides() -> None:
    more = (
        "  more: {from: {body: a, at: [0, 0]}, to: {body: b, at: [4, 0.3]}, law: {type: spring, stiffness: 5}}\nloads"
    )
    case = read_case(EDGES.replace("loads", more))
    found = side_places(case, [np.arange(len(group)) for group in case.members])
    ahead = {"belts": 1.0, "chains": -1.0, "more": 1.0}
    places = [
        ahead[group.name] * side[0] for group, side in zip(case.members, found, strict=True) if group.name in ahead
    ]
    assert sorted(places) == [-1.0, 0.0, 1.0]


def test_arrows_point_along_axes_that_run_backwards_in_a_view() -> None:
    case = read_case(IN_SPACE)
    side = views(case, np.zeros(3), 1.0)["side"]
    (mark,) = marks_at(case, symbols(case), start_state(case), side.seen, 1.0, side.signs)
    # to the right is what the front view sees as away: against z, for y is up
    assert side.across.tolist() == [0.0, 0.0, -1.0]
    assert np.cos(mark.angle) == pytest.approx(-1.0)


def test_names_in_a_legend_are_whole() -> None:
    from mdstopo.plots.style import styled

    long = EDGES.replace("belts", "shoulder_belts_of_the_left").replace("chains", "retractors_above_the_seat")
    with styled() as module:
        figure = draw(module, source_of(long))
        figure.canvas.draw()
    (legend,), (axis,) = figure.legends, figure.axes
    box, whole = legend.get_window_extent(), figure.bbox
    assert box.x1 <= whole.x1
    assert box.y1 <= whole.y1
    assert box.y0 >= axis.get_window_extent().y1


def test_long_names_in_a_legend_are_told_by_their_ends_and_many_leave_room_for_the_picture() -> None:
    from mdstopo.plots.style import styled

    long = "the_left_front_wheel_of_the_second_trailer_behind_the_tractor_WMW_W_"
    bodies = "".join(f"  {long}{k}: {{mass: 1, inertia: 1, position: [{k}, 3]}}\n" for k in range(25))
    with styled() as module:
        figure = draw(module, source_of(EDGES.replace("joints:", f"{bodies}joints:")))
        figure.canvas.draw()
    (legend,), (axis,) = figure.legends, figure.axes
    words = [each.get_text() for each in legend.get_texts()]
    assert len(set(words)) == len(words) >= 27
    assert sum(each.startswith("the_left_front") for each in words) == 25
    box, title = legend.get_window_extent(), axis.get_window_extent().y1 + 0.1 * figure.dpi
    assert box.x1 <= figure.bbox.x1
    assert box.y0 >= title


def test_symbols_in_a_legend_are_no_higher_than_its_lines() -> None:
    from mdstopo.plots.style import styled

    with styled() as module:
        figure = draw(module, source_of(EDGES.replace("force: [5, 1]", "force: [5, 1], moment: 4")))
    (axis,) = figure.axes
    (moment,) = (line for line in axis.lines if line.get_label() == "moment")
    corners = moment.get_marker().vertices
    assert 7.0 < moment.get_markersize() * np.ptp(corners[:, 1]) / (2.0 * np.abs(corners).max()) <= 10.0 + 1e-9


def test_a_moving_svg_dashes_belts_while_they_are_slack_and_shows_what_is_touched() -> None:
    from mdstopo.plots.moving_svg import Timing, moving_svg
    from mdstopo.plots.thickness import Thickness

    text = EDGES.replace("  alone:", "  slack:").replace(
        "[4, 0.2]}, law: {type: spring, stiffness: 5}", "[4, 0.2]}, law: LAW"
    )
    text = text.replace("LAW", "{type: gap, stiffness: 5, gap: 0.1}")
    text += """points: {foot: {body: b, grid: {list: [[4, 0]]}}}
contacts: [{points: foot, on: {body: ground, from: [-1, -0.4], to: [5, -0.4]}, stiffness: 1e4}]
"""
    source = source_of(text)
    source.title = "belts"
    states = np.tile(start_state(source.case), (3, 1))
    states[1:, 3] += 0.5  # pulled taut
    shares = Thickness(tuple(np.ones(len(group)) for group in source.case.members), "")
    timing = Timing("default", np.linspace(0.0, 1.0, 3), 4.0)
    said = moving_svg(Stage(source, states), shares, states, timing)
    assert said.count('attributeName="stroke-dasharray"') == 1
    assert 'calcMode="discrete" values="4 3;none;none"' in said
    assert "4 times slower" in said
    assert said.split("<g ")[0].count("<polyline") == 3 + len(bodies_lines(source)) + 1


def bodies_lines(source: Any) -> list[Any]:
    from mdstopo.plots.body_shapes import planar_shapes

    shapes = [shape for name in ("a", "b", "ground") for shape in planar_shapes(source.case, name)]
    return [line for shape in shapes for line in (*shape.areas, *shape.lines, *shape.arms)]


@pytest.mark.parametrize(
    ("names", "seconds"),
    [
        (("belts", "chains"), ("belts", "chains")),
        (("belt_1", "belt_2"), ("belt_1", "belt_2")),
        (("belt_1", "belt_2"), ("belt_1_0", "belt_2_0")),  # single members of a final design
    ],
)
def test_a_difference_between_two_members_of_the_same_points_is_drawn_as_that(
    names: tuple[str, str], seconds: tuple[str, str]
) -> None:
    from mdstopo.plots.designs_plot import draw_pair
    from mdstopo.plots.style import difference, styled

    text = EDGES + "objectives: {G: {response: energy}}\nconstraints: [{volume: all, fraction: 0.5}]\n"
    a, b = "{body: a, at: [0, 0]}", "{body: b, at: [4, 0.3]}"
    text = text.replace(f"from: {b}, to: {a}", f"from: {a}, to: {b}")
    both = []
    for (one, other), sizes in ((names, (1.0, 0.0)), (seconds, (0.0, 1.0))):
        source = source_of(text.replace("belts:", f"{one}:").replace("chains:", f"{other}:"))
        known = {one: sizes[0], other: sizes[1], "alone": 1.0}
        source.alpha = np.array([known[name] for name in source.case.group_slices])
        both.append(source)
    with styled() as module:
        figure = draw_pair(module, *both, ("first", "second"))
    wanted = matplotlib.colors.to_rgba(difference())
    found = [
        sum(
            len(each.get_segments())
            for each in axis.collections
            if len(each.get_colors()) and tuple(each.get_colors()[0]) == wanted
        )
        for axis in figure.axes[2:4]
    ]
    assert found == [1, 1]


@pytest.mark.parametrize("largest", [1.0, 0.25])
def test_two_designs_are_as_wide_as_they_are_beside_each_other(largest: float) -> None:
    from mdstopo.plots.designs_plot import draw_pair
    from mdstopo.plots.style import difference, styled
    from mdstopo.plots.thickness import alike

    text = EDGES + "objectives: {G: {response: energy}}\nconstraints: [{volume: all, fraction: 0.5}]\n"
    both = [source_of(text), source_of(text)]
    both[0].alpha, both[1].alpha = largest * np.array([0.2, 0.4, 0.4]), largest * np.array([0.4, 0.8, 0.8])
    one, other = alike(*both)
    lower = both[0].case.members[0].lower
    first, second = ((source.alpha - lower) / (0.8 * largest - lower) for source in both)
    assert np.concatenate(one.shares) == pytest.approx(first)
    assert np.concatenate(other.shares) == pytest.approx(second)
    assert one.what == other.what == f"alpha, up to {0.8 * largest:.3g}"
    with styled() as module:  # each member is twice as large in the second
        figure = draw_pair(module, *both, ("first", "second"))
    wanted = matplotlib.colors.to_rgba(difference())
    drawn = [
        len(each.get_segments()) for each in figure.axes[3].collections if tuple(each.get_colors()[:1].flat) == wanted
    ]
    assert sum(drawn) == 3


@pytest.mark.parametrize(("other", "legends"), [("belts", 1), ("ropes", 2)])
def test_a_picture_of_two_designs_names_the_groups_of_each(other: str, legends: int) -> None:
    """Colours go by the place of a group in its own case, so that two cases may need two legends; they had none."""
    from mdstopo.plots.designs_plot import draw_pair
    from mdstopo.plots.style import colour, styled

    text = EDGES + "objectives: {G: {response: energy}}\nconstraints: [{volume: all, fraction: 0.5}]\n"
    both = [source_of(text), source_of(text.replace("belts:", f"{other}:"))]
    with styled() as module:
        figure = draw_pair(module, *both, ("first", "second"))
        first = colour(0)
    assert len(figure.legends) == legends
    for legend, source in zip(figure.legends, both, strict=False):
        names = [each.get_text() for each in legend.get_texts()]
        groups = [group.name for group in source.case.members]
        assert [name for name in names if name in groups] == groups
        line = legend.get_lines()[names.index(groups[0])]
        assert matplotlib.colors.to_rgba(line.get_color()) == matplotlib.colors.to_rgba(first)
        assert legend.get_window_extent().y0 > max(axis.get_window_extent().y1 for axis in figure.axes)


@pytest.mark.parametrize("dark", [False, True])
def test_the_colour_of_differences_is_told_from_paper_ink_and_groups(dark: bool) -> None:
    """Farther from each, in sRGB, than a quarter of the way from black to white."""
    from mdstopo.plots.style import COLOURS, colour, difference, ink, paper, styled

    with styled(dark):
        others = [paper(), *(colour(k) for k in range(len(COLOURS))), *map(ink, ("full", "middle", "faint"))]
        own = np.array(matplotlib.colors.to_rgb(difference()))
    for other in others:
        assert np.linalg.norm(own - matplotlib.colors.to_rgb(other)) > 0.25 * np.sqrt(3.0), other
