"""Members that are crushed: closed forms, a return mapping of its own, energy, exact gradients through the set."""

import math

import numpy as np
import pytest

import mdstopo
from mdstopo.case.model import CrushLaw
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.mechanics.laws import crush, law_table
from mdstopo.status import Status
from tests.compiled import compiled
from tests.general.support import check_adjoint, check_direct, design_of, load, simulate_text, slopes

OPEN, ELASTIC, CRUSHING = crush.OPEN, crush.ELASTIC, crush.CRUSHING
CRUSH = law_table.CODES["crush"]

ONE = """
format: 1
gravity: [0, {g}]
time: {{end: {end}}}
bodies: {{ball: {{mass: 2, inertia: 1, position: [0, 1], velocity: [0, {v}]}}}}
motions: [{{body: ball, x: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  leg:
    from: {{body: ground, at: [0, {foot}]}}
    to: {{body: ball, at: [0, 1]}}
    law: {{type: crush, stiffness: 2000, force: 60, {more}}}
design: {{initial: 1, lower: 0.1}}
objectives:
  a: {{response: {{acceleration: {{body: ball}}}}, over_time: max}}
  s: {{response: {{displacement: {{body: ball, component: y}}}}, over_time: final}}
  E: {{response: energy, over_time: mean}}
  F: {{response: {{member_force: {{group: leg}}}}, over_time: max}}
  I: {{response: {{member_force: {{group: leg}}}}, over_time: integral}}
combine: {{weights: {{a: 1, s: 1, E: 1, F: 1, I: 1}}}}
"""
K, F, M = 2000.0, 60.0, 2.0


def one(end=1.5, v=-3.0, g=-10.0, foot=-1.0, more="gap: 0.1"):
    return ONE.format(end=end, v=v, g=g, foot=foot, more=more)


# --- the law by itself


@compiled
def _law(p, x, mode):
    return law_table.law(CRUSH, p, x, 0.0, mode, 0.0, 0.0, np.empty(0), 1.0)


@compiled
def _margin(p, x, xd, mode):
    return law_table.law_margin(CRUSH, p, x, xd, mode, 0.0, np.empty(0), 1.0)


@compiled
def _slopes(p, x, xd, mode):
    return law_table.law_margin_slopes(CRUSH, p, x, xd, mode, 0.0, np.empty(0), 1.0)


@compiled
def _next(p, x, mode):
    return law_table.law_next(CRUSH, p, x, 0.0, 0.0, mode, 0.0, np.empty(0), 1.0)


@compiled
def _start(p, x, xd, xdd):
    mode = law_table.law_start(CRUSH, p, x, xd, xdd, 0.0, np.empty(0), 1.0)
    return mode, law_table.law_first_set(CRUSH, p, x, mode)


@compiled
def _set(p, x, old, new):
    return law_table.law_set(CRUSH, p, x, old, new)


def row_of(side, gap=0.1):
    return np.array(law_table.parameters(CrushLaw(stiffness=50.0, force=4.0, gap=gap, side=side), []))


@pytest.mark.parametrize(("side", "s"), [("tension", 1.0), ("compression", -1.0)])
def test_the_law_is_its_definition_in_every_mode(side, s):
    p = row_of(side)
    for y in (-0.02, 0.03, 0.07):
        x = s * (y + 0.1)
        assert _law(p, x, OPEN) == (0.0, 0.0, 0.0, 0.0, 0.0)
        assert _law(p, x, ELASTIC) == pytest.approx((s * 50.0 * y, 50.0, 0.0, 25.0 * y * y, s * 50.0 * y))
        assert _law(p, x, CRUSHING) == pytest.approx((s * 4.0, 0.0, 0.0, 0.16, 0.0))
        h = 1e-6
        for mode in (OPEN, ELASTIC, CRUSHING):
            by_x = (_margin(p, x + h, 0.3, mode) - _margin(p, x - h, 0.3, mode)) / (2 * h)
            by_rate = (_margin(p, x, 0.3 + h, mode) - _margin(p, x, 0.3 - h, mode)) / (2 * h)
            assert _slopes(p, x, 0.3, mode) == pytest.approx((by_x, by_rate), abs=1e-8)


@pytest.mark.parametrize(("side", "s"), [("tension", 1.0), ("compression", -1.0)])
def test_force_and_energy_are_continuous_where_a_mode_ends(side, s):
    p = row_of(side)
    for y, before, after in ((0.0, OPEN, ELASTIC), (0.08, ELASTIC, CRUSHING)):
        x = s * (y + 0.1)
        assert _margin(p, x, 0.0, before) == pytest.approx(0.0, abs=1e-16)
        assert np.array(_law(p, x, before))[[0, 3]] == pytest.approx(np.array(_law(p, x, after))[[0, 3]], abs=1e-13)
    # crushing ends 0.3 m further: the set takes the elongation back to the plateau
    x = s * (0.1 + 0.08 + 0.3)
    assert _margin(p, x, -s * 0.01, CRUSHING) < 0.0
    assert _next(p, x, CRUSHING) == ELASTIC
    grown = _set(p, x, CRUSHING, ELASTIC)
    assert grown == pytest.approx(s * 0.3)
    assert _law(p, x - grown, ELASTIC)[0] == pytest.approx(s * 4.0)
    assert _set(p, x, OPEN, ELASTIC) == 0.0


def test_the_start_is_where_elongation_and_rate_say():
    p = row_of("compression")
    assert _start(p, 0.0, -1.0, 0.0) == (OPEN, 0.0)
    assert _start(p, -0.1, -1.0, 0.0) == (ELASTIC, 0.0)
    assert _start(p, -0.1, 0.0, 1.0) == (OPEN, 0.0)
    assert _start(p, -0.15, 1.0, 0.0) == (ELASTIC, 0.0)
    assert _start(p, -0.3, -1.0, 0.0) == (CRUSHING, 0.0)
    mode, first = _start(p, -0.3, 1.0, 0.0)
    assert mode == ELASTIC
    assert first == pytest.approx(-0.12)


@pytest.mark.parametrize("key", ["stiffness", "force"])
@pytest.mark.parametrize("value", ["0", "-1"])
def test_a_leg_without_stiffness_or_plateau_is_refused(key, value):
    other = "force" if key == "stiffness" else "stiffness"
    text = one().replace("stiffness: 2000, force: 60", f"{key}: {value}, {other}: 60")
    with pytest.raises(CaseError, match=rf"members\.leg\.law\.{key}"):
        read_case(text)


# --- motions


def test_the_stroke_and_the_rebound_of_one_mass_are_those_of_the_energy_balance():
    """Without gravity: m v^2 / 2 = F^2 / (2 k) + F p, and the mass leaves with what was elastic."""
    v = 3.0
    motion = simulate_text(one(v=-v, g=0, more="gap: 0.1"), tolerance=1e-11)
    touch, omega = 0.1 / v, math.sqrt(K / M)
    yielded = math.asin(F / K * omega / v) / omega
    speed = v * math.cos(omega * yielded)
    stopped = speed * M / F
    permanent = (0.5 * M * v**2 - 0.5 * F**2 / K) / F
    assert 0.5 * M * speed**2 / F == pytest.approx(permanent, rel=1e-12)  # the same twice
    deepest = motion.at([touch + yielded + stopped])
    assert deepest.q[0, 1] == pytest.approx(1.0 - 0.1 - F / K - permanent, abs=1e-9)
    assert deepest.v[0, 1] == pytest.approx(0.0, abs=1e-8)
    leaves = motion.at([touch + yielded + stopped + 0.5 * math.pi / omega])
    assert leaves.q[0, 1] == pytest.approx(1.0 - 0.1 - permanent, abs=1e-9)
    assert motion.v[-1, 1] == pytest.approx(F / math.sqrt(K * M), abs=1e-8)
    assert motion.a[-1, 1] == 0.0


def mapped(x, k, f, gap, s):
    """Force and permanent set along elongations x by return mapping, point by point: no events, no modes."""
    force, sets, p = [], [], 0.0
    for each in x:
        y = s * (each - p) - gap
        if y > f / k:
            p += s * (y - f / k)
            y = f / k
        force.append(s * k * max(y, 0.0))
        sets.append(p)
    return np.array(force), np.array(sets)


def test_forces_of_many_cycles_are_those_of_a_return_mapping():
    """A mass between two crushable stops, driven to and fro with a growing load: each side yields again and again."""
    text = """
format: 1
time: {end: 3}
bodies: {mass: {mass: 1, inertia: 1, position: [0, 0]}}
motions: [{body: mass, y: {velocity: 0}, angle: {velocity: 0}}]
members:
  left: {from: {body: ground, at: [-20, 0]}, to: {body: mass, at: [0, 0]},
    law: {type: crush, stiffness: 900, force: 12, gap: 0.02}, design: false}
  right: {from: {body: ground, at: [-30, 0]}, to: {body: mass, at: [0, 0]},
    law: {type: crush, stiffness: 500, force: 9, gap: 0.01, side: tension}, design: false}
loads: [{body: mass, force: [{table: [[0, 0], [0.4, 15], [0.9, -20], [1.5, 24], [2.1, -28], [3, 30]]}, 0]}]
"""
    motion = simulate_text(text, tolerance=1e-11)
    assert motion.status.ok
    t = np.linspace(0.0, 3.0, 200_001)
    seen = motion.at(t)
    x = seen.q[:, 0]
    left, left_set = mapped(x, 900.0, 12.0, 0.02, -1.0)
    right, right_set = mapped(x, 500.0, 9.0, 0.01, 1.0)
    load = np.interp(t, [0, 0.4, 0.9, 1.5, 2.1, 3], [0, 15, -20, 24, -28, 30])
    assert np.unique(np.round(left_set, 6)).size > 100
    assert np.unique(np.round(right_set, 6)).size > 100
    assert len(np.flatnonzero(np.diff(np.sign(np.diff(right_set)), n=1))) >= 3  # yields in several bursts
    off = seen.a[:, 0] - (load - left - right)
    assert np.abs(off).max() <= 1e-5  # of up to 30; what the mapping misses between its points
    work = np.concatenate(
        [[0.0], np.cumsum(0.5 * np.diff(t) * (load * seen.v[:, 0])[:-1] + 0.5 * np.diff(t) * (load * seen.v[:, 0])[1:])]
    )
    kept = 0.5 * seen.v[:, 0] ** 2 + left**2 / 1800.0 + right**2 / 1000.0
    lost = 12.0 * np.abs(left_set) + 9.0 * np.abs(right_set)
    assert np.abs(kept + lost - work).max() <= 1e-6 * work.max()


def test_a_leg_that_begins_to_act_where_it_is_short_takes_no_more_than_its_plateau():
    late = simulate_text(one(v=0, more="gap: -0.5, active_from: 0.2", end=0.4), tolerance=1e-11)
    before, after = late.at([0.2 - 1e-9]).a[0, 1], late.at([0.2]).a[0, 1]
    assert before == pytest.approx(-10.0)
    assert after == pytest.approx(-10.0 + F / M)
    # and on its way up, it has been crushed: elastic at once
    rising = simulate_text(one(v=5, more="gap: -3, active_from: 0.2", end=0.4), tolerance=1e-11)
    speed = 5.0 - 2.0
    omega = math.sqrt(K / M)
    s = 0.05
    # y'' = -omega^2 (y - y_e), from the plateau: y falls by F / k to contact's end
    rest = M * 10.0 / K
    y = rest + (F / K - rest) * math.cos(omega * s * 0.1) - speed / omega * math.sin(omega * s * 0.1)
    lift = 5.0 * 0.2 - 0.5 * 10.0 * 0.04
    assert rising.at([0.2 + s * 0.1]).q[0, 1] == pytest.approx(1.0 + lift + F / K - y, abs=1e-9)


def test_a_case_that_begins_beyond_the_plateau_is_crushed_already():
    motion = simulate_text(one(v=1.0, g=0, foot=0, more="free_length: 1.5", end=0.2), tolerance=1e-11)
    assert motion.a[0, 1] == pytest.approx(F / M)
    omega = math.sqrt(K / M)
    reach = F / K * math.cos(omega * 0.02) - math.sin(omega * 0.02) / omega
    assert motion.at([0.02]).q[0, 1] == pytest.approx(1.0 + F / K - reach, abs=1e-10)


# --- gradients


@pytest.mark.parametrize("solver", [{"tolerance": 1e-11}], ids=["runge_kutta"])
def test_the_adjoint_is_the_derivative_of_what_is_computed(solver):
    check_adjoint(load("crash", **solver), 3e-6, 1e-6)


@pytest.mark.parametrize("solver", [{"tolerance": 1e-10}, {"integrator": "generalized_alpha", "step": 0.001}])
def test_direct_and_adjoint_agree(solver):
    check_direct(load("crash", **solver))


def test_generalized_alpha_gives_the_gradient_to_its_own_order():
    exact = mdstopo.evaluate(load("crash", tolerance=1e-11), design_of(load("crash"))).gradients
    errors = []
    for step in (0.002, 0.0005):
        case = load("crash", integrator="generalized_alpha", step=step)
        found = mdstopo.evaluate(case, design_of(case)).gradients
        errors.append([np.abs(found[name] - exact[name]).max() / np.abs(exact[name]).max() for name in exact])
    assert np.max(errors[0]) < 0.2
    assert np.max(errors[1]) < np.max(errors[0]) / 3.0


def test_generalized_alpha_gives_the_impulse_of_a_leg_that_is_left_to_its_own_order():
    """A step of one stage that ends where contact is lost: the force there is none, and its slope that of before."""
    text, alpha = one(end=0.35), np.array([0.9])
    exact = mdstopo.evaluate(read_case(text, overrides={"solver.tolerance": "1e-11"}), alpha).gradients["I"][0]
    errors = []
    for step in ("1e-3", "2.5e-4"):
        case = read_case(text, overrides={"solver.integrator": "generalized_alpha", "solver.step": step})
        errors.append(abs(mdstopo.evaluate(case, alpha).gradients["I"][0] - exact) / abs(exact))
    assert errors[0] < 1e-2
    assert errors[1] < errors[0] / 8.0


def test_the_impulse_of_one_leg_is_that_of_the_momentum_in_value_and_slope():
    case = read_case(one(), overrides={"solver.tolerance": "1e-11"})
    found = mdstopo.evaluate(case, np.array([0.9]))
    motion = mdstopo.simulate(case, np.array([0.9]))
    impulse = M * (motion.v[-1, 1] + 3.0) + M * 10.0 * 1.5
    assert found.objectives["I"] == pytest.approx(impulse, rel=1e-8)
    for name, slope in slopes(case, np.array([0.9]), np.ones(1), 1e-4).items():
        assert found.gradients[name][0] == pytest.approx(slope, rel=2e-6), name
    # the plateau is alpha F whatever the motion
    assert found.gradients["F"][0] == pytest.approx(F, rel=1e-8)
    assert found.gradients["a"][0] == pytest.approx(F / M, rel=1e-8)


def test_histories_end_in_the_gradient():
    case = load("crash", tolerance=1e-9)
    from mdstopo.engine import Evaluator

    evaluator = Evaluator(case)
    alpha = design_of(case)
    status, _, lines = evaluator.histories(alpha, "end")
    assert status.ok
    gradient = evaluator.evaluate(alpha).gradients["end"]
    assert np.abs(lines[-1] - gradient).max() <= 1e-5 * np.abs(gradient).max()


# --- a plateau that is only just reached


def just(beyond):
    """A mass whose elastic depth would be F / k + beyond, without gravity."""
    speed = math.sqrt(K / M) * (F / K + beyond)
    case = read_case(one(v=-speed, g=0, foot=0, end=0.5, more="gap: 0"), overrides={"solver.tolerance": "1e-10"})
    return mdstopo.evaluate(case, np.ones(1))


@pytest.mark.parametrize("beyond", [1e-12, -1e-12])
def test_a_plateau_that_is_only_just_reached_is_told_on_either_side(beyond):
    assert just(beyond).status is Status.GRAZING


def test_a_proper_crush_and_a_clear_miss_are_differentiable_and_differ():
    near, below = just(1e-6), just(-1e-6)
    assert near.status.ok
    assert below.status.ok
    assert abs(near.gradients["s"][0] - below.gradients["s"][0]) > 0.1 * abs(below.gradients["s"][0])


def test_an_undamped_return_to_the_same_plateau_is_no_grazing():
    """It comes back to just that force each time; both derivatives are the same there."""
    found = mdstopo.evaluate(read_case(one(), overrides={"solver.tolerance": "1e-11"}), np.ones(1))
    assert found.status.ok


#: a weight on a spring, hung under legs that begin to act while they are short beyond their plateau and become longer
TOO_SHORT = """
format: 1
time: {{end: 0.4}}
gravity: [0, -9.8]
bodies: {{weight: {{mass: 2, inertia: 1, position: [0, 1], velocity: [0, -1]}}}}
points:
  up: {{body: ground, grid: {{list: [{up}]}}}}
  down: {{body: weight, grid: {{list: [{down}]}}}}
members:
  legs:
    from: up
    to: down
    connect: pairs
    law: {{type: crush, stiffness: {k}, force: {f}, side: compression, free_length: 2.5, active_from: 0.1}}
  spring:
    from: {{body: ground, at: [0, 0]}}
    to: {{body: weight, at: [0, 1]}}
    law: {{type: spring, stiffness: 90, damping: 3}}
design: {{initial: 0.7}}
objectives: {{G: {{response: {{displacement: {{body: weight, component: y}}}}, over_time: final}}}}
solver: {{integrator: runge_kutta, step: 0.02}}
"""


def too_short(legs):
    """The case with so many legs beside each other that are as strong as one."""
    places = (", ".join([f"[0, {height}]"] * legs) for height in (3.0, 1.0))
    return read_case(TOO_SHORT.format(k=1600 / legs, f=16 / legs, **dict(zip(("up", "down"), places, strict=True))))


def test_many_legs_that_are_crushed_as_they_begin_to_act_are_one_leg():
    """Each switches three times at once; not all did, and the others followed in a step without length, at a time that
    was taken to vary with the design."""
    one, many = (mdstopo.evaluate(too_short(legs), np.full(legs + 1, 0.7)) for legs in (1, 48))
    assert many.objectives["G"] == pytest.approx(one.objectives["G"], rel=1e-12)
    wanted, found = one.gradients["G"], many.gradients["G"]
    assert found[:48].sum() == pytest.approx(wanted[0], rel=1e-10)
    assert found[48] == pytest.approx(wanted[1], rel=1e-10)
