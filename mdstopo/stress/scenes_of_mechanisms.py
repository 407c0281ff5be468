"""Near-singular mechanisms: linkages that pass close by a dead point, that reach it, that repeat or contradict."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import Floats, ball, body, error, moved
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case


def bar(start: list[float], end: list[float], **more: Any) -> dict[str, Any]:
    """A uniform bar of 1 kg between two points, its angle 0 at the start."""
    (x0, y0), (x1, y1) = start, end
    length = float(np.hypot(x1 - x0, y1 - y0))
    return {"mass": 1.0, "inertia": length**2 / 12.0, "position": [(x0 + x1) / 2, (y0 + y1) / 2], **more}


def pin(name: str, first: str, second: str, at: list[float]) -> dict[str, Any]:
    """The entry of a revolute joint in a case."""
    return {"name": name, "type": "revolute", "bodies": [first, second], "at": at}


def four_bar(crank: float, base: float, start: float = 0.0, **solver: Any) -> dict[str, Any]:
    """A crank turned at 1 rad/s from upright, a coupler of 2 m and a rocker of 1 m on a base.

    With a crank of 1 m and a base of 2 m it is a parallelogram, which lies flat after a quarter of a turn.
    start: angle of the crank from upright, at which the rocker is parallel to it.
    """
    tip = [-crank * float(np.sin(start)), crank * float(np.cos(start))]
    place = _rocker(np.array(tip), base, 1.0)
    end = [float(place[0]), float(place[1])]
    parts = (("crank", [0.0, 0.0], tip), ("coupler", tip, end), ("rocker", [base, 0.0], end))
    return {
        "time": {"end": 2.5},
        "bodies": {name: bar(first, second) for name, first, second in parts},
        "joints": [
            pin("O", "ground", "crank", [0.0, 0.0]),
            pin("A", "crank", "coupler", tip),
            pin("B", "coupler", "rocker", end),
            pin("C", "ground", "rocker", [base, 0.0]),
        ],
        "motions": [{"body": "crank", "angle": {"velocity": 1.0}}],
        "solver": {"assemble": True, **solver},
    }


def _rocker(tip: Any, base: float, side: float) -> Any:
    """Where the coupler's circle of 2 m about the crank's tip meets the rocker's of 1 m, on one side."""
    d = np.array([base, 0.0]) - tip
    length = np.hypot(d[0], d[1])
    along = (3.0 + length * length) / (2.0 * length)
    off = side * np.sqrt(max(4.0 - along * along, 0.0))
    return tip + (along * d + off * np.array([-d[1], d[0]])) / length


def _four_bar(crank: float, base: float, crosses: bool, case: "Case") -> float:
    """The coupler's midst by the meeting of two circles.

    A linkage that stays off the flat place keeps its side; a parallelogram crosses there and remains one, because its
    velocities are continuous.
    """
    motion = moved(case)
    times = np.linspace(0.0, 2.5, 51)
    q = motion.at(times).q
    place = body(case, "coupler")
    expected = []
    for t in times:
        tip = crank * np.array([-np.sin(t), np.cos(t)])
        end = tip + np.array([2.0, 0.0]) if crosses else _rocker(tip, base, 1.0)
        expected.append((tip + end) / 2.0)
    return error(q[:, place : place + 2], expected)


def slider(rod: float, **solver: Any) -> dict[str, Any]:
    """A crank of 1 m, turned at 1 rad/s from upright, a rod of `rod` m and a slider on the axis."""
    end = [float(np.sqrt(rod * rod - 1.0)), 0.0] if rod > 1.0 else [0.0, 0.0]
    return {
        "time": {"end": 4.0},
        "bodies": {"crank": bar([0.0, 0.0], [0.0, 1.0]), "rod": bar([0.0, 1.0], end), "slider": ball(*end)},
        "joints": [
            pin("O", "ground", "crank", [0.0, 0.0]),
            pin("A", "crank", "rod", [0.0, 1.0]),
            pin("B", "rod", "slider", end),
            {"name": "guide", "type": "prismatic", "bodies": ["ground", "slider"], "at": end, "axis": [1.0, 0.0]},
        ],
        "motions": [{"body": "crank", "angle": {"velocity": -1.0}}],
        "solver": {"assemble": True, **solver},
    }


def _slider(rod: float, case: "Case") -> float:
    """x = sin t + sqrt(rod^2 - cos^2 t)."""
    motion = moved(case)
    times = np.linspace(0.0, 4.0, 81)
    x = motion.at(times).q[:, body(case, "slider")]
    return error(x, np.sin(times) + np.sqrt(rod * rod - np.cos(times) ** 2))


def door(misfit: float, **solver: Any) -> dict[str, Any]:
    """A swinging door with three hinges on one line seen from above: in the plane, three joints that say the same."""
    hinges = [pin(f"hinge{i}", "ground", "door", [0.0, 0.0]) for i in range(3)]
    if misfit:
        hinges[2]["at"] = {"ground": [0.0, 0.0], "door": [0.0, misfit]}
    return {
        "gravity": [0.0, -9.81],
        "time": {"end": 2.0},
        "bodies": {"door": {"mass": 3.0, "inertia": 0.25, "position": [0.5, 0.0]}},
        "joints": hinges,
        "solver": solver,
    }


def _door(case: "Case") -> float:
    """A pendulum: energy, and the angle by scipy."""
    from scipy.integrate import solve_ivp

    motion = moved(case)
    times = np.linspace(0.0, 2.0, 21)
    pull = 3.0 * 9.81 * 0.5 / (0.25 + 3.0 * 0.25)

    def rates(_: float, y: Floats) -> list[float]:
        return [y[1], -pull * np.cos(y[0])]

    exact = solve_ivp(rates, (0.0, 2.0), [0.0, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13)
    return error(motion.at(times).q[:, 2], exact.y[0])


def scenes() -> list[Scene]:
    """Near misses are right, dead points and contradictions are refused by name."""
    found = []
    solver: dict[str, Any] = {"integrator": "runge_kutta", "tolerance": 1e-9}
    for exponent in (2, 4, 6):
        less = 10.0**-exponent
        found.append(
            Scene(
                f"mechanism-near-parallelogram-1e-{exponent}",
                f"a parallelogram whose crank is shorter by 1e-{exponent} m passes its flat place: meeting of circles",
                four_bar(1.0 - less, 2.0, **solver),
                partial(_four_bar, 1.0 - less, 2.0, False),
                bound=1e-6,
            )
        )
        # the tip is 3 m from the rocker's pin: 1 + b^2 + 2 b sin(t) = 9
        base = 2.0 + less
        when = float(np.arcsin((8.0 - base**2) / (2.0 * base)))
        found.append(
            Scene(
                f"mechanism-dead-point-1e-{exponent}",
                f"a four-bar linkage stretched out at {when:.6g} s, before its crank lies flat",
                four_bar(1.0, base, **solver),
                partial(_four_bar, 1.0, base, False),
                refusal=("singular", "joint", f"at t = {when - 5e-4:.3f}"),
            )
        )
    for exponent in (2, 4, 6):
        rod = 1.0 + 10.0**-exponent
        found.append(
            Scene(
                f"mechanism-slider-1e-{exponent}",
                f"a slider-crank whose rod is longer than the crank by 1e-{exponent} m: closed form",
                slider(rod, **solver),
                partial(_slider, rod),
                bound=1e-6,
            )
        )
    for integrator, more in (("runge_kutta", {"tolerance": 1e-9}), ("generalized_alpha", {"step": 1e-3})):
        tag = integrator.replace("_", "-")
        found += [
            Scene(
                f"mechanism-parallelogram-{tag}",
                "a parallelogram crosses its flat place, where its rocker could turn either way: closed form",
                four_bar(1.0, 2.0, integrator=integrator, **more),
                partial(_four_bar, 1.0, 2.0, True),
                bound=1e-6,
            ),
            Scene(
                f"mechanism-flat-start-{tag}",
                "a parallelogram that begins flat: nothing says which way its rocker turns",
                four_bar(1.0, 2.0, np.pi / 2, integrator=integrator, **more),
                partial(_four_bar, 1.0, 2.0, True),
                refusal=("singular", "joint"),
            ),
        ]
        found.append(
            Scene(
                f"mechanism-door-{tag}",
                "a door on three hinges: a pendulum, scipy at 1e-13",
                door(0.0, integrator=integrator, **more),
                _door,
                bound=1e-8 if integrator == "runge_kutta" else 1e-5,
            )
        )
    found.append(
        Scene(
            "mechanism-door-misfit",
            "a door whose third hinge is a millimetre off",
            door(1e-3),
            _door,
            refusal=("hinge2", "does not fit"),
        )
    )
    return found
