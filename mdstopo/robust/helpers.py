"""What a run does more for an uncertain case: other processes for its points, and the conclusion."""

from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.robust.conclusion import Conclusion, conclude
from mdstopo.robust.crew import Crew
from mdstopo.robust.ensemble import Ensemble
from mdstopo.session.engine import Engine
from mdstopo.session.ready import compile_apart


def compile_kinds(engine: Engine, notify: Callable[[str], None]) -> None:
    """Have kernels compiled that only points of the sample need, as `compile_apart` does for the case itself."""
    for case in _ensemble(engine).kinds:
        compile_apart(case, notify)


def employ(engine: Engine, case: Case, workers: int, helpers: ExitStack) -> int:
    """Spread the points over processes, which `helpers` ends; how many processes are left for starts.

    Several starts have the processes for themselves.
    """
    ensemble = _ensemble(engine)
    if workers < 2 or case.optimizer.starts > 1:
        return workers
    crew = Crew(case, len(ensemble.sample), workers)
    helpers.callback(crew.close)
    ensemble.employ(crew)
    return 1


def concluded(engine: Engine, alpha: NDArray[np.float64]) -> Conclusion:
    """What became of the final design alpha (N,)."""
    ensemble = _ensemble(engine)
    return conclude(ensemble, alpha, ensemble.evaluate(alpha, gradient=False), ensemble.crew)


def _ensemble(engine: Engine) -> Ensemble:
    assert isinstance(engine, Ensemble)
    return engine
