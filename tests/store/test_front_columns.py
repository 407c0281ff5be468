"""Columns of a front: one row for each point, but for what is known of its ends."""

from typing import Any

import numpy as np
import pytest

from mdstopo.case.model import Case
from mdstopo.store.labels import labels
from mdstopo.store.whole_front import joined


@pytest.fixture
def part() -> dict[str, Any]:
    """A front of as many points as objectives, so that its ends have as many rows as columns of points have."""
    return {
        "weights": np.eye(2),
        "objectives": np.array([[0.0, 1.0], [1.0, 0.0]]),
        "evaluations": np.array([3, 4]),
        "kkt": np.array([1e-8, 1e-7]),
        "status": ["converged", "stalled"],
        "reason": ["a", "b"],
        "ends": np.array([[0.0, 1.0], [1.0, 0.0]]),
        "ideal": np.zeros(2),
        "further/objectives": np.array([[0.4, 0.4]]),
        "further/point": np.array([1]),
        "further/iterate": np.array([5]),
    }


def test_further_points_are_rows_behind_those_that_were_asked_for(part: dict[str, Any]) -> None:
    whole = joined(part, ["G1", "G2"])
    assert whole["objectives"].tolist() == [[0.0, 1.0], [1.0, 0.0], [0.4, 0.4]]
    assert whole["evaluations"].tolist() == [3, 4, 0]
    assert np.isnan(whole["kkt"][2])
    assert whole["status"] == ["converged", "stalled", "visited"]
    assert whole["reason"] == ["a", "b", "iterate 5 on the way to point 1"]


def test_ends_have_no_rows_for_further_points(part: dict[str, Any]) -> None:
    whole = joined(part, ["G1", "G2"])
    assert whole["ends"].tolist() == part["ends"].tolist()
    assert whole["ideal"].tolist() == [0.0, 0.0]


def test_ends_have_no_scale_of_points(part: dict[str, Any], case: Case) -> None:
    datasets = {f"pareto/{name}": value for name, value in part.items() if isinstance(value, np.ndarray)}
    scales = labels(case, datasets).scales
    assert scales["pareto/kkt"] == ("pareto/point",)
    assert scales["pareto/objectives"][0] == "pareto/point"
    assert not {"pareto/ends", "pareto/ideal"} & scales.keys()
