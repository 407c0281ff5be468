"""The notebook has the cells that stand in the sources, they run, and what they showed is in it."""

import ast
import json
from typing import Any

import pytest

from documentation.notebook import CELLS, PLACE


def test_the_notebook_is_that_of_the_sources_and_has_been_run() -> None:
    notebook = json.loads(PLACE.read_text(encoding="utf-8"))
    assert ["".join(cell["source"]) for cell in notebook["cells"]] == [text.removeprefix("md") for text in CELLS]
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    for cell in code:
        (output,) = cell["outputs"]
        assert output["output_type"] == "execute_result"
    assert any("<svg" in "".join(cell["outputs"][0]["data"].get("text/html", "")) for cell in code)


def test_its_cells_run(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    shown = []
    for text in (each for each in CELLS if not each.startswith("md")):
        *before, last = ast.parse(text).body
        assert isinstance(last, ast.Expr)
        exec(compile(ast.Module(before, []), "<cell>", "exec"), names)
        shown.append(eval(compile(ast.Expression(last.value), "<cell>", "eval"), names))
    assert "converged" in repr(shown[3])
    assert shown[-1][1] == (2, 1020)
