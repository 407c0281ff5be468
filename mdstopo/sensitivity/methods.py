"""The methods beside the adjoint one, by name: they differentiate the rows that a driver has found.

`direct` and `iterative` go through the driver's own steps again; `constant_load` needs only the poses at the looked-at
times.
"""

from typing import TYPE_CHECKING

import numpy as np

from mdstopo.integrators.scene_driver import Differentiated, ResponseResult
from mdstopo.integrators.steps import OK, status_of
from mdstopo.scene.model import FloatArray
from mdstopo.sensitivity.reductions import INTEGRAL, MEAN
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.integrators.driver import Driver

#: nodes of the rule by which constant_load forms a mean or an integral over time
NODES = 201

FALLBACK = "the sweeps of the iterative method do not contract at t = {:.6g} s; direct was taken instead"


def differentiate(method: str, driver: "Driver", alpha: FloatArray, looked: ResponseResult) -> Differentiated:
    """Gradients of the rows that `driver.evaluate(alpha, ...)` found, by `direct`, `iterative` or `constant_load`.

    alpha: (N,). Counts are added to `driver.work`. Raises ValueError for a name that is none of the three, and for
    `iterative` with another integrator than generalized_alpha.
    """
    if method not in ("direct", "iterative", "constant_load"):
        raise ValueError(f"no sensitivity method {method!r} here")
    if method == "iterative" and not driver.method.kind.iterative:
        raise ValueError("the iterative method is defined on the steps of generalized_alpha")
    gradients = np.zeros_like(looked.gradients)
    if method == "constant_load":
        return _constant_load(driver, alpha, looked, gradients)
    before = driver.work.copy()
    code, count, _ = driver.run(alpha, True)  # with tangents, which values alone may do without
    driver.work += before
    if code != OK:
        return Differentiated(status_of(code), "", gradients)
    # the driver's own array: another one might be read-only, which would be another compilation
    arguments = (
        driver.entry.TAG, driver.packed.ints, driver.packed.floats, driver.method.tables, driver._alpha,
        driver.scene.damped, driver.limits, count, driver.reductions, driver.room, driver.room_ints, driver.strength,
        looked.rows, looked.found, gradients,
    )  # fmt: skip
    message = ""
    if method == "iterative":
        from mdstopo.sensitivity.iterative import iterative

        stopped = iterative(*arguments, driver.work)
        if stopped < 0:
            return Differentiated(Status.OK, message, gradients)
        message = FALLBACK.format(float(driver.room[stopped]))
    from mdstopo.sensitivity.direct import direct

    direct(*arguments, np.zeros((0, gradients.shape[2])), driver.work)
    return Differentiated(Status.OK, message, gradients)


def histories(driver: "Driver", alpha: FloatArray) -> tuple[Status, FloatArray, FloatArray]:
    """Times (T,) of the steps and dg/dalpha (T, N) of the stored energy at them, by `direct`."""
    from mdstopo.sensitivity.direct import direct

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


def _constant_load(
    driver: "Driver", alpha: FloatArray, looked: ResponseResult, gradients: FloatArray
) -> Differentiated:
    from mdstopo.sensitivity.constant_load import constant_load

    before = driver.work.copy()
    status, steps = driver.simulate(alpha)
    driver.work += before
    if status is not Status.OK:
        return Differentiated(status, "", gradients)
    start, end = float(steps.t[0]), float(steps.t[-1])
    for j, reduction in enumerate(driver.reductions.tolist()):
        for r in range(int(looked.found[j])):
            times, weights = looked.rows[j, r, :1], np.ones(1)
            if reduction in (MEAN, INTEGRAL):
                times = np.linspace(start, end, NODES)
                weights = np.full(NODES, (end - start) / (NODES - 1))
                weights[[0, -1]] *= 0.5
                weights /= end - start if reduction == MEAN else 1.0
            poses = steps.at(times)[0]
            gradients[j, r] = constant_load(driver.packed, driver._alpha, poses, weights)
    return Differentiated(Status.OK, "", gradients)
