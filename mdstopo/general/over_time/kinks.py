"""Integrals over time of what has kinks: a norm that passes zero, the largest force where it passes to another member.

A quadrature is of high order only where the integrand is smooth. So where such a response is integrated, the motion is
first sampled, and computed once more with steps that end at its kinks (and around bends that are nearly such, where
derivatives bend more sharply than values; for values see `quadrature_breakpoints`). The integrand is continuous at a
kink, so its time adds no term to the derivative of the integral. Beside a norm's zero the derivative is along a vector
that all but vanishes, and the last stages of a long step have an error that would turn this vector anywhere. Steps
beside a zero are therefore short (`STEP_BESIDE_ZERO`; of a norm in an expression `STEPS_BESIDE_ZERO_IN_EXPRESSION`).
"""

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.general_model import GeneralModel
from mdstopo.general.over_time.minima import LOW_MINIMUM
from mdstopo.general.over_time.pieces import Pieces
from mdstopo.general.responses.extremes import FRACTION, STEP, TIME, VALUE, EvaluateAt
from mdstopo.general.responses.general_responses import has_kinks, has_norm, is_expression, norms_in
from mdstopo.general.steps.step_history import EVENTS
from mdstopo.scene.springs_model import FloatArray

#: a window, relative to the lowest minimum, within which every minimum is: the lowest may be next to zero
ALL = 1e9
#: how long the steps beside a norm's zero are, relative to the step that it was found in: the last stage of a step is
#: off by its length to the sixth power or so
STEP_BESIDE_ZERO = 0.1
#: distances from the zero of a norm in an expression at which steps end, in lengths of the step that it was found in:
#: steps become shorter towards the zero, about as long as they are far from it. None ends at the zero itself, where the
#: norm has no direction: an expression cannot be followed from inside of a step, as the norm alone is
STEPS_BESIDE_ZERO_IN_EXPRESSION = tuple(10.0**-k for k in range(1, 9))
#: fractions of a step at which values beside a kink are compared, one after the other
DISTANCES = (3e-3, 1e-4, 3e-6, 1e-7)


def kinks(driver: DriverWithRun, j: int, t: FloatArray) -> list[float]:
    """Times inside (t[0], t[-1]) at which steps have to end because response j has a kink there, or a norm in it beside
    them; t (m + 1,): the steps' times. At an event steps end anyway."""
    happened = np.diff(driver.index_of_steps()[: len(t), EVENTS]) > 0
    found = _kinks(driver, j, t)
    if driver.method.kind.adaptive and driver.settings[2] == 0.0:
        found += [time for part in norms_in(driver.scene.model, j) for time in _kinks(driver, part, t, True)]
    return [time for time in found if not _is_at_event(t, t[1:][happened], time)]


def _is_at_event(t: FloatArray, events: FloatArray, time: float) -> bool:
    """Whether a time is that of an event, to rounding. An event's time varies with the design. A given time beside it,
    at which a step ends, would take its place, and what is read there would seem not to move.

    t (m + 1,), events (E,): times of the steps, and those at which members switch.
    """
    step = np.clip(np.searchsorted(t, time) - 1, 0, len(t) - 2)
    return bool(np.any(np.abs(events - time) <= DISTANCES[-1] * (t[step + 1] - t[step])))


def _kinks(driver: DriverWithRun, j: int, t: FloatArray, in_expression: bool = False) -> list[float]:
    """Times inside (t[0], t[-1]) at which response j has a kink, events among them, and times beside zeros of norms.

    t (m + 1,): the steps' times. in_expression: whether response j is a norm in an expression: then none of its zeros
    is among the times, only those beside them.
    """
    pieces = Pieces(driver, j, t)
    values, rates = pieces.samples[:, :, 0], pieces.samples[:, :, 1]
    highest = float(np.abs(values).max())
    if highest == 0.0:
        return []
    found = list(pieces.changes)
    if not has_kinks(driver.scene.model, j):
        return found
    rate = float(np.abs(rates).max())
    for row in pieces.minima(ALL):
        low = -row[VALUE] if row[VALUE] < 0.0 else row[VALUE]
        if low > LOW_MINIMUM * highest or not t[0] < row[TIME] < t[-1]:
            continue
        w, c = int(row[STEP]), sharpened(int(row[STEP]), float(row[FRACTION]), pieces.evaluate_at)
        if min(w + c, len(pieces.t) - 1 - w - c) <= DISTANCES[-1]:  # zero from the start, or to the end: no kink
            continue
        length = float(pieces.t[w + 1] - pieces.t[w])
        time = float(pieces.t[w] + c * length)
        around = _around(time, low, rate, float(t[0]), float(t[-1]))
        if not around and turns_round(driver.scene.model, j):
            shares = STEPS_BESIDE_ZERO_IN_EXPRESSION if in_expression else (STEP_BESIDE_ZERO,)
            beside = [share * length for share in shares]
            around = [each for d in beside for each in (time - d, time + d) if t[0] < each < t[-1]]
        found += around if in_expression else [time, *around]
    return found


def turns_round(model: GeneralModel, j: int) -> bool:
    """Whether response j may change its direction sharply near zero: the norm of a vector, or a root in an
    expression."""
    return has_norm(model, j) or is_expression(model, j)


def sharpened(w: int, c: float, evaluate_at: EvaluateAt) -> float:
    """Where in step w a value comes down to zero and goes up again: rates near a kink are smeared, values are not.

    On both sides the value is a line through zero, so that two values tell where.
    """
    for d in DISTANCES:
        if c <= d or c >= 1.0 - d:
            break
        left, right = evaluate_at(np.array([[w, c - d], [w, c + d]]), True)[:, 0].tolist()
        if left + right > 0.0:
            c += d * (left - right) / (left + right)
    return min(max(c, 0.0), 1.0)


def _around(time: float, low: float, rate: float, start: float, end: float) -> list[float]:
    """Times about a low value at distances that double, so that steps resolve a bend as sharp as it is low."""
    if rate <= 0.0 or low <= 1e-9 * rate * (end - start):
        return []
    found, width = [], 2.0 * low / rate
    while width < 0.05 * (end - start):
        found += [each for each in (time - width, time + width) if start < each < end]
        width *= 3.0
    return found
