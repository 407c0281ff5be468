"""A case that takes another and changes it."""

from __future__ import annotations

from pathlib import Path

import pytest

from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.store.same_case import describe

from .scenes import EVERYTHING, EVERYTHING_IN_SPACE, SMALL


def files(folder: Path, **texts: str) -> Path:
    """Files name.yaml; the last one's path."""
    path = folder
    for name, text in texts.items():
        path = folder / f"{name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return path


def test_a_case_changes_another_key_by_key(tmp_path: Path) -> None:
    own = """\
extends: base.yaml
title: softer
bodies:
  a: {mass: 3}
  c: {mass: 1, inertia: 1, position: [9, 9]}
members:
  belts: {law: {stiffness: 100}}
loads: []
constraints: null
"""
    path = files(tmp_path, base=SMALL, own=own)
    case = load_case(path)
    third = "  c: {mass: 1, inertia: 1, position: [9, 9]}\n"
    merged = SMALL.replace("mass: 2", "mass: 3").replace("225", "100").replace("points:", third + "points:")
    merged = merged.replace("  - {body: b, force: [1, 0]}\n", "  []\n")
    merged = merged[: merged.index("constraints:")]
    assert describe(case) == describe(read_case("title: softer\n" + merged))
    assert case.name == "own"


@pytest.mark.parametrize("base", [SMALL, EVERYTHING, EVERYTHING_IN_SPACE], ids=["small", "plane", "space"])
def test_the_text_kept_is_the_whole_case(tmp_path: Path, base: str) -> None:
    path = files(tmp_path, base=base, own="extends: base.yaml\ntitle: 'yes'\ndefine: {k: 3, j: k * 2}\n")
    case = load_case(path)
    assert "extends" not in case.text
    assert "k * 2" in case.text
    (tmp_path / "base.yaml").unlink()
    assert describe(read_case(case.text, path=path)) == describe(case)
    own = load_case(files(tmp_path, alone=base), {"title": "'yes'", "define": "{k: 3, j: k * 2}"})
    assert describe(own) == describe(case)


def test_expressions_use_names_of_both(tmp_path: Path) -> None:
    base = SMALL.replace("format: 1\n", "format: 1\ndefine: {k: 3, n: k + 1}\n").replace("225", '"=n * 2"')
    path = files(tmp_path, base=base, own="extends: base.yaml\ndefine: {k: 7}\n")
    assert load_case(path).members[0].laws[0].stiffness == 16.0  # type: ignore[attr-defined]
    changed = load_case(path, {"define.k": "9"})
    assert changed.members[0].laws[0].stiffness == 20.0  # type: ignore[attr-defined]


def test_cases_extend_each_other_in_a_chain_with_paths_relative_to_each(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "pulse.csv").write_text("t,x,y\n0,1,0\n0.2,3,0\n")
    base = SMALL.replace("force: [1, 0]", "force: {file: pulse.csv}")
    files(tmp_path / "shared", base=base)
    files(tmp_path, middle="extends: shared/base.yaml\ntime: {end: 0.1}\n")
    path = files(tmp_path / "runs", own="extends: ../middle.yaml\nbodies: {a: {mass: 8}}\n")
    case = load_case(path)
    assert case.load_cases[0].loads[0].force[0].values[1, 0] == 3.0  # type: ignore[attr-defined, union-attr]
    assert (case.load_cases[0].end, case.bodies[0].mass) == (0.1, 8.0)
    assert list(case.files) == ["../shared/pulse.csv"]
    assert describe(read_case(case.text, path=path)) == describe(case)


@pytest.mark.parametrize(
    ("own", "place", "words"),
    [
        ("extends: none.yaml", "own.yaml:1:10", "there is no such file"),
        ("extends: .", "own.yaml:1:10", "this is not a file"),
        ("extends: [1]", "own.yaml:1:10", "found a list of 1, allowed is the path of a case file"),
        ("extends: own.yaml", "own.yaml:1:10", "is extended by itself: own.yaml -> own.yaml"),
        ("extends: other.yaml", "other.yaml:2:10", "is extended by itself: own.yaml -> other.yaml -> own.yaml"),
        ("extends: list.yaml", "list.yaml:1:1", "found a list of 1, allowed is a mapping"),
        ("extends: broken.yaml", "broken.yaml:2:1", "not valid YAML"),
        ("extends: base.yaml\nbodies: {a: {mas: 3}}", "own.yaml:2:14", "unknown key 'mas'"),
        ("extends: base.yaml\nbodies: {a: {mass: null}}", "own.yaml:2:13", "the key 'mass' is missing"),
        ("extends: wrong.yaml", "wrong.yaml:10:58", "found the text 'abc'"),
    ],
)
def test_mistakes_are_told_in_the_file_in_which_they_are(tmp_path: Path, own: str, place: str, words: str) -> None:
    path = files(
        tmp_path,
        base=SMALL,
        wrong=SMALL.replace("225", "abc"),
        other="format: 1\nextends: own.yaml\n",
        list="[1]\n",
        broken="format: 1\n}\n",
        own=own + "\n",
    )
    with pytest.raises(CaseError) as caught:
        load_case(path)
    told = str(caught.value).splitlines()
    assert any(str(tmp_path / place) in line and words in line for line in told), told


def test_long_chains_are_refused(tmp_path: Path) -> None:
    path = files(tmp_path, **{f"c{i}": f"extends: c{i + 1}.yaml\n" for i in range(30)}, own="extends: c0.yaml\n")
    with pytest.raises(CaseError, match="more than 10 cases extend each other"):
        load_case(path)


def test_what_is_extended_is_not_set_from_outside() -> None:
    with pytest.raises(CaseError, match="can only be stated in the file"):
        read_case(SMALL, overrides={"extends": "base.yaml"})
