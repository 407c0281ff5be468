"""Members that do not act at the time that is shown are thin, straight and dotted in grey, in all pictures."""

import re
from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.plots.acting import DOTS, IDLE, NOT_ACTING, acting
from mdstopo.plots.cloud import planar_cloud
from mdstopo.plots.layout_plot import draw
from mdstopo.plots.legend import legend_names
from mdstopo.plots.member_lines import WIDEST
from mdstopo.plots.moving_svg import POINT, Timing, moving_svg
from mdstopo.plots.notebook import InMemory
from mdstopo.plots.scenery import Floats, start_state
from mdstopo.plots.slack import member_lines
from mdstopo.plots.source import Motion
from mdstopo.plots.stage import Stage
from mdstopo.plots.style import colour, ink, styled
from mdstopo.plots.thickness import thickness

CASE = """
format: 1
time: {end: 1}
define: {release: 0.75}
bodies: {a: {mass: 1, inertia: 1, position: [1, 0]}}
points: {posts: {body: ground, grid: {list: [[0, 0], [0, 1]]}}}
members:
  sling: {from: posts, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 5, active_until: 0.9}}
  hook:
    from: posts
    to: {body: a, at: [1, 0]}
    law: {type: gap, stiffness: 5, free_length: 4, active_until: "=release"}
  twice:
    from: posts
    to: {body: a, at: [1, 0]}
    law:
      - {type: spring, stiffness: 5, active_from: 0.2, active_until: 0.3}
      - {type: spring, stiffness: 5, active_from: 0.6}
  always: {from: posts, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 5}}
design:
  initial: 0.5
  variables:
    own: {group: sling, parameter: active_until, each: member, lower: 0, upper: 1}
    late: {group: always, parameter: damping, initial: 1, lower: 0, upper: 2}
    let_go: {of: define.release, lower: 0.1, upper: 1}
objectives: {peak: {response: {displacement: {body: a, component: x}}}}
"""
#: where lines of members lie among others
MEMBERS = 2.2
#: a mass on springs of which each acts for a time; its force is never zero
PULLED = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [1, 0]}}
members:
  begun: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [1, 0]}, law: LAW}
design: {initial: 1, variables: {VARIABLES}}
objectives: {peak: {response: {displacement: {body: a, component: x}}}}
"""


class AtRest(InMemory):
    """A design whose motion stays where it starts, so that nothing is simulated."""

    def motion(self, load_case: str, times: Floats | None = None) -> Motion:
        assert times is not None
        return Motion(times, np.tile(start_state(self.case), (len(times), 1)))


def source_of(text: str = CASE, **values: Any) -> AtRest:
    """A design of a case with some values of variables."""
    case = read_case(text)
    design = case.start.copy()
    for name, value in values.items():
        design[case.space.parts[name]] = value
    return AtRest(case, design)


def at(source: AtRest, t: float | None) -> dict[str, list[bool]]:
    return {group.name: acting(source, group, t).tolist() for group in source.case.members}


def test_a_member_acts_while_any_of_its_laws_acts_from_its_first_time_to_before_its_last() -> None:
    source = source_of()
    both = {t: at(source, t)["twice"] for t in (0.1, 0.2, 0.25, 0.3, 0.5, 0.6, 1.0)}
    assert [each[0] for each in both.values()] == [False, True, True, False, False, True, True]
    assert all(first == second for first, second in both.values())
    assert at(source, 0.89)["sling"] == [True, True]
    assert at(source, 0.9)["sling"] == [False, False]
    assert at(source, 1.0)["always"] == [True, True]
    assert at(source, None) == {name: [True, True] for name in at(source, 0.0)}  # no time is shown


def test_times_that_are_design_variables_are_those_of_the_design() -> None:
    source = source_of(own=[0.3, 0.5], let_go=0.4)
    assert at(source, 0.35)["sling"] == [False, True]
    assert at(source, 0.39)["hook"] == [True, True]
    assert at(source, 0.4)["hook"] == [False, False]
    assert at(source, 0.55)["sling"] == [False, False]


@pytest.mark.parametrize(
    ("law", "variables", "value"),
    [
        ("{type: spring, stiffness: 5, free_length: 0.5, active_until: 0.9}", "active_until, lower: 0, upper: 1", 0.44),
        ("{type: spring, stiffness: 5, free_length: 0.5, active_from: 0.9}", "active_from, lower: 0, upper: 1", 0.61),
    ],
)
def test_members_act_in_pictures_while_they_accelerate_bodies_in_the_motion(
    law: str, variables: str, value: float
) -> None:
    text = PULLED.replace("LAW", law).replace("VARIABLES", f"t: {{group: begun, parameter: {variables}}}")
    source = source_of(text, t=value)
    times = np.linspace(0.0, 1.0, 51)
    speeds = source.engine.trajectory(source.design, "default").at(times).v[:, 0]
    pulled = np.abs(np.diff(speeds)) > 1e-6
    middle = [acting(source, source.case.members[0], t)[0] for t in (0.5 * (times[:-1] + times[1:])).tolist()]
    assert 10 < sum(middle) < 40
    assert pulled.tolist() == middle


def drawn(figure: Any, panel: int = 0) -> list[tuple[str, float, bool, int]]:
    """Colour, width, whether it is dotted, and corners of each line of members in a panel."""
    from matplotlib.colors import to_hex

    found = []
    for lines in [each for each in figure.axes[panel].collections if each.get_zorder() == MEMBERS]:
        for line, wide in zip(lines.get_segments(), lines.get_linewidths(), strict=True):
            style = lines.get_linestyles()[0]
            found.append((to_hex(lines.get_colors()[0]).upper(), float(wide), style[1] is not None, len(line)))
    return found


def test_a_layout_shows_what_does_not_act_at_its_time_as_dotted_straight_and_thin() -> None:
    pytest.importorskip("matplotlib")
    source = source_of(own=[0.3, 0.5], let_go=0.4)
    grey = (ink("middle").upper(), IDLE, True, 2)
    with styled() as module:
        figure = draw(module, source, None, (0.25, 0.55))
        still = draw(module, source)
    first, second, before = drawn(figure, 0), drawn(figure, 1), drawn(still)
    assert len(first) == len(second) == len(before) == 8
    assert [line for line in first if line[0] == grey[0]] == []
    assert [line for line in second if line[0] == grey[0]] == [grey] * 6  # all but those that always act
    assert [line for line in before if line[0] == grey[0]] == []
    assert {line[0] for line in before} == {colour(k).upper() for k in range(4)}
    assert [line[3] > 2 for line in second].count(True) == 0  # the hook is slack, and hangs only while it acts
    assert [line[3] > 2 for line in first].count(True) == 2
    (legend,), (other,) = figure.legends, still.legends
    assert NOT_ACTING in [text.get_text() for text in legend.get_texts()]  # though not in the first panel
    assert NOT_ACTING not in [text.get_text() for text in other.get_texts()]


def test_in_space_each_view_shows_what_does_not_act() -> None:
    pytest.importorskip("matplotlib")
    text = PULLED.replace("LAW", "{type: spring, stiffness: 5, active_until: 0.5}").replace("[0, 0]", "[0, 0, 0]")
    text = text.replace("[1, 0]", "[1, 0, 0]").replace("inertia: 1", "inertia: [1, 1, 1]")
    source = source_of(text.replace("format: 1", "format: 1\ndimension: 3").replace(", variables: {VARIABLES}", ""))
    with styled() as module:
        figure = draw(module, source, None, (0.25, 0.75))
    grey = ink("middle").upper()
    shown = [[line[:3] for line in drawn(figure, panel) if line[0] == grey and line[2]] for panel in range(8)]
    assert shown == [[]] * 4 + [[(grey, IDLE, True)]] * 4
    (legend,) = figure.legends
    assert NOT_ACTING in [text.get_text() for text in legend.get_texts()]


def test_a_moving_picture_changes_the_look_of_a_member_when_it_stops_acting() -> None:
    source = source_of(own=[0.3, 0.5], let_go=0.4)
    times = np.array([0.0, 0.25, 0.35, 0.45, 0.55])
    states = np.tile(start_state(source.case), (len(times), 1))
    said = moving_svg(
        Stage(source, states, "default", times.tolist()), thickness(source), states, Timing("default", times, 4.0)
    )
    grey, thin, dots = ink("middle"), f"{POINT * IDLE:.2f}", " ".join(map(str, DOTS))

    def values(line: str, name: str) -> list[str]:
        return re.search(rf'attributeName="{name}"[^>]*values="([^"]*)"', line).group(1).split(";")  # type: ignore[union-attr]

    lines = [line for line in said.splitlines() if 'attributeName="stroke"' in line]
    expected = [[t >= until for t in times] for until in (0.3, 0.5, 0.4, 0.4)]
    expected += [[not (0.2 <= t < 0.3) for t in times]] * 2
    assert len(lines) == 6
    for line, idle in zip(lines, expected, strict=True):
        assert [each == grey for each in values(line, "stroke")] == idle
        assert [each == thin for each in values(line, "stroke-width")] == idle
        assert [each == dots for each in values(line, "stroke-dasharray")] == idle
    still = moving_svg(Stage(source, states[:1]), thickness(source), states[:1])
    assert f'stroke-dasharray="{dots}"' not in still


def test_a_slack_belt_that_does_not_act_is_seen_straight_between_its_ends() -> None:
    source = source_of()
    (hook,) = (group for group in source.case.members if group.name == "hook")
    q = start_state(source.case)
    lines, slack = member_lines(source.case, hook, q, lambda places: places, np.arange(2), np.array([True, False]))
    assert slack.tolist() == [True, False]
    assert np.ptp(lines[1] @ [1.0, 1.0]) == pytest.approx(0.0, abs=1e-12)  # from (0, 1) to (1, 0)
    low = [planar_cloud(source.case, q[None], lambda group, k, on=on: np.full(len(group), on))[:, 1].min()
           for on in (True, False)]  # fmt: skip
    assert low[0] < -0.25
    assert low[1] > -0.1


def test_a_legend_has_room_for_its_word_only_where_a_time_is_shown() -> None:
    case = source_of().case
    assert NOT_ACTING in legend_names(case, at_times=True)
    assert NOT_ACTING not in legend_names(case)
    always = read_case(PULLED.replace("LAW", "{type: spring, stiffness: 5}").replace(", variables: {VARIABLES}", ""))
    assert NOT_ACTING not in legend_names(always, at_times=True)
    assert IDLE < WIDEST
