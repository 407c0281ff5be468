"""What the driver calls of the explicit methods for general scenes."""

import mdstopo.general.runge_kutta_duties  # noqa: F401  (enters the method's duties)
from mdstopo.general.direct import follow, push
from mdstopo.general.look import pull
from mdstopo.general.row_sweep import pull_rows
from mdstopo.general.runge_kutta import TAG, simulate
from mdstopo.general.visit import compare, visit

__all__ = ["TAG", "compare", "follow", "pull", "pull_rows", "push", "simulate", "visit"]
