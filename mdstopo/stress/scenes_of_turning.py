"""Thousands of turns: angles count on, joints stay together, circles stay circles."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import ADAPTIVE, ball, error, moved, spring, valued
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case

TURNS = 3000
ROUND = 2.0 * np.pi


def circle(**solver: Any) -> dict[str, Any]:
    """A body on a stretched spring about a fixed point, on the circle where tension is what the turn needs."""
    return {
        "time": {"end": TURNS * ROUND},
        "bodies": {"ball": ball(1.0, velocity=[0.0, 1.0], angular_velocity=1.0)},
        "members": {"string": spring([0.0, 0.0], "ball", [1.0, 0.0], stiffness=4.0, free_length=0.75)},
        "solver": solver,
    }


def _circle(case: "Case") -> float:
    motion = moved(case)
    times = ROUND * TURNS * np.linspace(0.0, 1.0, 101)
    q = motion.at(times).q
    turned = error(q[:, 2], times)
    return max(turned, error(q[:, 0:2], np.column_stack([np.cos(times), np.sin(times)])))


def wheel(turns: int, **solver: Any) -> dict[str, Any]:
    """A wheel on a pin that turns at 50 rad/s, with a weight fixed to it off the centre; no gravity."""
    return {
        "time": {"end": turns * ROUND / 50.0},
        "bodies": {
            "wheel": ball(0.0, angular_velocity=50.0),
            "weight": {
                "mass": 2.0, "inertia": 0.5, "position": [0.3, 0.0], "velocity": [0.0, 15.0], "angular_velocity": 50.0
            },
        },
        "joints": [
            {"name": "pin", "type": "revolute", "bodies": ["ground", "wheel"], "at": [0.0, 0.0]},
            {"name": "rim", "type": "fixed", "bodies": ["wheel", "weight"], "at": [0.3, 0.0]},
        ],
        "solver": solver,
    }  # fmt: skip


def _wheel(turns: int, case: "Case") -> float:
    """The angle, the pin's place and the centripetal force m r w^2."""
    motion = moved(case)
    drift = float(np.abs(motion.q[:, 0:2]).max())
    force = np.hypot(*motion.reactions["pin"][:, :2].T)
    return max(
        drift,
        error(motion.q[-1, [2, 5]], np.full(2, turns * ROUND)),
        error(force, np.full_like(force, 2.0 * 0.3 * 50.0**2)),
    )


def rotor(mass: float, drive: bool, turns: float, over_time: str, **solver: Any) -> dict[str, Any]:
    """A body that turns at 1000 rad/s, free or driven, and stretches a weak spring whose end is off its centre."""
    speed = 1000.0
    scene: dict[str, Any] = {
        "time": {"end": turns * ROUND / speed},
        "bodies": {"rotor": {"mass": mass, "inertia": mass, "position": [0.0, 0.0]}},
        "members": {"spring": spring([2.0, 0.0], "rotor", [1.0, 0.0], stiffness=3.0)},
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": "energy", "over_time": over_time}},
        "solver": solver,
    }
    if drive:
        still = {"velocity": 0.0}
        scene["motions"] = [{"body": "rotor", "x": still, "y": still, "angle": {"velocity": speed}}]
    else:
        scene["bodies"]["rotor"]["angular_velocity"] = speed
    return scene


def _mean(case: "Case") -> float:
    """Mean stored energy over whole turns, by the trapezoidal rule, which is exact for what is periodic and smooth."""
    angle = ROUND * np.arange(4000) / 4000
    elongation = np.sqrt(5.0 - 4.0 * np.cos(angle)) - 1.0
    return _value(case, float(np.mean(1.5 * elongation**2)))


def _largest(case: "Case") -> float:
    """The energy half a turn on: an elongation of 2 m."""
    return _value(case, 6.0)


def _value(case: "Case", exact: float) -> float:
    found = valued(case)
    return max(error(found.objectives["G"], exact), error(found.gradients["G"], [exact]))


def scenes() -> list[Scene]:
    """Scenes whose bodies turn many times: free, jointed and driven ones."""
    found = [
        Scene(
            f"turns-circle-{integrator}".replace("_", "-"),
            f"a body on a string turns {TURNS} times: the circle and the angle",
            circle(integrator=integrator, tolerance=1e-11),
            _circle,
            bound=1e-6,
        )
        for integrator in ADAPTIVE
    ]
    for integrator, turns, solver in (
        ("runge_kutta", 2000, {"tolerance": 1e-9}),
        ("generalized_alpha", 50, {"step": 1e-4}),
    ):
        found.append(
            Scene(
                f"turns-wheel-{integrator}".replace("_", "-"),
                f"a wheel on a pin with a weight fixed to it turns {turns} times: angle, pin and centripetal force",
                wheel(turns, integrator=integrator, **solver),
                partial(_wheel, turns),
                bound=1e-6 if integrator == "runge_kutta" else 5e-5,
            )
        )
    for name, words, drive, integrator in (
        ("driven", "a driven rotor", True, "runge_kutta"),
        ("driven-generalized-alpha", "a driven rotor", True, "generalized_alpha"),
        ("flywheel-gauss", "a flywheel of 1e12 kg m2", False, "gauss"),
        ("flywheel-runge-kutta", "a flywheel of 1e12 kg m2", False, "runge_kutta"),
        ("flywheel-generalized-alpha", "a flywheel of 1e12 kg m2", False, "generalized_alpha"),
    ):
        implicit = integrator == "generalized_alpha"
        tolerance = 1e-4 if implicit else 1e-8
        turns = 30 if implicit else 3000
        found += [
            Scene(
                f"turns-{name}-{over_time}",
                f"{words} stretches a weak spring in {turns} turns: {over_time} energy and gradient",
                rotor(1e12, drive, turns, over_time, integrator=integrator, tolerance=tolerance),
                _mean if over_time == "mean" else _largest,
                bound=10.0 * tolerance,
            )
            for over_time in ("mean", "max")
        ]
    return found
