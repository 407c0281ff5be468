"""Vectors in space as three numbers each, and matrices as nine numbers by rows in an array, inside kernels.

A vector is a tuple, which costs no memory. A turning matrix R stands in `m[i : i + 9]`, vectors in `x[i : i + 3]`.
"""

import math

from mdstopo.compiler.jit import part


@part
def vector_at(x, i):
    """The vector that stands at place i of x."""
    return x[i], x[i + 1], x[i + 2]


@part
def put(x, i, a):
    """Write a vector into three entries of x: x[i : i + 3] = a."""
    x[i] = a[0]
    x[i + 1] = a[1]
    x[i + 2] = a[2]


@part
def add(x, i, a):
    """Add a vector to three entries of x: x[i : i + 3] += a."""
    x[i] += a[0]
    x[i + 1] += a[1]
    x[i + 2] += a[2]


@part
def plus(a, b):
    """The sum a + b of vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@part
def minus(a, b):
    """The difference a - b of vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def times(s, a):
    """The vector s a, a multiplied by a number."""
    return s * a[0], s * a[1], s * a[2]


@part
def dot(a, b):
    """The scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def cross(a, b):
    """The vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def norm(a):
    """The length |a| of a vector."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@part
def turned(m, i, a):
    """R a for the matrix R at place i of m."""
    return (
        m[i] * a[0] + m[i + 1] * a[1] + m[i + 2] * a[2],
        m[i + 3] * a[0] + m[i + 4] * a[1] + m[i + 5] * a[2],
        m[i + 6] * a[0] + m[i + 7] * a[1] + m[i + 8] * a[2],
    )


@part
def turned_back(m, i, a):
    """R^T a for the matrix R at place i of m."""
    return (
        m[i] * a[0] + m[i + 3] * a[1] + m[i + 6] * a[2],
        m[i + 1] * a[0] + m[i + 4] * a[1] + m[i + 7] * a[2],
        m[i + 2] * a[0] + m[i + 5] * a[1] + m[i + 8] * a[2],
    )


@part
def by_rows(m, a):
    """R a for a matrix R of which m has the rows, as vectors."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


@part
def by_columns(m, a):
    """R^T a for a matrix R of which m has the rows, as vectors."""
    return (
        m[0][0] * a[0] + m[1][0] * a[1] + m[2][0] * a[2],
        m[0][1] * a[0] + m[1][1] * a[1] + m[2][1] * a[2],
        m[0][2] * a[0] + m[1][2] * a[1] + m[2][2] * a[2],
    )


@part
def row_of(m, i, k):
    """Row k of the matrix at place i of m."""
    return m[i + 3 * k], m[i + 3 * k + 1], m[i + 3 * k + 2]


@part
def column_of(m, i, k):
    """Column k of the matrix at place i of m."""
    return m[i + k], m[i + k + 3], m[i + k + 6]


@part
def unit(k):
    """The unit vector along axis k."""
    return 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
