"""With what order errors fall on a closed loop in space, and what a long motion keeps."""

from __future__ import annotations

import numpy as np
import pytest

from .test_implicit_steps import quantities


def test_joints_in_space_cost_runge_kutta_no_order() -> None:
    exact = quantities(tolerance=1e-12)
    steps = [0.1, 0.08, 0.05, 0.04]  # errors of shorter ones are near rounding
    errors = {name: [] for name in exact}
    for step in steps:
        for name, value in quantities(step=step, integrator="runge_kutta").items():
            errors[name].append(np.abs(value - exact[name]).max())
    for name, error in errors.items():
        assert np.polyfit(np.log(steps), np.log(error), 1)[0] >= 7.5, name


@pytest.mark.parametrize(("integrator", "periods"), [("runge_kutta", 50), ("gauss", 1000)])
def test_a_long_motion_in_space_keeps_energy_momenta_and_unit_quaternions(
    integrator: str, periods: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thousand periods of the explicit method are too many for a test; `benchmarks.drift` has them."""
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.drift import SPACE, case_of, drifts, period_of

    end = periods * period_of(SPACE)
    found = {tolerance: drifts(case_of(SPACE, end, tolerance, integrator)) for tolerance in (1e-5, 1e-8)}
    for tolerance, drift in found.items():
        assert drift["energy"] <= periods * tolerance
        assert drift["spin"] <= periods * tolerance
        assert drift["momentum"] <= 1e-13
        assert drift["quaternions"] <= 1e-14
    assert found[1e-8]["energy"] < 0.1 * found[1e-5]["energy"]
