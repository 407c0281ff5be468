"""Published and closed-form problems in space, to the digits that these have.

Numbers marked (i) were computed by an independent integrator in absolute coordinates and unit quaternions, at two
tolerances down to 1e-13; they agree with the published ones to the digits that these have.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk, ellipkinc

import mdstopo
from mdstopo.integrators.trajectory import Trajectory
from mdstopo.status import Status

HERE = Path(__file__).parent


@cache
def motion(name: str, *overrides: tuple[str, object]) -> Trajectory:
    """The motion of a case of this folder at a tolerance of 1e-11."""
    case = mdstopo.load_case(HERE / f"{name}.yaml", overrides={"solver.tolerance": 1e-11, **dict(overrides)})
    trajectory = mdstopo.simulate(case)
    assert trajectory.status is Status.OK, trajectory.message
    return trajectory


def turns(q: np.ndarray) -> Rotation:
    """Attitudes from quaternions (..., 4), w first."""
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (1.0, [0.17334396410, 0.64008859207, -0.74849079113]),
        (
            2.0,
            [
                *(-0.15041682275, -0.72416559164, -0.67302226956),
                *(0.12294713504, -0.49107989255, 0.35043003034, -0.78798688755),
            ],
        ),
    ],
)  # fmt: skip
def test_heavy_top(time: float, expected: list[float]) -> None:
    """Eleven digits (i); the CSV file of kynema-fmb has seven."""
    q = motion("heavy_top").at([time]).q[0]
    assert q[: len(expected)] == pytest.approx(expected, abs=2e-11)
    assert np.linalg.norm(q[3:]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (1.0, [0.51050146119, -1.64916759939, 0.14012311456]),
        (2.0, [-0.96934034478, -1.22124689496, 0.75427801079]),
    ],
)
def test_bricards_mechanism(time: float, expected: list[float]) -> None:
    """The corner that stands at (1, -1, 1) at the start, eleven digits (i); one row of its joints is redundant."""
    q = motion("bricard").at([time]).q[0].reshape(5, 7)[2]
    assert q[:3] + turns(q[3:]).apply([0.0, 0.0, 0.5]) == pytest.approx(expected, abs=2e-11)


def test_energy_of_bricards_mechanism() -> None:
    """IFToMM's criterion for A04 is the drift of the energy."""
    trajectory = motion("bricard")
    q, v = (x.reshape(len(x), 5, -1) for x in (trajectory.q, trajectory.v))
    kinetic = 0.5 * np.sum(v[..., :3] ** 2, axis=(1, 2))
    for body, axis in enumerate((0, 1, 2, 0, 1)):
        inertia = np.full(3, 1.01 / 12.0)
        inertia[axis] = 0.02 / 12.0
        own = turns(q[:, body, 3:]).inv().apply(v[:, body, 3:])
        kinetic += 0.5 * np.sum(inertia * own**2, axis=1)
    energy = kinetic + 9.81 * q[:, :, 1].sum(axis=1)
    assert np.ptp(energy) < 1e-9 * kinetic.max()


@pytest.mark.parametrize(
    ("start", "period"), [([1.0, 1.0, 1.0], 6.422703084225694), ([0.1, 2.0, 0.1], 13.953031879087)]
)
def test_a_body_without_forces_turns_as_jacobi_says(start: list[float], period: float) -> None:
    """Turning rates in the body's own axes by Jacobi's functions; the second start is near the separatrix.

    With 2 E > L^2 / J_2 (else axes 1 and 3 change places) w_2 is a sn, w_1 a cn and w_3 a dn.
    """
    inertia = np.array([1.0, 2.0, 3.0])
    trajectory = motion("free_body", ("bodies.body.angular_velocity", str(start)))
    times = np.linspace(0.0, 20.0, 41)
    states = trajectory.at(times)
    own = turns(states.q[:, 3:]).inv().apply(states.v[:, 3:])
    energy, square = 0.5 * np.sum(inertia * np.array(start) ** 2), np.sum((inertia * np.array(start)) ** 2)
    one, three = (0, 2) if square > 2.0 * energy * inertia[1] else (2, 0)
    a, b, c = inertia[[one, 1, three]]
    largest = np.array(
        [
            np.sqrt((2.0 * energy * c - square) / (a * (c - a))),
            np.sqrt((2.0 * energy * c - square) / (b * (c - b))),
            np.sqrt((square - 2.0 * energy * a) / (c * (c - a))),
        ]
    )
    rate = np.sqrt((c - b) * (square - 2.0 * energy * a) / (a * b * c))
    modulus = (b - a) * (2.0 * energy * c - square) / ((c - b) * (square - 2.0 * energy * a))
    assert 4.0 * ellipk(modulus) / rate == pytest.approx(period, rel=1e-12)
    ratios = np.abs(own) / largest[np.argsort([one, 1, three])]
    sn, cn, dn, _ = ellipj(rate * times + _phase(start, largest, one, modulus), modulus)
    assert ratios[:, 1] == pytest.approx(np.abs(sn), abs=2e-9)
    assert ratios[:, one] == pytest.approx(np.abs(cn), abs=2e-9)
    assert ratios[:, three] == pytest.approx(np.abs(dn), abs=2e-9)
    moment = turns(states.q[:, 3:]).apply(inertia * own)
    assert np.abs(moment - inertia * start).max() < 1e-10 * np.sqrt(square)


def _phase(start: list[float], largest: np.ndarray, one: int, modulus: float) -> float:
    """The argument of Jacobi's functions at the start, where the third rate, dn, is positive."""
    return float(ellipkinc(np.arctan2(start[1] / largest[1], start[one] / largest[0]), modulus))


def test_a_pendulum_on_a_spherical_joint() -> None:
    """Ten digits (i); the published files, by ADAMS, are good to 1e-3."""
    q = motion("spherical_pendulum").at([5.0]).q[0]
    assert [q[0] - 1.0, q[2] - 3.0] == pytest.approx([-1.9996838689, -0.0355587475], abs=2e-10)


def test_a_universal_joint_passes_speed_on_as_its_angle_says() -> None:
    """cos beta / (1 - sin^2 beta cos^2 theta), with a heavy first shaft, which turns evenly, and a second without mass.

    At the start the first shaft's fork lies in the plane of both shafts, where the ratio is 1 / cos beta.
    """
    trajectory = motion("universal_joint")
    times = np.linspace(0.0, 2.0, 21)
    v = trajectory.at(times).v.reshape(-1, 2, 6)
    beta, theta = np.pi / 6.0, 2.0 * times
    ratio = np.cos(beta) / (1.0 - np.sin(beta) ** 2 * np.cos(theta) ** 2)
    along = v[:, 1, 3:] @ [np.cos(beta), np.sin(beta), 0.0]
    assert along / 2.0 == pytest.approx(ratio, rel=1e-9)
