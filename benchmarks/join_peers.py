"""mdstopo as one more program in a folder of peers: `make(case, **setting)` gives a function of the design.

Imported by that folder's benchmark in its own processes, with this repository on the path.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo import evaluate
from mdstopo.case.reader import read_case

FloatArray = NDArray[np.float64]

_CASE = """
format: 1
time: {{end: {end!r}}}
bodies:
  one: {{mass: {m[0]!r}, inertia: {m[1]!r}, position: {one}}}
  two: {{mass: {m[2]!r}, inertia: {m[3]!r}, position: {two}}}
points:
  p: {{body: one, frame: body, grid: {{list: {p}}}}}
  q: {{body: two, frame: body, grid: {{list: {q}}}}}
members:
  springs: {{from: p, to: q, law: {{type: spring, stiffness: {k!r}}}}}
loads:
  - {{body: one, acceleration: [{a[0]!r}, {a[1]!r}], angular_acceleration: {a[2]!r}}}
  - {{body: two, acceleration: [{a[3]!r}, {a[4]!r}], angular_acceleration: {a[5]!r}}}
objectives:
  G: {{response: energy, over_time: max}}
solver: {{integrator: {integrator}, tolerance: {tolerance!r}}}
"""


def make(
    case: Any, tolerance: float = 1e-8, integrator: str = "auto"
) -> Callable[[FloatArray], tuple[float, FloatArray]]:
    """A function of alpha (N,) that gives G and dG/dalpha (N,).

    case: the peers' own object: m (m1, J1, m2, J2), y0 (x, y, psi of both bodies, velocities; at rest and not
    turned), ext (6,) accelerations that act, P and Q points in body coordinates, stiffness k, end time T; every P is
    joined with every Q.
    """
    start = np.asarray(case.y0, dtype=float)
    if start[[2, 5]].any() or start[6:].any():
        raise ValueError("only bodies at rest that are not turned")
    text = _CASE.format(
        end=float(case.T),
        m=[float(x) for x in case.m],
        one=start[:2].tolist(),
        two=start[3:5].tolist(),
        p=np.asarray(case.P, dtype=float).tolist(),
        q=np.asarray(case.Q, dtype=float).tolist(),
        k=float(case.k),
        a=[float(x) for x in case.ext],
        integrator=integrator,
        tolerance=float(tolerance),
    )
    scene = read_case(text)

    def objective(alpha: FloatArray) -> tuple[float, FloatArray]:
        found = evaluate(scene, alpha)
        if not found.status.ok:
            raise RuntimeError(f"{found.status.value} {found.message}")
        return found.objectives["G"], found.gradients["G"]

    return objective
