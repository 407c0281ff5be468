"""With what order errors fall on a closed loop in space, and what a motion of a thousand periods keeps."""

from __future__ import annotations

import numpy as np
import pytest

from .test_implicit_steps import quantities


def test_joints_in_space_cost_runge_kutta_no_order() -> None:
    exact = quantities(tolerance=1e-12)
    steps = [0.05, 0.04, 0.032, 0.025]
    errors = {name: [] for name in exact}
    for step in steps:
        for name, value in quantities(step=step, integrator="runge_kutta").items():
            errors[name].append(np.abs(value - exact[name]).max())
    for name, error in errors.items():
        assert np.polyfit(np.log(steps), np.log(error), 1)[0] >= 7.5, name


@pytest.mark.parametrize("integrator", ["runge_kutta", "gauss"])
def test_a_thousand_periods_in_space_keep_energy_momenta_and_unit_quaternions(
    integrator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tests.test_project import ROOT

    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.drift import PERIODS, SPACE, case_of, drifts, period_of

    end = PERIODS * period_of(SPACE)
    found = {tolerance: drifts(case_of(SPACE, end, tolerance, integrator)) for tolerance in (1e-5, 1e-8)}
    for tolerance, drift in found.items():
        assert drift["energy"] <= 1000 * tolerance
        assert drift["spin"] <= 1000 * tolerance
        assert drift["momentum"] <= 1e-13
        assert drift["quaternions"] <= 1e-14
    assert found[1e-8]["energy"] < 0.1 * found[1e-5]["energy"]
