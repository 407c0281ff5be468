"""The drawn layers are those of the code: every module has a box, none stands above one that imports it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from documentation.layers import IMAGE, ROWS, drawn
from tests.sources import statements_in, tree

from .test_imports import ROOT

PACKAGE = ROOT / "mdstopo"


def rows_of_boxes() -> dict[str, tuple[int, int]]:
    """The first and the last row of each module's box."""
    return {name: (k, k + box.rows - 1) for k, (_, boxes) in enumerate(ROWS) for box in boxes for name in box.names}


def imports(path: Path) -> Iterator[str]:
    """What a module imports of the package while it runs: all but what stands below `if TYPE_CHECKING`."""
    waiting: list[ast.AST] = [tree(path)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            waiting += node.orelse
            continue
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("mdstopo."):
            yield str(node.module)
        waiting += statements_in(node)


def test_every_module_has_a_box() -> None:
    inside = list(PACKAGE.iterdir())
    there = {path.stem for path in inside if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert sorted(rows_of_boxes()) == sorted(there - {"__init__"})


def test_no_box_stands_above_one_that_imports_it() -> None:
    place = rows_of_boxes()
    seen = 0
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if len(parts) == 2 and parts[1] == "__init__":
            continue
        for target in imports(path):
            importer, imported = parts[1], target.split(".")[1]
            if importer == imported:
                continue
            seen += 1
            assert place[importer][0] <= place[imported][1], f"{path}: {target}"
    assert seen > 500


def test_the_picture_is_drawn_anew_where_it_changed() -> None:
    assert IMAGE.read_text(encoding="utf-8") == drawn(), "python -m documentation.layers draws it"
