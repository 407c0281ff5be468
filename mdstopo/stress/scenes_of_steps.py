"""Fixed steps that are far too large, and tolerances at both ends of what double precision gives."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import ADAPTIVE, ENERGY, FULL, ball, error, errors, moved, spring
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case


def swing(end: float, **solver: Any) -> dict[str, Any]:
    """A body on a spring of 100 N/m, 10 rad/s, pulled by 30 N from rest."""
    return {
        "time": {"end": end},
        "bodies": {"ball": ball(1.0)},
        "members": {"spring": spring([0.0, 0.0], "ball", [1.0, 0.0], stiffness=100.0)},
        "loads": [{"body": "ball", "force": [30.0, 0.0]}],
        "design": dict(FULL),
        "objectives": {"G": {**ENERGY["G"], "over_time": "final"}},
        "solver": solver,
    }


def _energy(end: float, alpha: Any) -> Any:
    k = 100.0 * alpha[0]
    return 0.5 * k * (30.0 / k * (1.0 - np.cos(np.sqrt(k) * end))) ** 2


def _swing(end: float, case: "Case") -> float:
    return errors(case, partial(_energy, end))


def pendulum(**solver: Any) -> dict[str, Any]:
    """A rod that swings through 2.6 rad to either side, in 100 of its periods."""
    return {
        "gravity": [0.0, -9.81],
        "time": {"end": 300.0},
        "bodies": {"rod": {"mass": 1.0, "inertia": 0.1, "position": [0.5, 0.8]}},
        "joints": [{"name": "pin", "type": "revolute", "bodies": ["ground", "rod"], "at": [0.0, 0.0]}],
        "solver": solver,
    }


def _pendulum(case: "Case") -> float:
    """Energy at every state."""
    motion = moved(case)
    energy = 0.5 * (motion.v[:, :2] ** 2).sum(axis=1) + 0.05 * motion.v[:, 2] ** 2 + 9.81 * motion.q[:, 1]
    return error(energy, np.full_like(energy, energy[0]))


def whirling(**solver: Any) -> dict[str, Any]:
    """A body thrown round a pole on a stretched spring, five times a second."""
    return {
        "time": {"end": 10.0},
        "bodies": {"ball": ball(1.0, velocity=[0.0, 30.0])},
        "members": {"spring": spring([0.0, 0.0], "ball", [1.0, 0.0], stiffness=1e4)},
        "solver": solver,
    }


def _whirling(case: "Case") -> float:
    """Angular momentum at every state."""
    motion = moved(case)
    q, v = motion.q, motion.v
    moment = q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0]
    return error(moment, np.full_like(moment, 30.0))


def scenes() -> list[Scene]:
    """Scenes that are about steps and tolerances."""
    found = []
    coarse = {"integrator": "generalized_alpha"}
    for name, words, data, measure in (
        ("swing", "one step over five periods of a swing", swing(3.14, step=3.14, **coarse), partial(_swing, 3.14)),
        ("radians", "steps of 20 rad of a swing", swing(30.0, step=2.0, **coarse), partial(_swing, 30.0)),
        ("pendulum", "steps of a period of a rod that swings far", pendulum(step=3.0, **coarse), _pendulum),
        ("whirling", "steps of half a turn about a pole", whirling(step=0.1, **coarse), _whirling),
    ):
        found.append(Scene(f"step-too-large-{name}", words, data, measure, refusal=("step",)))
    found.append(
        Scene(
            "step-too-small",
            "fixed steps of 1e-12 s over a second",
            swing(1.0, step=1e-12, **coarse),
            partial(_swing, 1.0),
            refusal=("solver.step", "steps in 1 s"),
        )
    )
    for integrator in ADAPTIVE:
        tag = integrator.replace("_", "-")
        for tolerance, bound in ((1e-1, 1.0), (1e-3, 1e-2), (1e-13, 1e-12), (1e-17, 1e-12)):
            found.append(
                Scene(
                    f"tolerance-{tolerance:.0e}-{tag}",
                    f"a tolerance of {tolerance:g}: energy and gradient of a swing, within ten of it or 1e-12",
                    swing(1.3, integrator=integrator, tolerance=tolerance),
                    partial(_swing, 1.3),
                    bound=bound,
                )
            )
    return found + [
        Scene(
            f"tolerance-{tolerance:g}",
            f"a tolerance of {tolerance:g}, which nothing can keep or which says nothing",
            swing(1.3, tolerance=tolerance),
            partial(_swing, 1.3),
            refusal=("solver.tolerance", "allowed"),
        )
        for tolerance in (0.0, 2.0)
    ]
