"""The joints' own matrix: what it gives is the solution of the whole balance; where it is singular, it says so."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.general.dynamics.accelerations import NO_SHIFT, factor_matrix, joint_state, make_workspace, solve_unknowns
from mdstopo.general.dynamics.joint_matrix import decompose, substitute, weakest
from mdstopo.general.model.general_model import pack_general, unpack_general
from mdstopo.general.model.switches import OF_JOINTS, SWITCHES
from mdstopo.general.scene.compile_general import compile_general
from mdstopo.mechanics.kinematics.planar import turn_bodies
from tests.compiled import compiled
from tests.space.in_python import in_python  # noqa: F401

#: every kind of joint; two of them share both bodies, one body is driven in part and one in all
MECHANISM = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 2, inertia: 0.3, position: [0, 0]}
  b: {mass: 1, inertia: 0.1, position: [1, 0.2]}
  c: {mass: 30, inertia: 4, position: [2, -0.3]}
  d: {mass: 0.01, inertia: 0.002, position: [2.5, 0.5]}
  e: {mass: 1, inertia: 1, position: [3, 1]}
  f: {mass: 1, inertia: 1, position: [4, 1]}
joints:
  - {type: revolute, bodies: [ground, a], at: [-0.5, 0]}
  - {type: revolute, bodies: [a, b], at: [0.5, 0.1]}
  - {type: distance, bodies: [b, a], at: {a: [0.1, 0.4], b: [1.1, 0.5]}}
  - {type: prismatic, bodies: [b, c], at: [1.5, 0], axis: [1, 0.3]}
  - {type: fixed, bodies: [c, d], at: [2.2, 0.1]}
  - {type: distance, bodies: [d, e], at: {d: [2.5, 0.4], e: [3, 1]}}
  - {type: revolute, bodies: [e, f], at: [3.5, 1]}
motions:
  - {body: e, x: {velocity: 0.3}}
  - {body: f, x: {velocity: 0}, y: {velocity: 0}, angle: {velocity: 0}}
members:
  m: {from: {body: a, at: [0, 0.3]}, to: {body: c, at: [2, 0.3]}, law: LAW}
"""
PARALLELOGRAM = """
format: 1
time: {end: 1}
bodies:
  crank: {mass: 1, inertia: 0.1, position: [0, 0.5]}
  coupler: {mass: 1, inertia: 0.1, position: [1, 1]}
  rocker: {mass: 1, inertia: 0.1, position: [2, 0.5]}
joints:
  - {type: revolute, bodies: [ground, crank], at: [0, 0]}
  - {type: revolute, bodies: [crank, coupler], at: [0, 1]}
  - {type: revolute, bodies: [coupler, rocker], at: [2, 1]}
  - {type: revolute, bodies: [rocker, ground], at: [2, 0]}
"""


@compiled
def _solve(ints, floats, q, transposed, a, lam, jac, factors):
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    turn_bodies(model, q, workspace.turned)
    joint_state(model, q, np.zeros_like(q), workspace)
    w = workspace
    singular = factor_matrix(model, w, w.k, w.c, w.turn, w.mass, 0.0, 0.0, w.tangents[NO_SHIFT], transposed)
    jac[:] = workspace.jac
    factors[:] = workspace.switches
    if singular < 0:
        solve_unknowns(model, workspace, a, lam)
        solve_unknowns(model, workspace, a, lam)  # the factors stay
    return singular


def model_of(text):
    case = read_case(text)
    return compile_general(case, case.load_cases[0]).model


def solved(model, q, a, lam, transposed=False):
    """The place at which the balance is singular, Phi_q (n_row, n) and which factors were made; a, lam in place."""
    jac, factors = np.zeros((len(model.joint), 3, 6)), np.zeros(SWITCHES, np.int64)
    singular = _solve(*pack_general(model), q, transposed, a, lam, jac, factors)
    dense = np.zeros((len(lam), len(a)))
    for j, (_, one, two, *_) in enumerate(model.joint.tolist()):
        columns = [*range(3 * one, 3 * one + 3), *range(3 * two, 3 * two + 3)]
        for r, own in enumerate(model.row[j].tolist()):
            if own >= 0:
                dense[own, columns] += jac[j, r]
    dense[:, model.free == 0] = 0.0
    return singular, dense, factors


@pytest.mark.parametrize("law", ["{type: spring, stiffness: 1}", "{type: inerter, inertance: 1}"])
@pytest.mark.parametrize("transposed", [False, True])
def test_it_solves_the_whole_balance(law, transposed):
    """With an inerter the whole balance is factorised, as the mass is full then; here its part of it is left out."""
    model = model_of(MECHANISM.replace("LAW", law))
    rng = np.random.default_rng(5)
    n, n_row = len(model.mass), int(model.size[0])
    f, g = rng.normal(size=n), rng.normal(size=n_row)
    q = model.q0 + 0.1 * rng.normal(size=n)
    a, lam = f.copy(), g.copy()
    singular, jac, factors = solved(model, q, a, lam, transposed)
    assert singular == -1
    assert factors[OF_JOINTS] == ("spring" in law)
    whole = np.block([[np.diag(model.mass), jac.T], [jac, np.zeros((n_row, n_row))]])
    right = np.concatenate([f, g])
    for _ in range(2):
        right[:n][model.free == 0] = 0.0
        right = np.linalg.solve(whole, right)
    size = np.abs(right)
    assert a == pytest.approx(right[:n], abs=1e-11 * size[:n].max())
    assert lam == pytest.approx(right[n:], abs=1e-11 * size[n:].max())
    assert not a[model.free == 0].any()


@pytest.mark.parametrize(("angle", "regular"), [(0.0, False), (1e-7, False), (1e-4, True)])
def test_a_parallelogram_is_singular_where_it_lies_flat_and_a_joint_is_to_blame(angle, regular):
    model = model_of(PARALLELOGRAM)
    c, s = np.cos(angle), np.sin(angle)
    turn = angle - np.pi / 2
    q = np.array([0.5 * c, 0.5 * s, turn, 1 + c, s, 0, 2 + 0.5 * c, 0.5 * s, turn, 0, 0, 0])
    singular, _, _ = solved(model, q, np.ones(12), np.ones(8))
    assert (singular == -1) == regular
    if not regular:
        assert int(np.flatnonzero(model.unknown_index == singular)[0]) >= 12  # a row, no coordinate


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("least", "regular"), [(1e-9, True), (1e-13, False)])
def test_a_small_eigenvalue_is_found_whatever_row_it_belongs_to(seed, least, regular):
    """The last pivots stay above the bound, because the last rows have next to no part in it."""
    rng = np.random.default_rng(seed)
    n = 8
    part = np.append(rng.normal(size=n - 2), [1e-4, 1e-4])
    part /= np.linalg.norm(part)
    rest = np.linalg.qr(np.column_stack([part, rng.normal(size=(n, n - 1))]))[0]
    values = np.append(least, rng.uniform(0.5, 2.0, n - 1))
    dense = (rest * values) @ rest.T
    scale = rng.uniform(0.1, 10.0, n) / np.sqrt(np.diag(dense))
    dense *= np.outer(scale, scale)
    gram = np.concatenate([dense[i, : i + 1] for i in range(n)])
    envelope = np.array([[0, i * (i + 1) // 2] for i in range(n)])
    diagonal = np.zeros((2, n))
    found = decompose(envelope, gram, diagonal)
    if found < 0:
        found = weakest(envelope, gram, diagonal, np.zeros(len(gram)))
    assert (found < 0) == regular


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("seed", range(6))
def test_rows_that_begin_together_and_rows_alone_give_the_same_solution(seed):
    rng = np.random.default_rng(seed)
    first = np.minimum(np.repeat(rng.integers(0, 9, 5).cumsum() // 3, rng.integers(1, 4, 5)), 14)
    n = len(first)
    first = np.minimum(first, np.arange(n))
    lower = np.tril(rng.normal(size=(n, n))) * (np.arange(n) >= first[:, None]) + 3.0 * np.eye(n)
    dense = lower @ lower.T
    ends = np.cumsum(np.arange(n) - first + 1)
    envelope = np.stack([first, ends - np.arange(n) - 1], axis=1)
    gram = np.concatenate([dense[i, f : i + 1] for i, f in enumerate(first)])
    x = rng.normal(size=n)
    expected = np.linalg.solve(dense, x)
    diagonal = np.zeros((2, n))
    assert decompose(envelope, gram, diagonal) == -1
    substitute(envelope, gram, diagonal, x)
    assert x == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


def test_it_costs_a_closed_loop_what_its_length_costs():
    costs = []
    for count in (12, 48):
        turn = 2 * np.pi * np.arange(count + 1) / count
        x, y = np.cos(turn), np.sin(turn)
        bodies = "".join(
            f"  b{i}: {{mass: 1, inertia: 1, position: [{(x[i] + x[i + 1]) / 2}, {(y[i] + y[i + 1]) / 2}]}}\n"
            for i in range(count)
        )
        joints = "".join(
            f"  - {{type: revolute, bodies: [b{i - 1 if i else count - 1}, b{i}], at: [{x[i]}, {y[i]}]}}\n"
            for i in range(count)
        )
        joints += f"  - {{type: revolute, bodies: [ground, b0], at: [{x[0]}, {y[0]}]}}\n"
        model = model_of(f"format: 1\ntime: {{end: 1}}\nbodies:\n{bodies}joints:\n{joints}")
        first = model.skyline[:, 0].tolist()
        products = sum(j - max(first[i], first[j]) for i in range(len(first)) for j in range(first[i], i))
        costs.append((int(model.size[3]), products))
    for short, long in zip(*costs, strict=True):
        assert long <= 4.5 * short
    assert costs[0][0] <= 26 * 6


def skyline_of(runs):
    """`GeneralModel.skyline` of rows of which so many behind each other begin at one column, and how many entries."""
    rng, first = np.random.default_rng(len(runs)), []
    for run in runs:
        first += [int(rng.integers(0, len(first) + 1))] * run
    lengths = np.arange(len(first)) - first + 1
    ends = np.cumsum(lengths)
    return np.stack([first, ends - lengths - first], axis=1), int(ends[-1])


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("runs", [(1, 2, 3), (3, 3, 1, 3), (4, 1, 5, 2), (6, 2, 3)])
def test_rows_that_begin_at_one_column_are_factorised_together(runs):
    envelope, entries = skyline_of(runs)
    count, rng = len(envelope), np.random.default_rng(3)
    places = [(i, k) for i, (first, _) in enumerate(envelope) for k in range(first, i + 1)]
    lower, sizes = np.eye(count), rng.uniform(0.5, 2.0, count)
    for i, k in places:
        lower[i, k] = 1.0 if i == k else rng.normal() / count
    whole = lower @ np.diag(sizes) @ lower.T
    gram, diagonal = np.zeros(entries), np.zeros((2, count))
    for i, k in places:
        gram[envelope[i, 1] + k] = whole[i, k]
    kept = gram.copy()
    assert decompose(envelope, gram, diagonal) == -1
    assert diagonal == pytest.approx(np.stack([np.diag(whole), 1.0 / sizes]), rel=1e-12)
    for i, k in places:
        if i != k:
            assert gram[envelope[i, 1] + k] == pytest.approx(lower[i, k], abs=1e-12)
    x = rng.normal(size=count)
    expected = np.linalg.solve(whole, x)
    substitute(envelope, gram, diagonal, x)
    assert x == pytest.approx(expected, abs=1e-11)
    for i in range(count):  # the row at which the matrix is singular is told, whatever its place among those
        gram[:], at = kept, envelope[i, 1] + i
        gram[at] -= sizes[i]
        assert decompose(envelope, gram, diagonal) == i
