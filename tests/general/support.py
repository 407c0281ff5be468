"""What the tests of general scenes share."""

from pathlib import Path

import numpy as np

import mdstopo

CASES = Path(__file__).parent / "cases"


def load(name, **overrides):
    """A case of this folder, with overrides of the solver's keys."""
    return mdstopo.load_case(
        CASES / f"{name}.yaml", overrides={f"solver.{key}": str(value) for key, value in overrides.items()}
    )


def design_of(case, seed=0):
    """A random design around the initial one."""
    return np.array(case.initial) * np.random.default_rng(seed).uniform(0.7, 1.3, case.n_design)


def slopes(case, alpha, direction, h):
    """Derivatives of all objectives along a direction, by sixth-order central differences of whole evaluations."""
    total = {}
    for m, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
        for sign in (1.0, -1.0):
            found = mdstopo.evaluate(case, alpha + sign * m * h * direction, gradient=False)
            assert found.status.ok, found.message
            for name, value in found.objectives.items():
                total[name] = total.get(name, 0.0) + sign * weight * value / h
    return total


def check_exact_methods(case, alpha, h=1e-3):
    """Adjoint and direct gradients of a design agree, and are the slopes along one random direction."""
    found = mdstopo.evaluate(case, alpha)
    direct = mdstopo.evaluate(case, alpha, method="direct")
    direction = np.random.default_rng(2).normal(size=case.n_design) * alpha
    differences = slopes(case, alpha, direction, h)
    for name, gradient in found.gradients.items():
        assert abs(differences[name] - gradient @ direction) < 1e-8 * np.abs(gradient * direction).max(), name
        assert np.abs(direct.gradients[name] - gradient).max() < 1e-9 * np.abs(gradient).max(), name


def check_adjoint(case, h, bound):
    """The adjoint gradients of a design are the slopes along two random directions, to a share of the largest part."""
    alpha = design_of(case)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    rng = np.random.default_rng(1)
    for _ in range(2):
        direction = rng.normal(size=case.n_design) * alpha
        for objective, slope in slopes(case, alpha, direction, h).items():
            gradient = found.gradients[objective]
            assert abs(slope - gradient @ direction) <= bound * np.abs(gradient * direction).max(), objective


def check_direct(case):
    """Direct and adjoint gradients of a design agree to 1e-9 of the largest."""
    alpha = design_of(case)
    adjoint, direct = (mdstopo.evaluate(case, alpha, method=method) for method in ("adjoint", "direct"))
    for objective, gradient in adjoint.gradients.items():
        assert np.abs(direct.gradients[objective] - gradient).max() <= 1e-9 * np.abs(gradient).max(), objective


def simulate_text(text, **solver):
    """The trajectory of a case given as text."""
    from mdstopo.case.reader import read_case

    return mdstopo.simulate(read_case(text, overrides={f"solver.{k}": str(v) for k, v in solver.items()}))
