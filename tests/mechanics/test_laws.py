"""Every member law against its definition written a second time, in every mode and at every switch.

Slopes are checked twice: against complex steps of the definition, and against eighth-order differences of the kernel
itself within one frozen mode. The right mode of a state is worked out here from the contract's words alone.
"""

import dataclasses
import itertools
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from mdstopo.case.arrays import Table
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import (
    LAWS,
    ActuatorLaw,
    CrushLaw,
    CubicLaw,
    CurveLaw,
    GapLaw,
    InerterLaw,
    Law,
    PulseLaw,
    SpringLaw,
    TableLaw,
)
from mdstopo.mechanics.laws import actuator, gap, law_table
from mdstopo.mechanics.laws.law_table import CODES, PARAMETERS, parameters
from mdstopo.mechanics.laws.law_table import breakpoints as law_breakpoints
from mdstopo.scene.signal_segments import breakpoints
from tests.compiled import compiled
from tests.tiers import examples

ROOT = Path(__file__).resolve().parents[2]
OPEN, CLOSED, CLIPPED = gap.OPEN, gap.CLOSED, gap.CLIPPED
LINEAR, UPPER, LOWER = actuator.LINEAR, actuator.UPPER, actuator.LOWER
#: what is not a function of elongation and rate, or remembers, and the module that tests it instead
ELSEWHERE = {
    "inerter": "tests/general/test_inerter.py",
    "crush": "tests/general/test_crush.py",
    "expression": "tests/general/test_expression_laws.py",
}

#: time and free length, where they make no difference
TIME, REST = 0.0, 1.0

seeds = st.integers(0, 2**32 - 1)
many = settings(max_examples=examples(12, 60), deadline=None, derandomize=True)


# Kernels have no Python wrapper: these are their callers.
@compiled
def _law(code, p, x, xd, mode, t, value, curves):
    return law_table.law(code, p, x, xd, mode, t, value, curves, REST)


@compiled
def _by_parameter(code, p, place, x, xd, mode, t, value, curves):
    return law_table.law_slopes(code, p, place, x, xd, mode, t, value, curves, REST)


@compiled
def _margin_by_parameter(code, p, place, x, xd, mode, curves):
    return law_table.law_margin_slope(code, p, place, x, xd, mode, TIME, curves, REST)


@compiled
def _margin(code, p, x, xd, mode, t, curves):
    return law_table.law_margin(code, p, x, xd, mode, t, curves, REST)


@compiled
def _slopes(code, p, x, xd, mode, curves):
    return law_table.law_margin_slopes(code, p, x, xd, mode, TIME, curves, REST)


@compiled
def _margins(code, p, mode, curves):
    return law_table.law_margins(code, p, mode, curves)


@compiled
def _one_margin(code, p, which, x, xd, mode, curves):
    return law_table.law_one_margin(code, p, which, x, xd, mode, TIME, curves, REST)


@compiled
def _next(code, p, x, xd, xdd, mode, curves):
    return law_table.law_next(code, p, x, xd, xdd, mode, TIME, curves, REST)


@compiled
def _start(code, p, x, xd, xdd, curves):
    return law_table.law_start(code, p, x, xd, xdd, TIME, curves, REST)


@compiled
def _grazes(code, p, mode, curves):
    return law_table.law_grazes(code, p, 0.0, mode, TIME, curves, REST)


@compiled
def _switches(code, p, curves):
    return law_table.law_switches(code, p, curves)


class Kernel:
    """A law record behind its kernels; `before` other curves stand in front of its own."""

    def __init__(self, record, before=()):
        curves = list(before)
        row = parameters(record, curves)
        assert len(row) == PARAMETERS
        self.record, self.code = record, CODES[record.type]
        self.p, self.curves = np.array(row), np.array(curves, dtype=np.float64)

    def at(self, x, xd=0.0, mode=0, t=0.0, value=0.0):
        """f, f_x, f_xd, V, V_x."""
        return np.array(_law(self.code, self.p, float(x), float(xd), mode, float(t), float(value), self.curves))

    def by_parameter(self, place, x, xd, mode, t, value):
        """df/dp, dV/dp."""
        return _by_parameter(self.code, self.p, place, float(x), float(xd), mode, t, value, self.curves)

    def margin_by_parameter(self, place, x, xd, mode):
        return _margin_by_parameter(self.code, self.p, place, float(x), float(xd), mode, self.curves)

    def margin(self, x, xd, mode, t=TIME):
        return _margin(self.code, self.p, float(x), float(xd), mode, float(t), self.curves)

    def slopes(self, x, xd, mode):
        return _slopes(self.code, self.p, float(x), float(xd), mode, self.curves)

    def one_margin(self, which, x, xd, mode):
        """The margin, and its slopes by x, xd and time."""
        return _one_margin(self.code, self.p, which, float(x), float(xd), mode, self.curves)

    def margins(self, mode):
        """How many margins the mode has."""
        return int(_margins(self.code, self.p, mode, self.curves))

    def next(self, x, xd, xdd, mode):
        return _next(self.code, self.p, float(x), float(xd), float(xdd), mode, self.curves)

    def start(self, x, xd, xdd=0.0):
        return _start(self.code, self.p, float(x), float(xd), float(xdd), self.curves)

    def grazes(self, mode):
        return int(_grazes(self.code, self.p, mode, self.curves))

    def jumps(self, before, after):
        """Whether the force may jump where the mode changes so: where damped contact begins or ends with a force."""
        if not isinstance(self.record, GapLaw) or self.record.damping == 0.0:
            return False
        return {before, after} == {OPEN, CLOSED}

    @property
    def switches(self):
        return bool(_switches(self.code, self.p, self.curves))

    @property
    def modes(self):
        """The modes that the law can be in."""
        if isinstance(self.record, GapLaw):
            return (OPEN, CLOSED, CLIPPED) if self.record.clip else (OPEN, CLOSED)
        if isinstance(self.record, ActuatorLaw) and self.record.limit is not None:
            return (LINEAR, UPPER, LOWER)
        if isinstance(self.record, CurveLaw):
            return tuple(range(1, len(self.record.curve) + 2))
        return (0,)

    def modes_at(self, x):
        """The modes in which the law is what the contract says at x: of the pieces of a curve those that x is in."""
        return sorted(right_modes(self.record, x, 0.0)) if isinstance(self.record, CurveLaw) else self.modes


def size(rng):
    """A positive number between 0.1 and 100."""
    return 10.0 ** rng.uniform(-1.0, 2.0)


def signed(rng, largest=2.0):
    return rng.uniform(-largest, largest)


def some_gap(rng, side, clip):
    damping = size(rng) if rng.random() < 0.8 else 0.0
    return GapLaw(stiffness=size(rng), damping=damping, gap=signed(rng, 0.5), side=side, clip=clip)


def some_curve(rng):
    n = int(rng.integers(2, 8))
    x = signed(rng) + np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, n - 1))])
    return CurveLaw(curve=np.column_stack([x, rng.uniform(-5.0, 5.0, n)]))


MAKERS = {
    "spring": lambda rng: SpringLaw(stiffness=size(rng), damping=size(rng), preload=signed(rng)),
    "gap": lambda rng: some_gap(rng, "tension", False),
    "gap compressed": lambda rng: some_gap(rng, "compression", False),
    "gap clipped": lambda rng: some_gap(rng, "tension", True),
    "gap clipped compressed": lambda rng: some_gap(rng, "compression", True),
    "cubic": lambda rng: CubicLaw(stiffness=size(rng), cubic=signed(rng, 20.0)),
    "curve": some_curve,
    "pulse": lambda rng: PulseLaw(peak=signed(rng, 20.0), rate=size(rng), time=signed(rng)),
    "table": lambda rng: TableLaw(table=Table(np.array([0.0, 1.0]), np.array([[1.0], [3.0]]))),
    "actuator": lambda rng: ActuatorLaw(proportional=size(rng), derivative=size(rng), target=signed(rng)),
    "actuator limited": lambda rng: ActuatorLaw(
        proportional=size(rng), derivative=size(rng), target=signed(rng), limit=size(rng)
    ),
}
SWITCHING = tuple(kind for kind in MAKERS if kind.startswith("gap") or kind in ("actuator limited", "curve"))
GAPS = tuple(kind for kind in MAKERS if kind.startswith("gap"))

every_kind = pytest.mark.parametrize("kind", MAKERS)
every_switching = pytest.mark.parametrize("kind", SWITCHING)
every_gap = pytest.mark.parametrize("kind", GAPS)


def side_of(law):
    return 1.0 if law.side == "tension" else -1.0


def touch(law):
    """The elongation at which a gap closes."""
    return side_of(law) * law.gap


def demand(law, x, xd):
    """What an actuator would do without a limit."""
    return law.proportional * (x - law.target) + law.derivative * xd


def places(law):
    """Elongations at which something special may happen."""
    if isinstance(law, GapLaw):
        return (0.0, touch(law))
    if isinstance(law, CurveLaw):
        return (0.0, *law.curve[:, 0])
    if isinstance(law, ActuatorLaw):
        edge = 0.0 if law.limit is None else law.limit / law.proportional
        return (0.0, law.target, law.target + edge, law.target - edge, law.target + 5.0 * edge)
    return (0.0,)


def drawn(kind, seed):
    """A law with an elongation and a rate, both special ones in a third of the draws."""
    rng = np.random.default_rng(seed)
    kernel = Kernel(MAKERS[kind](rng))
    x = float(rng.choice(places(kernel.record))) if rng.random() < 1 / 3 else signed(rng, 4.0)
    xd = 0.0 if rng.random() < 1 / 3 else signed(rng, 4.0)
    return kernel, x, xd, rng


def definition(law, mode, t, value):
    """Force(x, xd) and energy(x) by the contract's table, for real and complex arguments."""
    match law:
        case SpringLaw():
            return (
                lambda x, xd: law.stiffness * x + law.damping * xd + law.preload,
                lambda x: law.stiffness * x**2 / 2,
            )
        case GapLaw():
            if mode == OPEN:
                return lambda x, xd: 0.0, lambda x: 0.0
            e = touch(law)
            if mode == CLIPPED:
                return lambda x, xd: 0.0, lambda x: law.stiffness * (x - e) ** 2 / 2
            return lambda x, xd: law.stiffness * (x - e) + law.damping * xd, lambda x: law.stiffness * (x - e) ** 2 / 2
        case CubicLaw():
            return (
                lambda x, xd: law.stiffness * x + law.cubic * x**3,
                lambda x: law.stiffness * x**2 / 2 + law.cubic * x**4 / 4,
            )
        case CurveLaw():
            return curve_definition(law)
        case PulseLaw():
            return lambda x, xd: law.peak * math.exp(-law.rate * (t - law.time) ** 2), lambda x: 0.0
        case TableLaw():
            return lambda x, xd: value, lambda x: 0.0
        case ActuatorLaw():
            if mode == LINEAR:
                return lambda x, xd: demand(law, x, xd), lambda x: 0.0
            return lambda x, xd: law.limit if mode == UPPER else -law.limit, lambda x: 0.0
    raise AssertionError(f"no definition of {law.type}")


def curve_definition(law):
    pieces = PchipInterpolator(law.curve[:, 0], law.curve[:, 1])
    areas = pieces.antiderivative()
    knots = pieces.x

    def read(poly, x):
        i = min(max(int(np.searchsorted(knots, x.real, side="right")) - 1, 0), len(knots) - 2)
        return np.polyval(poly.c[:, i], x - knots[i])

    def force(x, xd=0.0):
        near = min(max(x.real, knots[0]), knots[-1])
        return read(pieces, np.float64(near)) + pieces(near, 1) * (x - near) if near != x.real else read(pieces, x)

    def stored(x):
        near = min(max(x.real, knots[0]), knots[-1])
        if near == x.real:
            return read(areas, x)
        s = x - near
        return read(areas, np.float64(near)) + force(np.float64(near)) * s + pieces(near, 1) * s**2 / 2

    return force, lambda x: stored(x) - stored(np.float64(0.0))


# --- no law escapes


def test_every_law_of_the_format_is_tested_here_or_names_its_own_module():
    here = {MAKERS[kind](np.random.default_rng(0)).type for kind in MAKERS}
    assert here.isdisjoint(ELSEWHERE)
    assert here | set(ELSEWHERE) == set(LAWS)
    assert set(CODES) == set(LAWS)
    assert len(set(CODES.values())) == len(CODES)


@pytest.mark.parametrize("kind", ELSEWHERE)
def test_a_law_tested_elsewhere_has_its_module(kind):
    assert (ROOT / ELSEWHERE[kind]).is_file()


# --- forces, energies and their slopes


@every_kind
@many
@given(seeds)
def test_force_and_energy_are_those_of_the_definition(kind, seed):
    kernel, x, xd, rng = drawn(kind, seed)
    t, value = signed(rng), signed(rng, 10.0)
    for mode in kernel.modes_at(x):
        force, energy = definition(kernel.record, mode, t, value)
        f, _, _, v, _ = kernel.at(x, xd, mode, t, value)
        assert f == pytest.approx(force(np.float64(x), np.float64(xd)), rel=1e-11, abs=1e-11)
        assert v == pytest.approx(energy(np.float64(x)), rel=1e-10, abs=1e-11)


@every_kind
@many
@given(seeds)
def test_slopes_are_those_of_the_definition(kind, seed):
    kernel, x, xd, rng = drawn(kind, seed)
    t, value = signed(rng), signed(rng, 10.0)
    small = 1e-40
    for mode in kernel.modes_at(x):
        force, energy = definition(kernel.record, mode, t, value)
        _, f_x, f_xd, _, v_x = kernel.at(x, xd, mode, t, value)
        wanted = (
            np.imag(force(x + small * 1j, complex(xd))) / small,
            np.imag(force(complex(x), xd + small * 1j)) / small,
            np.imag(energy(x + small * 1j)) / small,
        )
        assert (f_x, f_xd, v_x) == pytest.approx(wanted, rel=1e-10, abs=1e-10)


def difference(function, x, h):
    """Eighth-order central difference: exact for every polynomial law but for rounding."""
    weights = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
    return sum(w * (function(x + i * h) - function(x - i * h)) for i, w in enumerate(weights, start=1)) / h


@every_kind
@many
@given(seeds)
def test_slopes_are_those_of_the_kernel_in_the_same_mode(kind, seed):
    kernel, x, xd, rng = drawn(kind, seed)
    t, value = signed(rng), signed(rng, 10.0)
    h = 0.05
    if isinstance(kernel.record, CurveLaw):
        # a cubic joins the next with one derivative only: differences stay within one of them
        room = np.abs(kernel.record.curve[:, 0] - x).min()
        assume(room > 1e-2)
        h = min(h, room / 5.0)
    for mode in kernel.modes:
        _, f_x, f_xd, _, v_x = kernel.at(x, xd, mode, t, value)
        by_x = difference(lambda s, mode=mode: kernel.at(s, xd, mode, t, value), x, h)
        by_rate = difference(lambda s, mode=mode: kernel.at(x, s, mode, t, value), xd, 0.05)
        assert (f_x, v_x) == pytest.approx((by_x[0], by_x[3]), rel=1e-7, abs=1e-7)
        assert (f_xd, 0.0) == pytest.approx((by_rate[0], by_rate[3]), rel=1e-7, abs=1e-7)


@every_kind
@many
@given(seeds)
def test_slopes_by_parameters_are_differences_of_laws_with_other_parameters(kind, seed):
    kernel, x, xd, rng = drawn(kind, seed)
    record, t, value = kernel.record, signed(rng), signed(rng, 10.0)
    names = [name for name in with_role(type(record), "varies") if name not in law_table.COMMON]
    for name, mode in itertools.product(names, kernel.modes):
        place, own = law_table.place_of(type(record), name), getattr(record, name)
        if own is None:  # an actuator without a limit has none to vary
            continue

        def changed(number, name=name):
            return Kernel(dataclasses.replace(record, **{name: number}))

        h = 1e-3 * (1.0 + abs(own))
        wanted = difference(lambda p, mode=mode: changed(p).at(x, xd, mode, t, value), own, h)
        found = kernel.by_parameter(place, x, xd, mode, t, value)
        assert found == pytest.approx((wanted[0], wanted[3]), rel=1e-6, abs=1e-6)
        if kernel.switches:
            h = 1e-6 * (1.0 + abs(own))
            below, here, above = (changed(own + side * h).margin(x, xd, mode) for side in (-4.0, 0.0, 4.0))
            if abs(above - 2.0 * here + below) > 1e-3 * h:
                continue  # another margin becomes the smaller one here
            by_p = difference(lambda p, mode=mode: changed(p).margin(x, xd, mode), own, h)
            assert kernel.margin_by_parameter(place, x, xd, mode) == pytest.approx(by_p, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("kind", ["spring", *GAPS, "cubic", "curve"])
@many
@given(seeds)
def test_energy_is_the_potential_of_the_elastic_force(kind, seed):
    kernel, x, _, _ = drawn(kind, seed)
    preload = getattr(kernel.record, "preload", 0.0)
    for mode in kernel.modes:
        if mode == CLIPPED and isinstance(kernel.record, GapLaw):
            # the spring keeps what it stores although no force is applied
            assert kernel.at(x, 0.0, CLIPPED)[3:] == pytest.approx(kernel.at(x, 0.0, CLOSED)[3:])
            continue
        f, _, _, _, v_x = kernel.at(x, 0.0, mode)
        assert v_x == pytest.approx(f - preload, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("kind", ["pulse", "table", "actuator", "actuator limited"])
@many
@given(seeds)
def test_active_laws_store_nothing(kind, seed):
    kernel, x, xd, _ = drawn(kind, seed)
    for mode in kernel.modes:
        assert kernel.at(x, xd, mode, 0.1, 3.0)[3:].tolist() == [0.0, 0.0]


@every_kind
@many
@given(seeds)
def test_a_law_depends_on_the_rate_exactly_where_its_slope_says_so(kind, seed):
    kernel, x, xd, _ = drawn(kind, seed)
    assert kernel.record.depends_on_rate == any(kernel.at(x, xd, mode)[2] != 0.0 for mode in kernel.modes)


@pytest.mark.parametrize("field", ["damping", "derivative"])
def test_laws_without_damping_do_not_depend_on_the_rate(field):
    for kind in MAKERS:
        record = MAKERS[kind](np.random.default_rng(1))
        if hasattr(record, field):
            assert not dataclasses.replace(record, **{field: 0.0}).depends_on_rate


def test_an_inerter_makes_a_scene_depend_on_velocities():
    # its acceleration along the member has terms in the velocities
    assert InerterLaw(inertance=1.0).depends_on_rate


# --- switches


def right_modes(law, x, xd):
    """The modes that the contract allows at this state, away from every switch exactly one."""
    if isinstance(law, ActuatorLaw):
        f = demand(law, x, xd)
        allowed = {UPPER: f >= law.limit, LOWER: f <= -law.limit, LINEAR: abs(f) <= law.limit}
    elif isinstance(law, CurveLaw):
        edges = [-np.inf, *law.curve[:, 0], np.inf]
        allowed = {1 + i: low <= x <= high for i, (low, high) in enumerate(itertools.pairwise(edges))}
    else:
        side = side_of(law)
        inside = side * x - law.gap
        pull = side * (law.stiffness * (x - touch(law)) + law.damping * xd)
        allowed = {
            OPEN: inside <= 0.0,
            CLOSED: inside >= 0.0 and (not law.clip or pull >= 0.0),
            CLIPPED: inside >= 0.0 and law.clip and pull <= 0.0,
        }
    return {mode for mode, good in allowed.items() if good}


def clear(law, x, xd, distance=1e-9):
    """Whether a state is away from all switches."""
    if isinstance(law, ActuatorLaw):
        return abs(abs(demand(law, x, xd)) - law.limit) > distance
    if isinstance(law, CurveLaw):  # a piece goes on a little beyond its ends
        return float(np.abs(x - law.curve[:, 0]).min()) > 1e-7
    pull = law.stiffness * (x - touch(law)) + law.damping * xd
    return abs(x - touch(law)) > distance and abs(pull) > distance


@every_kind
def test_the_kernel_knows_which_laws_switch(kind):
    kernel = Kernel(MAKERS[kind](np.random.default_rng(2)))
    assert kernel.switches == (kind in SWITCHING)
    if kind not in SWITCHING:
        assert kernel.margin(0.3, -2.0, 0) == np.inf
        assert kernel.slopes(0.3, -2.0, 0) == (0.0, 0.0)
        assert kernel.start(0.3, -2.0, 1.0) == 0
        assert kernel.grazes(0) == 0


@every_switching
@many
@given(seeds)
def test_a_margin_is_negative_exactly_where_the_mode_is_wrong(kind, seed):
    kernel, x, xd, _ = drawn(kind, seed)
    assume(clear(kernel.record, x, xd))
    right = right_modes(kernel.record, x, xd)
    assert len(right) == 1
    for mode in kernel.modes:
        assert (kernel.margin(x, xd, mode) >= 0.0) == (mode in right)


@every_switching
@many
@given(seeds)
def test_margin_slopes_are_those_of_the_margin(kind, seed):
    kernel, x, xd, _ = drawn(kind, seed)
    h = 1e-4
    for mode in kernel.modes:
        slopes = kernel.slopes(x, xd, mode)
        values = [kernel.margin(x + i * h, xd + j * h, mode) for i, j in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]
        middle, right, left, up, down = values
        # conditions are linear: where both halves agree, no other one takes over in between
        if abs(right + left - 2.0 * middle) + abs(up + down - 2.0 * middle) < 1e-10:
            wanted = (right - left) / (2.0 * h), (up - down) / (2.0 * h)
            assert slopes == pytest.approx(wanted, rel=1e-7, abs=1e-7)


@every_switching
@many
@given(seeds)
def test_the_start_is_in_the_mode_of_its_elongation_and_rate(kind, seed):
    kernel, x, xd, rng = drawn(kind, seed)
    assume(clear(kernel.record, x, xd))
    assert {kernel.start(x, xd, signed(rng))} == right_modes(kernel.record, x, xd)


@every_switching
@many
@given(seeds)
def test_from_any_mode_two_switches_lead_to_the_right_one(kind, seed):
    # a law that begins to act in mid-motion may find its member anywhere
    kernel, x, xd, rng = drawn(kind, seed)
    assume(clear(kernel.record, x, xd))
    xdd = signed(rng)
    for mode in kernel.modes:
        for _ in range(2):
            if kernel.margin(x, xd, mode) < 0.0:
                mode = kernel.next(x, xd, xdd, mode)
        assert {mode} == right_modes(kernel.record, x, xd)


def with_modes(kind, rng):
    """A law of a kind with its modes."""
    if kind != "crush":
        kernel = Kernel(MAKERS[kind](rng))
        return kernel, kernel.modes
    return Kernel(CrushLaw(stiffness=size(rng), force=size(rng), gap=signed(rng, 0.5))), (0, 1, 2)


#: what prices of candidates ask of laws with modes
every_even = pytest.mark.parametrize("kind", [*SWITCHING, "crush"])


@every_even
@many
@given(seeds)
def test_over_ranges_of_elongation_and_rate_a_margin_is_least_at_a_corner(kind, seed):
    rng = np.random.default_rng(seed)
    kernel, modes = with_modes(kind, rng)
    assert law_table.kernels_of(type(kernel.record)).is_even(kernel.record)
    x, xd = (np.sort(rng.uniform(-3.0, 3.0, 2)) for _ in range(2))
    for mode in modes:
        least = min(kernel.margin(a, b, mode) for a in x for b in xd)
        for a, b in zip(rng.uniform(*x, 9), rng.uniform(*xd, 9), strict=True):
            assert kernel.margin(a, b, mode) >= least - 1e-12 * max(abs(least), 1.0)


def test_every_law_that_declares_a_degree_is_tested_here():
    kinds = (with_modes(kind, np.random.default_rng(1))[0].record for kind in (*SWITCHING, "crush"))
    tested = [law_table.kernels_of(type(record)) for record in kinds]
    declared = [each for each in law_table.LISTED if each.modes and each.modes.degree]
    assert declared
    assert all(each in tested for each in declared)


@every_even
@many
@given(seeds)
def test_a_margin_is_the_lesser_of_at_most_two_linear_functions_and_knows_no_time(kind, seed):
    rng = np.random.default_rng(seed)
    kernel, modes = with_modes(kind, rng)
    assert law_table.kernels_of(type(kernel.record)).modes.degree is not None
    # along any line of elongations and rates it then bends downwards, and only once
    for mode in modes:
        for _ in range(5):
            x, xd = (np.linspace(*rng.uniform(-9.0, 9.0, 2), 41) for _ in range(2))
            margins = np.array([kernel.margin(a, b, mode) for a, b in zip(x, xd, strict=True)])
            assert [kernel.margin(a, b, mode, signed(rng)) for a, b in zip(x, xd, strict=True)] == margins.tolist()
            bend = np.diff(margins, 2)
            rounding = 1e-12 * max(np.abs(margins).max(), 1.0)
            assert bend.max() <= rounding
            bent = np.flatnonzero(bend < -rounding)
            # a bend between two samples is in the differences about both
            assert bent.size == 0 or bent[-1] - bent[0] <= 1


@every_even
@many
@given(seeds)
def test_the_margin_of_a_mode_is_the_least_of_margins_without_kinks(kind, seed):
    # a member that leaves its mode and returns within one step is found on cubics through values and rates at its ends
    rng = np.random.default_rng(seed)
    kernel, modes = with_modes(kind, rng)
    for mode in modes:
        x, xd = (np.linspace(*rng.uniform(-9.0, 9.0, 2), 9) for _ in range(2))
        each = np.array(
            [[kernel.one_margin(i, *at, mode) for i in range(kernel.margins(mode))] for at in zip(x, xd, strict=True)]
        )
        values, by_x, by_xd, by_time = each.transpose(2, 1, 0)
        rounding = 1e-12 * max(np.abs(values).max(), 1.0)
        least = [kernel.margin(a, b, mode) for a, b in zip(x, xd, strict=True)]
        assert values.min(axis=0) == pytest.approx(least, abs=rounding)
        assert np.abs(np.diff(values) - by_x[:, 1:] * np.diff(x) - by_xd[:, 1:] * np.diff(xd)).max() <= rounding
        assert not by_time.any()


@every_even
@many
@given(seeds)
def test_in_a_mode_force_and_energy_are_polynomials_of_their_degree(kind, seed):
    rng = np.random.default_rng(seed)
    kernel, modes = with_modes(kind, rng)
    degree = law_table.kernels_of(type(kernel.record)).modes.degree
    x = signed(rng) + np.linspace(-0.5, 0.5, 7)
    for mode in modes:
        f, _, f_xd, v, _ = np.array([kernel.at(each, 0.0, mode) for each in x]).T
        for values, order in ((f, degree), (v, degree + 1)):
            assert np.abs(np.diff(values, order + 1)).max() <= 1e-11 * max(np.abs(values).max(), 1.0)
        xd = signed(rng)
        moving = np.array([kernel.at(each, xd, mode)[0] for each in x])
        assert moving == pytest.approx(f + f_xd[0] * xd, rel=1e-11, abs=1e-11)


@every_gap
@pytest.mark.parametrize(("rate", "second"), list(itertools.product((-2.0, 0.0, 2.0), (-3.0, 3.0))))
@pytest.mark.parametrize("off", [0.0, 3e-13, -3e-13])
def test_at_touch_the_rate_decides_then_the_second_derivative(kind, rate, second, off):
    kernel = Kernel(MAKERS[kind](np.random.default_rng(3)))
    side = side_of(kernel.record)
    ahead = rate if rate != 0.0 else second
    x = touch(kernel.record) + off
    assert kernel.start(x, side * rate, side * second) == (CLOSED if ahead > 0.0 else OPEN)


@every_gap
@many
@given(seeds)
def test_just_behind_the_switch_the_next_mode_holds(kind, seed):
    rng = np.random.default_rng(seed)
    kernel = Kernel(MAKERS[kind](rng))
    law, side = kernel.record, side_of(kernel.record)
    rate = size(rng)
    step = 10.0 ** rng.uniform(-17.0, -9.0)
    x = touch(law) + side * step
    if kernel.margin(x, side * rate, OPEN) < 0.0:
        assert kernel.next(x, side * rate, 0.0, OPEN) == CLOSED
    x = touch(law) - side * step
    for mode in kernel.modes[1:]:
        if kernel.margin(x, -side * rate, mode) < 0.0:
            assert kernel.next(x, -side * rate, 0.0, mode) == OPEN


@pytest.mark.parametrize("kind", ["gap clipped", "gap clipped compressed"])
@many
@given(seeds)
def test_a_clipped_force_that_has_just_changed_its_sign_changes_the_mode(kind, seed):
    # the margin and the choice of mode must not disagree by rounding: the integrator would stand still
    rng = np.random.default_rng(seed)
    kernel = Kernel(MAKERS[kind](rng))
    law, side = kernel.record, side_of(kernel.record)
    assume(law.damping > 0.0)
    depth = size(rng)
    x = touch(law) + side * depth
    xd = -side * law.stiffness * depth / law.damping
    for ulps in range(-4, 5):
        rate = xd + ulps * np.spacing(xd)
        for mode, other in ((CLOSED, CLIPPED), (CLIPPED, CLOSED)):
            if kernel.margin(x, rate, mode) < 0.0:
                assert kernel.next(x, rate, 0.0, mode) == other


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_limited_actuator_goes_to_its_limit_and_back(sign):
    law = ActuatorLaw(proportional=3.0, derivative=0.5, target=0.2, limit=6.0)
    kernel = Kernel(law)
    held = UPPER if sign > 0.0 else LOWER
    beyond = law.target + sign * (2.0 + 1e-9)
    within = law.target + sign * (2.0 - 1e-9)
    assert kernel.next(beyond, 0.0, 0.0, LINEAR) == held
    assert kernel.next(within, 0.0, 0.0, held) == LINEAR
    assert kernel.start(beyond, 0.0) == held
    assert kernel.start(within, 0.0) == LINEAR
    assert kernel.at(beyond + sign, 5.0, held).tolist() == [sign * 6.0, 0.0, 0.0, 0.0, 0.0]


def switch_points(kernel, rng):
    """(before, after, x, xd) at which a law passes from one mode to another."""
    law = kernel.record
    if isinstance(law, ActuatorLaw):
        xd = signed(rng)
        for mode, f in ((UPPER, law.limit), (LOWER, -law.limit)):
            x = law.target + (f - law.derivative * xd) / law.proportional
            yield LINEAR, mode, x, xd
        return
    rate = size(rng)
    side = side_of(law)
    yield OPEN, CLOSED, touch(law), side * rate
    if not law.clip or law.damping == 0.0:
        yield CLOSED, OPEN, touch(law), -side * rate
        return
    # a force that may not reverse is gone before contact is
    yield CLIPPED, OPEN, touch(law), -side * rate
    x = touch(law) + side * rate * law.damping / law.stiffness
    yield CLOSED, CLIPPED, x, -side * rate
    yield CLIPPED, CLOSED, x, -side * rate


def test_only_damped_contacts_graze_and_only_clipped_ones_so_that_the_motion_feels_it():
    rng = np.random.default_rng(5)
    for kind in SWITCHING:
        record = MAKERS[kind](rng)
        kernel = Kernel(record)
        damped = isinstance(record, GapLaw) and record.damping > 0.0
        assert kernel.grazes(OPEN) == ((2 if record.clip else 1) if damped else 0), kind
        assert kernel.grazes(CLOSED) == 0
    undamped = GapLaw(stiffness=3.0, gap=0.1, clip=True)
    assert Kernel(undamped).grazes(OPEN) == 0


@pytest.mark.parametrize("kind", [kind for kind in SWITCHING if kind != "curve"])
@many
@given(seeds)
def test_forces_jump_at_a_switch_by_their_damping_or_not_at_all(kind, seed):
    rng = np.random.default_rng(seed)
    kernel = Kernel(MAKERS[kind](rng))
    for before, after, x, xd in switch_points(kernel, rng):
        assert kernel.margin(x, xd, before) == pytest.approx(0.0, abs=1e-9)
        old, new = kernel.at(x, xd, before), kernel.at(x, xd, after)
        jump = new[0] - old[0]
        assert new[3] == pytest.approx(old[3], rel=1e-10, abs=1e-12), "energy does not jump"
        if kernel.jumps(before, after):
            sign = 1.0 if after == CLOSED else -1.0
            assert kernel.record.damping > 0.0
            assert jump == pytest.approx(sign * kernel.record.damping * xd, rel=1e-11)
        else:
            assert jump == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("clip", [False, True])
@many
@given(seeds)
def test_compression_mirrors_tension(clip, seed):
    rng = np.random.default_rng(seed)
    one = some_gap(rng, "tension", clip)
    tension, compression = Kernel(one), Kernel(dataclasses.replace(one, side="compression"))
    x, xd, xdd = signed(rng), signed(rng), signed(rng)
    for mode in tension.modes:
        mirror = np.array([-1.0, 1.0, 1.0, 1.0, -1.0])
        assert compression.at(-x, -xd, mode) == pytest.approx(mirror * tension.at(x, xd, mode), abs=1e-13)
        assert compression.margin(-x, -xd, mode) == tension.margin(x, xd, mode)
    assert compression.start(-x, -xd, -xdd) == tension.start(x, xd, xdd)


@pytest.mark.parametrize("side", ["tension", "compression"])
@many
@given(seeds)
def test_clip_keeps_the_sign_of_the_force(side, seed):
    rng = np.random.default_rng(seed)
    kernel = Kernel(some_gap(rng, side, True))
    x, xd = signed(rng), signed(rng, 20.0)
    assert side_of(kernel.record) * kernel.at(x, xd, kernel.start(x, xd))[0] >= 0.0


def test_without_clip_damping_may_reverse_the_force():
    kernel = Kernel(GapLaw(stiffness=10.0, damping=5.0))
    assert kernel.start(0.1, -1.0) == CLOSED
    assert kernel.at(0.1, -1.0, CLOSED)[0] == pytest.approx(-4.0)


# Zero is not negative: the format allows it for every coefficient below.
@pytest.mark.parametrize("side", ["tension", "compression"])
@pytest.mark.parametrize("rate", [-2.0, 2.0])
def test_clip_holds_for_a_damper_without_a_spring(side, rate):
    kernel = Kernel(GapLaw(stiffness=0.0, damping=4.0, side=side, clip=True))
    s = side_of(kernel.record)
    x, xd = 0.3 * s, rate * s
    right = CLOSED if rate > 0.0 else CLIPPED
    assert kernel.start(x, xd) == right
    assert kernel.margin(x, xd, right) >= 0.0
    wrong = CLIPPED if rate > 0.0 else CLOSED
    assert kernel.margin(x, xd, wrong) < 0.0
    assert kernel.next(x, xd, 0.0, wrong) == right


def test_an_actuator_with_limit_zero_does_nothing():
    kernel = Kernel(ActuatorLaw(proportional=3.0, derivative=1.0, limit=0.0))
    for x, xd in ((1.0, 0.0), (-1.0, 0.5), (0.0, 0.0)):
        mode = kernel.start(x, xd)
        assert kernel.at(x, xd, mode)[0] == 0.0
        assert not kernel.margin(x, xd, mode) < 0.0


# --- curve


@many
@given(seeds)
def test_a_curve_is_pchip_inside_and_linear_outside(seed):
    kernel, _, _, rng = drawn("curve", seed)
    points = kernel.record.curve
    pieces = PchipInterpolator(points[:, 0], points[:, 1])
    low, high = points[0, 0], points[-1, 0]
    for x in (*rng.uniform(low, high, 5), *points[:, 0]):
        f, slope = kernel.at(x)[:2]
        assert f == pytest.approx(pieces(x), rel=1e-11, abs=1e-11)
        assert slope == pytest.approx(pieces(x, 1), rel=1e-10, abs=1e-10)
    for end, beyond in ((low, -0.7), (low, -9.0), (high, 0.7), (high, 9.0)):
        f, slope = kernel.at(end + beyond)[:2]
        assert slope == pytest.approx(pieces(end, 1), rel=1e-10, abs=1e-10)
        assert f == pytest.approx(pieces(end) + beyond * pieces(end, 1), rel=1e-10, abs=1e-10)


@settings(many, max_examples=examples(5, 25))
@given(seeds)
def test_the_energy_of_a_curve_is_its_integral_from_no_elongation(seed):
    kernel, _, _, rng = drawn("curve", seed)
    knots = kernel.record.curve[:, 0]
    for x in (knots[0] - 1.5, knots[-1] + 1.5, rng.uniform(knots[0], knots[-1]), knots[0], knots[-1]):
        cuts = sorted({0.0, float(x), *(float(k) for k in knots if min(0.0, x) < k < max(0.0, x))})
        area = sum(quad(lambda s: kernel.at(s)[0], a, b)[0] for a, b in itertools.pairwise(cuts))
        assert kernel.at(x)[3] == pytest.approx(math.copysign(1.0, x) * area, rel=1e-9, abs=1e-9)
    assert kernel.at(0.0)[3] == pytest.approx(0.0, abs=1e-14)


@many
@given(seeds)
def test_every_piece_of_a_curve_is_the_curve_where_it_holds_and_goes_on_smoothly_beyond(seed):
    """Force, stiffness and energy in the mode that holds are those without one, and continuous where it changes."""
    kernel, x, _, _ = drawn("curve", seed)
    (mode, *_) = right_modes(kernel.record, x, 0.0)
    assert kernel.at(x, mode=mode) == pytest.approx(kernel.at(x), rel=1e-12, abs=1e-12)
    knots = kernel.record.curve[:, 0]
    for i, knot in enumerate(knots):
        assert kernel.at(knot, mode=i + 1) == pytest.approx(kernel.at(knot, mode=i + 2), rel=1e-10, abs=1e-10)
        beyond = 0.9 * kernel.p[3]
        assert kernel.margin(knot + beyond, 1.0, i + 1) > 0.0
        assert kernel.margin(knot + 1.2 * kernel.p[3], 1.0, i + 1) < 0.0
        assert kernel.at(knot + beyond, mode=i + 1)[0] == pytest.approx(kernel.at(knot + beyond)[0], abs=1e-12)


@pytest.mark.parametrize(("rate", "second", "piece"), [(1.0, -1.0, 3), (-1.0, 1.0, 2), (0.0, 1.0, 3), (0.0, -1.0, 2)])
def test_on_a_knot_a_curve_starts_in_the_piece_that_it_moves_into(rate, second, piece):
    kernel = Kernel(CurveLaw(curve=np.array([[-1.0, -2.0], [0.0, 0.0], [1.0, 5.0]])))
    assert kernel.start(0.0, rate, second) == piece
    assert kernel.margin(0.0, rate, piece) >= 0.0


def test_curves_share_one_array():
    rng = np.random.default_rng(4)
    first, second = some_curve(rng), some_curve(rng)
    alone = Kernel(second)
    curves: list[float] = []
    parameters(first, curves)
    behind = Kernel(second, curves)
    assert len(behind.curves) > len(alone.curves)
    for x in np.linspace(-4.0, 6.0, 41):
        assert behind.at(x) == pytest.approx(alone.at(x), rel=1e-14, abs=1e-14)


def test_a_monotone_curve_stays_monotone():
    kernel = Kernel(CurveLaw(curve=np.array([[-1.0, -10.0], [0.0, 0.0], [0.1, 0.0], [0.2, 50.0], [3.0, 51.0]])))
    slopes = [kernel.at(x)[1] for x in np.linspace(-2.0, 4.0, 301)]
    assert min(slopes) >= -1e-14 * max(slopes)  # one that is zero is formed of coefficients that cancel


# --- laws of time


@pytest.mark.parametrize("rate", [0.0, 1e-12, 1.0, 1e6, 1e12, 1e300])
def test_a_pulse_is_finite_and_within_its_peak_at_any_time(rate):
    law = PulseLaw(peak=-7.0, rate=rate, time=0.3)
    kernel = Kernel(law)
    for t in (0.3, 0.3 + 1e-9, -1e6, 1e6, 1e12, 1e150, *np.linspace(0.0, 1.0, 21)):
        row = kernel.at(0.0, 0.0, 0, t)
        assert np.isfinite(row).all()
        assert -7.0 <= row[0] <= 0.0
        with np.errstate(over="ignore", under="ignore"):
            exact = -7.0 * np.exp(-np.float64(rate) * (np.float64(t) - 0.3) ** 2)
        assert row[0] == pytest.approx(exact, rel=1e-12, abs=1e-300)
    assert kernel.at(0.0, 0.0, 0, 0.3)[0] == -7.0


def inside(law, start, end):
    """Where integrators land on behalf of a law between start and end, both included."""
    return breakpoints(SimpleNamespace(loads=(), start=start, end=end), law_breakpoints(law))


@pytest.mark.parametrize("rate", [4.0, 1e6, 1e12])
def test_no_step_passes_over_a_narrow_pulse(rate):
    law = PulseLaw(peak=1.0, rate=rate, time=0.4)
    times = inside(law, -10.0, 10.0)
    width = 1.0 / math.sqrt(rate)
    wanted = sorted(0.4 + side * part * width for part in (0.0, 1.0, 2.5, 4.0, 6.0) for side in (-1.0, 1.0))
    assert times[1:-1] == pytest.approx(sorted(set(wanted)), rel=1e-14)
    # what lies beyond the outermost ones is below rounding
    assert math.exp(-rate * (times[1] - 0.4) ** 2) < 1e-15


def test_landings_stay_within_the_simulated_time():
    law = PulseLaw(peak=1.0, rate=1.0, time=0.0, active_from=-5.0, active_until=2.0)
    assert inside(law, 0.0, 3.0) == pytest.approx([0.0, 1.0, 2.0, 2.5, 3.0])
    assert law_breakpoints(PulseLaw(peak=1.0, rate=0.0, time=0.5)) == []


@every_kind
def test_every_law_lands_on_the_ends_of_its_activity(kind):
    law = dataclasses.replace(MAKERS[kind](np.random.default_rng(5)), active_from=0.25, active_until=0.75)
    assert {0.25, 0.75} <= set(law_breakpoints(law))
    assert not {0.25, 0.75} & set(law_breakpoints(dataclasses.replace(law, active_from=None, active_until=None)))


def test_a_table_lands_on_its_rows():
    rows = np.array([0.0, 0.3, 0.3, 0.9])
    law = TableLaw(table=Table(rows, np.array([[0.0], [1.0], [2.0], [0.0]])))
    assert inside(law, 0.0, 2.0) == pytest.approx([0.0, 0.3, 0.9, 2.0])


class Wormhole(Law):
    """A law without kernels."""

    type = "wormhole"


def test_a_record_without_a_kernel_is_a_programming_mistake():
    with pytest.raises(TypeError, match="no kernel"):
        parameters(Wormhole(), [])
