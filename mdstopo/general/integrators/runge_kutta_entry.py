"""The tag and the compiled `simulate` of the explicit Runge-Kutta methods, for `driver.entries`."""

import mdstopo.general.integrators.runge_kutta_sensitivity  # noqa: F401  (enters the method's functions)
from mdstopo.general.integrators.runge_kutta import TAG, simulate

__all__ = ["TAG", "simulate"]
