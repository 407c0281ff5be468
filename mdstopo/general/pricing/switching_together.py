"""Members that leave one mode for the same other one in a step, many at once.

Each is followed as `switching_prices.price_step` follows it: its elongation is the polynomial through the nodes, and
the force of each mode is integrated over the piece of the mode. Where the law is a polynomial and its margin linear,
all of that is a few sums and products, the same for all, and done in vectors.

A margin may be the lesser of two linear functions. The one by which the first member leaves is taken for all; members
that leave by the other one fail the check of their switch, and have to be followed one by one.
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import inverse_root, lanes, load, store, zero
from mdstopo.general.design.followed_member import GAUSS, LOCATED, NODE_ROWS
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.general_model import MEMBER_FREE_LENGTH
from mdstopo.general.model.priced_candidates import CODE, FIRST_NODE, MOVES, NODE, NODES, POWERS
from mdstopo.general.pricing.switching_prices import at_places, fill_law
from mdstopo.mechanics.kinematics.kinematics_interface import ALONG, ELONGATION, RATE, WORKS, member_works
from mdstopo.mechanics.laws.law_table import (
    law_degree,
    law_is_given,
    law_is_idle,
    law_is_timed,
    law_lacks_rate,
    law_makes_set,
    law_margin,
    law_margin_slopes,
    law_next,
    law_set,
)

#: members that are followed at once
TOGETHER = 64
#: of a member: the fraction of the step at which it switches, between which it is sought, by how much it was changed
#: last, and what the member does in the step
AT, LOWER, UPPER, LAST_CHANGE, SUM = range(5)
#: how often a switch is improved (Newton): the first guess is off by some thousandths, then by their squares
TIMES = 4
#: a margin at a switch that is found is no larger (m, m/s or a part)
GONE = 1e-10


class Switching:
    """Members that switch in the same step, TOGETHER at most, inside kernels.

    works (NODES, WORKS, TOGETHER): what they do at nodes. power (NODE_ROWS, NODES, TOGETHER), margin (NODES, TOGETHER):
    polynomials through these, and of the margin. law_power (4, 5): scratch of `fill_law`. found (5, TOGETHER): what is
    found of each. sets (2, TOGETHER): permanent sets (m) with which they begin the step, and end it.
    """

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Switching, ("works", "power", "margin", "law_power", "found", "sets"))


@kernel
def make_switching():
    """A `Switching`."""
    return Switching(
        np.zeros((NODES, WORKS, TOGETHER)),
        np.zeros((NODE_ROWS, NODES, TOGETHER)),
        np.zeros((NODES, TOGETHER)),
        np.zeros((4, 5)),
        np.zeros((5, TOGETHER)),
        np.zeros((2, TOGETHER)),
    )


@part
def is_quick(code, p, curves):
    """Whether members of a law may be followed together: in a mode it is a polynomial, and knows no time."""
    return law_degree(code) > 0 and not (law_is_timed(code, p, curves) or law_is_given(code) or law_lacks_rate(code))


@kernel
def price_switched(model, candidates, k, count, s, old, new, switching):
    """What members do in a step in which they leave one mode for another, and none for a third one.

    In:
      model: with the members, from the first place on.
      candidates, k: a `PricedCandidates`, and the number of the run, of a law that `is_quick`.
      count: how many there are, TOGETHER at most.
      s: the number of the step.
      old, new: the modes.
    In place:
      switching: a `Switching`: sets in row 0 are those with which members begin; of what is found SUM counts, NaN
        where a member has to be followed by itself; sets in row 1 are those with which they end.
    """
    works, power, margin = switching.works, switching.power, switching.margin
    found, sets = switching.found, switching.sets
    p = candidates.law[k]
    code = candidates.run[k, CODE]
    time = candidates.step_time[s]
    free = model.member[MEMBER_FREE_LENGTH]
    for m in range(NODES):
        o = candidates.step[s, FIRST_NODE] + m
        member_works(model, np.int64(0), count, candidates.node_pose[o], candidates.node_change[o], works[m])
        for i in range(0, count, lanes()):
            store(works[m, ELONGATION], i, load(works[m, ELONGATION], i) - load(sets[0], i))
    by_x, by_rate, rest = _linear_margin(code, p, model.curves, free[0], time, old, works)
    for i in range(0, count, lanes()):
        for a in range(NODES):
            for row in range(NODE_ROWS):
                value = zero()
                for m in range(NODES):
                    value += POWERS[a, m] * load(works[m, row], i)
                store(power[row, a], i, value)
            value = by_x * load(power[ELONGATION, a], i) + by_rate * load(power[RATE, a], i)
            store(margin[a], i, value + rest if a == 0 else value)
    _locate(count, by_x, by_rate, rest, works, margin, found)
    for i in range(0, count, lanes()):
        store(found[SUM], i, zero())
        store(sets[1], i, load(sets[0], i))
    for i in range(count):
        _check(code, p, model.curves, free[i], time, old, new, i, switching)
    if candidates.step[s, MOVES] != 0:
        _add_pieces(model, candidates, k, s, count, old, new, switching)


@part
def _check(code, p, curves, rest, time, old, new, i, switching):
    """Set the permanent set with which a member ends, and its SUM to NaN where its switch is not the one that is meant.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s).
    old, new, switching: as of `price_switched`.
    i: the member.
    """
    works, power, found, sets = switching.works, switching.power, switching.found, switching.sets
    c = found[AT, i]
    x = _of_member(power[ELONGATION], c, i)
    rate = _of_member(power[RATE], c, i)
    second = _slope_of_member(power[RATE], c, i) / time[1]
    t = time[0] + c * time[1]
    if (
        not abs(found[LAST_CHANGE, i]) <= LOCATED
        or not found[LOWER, i] - LOCATED <= c <= found[UPPER, i] + LOCATED
        or not abs(law_margin(code, p, x, rate, old, t, curves, rest)) <= GONE
        or law_next(code, p, x, rate, second, old, t, curves, rest) != new
    ):
        found[SUM, i] = np.nan
    if not law_makes_set(code, old, new):
        return
    growth = law_set(code, p, x, old, new)
    sets[1, i] += growth
    for m in range(1, NODES):
        x = works[m, ELONGATION, i] - growth
        t = time[0] + NODE[m] * time[1]
        if NODE[m] > c and law_margin(code, p, x, works[m, RATE, i], new, t, curves, rest) < 0.0:
            found[SUM, i] = np.nan


@part
def _linear_margin(code, p, curves, rest, time, mode, works):
    """The margin of a mode as a linear function: its slopes by elongation and rate, and the rest.

    Of two linear functions it is the one that is negative first for the first member; `_check` tells which members
    leave by the other one.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s).
    mode: the mode.
    works (NODES, WORKS, TOGETHER): what members do at the nodes.
    """
    m = np.int64(1)
    value = 0.0
    while m < NODES:
        t = time[0] + NODE[m] * time[1]
        value = law_margin(code, p, works[m, ELONGATION, 0], works[m, RATE, 0], mode, t, curves, rest)
        if value < 0.0 or m == NODES - 1:
            break
        m += 1
    x = works[m, ELONGATION, 0]
    rate = works[m, RATE, 0]
    by_x, by_rate = law_margin_slopes(code, p, x, rate, mode, time[0] + NODE[m] * time[1], curves, rest)
    return by_x, by_rate, value - by_x * x - by_rate * rate


@part
def _locate(count, by_x, by_rate, rest, works, margin, found):
    """Find where margins are zero.

    In:
      count: how many members there are.
      by_x, by_rate, rest: of `_linear_margin`.
      works (NODES, WORKS, TOGETHER): what they do at the nodes.
      margin (NODES, TOGETHER): coefficients of the margin in the step.
    Out:
      found (5, TOGETHER): AT, LOWER, UPPER and LAST_CHANGE are set.
    """
    for i in range(count):
        before = by_x * works[0, ELONGATION, i] + by_rate * works[0, RATE, i] + rest
        m = np.int64(1)
        value = before
        while m < NODES:
            value = by_x * works[m, ELONGATION, i] + by_rate * works[m, RATE, i] + rest
            if value < 0.0 or m == NODES - 1:
                break
            before = value
            m += 1
        found[LOWER, i] = NODE[m - 1]
        found[UPPER, i] = NODE[m]
        share = before / (before - value) if before >= 0.0 and value < 0.0 else 0.0
        found[AT, i] = NODE[m - 1] + share * (NODE[m] - NODE[m - 1])
    for i in range(0, count, lanes()):
        c = load(found[AT], i)
        change = zero()
        for _ in range(TIMES):
            u = c * 2.0 - 1.0
            value = load(margin[NODES - 1], i)
            slope = zero()
            for a in range(NODES - 2, -1, -1):
                slope = slope * u + value
                value = value * u + load(margin[a], i)
            inverse = inverse_root(slope * slope, np.finfo(np.float64).tiny)
            change = value * (slope * (inverse * inverse)) * 0.5
            c = c - change
        store(found[AT], i, c)
        store(found[LAST_CHANGE], i, change)


@part
def _add_pieces(model, candidates, k, s, count, old, new, switching):
    """Add the integrals over the pieces before the switches, and behind them, to SUM.

    model, candidates, k, s, count, old, new, switching: as of `price_switched`.
    """
    works, power, law_power = switching.works, switching.power, switching.law_power
    found, sets = switching.found, switching.sets
    p = candidates.law[k]
    code = candidates.run[k, CODE]
    first = candidates.step[s, FIRST_NODE]
    weight = candidates.node_energy[first : first + NODES]
    stored = False
    for m in range(NODES):
        stored = stored or weight[m] != 0.0
    low, high = _range_of_all(works, count)
    for piece in range(2):
        mode = old if piece == 0 else new
        if law_is_idle(code, mode):
            continue
        if piece == 1:
            least = np.inf
            most = -np.inf
            for i in range(count):  # without those that have to be followed by themselves, whose sets may be anything
                if found[SUM, i] == found[SUM, i]:
                    least = min(least, sets[1, i] - sets[0, i])
                    most = max(most, sets[1, i] - sets[0, i])
            if least > most:
                return
            low -= most
            high -= least
        middle, inverse, by_rate, places = fill_law(
            code, p, model.curves, candidates.step_time[s, 0], 0.0, low, high, mode, law_power[2:], law_power
        )  # fmt: skip
        for i in range(0, count, lanes()):
            begin = zero()
            wide = load(found[AT], i)
            if piece == 1:
                begin = wide
                wide = 1.0 - wide
            growth = load(sets[1], i) - load(sets[0], i) if piece == 1 else zero()
            total = zero()
            for g in range(GAUSS.shape[1]):
                u = (begin + wide * GAUSS[0, g]) * 2.0 - 1.0
                x = ((_at(power[ELONGATION], u, i) - growth) - middle) * inverse
                work = at_places(law_power[0], places, x)
                if by_rate != 0.0:
                    work += by_rate * _at(power[RATE], u, i)
                work = work * _at(power[ALONG], u, i)
                if stored:
                    work += at_places(law_power[1], places, x) * at_places(weight, NODES, u)
                total += GAUSS[1, g] * work
            store(found[SUM], i, load(found[SUM], i) + wide * total)


@part
def _range_of_all(works, count):
    """The least and the largest elongation at any node of the first members (m)."""
    low = works[0, ELONGATION, 0]
    high = low
    for m in range(NODES):
        for i in range(count):
            low = min(low, works[m, ELONGATION, i])
            high = max(high, works[m, ELONGATION, i])
    return low, high


@part
def _at(power, u, i):
    """Polynomials with coefficients (NODES, TOGETHER) by powers of u, of the members from i on at a vector u."""
    value = load(power[NODES - 1], i)
    for a in range(NODES - 2, -1, -1):
        value = value * u + load(power[a], i)
    return value


@part
def _of_member(power, c, i):
    """The polynomial of member i at a fraction c of the step."""
    u = 2.0 * c - 1.0
    value = power[NODES - 1, i]
    for a in range(NODES - 2, -1, -1):
        value = value * u + power[a, i]
    return value


@part
def _slope_of_member(power, c, i):
    """Its slope by the fraction."""
    u = 2.0 * c - 1.0
    value = 0.0
    for a in range(NODES - 1, 0, -1):
        value = value * u + a * power[a, i]
    return 2.0 * value
