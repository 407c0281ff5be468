"""What is generalized-alpha's own of the entries for general scenes (`entries`)."""

import mdstopo.general.integrators.generalized_alpha_sensitivity  # noqa: F401  (enters the method's functions)
from mdstopo.general.integrators.generalized_alpha import TAG, simulate

__all__ = ["TAG", "simulate"]
