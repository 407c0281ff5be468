"""Cases that come with the package are found by name; a file of that name in the current folder wins."""

from pathlib import Path

import pytest

from mdstopo.case.reader import load_case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.shipped import folder, names


@pytest.mark.parametrize("name", ["fig6", "fig6.yaml"])
def test_a_name_is_enough(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = load_case(name)
    assert case.path == folder() / "fig6.yaml"
    assert case.n_members == 1020
    assert case.name == "fig6"
    own = (folder() / "fig6.yaml").read_text().replace("count: 20", "count: 4")
    Path("fig6.yaml").write_text(own)
    assert load_case(name).n_members == 4 * 51


def test_an_unknown_name_tells_those_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError, match=r"no such file; cases that come with mdstopo: .*fig6, .*tiedown"):
        load_case("fig66")
    with pytest.raises(CaseError, match=r"no such file$"):
        load_case("there/fig6.yaml")


def test_every_case_that_comes_along_is_read() -> None:
    assert {"fig6", "fig7", "mooring", "lander"} <= set(names())
    for name in names():
        assert load_case(folder() / f"{name}.yaml").n_members
