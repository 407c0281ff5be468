"""The step of many variables against the interior point, and what it promises."""

from itertools import pairwise

import numpy as np
import pytest

from mdstopo.compiler.jit import vector_entry
from mdstopo.compiler.threads import VARIABLE
from mdstopo.optimizer import gsao, separable, wide, wide_numbers
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.gsao_state import Step
from mdstopo.optimizer.powers import largest, powers, primitives
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.safeguards import next_shift, no_cuts
from mdstopo.optimizer.shifts import Shifts
from mdstopo.optimizer.state import State
from mdstopo.optimizer.wide_kernels import COARSER, FEWEST_SAMPLED
from mdstopo.optimizer.wide_slots import BEYOND_MULTIPLIERS, ROOM, ROW, SLOTS, WHOLE, bracket_slots, enter_slot, root
from mdstopo.settings.optimizer_presets import settings
from tests.space.in_python import in_python  # noqa: F401  # a fixture

N = 12_000
SIZES = [wide.MANY_VARIABLES, 1_020, N]


class Many:
    """A sum of reciprocal and rising terms over a volume row."""

    def __init__(self, seed: int, equal: bool, n: int = N) -> None:
        rng = np.random.default_rng(seed)
        self.falling = np.exp(rng.normal(-1.0, 2.0, n))
        self.rising = np.where(rng.random(n) < 0.3, np.exp(rng.normal(0.0, 1.0, n)), 0.0)
        self.initial = np.full(n, 0.3)
        self.lower = np.where(rng.random(n) < 0.1, 0.3, 1e-3)
        self.upper = np.where(rng.random(n) < 0.1, 0.3, 1.0)
        cost = np.where(rng.random(n) < 0.1, 0.0, rng.uniform(0.5, 2.0, n))
        self.linear = LinearRows(cost[None], np.array([0.3 * cost.sum()]), np.array([equal]))

    def evaluate(self, x, gradient=True):
        terms = self.falling / (x + 0.1) + self.rising * x
        slope = -self.falling / (x + 0.1) ** 2 + self.rising
        value = np.array([terms.sum()])
        return Sample(float(value[0]), value, slope[None], np.zeros(0), np.zeros((0, len(x))))


def states(problem, steps, monkeypatch=None, **options):
    if monkeypatch is not None:
        monkeypatch.setattr(wide, "MANY_VARIABLES", 10**9)
        for module in (gsao, separable, wide, wide_numbers):
            monkeypatch.setattr(module, "VERY_MANY_VARIABLES", 10**9)
    optimizer = Gsao(problem, settings("default", options, max_iterations=100))
    found = [optimizer.start()]
    while found[-1].running and len(found) < steps:
        found.append(optimizer.step(found[-1]))
    return found


def measures_of(problem):
    return wide.Measures(wide.Space.of(problem.lower, problem.upper, problem.linear))


@pytest.mark.parametrize("equal", [False, True])
@pytest.mark.parametrize("options", [{}, {"power": -1.0}, {"power": 1.0}, {"move_limit": 0.05}, {"convex_start": 1.0}])
@pytest.mark.parametrize("n", SIZES)
def test_a_step_is_that_of_the_interior_point(n, equal, options, monkeypatch):
    problem = Many(1, equal, n)
    chosen = settings("default", options)
    for state in states(problem, 5, monkeypatch, **options):
        new = wide.propose(state, np.array([0]), measures_of(problem), chosen)
        size = abs(state.objective)
        assert state.objective - new.promised == pytest.approx(state.predicted, rel=1e-7, abs=1e-10 * size)
        assert state.objective - new.promised >= state.predicted - 1e-12 * size
        assert new.kkt == pytest.approx(state.kkt, rel=1e-5, abs=1e-8)
        assert np.abs(new.trial - state.trial).max() < 1e-3
        assert np.abs(new.trial - state.trial).mean() < 1e-6


def resting(seed, equal, n):
    """A problem that begins with nine variables in ten on a bound, where it would nearly always keep them."""
    problem = Many(seed, equal, n)
    rng = np.random.default_rng(seed)
    problem.falling = np.exp(rng.normal(-1.0, 8.0, n))
    at = np.where(problem.falling > 1.0, problem.upper, problem.lower)
    problem.initial = np.where(rng.random(n) < 0.9, at, problem.initial)
    problem.linear.b[:] = problem.linear.A @ problem.initial
    return problem


def bisected(problem, state, chosen):
    """The step by bisection alone, of the multiplier and of each variable; and the KKT residual at the iterate."""
    slope, cost, c = state.gradients[0], problem.linear.A[0], state.alpha
    span, power = wide.ranges(problem.lower, problem.upper), chosen.number("power")
    reach = state.shift.array() * span
    kappa = state.convex * np.abs(slope).max() / span
    most = np.minimum(np.minimum(chosen.number("move_limit"), state.trust * span), 0.9 * reach)
    low, high = np.maximum(problem.lower, c - most), np.minimum(problem.upper, c + most)

    def at(multiplier):
        left, right = low, high
        for _ in range(60):
            x = 0.5 * (left + right)
            t = 1.0 + np.where(slope < 0.0, x - c, c - x) / reach
            rises = slope * t ** (power - 1.0) + kappa * (x - c) + multiplier * cost > 0.0
            left, right = np.where(rises, left, x), np.where(rises, x, right)
        return np.where(left == low, low, right)

    least, largest = -np.abs(slope).max() * 1e3 if problem.linear.equal[0] else 0.0, np.abs(slope).max() * 1e3
    for _ in range(80):
        multiplier = 0.5 * (least + largest)
        over = cost @ at(multiplier) > problem.linear.b[0]
        least, largest = (multiplier, largest) if over else (least, multiplier)
    moved = np.clip(c - (slope + multiplier * cost) / np.abs(slope).max(), problem.lower, problem.upper)
    return at(multiplier), np.abs(c - moved).max()


@pytest.mark.parametrize("equal", [False, True])
@pytest.mark.parametrize("n", [wide.MANY_VARIABLES, 1_020, wide.PIECE + 5])
def test_of_variables_that_rest_nothing_changes_what_the_others_do(n, equal):
    problem, chosen = resting(10, equal, n), settings()
    for state in states(problem, 3)[1:]:
        new = wide.propose(state, np.array([0]), measures_of(problem), chosen)
        expected, kkt = bisected(problem, state, chosen)
        assert 0.5 < np.mean(new.trial == state.alpha) < 1.0
        assert np.abs(new.trial - expected).max() < 1e-9
        assert new.kkt == pytest.approx(kkt, rel=1e-9)


@pytest.mark.parametrize("options", [{}, {"power": -2.5}, {"power": 0.5}, {"power": 1.0}])
@pytest.mark.parametrize("seed", [20, 21])
def test_one_multiplier_explains_where_each_of_very_many_goes(seed, options):
    """So many that a coarser sample is looked at first."""
    n = 70_001
    assert n >= FEWEST_SAMPLED * (COARSER * wide._stride(n) + 1)
    problem, chosen = resting(seed, False, n), settings("default", options)
    cost, power = problem.linear.A[0], chosen.number("power")
    share = np.inf if power == 1.0 else 0.9
    for state in states(problem, 6, **options)[1:]:
        x, c, slope = state.trial, state.alpha, state.gradients[0]
        span = wide.ranges(problem.lower, problem.upper)
        reach, kappa = state.shift.array() * span, state.convex * np.abs(slope).max() / span
        most = np.minimum(np.minimum(chosen.number("move_limit"), state.trust * span), share * reach)
        low, high = np.maximum(problem.lower, c - most), np.minimum(problem.upper, c + most)
        t = 1.0 + np.where(slope < 0.0, x - c, c - x) / reach
        derivative = slope * t ** (power - 1.0) + kappa * (x - c)
        inside = (x > low) & (x < high) & (cost > 0.0)
        assert inside.sum() > 20
        multipliers = -derivative[inside] / cost[inside]
        multiplier = float(np.median(multipliers))
        rounding = 1e-11 * (np.abs(derivative) + kappa * span)
        rises = derivative + multiplier * cost
        assert (np.abs(rises) < rounding)[inside].all()
        assert (rises >= -rounding)[(x == low) & (low < high)].all()
        assert (rises <= rounding)[(x == high) & (low < high)].all()
        assert multiplier > 0.0
        assert -3e-12 * problem.linear.b[0] < float(cost @ x) - problem.linear.b[0] < 1e-14 * problem.linear.b[0]


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("shift", [2.0, 0.2, 0.05])
def test_linear_terms_take_steps_of_any_length_beside_their_shifts(n, shift):
    problem = Many(2, True, n)
    options = {"power": 1.0, "shift_start": shift, "shift_minimum": 0.05, "trust_start": 0.2}
    cost, least, most = problem.linear.A[0], problem.lower, problem.upper
    for state in states(problem, 12, **options):
        state.cuts, state.cut_gradients, state.cuts_lowered = no_cuts(n)
        slope, reach = state.gradients[0], state.trust * wide.ranges(least, most)
        kappa = state.convex * np.abs(slope).max() / wide.ranges(least, most)
        low, high = np.maximum(least, state.alpha - reach), np.minimum(most, state.alpha + reach)

        def at(multiplier, state=state, slope=slope, kappa=kappa, low=low, high=high):
            return np.clip(state.alpha - (slope + multiplier * cost) / kappa, low, high)

        near, far = -1e6, 1e6
        for _ in range(100):
            middle = 0.5 * (near + far)
            near, far = (middle, far) if cost @ at(middle) > problem.linear.b[0] else (near, middle)
        step = at(near) - state.alpha
        promised = float(slope @ step + 0.5 * (kappa * step) @ step)
        new = wide.propose(state, np.array([0]), measures_of(problem), settings("default", options))
        assert np.abs(new.trial - at(near)).max() < 1e-9
        assert new.promised - state.objective == pytest.approx(promised, rel=1e-9, abs=1e-12 * abs(state.objective))


def rooted(numbers, x, goal, guess, power, room, whole):
    n = numbers.shape[1]
    slots, place = np.empty((SLOTS, n)), np.empty(n, np.int64)
    for k in range(n):
        a, low, high, c, s, d, kappa = numbers[:, k]
        enter_slot(slots, place, k, k, c, s, a, low, high, d, kappa)
    ends = bracket_slots(slots, n, power, room, whole)
    return root(slots, n, ends, x, goal, 0.0, guess, BEYOND_MULTIPLIERS, power, 1e-12, np.bool_(True), room, whole)[0]


@pytest.mark.usefixtures("in_python")
def test_who_comes_to_an_end_of_the_box_at_the_last_moment_is_where_the_multiplier_has_it():
    """Newton's iteration of the multiplier moves those that were inside, and must not end where another joins them."""
    n, power, rng = 64, -1.0, np.random.default_rng(0)
    room, whole = np.empty((ROOM, ROW)), np.empty((WHOLE, ROW), dtype=np.int64)

    def at(multiplier, a, low, high, c, s, d, kappa):
        left, right = low, high
        for _ in range(70):
            x = 0.5 * (left + right)
            rises = s * (1.0 + (c - x if s > 0.0 else x - c) / d) ** (power - 1.0) + kappa * (x - c) + multiplier * a
            left, right = (left, x) if rises > 0.0 else (x, right)
        return low if left == low else high if right == high else x

    for _ in range(60):
        c, s = rng.uniform(0.2, 0.8, n), -np.exp(rng.normal(0.0, 1.0, n))
        numbers = np.array([rng.uniform(0.5, 2.0, n), c - 0.15, c + 0.15, c, s, np.full(n, 0.5), 0.1 * np.abs(s)])
        j = int(rng.integers(n))
        a, _, high, _, slope, d, kappa = numbers[:, j]
        first = -(slope * (1.0 + (high - c[j]) / d) ** (power - 1.0) + kappa * (high - c[j])) / a
        multiplier = first * (1.0 + 1e-7)
        expected = np.array([at(multiplier, *numbers[:, k]) for k in range(n)])
        x = np.clip(expected + rng.normal(0.0, 0.01, n), numbers[1], numbers[2])
        goal, guess = float(numbers[0] @ expected), multiplier * (1.0 + 1e-3 * rng.normal())
        found = rooted(numbers, x, goal, guess, power, room, whole)
        assert found == pytest.approx(multiplier, rel=1e-11)
        assert np.abs(x - expected).max() < 1e-11


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("equal", [False, True])
def test_the_row_holds_to_rounding_and_the_box_is_kept(n, equal, monkeypatch):
    problem = Many(2, equal, n)
    monkeypatch.setattr(wide, "_touched_up", None)  # the root is settled where it is found
    for state in states(problem, 12):
        excess = float(problem.linear.excess(state.trial)[0])
        scale = 2.0 * float(problem.linear.b[0])
        assert excess <= 1e-14 * scale
        assert not equal or abs(excess) <= 1e-14 * scale
        assert np.all(state.trial >= problem.lower)
        assert np.all(state.trial <= problem.upper)


def test_the_same_state_gives_the_same_bits():
    problem = Many(3, True)
    one, other = states(problem, 5)[-1], states(problem, 5)[-1]
    assert np.array_equal(one.trial, other.trial)
    assert one.predicted == other.predicted
    assert one.kkt == other.kkt


def test_any_number_of_threads_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(wide_numbers, "SHARED", 1)
    for module in (wide, wide_numbers):
        monkeypatch.setattr(module, "LIGHT", 1)
    found = []
    for threads in (1, 2, 3):
        monkeypatch.setenv(VARIABLE, str(threads))
        found.append(states(Many(3, True, 50_000), 6)[-1])
    one, *others = found
    for other in others:
        assert other.kkt == one.kkt
        assert other.predicted == one.predicted
        for name in ("trial", "alpha"):
            assert np.array_equal(getattr(other, name), getattr(one, name))
        for name in ("step", "shift"):
            assert np.array_equal(getattr(other, name).array(), getattr(one, name).array())


def test_memory_that_is_let_go_of_between_steps_changes_no_bit(monkeypatch):
    kept = states(Many(3, True), 8)[-1]
    monkeypatch.setattr(wide, "LIGHT", 1)
    taken, plain = [], wide.Room._take
    monkeypatch.setattr(wide.Room, "_take", lambda room: (taken.append(room), plain(room)))
    other = states(Many(3, True), 8)[-1]
    assert len(taken) > 2
    room = wide.Room()
    slots = room.of(N)[0]
    room.used(N // 32)
    assert room.of(N)[0] is slots
    room.used(N // 8)
    assert room.of(N)[0] is not slots
    assert np.array_equal(other.trial, kept.trial)
    assert np.array_equal(other.shift.array(), kept.shift.array())


def test_a_row_that_is_far_from_its_limit_has_no_price():
    problem = Many(4, False)
    problem.linear = LinearRows(problem.linear.A, 100.0 * problem.linear.b, problem.linear.equal)
    state = states(problem, 2)[-1]
    moved = np.clip(state.trial, problem.lower, problem.upper)
    assert np.array_equal(moved, state.trial)
    assert state.predicted > 0.0
    # where nothing rises a variable goes to the end of its box
    falls = (problem.rising == 0.0) & (problem.upper > state.alpha)
    assert np.all(state.trial[falls] > state.alpha[falls])


def test_a_run_ends_where_the_interior_point_ends(monkeypatch):
    monkeypatch.setattr("mdstopo.optimizer.safeguards.CUT_TRUST", 0.0)  # with so many variables there are no cuts
    problem = Many(5, True)
    new = states(problem, 100, bundle=False)[-1]
    old = states(problem, 100, monkeypatch, bundle=False)[-1]
    assert new.status == old.status
    assert new.best_objective == pytest.approx(old.best_objective, rel=1e-6)


def test_shifts_are_those_of_the_plain_rule():
    chosen = settings()
    state = states(Many(6, True), 5)[-1]
    step = Step(state.trial, state.alpha)
    assert np.array_equal(step.array(), state.trial - state.alpha)
    shifts = wide.next_wide_shift(state.shift, state.step, step, wide.ShiftRule.of(chosen), wide.Room())
    assert np.array_equal(shifts.array(), next_shift(state.shift.array(), state.step, step, chosen))
    assert len(np.unique(shifts.array())) > 2


@pytest.mark.parametrize("start", [2.0, 0.02, 30.0])
def test_shifts_follow_the_plain_rule_where_only_those_who_moved_are_looked_at(start, monkeypatch):
    known, plain = [], wide.wide_shift_few
    monkeypatch.setattr(wide, "wide_shift_few", lambda *given: (known.append(given[5]), plain(*given)))
    options = {"shift_start": start, "shift_minimum": 0.05, "shift_maximum": 10.0}
    found = states(resting(11, True, N), 15, **options)
    for before, after in pairwise(found):
        expected = before.shift.array()
        if after.history.accepted[-1]:
            step = Step(before.trial, before.alpha)
            expected = next_shift(expected, before.step, step, settings("default", options))
        assert np.array_equal(after.shift.array(), expected)
    assert sum(known) > 5
    assert False in known


def test_shifts_that_were_followed_by_others_stay_what_they_were():
    rng = np.random.default_rng(12)
    arrays, versions = [rng.random(50)], []
    versions.append(Shifts(arrays[0].copy()))
    for _ in range(4):
        following, array, places, before, count = versions[-1].following(20)
        for k, i in enumerate(rng.choice(50, 7, replace=False)):
            places[k], before[k], array[i] = i, array[i], rng.random()
            count[0] += 1
        versions.append(following)
        arrays.append(array.copy())
    broken, array, places, before, count = versions[2].following(20)  # another way on, broken off at its first change
    places[0], before[0], array[3] = 3, array[3], -1.0
    count[0] = 1
    for which in (2, 0, 4, 1, 3, 2):
        assert np.array_equal(versions[which].array(), arrays[which])
    assert broken.array()[3] == -1.0


def test_a_run_goes_on_from_stored_arrays_to_the_bit():
    problem = resting(13, False, N)
    straight = states(problem, 14)
    for state, expected in pairwise(straight):
        arrays = {name: np.array(array) for name, array in state.to_arrays().items()}
        resumed = Gsao(problem, settings(max_iterations=100)).step(State.from_arrays(arrays)).to_arrays()
        for name, array in expected.to_arrays().items():
            assert "seconds" in name or resumed[name].tobytes() == array.tobytes(), name


@pytest.mark.parametrize("n", [N, 3 * wide.PIECE + 5])
def test_what_a_step_tells_of_itself_is_what_single_passes_find(n):
    problem = resting(14, True, n)
    for state in states(problem, 6):
        measures = measures_of(problem)
        new = wide.propose(state, np.array([0]), measures, settings())
        unit = wide.ranges(problem.lower, problem.upper)
        change = np.abs(new.trial - state.alpha)
        assert measures.change(new.trial, state.alpha) == (change.max(), (change / unit).max())
        assert measures.change(new.trial, state.alpha) == wide.largest_change(new.trial, state.alpha, unit)
        measures.look(state.gradients, new.trial)
        assert measures.steepest(state.gradients) == np.abs(state.gradients).max()
        assert np.array_equal(measures.excess(new.trial), wide.excess(measures.space, new.trial))
        exact = problem.linear.A[0].astype(np.longdouble) @ new.trial - problem.linear.b[0]
        assert abs(float(measures.excess(new.trial)[0] - exact)) < 4e-15 * problem.linear.b[0]
        # the directions that are noted for the shifts
        noted, counts = measures.room.of(n)[2:4]
        direction = np.zeros(n, dtype=np.int64)
        for piece, count in enumerate(counts[1]):
            moves = noted[piece * wide.PIECE : piece * wide.PIECE + count]
            direction[moves // 4] = moves % 4
        step = new.trial - state.alpha
        assert np.array_equal(direction, np.where(step > 0.0, 1, np.where(step < 0.0, 2, 0)))


@pytest.mark.parametrize("exponent", [-6.0, -2.0, -0.1, 0.5, 1.0])
def test_powers_are_right_to_rounding(exponent):
    t = np.random.default_rng(0).uniform(0.05, 20.0, 500)
    out = np.empty_like(t)
    powers.py_func(t, exponent, out, np.empty((3, len(t)), dtype=np.int64))
    assert np.allclose(out, t**exponent, rtol=1e-14, atol=0.0)


@vector_entry
def all_primitives(z, power, value, room):
    primitives(z, power, value, room)
    return largest(value)


@pytest.mark.parametrize("power", [-5.0, -1.0, -0.5, 0.0, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("most", [1e-12, 1e-3, 0.1, 0.3, 0.45, 0.59, 0.61, 0.9])
def test_primitives_are_right_to_rounding_near_and_far(power, most):
    z = most * np.random.default_rng(0).uniform(-1.0, 1.0, 500)
    out = np.empty_like(z)
    found = all_primitives(z, power, out, np.empty((3, len(z)), dtype=np.int64))
    exact = np.log1p(z) if power == 0.0 else np.expm1(power * np.log1p(z)) / power
    assert np.allclose(out, exact, rtol=3e-15 if most < 0.4 else 1e-14, atol=1e-15 if most > 0.4 else 0.0)
    assert found == np.abs(out).max()


def test_the_largest_of_numbers_with_nan_is_nan():
    out, room = np.empty(40), np.empty((3, 40), dtype=np.int64)
    z = np.full(40, -0.25)
    assert all_primitives(z, 1.0, out, room) == 0.25
    z[17] = np.nan
    assert np.isnan(all_primitives(z, 1.0, out, room))


class Several(Many):
    """The same, and rows that compete: with `shares` of its gradient, at values so far below it."""

    def __init__(self, seed, shares, drops):
        super().__init__(seed, True, 1_020)
        self.shares, self.drops = shares, drops

    def evaluate(self, x, gradient=True):
        one = super().evaluate(x)
        turned = [one.gradients[0], *(s * one.gradients[0] for s in self.shares)]
        rows = one.objective * np.array([1.0, *(1.0 - drop for drop in self.drops)])
        return Sample(float(rows[0]), rows, np.array(turned), one.constraint_rows, one.constraint_gradients)


@pytest.mark.parametrize(("share", "drop", "alone"), [(0.95, 0.1, True), (-0.1, 0.1, False), (-0.1, 1e-9, False)])
def test_the_highest_row_makes_the_step_where_it_decides_alone(share, drop, alone, monkeypatch):
    problem, chosen = Several(7, (0.9, share), (0.14, drop)), settings()
    (state,) = states(problem, 1, monkeypatch)
    found = wide.propose(state, np.arange(3), measures_of(problem), chosen)
    assert (found is not None) == alone
    if found is not None:
        assert np.abs(found.trial - state.trial).max() < 1e-3
        assert state.objective - found.promised == pytest.approx(state.predicted, rel=1e-7)
        assert found.kkt == pytest.approx(state.kkt, rel=1e-5)


def test_bounds_and_costs_that_are_alike_are_not_read_and_change_no_bit():
    problem = Many(8, True)
    problem.lower, problem.upper = np.full(N, 1e-3), np.ones(N)
    problem.linear = LinearRows(np.ones((1, N)), np.array([0.3 * N]), np.array([True]))
    space = wide.Space.of(problem.lower, problem.upper, problem.linear)
    assert len(space.lower) == len(space.upper) == len(space.rows[0]) < N
    whole = wide.Space(problem.lower, problem.upper, problem.linear, (problem.linear.A[0],), np.ones(N))
    for state in states(problem, 5):
        one, other = (wide.propose(state, np.array([0]), wide.Measures(each), settings()) for each in (space, whole))
        assert np.array_equal(one.trial, other.trial)
        assert one[1:] == other[1:]


@pytest.mark.parametrize("n", SIZES)
def test_where_the_row_moves_nobody_its_multiplier_is_zero(n):
    """What it costs is on its lower bound and would go lower; what it does not cost moves."""
    rng = np.random.default_rng(0)
    problem = Many(1, False, n)
    free = rng.random(n) < 0.3
    problem.lower, problem.upper = np.full(n, 1e-3), np.ones(n)
    problem.initial = np.where(free, 0.5, problem.lower)
    problem.falling, problem.rising = np.where(free, problem.falling, 0.0), rng.uniform(0.1, 3.0, n)
    cost = np.where(free, 0.0, rng.uniform(0.5, 2.0, n))
    for bound in (cost @ problem.lower, np.nextafter(cost @ problem.lower, 1.0), 0.2 * n):
        problem.linear = LinearRows(cost[None], np.array([bound]), np.array([False]))
        for state in states(problem, 3):
            new = wide.propose(state, np.array([0]), measures_of(problem), settings())
            assert np.array_equal(new.trial[~free], problem.lower[~free])
            slope, x = state.gradients[0] / np.abs(state.gradients[0]).max(), state.alpha
            assert new.kkt == pytest.approx(np.abs(x - np.clip(x - slope, problem.lower, 1.0)).max(), rel=1e-12)


@pytest.mark.parametrize(("n", "which"), [(2_000, "fine"), (70_001, "coarse"), (70_001, "both")])
def test_a_sample_that_misleads_costs_time_alone(n, which, monkeypatch):
    problem = Many(9, True, n)
    problem.lower, problem.upper = np.full(n, 1e-3), np.ones(n)
    problem.linear = LinearRows(np.ones((1, n)), np.array([0.3 * n]), np.array([True]))
    seen = np.zeros(n, dtype=bool)
    seen[:: COARSER * wide._stride(n) + 1] = which != "fine"
    if which != "coarse":
        seen[:: wide._stride(n)] = True
    problem.falling, problem.rising = np.where(seen, 1.0, 50.0 + np.arange(n) / n), np.zeros(n)
    (state,) = states(problem, 1, monkeypatch)
    new = wide.propose(state, np.array([0]), measures_of(problem), settings())
    assert new is not None
    assert state.objective - new.promised == pytest.approx(state.predicted, rel=1e-7)
    assert abs(problem.linear.excess(new.trial)[0]) <= 1e-14 * 0.6 * n


def test_what_is_kept_is_what_the_function_gives_and_only_for_the_same_arrays():
    calls = []

    def size(x):
        calls.append(x)
        return len(x)

    kept = wide.Kept(size)
    one, same, other, third = np.zeros(1), np.zeros(1), np.zeros(2), np.zeros(3)
    assert [kept(x) for x in (one, one, other, one)] == [1, 1, 2, 1]
    assert len(calls) == 2
    assert (kept(same), len(calls)) == (1, 3)
    assert (kept(third), kept(one), len(calls)) == (3, 1, 5)
