"""A peer for tests: one spring of Hooke per member, the energy at the start times a factor that the setting says."""

import numpy as np


def make(problem, factor=1.0, broken=""):
    """As every peer's `make`."""
    if broken == "make":
        raise RuntimeError("cannot be made")

    def objective(alpha, gradient):
        if broken == "end":
            raise SystemExit(3)
        print("a peer may print")
        value = factor * float(np.sum(problem.stiffness * alpha))
        return value, factor * problem.stiffness if gradient else None

    return objective
