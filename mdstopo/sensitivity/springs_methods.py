"""The methods beside the adjoint one: they differentiate the rows that a driver has found (`case.sensitivities`).

`direct` and `iterative` go through the driver's own steps again; `constant_load` needs only the poses at the times of
the rows.
"""

from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.case.integrators import having
from mdstopo.case.sensitivities import SENSITIVITIES
from mdstopo.integrators.scene_driver import Differentiated, ResponseResult
from mdstopo.integrators.steps import OK, status_of
from mdstopo.scene.springs_model import FloatArray
from mdstopo.sensitivity.reductions import INTEGRAL, MEAN
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.integrators.driver import Driver

#: nodes of the rule by which constant_load forms a mean or an integral over time
NODES = 201

FALLBACK = "the sweeps of the iterative method do not contract at t = {:.6g} s; direct was taken instead"


def differentiate(method: str, driver: "Driver", alpha: FloatArray, result: ResponseResult) -> Differentiated:
    """Gradients of the rows that `driver.evaluate(alpha, ...)` found, by a method that is no part of that call.

    alpha: (N,). Counts are added to `driver.work`. Raises ValueError for any other name, and for a method that is not
    defined on the integrator's steps.
    """
    kind = SENSITIVITIES.get(method)
    if kind is None or kind.comes_with_values:
        raise ValueError(f"no sensitivity method {method!r} here")
    if kind.steps and not getattr(driver.method.kind, kind.steps):
        raise ValueError(f"the {method} method is defined on the steps of {', '.join(having(kind.steps))}")
    found: Differentiated = resolve_name(kind.springs)(driver, alpha, result)
    return found


def by_direct(driver: "Driver", alpha: FloatArray, result: ResponseResult) -> Differentiated:
    """Gradients carried forward with the motion, as of `differentiate`."""
    status, count = _run_again(driver, alpha)
    gradients = np.zeros_like(result.gradients)
    if status is Status.OK:
        _carry(driver, result, count, gradients)
    return Differentiated(status, "", gradients)


def by_iterative(driver: "Driver", alpha: FloatArray, result: ResponseResult) -> Differentiated:
    """The same by fixed-point sweeps over implicit steps; by `direct` where these do not contract, which is told."""
    from mdstopo.sensitivity.springs_iterative import iterative

    status, count = _run_again(driver, alpha)
    gradients = np.zeros_like(result.gradients)
    if status is not Status.OK:
        return Differentiated(status, "", gradients)
    stopped = iterative(*_arguments(driver, result, count, gradients, driver.work))
    if stopped < 0:
        return Differentiated(Status.OK, "", gradients)
    message = FALLBACK.format(float(driver.room[stopped]))
    _carry(driver, result, count, gradients)
    return Differentiated(Status.OK, message, gradients)


def _run_again(driver: "Driver", alpha: FloatArray) -> tuple[Status, int]:
    """Simulate again, with the tangents that a run for values leaves out; its work is added to what was counted.

    Returns its status and how many steps it took.
    """
    before = driver.work.copy()
    code, count, _ = driver.run(alpha, True)
    driver.work += before
    return Status.OK if code == OK else status_of(code), count


def _arguments(
    driver: "Driver", result: ResponseResult, count: int, gradients: FloatArray, *more: Any
) -> tuple[Any, ...]:
    """The arguments of a compiled entry, which fills the gradients; more: those behind what all of them begin with."""
    # the driver's own array of alpha: another one might be read-only, which would be another compilation
    return (
        driver.entry.TAG, driver.packed.ints, driver.packed.floats, driver.method.tables, driver._alpha,
        driver.scene.damped, driver.limits, count, driver.reductions, driver.room, driver.room_ints, driver.strength,
        result.rows, result.found, gradients, *more,
    )  # fmt: skip


def _carry(driver: "Driver", result: ResponseResult, count: int, gradients: FloatArray) -> None:
    """Fill the gradients by the direct method."""
    from mdstopo.sensitivity.springs_direct import direct

    direct(*_arguments(driver, result, count, gradients, np.zeros((0, gradients.shape[2])), driver.work))


def histories(driver: "Driver", alpha: FloatArray) -> tuple[Status, FloatArray, FloatArray]:
    """Times (T,) of the steps and dg/dalpha (T, N) of the stored energy at them, by `direct`."""
    from mdstopo.sensitivity.springs_direct import direct

    code, count, _ = driver.run(alpha, True)
    if code != OK:
        return status_of(code), np.zeros(0), np.zeros((0, len(alpha)))
    lines = np.zeros((count + 1, len(alpha)))
    direct(
        driver.entry.TAG, driver.packed.ints, driver.packed.floats, driver.method.tables, driver._alpha,
        driver.scene.damped, driver.limits, count, driver.reductions[:0], driver.room, driver.room_ints,
        driver.strength, driver.rows[:0], driver.found[:0], driver.gradients[:0], lines, driver.work,
    )  # fmt: skip
    return Status.OK, driver.room[: count + 1].copy(), lines


def by_constant_load(driver: "Driver", alpha: FloatArray, result: ResponseResult) -> Differentiated:
    """Gradients with inertia and loads frozen at the times of the rows."""
    from mdstopo.sensitivity.springs_constant_load import constant_load

    gradients = np.zeros_like(result.gradients)
    before = driver.work.copy()
    status, steps = driver.simulate(alpha)
    driver.work += before
    if status is not Status.OK:
        return Differentiated(status, "", gradients)
    start, end = float(steps.t[0]), float(steps.t[-1])
    for j, reduction in enumerate(driver.reductions.tolist()):
        for r in range(int(result.found[j])):
            times, weights = result.rows[j, r, :1], np.ones(1)
            if reduction in (MEAN, INTEGRAL):
                times = np.linspace(start, end, NODES)
                weights = np.full(NODES, (end - start) / (NODES - 1))
                weights[[0, -1]] *= 0.5
                weights /= end - start if reduction == MEAN else 1.0
            poses = steps.at(times)[0]
            gradients[j, r] = constant_load(driver.packed, driver._alpha, poses, weights)
    return Differentiated(Status.OK, "", gradients)
