"""Where steps are to end for the sake of integrals: at kinks of what is integrated, and where it bends too sharply.

The integral of a response is that of one more coordinate, by the weights of the stages, but no error control measures
it. A norm or an absolute value has a complex singularity as near to the real axis as it comes to zero, however smooth
the motion is; the nearer it is, the shorter steps beside it have to be. And a driven body, or one that hardly feels its
members, takes steps in which a smooth response is no polynomial. So the weights' sum over each step is compared
with that of a better rule (`nested_rules`), on the quintic through the step's ends, and steps are halved until both
agree. The motion is computed once more with steps that end at these middles; since steps between them are chosen anew,
all is checked again. Steps of fixed length promise no accuracy, and stay as they are.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.over_time.kinks import kinks
from mdstopo.general.over_time.motion_sizes import motion_sizes, rounding_of
from mdstopo.general.over_time.nested_rules import NestedRules, nested_rules
from mdstopo.general.over_time.switch_changes import moving_switches
from mdstopo.general.responses.general_responses import has_kinks, norms_in, switches_of
from mdstopo.general.steps.run_start import method_number
from mdstopo.general.steps.step_history import FIRST
from mdstopo.integrators.gauss_tables import LEVELS
from mdstopo.integrators.runge_kutta_tables import STAGES
from mdstopo.scene.signal_segments import TIMES_APART
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: how often an evaluation looks for breakpoints
MOST_LOOKS = 3
#: how far both sums over a step may differ, relative to the tolerance and the whole integral: derivatives bend more
#: sharply than values near a zero of a norm, where they were off by some hundred times as much (at 0.1 by up to 800
#: tolerances). It costs little, because one halving more lowers the difference by hundreds
SUMS_DIFFER = 1e-3
#: halvings of one step at most; after PATIENCE of them a part that is shorter than the motion by RESOLVED is given up
#: where one more leaves a larger share of the difference than VAIN: what is left is rounding. In a longer one it may be
#: an integrand that oscillates within it, as one of a load that the motion does not feel
HALVINGS, PATIENCE, VAIN, RESOLVED = 24, 3, 0.7, 256
#: how much of an earlier difference counts after one more halving: beside a kink one may be small by chance, and
#: differences fall to a quarter
FADES = 0.25
#: a response that is smaller by this at both ends of a step than in its middle, in this share of all steps, is zero in
#: truth: joints hold it there, which states keep to and what is between them misses
MISSED, MOSTLY = 1e-3, 0.75
#: how many steps are looked at before all are, and in which share of them it has to be so
FIRST_LOOKED_AT, SHARE_OF_LOOKED_AT = 32, 0.5
#: at how many places inside a step values are looked at, at least, and in all steps of a run together; where in its
#: part of a step each is, beside the middle, where much is symmetric
INSIDE, IN_RUN, OFF_MIDDLE = 3, 64, 0.4

#: places (K, 2), and between which two ends each is (K,) -> values (K, R)
Integrands = Callable[[FloatArray, IndexArray], FloatArray]


def followed_integrals(driver: DriverWithRun, count: int) -> dict[int, float]:
    """The responses whose integrals steps have to follow, those that no joints hold at zero, and up to what size each
    is rounding; 0: that is not known. To be asked of a first run, of `count` steps: in steps that are shorter for the
    sake of others rounding hides what is held at zero."""
    integrals = [j for j, kind in enumerate(driver.scene.reductions) if kind.is_integral]
    if not integrals:
        return {}
    sizes = motion_sizes(driver, count)
    nothing = {j: rounding_of(driver, j, sizes) for j in integrals}
    held = _held_at_zero(driver, count, nothing)
    return {j: size for j, size in nothing.items() if j not in held}


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
            if has_kinks(model, j) or moving_switches(driver, j) or norms_in(model, j):
                found += kinks(driver, j, t)
    if not driver.method.kind.adaptive or driver.settings[2] > 0.0:
        return found
    ends = np.unique(np.concatenate([t, found, driver.quadrature_breakpoints]))
    ends = ends[np.concatenate([[True], np.diff(ends) > TIMES_APART * (t[-1] - t[0])])]
    integrands = _integrands(driver, integrals, t, ends)
    nothing = np.array([followed[j] ** 2 if square else followed[j] for j, square in integrals])
    tolerance = SUMS_DIFFER * float(driver.settings[0])
    return found + halves(t, ends, integrands, _rules(driver, count), tolerance, nothing)


def _held_at_zero(driver: DriverWithRun, count: int, nothing: Mapping[int, float]) -> set[int]:
    """The responses that are zero in all states, and between them but for what is missed there: as far as their sizes
    tell, or, of what is never negative, their values at the ends of steps beside those within.

    nothing: by response up to what size it is rounding; 0: that is not known.
    """
    model = driver.scene.model
    asked = [j for j, size in nothing.items() if size > 0.0 or has_kinks(model, j)]
    steps = np.arange(count)
    if count > FIRST_LOOKED_AT:  # what is not often zero in some steps is not mostly zero in all
        asked = _seem_held(
            driver, count, {j: nothing[j] for j in asked}, steps[:: -(-count // FIRST_LOOKED_AT)], SHARE_OF_LOOKED_AT
        )
    return set(_seem_held(driver, count, {j: nothing[j] for j in asked}, steps, MOSTLY))


def _seem_held(
    driver: DriverWithRun, count: int, nothing: Mapping[int, float], steps: IndexArray, share: float
) -> list[int]:
    """Those of responses that are zero, as `_held_at_zero` has it, in some of the steps.

    nothing: of the responses that are asked for. steps (S,): which steps are looked at. share: in which of them values
    have to be missed.
    """
    if not nothing:
        return []
    js = np.array(list(nothing))
    limit = np.array(list(nothing.values()))

    def sizes(fraction: float, exact: bool = False) -> FloatArray:
        """(S, R): magnitudes at a fraction of each step."""
        places = np.column_stack([steps.astype(np.float64), np.full(len(steps), fraction)])
        return np.abs(driver.values_at(js, places, count, exact=exact))

    ends = np.maximum(sizes(0.0), sizes(1.0))
    is_rounding = (limit > 0.0) & np.all(ends <= limit, axis=0)
    kinked = np.array([has_kinks(driver.scene.model, j) for j in js.tolist()])
    if not np.any(is_rounding | kinked):
        return []
    places = max(INSIDE, -(-IN_RUN // count))
    inside = ((np.arange(places) + OFF_MIDDLE) / places).tolist()
    between = np.max([sizes(fraction) for fraction in inside], axis=0)
    seem = is_rounding | (kinked & _are_missed(ends, between, share))
    if not np.any(seem):
        return []
    # a force that is zero wherever steps end is not zero in the method's own motion within them
    states = np.maximum(ends, np.max([sizes(fraction, exact=True) for fraction in inside], axis=0))
    seem &= (is_rounding & np.all(states <= limit, axis=0)) | _are_missed(states, between, share)
    return list(js[seem].tolist())


def _are_missed(states: FloatArray, between: FloatArray, share: float) -> NDArray[np.bool_]:
    """(R,): whether sizes (S, R) in states of steps are next to nothing beside those between them, in a share of
    them."""
    missed: NDArray[np.bool_] = np.count_nonzero(states < MISSED * between, axis=0) >= share * len(states)
    return missed


def _integrands(
    driver: DriverWithRun, integrals: Sequence[tuple[int, bool]], t: FloatArray, ends: FloatArray
) -> Integrands:
    """Values of responses; those of an expression with switches go on between two `ends` as they are in their middle.

    driver: with a finished run. integrals: the responses, and whether their squares are meant.
    t (m + 1,): its steps' times (s). ends (k + 1,): where steps end or will have to end (s).
    """
    count = len(t) - 1
    js = np.array([j for j, _ in integrals])
    squared = np.array([square for _, square in integrals])
    switched = [r for r, j in enumerate(js.tolist()) if switches_of(driver.scene.model, j)]
    sides = np.full((len(ends) - 1, len(js)), -1)
    if switched:
        middle = 0.5 * (ends[:-1] + ends[1:])
        step = np.clip(np.searchsorted(t, middle, side="right") - 1, 0, count - 1)
        at = np.column_stack([step, (middle - t[step]) / (t[step + 1] - t[step])])
        for r in switched:
            sides[:, r] = driver.sample_response(int(js[r]), at, False, count, rates=False)[2][:, 2]

    def values(places: FloatArray, within: IndexArray) -> FloatArray:
        value = driver.values_at(js, places, count, who=sides[within])
        return np.where(squared, value * value, value)

    return values


def _rules(driver: DriverWithRun, count: int) -> NestedRules:
    """The rule by which stages integrate, and a better one; where steps differ in that, the least of them."""
    tables, model = driver.method.tables, driver.scene.model
    if driver.method.collocates:
        first = driver.index_of_steps()[: count + 1, FIRST]
        least = int(np.diff(first).min())
        nodes, weights = tables[LEVELS.index(least), 0, :2, :least]
    else:
        method = method_number.py_func(model)  # type: ignore[attr-defined]
        vectors = tables[method, 2, :, : STAGES[method]]
        nodes, weights = vectors[0][vectors[2] != 0.0], vectors[2][vectors[2] != 0.0]
    return nested_rules(tuple(nodes.tolist()), tuple(weights.tolist()))


def halves(
    t: FloatArray, ends: FloatArray, integrands: Integrands, rules: NestedRules, tolerance: float, nothing: FloatArray
) -> list[float]:
    """Times that halve the intervals between `ends`, and their halves, until a rule of integration is good on each.

    t (m + 1,): ends of the steps (s), all of them among `ends`.
    ends (k + 1,): times at which steps end or will have to end (s).
    integrands: their values (K, R) at places (K, 2), steps and fractions of them, each between two ends (K,).
    rules: the rule, and a better one.
    tolerance: how far both may differ, relative to the whole integral.
    nothing (R,): up to this an integrand counts as zero on the mean, and no interval is halved for it.
    """
    low, width, within = ends[:-1], np.diff(ends), np.arange(len(ends) - 1)
    span = float(t[-1] - t[0])
    step = np.clip(np.searchsorted(t, low + 0.5 * width, side="right") - 1, 0, len(t) - 2)
    found: list[float] = []
    allowed = tolerance * min(1.0, RESOLVED / len(low))  # what steps are off by may add up
    whole, before, asked = np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0), dtype=np.bool_)
    for depth in range(HALVINGS):
        times = low[:, None] + width[:, None] * rules.places
        fraction = np.clip((times - t[step][:, None]) / (t[step + 1] - t[step])[:, None], 0.0, 1.0)
        at = np.stack([np.broadcast_to(step[:, None], fraction.shape), fraction], axis=-1)
        value = integrands(at.reshape(-1, 2), np.repeat(within, len(rules.places))).reshape(*fraction.shape, -1)
        sums = width[:, None] * np.einsum("ipr,p->ir", value, rules.own)
        better = width[:, None] * np.einsum("ipr,p->ir", value, rules.better)
        if depth == 0:
            whole = np.abs(better).sum(axis=0)
            either = np.maximum(whole, np.abs(sums).sum(axis=0))  # either may miss a pulse
            asked = np.tile(either > nothing * span, (len(low), 1))
        off = np.abs(sums - better)
        bad = asked & (off > allowed * whole) & (width > 2.0 * TIMES_APART * span)[:, None]
        if depth >= PATIENCE:  # what does not fall with its halves is rounding
            pair = off.reshape(2, -1, len(whole)).sum(axis=0)
            bad &= np.tile(pair <= VAIN * before, (2, 1)) | (width * RESOLVED > span)[:, None]
        some = bad.any(axis=1)
        if not some.any():
            break
        before = np.maximum(off, FADES * np.tile(before, (2, 1)))[some] if depth else off[some]
        asked = np.tile(bad[some], (2, 1))
        half = 0.5 * width[some]
        found += (low[some] + half).tolist()
        low, width = np.concatenate([low[some], low[some] + half]), np.concatenate([half, half])
        step, within = np.tile(step[some], 2), np.tile(within[some], 2)
    return found
