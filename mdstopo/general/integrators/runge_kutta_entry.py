"""What is the explicit methods' own of the entries for general scenes (`entries`)."""

import mdstopo.general.integrators.runge_kutta_sensitivity  # noqa: F401  (enters the method's functions)
from mdstopo.general.integrators.runge_kutta import TAG, simulate

__all__ = ["TAG", "simulate"]
