"""Whether fixed steps are enough to see a motion by: ten to a period, by what the motion itself does."""

import numpy as np

from mdstopo.case.model import Case, FloatArray
from mdstopo.integrators.steps import TURN
from mdstopo.store.contents import Motion

#: steps to a period, or for the whole motion, below which it is hardly seen
STEPS_PER_PERIOD = 10.0
#: share of the largest speed of its kind below which a swing is of no interest
SMALL_SWING = 0.05


def coarse_steps(case: Case, load_case: str, motion: Motion) -> str:
    """Why the case's fixed step is too long for a motion, and which body turns round too fast for it; empty where it
    is not.

    A velocity that swings back and forth within fewer than ten steps is not resolved: between two instants at which it
    turns round, half a period, there are fewer than five. Swings below a twentieth of the largest speed do not count.
    Neither is it where a body in space turns in a step by more than error control would allow.
    """
    step = case.solver.step
    if step is None or not motion.status.ok or len(motion.t) < 2:
        return ""
    where = f"in load case {load_case} " if len(case.load_cases) > 1 else ""
    if motion.t[-1] - motion.t[0] < STEPS_PER_PERIOD * step * (1.0 - 1e-9):
        return f"solver.step of {step:g} s: {where}the motion has fewer than ten steps"
    each = motion.v.shape[1] // len(case.bodies)
    if turning := _turns_too_far(case, motion, each, step):
        return f"solver.step of {step:g} s: {where}{turning}"
    kinds = np.arange(motion.v.shape[1]) % each < each - each // 2  # places, then turns
    shortest, mover = np.inf, ""
    for column in range(motion.v.shape[1]):
        largest = float(np.abs(motion.v[:, kinds == kinds[column]]).max())
        found = _half_period(motion.t, motion.v[:, column], motion.a[:, column], SMALL_SWING * largest)
        if found < shortest:
            shortest, mover = found, case.bodies[column // each].name
    if 2.0 * shortest >= STEPS_PER_PERIOD * step:
        return ""
    return (
        f"solver.step of {step:g} s: {where}the velocity of {mover} swings with a period of some {2.0 * shortest:.2g} "
        "s, fewer than ten steps; halve the step until nothing changes, or leave it out"
    )


def _turns_too_far(case: Case, motion: Motion, each: int, step: float) -> str:
    """Which body in space turns by more than `TURN` in a step, and what step would do; empty where none does.

    each: freedoms of a body. An angle in a plane says how many whole turns there are, an orientation does not.
    """
    if each == 3:
        return ""
    rates = np.linalg.norm(motion.v.reshape(len(motion.t), len(case.bodies), each)[:, :, 3:], axis=2).max(axis=0)
    fastest = int(np.argmax(rates))
    rate = float(rates[fastest])
    if not rate * step > 1.1 * TURN:
        return ""
    return (
        f"{case.bodies[fastest].name} turns by {rate * step:.2g} rad in a step, at {rate:.4g} rad/s; {TURN:g} rad is "
        f"what can be followed: take steps of {TURN / rate:.2g} s or less, or leave it out"
    )


def _half_period(t: FloatArray, v: FloatArray, a: FloatArray, least: float) -> float:
    """The shortest time between two instants at which v (T,) turns round, its swings before and after above `least`.

    t (T,): times, s. a (T,): rates of v. Infinite where there are no two such instants.
    """
    turns = np.flatnonzero(a[:-1] * a[1:] < 0.0)
    if len(turns) < 2:
        return float("inf")
    share = a[turns] / (a[turns] - a[turns + 1])
    times = t[turns] + share * (t[turns + 1] - t[turns])
    at = np.concatenate([v[:1], v[turns] + share * (v[turns + 1] - v[turns]), v[-1:]])
    wide = np.abs(np.diff(at)) > least
    good = wide[:-2] & wide[1:-1] & wide[2:]
    gaps = np.diff(times)[good]
    return float(gaps.min(initial=np.inf))
