"""The step of a problem with many variables, one row and one volume row.

The interior point goes through a score of arrays of N numbers some fifteen times; a million variables then cost six
evaluations. Here the multiplier of the volume row is the only unknown: a sample of the variables gives a narrow bracket
for it, one pass finds the variables that every multiplier in the bracket sends to the same end of their box, and the
root is sought among the others, a few per cent. Nothing but that pass, which computes shifts, box and convex term as
it goes, touches N numbers. It is the same subproblem, solved to rounding.
"""

from math import gcd, inf
from typing import NamedTuple

import numpy as np

from mdstopo.native.threads import allowed
from mdstopo.optimizer.presets import Settings
from mdstopo.optimizer.problem import Floats, Ints, LinearRows
from mdstopo.optimizer.projection import ROUNDING, repair
from mdstopo.optimizer.state import State
from mdstopo.optimizer.wide_kernels import (
    COST,
    HIGH,
    LOW,
    SAMPLE,
    SLOTS,
    wide_minimum,
)
from mdstopo.optimizer.wide_passes import wide_adapt, wide_change, wide_residual

#: variables from which on this way is taken
MANY = 256
#: and from which on single passes over them are compiled too
WIDE = 10_000
#: and from which on threads share them
SHARED = 50_000
_LEAST_SAMPLE = 256


class Proposal(NamedTuple):
    """The next design (N,), the decrease that the model promises, the KKT residual at the iterate."""

    trial: Floats
    predicted: float
    kkt: float


def is_wide(state: State, chosen: int, linear: LinearRows, settings: Settings) -> bool:
    """Whether `propose` can make the next step of a state, of which `chosen` rows compete."""
    return (
        len(state.alpha) >= MANY
        and chosen + len(state.cuts) == 1 == len(linear)
        and not len(state.constraint_rows)
        and state.convex > 0.0
        and settings.number("power") != 0.0
        and not settings.flag("zero_shift")
        and not settings.flag("sign_rule")
    )


def propose(
    state: State, row: int, lower: Floats, upper: Floats, linear: LinearRows, settings: Settings
) -> Proposal | None:
    """The next step from a state, for its competing row; nothing where the subproblem resists."""
    alpha, n = state.alpha, len(state.alpha)
    slope, cost, bound = np.ascontiguousarray(state.gradients[row]), linear.A[0], float(linear.b[0])
    steepest = max(float(slope.max()), -float(slope.min()))
    if steepest == 0.0:
        return None
    power = settings.number("power")
    share = inf if power == 1.0 else 1.0 - settings.number("shift_margin")
    limits = np.array([power, settings.number("move_limit"), state.trust, share, state.convex * steepest])
    left = float(linear.excess(alpha)[0])
    trial, slots = np.empty(n), np.empty((SLOTS, n))
    place, live, x = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), np.empty(n)
    multiplier, miss, size, change, count = wide_minimum(
        alpha, slope, cost, state.shift, lower, upper, limits, bound, left + bound, bool(linear.equal[0]), _stride(n),
        1e-12 * (2.0 * abs(bound) + abs(left)), _threads(n), trial, slots, place, live, x,
    )  # fmt: skip
    size += abs(bound)
    if not (np.isfinite(change) and np.isfinite(multiplier)) or (abs(miss) > 1e-9 * size and multiplier != 0.0):
        return None
    _touch_up(trial, slots[:, :count], place[:count], linear, lower, upper, ROUNDING * size)
    promised = float(state.rows[row]) + change
    own = steepest if row == 0 else float(np.abs(state.gradients[0]).max())
    residual = wide_residual(alpha, slope, cost, lower, upper, multiplier, own, _threads(n))
    slack = 0.0 if linear.equal[0] else abs(multiplier * left) / own
    return Proposal(trial, state.objective - promised, max(residual, slack))


def adapt(state: State, settings: Settings) -> tuple[Floats, Floats]:
    """The last two steps (2, N) and the distances of the shifts (N,), after the trial was accepted."""
    steps, shifts = np.empty_like(state.steps), np.empty_like(state.shift)
    grow, shrink = settings.number("shift_grow"), settings.number("shift_shrink")
    least, most = settings.number("shift_minimum"), settings.number("shift_maximum")
    threads = _threads(len(shifts))
    wide_adapt(
        state.shift, state.steps[1], state.trial, state.alpha, grow, shrink, least, most, threads, steps, shifts
    )
    return steps, shifts


def largest_change(x: Floats, y: Floats, unit: Floats) -> tuple[float, float]:
    """max |x - y|, and the largest in its unit."""
    if len(x) >= WIDE:
        plain, scaled = wide_change(x, y, unit, _threads(len(x)))
        return plain, scaled
    change = np.abs(x - y)
    return float(change.max(initial=0.0)), float((change / unit).max(initial=0.0))


def _touch_up(
    trial: Floats, slots: Floats, place: Ints, linear: LinearRows,
    lower: Floats, upper: Floats, rounding: float,
) -> None:  # fmt: skip
    """Remove the last rounding errors of the volume row from the variables inside their boxes."""
    low, high = slots[LOW], slots[HIGH]
    for _ in range(20):
        excess = float(linear.excess(trial)[0])
        if abs(excess) <= rounding or (excess < 0.0 and not linear.equal[0]):
            return
        at = trial[place]
        push = np.where((at > low) & (at < high), slots[COST], 0.0)
        square = float(np.einsum("i,i->", push, push))
        if square == 0.0:
            break
        trial[place] = np.clip(at - excess / square * push, low, high)
    trial[:] = repair(trial, lower, upper, linear)


def _stride(n: int) -> int:
    """Every how many variables one is in the sample; with no common factor, so that no grid's rhythm is met."""
    stride = max(1, n // min(SAMPLE, max(_LEAST_SAMPLE, n // 64)))
    while gcd(stride, n) != 1:
        stride += 1
    return stride


def _threads(n: int) -> int:
    return allowed() if n >= SHARED else 1
