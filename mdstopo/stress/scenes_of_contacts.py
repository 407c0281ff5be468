"""Contacts: several at the same instant, at the start, that only just touch, that reverse."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import FULL, ball, error, errors, moved, spring, valued
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case

GENERAL = ("runge_kutta", "generalized_alpha")


def thrown(count: int, speed: float = 2.0, gap: float = 0.5, end: float = 1.0, **solver: Any) -> dict[str, Any]:
    """A body that flies away from ground until `count` belts of 100 N/m in all become tight at one instant."""
    law = {"type": "gap", "stiffness": 100.0 / count, "gap": gap}
    return {
        "time": {"end": end},
        "bodies": {"ball": ball(1.0, velocity=[speed, 0.0])},
        "points": {"wall": {"body": "ground", "grid": {"list": [[0.0, 0.0]] * count}}},
        "members": {"belts": {"from": "wall", "to": {"body": "ball", "at": [1.0, 0.0]}, "law": law}},
        "design": dict(FULL),
        "objectives": {"G": {"response": "energy", "over_time": "final"}},
        "solver": solver,
    }


def _tight(count: int, speed: float, gap: float, end: float, alpha: Any) -> Any:
    """Energy at the end, while the belts are still tight."""
    k = 100.0 / count * np.sum(alpha)
    return 0.5 * (speed * np.sin(np.sqrt(k) * (end - gap / speed))) ** 2


def _belts(count: int, speed: float, gap: float, end: float, case: "Case") -> float:
    return errors(case, partial(_tight, count, speed, gap, end))


def _there_and_back(case: "Case") -> float:
    """The whole motion: out, half a swing, back at the same speed."""
    motion = moved(case)
    times = np.linspace(0.0, motion.t[-1], 41)
    met, swing = 0.5 / 2.0, np.pi / 10.0
    out = np.where(times < met, 2.0 * times, 0.5 + 0.2 * np.sin(10.0 * (times - met)))
    x = np.where(times > met + swing, 0.5 - 2.0 * (times - met - swing), out)
    return error(motion.at(times).q[:, 0] - 1.0, x, 0.7)


def mirrored(**solver: Any) -> dict[str, Any]:
    """Four bodies flying apart from the middle, whose damped belts become tight at one instant."""
    law = {"type": "gap", "stiffness": 100.0, "damping": 4.0, "gap": 0.5}
    places = {"east": (1.0, 0.0), "north": (0.0, 1.0), "west": (-1.0, 0.0), "south": (0.0, -1.0)}
    return {
        "time": {"end": 0.4},
        "bodies": {name: ball(x, y, velocity=[2.0 * x, 2.0 * y]) for name, (x, y) in places.items()},
        "members": {name: spring([0.0, 0.0], name, [x, y], **law) for name, (x, y) in places.items()},
        "design": dict(FULL),
        "objectives": {"G": {"response": "energy", "over_time": "final"}},
        "solver": solver,
    }


def _mirrored(alpha: Any) -> Any:
    """Four damped half swings."""
    total = 0.0
    for a in alpha:
        decay = 2.0 * a
        rate = np.sqrt(100.0 * a - decay * decay)
        s = 0.4 - 0.25
        total = total + 50.0 * a * (2.0 / rate * np.exp(-decay * s) * np.sin(rate * s)) ** 2
    return total


def _mirrored_errors(case: "Case") -> float:
    return errors(case, _mirrored)


def dropped(restitution: bool, **solver: Any) -> dict[str, Any]:
    """A body dropped on a stiff undamped floor from 1 m; it bounces for 20 s."""
    law = {"type": "gap", "side": "compression", "stiffness": 1e6, "gap": 1.0}
    if restitution:
        law["damping"] = 200.0
    return {
        "gravity": [0.0, -9.81],
        "time": {"end": 20.0},
        "bodies": {"ball": ball(0.0, 10.0)},
        "members": {"floor": spring([0.0, 0.0], "ball", [0.0, 10.0], **law)},
        "solver": solver,
    }


def _bounces(case: "Case") -> float:
    """Energy before and after some twenty contacts, and the time of every flight."""
    motion = moved(case)
    height = motion.q[:, 1] - 9.0
    energy = 0.5 * motion.v[:, 1] ** 2 + 9.81 * height + 0.5e6 * np.minimum(height, 0.0) ** 2
    # flight: two falls of 1 m; contact: the swing about the place where spring and weight balance
    w, fall = 1e3, np.sqrt(2.0 / 9.81)
    speed = np.sqrt(2.0 * 9.81)
    contact = (np.pi + 2.0 * np.arctan(9.81 / (w * speed))) / w
    tops = np.arange(0, int(20.0 / (2.0 * fall + contact)) + 1) * (2.0 * fall + contact)
    return max(error(energy, np.full_like(energy, 9.81)), error(motion.at(tops).q[:, 1], np.full_like(tops, 10.0)))


def settling(**solver: Any) -> dict[str, Any]:
    """As `dropped`, with a floor that takes most of the speed: ever shorter bounces, then rest on the spring."""
    return dropped(True, **solver)


def _settled(case: "Case") -> float:
    """Where it rests: m g / k below the edge."""
    motion = moved(case)
    return error(motion.q[-1, 1], 9.0 - 9.81 / 1e6, 1.0) + float(abs(motion.v[-1, 1]))


def touching(excess: float, **solver: Any) -> dict[str, Any]:
    """A swing of 0.1 m to either side, and a belt that becomes tight at 0.1 m less `excess`."""
    scene = {
        "time": {"end": 2.0},
        "bodies": {"ball": ball(1.0, velocity=[1.0, 0.0])},
        "members": {
            "spring": spring([0.0, 0.0], "ball", [1.0, 0.0], stiffness=100.0),
            "belt": spring([0.0, 0.0], "ball", [1.0, 0.0], type="gap", stiffness=100.0, gap=0.1 - excess),
        },
        "design": dict(FULL),
        "objectives": {"G": {"response": "energy", "over_time": "max"}},
        "solver": solver,
    }
    return scene


def _touching(case: "Case") -> float:
    """All kinetic energy is stored at the turn, whatever stores it."""
    return error(valued(case).objectives["G"], 0.5)


def closed(**solver: Any) -> dict[str, Any]:
    """A belt exactly at its gap at the start, with the body at rest; a load pulls it on."""
    scene = thrown(1, speed=0.0, gap=0.0, end=0.2, **solver)
    scene["loads"] = [{"body": "ball", "force": [3.0, 0.0]}]
    return scene


def _closed(alpha: Any) -> Any:
    k = 100.0 * alpha[0]
    return 0.5 * k * (3.0 / k * (1.0 - np.cos(np.sqrt(k) * 0.2))) ** 2


def _closed_errors(case: "Case") -> float:
    return errors(case, _closed)


def scenes() -> list[Scene]:
    """The scenes, each with every integrator that carries contacts."""
    found = []
    for integrator in GENERAL:
        tag = integrator.replace("_", "-")
        adaptive = integrator == "runge_kutta"
        solver: dict[str, Any] = {"integrator": integrator, **({"tolerance": 1e-9} if adaptive else {"step": 2e-4})}
        bound = 1e-8 if adaptive else 1e-4
        found += [
            Scene(
                f"contacts-{count}-at-once-{tag}",
                f"{count} belts become tight at one instant: energy and gradient of one belt of their sum",
                thrown(count, end=0.35, **solver),
                partial(_belts, count, 2.0, 0.5, 0.35),
                bound=bound,
            )
            for count in (1, 2, 100)
        ]
        found += [
            Scene(
                f"contacts-and-release-{tag}",
                "100 belts become tight and slack again at one instant each: the motion in closed form",
                thrown(100, **solver),
                _there_and_back,
                bound=bound,
            ),
            Scene(
                f"contacts-damped-{tag}",
                "four bodies meet damped belts, whose force jumps, at one instant: energy and gradient",
                mirrored(**solver),
                _mirrored_errors,
                bound=bound,
            ),
            Scene(
                f"contacts-at-the-start-{tag}",
                "a belt exactly at its gap at the start is pulled tight: energy and gradient",
                closed(**solver),
                _closed_errors,
                bound=bound,
            ),
        ]
    solver = {"integrator": "runge_kutta", "tolerance": 1e-10}
    found += [
        Scene(
            "contacts-bouncing",
            "a body bounces on a floor of 1e6 N/m for 20 s: energy and the times of its tops",
            dropped(False, **solver),
            _bounces,
            bound=1e-6,
        ),
        Scene(
            "contacts-settling",
            "the same on a damped floor, ever shorter bounces: it rests where weight and spring balance",
            settling(**solver),
            _settled,
            bound=1e-6,
        ),
    ]
    found += [
        Scene(
            f"contacts-touching-{excess:g}",
            f"a belt is met {excess:g} m before the turn of a swing: energy at the peak",
            touching(excess, **solver),
            _touching,
            bound=1e-8,
        )
        for excess in (1e-3, 1e-9, 0.0, -1e-9)
    ]
    return found
