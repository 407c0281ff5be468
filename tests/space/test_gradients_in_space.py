"""Gradients of every response in space through all laws, their windows and the events of slack members."""

from __future__ import annotations

import numpy as np

import mdstopo
from tests.general.support import slopes

from .support import load


def test_gradients_through_all_laws_and_events_are_slopes() -> None:
    case = load("laws")
    rng = np.random.default_rng(3)
    alpha = np.array(case.initial) * rng.uniform(0.7, 1.3, case.n_design)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, alpha, method="direct")
    direction = rng.normal(size=case.n_design) * alpha
    differences = slopes(case, alpha, direction, 1e-3)
    for name, gradient in found.gradients.items():
        size = np.abs(gradient).max()
        assert size > 0.0, name
        assert abs(differences[name] - gradient @ direction) < 3e-8 * np.abs(gradient * direction).max(), name
        assert np.abs(direct.gradients[name] - gradient).max() < 1e-9 * size, name
