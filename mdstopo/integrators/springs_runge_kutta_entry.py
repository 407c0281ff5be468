"""What the driver calls of the explicit Runge-Kutta methods."""

import mdstopo.integrators.springs_runge_kutta_linear  # noqa: F401  (enters the method's functions in the interface's table)
from mdstopo.integrators.springs_runge_kutta import TAG, simulate

__all__ = ["TAG", "simulate"]
