"""The step of a problem with many variables and one volume row, where one function row decides it.

The interior point goes through a score of arrays of N numbers some fifteen times; a million variables then cost six
evaluations. Here the multiplier of the volume row is the only unknown: a sample of the variables, of very many a coarse
one before it, gives a narrow bracket for it, one pass finds the variables that every multiplier in the bracket sends to
the same end of their box, and the root is sought among the others, a few per cent. Nothing but that pass, which
computes shifts, box and convex term as it goes, touches N numbers. It is the same subproblem, the row solved to
rounding and the variables to some 1e-12 of their boxes.

Where several rows compete, the highest often decides alone: its minimiser is found, and is the solution if the other
rows lie below it there and the limits hold.
"""

from collections.abc import Callable
from functools import cache
from math import inf, isfinite
from mmap import mmap
from operator import is_
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.gsao_state import GsaoState, Step
from mdstopo.optimizer.nearest_feasible import ROUNDING, repair
from mdstopo.optimizer.problem import Floats, Ints, LinearRows, scale_of
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.wide_kernels import ROW_SOLVED, SAMPLE, wide_minimum, wide_rows
from mdstopo.optimizer.wide_numbers import LIGHT, VERY_MANY_VARIABLES, steepest, stride, threads_for, total
from mdstopo.optimizer.wide_passes import PIECE, wide_change, wide_shift, wide_shift_few, wide_steepest_and_sum
from mdstopo.optimizer.wide_slots import COST, HIGH, LOW, SLOTS
from mdstopo.settings.optimizer_presets import Settings

Indices = NDArray[np.intp]
T = TypeVar("T")

#: variables from which on this way is taken
MANY_VARIABLES = 256
_LEAST_SAMPLE = 256
#: where more than one in so many variables had a slot, the memory of the slots is not kept
MUCH = 16


class Proposal(NamedTuple):
    """The next design (N,), what the model promises of the objective there, the KKT residual at the iterate."""

    trial: Floats
    promised: float
    kkt: float


class Space(NamedTuple):
    """The designs that are allowed: bounds (N,), volume rows, and the ranges (N,); all but `linear` are `short`."""

    lower: Floats
    upper: Floats
    linear: LinearRows
    rows: tuple[Floats, ...]
    unit: Floats

    @classmethod
    def of(cls, lower: Floats, upper: Floats, linear: LinearRows) -> "Space":
        """The space of designs within bounds and rows."""
        unit = short(ranges(lower, upper))
        return cls(short(lower), short(upper), linear, tuple(short(row) for row in linear.A), unit)


def ranges(lower: Floats, upper: Floats) -> Floats:
    """How far each variable can go (N,); 1 where it cannot."""
    width = upper - lower
    return np.where(width > 0.0, width, 1.0)


def short(x: Floats) -> Floats:
    """The first piece of a long array whose numbers are all alike, which stands for the whole; any other array as it
    is."""
    return x[:PIECE] if len(x) >= VERY_MANY_VARIABLES and bool((x == x[0]).all()) else x


class Kept(Generic[T]):
    """A function of arrays that keeps its last two results.

    Arrays are known by their identity, so that none may be changed in place.
    """

    def __init__(self, function: Callable[..., T]) -> None:
        self._function = function
        self._kept: list[tuple[tuple[Floats, ...], T]] = []

    def __call__(self, *arrays: Floats) -> T:
        """What the function gives for these arrays, the same objects."""
        for known, result in self._kept:
            if all(map(is_, known, arrays)):
                return result
        result = self._function(*arrays)
        self.tell(result, *arrays)
        return result

    def tell(self, result: T, *arrays: Floats) -> None:
        """Note the result of the function for these arrays, which is known already."""
        self._kept = [(arrays, result), *self._kept[:1]]


class Room:
    """Arrays for `wide_minimum`, kept from one step to the next: new memory takes longer to get than to fill.

    slots (SLOTS, N), place, listed (N,), counts (2, pieces), x (N,). made: the step of which listed and counts tell who
    may have moved, or None. signs: two of (N/32,), because `wide_shift_few` reads the last step's while it writes this
    one's; signed: the step of which the first tell, or None.
    """

    def __init__(self) -> None:
        self._n = -1
        self.made: Step | None = None
        self.signed: Step | None = None

    def of(self, n: int) -> tuple[Floats, Ints, Ints, Ints, Floats]:
        """The arrays for n variables."""
        if n != self._n:
            self._n, self.made, self.signed = n, None, None
            self._who = _thin(n), np.empty((2, -(-n // PIECE)), dtype=np.int64)
            self.signs = np.empty(-(-n // 32), dtype=np.int64), np.empty(-(-n // 32), dtype=np.int64)
            self._take()
        (slots, place, x), (listed, counts) = self._slots, self._who
        return slots, place, listed, counts, x

    def used(self, count: int) -> None:
        """Note how many slots were used; where that is much memory it is freed."""
        if self._n >= LIGHT and count > self._n // MUCH:
            self._take()

    def _take(self) -> None:
        n = self._n
        self._slots = _thin(SLOTS * n).view(np.float64).reshape(SLOTS, n), _thin(n), _thin(n).view(np.float64)


def _thin(n: int) -> Ints:
    """Memory of which, where it is much, only the pages that are written to are taken, and those the small ones."""
    return np.frombuffer(mmap(-1, 8 * n), dtype=np.int64) if n >= LIGHT else np.empty(n, dtype=np.int64)


class Measures:
    """Numbers of designs and gradients that several steps need and that are kept: change, excess, steepest."""

    def __init__(self, space: Space) -> None:
        self.space = space
        self.change = Kept(lambda x, y: largest_change(x, y, space.unit))
        self.excess = Kept(lambda x: excess(space, x))
        self.steepest = Kept(steepest)
        self.room = Room()

    def look(self, gradients: Floats, x: Floats) -> None:
        """Compute `steepest` of the gradients (R, N) and `excess` of x, in one pass where that is possible."""
        rows = self.space.rows
        if (
            len(x) >= VERY_MANY_VARIABLES
            and gradients.shape == (1, len(x))
            and gradients.flags.c_contiguous
            and len(rows) == 1
        ):
            most, total = wide_steepest_and_sum(gradients[0], rows[0], x, threads_for(len(x), LIGHT))
            self.steepest.tell(np.array([most]), gradients)
            self.excess.tell(total - self.space.linear.b, x)


def is_wide(state: GsaoState, linear: LinearRows, settings: Settings) -> bool:
    """Whether `propose` may make the next step of a state."""
    return (
        len(state.alpha) >= MANY_VARIABLES
        and len(linear) == 1
        and state.convex > 0.0
        and settings.number("power") != 0.0
        and not settings.flag("zero_shift")
        and not settings.flag("sign_rule")
    )


def propose(state: GsaoState, chosen: Indices, measures: Measures, settings: Settings) -> Proposal | None:
    """The next step from a state, whose competing rows are `chosen`.

    Nothing where more than the highest row decides, or where the subproblem resists.
    """
    alpha, n, row = state.alpha, len(state.alpha), int(chosen[0])
    lower, upper, linear, (cost,), _ = measures.space
    slope, bound = np.ascontiguousarray(state.gradients[row]), float(linear.b[0])
    sizes = measures.steepest(state.gradients)
    own = float(sizes[row])
    steepest = own if len(chosen) == 1 else float(sizes[chosen].max())
    if own == 0.0 or not isfinite(steepest):
        return None
    power = settings.number("power")
    share = inf if power == 1.0 else 1.0 - settings.number("shift_margin")
    limits = np.array([power, settings.number("move_limit"), state.trust, share, state.convex * steepest])
    left = float(measures.excess(alpha)[0])
    scale = scale_of(lower, upper)
    room = measures.room
    room.made = None
    trial, (slots, place, listed, counts, x) = np.empty(n), room.of(n)
    multiplier, miss, size, change, residual, plain, scaled, count = wide_minimum(
        alpha, slope, cost, state.shift.array(), lower, upper, limits, bound, left + bound, bool(linear.equal[0]),
        own / scale, _stride(n), 1e-12 * (2.0 * abs(bound) + abs(left)), threads_for(n), trial, slots, place, listed,
        counts, x,
    )  # fmt: skip
    room.used(count)
    if not (isfinite(change) and isfinite(multiplier)) or (abs(miss) > ROW_SOLVED * size and multiplier != 0.0):
        return None
    if miss > ROUNDING * size or (linear.equal[0] and miss < -ROUNDING * size):
        trial = _touched_up(trial, slots[:, :count], place[:count], measures, ROUNDING * size)
    else:
        measures.change.tell((plain, scaled), trial, alpha)
        room.made = Step(trial, alpha)
    if not _decides(state, chosen, trial, lower, upper, power):
        return None
    slack = 0.0 if linear.equal[0] else abs(multiplier * left) / (scale * own)
    return Proposal(trial, float(state.rows[row]) + change, max(residual / scale, slack))


def _decides(state: GsaoState, chosen: Indices, trial: Floats, lower: Floats, upper: Floats, power: float) -> bool:
    """Whether one row decides the step: no other row is higher than it at the trial, and no limit is violated there.

    state: the iterate with its rows, cuts and constraint rows.
    chosen (k,): places of the competing rows; the first of them is the one that the trial minimises.
    trial (N,): the design.
    lower, upper (N,): bounds, or a piece of them where their numbers are all alike.
    power: the exponent xi of the approximation.
    """
    n = len(trial)
    if len(chosen) + len(state.cuts) + len(state.constraint_rows) == 1:
        return True
    values = []
    for some, of in (
        (state.gradients[chosen], state.rows[chosen]),
        (state.cut_gradients.reshape(-1, n), state.cuts),
        (state.constraint_gradients.reshape(-1, n), state.constraint_rows),
    ):
        found = np.zeros(len(of))
        if len(of):
            wide_rows(np.ascontiguousarray(some), state.alpha, trial, state.shift.array(), lower, upper, power, found)
        values.append(of + found)
    objective, cuts, limits = values
    return bool(objective.max() <= objective[0] and cuts.max(initial=-inf) <= objective[0] and not (limits > 0.0).any())


class ShiftRule(NamedTuple):
    """How shifts follow steps: numbers (4,), factors where these agree and oppose each other, smallest and largest
    shift; within, the last two as `Shifts.within` has them."""

    numbers: Floats
    within: tuple[float, float]

    @classmethod
    def of(cls, settings: Settings) -> "ShiftRule":
        """The rule that the settings state."""
        numbers = [settings.number(f"shift_{name}") for name in ("grow", "shrink", "minimum", "maximum")]
        return cls(np.array(numbers), (numbers[2], numbers[3]))


def next_wide_shift(shift: Shifts, last: Step, step: Step, rule: ShiftRule, room: Room) -> Shifts:
    """The next distances of the shifts, as `safeguards.next_shift`, from those that moved where these are known."""
    made, n = room.made == step, len(step.to)
    known = made and room.signed == last and shift.within == rule.within
    _, _, moves, counts, _ = room.of(n)  # what was listed has become what moves in `measure`
    if known:
        # NumPy's sum takes several times as long after an evaluation, which has displaced its code from the caches
        shifts, array, places, before, count = shift.following(sum(counts[1].tolist()))
    else:
        array, places, before = np.empty(n), np.empty(0, dtype=np.int64), np.empty(0)
        shifts, count = Shifts(array, rule.within), np.zeros(1, dtype=np.int64)
        threads = threads_for(n, LIGHT)
        wide_shift(shift.array(), last.to, last.origin, step.to, step.origin, rule.numbers, threads, array)
    room.signed = None
    if made:
        signs_before, signs = room.signs
        wide_shift_few(array, moves, counts, signs_before, signs, known, rule.numbers, places, before, count)
        room.signs, room.signed = (signs, signs_before), step
    return shifts


def largest_change(x: Floats, y: Floats, unit: Floats) -> tuple[float, float]:
    """The largest change max |x - y|, and the largest in units of each variable."""
    if len(x) >= VERY_MANY_VARIABLES:
        plain, scaled = wide_change(x, y, unit, threads_for(len(x), LIGHT))
        return plain, scaled
    change = np.abs(x - y)
    return float(change.max(initial=0.0)), float((change / unit).max(initial=0.0))


def excess(space: Space, x: Floats) -> Floats:
    """By how much a design exceeds the bounds of the linear rows: A x - b (m,)."""
    if len(x) < VERY_MANY_VARIABLES:
        return space.linear.excess(x)
    return np.array([total(row, x) for row in space.rows]) - space.linear.b


def _touched_up(trial: Floats, slots: Floats, place: Ints, measures: Measures, rounding: float) -> Floats:
    """A design without the last rounding errors of the volume row, taken from the variables inside their boxes."""
    low, high, space = slots[LOW], slots[HIGH], measures.space
    left = float(measures.excess(trial)[0])
    for _ in range(20):
        if abs(left) <= rounding or (left < 0.0 and not space.linear.equal[0]):
            return trial
        at = trial[place]
        push = np.where((at > low) & (at < high), slots[COST], 0.0)
        square = float(np.einsum("i,i->", push, push))
        if square == 0.0:
            break
        trial = trial.copy()  # `Measures` keeps what it knows of the other array
        trial[place] = np.clip(at - left / square * push, low, high)
        left = float(measures.excess(trial)[0])
    lower, upper = (np.resize(end, len(trial)) for end in (space.lower, space.upper))
    return repair(trial, lower, upper, space.linear)


@cache
def _stride(n: int) -> int:
    """Every how many variables one is in the sample."""
    return stride(n, min(SAMPLE, max(_LEAST_SAMPLE, n // 64)))
