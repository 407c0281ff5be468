"""What keeps sequential approximation safe: a merit, a trust box, shifts and a convex term that adapt, and
the stops.

Published rules where there are any: shifts move as Svanberg's (1987) asymptotes do; the trust box follows the
ratio of actual to predicted decrease; the convex term grows when the model proves too low, as in conservative
approximation (Svanberg 2002).
"""

import numpy as np

from mdstopo.optimizer.presets import Settings
from mdstopo.optimizer.problem import Floats, Sample
from mdstopo.optimizer.state import State
from mdstopo.status import RunStatus, Status

CONVEX_FLOOR = 1e-6
CONVEX_CEILING = 1e6
# A minimiser of a linear function plus the convex term is promised half of the linear decrease: a step that
# gains
# much more than promised was held back by that term.
TOO_CONVEX = 1.5
PRICE_GROWTH = 10.0
PRICE_CEILING = 1e4


def failure(sample: Sample) -> str:
    """Why a sample cannot be used, as a sentence; empty if it can."""
    if sample.status is Status.OK:
        numbers = (
            sample.objective,
            sample.rows,
            sample.gradients,
            sample.constraint_rows,
            sample.constraint_gradients,
        )
        if all(np.isfinite(number).all() for number in numbers) and len(sample.rows):
            return ""
        return Status.NON_FINITE.value
    return f"{sample.status.value} ({sample.message})" if sample.message else sample.status.value


def scaled_violation(sample: Sample) -> float:
    """The largest constraint violation, in the unit of alpha: c over the largest entry of its gradient."""
    if not len(sample.constraint_rows):
        return 0.0
    steepest = np.abs(sample.constraint_gradients).max(axis=1)
    return float(np.max(np.maximum(sample.constraint_rows, 0.0) / np.where(steepest > 0.0, steepest, 1.0)))


def merit(objective: float, constraint_rows: Floats, price: Floats) -> float:
    """What a step must decrease: the objective and the price of all violations."""
    return objective + float(np.einsum("i,i->", price, np.maximum(constraint_rows, 0.0)))


def first_price(sample: Sample, settings: Settings) -> Floats:
    """The price of each constraint row, (C,): so that `elastic` times its gradient outweighs the
    objective's."""
    if not len(sample.constraint_rows):
        return np.zeros(0)
    steepest = np.abs(sample.constraint_gradients).max(axis=1)
    slope = float(np.abs(sample.gradients).max())
    return settings.number("elastic") * (slope if slope > 0.0 else 1.0) / np.where(steepest > 0.0, steepest, 1.0)


def better(objective: float, violation: float, state: State, tolerance: float) -> bool:
    """Whether a design beats the best so far: among feasible ones by objective, else by violation."""
    if max(violation, state.best_violation) <= tolerance:
        return objective < state.best_objective
    return violation < state.best_violation


def next_trust(trust: float, ratio: float, settings: Settings) -> float:
    """The half width of the trust box, in ranges, after a step with this ratio of actual to predicted
    decrease."""
    if ratio > settings.number("good_ratio"):
        return min(1.0, trust * settings.number("trust_grow"))
    if ratio < settings.number("poor_ratio"):
        return trust * settings.number("trust_shrink")
    return trust


def next_convex(convex: float, ratio: float, too_low: bool, settings: Settings) -> float:
    """The relative weight of the convex term: more where the model was below the function, less after a good
    step."""
    if convex == 0.0:
        return 0.0
    if too_low:
        return min(convex * settings.number("convex_grow"), CONVEX_CEILING)
    if ratio > TOO_CONVEX:
        return max(convex * settings.number("convex_drop"), CONVEX_FLOOR)
    if ratio > settings.number("good_ratio"):
        return max(convex * settings.number("convex_shrink"), CONVEX_FLOOR)
    return convex


def next_shift(shift: Floats, steps: Floats, settings: Settings) -> Floats:
    """Distances of the shifts in ranges, (N,): wider where the last two steps agree, narrower where they
    oppose."""
    agreement = steps[0] * steps[1]
    factor = np.where(
        agreement > 0.0,
        settings.number("shift_grow"),
        np.where(agreement < 0.0, settings.number("shift_shrink"), 1.0),
    )
    return np.clip(shift * factor, settings.number("shift_minimum"), settings.number("shift_maximum"))


def verdict(state: State, move: float, settings: Settings) -> tuple[RunStatus, str]:
    """Whether to go on, and if not, why: a function of the state alone, so that a resumed run decides alike.

    move: the largest change that the next step would make, in ranges.
    """
    if state.status is RunStatus.FAILED:
        return state.status, state.reason
    if state.kkt <= settings.tolerance and state.violation <= settings.tolerance:
        return RunStatus.CONVERGED, (
            f"the projected KKT residual, {state.kkt:.2g} of the largest gradient entry, "
            f"is within the tolerance {settings.tolerance:.2g}"
        )
    if state.small >= 2:
        share = settings.number("decrease_tolerance")
        return RunStatus.CONVERGED, (
            f"actual and predicted decrease were both below {share:.2g} of the objective twice running"
        )
    if move <= settings.number("change_tolerance"):
        if move == 0.0:
            return RunStatus.CONVERGED, "no step is left that would change a variable"
        return RunStatus.CONVERGED, (f"the next step would change no variable by more than {move:.2g} of its range")
    if state.iteration >= settings.max_iterations:
        return RunStatus.MAX_ITERATIONS, f"the limit of {settings.max_iterations} iterations was reached"
    return RunStatus.RUNNING, ""
