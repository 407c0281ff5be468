"""Pictures, exports and starter cases: what they hold, and what they refuse."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.integrate import trapezoid

from mdstopo.case.reader import load_case as read
from mdstopo.case.reader import read_case
from mdstopo.cli.check_scene import odd_scales
from mdstopo.cli.group import run_group
from mdstopo.cli.new import templates
from mdstopo.plots.body_shapes import planar_shapes
from mdstopo.plots.objectives_over_time import response_history
from mdstopo.plots.plot_table import PLOTS, fitting
from mdstopo.plots.scenery import edge_at, hull, sizes, start_state
from mdstopo.plots.source import Source
from mdstopo.plots.style import styled
from mdstopo.plots.thickness import FAINT, stored_peaks
from mdstopo.report.gltf_motion import _cubics_suffice
from mdstopo.report.report_content import content
from mdstopo.scene.refusals import refusals
from tests.front.support import CASE
from tests.space.gltf_reader import Gltf

matplotlib = pytest.importorskip("matplotlib")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A run, a front and a comparison of methods of one small case."""
    folder = tmp_path_factory.mktemp("plots")
    case = folder / "probe.yaml"
    case.write_text(CASE)
    made = {name: folder / f"{name}.h5" for name in ("run", "pareto", "gradient")}
    assert run_group(["run", str(case), "--quiet", "--out", str(made["run"])]) == 0
    assert run_group(["pareto", str(case), "--points", "3", "--quiet", "--out", str(made["pareto"])]) == 0
    words = ["--method", "adjoint", "--method", "direct", "--history"]
    assert run_group(["gradient", str(case), *words, "--quiet", "--out", str(made["gradient"])]) == 0
    return made


@pytest.mark.parametrize("kind", ["run", "pareto", "gradient"])
def test_everything_a_result_has_is_drawn(results, kind, tmp_path, monkeypatch):
    copy = tmp_path / "result.h5"
    copy.write_bytes(results[kind].read_bytes())
    assert run_group(["plot", str(copy), "--quiet"]) == 0
    drawn = {path.stem.removeprefix("result-") for path in tmp_path.glob("*.png")}
    assert drawn == set(fitting(Source(copy).view))
    expected = {"run": "convergence", "pareto": "front", "gradient": "sensitivity-histories"}
    assert expected[kind] in drawn
    assert all(path.stat().st_size > 5000 for path in tmp_path.glob("*.png"))


def test_every_picture_but_those_of_fits_is_made_by_one_of_these_results(results):
    of_fits = {"fit", "correlation", "profiles"}  # in `tests/fit/test_seen.py`
    assert set(PLOTS) - of_fits == {name for path in results.values() for name in fitting(Source(path).view)}


@pytest.mark.parametrize("ending", ["svg", "pdf"])
def test_pictures_repeat_to_the_byte(results, ending, tmp_path):
    for name in ("a", "b"):
        words = ["plot", str(results["run"]), "convergence", "--out", str(tmp_path / f"{name}.{ending}"), "--quiet"]
        assert run_group(words) == 0
    assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_axes_have_units_and_the_curves_their_data(results):
    with styled() as module:
        source = Source(results["run"])
        figure = PLOTS["convergence"].draw(module, source)
        axis = figure.axes[0]
        assert axis.get_ylabel() == "G1, J"
        assert np.array_equal(axis.lines[0].get_ydata(), source.view.array("iterations/objectives")[:, 0], True)
        figure = PLOTS["histories"].draw(module, source)
        assert [each.get_ylabel() for each in figure.axes] == ["G1, J", "G2, J"]
        figure = PLOTS["layout"].draw(module, source, times=(0.0, 0.1))
        assert [each.get_title("left") for each in figure.axes] == ["t = 0 s", "t = 0.1 s"]


def test_a_history_has_its_objective_as_its_maximum(results):
    source = Source(results["run"])
    times = np.linspace(0.0, 0.2, 4001)
    evaluation = source.engine.evaluate(source.alpha, gradient=False)
    for load_case, name in (("rotation", "G1"), ("translation", "G2")):
        history = response_history(source.engine, source.alpha, load_case, times)[name]
        assert history.max() == pytest.approx(evaluation.objectives[name], rel=1e-6)


def test_a_history_of_a_general_scene_is_what_the_engine_reduces(tmp_path):
    text = CASE.replace("G2: {response: energy,", "G2: {response: {angle: {body: torso}}, over_time: mean,")
    from mdstopo.case.reader import read_case
    from mdstopo.engine import Evaluator

    engine = Evaluator(read_case(text))
    alpha = engine.case.initial
    times = np.linspace(0.0, 0.2, 2001)
    history = response_history(engine, alpha, "translation", times)["G2"]
    mean = trapezoid(history, times) / 0.2
    assert mean == pytest.approx(engine.evaluate(alpha, gradient=False).objectives["G2"], rel=1e-6)


def test_edges_of_contacts_ride_on_their_body_and_points_on_theirs():
    from mdstopo.case.reader import load_case

    case = load_case(ROOT / "tests/general/cases/crate.yaml")
    q = start_state(case)
    q[:3] += 1.0, 2.0, np.pi / 2.0  # the deck
    assert edge_at(case, case.contacts[1], q) == pytest.approx(np.array([[0.9, 2.13], [-0.2, 2.13]]))
    ((corners,),) = (shape.areas for shape in planar_shapes(case, "crate"))
    assert all((corners == point).all(axis=1).any() for point in case.contacts[1].points[1:])


def test_outlines_are_convex_hulls():
    points = np.random.default_rng(3).normal(size=(200, 2))
    corners = hull(points)
    edges = np.roll(corners, -1, axis=0) - corners
    for corner, edge in zip(corners, edges, strict=True):
        side = edge[0] * (points - corner)[:, 1] - edge[1] * (points - corner)[:, 0]
        assert side.min() > -1e-12
    assert len(hull(np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]))) == 2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["landscape"], "no picture 'landscape'"),
        (["front"], "has no front"),
        (["convergence", "--out", "x.bmp"], "a picture ends in .png, .svg, .pdf"),
        (["layout", "--time", "7"], "runs from 0 to 0.2 s"),
        (["layout", "--load-case", "fall"], "no load case 'fall'"),
        (["--point", "1"], "--point is for fronts"),
        (["--out", "x.png"], "say which"),
    ],
)
def test_what_cannot_be_drawn_is_refused(results, words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_group(["plot", str(results["run"]), *words]) == 2
    assert said in capsys.readouterr().err


def test_tables_hold_what_the_file_holds(results, tmp_path):
    out = tmp_path / "tables"
    assert run_group(["export", str(results["run"]), "--csv", "--out", str(out), "--quiet"]) == 0
    names = {path.stem for path in out.glob("*.csv")}
    assert names == {"members", "iterations", "trajectory-rotation", "trajectory-translation"}
    with h5py.File(results["run"]) as file:
        with (out / "iterations.csv").open() as stream:
            rows = list(csv.DictReader(stream))
        stored = file["iterations/objectives"][:, 1].tolist()
        assert [float(row["objectives G2"]) if row["objectives G2"] else None for row in rows][-1] == stored[-1]
        with (out / "members.csv").open() as stream:
            members = list(csv.DictReader(stream))
        assert [float(row["alpha"]) for row in members] == file["design/alpha"][()].tolist()


@pytest.fixture(scope="module")
def final(results):
    """The motion of a finalised design: every member is a group whose bounds are equal."""
    case, motion = (results["run"].with_name(name) for name in ("run.final.yaml", "final.h5"))
    assert run_group(["finalize", str(results["run"]), "--keep", "14", "--out", str(case), "--quiet"]) == 0
    assert run_group(["simulate", str(case), "--out", str(motion), "--quiet"]) == 0
    return motion


def test_members_without_a_range_are_drawn(final):
    source = Source(final)
    assert all(group.lower == group.upper == 1.0 for group in source.case.members)
    with styled() as module:
        (axis,) = PLOTS["layout"].draw(module, source).axes
        assert [len(each.get_segments()) for each in axis.collections] == [1] * 14
        widths = [float(width) for each in axis.collections for width in each.get_linewidths()]
        assert len({each.get_color()[0].tobytes() for each in axis.collections}) == 1  # one family
    page = content(source)
    rows = page["designs"][0]["members"]["rows"]
    assert len(rows) == 14
    shares = np.array([row[7] for row in rows])
    assert shares.max() == 1.0
    assert np.array_equal(np.argsort(shares), np.argsort(widths))
    peaks = np.concatenate(stored_peaks(source, source.alpha))
    assert shares == pytest.approx(np.maximum(peaks / peaks.max(), 2.0 * FAINT), abs=6e-4)
    assert peaks.min() < 0.9 * peaks.max()


def test_a_size_is_a_share_of_the_range_or_alpha_itself_where_there_is_none(results):
    group = Source(results["run"]).case.members[0]
    alpha = np.linspace(0.0, 1.0, len(group))
    assert sizes(replace(group, lower=0.2, upper=0.6), alpha) == pytest.approx(np.clip((alpha - 0.2) / 0.4, 0.0, 1.0))
    assert np.array_equal(
        sizes(replace(group, lower=0.3, upper=0.3), np.full(len(group), 0.3)), np.full(len(group), 0.3)
    )
    assert sizes(replace(group, lower=3.0, upper=3.0), np.full(len(group), 3.0)).max() == 1.0


def test_a_legend_names_groups_only_while_it_leaves_room_for_the_picture(results, final):
    with styled() as module:
        few, many = (PLOTS["layout"].draw(module, Source(path)) for path in (results["run"], final))
    for picture in (few, many):  # of a final design, whose members are groups, the families
        words = [text.get_text() for text in picture.legends[0].get_texts()]
        assert words == ["torso", "vehicle", "belts", "moment"]


@pytest.mark.parametrize("kind", ["run", "pareto", "gradient"])
def test_json_has_every_dataset_of_the_file_by_its_path(results, kind, tmp_path):
    out = tmp_path / "all.json"
    assert run_group(["export", str(results[kind]), "--json", "--out", str(out), "--quiet"]) == 0
    found = json.loads(out.read_text())["datasets"]
    paths: list[str] = []
    with h5py.File(results[kind]) as file:
        file.visititems(lambda path, node: paths.append(path) if isinstance(node, h5py.Dataset) else None)
    assert sorted(found) == sorted(paths)
    assert any(path.startswith("optimizer/") for path in paths) == (kind == "run")


def test_json_holds_every_dataset_and_null_for_what_is_not_known(results, tmp_path):
    out = tmp_path / "front.json"
    assert run_group(["export", str(results["pareto"]), "--json", "--out", str(out), "--quiet"]) == 0
    found = json.loads(out.read_text())["datasets"]
    with h5py.File(results["pareto"]) as file:
        assert found["pareto/alpha"] == file["pareto/alpha"][()].tolist()
    assert None in [value for row in found["pareto/visited/0"] for value in row]
    assert run_group(["export", str(results["pareto"])]) == 2


@pytest.mark.parametrize(("kind", "words"), [("run", []), ("pareto", ["--point", "0", "--slower", "5"])])
def test_the_motion_of_a_plane_is_exported_as_gltf(results, kind, words, tmp_path):
    out = tmp_path / "motion.glb"
    assert run_group(["export", str(results[kind]), "--gltf", *words, "--out", str(out), "--quiet"]) == 0
    found = Gltf(out.read_bytes())
    assert [each["name"] for each in found.json["animations"]] == ["rotation", "translation"]
    times, places = found.track(1, found.node("vehicle"), "translation")
    assert times[-1] == pytest.approx(1.0 if words else 0.2)
    assert not places[:, 2].any()
    assert places[-1, 0] > 0.1
    assert run_group(["export", str(results[kind]), "--csv", "--point", "0"]) == 2


#: a weight that swings on a spring by x = 1 + 0.2 cos 20 t
SWING = """
format: 1
time: {end: 2}
bodies: {a: {mass: 2, inertia: 1, position: [1.2, 0]}}
members: {s: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [1.2, 0]}, law: LAW}}
"""


def test_exported_places_are_those_of_the_motion_however_long_its_steps_are(tmp_path):
    case, result, out = tmp_path / "swing.yaml", tmp_path / "swing.h5", tmp_path / "swing.glb"
    case.write_text(SWING.replace("LAW", "{type: spring, stiffness: 800, free_length: 1}"))
    assert run_group(["simulate", str(case), "--out", str(result), "--quiet"]) == 0
    with h5py.File(result) as file:
        assert np.diff(file["trajectories/default/t"][()]).max() > 0.05
    assert run_group(["export", str(result), "--gltf", "--out", str(out), "--quiet"]) == 0
    found = Gltf(out.read_bytes())
    t, places = found.track(0, found.node("a"), "translation")
    assert places[:, 0] == pytest.approx(1.0 + 0.2 * np.cos(20.0 * t.astype(float)), abs=2e-4)


def test_cubics_through_turns_in_space_are_taken_only_where_they_are_near():
    """A body that swings about z by 0.2 cos 20 t."""
    case = read_case(
        "format: 1\ndimension: 3\ntime: {end: 1}\nbodies: {a: {mass: 1, inertia: [1, 1, 1], position: [0, 0, 0]}}"
    )
    for step, near in ((0.1, False), (0.02, True)):
        t = np.arange(0.0, 1.0, step)
        angle, rate, gain = 0.2 * np.cos(20 * t), -4.0 * np.sin(20 * t), -80.0 * np.cos(20 * t)
        q, v, a = np.zeros((len(t), 7)), np.zeros((len(t), 6)), np.zeros((len(t), 6))
        q[:, 3], q[:, 6], v[:, 5], a[:, 5] = np.cos(angle / 2), np.sin(angle / 2), rate, gain
        assert _cubics_suffice(case, (t, q, v, a), 1e-3) is near


def test_finished_files_name_their_axes_and_units(results):
    with h5py.File(results["run"]) as file:
        q = file["trajectories/rotation/q"]
        assert q.attrs["units"] == "m, rad"
        assert q.dims[0][0][()].tolist() == file["trajectories/rotation/t"][()].tolist()
        assert q.dims[1][0].asstr()[2] == "torso.psi"
        objectives = file["iterations/objectives"]
        assert objectives.dims[1][0].asstr()[()].tolist() == ["G1", "G2"]
        assert objectives.attrs["units"] == "J"


def test_every_template_is_a_case_without_a_doubt(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run_group(["new", "--list"]) == 0
    said = capsys.readouterr().out.splitlines()
    known = templates()
    assert [line.split()[0] for line in said] == list(known)
    assert next(iter(known)) == "crate"
    assert {"seat", "mooring", "mechanism", "space"} < set(known)
    for name in known:
        assert run_group(["new", f"my-{name}", "--template", name, "--quiet"]) == 0
        case = read(f"my-{name}")
        assert case.title == f"my {name}"
        assert case.is_optimizable
        assert case.warnings == ()
        assert refusals(case) == []
        assert odd_scales(case) == []
    assert read("my-mooring").body("vessel").mass == 9.0e6
    assert read("my-space").dimension == 3
    assert run_group(["new", "x", "--template", "sofa"]) == 2
    assert "there are crate" in capsys.readouterr().err
    assert run_group(["new"]) == 2


def test_who_names_a_template_without_the_option_is_told_which_one_it_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run_group(["new", "space"]) == 0
    assert "template crate; the one called space is written by --template space" in capsys.readouterr().err
    assert run_group(["new", "crate"]) == 0
    assert run_group(["new", "seat", "--template", "seat"]) == 0
    assert capsys.readouterr().err == ""


def test_the_starter_case_is_right_and_is_never_written_over_another(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run_group(["new", "my-deck"]) == 0
    assert run_group(["check", "my-deck.yaml", "--quiet"]) == 0
    text = Path("my-deck.yaml").read_text()
    assert 'title: "my deck"' in text
    assert run_group(["new", "my-deck"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run_group(["run", "my-deck.yaml", "--set", "optimizer.max_iterations=2", "--quiet"]) == 0
