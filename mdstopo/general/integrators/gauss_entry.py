"""The tag and the compiled `simulate` of Gauss collocation, for `driver.entries`."""

import mdstopo.general.integrators.gauss_sensitivity  # noqa: F401  (enters the method's functions)
from mdstopo.general.integrators.gauss import TAG, simulate

__all__ = ["TAG", "simulate"]
