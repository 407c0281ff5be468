"""The step of a method with fixed steps that keeps a tolerance: measured, not guessed.

The steps are halved until the objectives and their gradients settle at the method's second order; Richardson's estimate
of the error then gives the step. It is handed on in radians of the scene's fastest vibration, so that
it fits other designs as well.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mdstopo.integrators.scene_driver import SceneDriver
from mdstopo.scene.springs_model import FloatArray
from mdstopo.status import Status

#: error aimed at, in tolerances: the promise is ten, and other designs than the measured one are less kind
AIMED_ERROR = 2.0
#: ratio of successive differences between which halving is taken to have settled; four at second order
SETTLED = 2.7, 6.0
#: halvings before a scene counts as one that does not settle
HALVINGS = 12
#: steps of the first try
FIRST_STEPS = 16


@dataclass(frozen=True)
class _Run:
    """One try. rows: per objective the peak times, values and gradients; moved (T, n_body, D): where
    bodies are at times t (T,), as they have moved since the start.
    """

    t: FloatArray
    moved: FloatArray
    rows: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]


def default_step(driver: SceneDriver, alpha: FloatArray) -> float:
    """What to put into `driver.settings[2]` for errors of about `AIMED_ERROR` tolerances (settings[0]) at alpha (N,).

    Negative: radians of the fastest vibration a step (`springs_generalized_alpha.longest_step`). The error meant is
    that of the objectives and of the largest entry of their gradients, relative; without objectives that of the motion.
    """
    times = driver.scene.model.times
    span = float(times[-1] - times[0])
    step = min(span / FIRST_STEPS, float(np.max(np.diff(times))))
    found = _settle(lambda h: _run(driver, alpha, h), step, AIMED_ERROR * float(driver.settings[0]))
    rate = driver.rate_at_start()
    return -found * rate if rate * span > 1.0 else found


def _settle(run: Callable[[float], _Run | None], step: float, aim: float) -> float:
    """The longest step whose error is at most `aim`, by halving and extrapolation."""
    coarse, before = run(step), np.inf
    for _ in range(HALVINGS):
        step /= 2.0
        fine = run(step)
        difference = _difference(coarse, fine) if coarse is not None and fine is not None else np.inf
        error = difference / 3.0  # of the finer one, at second order
        settled = difference > 0.0 and SETTLED[0] <= before / difference <= SETTLED[1]
        if settled or (error <= aim and difference <= before) or difference < 1e-3 * aim:
            return step if error <= aim else step * float(np.sqrt(aim / error))
        coarse, before = fine, difference
    return step


def _run(driver: SceneDriver, alpha: FloatArray, step: float) -> _Run | None:
    """Simulate with a step, or None where that fails."""
    kept = driver.settings[2]
    driver.settings[2] = step
    try:
        if not driver.shapes:
            status, steps = driver.simulate(alpha)
            return _Run(steps.t.copy(), driver.displacements(steps.q), ()) if status is Status.OK else None
        result = driver.evaluate(alpha, True)
        if result.status is not Status.OK:
            return None
        rows = []
        for j, count in enumerate(result.row_counts.tolist()):
            values = result.rows[j, :count]
            rows.append((values[:, 0].copy(), values[:, 1].copy(), result.gradients[j, :count].copy()))
        return _Run(np.zeros(0), np.zeros((0, 0, 0)), tuple(rows))
    finally:
        driver.settings[2] = kept


def _difference(coarse: _Run, fine: _Run) -> float:
    """Largest relative difference of the highest peaks and gradients, or of the motion."""
    worst = 0.0
    for (t0, g0, s0), (t1, g1, s1) in zip(coarse.rows, fine.rows, strict=True):
        near = 0 if np.isnan(t1[0]) else int(np.argmin(np.abs(t0 - t1[0])))
        worst = max(worst, _relative(g0[near : near + 1], g1[:1]), _relative(s0[near], s1[0]))
    if not coarse.rows:
        places = np.searchsorted(fine.t, coarse.t)
        places = np.minimum(places, len(fine.t) - 1)
        places -= (places > 0) & (np.abs(fine.t[places - 1] - coarse.t) < np.abs(fine.t[places] - coarse.t))
        same = np.abs(fine.t[places] - coarse.t) <= 1e-9 * (fine.t[-1] - fine.t[0])
        for part in range(coarse.moved.shape[-1]):
            worst = max(worst, _relative(coarse.moved[same, :, part], fine.moved[places][same, :, part]))
    return worst


def _relative(a: FloatArray, b: FloatArray) -> float:
    size = float(np.max(np.abs(b), initial=0.0))
    difference = float(np.max(np.abs(a - b), initial=0.0))
    if not np.isfinite(difference):
        return float("inf")
    return difference / size if size > 0.0 else 0.0
