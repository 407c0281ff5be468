"""Losses of residuals, in the terms of robust statistics (Huber 1981).

Each function takes residuals r (n,), divided by their standard deviations, and returns three arrays (n,): the loss rho,
the weight w by which its influence function is psi = rho' / 2 = w r, and the slope psi' of that. Least squares have
rho = r^2, w = 1 and psi' = 1.
"""

from collections.abc import Callable
from pkgutil import resolve_name

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.methods.losses import LOSSES

Loss = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


def linear(r: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least squares: rho = r^2."""
    return r**2, np.ones_like(r), np.ones_like(r)


def huber(r: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Huber's loss: rho = r^2 where |r| <= 1, else 2 |r| - 1."""
    size = np.abs(r)
    near = size <= 1.0
    return np.where(near, r**2, 2.0 * size - 1.0), 1.0 / np.maximum(size, 1.0), near.astype(np.float64)


def soft_l1(r: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A smooth loss like Huber's: rho = 2 (sqrt(1 + r^2) - 1)."""
    root = np.sqrt(1.0 + r**2)
    return 2.0 * (root - 1.0), 1.0 / root, 1.0 / root**3


def cauchy(r: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cauchy's loss: rho = ln(1 + r^2)."""
    z = r**2
    return np.log1p(z), 1.0 / (1.0 + z), (1.0 - z) / (1.0 + z) ** 2


def loss(name: str, r: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """rho, psi and psi' (n,) of residuals r (n,), by a loss of `case.methods.losses`."""
    function: Loss = resolve_name(LOSSES[name].function)
    rho, weight, slope = function(r)
    return rho, weight * r, slope


def for_scipy(name: str) -> str | Callable[[FloatArray], FloatArray]:
    """The loss as `scipy.optimize.least_squares` takes it: of z = r^2, with its first and second derivatives by z."""
    kind = LOSSES[name]
    if not kind.is_robust:
        return "linear"
    function: Loss = resolve_name(kind.function)

    def of_squares(z: FloatArray) -> FloatArray:
        rho, weight, slope = function(np.sqrt(z))
        # psi' = d(w r)/dr = w + 2 z dw/dz; at z = 0 only products of dw/dz with z are needed
        second = np.divide(slope - weight, 2.0 * z, out=np.zeros_like(z), where=z > 0.0)
        return np.array([rho, weight, second])

    return of_squares
