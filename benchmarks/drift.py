"""Energy and momentum of a free, undamped scene over a thousand periods, computed from the states alone."""

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mdstopo import Case, Trajectory, simulate
from mdstopo.bench.tables import Table, verdict
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

PERIODS = 1000
TOLERANCES = (1e-6, 1e-8, 1e-10)
#: integrators in space; tighter ones of the explicit method take more memory than one run may have
IN_SPACE = {"runge_kutta": (1e-4, 1e-6, 1e-8), "gauss": TOLERANCES}


def _corners(centre: tuple[float, float, float], size: float) -> list[list[float]]:
    """Of a cube along the axes (m)."""
    sides = product((-0.5 * size, 0.5 * size), repeat=3)
    return [[c + d for c, d in zip(centre, each, strict=True)] for each in sides]


PLANE: dict[str, Any] = {
    "format": 1,
    "title": "Two bodies on springs, thrown and left alone",
    "bodies": {
        "small": {"mass": 2, "inertia": 0.5, "position": [0, 0], "velocity": [0.3, -0.1], "angular_velocity": 0.4},
        "large": {"mass": 5, "inertia": 2, "position": [1.5, 0.2], "velocity": [-0.2, 0.15], "angular_velocity": -0.3},
    },
    "points": {
        "small_edge": {"body": "small", "grid": {"rectangle": {"center": [0, 0], "size": [0.6, 0.6], "count": 8}}},
        "large_edge": {"body": "large", "grid": {"rectangle": {"center": [1.5, 0.2], "size": [0.8, 0.8], "count": 8}}},
    },
    "members": {"springs": {"from": "small_edge", "to": "large_edge", "law": {"type": "spring", "stiffness": 4}}},
    "design": {"initial": 1},
}
SPACE: dict[str, Any] = {
    "format": 1,
    "dimension": 3,
    "title": "Two bodies in space on springs, thrown and left alone",
    "bodies": {
        "small": {
            "mass": 2,
            "inertia": [[0.5, 0.05, 0], [0.05, 0.4, 0.02], [0, 0.02, 0.3]],
            "position": [0, 0, 0],
            "velocity": [0.3, -0.1, 0.2],
            "angular_velocity": [0.4, -0.2, 0.5],
        },
        "large": {
            "mass": 5,
            "inertia": [2, 1.5, 1],
            "position": [1.5, 0.2, 0.3],
            "orientation": {"axis": [1, 2, 3], "angle": 0.7},
            "velocity": [-0.2, 0.15, -0.1],
            "angular_velocity": [-0.3, 0.1, 0.2],
        },
    },
    "points": {
        "small_edge": {"body": "small", "grid": {"list": _corners((0.0, 0.0, 0.0), 0.6)}},
        "large_edge": {"body": "large", "grid": {"list": _corners((1.5, 0.2, 0.3), 1.2)}},
    },
    "members": PLANE["members"],
    "design": PLANE["design"],
}  # fmt: skip


def drift() -> Iterator[Table]:
    """A table for the plane and for each integrator in space: the largest drift at any time, relative to the start."""
    yield _table(PLANE, "runge_kutta", TOLERANCES, "")
    for integrator, tolerances in IN_SPACE.items():
        yield _table(SPACE, integrator, tolerances, " in space")


def _table(content: Mapping[str, Any], integrator: str, tolerances: Sequence[float], where: str) -> Table:
    """A row a tolerance."""
    period = period_of(content)
    rows, last = [], None
    for tolerance in tolerances:
        found = drifts(case_of(content, PERIODS * period, tolerance, integrator))
        good = found["energy"] <= 1000 * tolerance and found["spin"] <= 1000 * tolerance and found["momentum"] <= 1e-13
        falls = last is None or (found["energy"] < last["energy"] and found["spin"] < last["spin"])
        rows.append(
            [
                f"{tolerance:.0e}",
                *(f"{found[key]:.1e}" for key in ("energy", "spin", "momentum")),
                *([f"{found['quaternions']:.1e}"] if where else []),
                f"{found['steps']:.0f}",
                verdict(good and falls),
            ]
        )
        last = found
    unit = ["quaternions, length"] if where else []
    return Table(
        f"Drift of {integrator}{where} over {PERIODS} periods, unforced and undamped",
        ("tolerance", "energy", "angular momentum", "linear momentum", *unit, "steps", "met"),
        rows,
        (
            f"Periods of the slowest vibration, {period:.2f} s. The bar: energy and angular momentum to 1000 "
            "tolerances, falling with it; linear momentum to 1e-13.",
        ),
    )


def period_of(content: Mapping[str, Any]) -> float:
    """Of the slowest vibration (s)."""
    case = case_of(content, 1.0, 1e-8, "auto")
    omega = Evaluator(case).natural_frequencies(case.initial, "default")
    return float(2.0 * np.pi / min(omega[omega > 1e-3 * omega[-1]]))


def case_of(content: Mapping[str, Any], end: float, tolerance: float, integrator: str) -> Case:
    """A scene until a time (s)."""
    solver = {"integrator": integrator, "tolerance": tolerance}
    return read_case(json.dumps({**content, "time": {"end": float(end)}, "solver": solver}))


def drifts(case: Case) -> Mapping[str, float]:
    """The largest drift of energy, spin (angular momentum) and momentum at any time, relative to the start; that of
    the lengths of quaternions; and the number of steps."""
    motion = simulate(case)
    if not motion.status.ok:
        raise RuntimeError(f"{motion.status.value} {motion.message}")
    seen = _in_space(motion) if case.dimension == 3 else _in_plane(motion)
    places, turns, velocities, rates, lengths = seen
    mass = np.array([body.mass for body in case.bodies])
    inertia = np.array([body.inertia if case.dimension == 3 else np.diag([1, 1, body.inertia]) for body in case.bodies])
    own = np.einsum("tbij,bjk,tblk,tbl->tbi", turns, inertia, turns, rates)
    pushes = mass[:, None] * velocities
    energy = 0.5 * np.einsum("tbi,tbi->t", pushes, velocities) + 0.5 * np.einsum("tbi,tbi->t", own, rates)
    energy += _stored(case, places, turns)
    spin = np.einsum("tbi->ti", own + np.cross(places, pushes))
    momentum = np.einsum("tbi->ti", pushes)
    size = float(np.sum(mass * np.linalg.norm(velocities[0], axis=1)))
    return {
        "energy": float(np.max(np.abs(energy - energy[0])) / abs(energy[0])),
        "spin": float(np.max(np.abs(spin - spin[0])) / np.linalg.norm(spin[0])),
        "momentum": float(np.max(np.abs(momentum - momentum[0])) / size),
        "quaternions": lengths,
        "steps": float(len(motion.t) - 1),
    }


#: places (T, n, 3), turning matrices (T, n, 3, 3), velocities and turning rates (T, n, 3) in global axes of n bodies at
#: T times; by how much the length of a quaternion is not 1 at most
_Seen = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]


def _in_plane(motion: Trajectory) -> _Seen:
    q, v = (x.reshape(len(motion.t), -1, 3) for x in (motion.q, motion.v))
    places, velocities, rates = np.zeros((3, *q.shape))
    places[..., :2], velocities[..., :2], rates[..., 2] = q[..., :2], v[..., :2], v[..., 2]
    angles = np.zeros(q.shape)
    angles[..., 2] = q[..., 2]
    turns = Rotation.from_rotvec(angles.reshape(-1, 3)).as_matrix().reshape(*q.shape, 3)
    return places, turns, velocities, rates, 0.0


def _in_space(motion: Trajectory) -> _Seen:
    q, v = motion.q.reshape(len(motion.t), -1, 7), motion.v.reshape(len(motion.t), -1, 6)
    lengths = np.linalg.norm(q[..., 3:], axis=-1)
    turns = Rotation.from_quat(np.roll(q[..., 3:], -1, axis=-1).reshape(-1, 4)).as_matrix()
    off = float(np.abs(lengths - 1.0).max())
    return q[..., :3], turns.reshape(*lengths.shape, 3, 3), v[..., :3], v[..., 3:], off


def _stored(case: Case, places: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Energy of all springs at T times, from places (T, n, 3) and turning matrices (T, n, 3, 3)."""
    (group,) = case.members
    names = [body.name for body in case.bodies]
    ends = []
    for body, local in ((group.body_from, group.from_local), (group.body_to, group.to_local)):
        k, own = names.index(body), np.zeros((len(local), 3))
        own[:, : local.shape[1]] = local
        ends.append(places[:, k, None] + np.einsum("tij,mj->tmi", turns[:, k], own))
    vectors = ends[1][:, group.to_index] - ends[0][:, group.from_index]
    stretch = np.linalg.norm(vectors, axis=-1) - group.length
    return 0.5 * group.laws[0].stiffness * np.einsum("tm,tm->t", stretch, stretch)
