"""Numbers in the README, and in pages of the documentation, stand between marks; only this module writes there."""

import re
from pathlib import Path


def replace_block(path: Path, name: str, text: str) -> None:
    """Put text between `<!-- benchmarks: name -->` and `<!-- end -->`; ValueError where the marks are missing."""
    begin, end = f"<!-- benchmarks: {name} -->", "<!-- end -->"
    whole = path.read_text(encoding="utf-8")
    pattern = re.compile(re.escape(begin) + r".*?" + re.escape(end), re.DOTALL)
    if not pattern.search(whole):
        raise ValueError(f"{path} has no block {begin} ... {end}")
    path.write_text(pattern.sub(lambda _: f"{begin}\n\n{text.strip()}\n\n{end}", whole, count=1), encoding="utf-8")


def write_pages(tables: list[str], machine: str) -> None:
    """Put the tables of `applications` into the pages: a group that ends with the table of its summary for each."""
    from benchmarks.applications import APPLICATIONS, TABLES

    for i, name in enumerate(APPLICATIONS):
        own = tables[i * TABLES : (i + 1) * TABLES]
        replace_block(Path(f"docs/applications/{name}.md"), name, "\n".join([*own, machine]))
