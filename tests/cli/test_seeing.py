"""Moving pictures, overlays, designs beside each other, what differs between results, the page that follows one."""

import json
import re
import shutil
import signal
import subprocess
import sys
import threading
import urllib.request
from urllib.error import HTTPError

import numpy as np
import pytest

from mdstopo.cli.group import run_group
from mdstopo.plots.animation import still
from mdstopo.plots.source import Source
from mdstopo.report.watching import server
from mdstopo.store.store_errors import StoreError
from tests.front.support import CASE


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A run, the same with a softer law, and a short front."""
    folder = tmp_path_factory.mktemp("seeing")
    (folder / "case.yaml").write_text(CASE)
    made = {name: folder / f"{name}.h5" for name in ("run", "other", "front")}
    case = str(folder / "case.yaml")
    assert run_group(["run", case, "--quiet", "--out", str(made["run"])]) == 0
    words = ["--set", "members.belts.law.stiffness=2000", "--set", "optimizer.max_iterations=2"]
    assert run_group(["run", case, "--quiet", "--out", str(made["other"]), *words]) == 0
    assert run_group(["pareto", case, "--points", "2", "--quiet", "--out", str(made["front"])]) == 0
    return made


def test_a_written_film_is_named_by_the_path_that_was_given(results, monkeypatch, capsys):
    monkeypatch.chdir(results["run"].parent)
    assert run_group(["animate", results["run"].name, "--out", "short.svg", "--frames", "2"]) == 0
    assert capsys.readouterr().out == "short.svg\n"


def test_an_svg_moves_its_lines_from_the_first_state_to_the_last(results, tmp_path):
    out = tmp_path / "motion.svg"
    assert run_group(["animate", str(results["run"]), "--out", str(out), "--frames", "5", "--quiet"]) == 0
    text = out.read_text()
    assert "<script" not in text
    moves = re.findall(r'attributeName="points"[^>]* values="([^"]*)"', text.split("<g ")[0])
    assert moves
    assert {len(each.split(";")) for each in moves} == {5}
    first = [each.split(";")[0] for each in moves]
    assert all(f'points="{places}"' in text for places in first)
    numbers = np.array([float(each) for each in re.findall(r"-?[0-9.]+", " ".join(moves).replace(";", " "))])
    assert numbers.min() >= 0.0
    assert still(Source(results["run"])).count("<polyline") == text.count("<polyline")


@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_films_have_a_picture_for_each_frame(results, tmp_path, ending):
    if ending == "mp4" and shutil.which("ffmpeg") is None:
        pytest.skip("no ffmpeg on this machine")
    from PIL import Image

    out = tmp_path / f"motion.{ending}"
    words = ["--frames", "3", "--dark", "--quiet", "--load-case", "translation"]
    assert run_group(["animate", str(results["run"]), "--out", str(out), *words]) == 0
    if ending == "mp4":
        assert out.read_bytes()[4:8] == b"ftyp"
        return
    with Image.open(out) as film:
        assert film.n_frames == 3
        assert sum(film.convert("RGB").getpixel((2, 2))) < 120  # a dark ground


def test_what_cannot_be_animated_is_refused(results, tmp_path, capsys, monkeypatch):
    assert run_group(["animate", str(results["run"]), "--out", str(tmp_path / "a.avi")]) == 2
    assert "a moving picture ends in .gif, .mp4, .svg" in capsys.readouterr().err
    assert run_group(["animate", str(results["run"]), "--load-case", "no"]) == 2
    assert "there are rotation, translation" in capsys.readouterr().err
    monkeypatch.setenv("PATH", str(tmp_path))
    assert run_group(["animate", str(results["run"]), "--out", str(tmp_path / "a.mp4")]) == 2
    assert "needs the program ffmpeg" in capsys.readouterr().err


def test_overlays_and_both_designs_are_drawn(results, tmp_path, capsys):
    out = tmp_path / "picture.svg"
    words = ["plot", str(results["run"]), "layout", "--overlay", "--out", str(out)]
    assert run_group([*words, "--time", "0.1"]) == 2
    assert "two times or more" in capsys.readouterr().err
    assert run_group([*words, "--time", "0", "--time", "0.1", "--time", "0.2", "--dark", "--quiet"]) == 0
    assert "t = 0, 0.1, 0.2 s" in out.read_text()
    assert "#16181d" in out.read_text()
    assert run_group(["plot", str(results["run"]), "designs", "--out", str(out), "--quiet"]) == 0
    assert "design; width: alpha" in out.read_text()


def test_what_differs_is_told_and_drawn(results, tmp_path, capsys):
    picture = tmp_path / "both.png"
    words = ["diff", str(results["run"]), str(results["other"])]
    assert run_group([*words, "--picture", str(picture)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"members\.belts\.law\.stiffness +3000 +-> +2000", said)
    assert re.search(r"status +converged +-> +max_iterations", said)
    assert picture.stat().st_size > 10_000
    assert run_group([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    alphas = [Source(results[name]).alpha for name in ("run", "other")]
    changes = alphas[1] - alphas[0]
    assert not found["same"]
    assert found["designs"]["common"] == len(changes)
    assert found["designs"]["changed"] == int((np.abs(changes) > 1e-6).sum())
    assert found["designs"]["largest"][0] == pytest.approx(changes[np.abs(changes).argmax()])
    named = {pair["name"]: pair for pair in found["objectives"]}
    for name, key in (("run", "first"), ("other", "second")):
        values = Source(results[name]).view.array("iterations/objectives")
        assert any(named["G1, J"][key] == row[0] and named["G2, J"][key] == row[1] for row in values)


def test_a_result_differs_in_nothing_from_itself(results, capsys):
    assert run_group(["diff", str(results["run"]), str(results["run"])]) == 0
    assert "the two results are the same" in capsys.readouterr().out


@pytest.fixture
def followed(results, tmp_path):
    """A server that follows a file, and what asks it."""
    path = tmp_path / "followed.h5"
    serving = server(path, 0)
    thread = threading.Thread(target=serving.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()

    def ask(place, **headers):
        request = urllib.request.Request(f"http://127.0.0.1:{serving.server_port}{place}", headers=headers)
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=30) as answer:
            return answer.read().decode()

    yield path, ask
    serving.shutdown()
    serving.server_close()
    thread.join()


def test_the_page_follows_a_file_that_comes_and_changes(results, followed):
    path, ask = followed
    assert "fetch" in ask("/")
    assert json.loads(ask("/state")) == {"waiting": "there is no file followed.h5 yet"}
    shutil.copy(results["run"], path)
    state = json.loads(ask("/state"))
    view = Source(results["run"]).view
    assert (state["kind"], state["finished"]) == ("run", True)
    assert pytest.approx(view.array("iterations/objectives")) == np.array(state["iterations"]["objectives"]).T
    assert ask("/picture").startswith("<svg")
    shutil.copy(results["front"], path)
    state = json.loads(ask("/state"))
    assert state["kind"] == "pareto"
    assert state["front"]["done"] == 2
    path.write_bytes(b"something else")
    assert "waiting" in json.loads(ask("/state"))
    assert ask("/picture") == ""


def test_only_this_computer_is_answered(results, followed):
    _, ask = followed
    with pytest.raises(HTTPError) as refused:
        ask("/state", Host="somewhere.example")
    refused.value.close()
    assert refused.value.code == 403
    with pytest.raises(HTTPError) as unknown:
        ask("/../etc/passwd")
    unknown.value.close()
    assert unknown.value.code == 404


def test_ctrl_c_ends_it_with_zero(results):
    command = [sys.executable, "-m", "mdstopo", "watch", str(results["run"])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout.readline().startswith("http://127.0.0.1:")
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0


def test_a_port_that_is_taken_is_told(tmp_path):
    with server(tmp_path / "a.h5", 0) as first, pytest.raises(StoreError, match="--port chooses another one"):
        server(tmp_path / "a.h5", first.server_port)
