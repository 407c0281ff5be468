"""Gradients of rows over very many variables: kept one by one, never copied."""

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.problem import Bools, Floats, Ints
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES, steepest, total


class Stack:
    """Rows (K, N) that are arrays of their own: to take some of them, or more, moves no numbers.

    rows: contiguous arrays (N,), never changed; n: N. steepest (K,): the largest size of a number of each.
    """

    __slots__ = ("n", "rows", "steepest")

    def __init__(self, rows: Iterable[Floats], steepest: Floats, n: int) -> None:
        self.rows, self.steepest, self.n = tuple(rows), steepest, n

    @classmethod
    def of(cls, *matrices: Floats) -> "Stack":
        """The rows of matrices (K, N), which are not copied where they are contiguous."""
        rows = [np.ascontiguousarray(row) for matrix in matrices for row in matrix]
        return cls(rows, np.concatenate([steepest(matrix) for matrix in matrices]), matrices[0].shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """The shape (K, N) of all its rows together."""
        return len(self.rows), self.n

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, places: Ints | Bools | slice) -> "Stack":
        which = np.arange(len(self))[places]
        return Stack((self.rows[k] for k in which.tolist()), self.steepest[which], self.n)

    def __matmul__(self, x: Floats) -> Floats:
        """The rows times x (N,), (K,); summed in a fixed order."""
        return np.array([total(row, x) for row in self.rows])

    def __array__(self, dtype: object = None, copy: bool | None = None) -> NDArray[np.float64]:
        """All rows in one array, as files have them."""
        return np.array(self.rows).reshape(self.shape)


#: gradients of rows: a matrix (K, N), or a stack of very many variables
Slopes: TypeAlias = Floats | Stack


def slopes_of(matrix: Slopes) -> Slopes:
    """Gradients in the form in which they are kept: a stack where the variables are very many."""
    return Stack.of(matrix) if isinstance(matrix, np.ndarray) and matrix.shape[1] >= VERY_MANY_VARIABLES else matrix


def joined(one: Slopes, other: Slopes) -> Slopes:
    """The rows of one matrix, then those of the other."""
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.concatenate([one, other])
    first, last = (each if isinstance(each, Stack) else Stack.of(each) for each in (one, other))
    return Stack(first.rows + last.rows, np.concatenate([first.steepest, last.steepest]), first.n)


def steepest_of(slopes: Slopes) -> Floats:
    """The largest size of an entry of each row (K,)."""
    if isinstance(slopes, Stack):
        return slopes.steepest
    return np.asarray(np.abs(slopes).max(axis=1, initial=0.0))


def alike(slopes: Slopes, i: int, k: int, within: float) -> bool:
    """Whether no entries of two rows differ by more than that."""
    if isinstance(slopes, Stack):
        one, other = slopes.rows[i], slopes.rows[k]
        if abs(slopes.steepest[i] - slopes.steepest[k]) > within:
            return False
        return one is other or bool(steepest((one - other)[None])[0] <= within)
    return bool(np.abs(slopes[k] - slopes[i]).max() <= within)
