"""How to cite the project is said in the form that tools read, and agrees with the project."""

from __future__ import annotations

import tomllib

import yaml

import mdstopo

from .pages import DOCS, ROOT

CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
#: what version 1.2.0 of the format asks of a work, and of each reference
NEEDED = ({"cff-version", "message", "title", "authors"}, {"type", "title", "authors"})


def test_the_citation_has_what_the_format_needs() -> None:
    assert CITATION["cff-version"] == "1.2.0"
    assert NEEDED[0] <= set(CITATION)
    for reference in CITATION["references"]:
        assert NEEDED[1] <= set(reference)
    assert all(work["authors"] for work in [CITATION, *CITATION["references"]])


def test_the_citation_is_of_this_version_and_licence() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert (CITATION["title"], CITATION["license"]) == (project["name"], project["license"])
    assert CITATION["version"] == mdstopo.__version__


def test_the_paper_is_the_one_that_the_documentation_names() -> None:
    home = " ".join((DOCS / "index.md").read_text(encoding="utf-8").split())
    assert CITATION["references"][0]["title"] in home
