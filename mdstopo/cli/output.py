"""Where things are said: results on standard output, notices and progress on standard error."""

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TextIO

from mdstopo.cli import lost
from mdstopo.compiler.told import listeners
from mdstopo.store.json_values import json_value

#: seconds between two notices that kernels are being compiled
_EVERY = 10.0


class Output:
    """How much a command prints, and whether for people or as JSON.

    json: one JSON object is the only thing on standard output. quiet: nothing is said but mistakes (and the
    JSON object, where it was asked for).
    """

    def __init__(self, *, json: bool = False, quiet: bool = False) -> None:
        self.json = json
        self.quiet = quiet
        self._compiling = _Compiling(self.notice)
        if not quiet:
            listeners[:] = [self._compiling]  # a command speaks with one voice

    def announce(self, sentence: str) -> None:
        """Say that kernels are going to be compiled: the first of them need not be told."""
        self._compiling.began()
        self.notice(sentence)

    def say(self, text: str = "") -> None:
        """Print a line of the result, for people to read."""
        if not self.quiet and not self.json:
            write(sys.stdout, text)

    def table(self, rows: Iterable[Sequence[str]], indent: str = "  ") -> None:
        """Print rows of the result as aligned columns."""
        for line in aligned(rows, indent):
            self.say(line)

    def notice(self, sentence: str) -> None:
        """A remark for the user that is no part of the result."""
        if not self.quiet:
            write(sys.stderr, sentence)

    def document(self, content: Mapping[str, Any]) -> None:
        """Print the result as JSON, where that is wanted."""
        if self.json:
            plainly = (sys.stdout.encoding or "").lower().replace("-", "") != "utf8"
            write(sys.stdout, json.dumps(json_value(content), ensure_ascii=plainly, allow_nan=False))


class _Compiling:
    """Says that a kernel is compiled: the first, and then one every ten seconds."""

    def __init__(self, notice: Callable[[str], None]) -> None:
        self._notice = notice
        self._begun: float | None = None
        self._said = 0.0
        self._count = 0

    def began(self) -> None:
        """It has been said."""
        self._begun = self._said = time.monotonic()

    def __call__(self, name: str) -> None:
        """Another one is compiled."""
        now, self._count = time.monotonic(), self._count + 1
        if self._begun is None:
            self.began()
            self._notice(f"compiling kernels that are not kept yet, once for this version; the first is {name}")
        elif now - self._said >= _EVERY:
            self._said = now
            self._notice(f"still compiling: {name} is number {self._count}, after {duration(now - self._begun)}")


#: what a terminal would obey, and what turns the order of letters around, in letters that JSON reads as the same
_OBEYED = {
    code: f"\\u{code:04x}"
    for code in [*range(32), *range(127, 160), 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)]
    if chr(code) not in "\n\t"
}


def harmless(text: str) -> str:
    """A text without anything that a terminal obeys: titles and names may come from files of strangers."""
    return text.translate(_OBEYED)


def write(stream: TextIO, text: str) -> None:
    """Write a line; nothing once nobody reads any more. OutputError where standard output cannot be written."""
    try:
        print(harmless(text), file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except OSError as error:  # a full disk; nothing can be said of a standard error that cannot be written
        failure = lost(stream, error)
        if stream is sys.stdout:
            raise failure from None


def aligned(rows: Iterable[Sequence[str]], indent: str = "  ") -> list[str]:
    """Rows of text as lines with aligned columns; numbers to the right, words to the left."""
    rows = [list(row) for row in rows]
    count = max((len(row) for row in rows), default=0)
    widths = [max((len(row[i]) for row in rows if i < len(row)), default=0) for i in range(count)]
    right = [_is_numeric([row[i] for row in rows[1:] if i < len(row)]) for i in range(count)]
    lines = []
    for row in rows:
        cells = [c.rjust(widths[i]) if right[i] else c.ljust(widths[i]) for i, c in enumerate(row)]
        lines.append((indent + "  ".join(cells)).rstrip())
    return lines


def _is_numeric(cells: list[str]) -> bool:
    return bool(cells) and all(cell == "" or cell[0] in "0123456789-+." or cell == "nan" for cell in cells)


def number(value: float, digits: int = 6) -> str:
    """A number with so many digits, for people to read."""
    return f"{value:.{digits}g}"


def duration(seconds: float) -> str:
    """A time for people: 0.12 s, 3 min 20 s, 2 h 5 min."""
    if not math.isfinite(seconds):
        return "?"
    if seconds < 1.0:
        return f"{seconds * 1e3:.3g} ms"
    if seconds < 60.0:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
