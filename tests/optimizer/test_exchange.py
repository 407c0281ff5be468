"""Exchanged ends: bundles keep where they begin on the one body, and end elsewhere on the other."""

import numpy as np
import pytest

from mdstopo.case.design.exchange import exchange_ends
from mdstopo.case.reader import read_case
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.start_families import Family, design_of_family, neighbour

HEAD = """
format: 1
time: {end: 0.1}
bodies: {unit: {mass: 2, inertia: 0.05, position: [0, 0]}}
points:
  inner: {body: unit, grid: {rectangle: {center: [0, 0], size: [0.2, 0.2], count: 4}}}
  outer: {body: ground, grid: {rectangle: {center: [0, 0], size: [1, 1], count: 8}}}
"""
TAIL = """
loads: [{body: unit, force: [60, 20], moment: 3}]
objectives: {work: {response: energy, over_time: max}}
"""


def members(connect: str, more: str = "") -> str:
    spring = "law: {type: spring, stiffness: 900}"
    return f"members: {{web: {{from: inner, to: outer, connect: {connect}, {spring}{more}}}}}\n"


def table(group, alpha):
    out = np.full((len(group.from_local), len(group.to_local)), np.nan)
    out[group.from_index, group.to_index] = alpha
    return out


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.mark.parametrize("side", ["from", "to"])
def test_whole_rows_or_columns_of_the_grid_take_each_other_s_places(side, rng):
    (group,) = read_case(HEAD + members("all") + TAIL).design_groups
    alpha = rng.uniform(size=len(group))
    before, after = (table(group, a) for a in (alpha, exchange_ends([group], alpha, side, rng)))
    if side == "to":
        before, after = before.T, after.T
    assert not np.array_equal(before, after)
    assert sorted(map(tuple, before)) == sorted(map(tuple, after))


def test_members_that_a_filter_left_out_are_no_hindrance(rng):
    (group,) = read_case(HEAD + members("all", ", max_length: 0.6") + TAIL).design_groups
    assert len(group) < 32
    alpha = rng.uniform(size=len(group))
    other = exchange_ends([group], alpha, "to", rng)
    assert np.isin(other, alpha).all()
    assert not np.array_equal(other, alpha)


def test_where_every_point_has_one_member_values_are_exchanged(rng):
    text = HEAD.replace("count: 8", "count: 4") + members("pairs") + TAIL
    (group,) = read_case(text).design_groups
    alpha = np.arange(4.0)
    assert sorted(exchange_ends([group], alpha, "to", rng)) == sorted(alpha)


def test_alphas_that_are_shared_stay_one_value(rng):
    case = read_case(HEAD + members("all") + TAIL + "design: {shared: [web]}\n")
    problem = make_engine(case).problem()
    x = problem.exchange_ends(np.full(len(problem.lower), 0.4), "to", rng)
    assert np.allclose(x, 0.4)


def test_a_case_without_members_of_its_own_starts_near_the_best_instead(rng):
    text = HEAD + members("all", ", design: false") + TAIL
    text += "design: {variables: {c: {group: web, parameter: stiffness, each: group, lower: 100, upper: 1000}}}\n"
    problem = make_engine(read_case(text)).problem()
    best = np.array([0.3])
    assert np.array_equal(problem.exchange_ends(best, "to", rng), best)
    assert np.array_equal(design_of_family(problem, 0, 3, Family.OTHER_TO, best), neighbour(problem, 0, 3, best))
