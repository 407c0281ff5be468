"""What the driver calls of generalized-alpha for general scenes."""

import mdstopo.general.generalized_alpha_duties  # noqa: F401  (enters the method's duties)
from mdstopo.general.direct import follow, push
from mdstopo.general.generalized_alpha import TAG, simulate
from mdstopo.general.look import pull
from mdstopo.general.row_sweep import pull_rows
from mdstopo.general.visit import compare, visit

__all__ = ["TAG", "compare", "follow", "pull", "pull_rows", "push", "simulate", "visit"]
