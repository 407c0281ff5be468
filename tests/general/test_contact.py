"""Points against edges: closed forms of sliding, momentum, energy, ends of edges, exact gradients, refusals."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.general.dynamics.general_contact import add_contacts
from mdstopo.general.model.general_model import pack_general, unpack_general
from mdstopo.mechanics import contact
from mdstopo.mechanics.contact import ABOVE, BESIDE, CLIPPED, CLOSED
from mdstopo.mechanics.kinematics.kinematics_interface import pose_size, relative_pose
from mdstopo.status import Status
from tests.compiled import compiled
from tests.general.support import check_adjoint, check_direct, design_of, load, simulate_text
from tests.space.in_python import in_python  # noqa: F401  (a fixture)

G, ANGLE, K = 9.8, 0.4, 2.0e5
# a block that does not turn, on two feet, on a slope that falls to the right; it begins at its depth at rest
SLOPE = """
format: 1
gravity: [0, -9.8]
time: {{end: {end}}}
bodies:
  block: {{mass: 10, inertia: 1, position: [{x}, {y}], angle: -0.4, velocity: [{vx}, {vy}]}}
motions: [{{body: block, angle: {{velocity: 0}}}}]
points: {{feet: {{body: block, frame: body, grid: {{list: [[-0.2, -0.1], [0.2, -0.1]]}}}}}}
contacts:
  - points: feet
    on: {{body: ground, from: [{left}, {high}], to: [{right}, {low}]}}
    stiffness: 2.0e+5
    damping: {damping}
    friction: {friction}
    slip: 0.05
solver: {{tolerance: 1.0e-11}}
"""


def slope(end=1.0, friction=0.2, speed=0.0, lift=0.0, damping=0.0, length=50.0):
    """The block on the slope; lift: height of its feet above where they carry it at rest."""
    down, normal = np.array([np.cos(ANGLE), -np.sin(ANGLE)]), np.array([np.sin(ANGLE), np.cos(ANGLE)])
    sunk = 10.0 * G * np.cos(ANGLE) / (2.0 * K)
    at = (0.1 - sunk + lift) * normal
    v = speed * down
    right, left = length * down, -length * down
    return SLOPE.format(
        end=end, x=at[0], y=at[1], vx=v[0], vy=v[1], right=right[0], low=right[1], left=left[0], high=left[1],
        friction=friction, damping=damping,
    )  # fmt: skip


def along(motion, t):
    seen = motion.at(t)
    down = np.array([np.cos(ANGLE), -np.sin(ANGLE)])
    start = motion.q[0, :2]
    return (seen.q[:, :2] - start) @ down, seen.v[:, :2] @ down


@pytest.mark.parametrize(("friction", "speed"), [(0.2, 0.0), (0.2, 1.5), (0.6, 2.0)])
def test_a_block_slides_down_a_slope_as_its_one_equation_says(friction, speed):
    """N stays m g cos: m s'' = m g sin - mu N tanh(s' / slip), solved apart; faster than slip it is Coulomb's law."""
    motion = simulate_text(slope(friction=friction, speed=speed))
    assert motion.status.ok

    def rate(_, y):
        return y[1], G * np.sin(ANGLE) - friction * G * np.cos(ANGLE) * np.tanh(y[1] / 0.05)

    t = np.linspace(0.0, 1.0, 21)
    exact = solve_ivp(rate, (0.0, 1.0), (0.0, speed), method="DOP853", rtol=1e-12, atol=1e-14, t_eval=t).y
    distance, velocity = along(motion, t)
    assert np.abs(distance - exact[0]).max() <= 1e-8
    assert np.abs(velocity - exact[1]).max() <= 1e-8
    if speed > 0.0 and friction == 0.2:
        coulomb = speed * t + 0.5 * t**2 * G * (np.sin(ANGLE) - friction * np.cos(ANGLE))
        assert np.abs(distance - coulomb).max() <= 1e-6


def test_below_the_angle_of_friction_a_block_creeps_at_a_known_speed():
    motion = simulate_text(slope(friction=0.6, end=3.0))
    creep = 0.05 * np.arctanh(np.tan(ANGLE) / 0.6)
    assert along(motion, [3.0])[1][0] == pytest.approx(creep, rel=1e-8)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-12])
@pytest.mark.parametrize("slip", [1e-3, 1e-5, 1e-7])
def test_a_block_that_comes_to_rest_creeps_as_its_slip_says_however_small_that_is(slip, tolerance):
    """Where it has come to rest, it creeps at slip artanh(tan(angle) / mu), to the tolerance."""
    stop = 0.1 / (G * (0.6 * np.cos(ANGLE) - np.sin(ANGLE)))
    text = slope(end=stop + 500.0 * slip, friction=0.6, speed=0.1, length=1.0).replace("slip: 0.05", f"slip: {slip!r}")
    motion = simulate_text(text, tolerance=tolerance)
    assert motion.status.ok
    at_rest = motion.t[motion.t > stop + 40.0 * slip]
    creep = slip * np.arctanh(np.tan(ANGLE) / 0.6)
    assert len(at_rest) > 50
    np.testing.assert_allclose(along(motion, at_rest)[1], creep, rtol=max(10.0 * tolerance, 2e-9))


TIED = """
members:
  tie: {{from: {{body: ground, at: [{x}, {y}]}}, to: {{body: block, frame: body, at: [0, 0]}},
    law: {{type: spring, stiffness: {stiffness}}}}}
design: {{initial: 0.8}}
objectives:
  speed: {{response: {{velocity: {{body: block, component: x}}}}, over_time: final}}
  way: {{response: {{displacement: {{body: block, component: x}}}}, over_time: final}}
combine: {{method: weighted_sum, weights: {{speed: 1, way: 1}}}}
"""


@pytest.mark.parametrize(
    ("slip", "tolerance"), [*((1e-4, 10.0**-k) for k in (4, 6, 8, 10, 12)), (1e-3, 1e-8), (1e-5, 1e-8)]
)
def test_values_and_gradients_of_a_creeping_block_are_those_of_its_one_equation(slip, tolerance):
    """Tied by a spring along the slope: m s'' = m g sin - mu N tanh(s' / slip) - alpha k s, with its slope by alpha."""
    stop = 0.1 / (G * (0.6 * np.cos(ANGLE) - np.sin(ANGLE)))
    end, stiffness = 1.05 * stop + 2000.0 * slip, 9.8 / (0.05 * stop)
    down, normal = np.array([np.cos(ANGLE), -np.sin(ANGLE)]), np.array([np.sin(ANGLE), np.cos(ANGLE)])
    x, y = (0.1 - 10.0 * G * np.cos(ANGLE) / (2.0 * K)) * normal - down
    text = slope(end=end, friction=0.6, speed=0.1, length=2.0).replace("slip: 0.05", f"slip: {slip!r}")
    found = mdstopo.evaluate(
        read_case(
            text + TIED.format(x=x, y=y, stiffness=stiffness),
            overrides={"solver.tolerance": str(tolerance), "solver.integrator": "runge_kutta"},
        )
    )
    assert found.status.ok
    drag, pull = 0.6 * G * np.cos(ANGLE), stiffness / 10.0

    def rate(_, z):  # s, s' / slip, and their slopes by alpha
        s, w, s_a, w_a = z
        share = np.tanh(w)
        forward = G * np.sin(ANGLE) - drag * share - 0.8 * pull * s
        slope_of_it = -drag * (1.0 - share**2) * w_a - pull * s - 0.8 * pull * s_a
        return [slip * w, forward / slip, slip * w_a, slope_of_it / slip]

    small = [1e-16, 1e-12, 1e-16, 1e-12]
    s, w, s_a, w_a = solve_ivp(rate, (0.0, end), [0.0, 0.1 / slip, 0.0, 0.0], "Radau", rtol=2e-12, atol=small).y[:, -1]
    bound = max(10.0 * tolerance, 3e-7 * 1e-4 / slip)  # rounding of where the feet are
    assert found.objectives["way"] == pytest.approx(np.cos(ANGLE) * s, rel=max(10.0 * tolerance, 1e-9))
    assert found.gradients["way"][0] == pytest.approx(np.cos(ANGLE) * s_a, rel=max(10.0 * tolerance, 1e-9))
    assert found.objectives["speed"] == pytest.approx(np.cos(ANGLE) * slip * w, rel=bound)
    assert found.gradients["speed"][0] == pytest.approx(np.cos(ANGLE) * slip * w_a, rel=bound)


def test_a_slip_that_needs_far_too_many_steps_is_refused_by_its_contact():
    motion = simulate_text(slope(friction=0.6, end=20.0).replace("slip: 0.05", "slip: 1.0e-9"), tolerance=1e-6)
    assert motion.status is Status.STEP_LIMIT
    assert "point 0 of contact 0, of block on ground" in motion.message
    assert "slip" in motion.message
    assert motion.work["steps"] < 5000


def test_a_light_foot_that_a_joint_holds_brakes_with_what_it_carries():
    """Steps are limited by the mass that friction brakes: that of the machine, not of its shoe."""
    text = slope(friction=0.6, end=0.05).replace("slip: 0.05", "slip: 1.0e-4")
    body = text[text.index("  block:") : text.index("motions")]
    shoe = body.replace("block", "shoe").replace("mass: 10, inertia: 1", "mass: 0.001, inertia: 0.001")
    heel = text[text.index("  block:") : text.index("angle: -0.4")].split("position: ")[1].rstrip(", ")
    shod = text.replace(body, body + shoe).replace("points: {feet: {body: block", "points: {feet: {body: shoe")
    shod = shod.replace("motions:", f"joints: [{{type: fixed, bodies: [block, shoe], at: {heel}}}]\nmotions:")
    plain, jointed = (simulate_text(each, tolerance=1e-8) for each in (text, shod))
    assert plain.status.ok
    assert jointed.status.ok
    assert plain.work["steps"] > 150
    assert jointed.work["steps"] < 2.0 * plain.work["steps"]


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_a_block_that_falls_on_a_slope_without_loss_keeps_its_energy(integrator):
    step = {"step": 0.0002} if integrator == "generalized_alpha" else {}
    motion = simulate_text(slope(friction=0.0, lift=0.05, end=0.5), integrator=integrator, **step)
    normal = np.array([np.sin(ANGLE), np.cos(ANGLE)])
    depth = np.maximum(0.1 - motion.q[:, :2] @ normal, 0.0)
    energy = 5.0 * (motion.v[:, :2] ** 2).sum(axis=1) + 98.0 * motion.q[:, 1] + K * depth**2
    assert depth.max() > 1e-3
    assert depth.min() == 0.0
    bound = 1e-8 if integrator == "runge_kutta" else 2e-2
    assert np.abs(energy - energy[0]).max() <= bound * (energy[0] - 98.0 * motion.q[:, 1].min())


HIT = """
format: 1
time: {{end: 0.4}}
bodies:
  a: {{mass: 2, inertia: 0.3, position: [0, 0], velocity: [3, 0.5], angular_velocity: 2}}
  b: {{mass: 3, inertia: 0.5, position: [1.05, 0.1], velocity: [-1, 0], angular_velocity: -1, angle: 0.2}}
points: {{nose: {{body: a, grid: {{list: [[0.5, -0.1], [0.5, 0.1]]}}}}}}
contacts:
  - {{points: nose, on: {{body: b, frame: body, from: [-0.5, -0.6], to: [-0.5, 0.6]}}, stiffness: 40000,
     damping: {damping}, friction: {friction}, slip: 0.02}}
solver: {{tolerance: 1.0e-10}}
"""


@pytest.mark.parametrize(("damping", "friction"), [(0, 0), (60, 0.4)])
def test_a_collision_keeps_momentum_and_never_gains_energy(damping, friction):
    motion = simulate_text(HIT.format(damping=damping, friction=friction))
    mass, inertia = np.array([2.0, 3.0]), np.array([0.3, 0.5])
    q, v = motion.q.reshape(-1, 2, 3), motion.v.reshape(-1, 2, 3)
    linear = np.einsum("b,tbi->ti", mass, v[:, :, :2])
    spin = (mass * (q[:, :, 0] * v[:, :, 1] - q[:, :, 1] * v[:, :, 0]) + inertia * v[:, :, 2]).sum(axis=1)
    energy = 0.5 * (mass * (v[:, :, :2] ** 2).sum(axis=2) + inertia * v[:, :, 2] ** 2).sum(axis=1)
    assert np.abs(v[-1] - v[0]).max() > 0.5
    assert np.abs(linear - linear[0]).max() <= 1e-12 * np.abs(linear).max()
    assert np.abs(spin - spin[0]).max() <= 1e-12 * np.abs(spin).max()
    if friction == 0:
        assert energy[-1] == pytest.approx(energy[0], rel=1e-8)
    else:
        assert energy[-1] < 0.95 * energy[0]


def test_a_point_that_slides_over_the_end_of_its_edge_falls():
    text = slope(friction=0.1, speed=2.0, length=0.5).replace("[[-0.2, -0.1], [0.2, -0.1]]", "[[0.2, -0.1]]")
    motion = simulate_text(text.replace("velocity: 0}", "velocity: 0}"))
    assert motion.status.ok
    passed = along(motion, motion.t)[0] > 0.3
    assert np.abs(motion.a[passed][1:, 1] + G).max() <= 1e-9
    assert np.abs(motion.a[~passed][:, 1] + G).max() > 1.0


def test_a_point_that_passes_beside_an_edge_is_not_caught_from_behind():
    text = """
format: 1
time: {end: 1}
bodies: {ball: {mass: 1, inertia: 1, position: [-1, -0.2], velocity: [2, 0]}}
points: {centre: {body: ball, frame: body, grid: {list: [[0, 0]]}}}
contacts: [{points: centre, on: {body: ground, from: [-0.5, 0], to: [0.5, 0]}, stiffness: 1000, damping: 1}]
"""
    beside = simulate_text(text)
    assert beside.v[-1, :2] == pytest.approx([2.0, 0.0])
    # through the edge from its free side it is caught
    above = simulate_text(
        text.replace("position: [-1, -0.2], velocity: [2, 0]", "position: [0, 0.2], velocity: [0, -2]")
    )
    assert above.v[-1, 1] > 1.5


def test_a_bounce_within_one_step_is_not_missed():
    text = """
format: 1
time: {end: 10}
bodies: {ball: {mass: 1, inertia: 1, position: [0, 1], velocity: [0.3, -2]}}
points: {centre: {body: ball, frame: body, grid: {list: [[0, 0]]}}}
contacts: [{points: centre, on: {body: ground, from: [-9, 0], to: [9, 0]}, stiffness: 1.0e+5}]
"""
    motion = simulate_text(text)
    assert motion.v[-1, :2] == pytest.approx([0.3, 2.0], abs=1e-7)


def test_with_settling_a_block_begins_at_its_depth():
    text = slope(friction=0.3, lift=0.01).replace("tolerance: 1.0e-11", "tolerance: 1.0e-9, settle: true")
    text = text.replace("angle: {velocity: 0}", "angle: {velocity: 0}, x: {velocity: 0}")
    motion = simulate_text(text)
    assert motion.status.ok
    # held in x: what it weighs is carried by the vertical part of the normal force
    depth = 0.1 - motion.q[0, :2] @ np.array([np.sin(ANGLE), np.cos(ANGLE)])
    assert 2.0 * K * depth * np.cos(ANGLE) == pytest.approx(98.0, rel=1e-9)


# --- gradients


@compiled
def _add(ints, floats, member_state, q, v, tangent, f, k, c):
    model = unpack_general(ints, floats)
    rel = np.empty((model.pair.shape[0], pose_size(model)))
    relative_pose(model, q, v, rel)
    add_contacts(model, member_state, rel, q, v, tangent, f, k, c)


def test_tangents_are_the_slopes_of_the_forces():
    scene = Evaluator(read_case(HIT.format(damping=60, friction=0.4))).scenes["default"]
    ints, floats = pack_general(scene.model)
    member_state = np.zeros((3, 3))
    member_state[1, :2] = CLOSED
    rng = np.random.default_rng(3)
    q, v = scene.model.q0 + 0.05 * rng.normal(size=9), 0.02 * rng.normal(size=9)
    q[:3], v[6:] = [0.2, 0.05, 0.1], 0.0  # both points are inside

    def at(q, v, tangent=False):
        f, k, c = np.zeros(9), np.zeros((1, 6, 6)), np.zeros((1, 6, 6))
        _add(ints, floats, member_state, q, v, tangent, f, k, c)
        return f, k[0], c[0]

    _, stiffness, damping = at(q, v, True)
    places = [3 * int(body) + i for body in scene.model.pair[0] for i in range(3)]
    h = 1e-6
    for column, d in enumerate(places):
        e = np.zeros(9)
        e[d] = h
        by_q = -(at(q + e, v)[0] - at(q - e, v)[0])[places] / (2.0 * h)
        by_v = -(at(q, v + e)[0] - at(q, v - e)[0])[places] / (2.0 * h)
        assert stiffness[:, column] == pytest.approx(by_q, rel=1e-6, abs=1e-6 * np.abs(stiffness).max())
        assert damping[:, column] == pytest.approx(by_v, rel=1e-6, abs=1e-6 * np.abs(damping).max())


def test_the_adjoint_is_the_derivative_of_what_is_computed():
    check_adjoint(load("crate", tolerance=1e-11), 3e-6, 1e-6)


@pytest.mark.parametrize("solver", [{"tolerance": 1e-10}, {"integrator": "generalized_alpha", "step": 0.001}])
def test_direct_and_adjoint_agree(solver):
    check_direct(load("crate", **solver))


def test_generalized_alpha_comes_to_the_same_motion():
    exact = mdstopo.evaluate(load("crate", tolerance=1e-11), design_of(load("crate")), gradient=False).objectives
    errors = []
    for step in (0.001, 0.00025):
        case = load("crate", integrator="generalized_alpha", step=step)
        found = mdstopo.evaluate(case, design_of(case), gradient=False).objectives
        errors.append(max(abs(found[name] - value) / abs(value) for name, value in exact.items()))
    assert errors[0] < 0.05
    assert errors[1] < errors[0] / 3.0


def test_a_damped_touch_that_only_just_happens_is_told():
    text = """
format: 1
time: {{end: 2}}
bodies: {{ball: {{mass: 1, inertia: 1, position: [0, 1], velocity: [0, -1]}}}}
motions: [{{body: ball, x: {{velocity: 0}}, angle: {{velocity: 0}}}}]
points: {{centre: {{body: ball, frame: body, grid: {{list: [[0, 0]]}}}}}}
contacts: [{{points: centre, on: {{body: ground, from: [-1, {y}], to: [1, {y}]}}, stiffness: 400, damping: 5}}]
members:
  spring: {{from: {{body: ground, at: [0, 3]}}, to: {{body: ball, at: [0, 1]}}, law: {{type: spring, stiffness: 25}}}}
design: {{initial: 1}}
objectives: {{V: {{response: {{velocity: {{body: ball}}}}, over_time: final}}}}
solver: {{tolerance: 1.0e-10}}
"""
    just = mdstopo.evaluate(read_case(text.format(y=0.8 + 1e-12)), np.ones(1))
    assert just.status is Status.GRAZING
    assert "point 0 of contact 0, of ball on ground" in just.message
    assert mdstopo.evaluate(read_case(text.format(y=0.82)), np.ones(1)).status.ok


# --- mistakes


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("body: b, frame: body", "body: a, frame: body", r"contacts\[0\]\.on: the points are on 'a' as well"),
        ("to: [-0.5, 0.6]", "to: [-0.5, -0.6]", r"contacts\[0\]\.on: both ends of the edge coincide"),
        ("points: nose", "points: noes", "no point grid is called 'noes', did you mean 'nose'"),
        ("stiffness: 40000", "stiffness: 0", r"contacts\[0\]\.stiffness"),
        ("slip: 0.02", "slip: 0", r"contacts\[0\]\.slip"),
        ("friction: 0.4", "friction: -1", r"contacts\[0\]\.friction"),
        ("friction: 0.4", "grip: 1", r"contacts\[0\]\.grip"),
    ],
)
def test_mistakes_are_refused_at_their_place(old, new, message):
    text = HIT.format(damping=60, friction=0.4)
    assert old in text
    with pytest.raises(CaseError, match=message):
        read_case(text.replace(old, new, 1))


def test_two_contacts_of_one_name_are_a_mistake():
    text = HIT.format(damping=60, friction=0.4).replace("- {points", "- {name: c, points")
    row = text[text.index("  - {name") : text.index("solver")]
    with pytest.raises(CaseError, match=r"contacts\[1\]\.name: the name 'c' is given to contacts\[0\] already"):
        read_case(text.replace(row, row + row))


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("damping", [0.0, 40.0])
def test_the_margin_of_a_contact_is_the_least_of_margins_without_kinks(damping):
    rng = np.random.default_rng(2)
    row = np.array([900.0, damping, 0.3, 0.1, *np.zeros(8)])
    for mode in (ABOVE, BESIDE, CLOSED, CLIPPED):
        for _ in range(20):
            here, there = rng.uniform(-1.0, 1.0, (2, 3))
            places = range(contact.contact_margins(row, mode))
            one, two = ([contact.contact_one_margin(row, i, *at, mode) for i in places] for at in (here, there))
            least = min(one)
            assert least[0] == pytest.approx(contact.contact_margin(row, *here, mode), abs=1e-15)
            assert least[1:] == pytest.approx(contact.contact_margin_slopes(row, *here, mode), abs=1e-15)
            for before, after in zip(one, two, strict=True):
                assert after[0] - before[0] == pytest.approx(before[1:] @ (there - here), abs=1e-14)
