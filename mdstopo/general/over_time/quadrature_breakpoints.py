"""Where steps are to end for the sake of integrals: at kinks of what is integrated, and where it bends too sharply.

The integral of a response is that of one more coordinate, by the weights of the stages, but no error control measures
it. A norm or an absolute value has a complex singularity as near to the real axis as it comes to zero, however smooth
the motion is; the nearer it is, the shorter steps beside it have to be. And a driven body, or one that hardly feels its
members, takes steps in which a smooth response is no polynomial. So the weights' sum over each step is compared
with a Gauss-Legendre sum, on the quintic through the step's ends, and steps are halved until both agree. The motion is
computed once more with steps that end at these middles; since steps between them are chosen anew, all is checked again.
Steps of fixed length promise no accuracy, and stay as they are.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.over_time.kinks import kinks
from mdstopo.general.over_time.motion_sizes import motion_sizes, rounding_of
from mdstopo.general.responses.general_responses import has_kinks, switches_of
from mdstopo.general.steps.run_start import method_number
from mdstopo.general.steps.step_history import FIRST
from mdstopo.integrators.gauss_tables import LEVELS
from mdstopo.integrators.runge_kutta_tables import STAGES
from mdstopo.scene.signal_segments import APART
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: nodes and weights of the Gauss-Legendre sums, on (-1, 1): better than a method's own weights; than collocation's, too
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
FINE_NODES, FINE_WEIGHTS = np.polynomial.legendre.leggauss(20)
#: how often an evaluation looks for breakpoints
ROUNDS = 3
#: how far both sums over a step may differ, relative to the tolerance and the whole integral: derivatives bend more
#: sharply than values near a zero of a norm, where they were off by some hundred times as much (at 0.1 by up to 800
#: tolerances). It costs little, because one halving more lowers the difference by hundreds
SHARE = 1e-3
#: halvings of one step at most; after PATIENCE of them, and once a run has at least RESOLVED parts, a step is given up
#: where one more leaves a larger share of the difference than VAIN: what is left is rounding. In fewer parts it may be
#: an integrand that oscillates within them, as one of a load that the motion does not feel
HALVINGS, PATIENCE, VAIN, RESOLVED = 24, 3, 0.7, 256
#: how much of an earlier difference counts after one more halving: beside a kink one may be small by chance, and
#: differences fall to a quarter
FADES = 0.25
#: a response that is smaller by this at both ends of a step than in its middle, in this share of all steps, is zero in
#: truth: joints hold it there, which states keep to and what is between them misses
MISSED, MOSTLY = 1e-3, 0.75
#: at how many places inside a step values are looked at, at least, and in all steps of a run together; where in its
#: part of a step each is, beside the middle, where much is symmetric
INSIDE, IN_RUN, BESIDE = 3, 64, 0.4

#: places (K, 2), and between which two ends each is (K,) -> values (K,)
Integrand = Callable[[FloatArray, IndexArray], FloatArray]


def followed_integrals(driver: DriverWithRun, count: int) -> dict[int, float]:
    """The responses whose integrals steps have to follow, those that no joints hold at zero, and up to what size each
    is rounding; 0: that is not known. To be asked of a first run, of `count` steps: in steps that are shorter for the
    sake of others rounding hides what is held at zero."""
    integrals = [j for j, kind in enumerate(driver.scene.reductions) if kind.is_integral]
    if not integrals:
        return {}
    sizes = motion_sizes(driver, count)
    nothing = {j: rounding_of(driver, j, sizes) for j in integrals}
    return {j: size for j, size in nothing.items() if not _is_held_at_zero(driver, j, count, size)}


def quadrature_breakpoints(driver: DriverWithRun, count: int, followed: Mapping[int, float]) -> list[float]:
    """Times at which steps are to end, beside `driver.quadrature_breakpoints`, from the `count` steps of its last
    run. followed: of `followed_integrals`."""
    model, found = driver.scene.model, list[float]()
    if not followed:
        return found
    integrals = [(j, driver.scene.reductions[j].is_squared) for j in followed]
    t = driver.states()[0][: count + 1].copy()
    if not driver.quadrature_breakpoints:
        for j, _ in integrals:
            if has_kinks(model, j) or switches_of(model, j):
                found += kinks(driver, j, t)
    if not driver.method.kind.adaptive or driver.settings[2] > 0.0:
        return found
    ends = np.unique(np.concatenate([t, found, driver.quadrature_breakpoints]))
    ends = ends[np.concatenate([[True], np.diff(ends) > APART * (t[-1] - t[0])])]
    rule = _rule(driver, count)
    for j, square in integrals:
        integrand = _integrand(driver, j, t, ends, square)
        nothing = followed[j] ** 2 if square else followed[j]
        found += halves(
            t,
            ends,
            integrand,
            rule,
            SHARE * float(driver.settings[0]),
            nothing * float(t[-1] - t[0]),
            driver.method.collocates,
        )
    return found


def _is_held_at_zero(driver: DriverWithRun, j: int, count: int, nothing: float) -> bool:
    """Whether response j is zero in all states, and between them but for what is missed there: as far as its size
    tells, or, of what is never negative, its values at the ends of steps beside those within.

    nothing: up to what size it is rounding; 0: that is not known.
    """
    if nothing == 0.0 and not has_kinks(driver.scene.model, j):
        return False

    def size(fraction: float, exact: bool = False) -> FloatArray:
        places = np.column_stack([np.arange(count, dtype=np.float64), np.full(count, fraction)])
        value: FloatArray = driver.sample_response(j, places, exact, count, rates=False)[2][:, 0]
        return np.abs(value)

    ends = np.maximum(size(0.0), size(1.0))
    is_rounding = nothing > 0.0 and bool(np.all(ends <= nothing))
    if not (is_rounding or has_kinks(driver.scene.model, j)):
        return False
    places = max(INSIDE, -(-IN_RUN // count))
    inside = ((np.arange(places) + BESIDE) / places).tolist()
    between = np.max([size(fraction) for fraction in inside], axis=0)
    if not (is_rounding or _are_missed(ends, between)):
        return False
    # a force that is zero wherever steps end is not zero in the method's own motion within them
    states = np.maximum(ends, np.max([size(fraction, exact=True) for fraction in inside], axis=0))
    return (is_rounding and bool(np.all(states <= nothing))) or _are_missed(states, between)


def _are_missed(states: FloatArray, between: FloatArray) -> bool:
    """Whether sizes (S,) in states of steps are next to nothing beside those between the states."""
    return bool(np.count_nonzero(states < MISSED * between) >= MOSTLY * len(states))


def _integrand(driver: DriverWithRun, j: int, t: FloatArray, ends: FloatArray, square: bool) -> Integrand:
    """Values of response j; those of an expression with switches go on between two `ends` as they are in their middle.

    driver: with a finished run. t (m + 1,): its steps' times (s).
    ends (k + 1,): where steps end or will have to end (s).
    square: whether their squares are meant.
    """
    count = len(t) - 1

    def sample(places: FloatArray, who: int) -> FloatArray:
        value: FloatArray = driver.sample_response(j, places, False, count, who=who, rates=False)[2][:, 0]
        return value * value if square else value

    if not switches_of(driver.scene.model, j):
        return lambda places, within: sample(places, -1)
    middle = 0.5 * (ends[:-1] + ends[1:])
    step = np.clip(np.searchsorted(t, middle, side="right") - 1, 0, count - 1)
    at = np.column_stack([step, (middle - t[step]) / (t[step + 1] - t[step])])
    sides = driver.sample_response(j, at, False, count, rates=False)[2][:, 2].astype(np.int64)

    def on_sides(places: FloatArray, within: IndexArray) -> FloatArray:
        value = np.empty(len(places))
        for side in np.unique(sides[within]).tolist():
            own = sides[within] == side
            value[own] = sample(places[own], side)
        return value

    return on_sides


def _rule(driver: DriverWithRun, count: int) -> FloatArray:
    """Nodes and weights (2, s) on (0, 1) by which stages integrate; where steps differ in that, the least of them."""
    tables, model = driver.method.tables, driver.scene.model
    if driver.method.collocates:
        first = driver.index_of_steps()[: count + 1, FIRST]
        least = int(np.diff(first).min())
        rule: FloatArray = tables[LEVELS.index(least), 0, :2, :least]
        return rule
    method = method_number.py_func(model)  # type: ignore[attr-defined]
    vectors = tables[method, 2, :, : STAGES[method]]
    weighed = vectors[2] != 0.0
    return np.stack([vectors[0][weighed], vectors[2][weighed]])


def halves(
    t: FloatArray,
    ends: FloatArray,
    integrand: Integrand,
    rule: FloatArray,
    tolerance: float,
    nothing: float = 0.0,
    collocated: bool = False,
) -> list[float]:
    """Times that halve the intervals between `ends`, and their halves, until a rule of integration is good on each.

    t (m + 1,): ends of the steps (s), all of them among `ends`.
    ends (k + 1,): times at which steps end or will have to end (s).
    integrand: its values (K,) at places (K, 2), steps and fractions of them, each between two ends (K,).
    rule (2, s): nodes and weights of the rule on (0, 1).
    tolerance: how far the rule may differ from the Gauss-Legendre sum, relative to the whole integral.
    nothing: up to this the integrand counts as zero on the mean, and no interval is halved.
    collocated: whether the rule is one of Gauss's, which a finer sum has to judge.
    """
    count = rule.shape[1]
    nodes, weights = (FINE_NODES, FINE_WEIGHTS) if collocated else (NODES, WEIGHTS)
    places = np.concatenate([rule[0], 0.5 * (nodes + 1.0)])
    low, width, within = ends[:-1], np.diff(ends), np.arange(len(ends) - 1)
    step = np.clip(np.searchsorted(t, low + 0.5 * width, side="right") - 1, 0, len(t) - 2)
    found: list[float] = []
    whole = np.nan
    before = np.full(0, np.inf)
    patience = max(PATIENCE, math.ceil(math.log2(RESOLVED / len(low))))
    for depth in range(HALVINGS):
        times = low[:, None] + width[:, None] * places
        fraction = np.clip((times - t[step][:, None]) / (t[step + 1] - t[step])[:, None], 0.0, 1.0)
        at = np.stack([np.broadcast_to(step[:, None], fraction.shape), fraction], axis=-1)
        value = integrand(at.reshape(-1, 2), np.repeat(within, len(places))).reshape(fraction.shape)
        sums = width * np.einsum("ij,j->i", value[:, :count], rule[1])
        better = 0.5 * width * np.einsum("ij,j->i", value[:, count:], weights)
        if np.isnan(whole):
            whole = float(np.abs(better).sum())
            if max(whole, float(np.abs(sums).sum())) <= nothing * (t[-1] - t[0]):  # either may miss a pulse
                break
        off = np.abs(sums - better)
        bad = (off > tolerance * whole) & (width > 2.0 * APART * (t[-1] - t[0]))
        if depth >= patience:  # what does not fall with its halves is rounding
            pair = off.reshape(2, -1).sum(axis=0)
            bad &= np.tile(pair <= VAIN * before, 2)
        if not bad.any():
            break
        before = np.maximum(off, FADES * np.tile(before, 2))[bad] if depth else off[bad]
        half = 0.5 * width[bad]
        found += (low[bad] + half).tolist()
        low, width = np.concatenate([low[bad], low[bad] + half]), np.concatenate([half, half])
        step, within = np.tile(step[bad], 2), np.tile(within[bad], 2)
    return found
