"""Rows of the joints and what follows from them, against their definition written a second time, in complex numbers.

Slopes of the definition are complex steps (exact to rounding); second and third ones are sixth-order differences of
those, so no kernel is tested against a kernel except where two of them must agree.
"""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.model import JOINTS, DistanceJoint, FixedJoint, PrismaticJoint, RevoluteJoint
from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.joints import joint_table
from mdstopo.mechanics.joints.joint_table import CODES, WIDTH, describe, kernels_of, parameters
from mdstopo.mechanics.joints.revolute import PLACES, place_joint
from mdstopo.scene.springs_model import HOME
from tests.compiled import compiled
from tests.tiers import examples

#: how many rows each has
ROWS = {"revolute": 2, "prismatic": 2, "fixed": 3, "distance": 1}
RECORDS = {cls.type: cls for cls in (RevoluteJoint, PrismaticJoint, FixedJoint, DistanceJoint)}
KINDS = tuple(RECORDS)
UNTOUCHED = -77.0
FORCE, MOMENT = 0, 1

every_kind = pytest.mark.parametrize("kind", KINDS)
seeds = st.integers(0, 2**32 - 1)
many = settings(max_examples=examples(5, 25), deadline=None, derandomize=True)


@kernel
def turned(w, par):
    """The places of two bodies that are at w (6,); behind the parameters par there is where they are at home."""
    home = par[WIDTH:].reshape((2, HOME))
    q = np.empty(6)
    for i in range(6):
        q[i] = w[i] - home[i // 3, i % 3]
    places = np.empty(PLACES)
    place_joint(home, 0, 1, q, places)
    return places


# Kernels have no Python wrapper: these are their callers.
@compiled
def _rows(code, par, w, phi, jac):
    joint_table.joint_rows(code, par, turned(w, par), phi, jac)


@compiled
def _gamma(code, par, w, wd, gamma):
    joint_table.joint_gamma(code, par, turned(w, par), wd, gamma)


@compiled
def _velocity_slope(code, par, w, wd, out):
    joint_table.joint_velocity_slope(code, par, turned(w, par), wd, out)


@compiled
def _acceleration_slopes(code, par, w, wd, wdd, by_q, by_v):
    joint_table.joint_acceleration_slopes(code, par, turned(w, par), wd, wdd, by_q, by_v)


@compiled
def _stiffness(code, par, w, lam, k):
    joint_table.joint_stiffness(code, par, turned(w, par), lam, k)


@compiled
def _reaction(code, rows, par, w, lam, out):
    joint_table.joint_reaction(code, rows, par, turned(w, par), lam, out)


@compiled
def _transmitted(code, par, w, lam, which, by_lam, by_q):
    return joint_table.joint_transmitted(code, par, turned(w, par), lam, which, by_lam, by_q)


@dataclasses.dataclass(frozen=True)
class Setting:
    """A joint with its parameter row, and a state of its two bodies; lam is zero beyond the joint's rows."""

    kind: str
    joint: RevoluteJoint | PrismaticJoint | FixedJoint | DistanceJoint
    angles: tuple[float, float]
    par: np.ndarray
    w: np.ndarray
    wd: np.ndarray
    wdd: np.ndarray
    lam: np.ndarray

    @property
    def code(self):
        return CODES[self.kind]

    @property
    def rows(self):
        return ROWS[self.kind]

    @property
    def head(self):
        """Where the joint's point on its first body is."""
        return self.w[:2] + turn(self.w[2]) @ np.array(self.joint.at_first)

    def at(self, w):
        return dataclasses.replace(self, w=np.ascontiguousarray(w))


def joint_of(kind, at_first, at_second, axis=(1.0, 0.0), length=1.0, name="hip", index=0):
    own = {"prismatic": {"axis": tuple(axis)}, "distance": {"length": length}}.get(kind, {})
    return RECORDS[kind](
        name=name, index=index, bodies=("torso", "ground"), at_first=tuple(at_first), at_second=tuple(at_second), **own
    )


def with_home(joint, angle_first=0.0, angle_second=0.0, places=((0.0, 0.0), (0.0, 0.0))):
    """The parameters of a joint between two bodies at home, and behind them this home."""
    angles = (angle_first, angle_second)
    home = np.array(
        [(*place, angle, np.cos(angle), np.sin(angle)) for place, angle in zip(places, angles, strict=True)]
    )
    return np.array([*parameters(joint, home, 0, 1), *home.ravel()])


def setting(kind, seed):
    """A generic one: points off the centres of mass, joints that do not fit, a link that is not short."""
    rng = np.random.default_rng(seed)
    axis = rng.uniform(-np.pi, np.pi)
    arms = rng.uniform(-1.0, 1.0, (2, 2))
    joint = joint_of(kind, arms[0], arms[1], (np.cos(axis), np.sin(axis)), rng.uniform(0.2, 3.0))
    angles = tuple(rng.uniform(-3.0, 3.0, 2))
    w = rng.uniform(-2.0, 2.0, 6)
    w[2::3] *= 2.0
    # the points are put apart, so that the link has a direction whose derivatives stay moderate
    gap, way = rng.uniform(0.6, 3.0), rng.uniform(-np.pi, np.pi)
    apart = gap * np.array([np.cos(way), np.sin(way)])
    w[3:5] = w[:2] + turn(w[2]) @ arms[0] + apart - turn(w[5]) @ arms[1]
    lam = np.zeros(3)
    lam[: ROWS[kind]] = rng.uniform(-5.0, 5.0, ROWS[kind])
    par = with_home(joint, *angles, rng.normal(size=(2, 2)))
    return Setting(kind, joint, angles, par, w, rng.uniform(-3.0, 3.0, 6), rng.uniform(-5.0, 5.0, 6), lam)


def assembled(s):
    """The same with the second body moved so that the joint fits."""
    w = s.w.copy()
    if s.kind != "distance":
        w[5] = w[2] + (s.angles[1] - s.angles[0] if s.kind != "revolute" else w[5])
    apart = np.zeros(2)
    if s.kind == "prismatic":
        apart = turn(w[2]) @ np.array(s.joint.axis) * 0.7
    if s.kind == "distance":
        apart = s.joint.length * np.array([np.cos(w[5]), np.sin(w[5])])
    w[3:5] = w[:2] + turn(w[2]) @ np.array(s.joint.at_first) + apart - turn(w[5]) @ np.array(s.joint.at_second)
    return s.at(w)


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def definition(s, w):
    """Phi from the record alone, for real or complex w."""
    d = w[3:5] + turn(w[5]) @ np.array(s.joint.at_second) - w[:2] - turn(w[2]) @ np.array(s.joint.at_first)
    angle = w[5] - w[2] - (s.angles[1] - s.angles[0])
    if s.kind == "revolute":
        return d
    if s.kind == "fixed":
        return np.array([d[0], d[1], angle])
    if s.kind == "prismatic":
        normal = np.array([-s.joint.axis[1], s.joint.axis[0]])
        return np.array([normal @ (turn(-w[2]) @ d), angle])
    return np.array([np.sqrt(d[0] ** 2 + d[1] ** 2) - s.joint.length])


def slopes(s, w):
    """dPhi/dw (rows, 6) by complex steps."""
    return np.stack([definition(s, w + 1e-30j * unit).imag / 1e-30 for unit in np.eye(6)], axis=1)


def differences(function, x, h=1e-3):
    """d function/dx by sixth-order central differences, the derivative's index last."""
    columns = []
    for unit in np.eye(len(x)):
        step = h * unit
        pairs = [function(x + n * step) - function(x - n * step) for n in (1, 2, 3)]
        columns.append((0.75 * pairs[0] - 0.15 * pairs[1] + pairs[2] / 60.0) / h)
    return np.stack(columns, axis=-1)


def jac_rate(s, w, wd):
    """d(dPhi/dw)/dt (rows, 6) where w moves with wd."""
    return differences(lambda t: slopes(s, w + t[0] * wd), np.zeros(1))[..., 0]


def rows_of(s):
    phi, jac = np.full(3, UNTOUCHED), np.full((3, 6), UNTOUCHED)
    _rows(s.code, s.par, s.w, phi, jac)
    return phi, jac


def gamma_of(s):
    gamma = np.full(3, UNTOUCHED)
    _gamma(s.code, s.par, s.w, s.wd, gamma)
    return gamma


def velocity_slope_of(s):
    out = np.full((3, 6), UNTOUCHED)
    _velocity_slope(s.code, s.par, s.w, s.wd, out)
    return out


def acceleration_slopes_of(s):
    by_q, by_v = np.full((3, 6), UNTOUCHED), np.full((3, 6), UNTOUCHED)
    _acceleration_slopes(s.code, s.par, s.w, s.wd, s.wdd, by_q, by_v)
    return by_q, by_v


def stiffness_of(s, before=0.0):
    k = np.full((6, 6), before)
    _stiffness(s.code, s.par, s.w, s.lam, k)
    return k


def reaction_of(s):
    out = np.full(3, UNTOUCHED)
    _reaction(s.code, s.rows, s.par, s.w, s.lam, out)
    return out


def transmitted_of(s, which):
    by_lam, by_q = np.full(3, UNTOUCHED), np.full(6, UNTOUCHED)
    return _transmitted(s.code, s.par, s.w, s.lam, which, by_lam, by_q), by_lam, by_q


def close(found, expected, tolerance=1e-8):
    scale = 1.0 + np.abs(expected).max(initial=0.0)
    return np.abs(np.asarray(found) - expected).max(initial=0.0) <= tolerance * scale


def across(lever, force):
    return lever[0] * force[1] - lever[1] * force[0]


# Rows and their derivatives.
@every_kind
@many
@given(seeds)
def test_rows_and_slopes_are_those_of_the_definition(kind, seed):
    s = setting(kind, seed)
    phi, jac = rows_of(s)
    assert close(phi[: s.rows], definition(s, s.w), 1e-13)
    assert close(jac[: s.rows], slopes(s, s.w), 1e-13)


@every_kind
@many
@given(seeds)
def test_gamma_is_what_the_second_time_derivative_has_beside_the_accelerations(kind, seed):
    s = setting(kind, seed)
    assert close(gamma_of(s)[: s.rows], jac_rate(s, s.w, s.wd) @ s.wd)


@every_kind
@many
@given(seeds)
def test_velocity_slope_is_that_of_the_velocity_rows(kind, seed):
    s = setting(kind, seed)
    expected = differences(lambda w: slopes(s, w) @ s.wd, s.w)
    assert close(velocity_slope_of(s)[: s.rows], expected)
    # mixed second derivatives do not mind their order: the slope is the rate of the rows' own slopes
    assert close(velocity_slope_of(s)[: s.rows], jac_rate(s, s.w, s.wd))


@every_kind
@many
@given(seeds)
def test_acceleration_slopes_are_those_of_the_acceleration_rows(kind, seed):
    s = setting(kind, seed)

    def acceleration_rows(w):
        return slopes(s, w) @ s.wdd + jac_rate(s, w, s.wd) @ s.wd

    by_q, by_v = acceleration_slopes_of(s)
    # two differences, one inside the other, leave about 1e-9 of rounding
    assert close(by_q[: s.rows], differences(acceleration_rows, s.w, 4e-3))
    assert close(by_v[: s.rows], differences(lambda wd: jac_rate(s, s.w, wd) @ wd, s.wd, 0.1))


@every_kind
@many
@given(seeds)
def test_acceleration_slopes_follow_the_kernels_own_rows_and_gamma(kind, seed):
    s = setting(kind, seed)

    def by_position(w):
        moved = s.at(w)
        return rows_of(moved)[1][: s.rows] @ s.wdd + gamma_of(moved)[: s.rows]

    def by_velocity(wd):
        return gamma_of(dataclasses.replace(s, wd=wd))[: s.rows]

    by_q, by_v = acceleration_slopes_of(s)
    assert close(by_q[: s.rows], differences(by_position, s.w), 1e-9)
    assert close(by_v[: s.rows], differences(by_velocity, s.wd, 0.1), 1e-11)


@every_kind
@many
@given(seeds)
def test_stiffness_is_the_slope_of_the_constraint_forces(kind, seed):
    s = setting(kind, seed)
    k = stiffness_of(s)
    assert close(k, differences(lambda w: slopes(s, w).T @ s.lam[: s.rows], s.w))
    assert close(k, k.T, 1e-14)
    assert close(stiffness_of(s, before=2.5), k + 2.5, 1e-14), "it must be added to what is there"


@every_kind
def test_rows_that_a_joint_has_not_stay_as_they_are(kind):
    s = setting(kind, 3)
    phi, jac = rows_of(s)
    by_q, by_v = acceleration_slopes_of(s)
    for array in (phi, jac, gamma_of(s), velocity_slope_of(s), by_q, by_v):
        assert (array[s.rows :] == UNTOUCHED).all()
        assert (array[: s.rows] != UNTOUCHED).all()


# Closed forms.
def test_a_pendulum_has_its_centripetal_acceleration():
    # the second body hangs from the origin of ground by an arm l along its own y axis and turns at omega
    arm, omega = 0.7, 3.0
    par = with_home(joint_of("revolute", (0.0, 0.0), (0.0, arm)))
    w = np.array([0.0, 0.0, 0.0, 0.0, -arm, 0.0])
    wd = np.array([0.0, 0.0, 0.0, omega * arm, 0.0, omega])
    phi, jac, gamma = np.zeros(3), np.zeros((3, 6)), np.zeros(3)
    _rows(CODES["revolute"], par, w, phi, jac)
    _gamma(CODES["revolute"], par, w, wd, gamma)
    assert close(phi[:2], np.zeros(2), 1e-15)
    assert close(jac[:2] @ wd, np.zeros(2), 1e-15)
    # the centre of mass is accelerated towards the pivot by omega^2 l
    upward = np.array([0.0, 0.0, 0.0, 0.0, omega**2 * arm, 0.0])
    assert close(jac[:2] @ upward + gamma[:2], np.zeros(2), 1e-14)


def test_a_slider_on_a_turning_guide_has_its_coriolis_acceleration():
    # the guide turns at omega about the origin, the slider is at radius r on it and moves outward at u
    radius, omega, u = 0.4, 2.0, 1.5
    par = with_home(joint_of("prismatic", (0.0, 0.0), (0.0, 0.0)))
    w = np.array([0.0, 0.0, 0.0, radius, 0.0, 0.0])
    wd = np.array([0.0, 0.0, omega, u, omega * radius, omega])
    phi, jac, gamma = np.zeros(3), np.zeros((3, 6)), np.zeros(3)
    _rows(CODES["prismatic"], par, w, phi, jac)
    _gamma(CODES["prismatic"], par, w, wd, gamma)
    assert close(jac[:2] @ wd, np.zeros(2), 1e-15)
    accelerated = np.array([0.0, 0.0, 0.0, -(omega**2) * radius, 2.0 * omega * u, 0.0])
    assert close(jac[:2] @ accelerated + gamma[:2], np.zeros(2), 1e-14)


def test_a_turning_link_has_its_centripetal_acceleration():
    length, speed = 2.0, 3.0
    par = with_home(joint_of("distance", (0.0, 0.0), (0.0, 0.0), length=length))
    wd = np.array([0.0, 0.0, 0.0, 0.0, speed, 0.0])
    gamma = np.zeros(3)
    _gamma(CODES["distance"], par, np.array([0.0, 0.0, 0.0, length, 0.0, 0.0]), wd, gamma)
    assert gamma[0] == pytest.approx(speed**2 / length, rel=1e-15)


@many
@given(seeds, st.floats(-5.0, 5.0))
def test_a_slider_may_slide(seed, way):
    s = assembled(setting("prismatic", seed))
    along = np.zeros(6)
    along[3:5] = turn(s.w[2]) @ np.array(s.joint.axis)
    phi, jac = rows_of(s.at(s.w + way * along))
    assert close(phi[:2], np.zeros(2), 1e-14)
    assert close(jac[:2] @ along, np.zeros(2), 1e-15)


@every_kind
@many
@given(seeds)
def test_a_joint_that_fits_has_no_misfit(kind, seed):
    s = assembled(setting(kind, seed))
    assert close(rows_of(s)[0][: s.rows], np.zeros(s.rows), 1e-13)


# Invariance under rigid motion.
@every_kind
@many
@given(seeds, st.floats(-4.0, 4.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_one_rigid_motion_of_both_bodies_turns_global_rows_and_leaves_the_others(kind, seed, angle, x, y):
    s = setting(kind, seed)
    moved = s.w.copy()
    for b in (0, 3):
        moved[b : b + 2] = turn(angle) @ s.w[b : b + 2] + (x, y)
        moved[b + 2] += angle
    before, after = rows_of(s)[0][: s.rows], rows_of(s.at(moved))[0][: s.rows]
    expected = before.copy()
    if kind in ("revolute", "fixed"):
        expected[:2] = turn(angle) @ before[:2]
    assert close(after, expected, 1e-13)


# What a joint transmits.
@every_kind
@many
@given(seeds)
def test_reaction_is_the_constraint_force_on_the_first_body(kind, seed):
    s = setting(kind, seed)
    force = reaction_of(s)
    on_first = -slopes(s, s.w)[:, :3].T @ s.lam[: s.rows]
    assert close(force[:2], on_first[:2], 1e-13)
    assert close(force[2] + across(s.head - s.w[:2], force[:2]), on_first[2], 1e-13)


@every_kind
@many
@given(seeds)
def test_the_second_body_feels_the_opposite(kind, seed):
    s = assembled(setting(kind, seed))
    force = reaction_of(s)
    on_second = -slopes(s, s.w)[:, 3:].T @ s.lam[: s.rows]
    assert close(-force[:2], on_second[:2], 1e-12)
    assert close(-force[2] - across(s.head - s.w[3:5], force[:2]), on_second[2], 1e-12)


@many
@given(seeds)
def test_multipliers_are_the_reaction_where_the_conventions_say_so(seed):
    revolute, fixed, distance = (setting(kind, seed) for kind in ("revolute", "fixed", "distance"))
    assert close(reaction_of(revolute), [*revolute.lam[:2], 0.0], 1e-13)
    assert close(reaction_of(fixed), fixed.lam, 1e-13)
    s = distance
    d = s.w[3:5] + turn(s.w[5]) @ np.array(s.joint.at_second) - s.head
    # positive: a link in tension, which pulls the first body towards the second
    assert close(reaction_of(s), [*(s.lam[0] * d / np.hypot(*d)), 0.0], 1e-13)


@many
@given(seeds)
def test_a_slider_presses_along_the_normal_with_a_moment_that_knows_its_way(seed):
    s = assembled(setting("prismatic", seed))
    normal = turn(s.w[2]) @ np.array([-s.joint.axis[1], s.joint.axis[0]])
    # 0.7 along the axis (see `assembled`): the normal force on the first body acts at the slider
    assert close(reaction_of(s), [*(s.lam[0] * normal), s.lam[1] + 0.7 * s.lam[0]], 1e-13)


@every_kind
@many
@given(seeds)
def test_transmitted_force_and_moment_are_the_size_of_the_reaction(kind, seed):
    s = setting(kind, seed)
    force = reaction_of(s)
    assert transmitted_of(s, FORCE)[0] == pytest.approx(np.hypot(force[0], force[1]), rel=1e-13)
    assert transmitted_of(s, MOMENT)[0] == pytest.approx(abs(force[2]), rel=1e-12, abs=1e-13)


@every_kind
@pytest.mark.parametrize("which", [FORCE, MOMENT])
@many
@given(seeds)
def test_slopes_of_what_is_transmitted(kind, which, seed):
    s = setting(kind, seed)
    value, by_lam, by_q = transmitted_of(s, which)
    if 0.0 < value < 0.1:
        return  # the differences would step over the kink at zero
    h = 1e-3 * min(1.0, value) if value else 1e-3
    lam = differences(lambda x: transmitted_of(dataclasses.replace(s, lam=x), which)[0], s.lam, h)
    place = differences(lambda x: transmitted_of(s.at(x), which)[0], s.w, h)
    assert close(by_lam[: s.rows], lam[: s.rows])
    assert (by_lam[s.rows :] == 0.0).all()
    assert close(by_q, place)
    assert kind == "prismatic" or (by_q == 0.0).all(), "only a slider's moment depends on where it is"


@every_kind
@pytest.mark.parametrize("which", [FORCE, MOMENT])
def test_what_transmits_nothing_has_no_slope(kind, which):
    s = dataclasses.replace(setting(kind, 5), lam=np.zeros(3))
    value, by_lam, by_q = transmitted_of(s, which)
    assert value == 0.0
    assert (by_lam == 0.0).all()
    assert (by_q == 0.0).all()


# Where a link has no direction.
@pytest.mark.parametrize("gap", [0.0, 1e-200, -1e-320])
def test_a_link_whose_points_meet_has_zero_rows_and_no_nan(gap):
    s = setting("distance", 9)
    joint = joint_of("distance", (0.0, 0.0), (0.0, 0.0), length=0.8)
    s = dataclasses.replace(s, joint=joint, par=with_home(joint))
    s = s.at([0.0, 0.0, 0.3, gap, gap, -0.4])
    phi, jac = rows_of(s)
    assert phi[0] == pytest.approx(-0.8, abs=1e-15)
    for array in (jac[0], gamma_of(s)[0], velocity_slope_of(s)[0], *(x[0] for x in acceleration_slopes_of(s))):
        assert np.all(array == 0.0)
    assert (stiffness_of(s) == 0.0).all()
    assert (reaction_of(s) == 0.0).all()


def test_a_very_short_link_still_has_its_direction():
    s = setting("distance", 9)
    joint = joint_of("distance", (0.0, 0.0), (0.0, 0.0), length=0.8)
    s = dataclasses.replace(s, joint=joint, par=with_home(joint))
    short = 1e-149
    _, jac = rows_of(s.at([0.0, 0.0, 0.0, 0.6 * short, 0.8 * short, 0.0]))
    assert close(jac[0], np.array([-0.6, -0.8, 0.0, 0.6, 0.8, 0.0]), 1e-12)


# From the case.
def test_codes_and_rows_know_every_joint_of_the_format():
    assert set(CODES) == set(JOINTS) == set(KINDS) == set(ROWS)
    assert len(set(CODES.values())) == len(CODES)
    assert {word: kernels_of(joint).rows for word, joint in JOINTS.items()} == ROWS


@every_kind
def test_a_parameter_row_holds_points_normal_length_and_misfit_at_home(kind):
    joint = joint_of(kind, (1.0, 2.0), (3.0, 4.0), (0.6, 0.8), 5.0)
    home = np.array([[0.0, 0.0, angle, np.cos(angle), np.sin(angle)] for angle in (0.25, 1.0)])
    row = parameters(joint, home, 0, 1)
    assert len(row) == WIDTH == 12
    assert all(type(value) is float for value in row)
    assert row[:4] == [1.0, 2.0, 3.0, 4.0]
    if kind == "prismatic":
        assert row[4:6] == [-0.8, 0.6]
    if kind == "distance":
        assert row[7] == 5.0
    apart = turn(1.0) @ [3.0, 4.0] - turn(0.25) @ [1.0, 2.0]
    misfits = {
        "revolute": [*apart],
        "fixed": [*apart],
        "prismatic": [turn(0.25) @ [-0.8, 0.6] @ apart],
        "distance": [apart @ apart - 25.0],
    }
    misfit = misfits.get(kind, [])  # of others only turns count, which have none at home
    assert row[8:] == pytest.approx([*misfit, *[0.0] * (4 - len(misfit))], rel=1e-14)


def test_joints_are_named_as_their_author_named_them():
    hip = joint_of("revolute", (0.0, 0.0), (0.0, 0.0))
    assert describe(hip) == "joint hip (revolute, between torso and ground)"
    unnamed = joint_of("distance", (0.0, 0.0), (0.0, 0.0), name="2", index=2)
    assert describe(unnamed) == "joint joints[2] (distance, between torso and ground)"
