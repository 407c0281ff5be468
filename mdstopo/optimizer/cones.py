"""Three-dimensional second-order cones x_0 >= |(x_1, x_2)|, as an interior point needs them, compiled.

The scaling is that of Nesterov and Todd (1997), W y = W^-1 s = lam, in closed form (L. Vandenberghe, "The CVXOPT linear
and quadratic cone program solvers", 2010). Points of K cones are arrays (K, 3).
"""

from typing import NamedTuple

import numpy as np

from mdstopo.compiler.jit import member_kernel
from mdstopo.optimizer.problem import Floats

#: what a determinant is at least: a point on the boundary is taken to be next to it
LEAST_DETERMINANT = 1e-30


class Scaling(NamedTuple):
    """The Nesterov-Todd scaling W of K cones: w (K, 3) and eta (K,), of which W is made; lam (K, 3), the scaled
    variables.

    W is symmetric. Its eigenvectors are the rows of turn (K, 3, 3), with the squares of its eigenvalues (K, 3): in
    their basis the linear systems have a diagonal where W^2 has entries of which one would drown the others.
    """

    w: Floats
    eta: Floats
    lam: Floats
    squares: Floats
    turn: Floats


@member_kernel
def determinant(x: Floats) -> float:
    """x_0^2 - |(x_1, x_2)|^2 of x (3,) without cancellation."""
    size = np.sqrt(x[1] * x[1] + x[2] * x[2])
    return float((x[0] - size) * (x[0] + size))


@member_kernel
def outside(x: Floats) -> float:
    """How far points (K, 3) lie outside the cone, at most: where one is on its boundary to rounding the scaling fails,
    and a step may leave the cone by far more."""
    most = 0.0
    for k in range(len(x)):
        most = max(most, np.sqrt(x[k, 1] * x[k, 1] + x[k, 2] * x[k, 2]) - x[k, 0])
    return most


@member_kernel
def scaling_of(s: Floats, y: Floats) -> Scaling:
    """The scaling of slacks and multipliers (K, 3) inside their cones."""
    K = len(s)
    found = Scaling(np.empty((K, 3)), np.empty(K), np.empty((K, 3)), np.empty((K, 3)), np.empty((K, 3, 3)))
    half = np.sqrt(0.5)
    for k in range(K):
        w, squares, turn = found.w[k], found.squares[k], found.turn[k]
        det_s, det_y = max(determinant(s[k]), LEAST_DETERMINANT), max(determinant(y[k]), LEAST_DETERMINANT)
        by_s, by_y = 1.0 / np.sqrt(det_s), 1.0 / np.sqrt(det_y)
        inner = 0.0
        for i in range(3):
            inner += s[k, i] * by_s * (y[k, i] * by_y)
        gamma = np.sqrt(0.5 * (1.0 + inner))
        for i in range(1, 3):
            w[i] = 0.5 * (s[k, i] * by_s - y[k, i] * by_y) / gamma
        size = np.sqrt(w[1] * w[1] + w[2] * w[2])
        w[0] = np.sqrt(1.0 + size * size)
        found.eta[k] = np.sqrt(np.sqrt(det_s / det_y))
        times(w, found.eta[k], y[k], found.lam[k])
        square = found.eta[k] * found.eta[k]
        larger = (w[0] + size) * (w[0] + size)
        squares[0], squares[1], squares[2] = square * larger, square / larger, square
        x, z = (w[1] / size, w[2] / size) if size > 0.0 else (1.0, 0.0)
        turn[0, 0], turn[0, 1], turn[0, 2] = half, half * x, half * z
        turn[1, 0], turn[1, 1], turn[1, 2] = half, -half * x, -half * z
        turn[2, 0], turn[2, 1], turn[2, 2] = 0.0, -z, x
    return found


@member_kernel
def times(w: Floats, eta: float, x: Floats, out: Floats) -> None:
    """Multiply by the scaling of one cone: out (3,) = W x."""
    inner = w[1] * x[1] + w[2] * x[2]
    share = x[0] + inner / (1.0 + w[0])
    out[0] = eta * (w[0] * x[0] + inner)
    out[1] = eta * (x[1] + w[1] * share)
    out[2] = eta * (x[2] + w[2] * share)


@member_kernel
def inverse_times(w: Floats, eta: float, x: Floats, out: Floats) -> None:
    """Multiply by the inverse of one cone's scaling: out (3,) = W^-1 x."""
    inner = w[1] * x[1] + w[2] * x[2]
    share = inner / (1.0 + w[0]) - x[0]
    out[0] = (w[0] * x[0] - inner) / eta
    out[1] = (x[1] + w[1] * share) / eta
    out[2] = (x[2] + w[2] * share) / eta


@member_kernel
def longest(scaling: Scaling, ds: Floats, dy: Floats) -> float:
    """The longest step within the cones for changes (K, 3) of slacks and multipliers, found in the scaled space."""
    most = np.inf
    change = np.empty(3)
    for k in range(len(ds)):
        inverse_times(scaling.w[k], scaling.eta[k], ds[k], change)
        most = min(most, to_boundary(scaling.lam[k], change))
        times(scaling.w[k], scaling.eta[k], dy[k], change)
        most = min(most, to_boundary(scaling.lam[k], change))
    return most


@member_kernel
def to_boundary(x: Floats, d: Floats) -> float:
    """The largest step for which x + a d, both (3,), stays inside the cone."""
    a = determinant(d)
    b = x[0] * d[0] - x[1] * d[1] - x[2] * d[2]
    c = max(determinant(x), 0.0)
    step = np.inf
    # the smallest positive root of a t^2 + 2 b t + c, c > 0
    if a < 0.0 or (b < 0.0 and b * b - a * c >= 0.0):
        root = c / (np.sqrt(max(b * b - a * c, 0.0)) - b)
        if root >= 0.0:
            step = root
    return min(step, -x[0] / d[0]) if d[0] < 0.0 else step


@member_kernel
def aim(scaling: Scaling, target: float, ds: Floats, dy: Floats, corrected: bool, out: Floats) -> None:
    """The right side of a Newton step, by how much the products of cones have to change: out = W (lam \\ (target e -
    lam o lam - (W^-1 ds) o (W dy))).

    o is the cone's product, and lam \\ x solves lam o y = x.

    In:
      scaling: W and lam of K cones.
      target: the complementarity to go to.
      ds, dy (K, 3): changes of slacks and multipliers.
      corrected: whether their product, the last term, is to be corrected for.
    Out:
      out (K, 3).
    """
    left, right, total = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(out)):
        lam, w, eta = scaling.lam[k], scaling.w[k], scaling.eta[k]
        _product(lam, lam, total)
        for i in range(3):
            total[i] = -total[i]
        total[0] += target
        if corrected:
            inverse_times(w, eta, ds[k], left)
            times(w, eta, dy[k], right)
            product = out[k]
            _product(left, right, product)
            for i in range(3):
                total[i] -= product[i]
        # x with lam o x = total
        head = (lam[0] * total[0] - lam[1] * total[1] - lam[2] * total[2]) / determinant(lam)
        for i in range(1, 3):
            left[i] = (total[i] - head * lam[i]) / lam[0]
        left[0] = head
        times(w, eta, left, out[k])


@member_kernel
def _product(a: Floats, b: Floats, out: Floats) -> None:
    """The cone's product a o b of two points (3,)."""
    out[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    out[1] = a[0] * b[1] + b[0] * a[1]
    out[2] = a[0] * b[2] + b[0] * a[2]
