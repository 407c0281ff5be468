"""A violation is small only if it is small in both measures: relative to the bound, and as a change of a variable."""

import numpy as np
import pytest

from mdstopo.optimizer.problem import Sample
from mdstopo.optimizer.violations import scaled_violation


@pytest.mark.parametrize(("slope", "found"), [(10.0, 2e-6), (1.0, 2e-6), (0.1, 2e-5), (0.0, 2e-6)])
def test_the_larger_of_both_measures_counts(slope: float, found: float) -> None:
    rows, slopes = np.array([-1.0, 2e-6]), np.array([[1.0, 0.0], [0.0, -slope]])
    sample = Sample(1.0, np.ones(1), np.ones((1, 2)), rows, slopes)
    assert scaled_violation(sample) == pytest.approx(found)


def test_without_limits_there_is_no_violation() -> None:
    assert scaled_violation(Sample(1.0, np.ones(1), np.ones((1, 2)))) == 0.0
