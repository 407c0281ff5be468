"""Rotation vectors since the start of a window (`spatial_windows`), against differences along motions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mdstopo.mechanics.kinematics.spatial import SPATIAL

from .in_python import KERNELS, N, by_numbers, in_python, same, scene, state  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_python")
#: freedoms of the bodies that are no ground
M = N - 6


def of_window(size: float, seed: int = 1) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A model, coordinates at the start of a window, and x, y, u there, with turns of about `size`."""
    random = np.random.default_rng(seed)
    x, y, u = random.normal(size=(3, M))
    for body in range(2):
        turn = x[6 * body + 3 : 6 * body + 6]
        turn *= size / np.linalg.norm(turn)
    return scene(), state()[0], x, y, u


def states(model: Any, q0: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    q, v = q0.copy(), np.zeros(N)
    KERNELS.window_state(model, q0, x, y, q, v)
    return q, v


def accelerations(model: Any, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    a = np.zeros(N)
    KERNELS.window_accelerations(model, x, y, u, a)
    return a


def maps_at(model: Any, x: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    maps = np.zeros((3, KERNELS.window_size(model)))
    KERNELS.window_maps(model, x, y, u, maps)
    return maps


@pytest.mark.parametrize("size", [1e-9, 0.01, 0.7, 2.0, 3.1])
def test_velocities_and_accelerations_are_derivatives_of_the_motion(size: float) -> None:
    model, q0, x, y, u = of_window(size)
    e = 1e-3

    def at(t: float) -> tuple[np.ndarray, np.ndarray]:
        return states(model, q0, x + t * y + 0.5 * t * t * u, y + t * u)

    q, v = at(0.0)

    def difference(after: np.ndarray) -> np.ndarray:
        return SPATIAL.difference(after, q)

    moved = [difference(at(k * e)[0]) - difference(at(-k * e)[0]) for k in (1, 2)]
    same(v, (8.0 * moved[0] - moved[1]) / (12.0 * e))
    sped = [at(k * e)[1] - at(-k * e)[1] for k in (1, 2)]
    a = accelerations(model, x, y, u)
    same(a, (8.0 * sped[0] - sped[1]) / (12.0 * e))
    back = np.zeros(M)
    KERNELS.window_rates(model, x, y, a, back)
    same(back, u, 1e-12)


@pytest.mark.parametrize("size", [1e-9, 0.3, 1.1, 3.0])
def test_slopes_are_those_of_states_and_accelerations(size: float) -> None:
    model, q0, x, y, u = of_window(size)
    maps = maps_at(model, x, y, u)
    q, _ = states(model, q0, x, y)

    def pushed(dx: np.ndarray, dy: np.ndarray) -> np.ndarray:
        out = np.zeros((3, N))
        KERNELS.window_jvp(model, maps, dx, dy, *out)
        return out

    one = np.eye(M)
    none = np.zeros(M)
    by_x = np.stack([pushed(e, none) for e in one], axis=-1)
    by_y = np.stack([pushed(none, e) for e in one], axis=-1)
    same(by_x[0], by_numbers(lambda z: SPATIAL.difference(states(model, q0, z, y)[0], q), x), 1e-8)
    same(by_x[1], by_numbers(lambda z: states(model, q0, z, y)[1], x))
    same(by_x[2], by_numbers(lambda z: accelerations(model, z, y, u), x))
    same(by_y[1], by_numbers(lambda z: states(model, q0, x, z)[1], y))
    same(by_y[2], by_numbers(lambda z: accelerations(model, x, z, u), y))
    turned = np.stack([_turned(model, maps, e, False, False) for e in one], axis=-1)
    same(turned, by_numbers(lambda z: accelerations(model, x, y, z), u)[:M])
    same(turned @ np.stack([_turned(model, maps, e, True, False) for e in one], axis=-1), one, 1e-13)
    same(np.stack([_turned(model, maps, e, False, True) for e in one]), turned, 1e-15)
    same(np.stack([_turned(model, maps, e, True, True) for e in one]) @ turned, one, 1e-13)
    bars = np.random.default_rng(2).normal(size=(3, N))
    bar_x, bar_y = np.zeros((2, M))
    KERNELS.window_vjp(model, maps, *bars, bar_x, bar_y)
    same(bar_x, np.einsum("kn,knm->m", bars, by_x), 1e-13)
    same(bar_y, np.einsum("kn,knm->m", bars, by_y), 1e-13)


def _turned(model: Any, maps: np.ndarray, x: np.ndarray, inverse: bool, transposed: bool) -> np.ndarray:
    out = x.copy()
    KERNELS.window_turn(model, maps, inverse, transposed, out)
    return out


def test_the_start_of_a_window_is_seen_behind_its_turns() -> None:
    model, q0, x, y, _ = of_window(1.2)
    q, _ = states(model, q0, x, y)
    found = np.stack([_start(model, x, e) for e in np.eye(N)[:M]], axis=-1)

    def moved(z: np.ndarray) -> np.ndarray:
        return SPATIAL.difference(states(model, SPATIAL.retract(q0, np.append(z, np.zeros(6))), x, y)[0], q)

    same(found, by_numbers(moved, np.zeros(M))[:N], 1e-8)
    bar = np.random.default_rng(3).normal(size=N)
    back = np.zeros(N)
    KERNELS.window_start_vjp(model, x, bar, back)
    same(back[:M], found.T @ bar, 1e-13)


def _start(model: Any, x: np.ndarray, dq0: np.ndarray) -> np.ndarray:
    out = np.zeros(N)
    KERNELS.window_start_jvp(model, x, dq0, out)
    return out


@pytest.mark.parametrize("coupled", [True, False])
def test_slopes_of_second_derivatives_are_those_of_accelerations_turned(coupled: bool) -> None:
    model, q0, x, y, u = of_window(0.9)
    random = np.random.default_rng(4)
    by_q, by_v = random.normal(size=(2, M, M))
    if not coupled:
        own = np.kron(np.eye(2), np.ones((6, 6)))
        own[:, [0, 1, 2, 6, 7, 8]] = 0.0  # of the turning rates of the body itself
        own[[0, 1, 2, 6, 7, 8]] = 0.0
        by_v *= own
    home, _ = states(model, q0, x, y)
    speed = states(model, q0, x, y)[1][:M]
    push = accelerations(model, x, y, u)[:M]

    def rates(x_now: np.ndarray, y_now: np.ndarray) -> np.ndarray:
        q, v = states(model, q0, x_now, y_now)
        a = np.zeros(N)
        a[:M] = push + by_q @ SPATIAL.difference(q, home)[:M] + by_v @ (v[:M] - speed)
        out = np.zeros(M)
        KERNELS.window_rates(model, x_now, y_now, a, out)
        return out

    maps = maps_at(model, x, y, u)
    by_x, by_y = (np.pad(given, ((0, 0), (0, 4))) for given in (by_q, by_v))  # whole vectors
    KERNELS.window_slopes(model, maps, coupled, by_x, by_y)
    same(by_x[:, :M], by_numbers(lambda z: rates(z, y), x), 1e-8)
    same(by_y[:, :M], by_numbers(lambda z: rates(x, z), y), 1e-8)
    assert not by_x[:, M:].any()
    assert not by_y[:, M:].any()
