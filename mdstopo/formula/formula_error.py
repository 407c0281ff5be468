"""A mistake in a formula."""

from __future__ import annotations


class FormulaError(Exception):
    """A formula that cannot be used: a sentence without a full stop, and the column in the formula, from 1."""

    def __init__(self, message: str, column: int) -> None:
        self.message = message
        self.column = column
        super().__init__(message, column)

    def __str__(self) -> str:
        return f"{self.message} (column {self.column} of the expression)"
