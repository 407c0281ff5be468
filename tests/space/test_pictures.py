"""Pictures, the page and the exported motion of bodies in space; motions are made by hand, nothing is compiled."""

import json
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mdstopo.case.reader import read_case
from mdstopo.plots.acting import NOT_ACTING
from mdstopo.plots.scenery import ends_at, start_state
from mdstopo.plots.solids import convex, equal_box, solid
from mdstopo.plots.surface_lines import surfaces_of
from mdstopo.plots.thickness import thickness
from mdstopo.plots.views import upright, views
from mdstopo.plots.windows_of_laws import active_windows
from mdstopo.report import report_content
from mdstopo.report.gltf_motion import _sideways, motion_file
from mdstopo.report.report_page import page
from mdstopo.scene.point_positions import point_rates, points_at
from mdstopo.scene.quaternions import quaternions_of
from tests.browser import BROWSER, look
from tests.front.support import CASE as PLANAR
from tests.space.gltf_reader import Gltf

NODE = shutil.which("node")
TITLE = "A hull </script><script>alert(1)</script> & {data}"
CASE = """\
format: 1
dimension: 3
title: "TITLE"
gravity: [0, 0, -9.81]
time: {end: 2}
bodies:
  hull: {mass: 60, inertia: [4, 5, 6], position: [0, 0, 1], orientation: {axis: [0, 0, 1], angle: 0.2}}
  ball: {mass: 3, inertia: [0.1, 0.1, 0.1], position: [1, 0, 1]}
joints:
  - {name: elbow, type: revolute, bodies: [hull, ball], at: [0.5, 0, 1], axis: [0, 1, 0]}
points:
  corners: {body: hull, frame: body, grid: {box: {from: [-0.5, -0.4, -0.25], to: [0.5, 0.4, 0.25], count: [3, 2, 2]}}}
  posts: {body: ground, grid: {plane: {corner: [-1.5, -1.2, 0], edges: [[3, 0, 0], [0, 2.4, 0]], count: [2, 2]}}}
contacts:
  - {points: corners, on: {body: ground, plane: {at: [0, 0, 0.2], normal: [0, 0.1, 1]}}, stiffness: 1e4}
  - {points: corners, on: {body: ball, sphere: {center: [1, 0, 1], radius: 0.1}}, stiffness: 1e4}
  - points: posts
    on: {body: hull, frame: body, rectangle: {center: [0, 0, 0.3], axes: [[1, 0, 0], [0, 1, 0]], size: [1, 0.8]}}
    stiffness: 1e4
  - points: posts
    on: {body: hull, frame: body, cylinder: {from: [0, 0, 0], to: [1, 0, 0], radius: 0.3, hollow: true}}
    stiffness: 1e4
members:
  lashings: {from: corners, to: posts, law: {type: spring, stiffness: 800}}
objectives:
  sway: {response: {displacement: {body: hull, component: norm}}, over_time: max}
""".replace("TITLE", TITLE)
#: parts of the names of groups
WAYS = ("fore_port", "fore_starboard", "aft_port", "aft_starboard")
#: rad/s about a global axis, m/s, of the hull; the ball stays
SPIN, DRIFT = np.array([0.0, 9.0, 12.0]), np.array([0.1, 0.0, 0.3])


def states(case, times):
    """q and v of the motion."""
    q = np.tile(start_state(case), (len(times), 1))
    v = np.zeros((len(times), 12))
    turned = Rotation.from_rotvec(times[:, None] * SPIN) * Rotation.from_matrix(case.bodies[0].rotation)
    q[:, :3] += times[:, None] * DRIFT
    q[:, 3:7] = quaternions_of(turned.as_matrix())
    for k in range(1, len(q)):
        q[k, 3:7] *= 1.0 if q[k, 3:7] @ q[k - 1, 3:7] >= 0.0 else -1.0
    v[:, :3], v[:, 3:6] = DRIFT, SPIN
    return q, v


@pytest.fixture(scope="module")
def source():
    """A result as pictures ask for it: steps of 0.05 s, and an engine that knows the motion at any time."""
    case = read_case(CASE)
    t = np.linspace(0.0, 2.0, 41)
    q, v = states(case, t)
    alpha = np.linspace(0.001, 1.0, case.n_design)
    view = SimpleNamespace(
        path=Path("hull.h5"), status="done", reason="", kind="simulate", warnings=(), case_text=CASE, provenance={},
        settings={}, arrays={"design/alpha": alpha},
        under=lambda place: {"t": t, "q": q, "v": v} if place.startswith("trajectories") else {},
    )  # fmt: skip

    def at(times):
        return SimpleNamespace(**dict(zip("qv", states(case, np.asarray(times)), strict=True)))

    motion = SimpleNamespace(t=t, q=q, v=v, at=at, status=SimpleNamespace(ok=True))
    return SimpleNamespace(
        case=case, stated=case, alpha=alpha, design=alpha, view=view, title=TITLE, names=("sway",),
        load_cases=("default",), engine=SimpleNamespace(trajectory=lambda design, name: motion),
    )  # fmt: skip


def test_a_box_has_six_faces_and_twelve_edges_that_look_outward():
    points = np.array([[x, y, z] for x in (0.0, 1.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 0.5, 4.0)])
    turned = points @ Rotation.from_rotvec([0.3, -0.4, 0.9]).as_matrix().T
    shape = convex(turned)
    assert (len(shape.corners), len(shape.faces), len(shape.edges)) == (8, 6, 12)
    assert _volume(shape) == pytest.approx(24.0)


def test_every_point_is_inside_of_the_hull():
    points = np.random.default_rng(5).normal(size=(300, 3))
    shape = convex(points)
    for face in shape.faces:
        a, b, c = shape.corners[list(face[:3])]
        normal = np.cross(b - a, c - a)
        assert ((points - a) @ normal).max() < 1e-9 * np.linalg.norm(normal)
    assert len(shape.corners) - len(shape.edges) + len(shape.faces) == 2  # Euler
    assert len(convex(np.zeros((4, 3))).corners) == 1
    assert convex(np.outer([0.0, 2.0, 1.0], [1.0, 1.0, 0.0])).edges == ((0, 1),)
    flat = convex(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.5, 0.5, 1.0], [0.0, 1.0, 1.0]]))
    assert (len(flat.corners), len(flat.faces), len(flat.edges)) == (4, 1, 4)


def test_a_body_without_points_is_the_box_of_its_inertia():
    a, b, c, mass = 0.2, 0.5, 0.9, 7.0
    turn = Rotation.from_rotvec([0.2, 0.5, -0.3]).as_matrix()
    tensor = turn @ np.diag(mass / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])) @ turn.T
    shape = equal_box(mass, tensor)
    assert _volume(shape) == pytest.approx(a * b * c)
    assert np.abs(shape.corners @ turn) == pytest.approx(np.tile([0.5 * a, 0.5 * b, 0.5 * c], (8, 1)))
    assert len(equal_box(1.0, np.diag([0.0, 1.0, 1.0])).corners) == 2  # a rod


def test_lines_of_surfaces_lie_on_them():
    case = read_case(CASE)
    found = surfaces_of(case)
    assert [each.body for each in found] == ["ground", "ball", "hull", "hull"]
    assert [each.endless for each in found] == [True, False, False, False]
    plane, sphere, rectangle, cylinder = (np.concatenate(each.lines) for each in found)
    assert (plane - [0.0, 0.0, 0.2]) @ [0.0, 0.1, 1.0] == pytest.approx(np.zeros(len(plane)), abs=1e-12)
    assert np.ptp(plane[:, 0]) > 2.0  # as large as the scene
    assert np.linalg.norm(sphere, axis=1) == pytest.approx(np.full(len(sphere), 0.1))
    assert rectangle[:, 2] == pytest.approx(np.full(len(rectangle), 0.3))
    assert np.abs(rectangle).max(axis=0) == pytest.approx([0.5, 0.4, 0.3])
    assert np.linalg.norm(cylinder[:, 1:], axis=1) == pytest.approx(np.full(len(cylinder), 0.3))
    assert (cylinder[:, 0].min(), cylinder[:, 0].max()) == pytest.approx((0.0, 1.0))


def _volume(shape):
    total = 0.0
    for face in shape.faces:
        for k in range(1, len(face) - 1):
            a, b, c = shape.corners[[face[0], face[k], face[k + 1]]]
            total += np.dot(a, np.cross(b, c)) / 6.0
    return total


@pytest.mark.parametrize("gravity", ["[0, 0, -9.81]", "[0, -9.81, 0]", "[0, 0, 9.81]", "[-9.81, 0, 0]", "[0, 0, 0]"])
def test_up_is_against_gravity_and_views_are_right_handed(gravity):
    case = read_case(CASE.replace("[0, 0, -9.81]", gravity))
    axes = upright(case)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    pull = np.array(json.loads(gravity))
    assert axes[2] @ pull == -np.abs(pull).max()
    for view in views(case, np.zeros(3), 1.0).values():
        assert np.array([view.across, view.along, view.toward]) @ np.array(
            [view.across, view.along, view.toward]
        ).T == pytest.approx(np.eye(3), abs=1e-14)
        assert np.cross(view.across, view.along) == pytest.approx(view.toward)


def test_what_is_nearer_is_larger_in_perspective():
    case = read_case(CASE)
    view = views(case, np.zeros(3), 1.0)["perspective"]
    rod = np.array([[0.0, 0.0, 0.0], view.across * 0.1])
    near, far = (view.seen(rod + s * view.toward) for s in (0.8, -0.8))
    assert np.ptp(near[:, 0]) / np.ptp(far[:, 0]) == pytest.approx((4.0 + 0.8) / (4.0 - 0.8))


@pytest.mark.parametrize("text", [CASE, PLANAR])
def test_rates_of_points_are_derivatives(text):
    case = read_case(text)
    random = np.random.default_rng(2)
    count, h = len(case.bodies), 1e-6
    local = random.normal(size=(4, case.dimension))
    if case.dimension == 3:
        v = np.tile([*DRIFT, *SPIN, 0, 0, 0, 0, 0, 0], (1, 1))
        before, now, after = (states(case, np.array([0.4 + s * h]))[0] for s in (-1, 0, 1))
    else:
        now, v = random.normal(size=(2, 1, 3 * count))
        before, after = now - h * v, now + h * v
    body = case.bodies[0].name
    slope = (points_at(case, body, local, after) - points_at(case, body, local, before)) / (2.0 * h)
    assert point_rates(case, body, local, now, v) == pytest.approx(slope, abs=1e-7)
    assert not point_rates(case, "ground", local, now, v).any()


@pytest.mark.parametrize("moments", [(None,), (0.0, 0.5)], ids=["of the design", "of two moments"])
def test_layouts_have_three_views_of_one_scale_and_a_perspective(source, moments, tmp_path):
    pytest.importorskip("matplotlib")
    from mdstopo.plots.space_layout import draw_space
    from mdstopo.plots.style import save, styled

    with styled() as module:
        start = start_state(source.case)
        panels = [(t, states(source.case, np.array([t]))[0][0] if t else start) for t in moments]
        figure = draw_space(module, source, panels, thickness(source))
        assert len(figure.axes) == 4 * len(panels)
        scales, labels = [], []
        for axis in figure.axes:
            if axis.get_xlabel():
                labels.append((axis.get_title("left")[:5].strip(" ,"), axis.get_xlabel(), axis.get_ylabel()))
                box = axis.get_position().size * figure.get_size_inches()
                scales += [box[0] / np.ptp(axis.get_xlim()), box[1] / np.ptp(axis.get_ylim())]
        assert scales == pytest.approx([scales[0]] * 6 * len(panels))
        assert set(labels) == {("front", "x, m", "z, m"), ("top", "x, m", "y, m"), ("side", "y, m", "z, m")}
        for ending in ("svg", "png"):
            save(figure, tmp_path / f"layout.{ending}")
            assert (tmp_path / f"layout.{ending}").stat().st_size > 5000


@pytest.fixture(scope="module")
def named(source):
    """The same with eight groups whose names are long."""
    group = "  lashings: {from: corners, to: posts, law: {type: spring, stiffness: 800}}\n"
    eight = [group.replace("lashings", f"lashings_of_the_{way}_quarter_{k}") for k in (1, 2) for way in WAYS]
    case = read_case(CASE.replace(group, "".join(eight)).replace("body: hull, component", "body: ball, component"))
    alpha = np.linspace(0.001, 1.0, case.n_design)
    return SimpleNamespace(**{**vars(source), "case": case, "stated": case, "alpha": alpha, "design": alpha})


def inside(figure, artist) -> bool:
    """Whether an artist is within the picture, as it is drawn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    box, whole = artist.get_window_extent(canvas.get_renderer()), figure.bbox
    return bool(box.x0 >= whole.x0 and box.x1 <= whole.x1 and box.y0 >= whole.y0 and box.y1 <= whole.y1)


def test_long_names_are_whole_and_hide_nothing(named):
    pytest.importorskip("matplotlib")
    from mdstopo.plots import design_plot
    from mdstopo.plots.space_layout import draw_space
    from mdstopo.plots.style import styled

    with styled() as module:
        start = start_state(named.case)
        layout = draw_space(module, named, [(None, start)], thickness(named))
        (legend,) = layout.legends
        assert inside(layout, legend)
        assert len(legend.get_texts()) == 12
        below = legend.get_window_extent().y0
        assert all(axis.get_window_extent().y1 <= below for axis in layout.axes)
        design = design_plot.draw(module, named)
        (axis,) = design.axes
        assert inside(design, axis.get_legend())
        assert axis.get_legend().get_window_extent().y0 >= axis.get_window_extent().y1 - 5.0


def test_a_long_title_of_a_history_is_whole(named, monkeypatch):
    pytest.importorskip("matplotlib")
    from mdstopo.plots import histories_plot
    from mdstopo.plots.style import styled

    times = np.linspace(0.0, 2.0, histories_plot.SAMPLES)
    monkeypatch.setattr(histories_plot, "response_history", lambda *_: {"sway": 0.3 * times})
    monkeypatch.setattr(histories_plot, "words", lambda _: "displacement y of the cargo relative to the ship's deck")
    with styled() as module:
        figure = histories_plot.draw(module, SimpleNamespace(**{**vars(named), "load_cases": ("default", "rolling")}))
        (axis,) = figure.axes
        assert axis.get_title("left").endswith("load case default")
        assert inside(figure, axis._left_title)


@pytest.fixture(scope="module")
def written(source, tmp_path_factory):
    """The page as a file, and its data."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report_content, "response_history", lambda *given: {"sway": 0.3 * given[-1]})
        data = report_content.content(source)
    place = tmp_path_factory.mktemp("page") / "hull.html"
    place.write_text(page(data))
    return place, data


def test_the_page_is_one_file_and_a_title_is_only_words(written):
    text = written[0].read_text()
    assert not re.search(r"(src|href)\s*=|https?://(?!www\.w3\.org/2000/svg)", text)
    assert text.count("<script") == 2
    assert "alert(1)</script>" not in text
    found = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)[1])
    assert found["title"] == TITLE
    assert found["dimension"] == 3
    assert [len(body["faces"]) for body in found["bodies"]] == [6, 0, 1]
    (elbow,) = found["symbols"]["default"]["still"]
    assert elbow["kind"] == "revolute"
    assert elbow["at"] == pytest.approx(Rotation.from_rotvec([0, 0, -0.2]).apply([0.5, 0, 0]), abs=1e-5)


def test_forces_in_the_page_are_those_of_the_springs(source, written):
    """The springs have no damper: force is alpha times stiffness times elongation."""
    design = written[1]["designs"][0]
    motion, rows = design["motions"]["default"], design["members"]["rows"]
    (group,) = source.case.members
    chosen = [row[10] for row in rows]
    for k in (0, 17, 80):
        q = states(source.case, np.array([motion["t"][k]]))[0][0]
        ends = ends_at(source.case, group, q)[chosen]
        stretch = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - group.length[chosen]
        assert motion["force"][k] == pytest.approx(source.alpha[chosen] * 800.0 * stretch, rel=2e-3, abs=1e-3)


def in_node(place: Path):
    """What a page draws as it is used."""
    script = Path(__file__).with_name("page_in_node.js")
    done = subprocess.run([NODE, str(script), str(place)], capture_output=True, text=True, timeout=60, check=True)
    return json.loads(done.stdout)


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_a_long_scene_stays_in_the_view_where_it_is_turned_from_its_end(source, tmp_path, monkeypatch):
    monkeypatch.setattr(report_content, "response_history", lambda *given: {"sway": 0.3 * given[-1]})
    case = read_case(
        CASE.replace("corner: [-1.5, -1.2, 0], edges: [[3, 0, 0]", "corner: [-15, -1.2, 0], edges: [[30, 0, 0]")
    )
    place = tmp_path / "long.html"
    place.write_text(page(report_content.content(SimpleNamespace(**{**vars(source), "case": case, "stated": case}))))
    drawn = in_node(place)["seen"]["turned from the side"]
    places = np.concatenate([each["path"] for each in drawn if each["kind"] == "area"])
    assert (places >= 0.0).all()
    assert (places <= [760.0, 560.0]).all()
    assert np.ptp(places[:, 0]) > 380.0
    # while it is turned, too, before the mouse is let go
    turning = [each["path"] for each in in_node(place)["seen"]["turning from the side"] if each["kind"] == "area"]
    assert np.concatenate(turning) == pytest.approx(places)


@pytest.mark.skipif(NODE is None, reason="no node on this machine")
def test_the_scene_turns_under_the_mouse_and_moves_with_the_slider(source, written):
    found = in_node(written[0])
    seen = found["seen"]
    assert (found["title"], found["clock"]) == (TITLE, "t = 1 s")
    pictures = {name: json.dumps(drawn) for name, drawn in seen.items()}
    assert pictures["back"] == pictures["perspective"]
    # another design or load case does not undo what the user has moved and zoomed
    assert pictures["chosen again"] == pictures["moved"]
    # what is turned is shown as large as it is when the mouse is let go
    assert pictures["turning from the side"] == pictures["turned from the side"]
    assert len(set(pictures.values())) == len(pictures) - 3
    assert all(np.isfinite(each["path"]).all() for drawn in seen.values() for each in drawn)
    case, start = source.case, start_state(source.case)
    corners = points_at(case, "hull", solid(case, "hull").corners, start[None])[0]
    ground = solid(case, "ground").corners
    for name, view in views(case, np.zeros(3), 1.0).items():
        if name == "perspective":
            continue
        drawn = [
            each["path"] for each in seen[name] if each["kind"] == "area" and each["colour"] in ("#009E73", "#555555")
        ]
        places = np.unique(np.round(np.concatenate(drawn), 6), axis=0)
        expected = view.seen(np.concatenate([corners, ground])) * [1.0, -1.0]
        # up to scale and place on the screen
        moved, told = (each - each.min(axis=0) for each in (expected, places))
        moved *= told.max() / moved.max()
        away = np.abs(moved[:, None] - told[None]).max(axis=2)
        assert away.min(axis=1).max() < 1e-3, name
        assert away.min(axis=0).max() < 1e-3, name


def test_the_exported_motion_is_gltf_and_is_the_motion(source):
    data, left_out = motion_file(source)
    assert left_out == 0
    found = Gltf(data)
    assert found.json["scenes"][0]["name"] == TITLE
    root = found.json["scenes"][0]["nodes"][0]
    standing = Rotation.from_quat(found.json["nodes"][root]["rotation"])
    assert standing.apply([0.0, 0.0, 1.0]) == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    hull, case = found.node("hull"), source.case
    t, place = found.track(0, hull, "translation")
    turn = Rotation.from_quat(found.track(0, hull, "rotation")[1])
    assert t[-1] == 2.0
    q = states(case, t.astype(np.float64))[0]
    assert place == pytest.approx(q[:, :3], abs=1e-6)
    exact = Rotation.from_quat(np.roll(q[:, 3:7], -1, axis=1))
    assert (turn * exact.inv()).magnitude().max() < 2e-4  # cubic polynomials within steps of 0.75 rad
    assert (turn[1:] * turn[:-1].inv()).magnitude().max() < 0.21
    (group,) = case.members
    for member in (5, len(group) - 1):
        node = found.node(f"lashings {member}")
        foot, scale = (found.track(0, node, path)[1] for path in ("translation", "scale"))
        tip = foot + Rotation.from_quat(found.track(0, node, "rotation")[1]).apply(
            np.outer(scale[:, 1], [0.0, 1.0, 0.0])
        )
        ends = np.stack([ends_at(case, group, each)[member] for each in q])
        assert foot == pytest.approx(ends[:, 0], abs=2e-4)
        assert tip == pytest.approx(ends[:, 1], abs=2e-4)
    slow = Gltf(motion_file(source, slower=10.0)[0])
    assert slow.track(0, hull, "translation")[0][-1] == pytest.approx(20.0)


def tubes(found, name):
    """(T, 2, 3) ends of the axis of a member's tube."""
    node = found.node(name)
    foot, turn, scale = (found.track(0, node, path)[1] for path in ("translation", "rotation", "scale"))
    tip = foot + Rotation.from_quat(turn).apply(np.outer(scale[:, 1], [0.0, 1.0, 0.0]))
    return np.stack([foot, tip], axis=1)


def test_exported_members_of_the_same_two_points_lie_beside_each_other_at_all_times(source):
    law = "law: {type: spring, stiffness: 800}}"
    text = CASE.replace("objectives:", f"  doubles: {{from: posts, to: corners, {law}\nobjectives:")
    text = text.replace("count: [2, 2]}}}", "count: [2, 2]}}}\n  tip: {body: ball, grid: {list: [[1, 0.5, 1]]}}")
    text = text.replace("  doubles", f"  alone: {{from: corners, to: tip, {law}\n  doubles")
    case = read_case(text)
    own = {"case": case, "alpha": np.ones(case.n_design), "design": np.ones(case.n_design)}
    found = Gltf(motion_file(SimpleNamespace(**{**vars(source), **own}))[0])
    t = found.track(0, found.node("hull"), "translation")[0].astype(np.float64)
    q = states(case, t)[0]
    lashings, alone, doubles = case.members
    exact = np.stack([ends_at(case, alone, each)[3] for each in q])
    assert tubes(found, "alone 3") == pytest.approx(exact, abs=2e-4)
    for corner, post in ((0, 0), (4, 3)):
        (one,) = np.flatnonzero((lashings.from_index == corner) & (lashings.to_index == post))
        (other,) = np.flatnonzero((doubles.from_index == post) & (doubles.to_index == corner))
        first, second = tubes(found, f"lashings {one}"), tubes(found, f"doubles {other}")[:, ::-1]
        exact = np.stack([ends_at(case, lashings, each)[one] for each in q])
        assert 0.5 * (first + second) == pytest.approx(exact, abs=2e-4)
        gap = first - second
        radius = found.track(0, found.node(f"lashings {one}"), "scale")[1][:, 0]
        assert gap[:, 0] == pytest.approx(gap[:, 1], abs=1e-5)
        apart = np.linalg.norm(gap[:, 0], axis=1)
        assert apart == pytest.approx(np.full(len(t), 2.5 * radius[0]), rel=1e-3)
        along = exact[:, 1] - exact[:, 0]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        assert np.abs((gap[:, 0] * along).sum(axis=1)).max() < 1e-3 * apart[0]
        # from one frame to the next they turn around each other no more than the member turns
        turned = np.linalg.norm(np.diff(along, axis=0), axis=1)
        assert (np.linalg.norm(np.diff(gap[:, 0], axis=0), axis=1) <= (turned + 2e-3) * apart[0]).all()


def test_exported_members_are_thin_and_grey_while_they_do_not_act(source):
    start, end = (getattr(source.case.load_cases[0], name) for name in ("start", "end"))
    until, again = start + 0.4 * (end - start), start + 0.7 * (end - start)
    law = "{type: spring, stiffness: 800, active_until: UNTIL}, {type: spring, stiffness: 800, active_from: AGAIN}"
    law = law.replace("UNTIL", f"{until}").replace("AGAIN", f"{again}")
    case = read_case(CASE.replace("objectives:", f"  timed: {{from: posts, to: corners, law: [{law}]}}\nobjectives:"))
    own = {"case": case, "alpha": np.ones(case.n_design), "design": np.ones(case.n_design)}
    own["windows"] = active_windows(case, own["design"])
    found = Gltf(motion_file(SimpleNamespace(**{**vars(source), **own}))[0])
    names = [node["name"] for node in found.json["nodes"]]
    assert sum(name.endswith(f", {NOT_ACTING}") for name in names) == len(case.members[-1])  # of no others
    t, size = found.track(0, found.node("timed 2"), "scale")
    _, idle_size = found.track(0, found.node(f"timed 2, {NOT_ACTING}"), "scale")
    acts = (t + start < until) | (t + start >= again)
    assert 20 < acts.sum() < len(t) - 20
    assert (size > 0.0).all(axis=1).tolist() == acts.tolist()
    assert (idle_size > 0.0).all(axis=1).tolist() == (~acts).tolist()
    assert not size[~acts].any()
    assert not idle_size[acts].any()
    assert idle_size[~acts][:, 0].max() < 0.2 * size[acts][:, 0].min()
    q = states(case, t.astype(np.float64))[0]
    exact = np.stack([ends_at(case, case.members[-1], each)[2] for each in q])
    lengths = np.linalg.norm(exact[:, 1] - exact[:, 0], axis=1)
    assert (size + idle_size)[:, 1] == pytest.approx(lengths, abs=2e-4)
    for path in ("translation", "rotation"):  # the one in the place of the other
        first, second = (found.track(0, found.node(f"timed 2{more}"), path)[1] for more in ("", f", {NOT_ACTING}"))
        assert np.array_equal(first, second)
    before = found.json["nodes"][found.node(f"timed 2, {NOT_ACTING}")]
    assert not any(before["scale"])  # before any motion every member is drawn as one that acts
    meshes = [found.json["nodes"][found.node(name)]["mesh"] for name in ("timed 2", f"timed 2, {NOT_ACTING}")]
    colours = [
        found.json["materials"][found.json["meshes"][mesh]["primitives"][0]["material"]]["pbrMetallicRoughness"]
        for mesh in meshes
    ]
    red, green, blue, _ = colours[1]["baseColorFactor"]
    assert red == green == blue
    assert colours[0] != colours[1]


def test_exported_members_without_a_length_lie_beside_each_other_once_they_have_one():
    ends = np.zeros((3, 1, 2, 3))
    ends[1:, 0, 1] = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
    assert _sideways(ends, np.array([0.0, 0.0, 1.0]))[:, 0].tolist() == [[0, 0, 0], [0, 1, 0], [-1, 0, 0]]


IN_BROWSER = Path(__file__).with_name("page_in_browser.js")


@pytest.mark.skipif(BROWSER is None, reason="no browser on this machine")
@pytest.mark.parametrize("size", [(1300, 1000), (500, 900)])
def test_a_browser_shows_the_page_and_turns_the_scene(written, tmp_path, size):
    found = look(written[0], IN_BROWSER.read_text(), tmp_path, size)
    assert found["errors"] == []
    assert found["overlaps"] == []
    assert found["back"] == found["pictures"][0]
    assert len(set(found["pictures"])) == len(found["pictures"]) == 10
    assert found["sharp"] >= 1
