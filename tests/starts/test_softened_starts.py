"""The run with a quarter of the strengths that precedes a softened start."""

import numpy as np

from mdstopo.optimizer.problem import Sample
from mdstopo.settings.optimizer_presets import settings
from mdstopo.starts.single_start import SOFT_ITERATIONS, soften
from tests.optimizer.toys import Toy


class Limited(Toy):
    """A sum that is to be small, and at least `least`, which members with a quarter of their strength cannot reach."""

    competes = True

    def __init__(self, least: float, factor: float = 1.0) -> None:
        super().__init__(lambda x: (np.array([np.sum(x)]), np.ones((1, len(x)))), np.full(4, 0.5), 0.0, 1.0)
        self.least, self.factor = least, factor

    def softened(self, share: float) -> "Limited":
        return Limited(self.least, share)

    def evaluate(self, x, gradient: bool = True) -> Sample:
        level = self.factor * np.sum(x)
        rows, slopes = np.array([level]), np.full((1, len(x)), self.factor)
        return Sample(level, rows, slopes, self.least - rows, -slopes, np.zeros(1, dtype=np.int64))


def test_it_ends_where_so_weak_members_cannot_keep_the_limits() -> None:
    chosen = settings(max_iterations=100)
    weak = soften(chosen, Limited(2.0), None, lambda: False)  # at most 1 with a quarter of the strengths
    assert weak is not None
    assert weak.restoring
    assert weak.iteration < SOFT_ITERATIONS
    strong = soften(chosen, Limited(0.5), None, lambda: False)
    assert strong is not None
    assert not strong.restoring
    assert abs(strong.best_objective - 0.5) < 1e-5
    assert soften(chosen, Limited(2.0), None, lambda: True) is None
