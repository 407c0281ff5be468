"""Every case of the gallery is computed, and the page shows the cases as they are."""

import pytest

from benchmarks.gallery import PAGE, PICTURES, cases, compute, page, taught
from mdstopo.case.reader import load_case
from mdstopo.store.result_reader import read_result


def test_the_page_is_that_of_the_cases() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run `make gallery`"
    assert len(cases()) >= 20
    assert {path.stem for path in PICTURES.glob("*.svg")} == {path.stem for path in cases()}


@pytest.mark.parametrize("path", cases(), ids=lambda path: path.stem)
def test_a_case_is_computed_and_teaches_something(path, tmp_path) -> None:
    case = load_case(path)
    assert not case.warnings
    assert len(taught(path)) > 40
    view = read_result(compute(path, tmp_path))
    assert view.finished
    assert view.status != "failed"
