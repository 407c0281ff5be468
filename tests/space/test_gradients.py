"""Gradients of every response in space, with joints, loads and damping, against differences and each other."""

from __future__ import annotations

import numpy as np

import mdstopo
from tests.general.support import slopes

from .support import load


def test_gradients_of_all_responses_are_slopes() -> None:
    case = load("linkage")
    rng = np.random.default_rng(3)
    alpha = np.array(case.initial) * rng.uniform(0.7, 1.3, case.n_design)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direction = rng.normal(size=case.n_design) * alpha
    differences = slopes(case, alpha, direction, 2e-3)
    for name, gradient in found.gradients.items():
        size = np.abs(gradient).max()
        if name == "rate":  # highest at the start, whatever the design
            assert size == 0.0
            continue
        assert size > 0.0, name
        assert abs(differences[name] - gradient @ direction) < 1e-8 * np.abs(gradient * direction).max(), name


def test_direct_gradients_of_all_responses_are_the_adjoint_ones() -> None:
    case = load("linkage")
    alpha = np.array(case.initial) * np.random.default_rng(3).uniform(0.7, 1.3, case.n_design)
    found, direct = mdstopo.evaluate(case, alpha), mdstopo.evaluate(case, alpha, method="direct")
    assert found.status.ok, found.message
    for name, gradient in found.gradients.items():
        assert np.abs(direct.gradients[name] - gradient).max() <= 1e-9 * np.abs(gradient).max(), name


def test_gradients_of_springs_alone_are_slopes() -> None:
    case = load("springs")
    rng = np.random.default_rng(4)
    alpha = rng.uniform(0.2, 0.9, case.n_design)
    found = mdstopo.evaluate(case, alpha)
    direction = rng.normal(size=case.n_design) * alpha
    gradient = found.gradients["sway"]
    difference = slopes(case, alpha, direction, 2e-3)["sway"]
    assert abs(difference - gradient @ direction) < 1e-8 * np.abs(gradient * direction).max()
