"""Cases, evaluations, motions and results say what they are, and show themselves in notebooks."""

import re
import subprocess
import sys

import pytest

from mdstopo import evaluate, load_case, optimize, simulate
from mdstopo.shown import counted, html_of
from tests.engine.scenes import CASES

SMALL = {"points.torso_edge.grid.rectangle.count": 4, "optimizer.max_iterations": 2}


@pytest.fixture(scope="module")
def case():
    return load_case(CASES / "fig6.yaml", overrides=SMALL)


def test_each_says_in_a_line_what_it_is(case):
    assert repr(case) == (
        "<Case 'Figure 6 (Section IV.A): two rigid bodies, 1020 members': "
        "2 bodies; 204 members, 204 designed; objectives G; 1 constraint>"
    )
    assert re.fullmatch(r"<Trajectory of load case 'default': done; 1 step from 0 to 0.2 s>", repr(simulate(case)))
    told = repr(evaluate(case))
    assert re.match(r"<Evaluation: done; G = [\d.]+; gradients by 204 members; largest excess of a constraint ", told)
    told = repr(optimize(case))
    assert re.match(r"<Result of 'Figure 6 .*': max_iterations: .*; G [\d.]+ -> [\d.]+; 2 iterations, ", told)


def test_each_shows_itself_with_a_picture(case):
    pytest.importorskip("matplotlib")
    for value in (case, simulate(case), evaluate(case), optimize(case)):
        text = value._repr_html_()
        assert text.startswith("<div><table>")
        assert text.count("<svg") == text.count("</svg>") == 1
        assert "<script" not in text
    assert "204" in case._repr_html_()
    with pytest.raises(ValueError, match="int has no form"):
        html_of(3)


def test_titles_cannot_bring_markup(case):
    sly = load_case(CASES / "fig6.yaml", overrides={**SMALL, "title": "'<script>alert(1)</script>'"})
    assert "<script" not in sly._repr_html_()
    assert "&lt;script" in sly._repr_html_()


def test_counts_are_words():
    assert [counted(1, "body"), counted(2, "body"), counted(1200, "member")] == ["1 body", "2 bodies", "1,200 members"]


def test_a_name_that_is_not_there_is_a_mistake_for_type_checkers(tmp_path):
    pytest.importorskip("mypy")
    file = tmp_path / "mine.py"
    file.write_text("import mdstopo\nreveal_type(mdstopo.evaluate)\nmdstopo.optimise\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--no-incremental", "--cache-dir", str(tmp_path), str(file)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert 'Module has no attribute "optimise"' in done.stdout
    assert "mdstopo.evaluation.Evaluation" in done.stdout
