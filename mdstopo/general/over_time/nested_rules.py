"""A rule of integration and a better one that has its nodes, too: what both differ by tells whether the first is good.

With s nodes x given, n more, and weights that integrate the polynomial through all s + n values, polynomials up to the
degree s + 2 n - 1 are integrated exactly where the new nodes are the zeros of a polynomial p of degree n with

    int_0^1 p(x) x^k prod_i (x - x_i) dx = 0,   k = 0 ... n - 1

(Kronrod's way to extend a rule of Gauss's, for any rule). Not for every n do such zeros lie within (0, 1).
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from mdstopo.scene.springs_model import FloatArray

#: degree up to which the better rule is exact at least; nodes that it may have more where the given one is that good
DEGREE, MORE = 12, 16
#: sum of the magnitudes of its weights at most, which is what rounding of values is multiplied by; how far its nodes
#: are apart at least
LARGEST_SUM, NODES_APART = 4.0, 1e-3
#: how exactly polynomials are to be integrated
EXACT = 1e-12
#: nodes of the rule of Gauss's that is taken where there is none of no more nodes
GAUSS = 8


class NestedRules(NamedTuple):
    """places (P,): nodes on [0, 1]. own, better (P,): weights of the given rule and of the better one, some of them
    0."""

    places: FloatArray
    own: FloatArray
    better: FloatArray


@cache
def nested_rules(nodes: tuple[float, ...], weights: tuple[float, ...]) -> NestedRules:
    """A rule on [0, 1], and one with its nodes and as few more as make it exact to `DEGREE` and by five degrees more
    than the given one; where no such nodes lie within, Gauss's rule beside it."""
    given, at = np.unique(nodes, return_inverse=True)
    own = np.bincount(at, np.asarray(weights)).astype(np.float64)
    for count in range(1, (MORE if _error(given, own, DEGREE) < EXACT else GAUSS) + 1):
        degree = len(given) + 2 * count - 1
        if degree < DEGREE or _error(given, own, degree - 4) < EXACT:
            continue
        places = np.concatenate([given, _added(given, count)])
        if not (np.all((places >= 0.0) & (places <= 1.0)) and np.diff(np.sort(places)).min() > NODES_APART):
            continue
        better = _interpolatory(places)
        if np.abs(better).sum() <= LARGEST_SUM and _error(places, better, degree) < EXACT:
            return NestedRules(places, np.append(own, np.zeros(count)), better)
    x, better = legendre.leggauss(GAUSS)
    places = np.concatenate([given, 0.5 * (x + 1.0)])
    return NestedRules(places, np.append(own, np.zeros(GAUSS)), np.append(np.zeros(len(given)), 0.5 * better))


def _polynomials(x: FloatArray, degree: int) -> FloatArray:
    """(len(x), degree + 1): Legendre's polynomials on [0, 1]."""
    return legendre.legvander(2.0 * x - 1.0, degree).astype(np.float64, copy=False)


def _error(places: FloatArray, weights: FloatArray, degree: int) -> float:
    """The largest error of a rule for Legendre's polynomials up to a degree."""
    integrals = weights @ _polynomials(places, degree)
    integrals[0] -= 1.0
    return float(np.abs(integrals).max())


def _interpolatory(places: FloatArray) -> FloatArray:
    """Weights that integrate the polynomial through all values."""
    integrals = np.zeros(len(places))
    integrals[0] = 1.0
    return np.linalg.solve(_polynomials(places, len(places) - 1).T, integrals).astype(np.float64, copy=False)


def _added(given: FloatArray, count: int) -> FloatArray:
    """The zeros (count,) of the polynomial p; NaN where not all are real, or where there is none."""
    x, weights = legendre.leggauss(len(given) + count)  # exact for the products below
    x, weights = 0.5 * (x + 1.0), 0.5 * weights
    basis = _polynomials(x, count)
    products = basis[:, :count].T @ (basis * (weights * np.prod(x[:, None] - given, axis=1))[:, None])
    scale = np.abs(products).max(axis=1, keepdims=True)  # zeros where the given rule is Gauss's
    try:
        lower = np.linalg.solve(products[:, :count] / scale, -products[:, count] / scale[:, 0])
    except np.linalg.LinAlgError:
        return np.full(count, np.nan)
    zeros = 0.5 * (legendre.legroots(np.append(lower, 1.0)) + 1.0)
    return np.real(zeros) if np.all(np.isreal(zeros)) else np.full(count, np.nan)
