"""Numbers in the README stand between marks, and only this module writes there."""

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
