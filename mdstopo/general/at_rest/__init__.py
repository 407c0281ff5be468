"""Where a motion starts: its equilibrium, what counts from there, and small motion about it."""
