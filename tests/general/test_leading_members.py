"""Integrals of the largest of several forces: who leads when, and who shares the derivative."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from mdstopo import evaluate
from mdstopo.case.reader import read_case

#: a driven body whose three forces are 3 - t, 3 + t and, far from the third one's ground, nearly 3
BRIEF = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
motions: [{body: a, x: {velocity: 1}, y: {velocity: 0}, angle: {velocity: 0}}]
points:
  anchors: {body: ground, grid: {list: [[10, 0], [0, -100], [-10, 0]]}}
  pads: {body: a, grid: {list: [[0, 0], [0, 0], [0, 0]]}}
members:
  g: {from: anchors, to: pads, connect: pairs, law: {type: spring, stiffness: 1, preload: 3}}
design: {initial: 1}
objectives:
  MEAN: {response: {member_force: {group: g}}, over_time: mean}
  RMS: {response: {member_force: {group: g}}, over_time: rms}
  SUM: {response: {member_force: {group: g}}, over_time: integral}
combine: {weights: {MEAN: 1, RMS: 1, SUM: 1}}
solver: {tolerance: 1e-10}
"""

FORCES = (lambda t: 3.0 - t, lambda t: 3.0 + np.sqrt(1e4 + t * t) - 100.0, lambda t: 3.0 + t)


def pieces(alpha):
    """(low, high, who) of the largest of alpha_i FORCES[i] over [0, 2], by roots of their differences."""
    force = [lambda t, a=a, f=f: a * f(t) for a, f in zip(alpha, FORCES, strict=True)]
    cuts = [0.0, 2.0]
    for i in range(3):
        for k in range(i):
            d = lambda t, i=i, k=k: force[i](t) - force[k](t)  # noqa: E731
            cuts += [brentq(d, 0.0, 2.0, xtol=1e-15)] if d(0.0) * d(2.0) < 0.0 else []
    for low, high in pairwise(sorted(cuts)):
        yield low, high, int(np.argmax([f(0.5 * (low + high)) for f in force]))


@pytest.mark.parametrize("above", [-1e-3, 1e-6, 1e-4, 1e-2, 0.2])
def test_a_member_that_leads_for_however_short_a_time_is_not_missed(above):
    """The first force falls, the last one rises; between them the second one leads for a time as long as `above`."""
    alpha = np.array([1.0, 0.0, 0.5])
    alpha[1] = (2.0 + above) / FORCES[1](1.0)
    found = evaluate(read_case(BRIEF), alpha)
    once, twice = np.zeros(3), np.zeros(3)
    for low, high, who in pieces(alpha):
        once[who] += quad(FORCES[who], low, high, epsabs=1e-14)[0]
        twice[who] += quad(lambda t, who=who: FORCES[who](t) ** 2, low, high, epsabs=1e-14)[0]
    assert (once[1] > 0.0) == (above > 0.0)
    rms = np.sqrt(0.5 * alpha**2 @ twice)
    assert found.objectives["SUM"] == pytest.approx(alpha @ once, rel=1e-9)
    assert found.objectives["RMS"] == pytest.approx(rms, rel=1e-9)
    assert found.gradients["SUM"] == pytest.approx(once, rel=1e-7, abs=1e-8)
    assert found.gradients["MEAN"] == pytest.approx(0.5 * once, rel=1e-7, abs=1e-8)
    assert found.gradients["RMS"] == pytest.approx(0.5 * alpha * twice / rms, rel=1e-7, abs=1e-8)


#: three members that pull with the same force, whatever the body does
TIED = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0], velocity: [0.1, 0]}}
motions: [{body: a, x: {velocity: 0.1}, y: {velocity: 0}, angle: {velocity: 0}}]
points:
  p: {body: ground, grid: {list: [[-3, 0], [0, 2], [2, -2]]}}
  q: {body: a, grid: {list: [[0, 0], [0.1, 0.3], [0.2, 0]]}}
members: {g: {from: p, to: q, connect: pairs, law: LAW}}
design: {initial: 0.6}
objectives:
  MEAN: {response: {member_force: {group: g}}, over_time: mean}
  RMS: {response: {member_force: {group: g}}, over_time: rms}
combine: {weights: {MEAN: 1, RMS: 1}}
"""


@pytest.mark.parametrize("method", ["adjoint", "direct"])
@pytest.mark.parametrize(
    "law",
    [
        "{type: table, table: [[0, 1], [0.5, 3], [1, -2]]}",
        "{type: pulse, peak: 2, rate: 9, time: 0.4}",
        "{type: actuator, proportional: 900, target: -1, limit: 0.5}",
    ],
)
def test_forces_that_are_the_same_share_the_derivative(law, method):
    """All of them scaled together scale the mean; each has its third of that."""
    found = evaluate(read_case(TIED.replace("LAW", law)), method=method)
    for name, value in found.objectives.items():
        assert found.gradients[name] == pytest.approx(np.full(3, value / 0.6 / 3), rel=1e-8), name


def test_only_those_share_that_are_the_largest():
    text = TIED.replace("LAW", "{type: table, table: [[0, 1], [1, 3]]}")
    found = evaluate(read_case(text), np.array([0.6, 0.5, 0.6]))
    assert found.gradients["MEAN"] == pytest.approx([1.0, 0.0, 1.0], rel=1e-9)


#: a driven body with many springs to the ground, whose forces are 3 and what the way to each anchor has become longer
MANY = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
motions: [{body: a, x: {velocity: 1}, y: {velocity: 0}, angle: {velocity: 0}}]
points:
  anchors: {body: ground, grid: {list: ANCHORS}}
  pads: {body: a, grid: {list: PADS}}
members:
  g: {from: anchors, to: pads, connect: pairs, law: {type: spring, stiffness: 1, preload: 3}}
design: {initial: 1}
objectives:
  MEAN: {response: {member_force: {group: g}}, over_time: mean}
  RMS: {response: {member_force: {group: g}}, over_time: rms}
combine: {weights: {MEAN: 1, RMS: 1}}
solver: {tolerance: 1e-9}
"""


def many(count, seed):
    """A case of that many members, and their forces (count, K) at times (K,) by alpha = 1."""
    rng = np.random.default_rng(seed)
    far = rng.uniform(0.5, 3.0, count) * np.where(rng.random(count) < 0.5, -1.0, 1.0)
    anchors = np.round(np.column_stack([far, rng.normal(size=count)]), 4)
    text = MANY.replace("ANCHORS", str(anchors.tolist())).replace("PADS", str([[0, 0]] * count))

    def forces(t):
        way = np.hypot(anchors[:, :1] - t, anchors[:, 1:])
        return way - np.hypot(anchors[:, :1], anchors[:, 1:]) + 3.0

    return read_case(text), forces


@pytest.mark.parametrize(("count", "spread"), [(15, 0.1), (60, 1e-3), (300, 1e-5)])
def test_however_many_members_come_near_the_largest_force_all_that_lead_are_found(count, spread):
    """A fine sum over the largest of the forces in closed form is the same, and so is each member's share of it."""
    case, forces = many(count, seed=count)
    # all are about the same after 1 s, where most of them change their place
    alpha = 3.0 / forces(np.ones(1))[:, 0] * (1.0 + spread * np.random.default_rng(1).uniform(-1.0, 1.0, count))
    found = evaluate(case, alpha)
    ends = np.linspace(0.0, 2.0, 20001)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    t = (0.5 * (ends[1:] + ends[:-1])[:, None] + 0.5 * np.diff(ends)[:, None] * nodes).ravel()
    w = np.tile(0.5 * weights, 20000) * 1e-4
    plain = forces(t)
    size = np.abs(alpha[:, None] * plain)
    who, most = size.argmax(axis=0), size.max(axis=0)
    share = np.bincount(who, w * np.abs(plain[who, np.arange(len(t))]), minlength=count) / 2.0
    assert len(np.unique(who)) > 2
    assert found.objectives["MEAN"] == pytest.approx(0.5 * w @ most, rel=2e-9)
    assert found.objectives["RMS"] == pytest.approx(np.sqrt(0.5 * w @ most**2), rel=2e-9)
    assert found.gradients["MEAN"] == pytest.approx(share, abs=1e-4)


#: fifteen springs of one slider, all of whose forces vanish at the same times
SLIDER = """
format: 1
time: {end: 3}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0]}}
joints: [{name: p, type: prismatic, bodies: [ground, a], at: [0, 0], axis: [1, 0]}]
points:
  p: {body: ground, grid: {list: P}}
  q: {body: a, grid: {list: Q}}
members: {g: {from: p, to: q, connect: pairs, law: {type: spring, stiffness: 9}}}
design: {initial: 0.5}
objectives: {F: {response: {member_force: {group: g}}, over_time: rms}}
"""


def test_all_pairs_of_members_are_searched_together(monkeypatch):
    """Each pair by itself took thousands of calls of a kernel from Python; here their number is that of iterations."""
    from mdstopo.general.over_time import leading_members

    places = np.random.default_rng(5).uniform(-1.0, 1.0, (15, 2)).round(3)
    case = read_case(SLIDER.replace("P", str((places + 2.0).tolist())).replace("Q", str(places.tolist())))
    calls, compare = [], leading_members.compare

    def counted(*arguments):
        calls.append(len(arguments[2]))
        return compare(*arguments)

    monkeypatch.setattr(leading_members, "compare", counted)
    evaluate(case, np.random.default_rng(0).uniform(0.2, 1.0, 15), gradient=False)
    assert 3 < len(calls) < 80
