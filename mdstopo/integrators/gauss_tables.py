"""Coefficients of Gauss collocation with several numbers of nodes, and of its dense output.

On a window [t, t + h] with c in [0, 1] the acceleration is a polynomial sum_k a^_k P_k(2c - 1), and

    v(c) = v_0 + h sum_k a^_k I1_k(c),     q(c) = q_0 + h c v_0 + h^2 sum_k a^_k I2_k(c)

with I1_k, I2_k the first and second integrals of the shifted Legendre polynomials from 0. The nodes' values obey the
Gauss Runge-Kutta method (v = v_0 + h A a, q = q_0 + h c v_0 + h^2 A A a: order 2s, symplectic, A-stable).
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.scene.springs_model import FloatArray

AnyFloats = NDArray[np.floating[Any]]

#: numbers of nodes a window may have, in the order in which they are tried
LEVELS = (7, 10, 14)

#: planes of the tables, each (s_max, s_max): row 0 of NODES holds c, row 1 the weights b, row 2 b (1 - c);
#: A, AA integrate node accelerations once and twice to the nodes; LEGENDRE turns node values into coefficients;
#: FIRST, SECOND are I1_k and I2_k at the nodes, VALUES P_k (rows nodes, columns k)
NODES, A, AA, LEGENDRE, FIRST, SECOND, VALUES = range(7)


def _legendre(x: AnyFloats, degree: int) -> list[AnyFloats]:
    """P_0 .. P_degree at x in [-1, 1], in the precision of x."""
    values = [np.ones_like(x), x.copy()]
    for k in range(1, degree):
        values.append(((2 * k + 1) * x * values[k] - k * values[k - 1]) / (k + 1))
    return values[: degree + 1]


def _nodes(s: int) -> tuple[AnyFloats, AnyFloats]:
    """Gauss nodes and weights on [0, 1], polished by Newton in extended precision."""
    x = np.polynomial.legendre.leggauss(s)[0].astype(np.longdouble)
    for _ in range(3):
        p = _legendre(x, s)
        slope = s * (p[s - 1] - x * p[s]) / (1 - x * x)
        x = x - p[s] / slope
    p = _legendre(x, s)
    slope = s * (p[s - 1] - x * p[s]) / (1 - x * x)
    return (x + 1) / 2, 1 / ((1 - x * x) * slope * slope)


def integrals(c: AnyFloats, count: int) -> tuple[AnyFloats, AnyFloats, AnyFloats]:
    """Legendre polynomials and their integrals: P_k, I1_k, I2_k for k < count at c in [0, 1], three arrays (len(c),
    count)."""
    p = _legendre(2 * c - 1, count + 2)
    first = [c] + [(p[k + 1] - p[k - 1]) / (2 * (2 * k + 1)) for k in range(1, count + 1)]
    second = [c * c / 2] + [(first[k + 1] - first[k - 1]) / (2 * (2 * k + 1)) for k in range(1, count)]
    return np.stack(p[:count], 1), np.stack(first[:count], 1), np.stack(second[:count], 1)


@cache
def gauss_tables() -> FloatArray:
    """All tables (n_level, 7, s_max, s_max), padded with zeros; computed once a process (about a millisecond).

    Not to be written to; not flagged so, because the flag is part of an array's type and would have every kernel
    compiled twice.
    """
    most = max(LEVELS)
    tables = np.zeros((len(LEVELS), 7, most, most))
    for level, s in enumerate(LEVELS):
        c, b = _nodes(s)
        values, first, second = integrals(c, s)
        transform = ((2 * np.arange(s) + 1)[:, None] * values.T) * b[None, :]
        matrix = first @ transform
        out = tables[level]
        out[NODES, :3, :s] = c, b, b * (1 - c)
        planes = {A: matrix, AA: matrix @ matrix, LEGENDRE: transform, FIRST: first, SECOND: second, VALUES: values}
        for plane, value in planes.items():
            out[plane, :s, :s] = value
    return tables
