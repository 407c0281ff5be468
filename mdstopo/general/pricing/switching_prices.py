"""The price of a member that is not built by a law that switches: it is followed through the steps of the motion.

No step ends at a switch of a member of alpha = 0. So its elongation is looked at at some nodes of each step. Where it
leaves its mode within the step, the sum over stages, which is for smooth forces and energies, gives way to an integral
over the pieces: there the virtual change, and the weight of the energy, are the polynomials with the moments that the
stages give.
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, larger, largest, load, store, where_larger, zero
from mdstopo.general.design.followed_member import (
    CHANGES,
    CLOSE_MARGIN,
    NODE_ROWS,
    PIECE,
    PIECE_MODE,
    PIECE_SET,
    follow,
    over_pieces,
)
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.general_model import MEMBER_FREE_LENGTH
from mdstopo.general.model.priced_candidates import (
    CODE,
    FIRST_NODE,
    FIRST_STAGE,
    FIRST_STEP,
    KIND,
    LAST_STAGE,
    LAST_STEP,
    MOVES,
    NODES,
    POINT,
    WHOLE,
)
from mdstopo.mechanics.kinematics.kinematics_interface import (
    ALONG,
    ELONGATION,
    INVERSE,
    RATE,
    WORKS,
    member_motion,
    member_work,
    member_works,
    second_rate,
)
from mdstopo.mechanics.laws.law_table import (
    law,
    law_degree,
    law_first_set,
    law_is_idle,
    law_margin,
    law_remembers,
    law_start,
)

#: places from -1 to 1 at which a law that is a polynomial is evaluated, for three coefficients and for five, and what
#: makes these of values there
PLACE = np.array([[1.0, 0.0, -1.0, 0.0, 0.0], np.cos(np.pi * np.arange(5) / 4.0)])
FROM_PLACES = np.zeros((2, 5, 5))
FROM_PLACES[0, :3, :3] = np.linalg.inv(np.vander(PLACE[0, :3], increasing=True))
FROM_PLACES[1] = np.linalg.inv(np.vander(PLACE[1], increasing=True))
#: members that are followed at once, and what stands for the mode of one that leaves it
ROW = 16
NOWHERE = -1
#: the free length (m) that is given to a law that does not depend on it
NO_REST = 1.0


class Following:
    """Members that are followed through a step, ROW at most, inside kernels.

    node, power (NODE_ROWS, NODES): values of a member at nodes, and coefficients of the polynomials through them.
    pieces (CHANGES + 1, PIECE): between its switches. works (NODES + 2, WORKS, ROW): what members do at nodes and at a
    stage, and prices. modes, sets (3, ROW): modes and permanent sets (m) with which members begin a step, end it, stay.
    """

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Following, ("node", "power", "pieces", "works", "modes", "sets"))


@kernel
def make_following():
    """A `Following`, with no member in a mode."""
    return Following(
        np.empty((NODE_ROWS, NODES)),
        np.empty((NODE_ROWS, NODES)),
        np.zeros((CHANGES + 1, PIECE)),
        np.zeros((NODES + 2, WORKS, ROW)),
        np.zeros((3, ROW), np.int64),
        np.zeros((3, ROW)),
    )


@kernel
def price_followed(model, candidates, k, at, count, following, price):
    """Add what members of a law that switches do in the steps of a run.

    model: with the members.
    candidates, k: a `PricedCandidates`, and the number of the run.
    at, count: the first member, and how many there are, ROW at most.
    following: a `Following`, overwritten.
    price (count,): added to.
    """
    run = candidates.run[k]
    modes, sets = following.modes, following.sets
    modes[:] = 0
    sets[:] = 0.0
    begun = np.bool_(False)
    ends = np.int64(0)
    for s in range(run[FIRST_STEP], run[LAST_STEP]):
        kind = candidates.step[s, KIND]
        if kind == POINT:
            for i in range(count):
                started = begun or ends != 0
                price[i] += price_point(model, candidates, k, at + i, s, modes[ends, i], sets[ends, i], started)
            continue
        if candidates.step[s, MOVES] == 0 and not law_remembers(run[CODE]):
            continue
        price_step(model, candidates, k, at, count, s, modes[0], sets[0], begun, np.bool_(False), following, price)
        # a part of a step leaves the modes with which the whole one begins
        ends = np.int64(1)
        if kind == WHOLE:
            modes[0] = modes[1]
            sets[0] = sets[1]
            ends = np.int64(0)
            begun = np.bool_(True)


@kernel
def price_point(model, candidates, k, i, s, mode, kept, begun):
    """What member i of a law that switches does at a state alone, on the side of it that is looked at.

    model: with the members.
    candidates, k, i: a `PricedCandidates`, the number of the run, and the member.
    s: the number of the state among the steps.
    mode, kept: the mode that the member is in, and its permanent set (m); of a law that does not remember, any.
    begun: whether it is in a mode.
    """
    code = candidates.run[k, CODE]
    o = candidates.step[s, FIRST_STAGE]
    length, x, rate = member_motion(model, i, candidates.pose[o, 0])
    if not length > 0.0:
        return 0.0
    if not begun or not law_remembers(code):
        p = candidates.law[k]
        second = second_rate(model, i, candidates.pose[o, 0], candidates.pose_a[o])
        rest = model.member[MEMBER_FREE_LENGTH, i]
        shift = candidates.step_time[s, 1]
        mode = law_start(
            code, p, x + shift * rate, rate + shift * second, second, candidates.when[o] + shift, model.curves, rest
        )  # fmt: skip
        kept = law_first_set(code, p, x, mode)
    _, _, along = member_work(model, i, candidates.pose[o, 0], candidates.change[o, 0])
    f, _, _, energy, _ = law(
        code, candidates.law[k], x - kept, rate, mode, candidates.when[o], candidates.level[o], model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip
    return f * along + candidates.energy[o] * energy


@kernel
def price_step(model, candidates, k, at, count, s, begin, begin_set, begun, quick, following, price):
    """Add what members of a law that switches do in a step.

    A step in which a member stays in its mode is summed over its stages, as for a member that is built. In a step in
    which its mode changes, the force of each mode times the member's part of the virtual change, and the energy times
    its weight, are integrated over the mode's piece, all from their values at the nodes.

    In:
      model: with the members.
      candidates, k: a `PricedCandidates`, and the number of the run.
      at, count: the first member, and how many there are, ROW at most.
      s: the number of the step.
      begin, begin_set (count,): modes that they are in, and their permanent sets (m), unless they are to be found.
      begun: whether they are in modes.
      quick: whether last digits may depend on which members are followed together.
    Out:
      following: a `Following`: its modes and sets in row 1 are those with which the members end.
      price (count,): added to.
    """
    node, power, pieces = following.node, following.power, following.pieces
    works, modes, sets = following.works, following.modes, following.sets
    p = candidates.law[k]
    code = candidates.run[k, CODE]
    curves = model.curves
    free = model.member[MEMBER_FREE_LENGTH]
    step = candidates.step[s]
    time = candidates.step_time[s]
    first = step[FIRST_NODE]
    level = candidates.node_level[first : first + NODES]
    weight = candidates.node_energy[first : first + NODES]
    known = begun and law_remembers(code)
    stay = False
    for m in range(NODES):
        o = first + m
        member_works(model, at, count, candidates.node_pose[o], candidates.node_change[o], works[m])
    for i in range(count):
        for m in range(NODES):
            node[ELONGATION, m] = works[m, ELONGATION, i]
            node[RATE, m] = works[m, RATE, i]
        rest = free[at + i]
        mode = np.int64(begin[i])
        kept = begin_set[i]
        if not known:
            mode = mode_at_start(model, candidates, k, at + i, s, node)
            kept = law_first_set(code, p, node[ELONGATION, 0], mode)
        last = follow(code, p, curves, rest, time, mode, kept, node, power, pieces)
        modes[1, i] = int(pieces[last, PIECE_MODE])
        sets[1, i] = pieces[last, PIECE_SET]
        modes[2, i] = mode if last == 0 and not law_is_idle(code, mode) else np.int64(NOWHERE)
        sets[2, i] = kept
        stay = stay or modes[2, i] != NOWHERE
        if last > 0 and step[MOVES] != 0:
            for m in range(NODES):
                node[ALONG, m] = works[m, ALONG, i]
            price[i] += over_pieces(code, p, curves, rest, time, level, weight, last, node, power, pieces)
    if stay and step[MOVES] != 0:
        _add_stages(model, candidates, k, at, count, s, quick, following, price)


@part
def _add_stages(model, candidates, k, at, count, s, quick, following, price):
    """Add what the members that stay in their modes do in a step: the second part of `price_step`.

    model, candidates, k, at, count, s, quick, price: as there.
    following: a `Following`, of which row 2 of the modes and sets counts, NOWHERE where a member does not stay.
    """
    node, power = following.node, following.power
    works, modes, sets = following.works, following.modes, following.sets
    p = candidates.law[k]
    code = candidates.run[k, CODE]
    curves = model.curves
    free = model.member[MEMBER_FREE_LENGTH]
    step = candidates.step[s]
    main = np.int64(NOWHERE)
    like = np.int64(0)
    for i in range(count):
        if main == NOWHERE:
            main = modes[2, i]
            like = np.int64(i)
    quick = quick and law_degree(code) > 0
    now = works[NODES]
    found_now = works[NODES + 1, 0]
    for o in range(step[FIRST_STAGE], step[LAST_STAGE]):
        t = candidates.when[o]
        value = candidates.level[o]
        member_works(model, at, count, candidates.pose[o, 0], candidates.change[o, 0], now)
        for i in range(count):
            now[ELONGATION, i] -= sets[2, i]
            if modes[2, i] != NOWHERE and now[INVERSE, i] != 0.0 and not (quick and modes[2, i] == main):
                f, _, _, energy, _ = law(
                    code, p, now[ELONGATION, i], now[RATE, i], modes[2, i], t, value, curves, free[at + i]
                )  # fmt: skip
                price[i] += f * now[ALONG, i] + candidates.energy[o] * energy
        if not quick:
            continue
        for i in range(count):
            if modes[2, i] != main:
                # the polynomial is as exact as the range of the members that it is for is narrow
                now[ELONGATION, i] = now[ELONGATION, like]
        found_now[:] = 0.0
        add_polynomial(
            code, p, curves, t, value, candidates.energy[o], now, count, main, node, power, found_now
        )  # fmt: skip
        for i in range(count):
            if modes[2, i] == main:
                price[i] += found_now[i]


@part
def range_of(x, count):
    """The least and the largest of the first numbers of x, of which there are so many."""
    low = x[0]
    high = x[0]
    whole = count - count % lanes()
    if whole > 0:
        above = load(x, 0)
        below = zero() - above
        for i in range(lanes(), whole, lanes()):
            above = larger(load(x, i), above)
            below = larger(zero() - load(x, i), below)
        low = -largest(below)
        high = largest(above)
    for i in range(whole, count):
        low = min(low, x[i])
        high = max(high, x[i])
    return low, high


@part
def fill_law(code, p, curves, t, value, low, high, mode, node, power):
    """Force and energy of a law that is a polynomial (`Modes.degree`), by powers of (x - middle) / half.

    In:
      code, p (8,), curves: the law, and numbers of all laws.
      t, value: time (s), and the law's tabulated force then (N).
      low, high: between which elongations they are wanted (m).
      mode: the mode.
    Out:
      power (2 or more, 5 or more): coefficients of the force and of the energy.
      node (2 or more, 5 or more): scratch.

    Returns the middle of the elongations, the inverse of half their range, the slope of the force by the rate, and how
    many coefficients there are.
    """
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), 1e-6 * (1.0 + abs(middle)))
    five = np.int64(0) if law_degree(code) == 1 else np.int64(1)
    places = 5 if five == 1 else 3
    by_rate = 0.0
    for m in range(places):
        f, _, by_rate, energy, _ = law(
            code, p, middle + half * PLACE[five, m], 0.0, mode, t, value, curves, NO_REST
        )  # fmt: skip
        node[0, m] = f
        node[1, m] = energy
    for a in range(places):
        force = 0.0
        stored = 0.0
        for m in range(places):
            force += FROM_PLACES[five, a, m] * node[0, m]
            stored += FROM_PLACES[five, a, m] * node[1, m]
        power[0, a] = force
        power[1, a] = stored
    return middle, 1.0 / half, by_rate, places


@part
def at_places(power, places, s):
    """The polynomial with so many coefficients, at a vector s."""
    value = zero() + power[places - 1]
    for a in range(places - 2, -1, -1):
        value = value * s + power[a]
    return value


@kernel
def add_polynomial(code, p, curves, t, value, weight, works, count, mode, node, power, price):
    """Add what members in one mode do at a state: force times virtual change, and energy times the weight there.

    Of a law that is a polynomial (`Modes.degree`), from few of its values.

    In:
      code, p (8,), curves: the law, and numbers of all laws.
      t, value, weight: time (s), the law's tabulated force then (N), and the weight of the energy.
      works (WORKS, count or more): what members do there, of `member_works`, elongations less permanent sets.
      count: how many there are; a whole number of vectors may be read.
      mode: that they are in.
    Out:
      price (count, to whole vectors): added to.
      node, power (2 or more, 5 or more): scratch.
    """
    x = works[ELONGATION]
    low, high = range_of(x, count)
    middle, inverse, by_rate, places = fill_law(code, p, curves, t, value, low, high, mode, node, power)
    for a in range(places):
        power[1, a] *= weight
    for i in range(0, count, lanes()):
        s = (load(x, i) - middle) * inverse
        work = (at_places(power[0], places, s) + by_rate * load(works[RATE], i)) * load(works[ALONG], i)
        if weight != 0.0:
            work += where_larger(load(works[INVERSE], i), 0.0, at_places(power[1], places, s))
        store(price, i, load(price, i) + work)


@kernel
def add_in_mode(code, p, curves, t, value, weight, free, works, mode, price):
    """What `add_polynomial` does of any law, member by member.

    code, p, curves, t, value, weight, works, mode, price: as there, of as many members as there are prices.
    free (count,): free lengths (m).
    """
    for i in range(price.shape[0]):
        if works[INVERSE, i] != 0.0:
            f, _, _, energy, _ = law(
                code, p, works[ELONGATION, i], works[RATE, i], mode, t, value, curves, free[i]
            )  # fmt: skip
            price[i] += f * works[ALONG, i] + weight * energy


@part
def mode_at_start(model, candidates, k, i, s, node):
    """The mode of member i at the first node of a step.

    model, candidates, k, i, s, node: as of `_by_second_derivative`.
    """
    code = candidates.run[k, CODE]
    p = candidates.law[k]
    x = node[ELONGATION, 0]
    rate = node[RATE, 0]
    t = candidates.step_time[s, 0]
    rest = model.member[MEMBER_FREE_LENGTH, i]
    mode = np.int64(law_start(code, p, x, rate, 0.0, t, model.curves, rest))
    if not law_margin(code, p, x, rate, mode, t, model.curves, rest) > CLOSE_MARGIN:
        mode = _by_second_derivative(model, candidates, k, i, s, node)
    return mode


@kernel
def _by_second_derivative(model, candidates, k, i, s, node):
    """The mode of member i at the first node of a step, where that depends on its second derivative.

    model: with the members.
    candidates, k: a `PricedCandidates`, and the number of the run.
    i, s: numbers of the member and of the step.
    node (NODE_ROWS, NODES): the member at the nodes.
    """
    rest = model.member[MEMBER_FREE_LENGTH, i]
    first = candidates.step[s, FIRST_NODE]
    r = candidates.node_pose[first]
    length, _, _ = member_motion(model, i, r)
    second = second_rate(model, i, r, candidates.node_a[first]) if length > 0.0 else 0.0
    return np.int64(
        law_start(
            candidates.run[k, CODE], candidates.law[k], node[ELONGATION, 0], node[RATE, 0], second,
            candidates.step_time[s, 0], model.curves, rest,
        )
    )  # fmt: skip
