"""References, and errors against them.

A reference is the objective and gradient by the *other* adaptive integrator at a tolerance of 1e-13: what collocation
gives is measured against the explicit Nystroem method and the other way round. The two share the force sums, but
neither steps, stages nor reverse sweeps. How far they agree is part of what is printed.
"""

from benchmarks.scenes import design, scene
from mdstopo.bench.reference import Reference, solution

ADAPTIVE = ("gauss", "runge_kutta")
TIGHTEST = 1e-13


def reference(name: str, design_name: str, integrator: str) -> Reference:
    """The reference for a scene, a design and the integrator that is to be measured."""
    other = "runge_kutta" if integrator != "runge_kutta" else "gauss"
    case = scene(name, integrator=other, tolerance=TIGHTEST)
    return Reference(*solution(case, design(design_name, case.n_design)))


def agreement(name: str, design_name: str) -> float:
    """Relative difference of the two references' gradients, largest entry."""
    one, two = (reference(name, design_name, integrator) for integrator in ADAPTIVE)
    return one.errors(two.value, two.gradient)[1]
