"""Masses from 1e-6 to 1e6 kg in one scene: chains of springs, and a light link that hangs on a heavy one."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.stress.measuring import INTEGRATORS, error, moved
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case

MASSES = (1e-6, 1.0, 1e6)


def chain(order: tuple[int, ...], end: float, **solver: Any) -> dict[str, Any]:
    """Three free bodies in a row, tied by springs of 1 N/m; the first moves at 0.01 m/s."""
    names = ["first", "second", "third"]
    bodies = {
        name: {"mass": MASSES[i], "inertia": MASSES[i], "position": [float(place), 0.0]}
        for place, (name, i) in enumerate(zip(names, order, strict=True))
    }
    bodies["first"]["velocity"] = [0.01, 0.0]
    return {
        "time": {"end": end},
        "bodies": bodies,
        "members": {
            f"tie{place}": {
                "from": {"body": names[place], "at": [float(place), 0.0]},
                "to": {"body": names[place + 1], "at": [place + 1.0, 0.0]},
                "law": {"type": "spring", "stiffness": 1.0},
            }
            for place in range(2)
        },
        "design": {"initial": 1.0},
        "solver": solver,
    }


def _modes(order: tuple[int, ...], case: "Case") -> float:
    """Against the modes of the chain; displacements relative to each body's largest, momentum to what there is."""
    motion = moved(case)
    times = np.linspace(0.0, motion.t[-1], 40)[1:]
    mass = np.array([MASSES[i] for i in order])
    stiffness = np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    root = np.sqrt(mass)
    squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
    squares[0], vectors[:, 0] = 0.0, root / np.sqrt(mass.sum())  # the row of bodies moves as a whole
    # eigh loses the slow vibration in the rounding of the fast one; the characteristic polynomial does not
    total, product = 1.0 / mass[0] + 2.0 / mass[1] + 1.0 / mass[2], mass.sum() / mass.prod()
    squares[2] = 0.5 * (total + np.sqrt(total * total - 4.0 * product))
    squares[1] = product / squares[2]
    vectors[:, 1] = np.cross(vectors[:, 2], vectors[:, 0])
    start = vectors.T @ (root * [0.01, 0.0, 0.0])
    omega = np.sqrt(squares[1:])
    swing = np.column_stack([times, *(np.sin(w * times) / w for w in omega)]) * start
    expected = swing @ vectors.T / root
    states = motion.at(times)
    shift = states.q[:, 0::3] - [0.0, 1.0, 2.0]
    worst = max(error(shift[:, i], expected[:, i], float(np.abs(expected).max())) for i in range(3))
    momentum = states.v[:, 0::3] @ mass
    return max(worst, error(momentum, np.full(len(times), mass[0] * 0.01)))


def pendulums(**solver: Any) -> dict[str, Any]:
    """A heavy body on a rod of 1 m, released level; a light one hangs on it by another."""
    return {
        "gravity": [0.0, -9.81],
        "time": {"end": 2.0},
        "bodies": {
            "heavy": {"mass": 1e6, "inertia": 1e6, "position": [1.0, 0.0]},
            "light": {"mass": 1e-6, "inertia": 1e-6, "position": [1.0, -1.0]},
        },
        "joints": [
            {"type": "distance", "bodies": ["ground", "heavy"], "at": [[0.0, 0.0], [1.0, 0.0]]},
            {"type": "distance", "bodies": ["heavy", "light"], "at": [[1.0, 0.0], [1.0, -1.0]]},
        ],
        "solver": solver,
    }


def _pendulums(case: "Case") -> float:
    """Angles of both rods, from Lagrange's equations in the two angles."""
    from scipy.integrate import solve_ivp

    motion = moved(case)
    times = np.linspace(0.0, 2.0, 21)
    m1, m2, g = 1e6, 1e-6, 9.81

    def rates(_: float, y: np.ndarray) -> list[float]:
        a, b, u, w = y  # angles from straight down
        c, s = np.cos(a - b), np.sin(a - b)
        matrix = np.array([[m1 + m2, m2 * c], [c, 1.0]])  # the second row is divided by m2
        right = [-m2 * w * w * s - (m1 + m2) * g * np.sin(a), u * u * s - g * np.sin(b)]
        return [u, w, *np.linalg.solve(matrix, right)]

    exact = solve_ivp(rates, (0.0, 2.0), [np.pi / 2, 0.0, 0.0, 0.0], "DOP853", times, rtol=1e-13, atol=1e-13).y
    heavy = np.column_stack([np.sin(exact[0]), -np.cos(exact[0])])
    light = heavy + np.column_stack([np.sin(exact[1]), -np.cos(exact[1])])
    q = motion.at(times).q
    return error(np.column_stack([q[:, 0:2], q[:, 3:5]]), np.column_stack([heavy, light]))


def spun(**solver: Any) -> dict[str, Any]:
    """A body of 1e6 kg and one of 1e-6 kg, tied by an elastic string, turn about each other on a circle."""
    stretch = 1e-6 * 1.0**2 * 1.0  # m r w^2 over k = 1 N/m
    return {
        "time": {"end": 20.0},
        "bodies": {
            "heavy": {"mass": 1e6, "inertia": 1.0, "position": [0.0, 0.0]},
            "light": {"mass": 1e-6, "inertia": 1e-6, "position": [1.0, 0.0], "velocity": [0.0, 1.0]},
        },
        "members": {
            "string": {
                "from": {"body": "heavy", "at": [0.0, 0.0]}, "to": {"body": "light", "at": [1.0, 0.0]},
                "law": {"type": "spring", "stiffness": 1.0, "free_length": 1.0 - stretch},
            }
        },
        "solver": solver,
    }  # fmt: skip


def _spun(case: "Case") -> float:
    """The circle, to which the heavy body's own motion (1e-12 m) adds nothing that counts."""
    motion = moved(case)
    times = np.linspace(0.0, 20.0, 41)
    q = motion.at(times).q
    return error(q[:, 3:5] - q[:, 0:2], np.column_stack([np.cos(times), np.sin(times)]))


def scenes() -> list[Scene]:
    """Every order of the masses with one integrator, one order with the others."""
    found = []
    for order, integrator in (((0, 1, 2), "gauss"), ((2, 0, 1), "gauss"), ((0, 1, 2), "runge_kutta")):
        found.append(
            Scene(
                f"masses-chain-{'-'.join(f'{MASSES[i]:.0e}' for i in order)}-{integrator}".replace("_", "-"),
                f"masses {', '.join(f'{MASSES[i]:g}' for i in order)} kg in a row: modes and total momentum",
                chain(order, 3.0, integrator=integrator, tolerance=1e-9),
                partial(_modes, order),
                bound=1e-8,
            )
        )
    for integrator in INTEGRATORS:
        implicit = integrator == "generalized_alpha"
        found.append(
            Scene(
                f"masses-circle-{integrator}".replace("_", "-"),
                "1e6 and 1e-6 kg turn about each other on a string: the circle",
                spun(integrator=integrator, **({"step": 1e-3} if implicit else {"tolerance": 1e-7})),
                _spun,
                bound=1e-5 if implicit else 1e-6,
            )
        )
    for integrator in ("runge_kutta", "generalized_alpha"):
        solver = {"tolerance": 1e-9} if integrator == "runge_kutta" else {"step": 2.5e-4}
        found.append(
            Scene(
                f"masses-pendulums-{integrator}".replace("_", "-"),
                "a rod with 1e-6 kg hangs on one with 1e6 kg: Lagrange's equations, DOP853 at 1e-13",
                pendulums(integrator=integrator, **solver),
                _pendulums,
                bound=1e-8 if integrator == "runge_kutta" else 1e-5,
            )
        )
    return found
