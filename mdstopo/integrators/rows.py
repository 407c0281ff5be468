"""States of several nodes as rows of whole vectors: what the iterations of the Gauss method do over and over.

A row has n coordinates and zeros after them up to `row_width(n)`, so that loops over coordinates are few instructions
without remainders.
"""

import numpy as np

from mdstopo.compiler.jit import part
from mdstopo.compiler.vector import WIDE, lanes, larger, largest, load, magnitude, store, total, zero


@part
def row_width(n):
    """The length of a row that is padded for vectors, of n coordinates."""
    return (n + WIDE - 1) // WIDE * WIDE


@part
def make_rows(count, n):
    """Zeros (count, W), no vector of which lies in two lines of the cache: reading those takes half as long again."""
    width = row_width(n)
    room = np.zeros(count * width + WIDE)
    first = -(room.ctypes.data // room.itemsize) % WIDE
    return room[first : first + count * width].reshape((count, width))


@part
def copy_row(source, target):
    """Copy a vector into a longer row: target (W,) = source (n,), with zeros after it."""
    target[:] = 0.0
    for d in range(source.shape[0]):
        target[d] = source[d]


@part
def combine_rows(matrix, s, columns, factor, base, a, out):
    """out[i] = base[i] + factor sum_j matrix_ij a[j] for i < s, j < columns.

    In:
      matrix (s or more, columns or more): of which the first rows and columns count.
      s: how many rows come out.
      factor: of the sums.
      columns: how many rows go in.
      base (s or more, W), a (columns or more, W): rows.
    Out:
      out (s or more, W): overwritten up to s.
    """
    for d in range(0, out.shape[1], lanes()):
        for i in range(s):
            x = zero()
            for j in range(columns):
                x += matrix[i, j] * load(a[j], d)
            store(out[i], d, load(base[i], d) + factor * x)


@part
def integrate_to_nodes(matrix, s, columns, factor, start, slope, c, a, out):
    """out[i] = start + c_i slope + factor sum_j matrix_ij a[j] for i < s, j < columns.

    In:
      matrix (s or more, columns or more): of which the first rows and columns count.
      s: how many rows come out.
      factor: of the sums.
      columns: how many rows go in.
      start, slope (W,): alike for all rows.
      c (s or more,): times of the nodes, 0 to 1.
      a (columns or more, W): rows.
    Out:
      out (s or more, W): overwritten up to s.
    """
    for d in range(0, out.shape[1], lanes()):
        x0 = load(start, d)
        x1 = load(slope, d)
        for i in range(s):
            x = zero()
            for j in range(columns):
                x += matrix[i, j] * load(a[j], d)
            store(out[i], d, x0 + c[i] * x1 + factor * x)


@part
def move_to_nodes(matrix, s, factor, start, slope, c, a, weight, ref, out, dx):
    """out[i] = start + c_i slope + factor sum_j matrix_ij a[j] for i, j < s, and dx[i] = out[i] - ref[i].

    In:
      matrix (s or more, s or more): of which the first rows and columns count.
      s: how many rows.
      factor: of the sums.
      start, slope (W,): alike for all rows.
      c (s or more,): times of the nodes, 0 to 1.
      a, ref (s or more, W): rows.
      weight (W,): of the changes.
    In and out:
      out (s or more, W): overwritten up to s.
    Out:
      dx (s or more, W): overwritten up to s.

    Returns max over i and coordinates of weight times the change of out[i]; NaN where one is not finite.
    """
    most = zero()
    lost = zero()
    for d in range(0, out.shape[1], lanes()):
        x0 = load(start, d)
        x1 = load(slope, d)
        w = load(weight, d)
        for i in range(s):
            x = zero()
            for j in range(s):
                x += matrix[i, j] * load(a[j], d)
            x = x0 + c[i] * x1 + factor * x
            e = w * magnitude(x - load(out[i], d))
            most = larger(e, most)
            lost += e - e
            store(out[i], d, x)
            store(dx[i], d, x - load(ref[i], d))
    return np.nan if total(lost) != 0.0 else largest(most)


@part
def renew_rows(matrix, s, factor, base, a, weight, out):
    """out[i] = base[i] + factor sum_j matrix_ij a[j] for i, j < s.

    In:
      matrix (s or more, s or more): of which the first rows and columns count.
      s: how many rows.
      factor: of the sums.
      base, a (s or more, W): rows.
      weight (W,): of the changes.
    In and out:
      out (s or more, W): overwritten up to s.

    Returns max over i and coordinates of weight times the change of out[i], and of weight |out[i]|.
    """
    most = zero()
    size = zero()
    for d in range(0, out.shape[1], lanes()):
        w = load(weight, d)
        for i in range(s):
            x = zero()
            for j in range(s):
                x += matrix[i, j] * load(a[j], d)
            x = load(base[i], d) + factor * x
            most = larger(w * magnitude(x - load(out[i], d)), most)
            size = larger(w * magnitude(x), size)
            store(out[i], d, x)
    return largest(most), largest(size)


@part
def add_products(matrix, x, s, base, out):
    """out[i] = base[i] + sum_d x[i, d] matrix[i, d] for i < s; matrix (s, n, W), a row for each coordinate of x[i]."""
    for e in range(0, out.shape[1], lanes()):
        for i in range(s):
            y = load(base[i], e)
            for d in range(matrix.shape[1]):
                y += x[i, d] * load(matrix[i, d], e)
            store(out[i], e, y)


@part
def scale_rows(factor, x, s, out):
    """Multiply the first s rows by factors (W,): out[i] = factor x[i]."""
    for d in range(0, x.shape[1], lanes()):
        f = load(factor, d)
        for i in range(s):
            store(out[i], d, f * load(x[i], d))


@part
def subtract_rows(x, y, s, out):
    """Subtract the first s rows: out[i] = x[i] - y[i]."""
    for d in range(0, x.shape[1], lanes()):
        for i in range(s):
            store(out[i], d, load(x[i], d) - load(y[i], d))


@part
def take_rows(x, s, out):
    """Copy the first s rows: out[i] = x[i] for i < s."""
    for d in range(0, x.shape[1], lanes()):
        for i in range(s):
            store(out[i], d, load(x[i], d))


@part
def largest_difference(x, y, weight, s):
    """max over i < s and coordinates of weight |x[i] - y[i]|; NaN where one is not finite."""
    most = zero()
    lost = zero()
    for d in range(0, x.shape[1], lanes()):
        w = load(weight, d)
        for i in range(s):
            e = w * magnitude(load(x[i], d) - load(y[i], d))
            most = larger(e, most)
            lost += e - e
    return np.nan if total(lost) != 0.0 else largest(most)
