"""The tag and the compiled `simulate` of generalized-alpha, for `driver.entries`."""

import mdstopo.general.integrators.generalized_alpha_sensitivity  # noqa: F401  (enters the method's functions)
from mdstopo.general.integrators.generalized_alpha import TAG, simulate

__all__ = ["TAG", "simulate"]
