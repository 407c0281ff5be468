"""From the text of a formula to its tree: a lexer and a parser by strength of operators (Pratt 1973).

    sum      : product (("+" | "-") product)*
    product  : signed (("*" | "/") signed)*
    signed   : ("+" | "-") signed | power
    power    : atom ("^" signed)?          so that -x^2 is -(x^2), and 2^-3 and x^y^z = x^(y^z) are allowed
    atom     : number | name | function "(" sum ("," sum)* ")" | "(" sum ")"

The first operand of `if` is a comparison of two sums. Length, nesting and the number of parts are limited, and nothing
is computed here, so that no text takes long or much memory.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.tree import COMPARISONS, FUNCTIONS, Expression, name, number, operation

MOST_CHARACTERS = 5000
"""Characters of a formula."""
DEEPEST_NESTING = 50
"""Brackets, signs and powers inside each other."""
MOST_PARTS = 1000
"""Numbers, names, operators and functions of a formula."""

CONSTANTS = {"pi": math.pi}
TIME = "t"
"""The name of the time in a formula, s."""
WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_SIGN = re.compile(r"\*\*|<=|>=|==|!=|<>|&&|\|\||[-+*/^<>(),]")
_BLANK = re.compile(r"[ \t\r\n]+")
_KINDS = (("blank", _BLANK), ("number", _NUMBER), ("name", WORD), ("sign", _SIGN))
_INSTEAD = {
    "**": "a power is written ^",
    "==": "compare with < <= > >=",
    "!=": "compare with < <= > >=",
    "<>": "compare with < <= > >=",
    "&&": "write one `if` inside another",
    "||": "write one `if` inside another",
}
_END = "the end"


class Token(NamedTuple):
    """A piece of a formula: number, name, sign or end; column from 1."""

    kind: str
    text: str
    column: int


class Formula(NamedTuple):
    """A formula that has been read: its text, its tree, and at which column each part of the tree first stands."""

    text: str
    root: Expression
    columns: Mapping[Expression, int]

    def column(self, part: Expression) -> int:
        """Where a part stands; 1 for one that is not written."""
        return self.columns.get(part, 1)


def parse(text: str, names: Collection[str] | None = None, hints: Mapping[str, str] | None = None) -> Formula:
    """The formula in a text. Raises FormulaError with the column.

    names: those that it may use; None: any. hints: what is told beside, by names that may be written and are unknown.
    """
    return _Parser(text, names, hints or {}).formula()


def reserved(word: str) -> bool:
    """Whether a word has a meaning in all formulas, so that no name can be this word."""
    return word in FUNCTIONS or word in CONSTANTS


def _tokens(text: str) -> list[Token]:
    if len(text) > MOST_CHARACTERS:
        raise FormulaError(f"found {len(text):,} characters, allowed are {MOST_CHARACTERS:,}", MOST_CHARACTERS + 1)
    tokens: list[Token] = []
    position = 0
    while position < len(text):
        column = position + 1
        kind, match = next(
            ((kind, match) for kind, pattern in _KINDS if (match := pattern.match(text, position))), ("", None)
        )
        if match is None:
            raise FormulaError(f"found {_shown(text[position])}, which no expression has", column)
        position = match.end()
        if match[0] in _INSTEAD:
            raise FormulaError(f"found {match[0]!r}: {_INSTEAD[match[0]]}", column)
        if kind == "blank":
            continue
        if len(tokens) >= 2 * MOST_PARTS:
            raise FormulaError(f"found more than {MOST_PARTS:,} numbers, names and operators", column)
        tokens.append(Token(kind, match[0], column))
    tokens.append(Token("end", _END, len(text.rstrip()) + 1))
    return tokens


class _Parser:
    def __init__(self, text: str, names: Collection[str] | None, hints: Mapping[str, str]) -> None:
        self.text = text
        self.names = names
        self.hints = hints
        self.tokens = _tokens(text)
        self.place = 0
        self.depth = 0
        self.count = 0
        self.columns: dict[Expression, int] = {}

    def formula(self) -> Formula:
        """All of the text."""
        if len(self.tokens) == 1:
            raise FormulaError("found nothing, needed is an expression", 1)
        root = self.sum()
        token = self.tokens[self.place]
        if token.kind != "end":
            raise self.unexpected(token, "an operator or the end")
        return Formula(self.text, root, self.columns)

    def sum(self) -> Expression:
        """Products, added and subtracted."""
        left = self.product()
        while (sign := self.taken("+", "-")) is not None:
            left = self.made(sign, sign.text, left, self.product())
        return left

    def product(self) -> Expression:
        """Powers, multiplied and divided."""
        left = self.signed()
        while (sign := self.taken("*", "/")) is not None:
            left = self.made(sign, sign.text, left, self.signed())
        return left

    def signed(self) -> Expression:
        """A power, perhaps with signs before it."""
        sign = self.taken("+", "-")
        if sign is None:
            return self.power()
        self.deeper(sign)
        inner = self.signed()
        self.depth -= 1
        return inner if sign.text == "+" else self.made(sign, "neg", inner)

    def power(self) -> Expression:
        """An atom, perhaps with an exponent."""
        base = self.atom()
        sign = self.taken("^")
        if sign is None:
            return base
        self.deeper(sign)
        exponent = self.signed()
        self.depth -= 1
        return self.made(sign, "^", base, exponent)

    def atom(self) -> Expression:
        """A number, a name, a call, or a sum in brackets."""
        token = self.tokens[self.place]
        self.place += 1
        if token.kind == "number":
            return self.number(token)
        if token.kind == "name":
            if self.tokens[self.place].text == "(":
                return self.call(token)
            return self.name(token)
        if token.text != "(":
            raise self.unexpected(token, "a number, a name, a function or (")
        self.deeper(token)
        inner = self.sum()
        self.close(token)
        return inner

    def number(self, token: Token) -> Expression:
        """A number that is finite and stands alone."""
        after = self.tokens[self.place]
        if after.kind in ("name", "number") and after.column == token.column + len(token.text):
            hint = f"; write {token.text}*{after.text}" if after.kind == "name" else ""
            raise FormulaError(f"found {_shown(after.text)} right after a number{hint}", after.column)
        value = float(token.text)
        if not math.isfinite(value):
            raise FormulaError(f"found {_shown(token.text)}, which is too large for a number", token.column)
        return self.kept(token, number(value))

    def name(self, token: Token) -> Expression:
        """A constant, or a name that is known."""
        word = token.text
        if word in CONSTANTS:
            return self.kept(token, number(CONSTANTS[word]))
        if word in FUNCTIONS:
            raise FormulaError(f"{word!r} is a function and is written {word}(...)", token.column)
        if self.names is not None and word not in self.names:
            raise FormulaError(_unknown(word, self.names, self.hints.get(word)), token.column)
        return self.kept(token, name(word))

    def call(self, token: Token) -> Expression:
        """A function with its operands."""
        word = token.text
        if word not in FUNCTIONS:
            if word in CONSTANTS or (self.names is not None and word in self.names):
                raise FormulaError(f"{word!r} is no function; write {word}*(...) for a product", token.column)
            hint = _did_you_mean(word, FUNCTIONS)
            there = f"there are {', '.join(FUNCTIONS)}"
            raise FormulaError(f"there is no function {_shown(word)}{hint or ';'} {there}", token.column)
        opened = self.tokens[self.place]
        self.place += 1
        self.deeper(opened)
        operands = [self.comparison() if word == "if" else self.sum()]
        while self.taken(",") is not None:
            operands.append(self.sum())
        self.close(opened)
        least, most, _ = FUNCTIONS[word]
        if len(operands) < least or (most is not None and len(operands) > most):
            needed = f"{least}" if least == most else f"at least {least}"
            raise FormulaError(f"{word} has {needed} values, found {len(operands)}", token.column)
        return self.made(token, word, *operands)

    def comparison(self) -> Expression:
        """Two sums, compared."""
        left = self.sum()
        sign = self.taken(*COMPARISONS)
        if sign is None:
            raise self.unexpected(self.tokens[self.place], "a comparison (< <= > >=) in the first value of `if`")
        return self.made(sign, sign.text, left, self.sum())

    def taken(self, *texts: str) -> Token | None:
        """Go past the next token if it is one of these signs; the token, or None."""
        token = self.tokens[self.place]
        if token.kind != "sign" or token.text not in texts:
            return None
        self.place += 1
        return token

    def close(self, opened: Token) -> None:
        """The bracket that belongs to an opened one."""
        token = self.tokens[self.place]
        if token.text != ")" or token.kind != "sign":
            raise self.unexpected(token, f"an operator or ) for the bracket at column {opened.column}")
        self.place += 1
        self.depth -= 1

    def deeper(self, token: Token) -> None:
        """One level further in."""
        self.depth += 1
        if self.depth > DEEPEST_NESTING:
            raise FormulaError(f"nested deeper than {DEEPEST_NESTING} levels", token.column)

    def made(self, token: Token, operator: str, *operands: Expression) -> Expression:
        """An operation that stands at a token."""
        return self.kept(token, operation(operator, *operands))

    def kept(self, token: Token, part: Expression) -> Expression:
        """A part, with its column; not too many."""
        self.count += 1
        if self.count > MOST_PARTS:
            raise FormulaError(f"found more than {MOST_PARTS:,} numbers, names and operators", token.column)
        self.columns.setdefault(part, token.column)
        return part

    def unexpected(self, token: Token, allowed: str) -> FormulaError:
        """A token that cannot stand where it does."""
        if token.kind == "sign" and token.text in COMPARISONS:
            allowed += "; comparisons stand in the first value of `if`"
        what = token.text if token.kind == "end" else _shown(token.text)
        return FormulaError(f"found {what}, allowed is {allowed}", token.column)


def _unknown(word: str, names: Iterable[str], more: str | None) -> str:
    listed = sorted(names)
    hint = _did_you_mean(word, [*listed, *FUNCTIONS, *CONSTANTS])
    told = ", ".join(listed[:20]) + (", ..." if len(listed) > 20 else "")
    there = f"names are {told}" if listed else "no names are defined"
    return f"there is no name {_shown(word)}{hint or ';'} {there}" + (f"; {more}" if more else "")


def _did_you_mean(word: str, words: Iterable[str]) -> str:
    from difflib import get_close_matches  # only for a mistyped word

    by_lower = {each.lower(): each for each in words}
    found = get_close_matches(word[:60].lower(), list(by_lower), n=1, cutoff=0.6)
    return f", did you mean {by_lower[found[0]]!r}?" if found else ""


def _shown(text: str) -> str:
    return ascii(text if len(text) <= 40 else text[:37] + "...")
