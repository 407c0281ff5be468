"""The page draws members where pictures do: slack belts hang alike, members of the same ends lie beside each other."""

import json
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.plots.acting import DOTS, IDLE, NOT_ACTING, acts_in
from mdstopo.plots.beside import sideways
from mdstopo.plots.scenery import start_state
from mdstopo.plots.slack import CORNERS, DASHES, DEEPEST, SLACK, THIN, belt_lengths, down, member_lines
from mdstopo.plots.style import ink
from mdstopo.plots.windows_of_laws import active_windows
from mdstopo.report import report_content

SCENE = Path(report_content.__file__).with_name("scene_plane.js")
NODE = shutil.which("node")
SCRIPTS = [Path(report_content.__file__).with_name(name) for name in ("glyphs.js", "members.js")]
CASE = """
format: 1
gravity: [3, -9.8]
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [1, 0]}}
points:
  posts: {body: ground, grid: {list: [[0, 0], [0.2, 0.5], [0.5, 0]]}}
members:
  slack: {from: posts, to: {body: a, at: [1, 0]}, law: {type: gap, stiffness: 5, gap: 0.02}}
  long: {from: posts, to: {body: a, at: [1, 0]}, law: {type: gap, stiffness: 5, free_length: 4}}
  taut: {from: posts, to: {body: a, at: [1, 0]}, law: {type: gap, stiffness: 5, gap: 0}}
  springs: {from: posts, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 5}}
"""


def in_node(script: str) -> object:
    assert NODE is not None
    text = "".join(each.read_text() for each in SCRIPTS) + f"\nprocess.stdout.write(JSON.stringify({script}));"
    return json.loads(subprocess.run([NODE, "-e", text], capture_output=True, text=True, check=True, timeout=60).stdout)


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_belts_hang_on_the_page_as_in_pictures() -> None:
    case = read_case(CASE)
    hang = json.dumps({"slack": SLACK, "deepest": DEEPEST, "corners": CORNERS, "down": down(case).tolist()})
    calls, expected = [], []
    for group in case.members:
        belts = belt_lengths(case, group)
        lines, slack = member_lines(case, group, start_state(case), lambda places: places, np.arange(len(group)))
        for k, (line, hangs) in enumerate(zip(lines, slack.tolist(), strict=True)):
            p, q = line[0].tolist(), line[-1].tolist()
            calls.append(f"memberLine({hang}, {p}, {q}, {'null' if belts is None else float(belts[k])})")
            expected.append((line if hangs else line[[0, -1]], hangs))
    found = in_node(f"[{', '.join(calls)}]")
    assert [each["slack"] for each in found] == [hangs for _, hangs in expected]
    assert sum(hangs for _, hangs in expected) == 6
    for each, (line, _) in zip(found, expected, strict=True):
        assert np.array(each["line"]) == pytest.approx(line, abs=1e-12)


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_members_are_shifted_on_the_page_to_the_side_that_pictures_choose() -> None:
    line = np.array([[1.0, 2.0], [4.0, 6.0]])
    on_screen = line * [1.0, -1.0]  # down is positive there
    found = np.array(in_node(f"shifted({on_screen.tolist()}, 2.5)")) * [1.0, -1.0]
    assert found - line == pytest.approx(np.repeat(2.5 * sideways(line[None], np.ones(1)), 2, axis=0))


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_what_is_far_off_is_left_out_of_the_page_where_it_would_make_the_rest_small() -> None:
    inner, all_places = "[[0, 0], [1, 1]]", "[[0, 0], [1, 1], [REACH, 0]]"
    assert in_node(f"lookedAt({inner}, {all_places.replace('REACH', '1.9')}, 2)") == [[0, 0], [1, 1], [1.9, 0]]
    assert in_node(f"lookedAt({inner}, {all_places.replace('REACH', '30')}, 2)") == [[0, 0], [1, 1]]


#: what a scene draws on: keeps each line with its width and dashes
PAPER = """
const drawn = [], own = { dash: [] };
const g = new Proxy(own, {
  get: (_, name) => own[name] || (() => 0), set: (_, name, value) => { own[name] = value; return true; },
});
Object.assign(own, {
  beginPath() { own.path = []; }, moveTo(x, y) { own.path.push([x, y]); }, lineTo(x, y) { own.path.push([x, y]); },
  setLineDash(dash) { own.dash = dash; },
  stroke() { drawn.push([own.path, own.lineWidth, own.dash, own.strokeStyle]); },
});
"""


def source_of(case: Case) -> SimpleNamespace:
    """The first design of a case, of which no motion is simulated."""
    view = SimpleNamespace(
        arrays={}, status="done", reason="", kind="simulate", warnings=(), case_text="", provenance={}, settings={},
        path=Path("none.h5"), under=lambda place: {},
    )  # fmt: skip
    still = SimpleNamespace(trajectory=lambda alpha, name: SimpleNamespace(t=np.zeros(1)))
    return SimpleNamespace(
        case=case, stated=case, view=view, title="belts", names=(), load_cases=("default",), engine=still,
        alpha=case.start[: case.n_design], design=case.start,
    )  # fmt: skip


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_a_planar_scene_of_the_page_draws_slack_belts_thin_and_members_of_the_same_ends_beside_each_other() -> None:
    case = read_case(CASE)
    source = source_of(case)
    data = report_content.content(source)
    members = data["designs"][0]["members"]
    groups = [members["groups"][row[0]] for row in members["rows"]]
    lengths = {group.name: belt_lengths(case, group) for group in case.members}
    for row, name, belt, side in zip(members["rows"], groups, members["belts"], members["beside"], strict=True):
        assert belt == (None if lengths[name] is None else pytest.approx(lengths[name][row[8]], rel=1e-5))
        assert abs(side) in (0.5, 1.5)  # four between each two points
    script = f"""(() => {{ {PAPER} {SCENE.read_text()}
      const data = {json.dumps(data)}, members = data.designs[0].members, canvas = {{ getContext: () => g }};
      const scene = makeScene({{ canvas, data, motion: () => null, load: () => "default", colours: ["#fff"] }});
      scene.fit(members); drawn.length = 0;
      scene.draw(data.start, members, (row) => `member ${{row[0]}}`, false, null);
      return drawn.filter((each) => String(each[3]).startsWith("member"));
    }})()"""
    found = in_node(script)
    assert len(found) == len(groups) == 12
    widths = {(name in ("slack", "long")): width for name, (_, width, _, _) in zip(groups, found, strict=True)}
    assert widths[True] == pytest.approx(THIN * widths[False])
    for name, (path, _, dash, _) in zip(groups, found, strict=True):
        assert dash == (list(DASHES) if name in ("slack", "long") else [])
        assert len(path) == (CORNERS if name in ("slack", "long") else 2)
    starts = np.array([path[0] for path, *_ in found]).reshape(4, 3, 2)  # by group and post
    apart = np.linalg.norm(np.diff(starts, axis=0), axis=2)
    assert apart == pytest.approx(np.full((3, 3), apart[0, 0]))
    assert apart[0, 0] > max(widths.values())


#: belts that hang while they act, of which one changes its time in the design, and springs that act twice
TIMED = (
    CASE[: CASE.index("  slack:")]
    + """
  belts: {from: posts, to: {body: a, at: [1, 0]}, law: {type: gap, stiffness: 5, free_length: 4, active_until: 0.9}}
  springs:
    from: posts
    to: {body: a, at: [1, 0]}
    law: [{type: spring, stiffness: 5, active_until: 0.3}, {type: spring, stiffness: 5, active_from: 0.6}]
  always: {from: posts, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 5}}
design:
  variables: {until: {group: belts, parameter: active_until, each: member, initial: 0.5, lower: 0, upper: 1}}
objectives: {peak: {response: {displacement: {body: a, component: x}}}}
"""
)
TIMES = [0.0, 0.29, 0.3, 0.45, 0.5, 0.59, 0.6, 0.95]


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_members_act_on_the_page_at_the_times_at_which_they_act_in_pictures() -> None:
    case = read_case(TIMED)
    design = case.start.copy()
    design[-3:] = 0.4, 0.5, 0.6
    source = source_of(case)
    source.alpha, source.design = design[: case.n_design], design
    members = report_content.content(source)["designs"][0]["members"]
    said = in_node(f"{json.dumps(members['windows'])}.map((own) => {json.dumps(TIMES)}.map((t) => actsAt(own, t)))")
    windows = active_windows(case, design)
    expected = np.concatenate(
        [acts_in(windows[group.name], np.array(TIMES)).T if group.name in windows else np.ones((3, len(TIMES)), bool)
         for group in case.members]
    )  # fmt: skip
    assert members["windows"][-3:] == [None] * 3
    assert np.array(said).tolist() == expected.tolist()
    assert expected[:3].sum(axis=1).tolist() == [3, 4, 6]
    assert in_node(f"{json.dumps(members['windows'])}.map((own) => actsAt(own, null))") == [True] * 9


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
@pytest.mark.parametrize("space", [False, True])
def test_a_scene_of_the_page_draws_members_that_do_not_act_straight_thin_and_dotted_in_grey(space: bool) -> None:
    text = TIMED
    if space:
        text = (
            text.replace("[3, -9.8]", "[3, 0, -9.8]")
            .replace("[1, 0]", "[1, 0, 0]")
            .replace("inertia: 1", "inertia: [1, 1, 1]")
        )
        text = text.replace("[[0, 0], [0.2, 0.5], [0.5, 0]]", "[[0, 0, 0], [0.2, 0, 0.5], [0.5, 0, 0]]")
        text = text.replace("format: 1", "format: 1\ndimension: 3")
    data = report_content.content(source_of(read_case(text)))
    script = f"""(() => {{ {PAPER} {SCENE.with_name(f"scene_{'space' if space else 'plane'}.js").read_text()}
      const nothing = () => 0, classList = {{ add: nothing }};
      const node = () => ({{ addEventListener: nothing, appendChild: nothing, classList, getContext: () => g }});
      globalThis.document = {{ createElement: node }};
      const data = {json.dumps(data)}, members = data.designs[0].members, canvas = node(), tools = node();
      const scene = makeScene({{ canvas, tools, data, motion: () => null, load: () => "default", colours: ["#fff"] }});
      scene.fit(members);
      return [null, 0.1, 0.55].map((time) => {{
        drawn.length = 0;
        scene.draw(data.start, members, (row) => `member ${{row[0]}}`, false, time);
        return drawn.filter((each) => String(each[3]).startsWith("member") || each[3] === data.hang.idle.colour);
      }});
    }})()"""
    still, first, later = in_node(script)
    idle = data["hang"]["idle"]
    assert (idle["word"], idle["colour"], idle["dots"]) == (NOT_ACTING, ink("middle"), DOTS)
    assert idle["width"] == pytest.approx(IDLE * 96.0 / 72.0)
    assert [len(each) for each in (still, first, later)] == [9, 9, 9]
    for shown, count in ((still, 0), (first, 0), (later, 6)):
        grey = [(len(path), width, dash) for path, width, dash, colour in shown if colour == idle["colour"]]
        assert grey == [(2, idle["width"], list(DOTS))] * count
        hanging = [len(path) for path, _, dash, _ in shown if dash == list(DASHES)]
        assert hanging == [CORNERS] * (0 if count else 3)
