"""Laws of formulas, run as Python: the same as the built-in laws, and as a second evaluation of the formulas."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from mdstopo.case.laws.expression_law import with_parameters
from mdstopo.case.model import ActuatorLaw, CubicLaw, GapLaw, Law, PulseLaw, SpringLaw
from mdstopo.mechanics.laws import law_table
from tests.formula.random_formulas import evaluate
from tests.space.in_python import in_python  # noqa: F401

pytestmark = pytest.mark.usefixtures("in_python")
#: a complex step is right to rounding
STEP = 1e-30
REST = 0.7


def law_of(force: str | None, energy: str | None = None, damping: str | None = None, **parameters: float) -> Law:
    """A law of formulas."""
    own = {"force": force, "energy": energy, "damping": damping}
    return with_parameters({**own, "free_length": None, "active_from": None, "active_until": None}, parameters)


class Kernels:
    """A law's kernels with its numbers."""

    def __init__(self, law: Law) -> None:
        self.law = law
        self.code = law_table.code_of(type(law))
        curves: list[float] = [1.0, 2.0, 3.0]
        self.p = np.array(law_table.parameters(law, curves))
        self.curves = np.array(curves)

    def start(self, x: float, xd: float, t: float = 0.0) -> int:
        """The mode at the start."""
        return int(law_table.law_start(self.code, self.p, x, xd, 0.0, t, self.curves, REST))

    def at(self, x: float, xd: float, mode: int, t: float = 0.0) -> Any:
        """f, f_x, f_xd, V, V_x."""
        return np.array(law_table.law(self.code, self.p, x, xd, mode, t, 0.0, self.curves, REST))

    def by(self, place: int, x: float, xd: float, mode: int, t: float = 0.0) -> Any:
        """Derivatives of f and V by a parameter."""
        return np.array(law_table.law_slopes(self.code, self.p, place, x, xd, mode, t, 0.0, self.curves, REST))

    def by_time(self, x: float, xd: float, mode: int, t: float) -> float:
        """Derivative of f by time."""
        return float(law_table.law_by_time(self.code, self.p, x, xd, mode, t, self.curves, REST))

    def margin(self, x: float, xd: float, mode: int, t: float = 0.0) -> float:
        """The margin."""
        return float(law_table.law_margin(self.code, self.p, x, xd, mode, t, self.curves, REST))

    def margin_by(self, place: int, x: float, xd: float, mode: int, t: float = 0.0) -> float:
        """Its derivative by a parameter."""
        return float(law_table.law_margin_slope(self.code, self.p, place, x, xd, mode, t, self.curves, REST))

    def margin_slopes(self, x: float, xd: float, mode: int, t: float = 0.0) -> list[float]:
        """Its derivatives by x, xd and t."""
        both = law_table.law_margin_slopes(self.code, self.p, x, xd, mode, t, self.curves, REST)
        return [*both, law_table.law_margin_by_time(self.code, self.p, x, xd, mode, t, self.curves, REST)]

    def is_idle(self, mode: int) -> bool:
        """Whether nothing acts."""
        return bool(law_table.law_is_idle(self.code, mode))

    def next(self, x: float, xd: float, mode: int, t: float = 0.0) -> int:
        """The mode behind the end of a mode."""
        return int(law_table.law_next(self.code, self.p, x, xd, 0.0, mode, t, self.curves, REST))


GAP = {"k": 300.0, "c": 7.0, "g": 0.02}
BUILT_IN = {
    "spring": (
        SpringLaw(stiffness=300.0, damping=7.0, preload=2.0),
        law_of("k*x + c*xd + p", "k*x^2/2", k=300.0, c=7.0, p=2.0),
    ),
    "gap": (
        GapLaw(stiffness=300.0, damping=7.0, gap=0.02),
        law_of("if(x >= g, k*(x - g) + c*xd, 0)", "if(x >= g, k*(x - g)^2/2, 0)", **GAP),
    ),
    "gap compressed": (
        GapLaw(stiffness=300.0, damping=7.0, gap=0.02, side="compression"),
        law_of("if(x <= -g, k*(x + g) + c*xd, 0)", "if(-x >= g, k*(x + g)^2/2, 0)", **GAP),
    ),
    "gap clipped": (
        GapLaw(stiffness=300.0, damping=7.0, gap=0.02, clip=True),
        law_of("if(x >= g, max(k*(x - g) + c*xd, 0), 0)", "k*max(x - g, 0)^2/2", **GAP),
    ),
    "gap of energy": (
        GapLaw(stiffness=300.0, damping=7.0, gap=0.02),
        law_of(None, "k*max(x - g, 0)^2/2", "c*step(x - g)*xd", **GAP),
    ),
    "cubic": (
        CubicLaw(stiffness=300.0, cubic=40.0),
        law_of("k*x + b*x^3", "k*x^2/2 + b*x^4/4", k=300.0, b=40.0),
    ),
    "cubic of energy": (CubicLaw(stiffness=300.0, cubic=40.0), law_of(None, "k*x^2/2 + b*x^4/4", k=300.0, b=40.0)),
    "pulse": (PulseLaw(peak=40.0, rate=50.0, time=0.1), law_of("a*exp(-r*(t - t0)^2)", a=40.0, r=50.0, t0=0.1)),
    "actuator": (
        ActuatorLaw(proportional=300.0, derivative=7.0, target=0.1, limit=20.0),
        law_of("clip(kp*(x - goal) + kd*xd, -most, most)", kp=300.0, kd=7.0, goal=0.1, most=20.0),
    ),
}  # fmt: skip
STATES = [(x, xd) for x in (-0.3, -0.021, 0.005, 0.0213, 0.11, 0.4) for xd in (-3.1, -0.2, 0.15, 2.9)]


@pytest.mark.parametrize("kind", BUILT_IN)
def test_built_in_laws_written_as_formulas_have_the_same_values_and_slopes(kind: str) -> None:
    one, other = (Kernels(law) for law in BUILT_IN[kind])
    for x, xd in STATES:
        for t in (0.0, 0.13):
            modes = one.start(x, xd, t), other.start(x, xd, t)
            found = other.at(x, xd, modes[1], t)
            np.testing.assert_allclose(found, one.at(x, xd, modes[0], t), rtol=1e-12, atol=1e-12)
            for place in range(len(law_table.numbers(type(other.law)))):
                by = one.by(place, x, xd, modes[0], t)
                np.testing.assert_allclose(other.by(place, x, xd, modes[1], t), by, rtol=1e-12, atol=1e-12)
            rest = one.by(law_table.FREE_LENGTH, x, xd, modes[0], t)
            np.testing.assert_allclose(
                other.by(law_table.FREE_LENGTH, x, xd, modes[1], t), rest, rtol=1e-12, atol=1e-12
            )


@pytest.mark.parametrize("kind", ["gap", "gap compressed", "gap clipped", "gap of energy", "actuator"])
def test_nothing_acts_where_nothing_of_the_built_in_laws_does(kind: str) -> None:
    one, other = (Kernels(law) for law in BUILT_IN[kind])
    found = {(one.is_idle(one.start(*state)), other.is_idle(other.start(*state))) for state in STATES}
    assert found == ({(False, False)} if kind == "actuator" else {(True, True), (False, False)})


def test_a_power_of_nothing_acts_where_its_exponent_is_not_above_zero() -> None:
    law = "if(x < 0, -k*(-x)^n, 0)", "k*max(-x, 0)^(n + 1)/(n + 1)"
    for n, idle in ((1.5, True), (-0.5, True), (-1.5, False)):
        kernels = Kernels(law_of(*law, k=2.0, n=n))
        assert kernels.is_idle(kernels.start(0.1, 0.0)) == idle
        assert (kernels.at(0.1, 0.0, kernels.start(0.1, 0.0)) == 0.0).all() == idle


def test_a_law_that_was_idle_acts_behind_its_switch_and_is_idle_again() -> None:
    kernels = Kernels(BUILT_IN["gap clipped"][1])
    open_one = kernels.start(0.0, 1.0)
    assert kernels.is_idle(open_one)
    closed = kernels.next(0.02 + 1e-16, 1.0, open_one)
    assert not kernels.is_idle(closed)
    assert kernels.at(0.03, 1.0, closed)[0] == pytest.approx(300.0 * 0.01 + 7.0)
    clipped = kernels.next(0.0201, -3.0, closed)
    assert not kernels.is_idle(clipped)  # it stores something
    assert kernels.is_idle(kernels.next(0.02 - 1e-16, -3.0, clipped))


@pytest.mark.parametrize("kind", ["gap", "gap compressed", "gap clipped", "gap of energy", "actuator"])
def test_they_switch_where_the_built_in_laws_do(kind: str) -> None:
    one, other = (Kernels(law) for law in BUILT_IN[kind])
    for x, xd in STATES:
        mode = other.start(x, xd)
        assert other.margin(x, xd, mode) >= 0.0
        for new_x, new_xd in STATES:
            modes = one.start(x, xd), mode
            left = [each.margin(new_x, new_xd, mode) < 0.0 for each, mode in zip((one, other), modes, strict=True)]
            assert left[0] == left[1]
            now = mode
            for _ in range(8):
                if other.margin(new_x, new_xd, now) >= 0.0:
                    break
                now = other.next(new_x, new_xd, now)
            right = other.start(new_x, new_xd)
            np.testing.assert_array_equal(other.at(new_x, new_xd, now), other.at(new_x, new_xd, right))


#: contact of Hunt and Crossley (1975); friction of Brown and McPhee (2016) with a normal force N; two slopes of
#: a crush tube with unloading by the rate; a tyre of Pacejka's form; a switch at a time; a length
FORMULAS: dict[str, tuple[str, dict[str, float]]] = {
    "hunt_crossley": ("if(x > 0, k*x^n*(1 + d*xd), 0)", {"k": 4e3, "n": 1.5, "d": 0.4}),
    "brown_mcphee": (
        "N*(mu*tanh(4*xd/v) + (ms - mu)*(xd/v)/((xd/v)^2/4 + 3/4)^2)",
        {"N": 50.0, "mu": 0.2, "ms": 0.4, "v": 0.1},
    ),
    "two_slopes": ("sign(x)*min(k*abs(x), k*y + h*(abs(x) - y)) + c*xd", {"k": 900.0, "h": 90.0, "y": 0.1, "c": 4.0}),
    "tyre": ("D*sin(C*atan(B*x - E*(B*x - atan(B*x))))", {"D": 30.0, "C": 1.4, "B": 8.0, "E": 0.3}),
    "switched": ("a*step(t - t0)*x + b*max(0, sin(w*t))", {"a": 40.0, "t0": 0.07, "b": 3.0, "w": 20.0}),
    "pulse": ("a*exp(-r*(t - t0)^2)*x + sin(w*t)*xd^2", {"a": 40.0, "r": 50.0, "t0": 0.1, "w": 20.0}),
    "length": ("k*log(l/l0)*l0 + c*xd/l + a*l0^2", {"k": 40.0, "c": 2.0, "a": 1.5}),
    "hyperbolic": ("k*sinh(a*x)/cosh(x) + asin(x/2) - acos(x/3)*tan(x) + atan2(x, k)", {"k": 3.0, "a": 2.0}),
}


def second(text: str, names: dict[str, Any]) -> Any:
    """The formula by Python; l = x + l0."""
    return evaluate(text, {**names, "l": names["x"] + names["l0"]})


@pytest.mark.parametrize("kind", FORMULAS)
def test_forces_and_all_slopes_are_those_of_complex_steps(kind: str) -> None:
    text, parameters = FORMULAS[kind]
    kernels = Kernels(law_of(text, **parameters))
    for x, xd in STATES:
        for t in (0.01, 0.13):  # at 0 the switch by time has a kink
            names: dict[str, Any] = {"x": x, "xd": xd, "t": t, "l0": REST, **parameters}
            mode = kernels.start(x, xd, t)
            found = kernels.at(x, xd, mode, t)
            force = complex(second(text, {word: complex(value) for word, value in names.items()})).real
            assert found[0] == pytest.approx(force, rel=1e-12, abs=1e-12)
            found_slopes = {"x": found[1], "xd": found[2], "t": kernels.by_time(x, xd, mode, t)}
            found_slopes |= {word: kernels.by(place, x, xd, mode, t)[0] for place, word in enumerate(parameters)}
            for word, slope in found_slopes.items():
                stepped = complex(second(text, {**names, word: complex(names[word], STEP)})).imag / STEP
                assert slope == pytest.approx(stepped, rel=1e-10, abs=1e-10), (word, x, xd)
            # a longer free length at fixed places of the ends shortens the elongation
            moved = {**names, "x": complex(x, -STEP), "l0": complex(REST, STEP)}
            stepped = complex(second(text, moved)).imag / STEP
            assert kernels.by(law_table.FREE_LENGTH, x, xd, mode, t)[0] == pytest.approx(stepped, rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("kind", ["hunt_crossley", "two_slopes", "switched"])
def test_where_a_margin_is_zero_moves_with_parameters_as_its_slopes_say(kind: str) -> None:
    text, parameters = FORMULAS[kind]
    kernels = Kernels(law_of(text, **parameters))
    small, looked = 1e-5, 0
    for start in ((-0.3, 0.1, 0.0), (0.05, 0.2, 0.0), (0.2, -0.1, 0.06), (0.3, 0.2, 0.1)):
        mode = kernels.start(*start)
        for moved in range(3):

            def margin(value: float, of: Kernels, moved: int = moved, start: Any = start, mode: int = mode) -> float:
                x, xd, t = (value if i == moved else each for i, each in enumerate(start))
                return of.margin(x, xd, mode, t)

            span = sorted((start[moved], -1.0 if start[moved] > 0.0 else 1.0))
            if not margin(span[0], kernels) * margin(span[1], kernels) < 0.0:
                continue
            root = brentq(margin, *span, args=(kernels,), xtol=1e-15)
            at = tuple(root if i == moved else each for i, each in enumerate(start))
            slope = kernels.margin_slopes(at[0], at[1], mode, at[2])[moved]
            for place, word in enumerate(parameters):
                ends = []
                for step in (small, -small):
                    other = Kernels(law_of(text, **{**parameters, word: parameters[word] * (1.0 + step)}))
                    ends.append(brentq(margin, root - 0.01, root + 0.01, args=(other,), xtol=1e-15))
                moves = (ends[0] - ends[1]) / (2.0 * small * parameters[word])
                found = -kernels.margin_by(place, at[0], at[1], mode, at[2]) / slope
                assert found == pytest.approx(moves, rel=1e-6, abs=1e-8), (word, at)
                looked += 1
    assert looked >= len(parameters)


def test_a_margin_of_any_scale_tells_a_distance() -> None:
    for text in ("step(1e-9*x^3 - 1e-9)", "max(1e12*(x^3 - 1), 0)", "if(exp(x) > exp(1), 1, 0)"):
        kernels = Kernels(law_of(text))
        mode = kernels.start(0.9, 0.0)
        assert kernels.margin(1.0 - 1e-7, 0.0, mode) == pytest.approx(1e-7, rel=1e-5)
        assert kernels.margin(1.0 + 1e-7, 0.0, mode) == pytest.approx(-1e-7, rel=1e-5)


#: a contact that begins with a fractional power, in several spellings
CONTACTS = (
    "if(x > 0, k*x^n*(1 + d*xd), 0)",
    "k*max(x, 0)^n*(1 + d*xd)",
    "k*step(x)*x^n*(1 + d*xd)",
    "if(0 > x, 0, k*x*abs(x)^(n - 1)*(1 + d*xd))",
    "k*(1 + d*xd)*if(x > 0, sqrt(x)^(2*n), 0)",
)


@pytest.mark.parametrize("text", CONTACTS)
def test_a_fractional_power_is_finite_beyond_its_end_and_where_it_is_not_looked_at(text: str) -> None:
    parameters = {"k": 4e3, "n": 1.5, "d": 0.4}
    kernels, plain = (Kernels(law_of(each, **parameters)) for each in (text, CONTACTS[0]))
    for side in (0.1, -0.1):
        mode = kernels.start(side, 0.3)
        for x in (0.1, 0.02, -1e-15, -0.1):
            if side > 0.0 or x < 0.0:
                expected = plain.at(max(x, 0.0), 0.3, plain.start(side, 0.3))
                np.testing.assert_allclose(kernels.at(x, 0.3, mode)[0], expected[0], rtol=1e-12, atol=1e-18)
            if abs(x) > 1e-3 and x * side > 0.0:
                np.testing.assert_allclose(kernels.at(x, 0.3, mode)[:3], expected[:3], rtol=1e-12)
            for place in range(3):
                assert np.isfinite(kernels.by(place, x, 0.3, mode)).all()


@pytest.mark.parametrize("text", ["sqrt(x)", "k*x^n", "if(x < 1, log(x), 2)", "if(sqrt(x) < 1, 1, 2)", "x*sqrt(x)"])
def test_what_has_no_value_where_it_is_looked_at_is_none(text: str) -> None:
    kernels = Kernels(law_of(text, k=2.0, n=0.7))
    assert np.isnan(kernels.at(-0.1, 0.0, kernels.start(0.5, 0.0))).all()
    assert np.isfinite(kernels.at(0.1, 0.0, kernels.start(0.5, 0.0))).all()


def test_a_margin_that_jumps_with_another_switch_changes_sides_with_it() -> None:
    kernels = Kernels(law_of("if(sign(x)*xd > 0.5, 3, 1) + x"))
    mode = kernels.start(-0.1, 1.0)
    assert kernels.at(-0.1, 1.0, mode)[0] == pytest.approx(0.9)
    mode = kernels.next(1e-16, 1.0, mode)
    assert kernels.at(0.1, 1.0, mode)[0] == pytest.approx(3.1)
    assert kernels.margin(0.1, 1.0, mode) > 0.0


def test_comparisons_of_the_same_have_one_switch() -> None:
    law: Any = law_of("abs(x) + if(2*x > 0, x, 0) + if(0 >= x, x, 0) + sign(-3*x) + max(x, 0) + min(0, -x)")
    assert law.program.switches == 1
    fixed: Any = law_of("if(k > 0, x, -x) + max(k, 1)*x", k=2.0)
    assert fixed.program.switches == 0


def test_an_inner_switch_that_nobody_looks_at_does_nothing_and_is_right_again_later() -> None:
    kernels = Kernels(law_of("if(x > 1, sign(xd - 2), 5)"))
    mode = kernels.start(0.5, 3.0)
    assert kernels.margin(0.5, 1.0, mode) == 0.5
    new = kernels.next(1.0 + 1e-15, 1.0, mode)
    assert kernels.at(1.1, 1.0, new)[0] == -1.0
    assert kernels.margin(1.1, 1.0, new) == pytest.approx(0.1)
