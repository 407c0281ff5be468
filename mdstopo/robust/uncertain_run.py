"""What a run does more for an uncertain case: other processes for its points, and the conclusion."""

from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.robust.conclusion import Conclusion, conclude
from mdstopo.robust.ensemble import Ensemble
from mdstopo.robust.points_in_workers import PointWorkers
from mdstopo.starts.evaluator_interface import Engine


def kinds(engine: Engine) -> list[Case]:
    """Cases at points of the sample that need other kernels than the case itself, one of each kind."""
    return _ensemble(engine).kinds


def spread(engine: Engine, case: Case, workers: int, helpers: ExitStack, notify: Callable[[str], None]) -> int:
    """Distribute the points over processes, which `helpers` ends. Returns how many processes are left for starts.

    Several starts have the processes for themselves.
    """
    ensemble = _ensemble(engine)
    if workers < 2 or case.optimizer.starts > 1:
        return workers
    others = PointWorkers(case, len(ensemble.sample), workers, notify)
    helpers.callback(others.close)
    ensemble.spread(others)
    return 1


def concluded(engine: Engine, alpha: NDArray[np.float64]) -> Conclusion:
    """The results of the final design alpha (N,) on the nominal case, its sample and a fresh one."""
    ensemble = _ensemble(engine)
    return conclude(ensemble, alpha, ensemble.evaluate(alpha, gradient=False), ensemble.workers)


def _ensemble(engine: Engine) -> Ensemble:
    assert isinstance(engine, Ensemble)
    return engine
