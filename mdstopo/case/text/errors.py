"""Mistakes in a case file: located, collected, printed one per line."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mdstopo.case.value import Value, frozen


@frozen
class Mistake(Value):
    """One mistake (or, in `Case.warnings`, one remark).

    path_key: path of the key (``members.belts.law.stiffness``); message: what was found and what is allowed;
    line, column: from 1. origin: what stands in place of file, line and column where the value did not come
    from the file (``--set solver.step``), else empty.
    """

    path_key: str
    message: str
    line: int
    column: int
    origin: str = ""

    def located(self, file: str) -> str:
        """``file:line:column: key: message``, the form that editors understand."""
        place = self.origin or f"{file}:{self.line}:{self.column}"
        key = f"{self.path_key}: " if self.path_key else ""
        return f"{place}: {key}{self.message}"


class CaseError(Exception):
    """A case that cannot be used: every mistake that one reading finds, sorted by place.

    mistakes: tuple[Mistake, ...]; file: the name the places refer to.
    """

    def __init__(self, mistakes: Iterable[Mistake], file: str = "<case>") -> None:
        unique = dict.fromkeys(mistakes)
        self.mistakes: tuple[Mistake, ...] = tuple(
            sorted(unique, key=lambda m: (bool(m.origin), m.line, m.column, m.origin, m.path_key))
        )
        self.file = file
        super().__init__(file)

    def __str__(self) -> str:
        return "\n".join(mistake.located(self.file) for mistake in self.mistakes)

    def __reduce__(self) -> tuple[Any, ...]:
        return CaseError, (self.mistakes, self.file)
