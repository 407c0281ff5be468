"""The numbers that follow from defined names which are design variables: their values and derivatives.

Each is an expression of the names, through any other names between them. Derivatives are derived from the expressions,
so they are exact; where an expression has a kink, they are those of the side on which it is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.objects.problem_parts import Following, Follows
from mdstopo.formula.calculus import derivative, substituted
from mdstopo.formula.formula_values import value_of, values_of
from mdstopo.formula.parser import parse
from mdstopo.formula.tree import COMPARISONS, Expression, name, names_in, number, parts

#: what jumps where its operands do not
_JUMPS = ("sign", "step", *COMPARISONS)


class Expressions:
    """Expressions of a case as functions of some defined names x (V,); the other names are given."""

    def __init__(self, names: Sequence[str], given: Mapping[str, float | str], texts: Sequence[str]) -> None:
        self.names = tuple(names)
        self._trees = {word: _tree(stated) for word, stated in given.items()}
        self._written = [parse(text).root for text in texts]
        #: the given names that expressions lead to, each behind those that it is made of
        self.used: list[str] = []
        for root in self._written:
            self._use(root)
        whole: dict[str, Expression] = {word: name(word) for word in self.names}
        for word in self.used:
            whole[word] = _put_in(self._trees[word], whole)
        #: of each expression what it is of the names alone
        self.roots = [_put_in(root, whole) for root in self._written]

    def _use(self, root: Expression) -> None:
        """Note the names that an expression leads to. Names do not lead back to themselves (`definitions`)."""
        waiting = names_in(root)
        while waiting:
            word = waiting[-1]
            inner = [] if self._is_known(word) else names_in(self._trees[word])
            missing = [each for each in inner if not self._is_known(each)]
            if missing:
                waiting += missing
                continue
            waiting.pop()
            if not self._is_known(word):
                self.used.append(word)

    def _is_known(self, word: str) -> bool:
        return word in self.names or word in self.used

    def values(self, x: FloatArray) -> FloatArray:
        """(K,) the expressions at x, computed as they are written; NaN or infinite where there is no value."""
        known = dict(zip(self.names, x.tolist(), strict=True))
        for word in self.used:
            known[word] = value_of(self._trees[word], known)
        return np.array(values_of(known, self._written))

    def slopes(self, x: FloatArray) -> FloatArray:
        """(K, V) derivatives of the expressions by the defined names, at values x (V,)."""
        found = values_of(dict(zip(self.names, x.tolist(), strict=True)), self._derivatives)
        return np.array(found).reshape(len(self.roots), len(self.names))

    @cached_property
    def _derivatives(self) -> list[Expression]:
        """Of each expression that by each name."""
        return [derivative(root, word) for root in self.roots for word in self.names]

    def depends(self, k: int) -> list[str]:
        """The defined names that expression k depends on."""
        return [word for word in names_in(self.roots[k]) if word in self.names]

    def jumps(self, k: int) -> str:
        """What in expression k may jump as the names vary (`sign`, `step`, `if`), or nothing."""
        for part in parts(self.roots[k]):
            if part.operator in _JUMPS and names_in(part):
                return "if" if part.operator in COMPARISONS else part.operator
        return ""


def expressions_of(follows: Follows, numbers: Sequence[Following]) -> Expressions:
    """Some of the numbers that follow from defined names, as expressions of these."""
    return Expressions(follows.names, follows.given, [each.expression for each in numbers])


def _tree(stated: float | str) -> Expression:
    return parse(stated).root if isinstance(stated, str) else number(stated)


def _put_in(root: Expression, whole: Mapping[str, Expression]) -> Expression:
    """An expression with what its names are in their place."""
    return substituted(root, {name(word): whole[word] for word in names_in(root)})
