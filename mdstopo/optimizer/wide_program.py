"""The subproblem of very many variables and few rows that are lines, solved as exactly as one of few variables.

    minimise   e_0 + sum_j penalty_j e_j + sum_i h_i d_i^2 / 2 - w' M^-1 w / 2
    subject to f_k + Q_k d <= e_g,  e_j >= 0;   A d <= b or A d = b;   w = Z d;   d in the box

An interior point over all variables goes through them some thirty times. But only the rows' multipliers couple the
variables: with them known, each goes to an end of its box or to -r_i/h_i. So

1. a sample of the variables, each standing for its neighbours, gives multipliers that are nearly right;
2. one pass over all finds those that they leave in doubt, a few per cent; what the others add is summed up. Of those
   that are surely inside their boxes, whose steps are linear in the multipliers, a matrix of the size of the rows is
   kept, and stands for them as that many variables without bounds;
3. where those in doubt are many, a sample of them narrows the doubt to few;
4. these few and the matrix are a program of some thousand variables (`wide_interior`), whose multipliers are those of
   the whole;
5. one pass computes all steps from them. Who does not do what was assumed joins the few, and the last steps are
   repeated.

So what is found solves the whole program to the tolerance of the small one.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mdstopo.optimizer.problem import Bools, Floats, Ints, largest_of_groups
from mdstopo.optimizer.wide_classes import DOUBT, LONGEST, SCALED, TRUST, H, finish, sort
from mdstopo.optimizer.wide_curvature import compact
from mdstopo.optimizer.wide_interior import CURVED, LIMIT, LINE, NO_BOUND, NO_MULTIPLIER, interior
from mdstopo.optimizer.wide_numbers import stride, threads_for
from mdstopo.optimizer.wide_passes import PIECE

#: variables of a sample at least (of a sample of those in doubt, too) and at most; between, a sample has one of so
#: many. Up to how many variables in doubt are solved for at once, without a sample
LEAST_SAMPLE, LARGEST_SAMPLE, VARIABLES_PER_MORE, FEW_IN_DOUBT = 768, 4_096, 256, 3_000
#: mean product and residual of a solution of the small program, in its own scale; what counts as one; and of a sample
EXACT, ENOUGH, ROUGH = (1e-14, 1e-11), (1e-8, 1e-8), (1e-9, 1e-9)
#: what counts of a sample, in what was to be reached
SAMPLE_SLACK = 1e3
MAX_STEPS = 100.0
#: the doubt that a sample of n leaves, times the root of n; how often those who were taken for decided are added, or
#: all are sorted again where they are more than this share of all
DOUBTFUL, MOST_ROUNDS, AGAIN = 2.5, 12, 0.1
#: by what the doubt grows where the program of those in doubt has no solution
DOUBT_GROWS = 4.0
#: eigenvalues of the matrix of those inside their boxes that count, of the largest
LEAST_EIGENVALUE = 1e-15
#: what the product of a row's slack and its multiplier is at first, at most
CENTRED = 1.0
#: what the multipliers of bounds are at first, in the largest derivative
OUTWEIGH = 2.0
#: multipliers of lines below this, in mean products, are none
NONE = 10.0
#: how far below others a row is said to be at most, in what rows can change by; where variables have no bounds
FAR_BELOW, FAR_BELOW_UNBOUNDED = 10.0, 1e3
#: M of a row of the curvature that is to weigh nothing
WEIGHTLESS = 1e20


class Region(NamedTuple):
    """The designs that a step may reach: x (N,), bounds and ranges (N,) or a few of them where all are alike, and
    `limits` of `wide_classes` but the doubt."""

    x: Floats
    lower: Floats
    upper: Floats
    unit: Floats
    limits: Floats

    def box(self, places: Ints | slice) -> tuple[Floats, Floats, Floats]:
        """The ends of the box, relative to x, and h of some variables."""
        lower, upper, unit = (
            each[places] if len(each) == len(self.x) else each[:1] for each in (self.lower, self.upper, self.unit)
        )
        at = self.x[places]
        reach = np.minimum(self.limits[LONGEST], self.limits[TRUST] * unit)
        low = np.minimum(np.maximum(lower, at - reach) - at, 0.0)
        high = np.maximum(np.minimum(upper, at + reach) - at, 0.0)
        own = self.limits[H] / (unit * unit if self.limits[SCALED] else 1.0)
        return low, high, own + np.zeros(len(at))


class Room(NamedTuple):
    """Arrays for one pass after another: classes (2, N), listed (N,), counts (pieces,)."""

    classes: Bools
    listed: Ints
    counts: Ints

    @classmethod
    def of(cls, n: int) -> "Room":
        """The arrays for n variables."""
        pieces = -(-n // PIECE)
        return cls(np.zeros((2, n), dtype=np.bool_), np.zeros(n, dtype=np.int64), np.zeros(pieces, dtype=np.int64))

    def variables(self) -> Ints:
        """The variables that the last pass has listed, in order."""
        counts = self.counts.tolist()
        return np.concatenate([self.listed[k * PIECE : k * PIECE + count] for k, count in enumerate(counts)])


@dataclass(frozen=True, slots=True)
class WideProgram:
    """A program. pool (S, N): rows, of which `places` (R,) are lines, then linear rows, then rows Z of the curvature.

    offset (R,): the value at d = 0 of a line, A x - b of a linear row, 0 of a row of the curvature; kind (R,) as
    `wide_interior` has it, group (R,) of a line; penalty (J,); M (R, R), 0 but of rows of the curvature;
    products (2 m, 2 m): of the latter, in ranges.
    """

    region: Region
    pool: Floats
    places: Ints
    offset: Floats
    kind: Ints
    group: Ints
    penalty: Floats
    M: Floats
    products: Floats

    def columns(self, some: Ints | slice) -> Floats:
        """The rows' entries (R, n) of some variables."""
        return np.ascontiguousarray(
            self.pool[self.places][:, some] if isinstance(some, slice) else self.pool[self.places[:, None], some]
        )

    def with_products(self, products: Floats) -> "WideProgram":
        """The same program with the curvature of these products; that of a sample is positive only by its own."""
        found = compact(products, len(products) // 2, float(self.region.limits[H]))
        if found is None:
            return self.without_curvature()
        M, curved = np.zeros_like(self.M), self.kind == CURVED
        M[np.ix_(curved, curved)] = found
        return replace(self, M=M)

    def without_curvature(self) -> "WideProgram":
        """The same program with rows of the curvature that weigh next to nothing."""
        return replace(self, M=np.diag(np.where(self.kind == CURVED, -WEIGHTLESS, 0.0)))


class Few(NamedTuple):
    """Some of the variables: their numbers, columns (R, n), ends and h (n,), and how many variables each stands for."""

    which: Ints
    Q: Floats
    low: Floats
    high: Floats
    h: Floats
    weight: float = 1.0

    def some(self, part: slice | Bools, weight: float = 1.0) -> "Few":
        """A part of these variables."""
        Q = np.ascontiguousarray(self.Q[:, part])
        return Few(self.which[part], Q, self.low[part], self.high[part], self.h[part], weight)

    def joined(self, other: "Few") -> "Few":
        """These variables, then the others."""
        one, two = (np.stack([each.low, each.high, each.h]) for each in (self, other))
        which, Q = np.concatenate([self.which, other.which]), np.concatenate([self.Q, other.Q], axis=1)
        return Few(which, Q, *np.concatenate([one, two], axis=1))


class Guess(NamedTuple):
    """Multipliers theta (R,) that are nearly right: they are wrong by up to `doubt` times spread (R,)."""

    theta: Floats
    spread: Floats
    doubt: float

    def moved(self, theta: Floats, doubt: float) -> "Guess":
        """The guess of other multipliers, where they are known to be no larger than the largest that were met."""
        return Guess(theta, np.maximum(self.spread, np.abs(theta)), doubt)


class Found(NamedTuple):
    """What an iteration has found: multipliers theta (R,); the steps (n,) of variables in doubt; whether that is a
    solution."""

    theta: Floats
    d: Floats
    solved: bool


class WideSolution(NamedTuple):
    """The trial (N,); multipliers (R,) of all rows; their changes Q d (R,); d'B d/2; those who were solved for in the
    end; whether it is a solution."""

    trial: Floats
    theta: Floats
    change: Floats
    curved: float
    few: Few
    solved: bool


def solve(program: WideProgram, room: Room) -> WideSolution:
    """Solve a program; the same to the bit on any number of threads."""
    region, n = program.region, len(program.region.x)
    nothing = np.zeros(len(program.places))
    sample = np.arange(0, n, stride(n, min(LARGEST_SAMPLE, max(LEAST_SAMPLE, n // VARIABLES_PER_MORE))))
    every = _some(program, sample, n / len(sample))
    theta, _ = _multipliers(program, every, None, nothing, np.zeros((len(nothing), 0)))
    guess = Guess(theta, np.abs(theta), DOUBTFUL / np.sqrt(len(sample)))
    few, sums, inside, guess = _doubtful(program, guess, room)
    trial, change = np.empty(n), np.empty(len(theta))
    for attempt in range(MOST_ROUNDS):
        found = _solved(program, few, sums, inside, EXACT)
        if not found.solved and attempt < MOST_ROUNDS - 1 and len(few.which) < n:
            # those in doubt cannot meet what the others leave: there have to be more
            guess = guess._replace(doubt=DOUBT_GROWS * guess.doubt)
            few, sums, inside, guess = _doubtful(program, guess, room)
            continue
        trial[few.which] = _ends(region, few, found.d)
        curved = finish(
            program.pool, program.places, found.theta, *region[:4], region.limits, threads_for(n), room.classes, trial,
            room.listed, room.counts, change,
        )  # fmt: skip
        others = room.variables()
        if not len(others) or not found.solved:
            break
        if len(others) > AGAIN * n and attempt < MOST_ROUNDS // 2:
            between = np.abs(found.theta - guess.theta) / guess.doubt
            guess = guess.moved(found.theta, guess.doubt)
            few, sums, inside, guess = _doubtful(program, guess._replace(spread=guess.spread + between), room)
        else:
            few, sums, inside = _joined(program, few, others, sums, inside, room)
    w = change[program.kind == CURVED] @ found.theta[program.kind == CURVED]
    return WideSolution(trial, found.theta, change, 0.5 * (curved + float(w)), few, found.solved and not len(others))


def _some(program: WideProgram, which: Ints, weight: float = 1.0) -> Few:
    low, high, h = program.region.box(which)
    return Few(which, program.columns(which), low, high, h, weight)


def _ends(region: Region, few: Few, d: Floats) -> Floats:
    """Where the steps d (n,) of a few lead, ends of the box and bounds to the bit."""
    lower, upper = (e[few.which] if len(e) == len(region.x) else e[:1] for e in (region.lower, region.upper))
    return np.clip(region.x[few.which] + d, lower, upper)


def _multipliers(
    program: WideProgram, sample: Few, whole: Few | None, sums: Floats, inside: Floats
) -> tuple[Floats, bool]:
    """The multipliers (R,) of a program of a sample of some variables, or of all of them (None), beside what others
    add; and whether they are those of a solution."""
    nearly = program
    if len(program.products):
        products = _products(program, sample)
        if whole is not None:
            products += program.products - _products(program, whole)
        nearly = program.with_products(products)
    found = _solved(nearly, sample, sums, inside, ROUGH)
    if not found.solved and len(program.products):
        found = _solved(program.without_curvature(), sample, sums, inside, ROUGH)
    return np.where(np.isfinite(found.theta), found.theta, 0.0), found.solved


def _products(program: WideProgram, few: Few) -> Floats:
    """What some variables add to the products of the curvature's rows."""
    unit = program.region.unit
    wide = unit[few.which] if len(unit) == len(program.region.x) else unit[:1]
    Z = few.Q[program.kind == CURVED]
    return np.asarray(few.weight * (Z * wide**2) @ Z.T)


def _doubtful(program: WideProgram, guess: Guess, room: Room) -> tuple[Few, Floats, Floats, Guess]:
    """Those that multipliers leave in doubt, and what the others add: the sums (R,) of those at ends of their boxes,
    and the columns (R, p) that stand for those inside; `room.classes` say which they are. And the guess, its doubt as
    it was, with the largest multipliers that were met."""
    region, first = program.region, guess
    limits = region.limits.copy()
    limits[DOUBT] = guess.doubt
    sums, inside = np.empty(len(guess.theta)), np.empty((len(guess.theta), len(guess.theta)))
    sort(
        program.pool, program.places, guess.theta, guess.spread, *region[:4], limits, threads_for(len(region.x)),
        room.classes, room.listed, room.counts, sums, inside,
    )  # fmt: skip
    few = _some(program, room.variables())
    met = np.abs(guess.theta)
    while len(few.which) > FEW_IN_DOUBT:
        n = len(few.which)
        part = slice(None, None, stride(n, LEAST_SAMPLE))
        sample = few.some(part, n / len(few.which[part]))
        theta, solved = _multipliers(program, sample, few, sums, _factor(inside))
        if not solved:
            # they cannot meet what the others leave: there have to be more of them
            if n == len(region.x) or first.doubt > 1.0:
                break
            return _doubtful(program, first._replace(doubt=DOUBT_GROWS * first.doubt), room)
        met = np.maximum(met, np.abs(theta))
        guess = Guess(theta, met, guess.doubt * max(DOUBTFUL / np.sqrt(len(sample.which)), 2.0 * FEW_IN_DOUBT / n))
        few, sums, inside = _decided(few, guess, sums, inside, room)
        if len(few.which) > 0.5 * n:
            break
    return few, sums, _factor(inside), guess.moved(guess.theta, first.doubt)


def _decided(few: Few, guess: Guess, sums: Floats, inside: Floats, room: Room) -> tuple[Few, Floats, Floats]:
    """Decide some of a few variables by a better guess; returns as `_doubtful`, sums with what others add."""
    r, doubt = guess.theta @ few.Q, guess.doubt * (guess.spread @ np.abs(few.Q))
    least, most = r + few.h * few.low, r + few.h * few.high
    low, high = least > doubt, most < -doubt
    within = (least < -doubt) & (most > doubt)
    rest = ~(low | high | within)
    room.classes[0, few.which], room.classes[1, few.which] = within | rest, high | rest
    sums = sums + few.Q[:, low] @ few.low[low] + few.Q[:, high] @ few.high[high]
    inside = inside + (few.Q[:, within] / few.h[within]) @ few.Q[:, within].T
    return few.some(rest), sums, inside


def _joined(
    program: WideProgram, few: Few, others: Ints, sums: Floats, inside: Floats, room: Room
) -> tuple[Few, Floats, Floats]:
    """Take variables that were wrongly taken for decided into those that are solved for.

    Constant:
      program: the whole program.
    In:
      few: the variables that are solved for.
      others (n,): which variables join them.
      sums (R,), inside (R, p): what variables at ends of their boxes, and those inside, add to the rows (`_doubtful`).
    Out:
      room: its `classes` put the others in doubt.

    Returns the few with the others, and `sums` and `inside` without these.
    """
    more = _some(program, others)
    within, beyond = room.classes[0, others], room.classes[1, others]
    d = np.where(within, 0.0, np.where(beyond, more.high, more.low))
    sums = sums - more.Q @ d
    if within.any():
        taken = (more.Q[:, within] / more.h[within]) @ more.Q[:, within].T
        inside = _factor(inside @ inside.T - taken)
    room.classes[:, others] = True
    return few.joined(more), sums, inside


def _factor(product: Floats) -> Floats:
    """L (R, p) with L L' = product (R, R): the columns of as many variables without bounds, with h = 1."""
    size = np.sqrt(np.maximum(np.diag(product), 0.0))
    if not size.any() or not np.isfinite(size).all():
        return np.zeros((len(size), 0))
    unit = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(product / unit[:, None] / unit)
    used = values > LEAST_EIGENVALUE * values[-1]
    return np.asarray(size[:, None] * vectors[:, used] * np.sqrt(values[used]))


def _solved(program: WideProgram, few: Few, sums: Floats, inside: Floats, wanted: tuple[float, float]) -> Found:
    """The small program: a few variables, those of `inside` (R, p) without bounds, and what others add."""
    R, p, n = len(program.places), inside.shape[1], len(few.which)
    line, group, kind = program.kind == LINE, program.group, program.kind
    width = few.high - few.low
    Q = np.empty((R, n + p))
    np.multiply(few.Q, width * few.weight, out=Q[:, :n])
    Q[:, n:] = inside
    sizes = np.abs(Q)
    steepest = sizes.max(axis=1, initial=0.0) / few.weight
    of_group = largest_of_groups(steepest[line], group[line], len(program.penalty) + 1)
    of_group = np.where(np.isfinite(of_group) & (of_group > 0.0), of_group, 1.0)
    scale = np.where(line, of_group[group], np.where(steepest > 0.0, steepest, 1.0))
    own = float(of_group[0])
    Q /= scale[:, None]
    at = np.zeros(n + p)
    np.divide(-few.low, width, out=at[:n], where=width > 0.0)
    # the objective's level is counted from the highest row
    value, objective = program.offset + sums, line & (group == 0)
    base = float(value[objective].max(initial=-np.inf)) if objective.any() else 0.0
    f = (value - np.where(objective, base, 0.0)) / scale - Q @ at
    size = np.maximum(1.0, sizes.sum(axis=1) / scale)
    # a row that cannot come up to others might else be farther off than what all products together are rounded to
    f = np.where(line, np.maximum(f, -(FAR_BELOW if p == 0 else FAR_BELOW_UNBOUNDED) * float(size.max())), f)
    frame = np.stack([at, np.full(n + p, 1.0 / own)])
    frame[1, :n] = few.h * width**2 * few.weight / own
    penalty = np.concatenate([[1.0 if objective.any() else 0.0], program.penalty * of_group[1:] / own])
    v, bounds, rows, levels = _start(kind, group, Q, f, at, n, penalty)
    _, gap, worst = interior(
        Q, f, kind, group, program.M * (own / (scale[:, None] * scale)), frame, n, penalty, size, v, bounds, rows,
        levels, np.array([*wanted, MAX_STEPS]),
    )  # fmt: skip
    wl, wu, zl, zu = bounds[:, :n]
    d = np.where(wl < wu, few.low + wl * width, few.high - wu * width)
    d = np.where((zl > wl) & (wl < 1e-6), few.low, np.where((zu > wu) & (wu < 1e-6), few.high, d))
    enough = np.maximum(SAMPLE_SLACK * np.array(wanted), ENOUGH)
    theta = np.where(line & (rows[1] <= NONE * wanted[0]), 0.0, rows[1]) * own / scale
    return Found(theta, d, bool(gap <= enough[0] and worst <= enough[1] and np.isfinite(d).all()))


def _start(
    kind: Ints, group: Ints, Q: Floats, f: Floats, at: Floats, bounded: int, penalty: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """A point inside the bounds with which `wide_interior.interior` begins: v, bounds, rows, levels.

    kind (R,): what each row is, as `wide_interior` has it.
    group (R,): the group of each line.
    Q (R, n), f (R,): the scaled rows Q v + f.
    at (n,): the variables at the iterate.
    bounded: how many of them, the first ones, are in [0, 1].
    penalty (J + 1,): of the objective's level, then of the constraints'.
    """
    mu, line = 0.1, kind == LINE
    v = at.copy()
    v[:bounded] = np.clip(at[:bounded], 0.1, 0.9)
    bounds = np.full((4, len(v)), mu)
    bounds[0, :bounded], bounds[1, :bounded] = v[:bounded], 1.0 - v[:bounded]
    bounds[:2, bounded:], bounds[2:, bounded:] = NO_BOUND, NO_MULTIPLIER
    row = Q @ v + f
    e = largest_of_groups(row[line], group[line], len(penalty))
    e = np.where(np.isfinite(e), e, 0.0)
    e[1:] = np.maximum(e[1:], 0.0)
    e += mu
    counts = np.bincount(group[line], minlength=len(penalty))
    top = np.concatenate([[1.0], np.minimum(0.5 * penalty[1:], 1.0)])
    rows = np.zeros((2, len(f)))
    rows[0] = np.where(line, e[group] - row, np.maximum(-row, mu))
    # products of a slack and its multiplier that differ by orders of magnitude would make steps short
    share = np.minimum((top / np.maximum(counts, 1))[group], CENTRED / rows[0])
    rows[1] = np.where(line, share, np.where(kind == LIMIT, np.minimum(mu, CENTRED / rows[0]), 0.0))
    # multipliers of bounds that can outweigh any derivative, or the first steps would be short
    bounds[2:, :bounded] = mu + OUTWEIGH * float(np.abs(rows[1] @ Q[:, :bounded]).max(initial=0.0))
    carried = np.bincount(group[line], weights=share[line], minlength=len(penalty))
    return v, bounds, rows, np.stack([e, np.concatenate([[0.0], (penalty - carried)[1:]])])
