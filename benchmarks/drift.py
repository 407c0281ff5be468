"""Energy and momentum of a free, undamped scene over a thousand periods, computed from the states alone."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case, simulate
from mdstopo.bench.tables import Table, verdict
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

PERIODS = 1000
TOLERANCES = (1e-6, 1e-8, 1e-10)

_CASE = """
format: 1
title: Two bodies on springs, thrown and left alone
time: {{end: {end!r}}}
bodies:
  small: {{mass: 2, inertia: 0.5, position: [0, 0], velocity: [0.3, -0.1], angular_velocity: 0.4}}
  large: {{mass: 5, inertia: 2, position: [1.5, 0.2], velocity: [-0.2, 0.15], angular_velocity: -0.3}}
points:
  small_edge: {{body: small, grid: {{rectangle: {{center: [0, 0], size: [0.6, 0.6], count: 8}}}}}}
  large_edge: {{body: large, grid: {{rectangle: {{center: [1.5, 0.2], size: [0.8, 0.8], count: 8}}}}}}
members:
  springs: {{from: small_edge, to: large_edge, law: {{type: spring, stiffness: 4}}}}
design: {{initial: 1}}
solver: {{integrator: runge_kutta, tolerance: {tolerance!r}}}
"""


def drift() -> Table:
    """One table: the largest drift at any time, relative to the start, a row a tolerance."""
    period = 2.0 * np.pi / float(min(_frequencies(_case(1.0, 1e-8))))
    rows, last = [], None
    for tolerance in TOLERANCES:
        found = _drifts(_case(PERIODS * period, tolerance))
        good = found["energy"] <= 1000 * tolerance and found["spin"] <= 1000 * tolerance and found["momentum"] <= 1e-13
        falls = last is None or (found["energy"] < last["energy"] and found["spin"] < last["spin"])
        rows.append(
            [
                f"{tolerance:.0e}",
                *(f"{found[key]:.1e}" for key in ("energy", "spin", "momentum")),
                f"{found['steps']:.0f}",
                verdict(good and falls),
            ]
        )
        last = found
    return Table(
        f"Drift of runge_kutta over {PERIODS} periods, unforced and undamped",
        ("tolerance", "energy", "angular momentum", "linear momentum", "steps", "met"),
        rows,
        (
            f"Periods of the slowest vibration, {period:.2f} s. The bar: energy and angular momentum to 1000 "
            "tolerances, falling with it; linear momentum to 1e-13.",
        ),
    )


def _case(end: float, tolerance: float) -> Case:
    return read_case(_CASE.format(end=float(end), tolerance=tolerance))


def _frequencies(case: Case) -> NDArray[np.float64]:
    omega = Evaluator(case).natural_frequencies(case.initial, "default")
    return omega[omega > 1e-3 * omega[-1]]


def _drifts(case: Case) -> Mapping[str, float]:
    motion = simulate(case)
    if not motion.status.ok:
        raise RuntimeError(f"{motion.status.value} {motion.message}")
    mass = np.array([body.mass for body in case.bodies])
    inertia = np.array([body.inertia for body in case.bodies])
    q, v = motion.q.reshape(len(motion.t), -1, 3), motion.v.reshape(len(motion.t), -1, 3)
    kinetic = 0.5 * np.einsum("b,tbi,tbi->t", mass, v[..., :2], v[..., :2])
    kinetic += 0.5 * np.einsum("b,tb,tb->t", inertia, v[..., 2], v[..., 2])
    energy = kinetic + _stored(case, q)
    spin = np.einsum("b,tb->t", inertia, v[..., 2])
    spin += np.einsum("b,tb->t", mass, q[..., 0] * v[..., 1] - q[..., 1] * v[..., 0])
    momentum = np.einsum("b,tbi->ti", mass, v[..., :2])
    size = float(np.sum(mass * np.hypot(v[0, :, 0], v[0, :, 1])))
    return {
        "energy": float(np.max(np.abs(energy - energy[0])) / abs(energy[0])),
        "spin": float(np.max(np.abs(spin - spin[0])) / abs(spin[0])),
        "momentum": float(np.max(np.abs(momentum - momentum[0])) / size),
        "steps": float(len(motion.t) - 1),
    }


def _stored(case: Case, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Energy of all springs at T times: q (T, n_bodies, 3)."""
    (group,) = case.members
    names = [body.name for body in case.bodies]
    ends = []
    for body, local in ((group.body_from, group.from_local), (group.body_to, group.to_local)):
        pose = q[:, names.index(body)]
        c, s = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
        x, y = local.T
        ends.append((pose[:, :1] + c * x - s * y, pose[:, 1:2] + s * x + c * y))
    (px, py), (qx, qy) = ends
    i, j = group.from_index, group.to_index
    stretch = np.hypot(qx[:, j] - px[:, i], qy[:, j] - py[:, i]) - group.length
    return 0.5 * group.laws[0].stiffness * np.einsum("tm,tm->t", stretch, stretch)
