"""Where things are kept: pictures and result files in `results/`, numbers and what they depend on in one JSON file.

An item is done when its files are there and nothing it depends on has changed: the case file, this package, and the
sources of mdstopo that compute (a changed command line or picture style makes pictures anew, too).
"""

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
CASES = ROOT / "cases"

Numbers = dict[str, Any]


@dataclass(frozen=True)
class Item:
    """One figure or table. make: fills the folder, gives numbers; files: what it leaves there."""

    name: str
    title: str
    make: "Callable[[Desk], Numbers]"
    files: tuple[str, ...]
    needs: tuple[str, ...] = field(default=())


class Desk:
    """The folder that everything goes to, and the record of what is done."""

    def __init__(self, folder: Path, say: Callable[[str], None]) -> None:
        self.folder = folder
        self.say = say
        self._record = folder / "reproduce.json"
        self._sources = _hash_of_sources()
        folder.mkdir(parents=True, exist_ok=True)
        self.record: dict[str, dict[str, Any]] = {}
        if self._record.exists():
            try:
                self.record = json.loads(self._record.read_text(encoding="utf-8"))
            except ValueError:
                say(f"{self._record} is damaged; everything is made again")

    def path(self, name: str) -> Path:
        """Of a file in the folder."""
        return self.folder / name

    def numbers(self, name: str) -> Numbers:
        """What an item found."""
        found: Numbers = self.record[name]["numbers"]
        return found

    def is_done(self, item: Item) -> bool:
        """Whether nothing is left to do for it."""
        entry = self.record.get(item.name)
        return (
            entry is not None
            and entry["sources"] == self._sources
            and all(self.path(name).exists() for name in item.files)
        )

    def make(self, item: Item) -> None:
        """Make an item, and write down what it found."""
        began = time.perf_counter()
        numbers = item.make(self)
        seconds = time.perf_counter() - began
        self.record[item.name] = {"sources": self._sources, "seconds": seconds, "numbers": numbers}
        draft = self._record.with_suffix(".part")
        draft.write_text(json.dumps(self.record, indent=1), encoding="utf-8")
        draft.replace(self._record)


def _hash_of_sources() -> str:
    digest = hashlib.sha256()
    for folder in ("mdstopo", "reproduce"):
        for source in sorted((ROOT / folder).rglob("*.py")):
            digest.update(source.read_bytes())
    for case in sorted(CASES.glob("*.yaml")):
        digest.update(case.read_bytes())
    return digest.hexdigest()
