"""Attachment points that coincide, and members whose ends meet on the way."""

from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import (
    ADAPTIVE,
    ENERGY,
    FULL,
    INTEGRATORS,
    Floats,
    ball,
    error,
    errors,
    moved,
    spring,
    valued,
)
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case


def passing(law: dict[str, Any], offset: float = 0.0, **solver: Any) -> dict[str, Any]:
    """A body that flies through the ground end of a member, or past it at `offset`."""
    return {
        "time": {"end": 0.6},
        "bodies": {"ball": ball(1.0, offset, velocity=[-4.0, 0.0])},
        "members": {"through": spring([0.0, 0.0], "ball", [1.0, offset], **law)},
        "design": dict(FULL),
        "objectives": {"G": {**ENERGY["G"], "over_time": "final"}},
        "solver": solver,
    }


def _origin_spring(case: "Case") -> float:
    """f = k L with k = 10: x = cos wt - 4/w sin wt, straight through the origin."""
    motion = moved(case)
    times, w = np.linspace(0.0, 0.6, 31), np.sqrt(10.0)
    return error(motion.at(times).q[:, 0], np.cos(w * times) - 4.0 / w * np.sin(w * times))


def _free_flight(case: "Case") -> float:
    motion = moved(case)
    times = np.linspace(0.0, 0.6, 31)
    return error(motion.at(times).q[:, 0], 1.0 - 4.0 * times)


def _near_miss(offset: float, case: "Case") -> float:
    """A spring of length 1 that is passed at a distance: Newton's law, with short steps where the direction turns."""
    from scipy.integrate import solve_ivp

    motion = moved(case)
    free = np.hypot(1.0, offset)

    def rates(_: float, y: Floats) -> list[float]:
        length = np.hypot(y[0], y[1])
        pull = -10.0 * (length - free) / length
        return [y[2], y[3], pull * y[0], pull * y[1]]

    met = _passes()
    state, found, expected = np.array([1.0, offset, -4.0, 0.0]), [], []
    edges = [0.0, met - 50.0 * offset, met + 50.0 * offset, 0.6] if offset < 1e-3 else [0.0, 0.2, 0.4, 0.6]
    for begin, end in pairwise(edges):
        near = offset < 1e-3 and begin < met < end
        longest = offset / 40.0 if near else np.inf
        state = solve_ivp(
            rates, (begin, end), state, "DOP853", max_step=longest, first_step=longest if near else None,
            rtol=1e-13, atol=1e-15,
        ).y[:, -1]  # fmt: skip
        expected.append(state[:2])
        found.append(motion.at([end]).q[0, :2])
    return error(found, expected)


def _passes() -> float:
    """When a body with x'' = 10 (1 - x), x = 1 and x' = -4 at first, is at x = 0."""
    w = np.sqrt(10.0)
    return float(np.arcsin(w / 4.0) / w)


def _moved(case: "Case") -> float:
    """No motion is right."""
    return float(moved(case).t[-1])


def _refused(case: "Case") -> float:
    """No value is right."""
    return valued(case).objectives["G"]


def doubled(**solver: Any) -> dict[str, Any]:
    """Three members with the same two attachment points; the points of a fourth are passed by the body."""
    members = {f"tie{i}": spring([0.0, 0.0], "ball", [1.0, 0.0], stiffness=40.0 * (i + 1)) for i in range(3)}
    members["passed"] = spring([1.2, 0.0], "other", [1.1, 0.3], stiffness=1.0)
    return {
        "time": {"end": 1.3},
        "bodies": {"ball": ball(1.0), "other": ball(1.1, 0.3)},
        "members": members,
        "loads": [{"body": "ball", "force": [30.0, 0.0]}],
        "design": dict(FULL),
        "objectives": {"G": {**ENERGY["G"], "over_time": "final"}},
        "solver": solver,
    }


def _doubled(alpha: Any) -> Any:
    k = 40.0 * (alpha[0] + 2.0 * alpha[1] + 3.0 * alpha[2])
    elongation = 30.0 / k * (1.0 - np.cos(np.sqrt(k) * 1.3))
    return 0.5 * k * elongation**2


def crossing(**solver: Any) -> dict[str, Any]:
    """Two bodies on springs of their own swing through each other: at times all four attachment points coincide."""
    members = {
        name: {**spring([-2.0, 0.0], name, [x, 0.0], stiffness=9.0, free_length=2.0)}
        for name, x in (("left", -0.5), ("right", 0.5))
    }
    return {
        "time": {"end": 10.0},
        "bodies": {"left": ball(-0.5), "right": ball(0.5)},
        "members": members,
        "solver": solver,
    }


def _crossing(case: "Case") -> float:
    motion = moved(case)
    times = np.linspace(0.0, 10.0, 41)
    swing = 0.5 * np.cos(3.0 * times)
    return error(motion.at(times).q[:, [0, 3]], np.column_stack([-swing, swing]))


def scenes() -> list[Scene]:
    """What has a direction or needs none is right; what has none and carries a force is refused by name."""
    found = []
    pull = {"stiffness": 10.0}
    for integrator in INTEGRATORS:
        solver: dict[str, Any] = {"integrator": integrator, "tolerance": 1e-7}
        tag = integrator.replace("_", "-")
        loose = 1e-5 if integrator == "generalized_alpha" else 1e-6
        found += [
            Scene(
                f"meeting-under-force-{tag}",
                "the ends of a spring meet while it carries 10 N: no direction",
                passing(pull, **solver),
                _refused,
                refusal=("meet", "member 0 of group through"),
            ),
            Scene(
                f"meeting-motion-under-force-{tag}",
                "the motion alone through such a place",
                passing(pull, **solver),
                _moved,
                refusal=("meet", "member 0 of group through"),
            ),
            Scene(
                f"meeting-without-force-{tag}",
                "the ends of a spring of no length meet, where it carries nothing: a straight swing through",
                passing({**pull, "preload": 10.0}, **solver),
                _origin_spring,
                bound=loose,
            ),
            Scene(
                f"meeting-crossing-{tag}",
                "attachment points of two bodies coincide again and again: each swings by itself",
                crossing(**solver),
                _crossing,
                bound=10.0 * loose,
            ),
        ]
    solver = {"integrator": "runge_kutta", "tolerance": 1e-8}
    found += [
        Scene(
            "meeting-slack-rope",
            "the ends of a slack rope meet: free flight",
            passing({"type": "gap", "stiffness": 10.0, "gap": 5.0}, **solver),
            _free_flight,
            bound=1e-9,
        ),
        Scene(
            "meeting-cubic-under-force",
            "the ends of a cubic spring meet while it carries a force",
            passing({"type": "cubic", "stiffness": 1.0, "cubic": 0.1}, **solver),
            _refused,
            refusal=("meet", "member 0 of group through"),
        ),
        Scene(
            "meeting-actuator-under-force",
            "the ends of an actuator meet while it pulls",
            passing({"type": "table", "table": [[0.0, 1.0], [1.0, 2.0]]}, **solver),
            _refused,
            refusal=("meet", "member 0 of group through"),
        ),
        Scene(
            "meeting-at-the-start",
            "a member without length at the start",
            {**passing(pull), "members": {"none": spring([1.0, 0.0], "ball", [1.0, 0.0], stiffness=1.0)}},
            _free_flight,
            refusal=("members.none", "zero length"),
        ),
    ]
    for integrator in ADAPTIVE:
        tag = integrator.replace("_", "-")
        found.append(
            Scene(
                f"meeting-coincident-{tag}",
                "three members with the same attachment points: energy and gradient of one spring with their sum",
                doubled(integrator=integrator, tolerance=1e-9),
                _doubled_errors,
                bound=1e-8,
            )
        )
        for exponent in (2, 4, 6, 8):
            offset = 10.0**-exponent
            found.append(
                Scene(
                    f"meeting-near-miss-1e-{exponent}-{tag}",
                    f"a stretched spring is passed at {offset:g} m: polar coordinates, scipy at 1e-13",
                    passing(pull, offset, integrator=integrator, tolerance=1e-9),
                    partial(_near_miss, offset),
                    bound=3e-8,
                )
            )
    return found


def _doubled_errors(case: "Case") -> float:
    return errors(case, _doubled)
