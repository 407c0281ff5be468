"""Integrals of the stored energy of springs between free bodies: steps fit them, and stay where they did before."""

import numpy as np
import pytest

from mdstopo import evaluate, simulate
from mdstopo.engine import Evaluator
from mdstopo.integrators import integrands
from tests.engine.scenes import random_design, random_scene, read, with_solver

#: a heavy body passes by a weak spring
PASSING = {
    "time": {"end": 1.0},
    "bodies": {"a": {"mass": 1e6, "inertia": 1e6, "position": [0.0, 0.0], "velocity": [5.0, 0.0]}},
    "members": {
        "g": {
            "from": {"body": "ground", "at": [1.5, 0.3]},
            "to": {"body": "a", "at": [0.0, 0.0]},
            "law": {"type": "spring", "stiffness": 1.0},
        }
    },
    "design": {"initial": 1.0},
    "objectives": {"E": {"response": "energy", "over_time": "mean"}},
}


@pytest.mark.parametrize(("method", "damped", "stages"), [
    ("gauss", False, 7), ("gauss", False, 14), ("runge_kutta", False, 17), ("runge_kutta", True, 12),
])  # fmt: skip
def test_terms_are_those_of_legendre(method, damped, stages):
    from mdstopo.integrators.gauss_tables import LEVELS, NODES, gauss_tables
    from mdstopo.integrators.runge_kutta_tables import VECTORS, C, runge_kutta_tables

    rule, used, _ = integrands._rule(method == "gauss", damped, stages)
    nodes = (
        gauss_tables()[LEVELS.index(stages), NODES, 0, :stages]
        if method == "gauss"
        else runge_kutta_tables()[int(damped), VECTORS, C, :stages]
    )
    values = np.polynomial.legendre.legval(2.0 * nodes - 1.0, [0.5, 0.0, -2.0, 1.0])
    assert rule @ values[used] == pytest.approx([0.5, 0.0, -2.0, 1.0, *np.zeros(len(rule) - 4)], abs=1e-12)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_energies_that_the_motion_does_not_feel_are_integrated_to_the_tolerance(integrator):
    found = evaluate(read(PASSING, integrator=integrator))
    exact = evaluate(read(PASSING, integrator="gauss", tolerance=1e-13))
    assert found.objectives["E"] == pytest.approx(exact.objectives["E"], rel=1e-7)
    assert found.gradients["E"] == pytest.approx(exact.gradients["E"], rel=1e-7)
    general = Evaluator(read(PASSING, integrator=integrator), beyond="a check of the kernels that have direct")
    swept, carried = (general.evaluate(np.ones(1), sensitivity=method) for method in ("adjoint", "direct"))
    assert carried.gradients["E"] == pytest.approx(swept.gradients["E"], rel=1e-10)
    assert carried.gradients["E"] == pytest.approx(exact.gradients["E"], rel=1e-7)


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])
def test_integrals_that_were_right_keep_their_bits(integrator, monkeypatch):
    seeds = range(4)
    cases = [read(random_scene(seed, "ground", "off_centre", over_time="mean")) for seed in seeds]
    cases = [with_solver(case, integrator=integrator) for case in cases]
    plain = [evaluate(case, random_design(case, seed)) for seed, case in zip(seeds, cases, strict=True)]
    monkeypatch.setattr(integrands, "LEFT_BY_STEP", 1e-9)  # every step is suspected
    for seed, case, before in zip(seeds, cases, plain, strict=True):
        again = evaluate(with_solver(case), random_design(case, seed))  # compiled anew
        assert again.objectives == before.objectives
        assert np.array_equal(again.gradients["G"], before.gradients["G"])


def test_a_motion_stays_itself_when_a_later_evaluation_lands_elsewhere():
    case, times = read(PASSING, integrator="runge_kutta"), np.linspace(0.01, 0.99, 30)
    motion = simulate(case)
    before = motion.at(times)
    evaluate(case, [0.1])
    after = motion.at(times)
    assert np.array_equal(before.q, after.q)
    assert np.array_equal(before.a, after.a)
