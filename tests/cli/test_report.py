"""The page of a result, as data and in a real browser."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from mdstopo.cli.group import run_group
from mdstopo.plots.source import Source
from mdstopo.report import report_tables
from mdstopo.report.report_content import content
from mdstopo.report.report_tables import peak_of
from tests.browser import BROWSER, look
from tests.front.support import CASE

#: what is done to the page: slider, colour, a point of the front; what came of it is written down
PROBE = """
const pixels = () => { const c = document.getElementById("layout");
  const image = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  return image.reduce((a, x, i) => (a * 31 + x * (i % 97)) % 1000003, 7); };
seen.ready = document.body.dataset.ready;
seen.before = pixels();
const slider = document.getElementById("time");
slider.value = 40; slider.dispatchEvent(new Event("input"));
seen.clock = document.getElementById("clock").textContent;
seen.moved = pixels();
seen.cursor = document.querySelector(".cursor").getAttribute("x1");
const colour = document.getElementById("colour");
colour.value = "force"; colour.dispatchEvent(new Event("change"));
seen.coloured = pixels();
const point = document.querySelector('circle[data-point="0"]');
if (point) {
  point.dispatchEvent(new Event("click"));
  seen.design = document.body.dataset.design; seen.clicked = pixels(); }
seen.charts = document.querySelectorAll("svg").length;
seen.ticks = [...document.querySelectorAll("svg text")].map((t) => t.textContent);
seen.peaks = document.querySelectorAll("circle.peak").length;
seen.tables = [...document.querySelectorAll("#results table")].map((t) => t.rows.length);
seen.parts = document.querySelectorAll("#parts tr").length - 1;
seen.numbers = [...document.querySelectorAll("text.number")].map((t) => t.textContent);
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    (folder / "probe.yaml").write_text(CASE)
    made = {name: folder / f"{name}.h5" for name in ("run", "pareto")}
    assert run_group(["run", str(folder / "probe.yaml"), "--quiet", "--out", str(made["run"])]) == 0
    words = ["--points", "3", "--quiet", "--out", str(made["pareto"])]
    assert run_group(["pareto", str(folder / "probe.yaml"), *words]) == 0
    return made


def test_the_page_needs_nothing_else_and_holds_the_case(results, tmp_path):
    out = tmp_path / "page.html"
    assert run_group(["report", str(results["run"]), "--out", str(out), "--quiet"]) == 0
    text = out.read_text()
    assert not re.search(r"(src|href)\s*=", text)
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)[1])
    assert data["case"] == CASE
    assert data["warnings"] == list(Source(results["run"]).view.warnings)


def test_forces_and_responses_are_the_engines(results):
    """The forces do the work that the springs store, and most of the response, which is all springs' energy."""
    source = Source(results["run"])
    (design,) = content(source)["designs"]
    motion = design["motions"]["translation"]
    assert len(design["members"]["rows"]) == np.array(motion["force"]).shape[1]
    lengths = []
    for q in np.array(motion["q"]):
        ends = []
        for _, a, b, px, py, qx, qy, *_ in design["members"]["rows"]:
            p, r = (_place(q, body, x, y) for body, x, y in ((a, px, py), (b, qx, qy)))
            ends.append(np.hypot(*(r - p)))
        lengths.append(ends)
    lengths, force = np.array(lengths), np.array(motion["force"])
    work = np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(lengths, axis=0), axis=0).sum(axis=1)
    alpha = source.alpha[[row[8] for row in design["members"]["rows"]]]
    stretch = lengths[-1] - lengths[0]
    assert work[-1] == pytest.approx((0.5 * 3000.0 * alpha * stretch**2).sum(), rel=1e-4)
    # what is too thin to be drawn holds the rest
    whole = motion["responses"][0]["values"][-1]
    assert 0.8 * whole < work[-1] < whole


def _place(q, body, x, y):
    c, s = np.cos(q[3 * body + 2]), np.sin(q[3 * body + 2])
    return np.array([q[3 * body] + c * x - s * y, q[3 * body + 1] + s * x + c * y])


@pytest.mark.skipif(BROWSER is None, reason="no browser on this machine")
@pytest.mark.parametrize("kind", ["run", "pareto"])
def test_the_slider_moves_and_points_can_be_clicked(results, kind, tmp_path):
    out = tmp_path / "page.html"
    assert run_group(["report", str(results[kind]), "--out", str(out), "--quiet"]) == 0
    seen = look(out, PROBE, tmp_path)
    assert seen["errors"] == []
    assert seen["overlaps"] == []
    assert seen["peaks"] == 1
    assert 0 < seen["parts"] <= 300
    assert seen["ready"] == "yes"
    assert seen["clock"] == "t = 0.1 s"
    assert len({seen["before"], seen["moved"], seen["coloured"]}) == 3
    assert "NaN" not in seen["ticks"]
    if kind == "pareto":
        assert seen["design"] == "0"
        assert seen["clicked"] != seen["coloured"]
        assert seen["charts"] == 2
        assert len(seen["numbers"]) >= 3
    else:
        assert seen["charts"] == 3
        assert seen["tables"] == [3, 2]  # heads, two objectives, one constraint


def test_tables_are_those_of_the_file(results):
    """The best iterate, its constraints, and forces of members against their law at the ends of the motion."""
    source = Source(results["run"])
    page = content(source)
    values = source.view.arrays["iterations/objectives"]
    assert [row["start"] for row in page["summary"]] == pytest.approx(values[0])
    assert [row["best"] for row in page["summary"]] == pytest.approx(values[page["iterations"]["best"]])
    (volume,) = page["limits"]
    assert volume["best"] == pytest.approx(source.alpha.sum())
    assert volume["margin"] == pytest.approx(-abs(volume["best"] - volume["bound"]), abs=1e-12)
    (design,) = page["designs"]
    peak = design["motions"]["translation"]["responses"][0]["peak"]
    assert peak[1] == pytest.approx(values[page["iterations"]["best"]][1], rel=1e-5)
    forces = {(part["group"], part["member"]): part["force"] for part in design["parts"]}
    seen = [np.array(each["force"]) for each in design["motions"].values()]
    for k, row in enumerate(design["members"]["rows"]):
        largest = max(np.abs(force[:, k]).max() for force in seen)
        assert abs(forces["belts", row[8]]) >= (1.0 - 1e-3) * largest


def test_the_largest_force_of_a_member_may_push_and_is_that_of_all_load_cases(monkeypatch):
    forces = {"a": [[3.0, 1.0], [-5.0, 2.0]], "b": [[4.0, -2.5], [1.0, 0.0]]}
    monkeypatch.setattr(report_tables, "forces_of", lambda _case, _design, _kept, q, _v: np.array(forces[q]))
    motions = {name: (np.array([0.0, 0.1]), SimpleNamespace(q=name, v=None)) for name in forces}
    found = report_tables.member_peaks(SimpleNamespace(case=None), np.ones(2), [(None, np.arange(2))], motions)
    assert found == [
        {"force": -5.0, "time": 0.1, "load_case": "a"},
        {"force": -2.5, "time": 0.0, "load_case": "b"},
    ]


def test_a_peak_between_samples_is_found():
    times = np.linspace(0.0, 1.0, 11)
    wave = lambda t: np.sin(9.0 * t)  # noqa: E731
    assert peak_of("max", times, wave(times), wave) == pytest.approx((np.pi / 18, 1.0), abs=2e-3)
    assert peak_of("min", times, wave(times), wave)[1] == pytest.approx(-1.0, abs=1e-4)
    assert peak_of("final", times, wave(times), wave) == (1.0, np.sin(9.0))
    assert peak_of("mean", times, wave(times), wave) is None
