"""What is Gauss collocation's own of the entries for general scenes (`entries`)."""

import mdstopo.general.integrators.gauss_sensitivity  # noqa: F401  (enters the method's functions)
from mdstopo.general.integrators.gauss import TAG, simulate

__all__ = ["TAG", "simulate"]
