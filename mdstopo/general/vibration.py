"""Small undamped motion about the start of a general scene."""

from typing import TYPE_CHECKING

import numpy as np

from mdstopo.scene.model import FloatArray

if TYPE_CHECKING:
    from mdstopo.general.general_driver import GeneralDriver

#: what a constraint leaves of a direction, relative, below which the direction is held
HELD = 1e-9


def natural_frequencies(driver: "GeneralDriver", alpha: FloatArray) -> FloatArray:
    """Angular frequencies (rad/s), rising, at the modes that members have at the start; unstable ones are left out."""
    from mdstopo.general.start_entry import linearise

    model = driver.scene.model
    n = len(model.mass)
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    rows = np.zeros((int(model.size[0]), n))
    driver.member_state[:] = 0.0
    driver.settle(alpha)
    linearise(driver.ints, driver.floats, driver.alpha.copy(), driver.member_state, stiffness, mass, rows)
    free = np.flatnonzero(model.free)
    k, m, j = stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], rows[:, free]
    root = np.linalg.cholesky(m)
    inverse = np.linalg.inv(root)
    j = j @ inverse.T
    _, sizes, basis = np.linalg.svd(j) if len(j) else (None, np.zeros(0), np.eye(len(free)))
    rank = int(np.sum(sizes > HELD * sizes.max(initial=0.0)))
    motion = basis[rank:].T
    values = np.linalg.eigvals(motion.T @ inverse @ k @ inverse.T @ motion).real
    rounding = 1e-12 * np.abs(values).max(initial=0.0)
    frequencies: FloatArray = np.sort(np.sqrt(values[values > rounding]))
    return frequencies
