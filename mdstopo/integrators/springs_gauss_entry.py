"""What the driver calls of the Gauss method."""

import mdstopo.integrators.springs_gauss_linear  # noqa: F401  (enters the method's functions in the interface's table)
from mdstopo.integrators.springs_gauss import TAG, simulate

__all__ = ["TAG", "simulate"]
