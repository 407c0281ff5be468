"""Stiffness ratios up to 1e12: a chain of two bodies with a soft and a stiff spring, whose motion is a sum of modes."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import ADAPTIVE, ENERGY, FULL, ball, error, errors, moved, spring
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case


def chain(ratio: float, end: float, apart: float = 0.0, **solver: Any) -> dict[str, Any]:
    """Ground, a spring of 1 N/m, a body, a spring of `ratio` N/m, a body; both are pulled by 1 N from rest.

    apart: N by which they are pulled apart beside that.
    """
    return {
        "time": {"end": end},
        "bodies": {"near": ball(1.0), "far": ball(2.0)},
        "members": {
            "soft": spring([0.0, 0.0], "near", [1.0, 0.0], stiffness=1.0),
            "stiff": {
                "from": {"body": "near", "at": [1.0, 0.0]}, "to": {"body": "far", "at": [2.0, 0.0]},
                "law": {"type": "spring", "stiffness": ratio},
            },
        },
        "loads": [{"body": "near", "force": [1.0 - apart, 0.0]}, {"body": "far", "force": [1.0 + apart, 0.0]}],
        "design": dict(FULL),
        "objectives": {"G": {**ENERGY["G"], "over_time": "final"}},
        "solver": solver,
    }  # fmt: skip


def modes(soft: Any, stiff: Any, t: Any, apart: float = 0.0) -> tuple[Any, Any]:
    """Displacement of the near body and elongation of the stiff spring at t, in closed form without cancellation."""
    trace, determinant = soft + 2.0 * stiff, soft * stiff
    fast = 0.5 * (trace + np.sqrt(trace * trace - 4.0 * determinant))
    near, elongation = 0.0, 0.0
    for square in (determinant / fast, fast):  # the mode (1 - square / stiff, 1)
        first = 1.0 - square / stiff
        work = first + 1.0 + apart * square / stiff
        share = work / (first * first + 1.0) * 2.0 * np.sin(0.5 * np.sqrt(square) * t) ** 2 / square
        near = near + share * first
        elongation = elongation + share * square / stiff
    return near, elongation


def _energy(ratio: float, end: float, apart: float, alpha: Any) -> Any:
    near, elongation = modes(alpha[0], ratio * alpha[1], end, apart)
    return 0.5 * alpha[0] * near**2 + 0.5 * ratio * alpha[1] * elongation**2


def _chain_energy(ratio: float, end: float, apart: float, case: "Case") -> float:
    return errors(case, partial(_energy, ratio, end, apart))


def _chain_motion(ratio: float, case: "Case") -> float:
    motion = moved(case)
    times = np.linspace(0.0, motion.t[-1], 50)[1:]
    near, elongation = modes(1.0, ratio, times)
    q = motion.at(times).q
    return error(q[:, [0, 3]], np.column_stack([1.0 + near, 2.0 + near + elongation]), float(np.abs(near).max()))


def scenes() -> list[Scene]:
    """Energy and gradient with what resolves the fast vibration; the slow motion with what damps it out."""
    found = []
    for integrator in ADAPTIVE:
        for exponent in (4, 8, 12):
            ratio = 10.0**exponent
            apart = 1e-6 * ratio  # it stretches the stiff spring by a micrometre
            end = 2.0 if exponent == 4 else 300.0 / np.sqrt(2.0 * ratio)
            found.append(
                Scene(
                    f"stiffness-1e{exponent}-{integrator.replace('_', '-')}",
                    f"stiffness ratio 1e{exponent}, fast vibration resolved: energy and gradient, modes in closed form",
                    chain(ratio, end, apart, integrator=integrator, tolerance=1e-8),
                    partial(_chain_energy, ratio, end, apart),
                    bound=1e-7,
                )
            )
        found.append(
            Scene(
                f"stiffness-1e12-unstretched-{integrator.replace('_', '-')}",
                "stiffness ratio 1e12, the stiff spring stretched by 1e-12 m only: energy and gradient",
                chain(1e12, 2e-4, integrator=integrator, tolerance=1e-8),
                partial(_chain_energy, 1e12, 2e-4, 0.0),
                bound=1e-7,
            )
        )
        found.append(
            Scene(
                f"stiffness-1e12-slow-{integrator.replace('_', '-')}",
                "stiffness ratio 1e12 over ten slow periods, 1.4e7 fast ones: more steps than a motion may have",
                chain(1e12, 20.0 * np.pi, integrator=integrator, tolerance=1e-8),
                partial(_chain_motion, 1e12),
                refusal=("more steps than it may take", "the fastest body is"),
            )
        )
    return found + [
        Scene(
            f"stiffness-1e{exponent}-slow-generalized-alpha",
            f"stiffness ratio 1e{exponent}, a slow period in 6284 steps that damp the fast vibration out",
            chain(10.0**exponent, 2.0 * np.pi, integrator="generalized_alpha", step=1e-3, spectral_radius=0.5),
            partial(_chain_motion, 10.0**exponent),
            bound=1e-5,
        )
        for exponent in (6, 12)
    ]
