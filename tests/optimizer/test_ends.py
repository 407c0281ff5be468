"""Words and numbers at the end of runs that begin or pass where a method is easily misled."""

import numpy as np

from mdstopo.optimizer.driver import Gsao, run
from mdstopo.optimizer.presets import settings
from mdstopo.status import RunStatus
from tests.optimizer.toys import Toy


def ended(problem, **options):
    problem.competes = True
    return run(Gsao(problem, settings(**options)))


def test_a_first_design_that_cannot_be_left_is_judged_by_its_limits() -> None:
    """x <= 1 and x >= 2 from x = 1: no step lowers U or the excess; that no design keeps the limit has to be said."""
    problem = Toy(
        lambda x: (-x, -np.ones((1, 1))), [1.0], 0.0, 1.0, constraints=lambda x: (2.0 - x, -np.ones((1, 1)))
    )
    state = ended(problem)
    assert state.status is RunStatus.FAILED
    assert "no design near this one keeps the limits" in state.reason
