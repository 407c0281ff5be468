"""The response of every objective, over time: for pictures and tables, not for the optimiser."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]


def response_history(engine: "Evaluator", alpha: Floats, load_case: str, times: Floats) -> dict[str, Floats]:
    """g(t) (T,) of each objective of a load case at times (T,) that its motion reaches, by the objective's name.

    Raises ValueError where the motion ends before the last of them.
    """
    motion = engine.trajectory(alpha, load_case)
    if times[-1] > motion.t[-1]:
        raise ValueError(f"the motion in load case {load_case} ends at {motion.t[-1]:g} s: {motion.status.value}")
    names = [objective.name for objective in engine.case.objectives if objective.load_case == load_case]
    design = engine.computed(engine.design(alpha))
    return dict(zip(names, engine.driver(load_case).response_history(design, times), strict=False))
