"""Small undamped motion about the start of a general scene."""

import numpy as np

from mdstopo.general.driver_interface import DriverWithStart
from mdstopo.scene.springs_model import FloatArray
from mdstopo.scene.vibration_modes import Modes, modes_of

#: what a constraint leaves of a direction, relative, below which the direction is held
HELD = 1e-9


def start_modes(driver: DriverWithStart, alpha: FloatArray) -> Modes:
    """Small motion with the modes that members have at the start; shapes are of all freedoms, driven ones at rest."""
    from mdstopo.general.statics.start_entry import linearise

    model = driver.scene.model
    n = len(model.mass)
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    rows = np.zeros((int(model.size[0]), n))
    driver.member_state[:] = 0.0
    driver.settle(alpha)
    linearise(driver.ints, driver.floats, driver.alpha.copy(), driver.member_state, stiffness, mass, rows)
    free = np.flatnonzero(model.free)
    k, m, j = stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], rows[:, free]
    found = modes_of(k, np.linalg.inv(np.linalg.cholesky(m)), j, HELD)
    basis = np.zeros((n, found.basis.shape[1]))
    basis[free] = found.basis
    return Modes(found.matrix, basis, found.scale)
