"""A member that switches within a step, though the step does not end there: its pieces, and integrals over these.

No step ends at a switch of a member that does nothing to the motion. So its elongation is looked at at some nodes of
the step, and followed on the polynomial through these to where it leaves its mode.
"""

import numpy as np

from mdstopo.compiler.jit import part
from mdstopo.general.model.priced_candidates import NODE, NODES, POWERS
from mdstopo.mechanics.kinematics.kinematics_interface import ALONG, ELONGATION, RATE
from mdstopo.mechanics.laws.law_table import law, law_has_pieces, law_is_idle, law_margin, law_next, law_set

#: the highest power of time that virtual changes within a step have, and stages from which on they have it
HIGHEST_POWER, MANY_STAGES = 3, 8
#: a step has cubes of time among these, and squares, from this part of the time on over which its stages lie
CUBES_FROM, SQUARES_FROM = 0.5, 0.1
#: Legendre's polynomials at the nodes by degree, each times what its moment over a step counts
AT_NODES = np.polynomial.legendre.legvander(2.0 * NODE - 1.0, HIGHEST_POWER) * (
    2.0 * np.arange(HIGHEST_POWER + 1) + 1.0
)
#: points and weights of an integral over a piece of a step, as fractions of it (Gauss)
GAUSS = 0.5 * np.array(np.polynomial.legendre.leggauss(5)) + np.array([[0.5], [0.0]])
#: what is known of a member at the nodes: the first rows of `member_works`, ELONGATION, RATE and ALONG
NODE_ROWS = 3
#: pieces of a step in which a member stays in a mode: the fraction at which one begins, the mode, the permanent set;
#: how many changes are followed at most, about the rows of a table of measured forces; to which fraction of the step
#: each is located
PIECE = 3
BEGIN, PIECE_MODE, PIECE_SET = range(PIECE)
CHANGES = 64
LOCATED = 2.0**-40
#: the mode in which a curve looks for its piece at each elongation
ANY_PIECE = 0
#: a margin below this leaves open in which mode a member begins, and its second derivative decides (m, m/s or a part)
CLOSE_MARGIN = 1e-6
#: a mode is over where its margin is below zero by more than rounding, this part of 1 m and the member's length: right
#: behind a switch the margin of the new mode is zero, and it would end again at once. What has just been crushed stands
#: at its plateau, from which it moves away
ROUNDING = 4e-15


@part
def degree_of(stages, length, reach):
    """Of which degree the virtual changes are within a step of so many stages.

    length: of the step (s). reach: how long behind its start the last stage lies (s).

    A step that ends at an event has the stages of the step that was cut there, which lie up to far behind its end, and
    their weights are small. The higher moments of what these stages give all but cancel: in a short step nothing is
    left of them but the error of the method, and rounding.
    """
    degree = HIGHEST_POWER if stages >= MANY_STAGES else min(stages - 1, HIGHEST_POWER - 1)
    if length < SQUARES_FROM * reach:
        return min(degree, 1)
    return min(degree, 2) if length < CUBES_FROM * reach else degree


@part
def _first_over(code, p, curves, rest, time, node, begin, mode, kept, over):
    """The first node behind a fraction of a step at which a mode has ended; NODES where it has at none.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s).
    node (NODE_ROWS, NODES): the member there, of which ELONGATION and RATE count.
    begin: the fraction.
    mode, kept: the mode, and the permanent set (m).
    over: the margin below which it has ended, less than zero.
    """
    for m in range(1, NODES):
        if NODE[m] > begin:
            t = time[0] + NODE[m] * time[1]
            if law_margin(code, p, node[ELONGATION, m] - kept, node[RATE, m], mode, t, curves, rest) < over:
                return m
    return NODES


@part
def fill_power(values, power):
    """power (NODES,): coefficients of the polynomial through values (NODES,) at the nodes, as of POWERS."""
    for a in range(NODES):
        w = POWERS[a]
        power[a] = (
            (w[0] * values[0] + w[1] * values[1])
            + (w[2] * values[2] + w[3] * values[3])
            + (w[4] * values[4] + w[5] * values[5])
        )


@part
def polynomial(power, c):
    """The polynomial with coefficients as of POWERS at a fraction c of a step."""
    u = 2.0 * c - 1.0
    square = u * u
    return (power[0] + power[1] * u) + square * ((power[2] + power[3] * u) + square * (power[4] + power[5] * u))


@part
def _slope(power, c):
    """Its slope by the fraction."""
    u = 2.0 * c - 1.0
    value = 0.0
    for m in range(NODES - 1, 0, -1):
        value = value * u + m * power[m]
    return 2.0 * value


@part
def _margin(code, p, curves, rest, time, power, c, mode, kept):
    """How far a mode is from its end at a fraction c of a step.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s). power (NODE_ROWS, NODES): coefficients of ELONGATION and RATE.
    mode, kept: the mode, and the permanent set (m).
    """
    x = polynomial(power[ELONGATION], c) - kept
    return law_margin(code, p, x, polynomial(power[RATE], c), mode, time[0] + c * time[1], curves, rest)


@part
def _located(code, p, curves, rest, time, power, lower, upper, mode, kept, end):
    """The fraction of a step at which a mode has just ended.

    Regula falsi, which halves the value at an end that stays (Illinois), and the interval where three turns have not
    left a quarter of it.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s). power (NODE_ROWS, NODES): coefficients of ELONGATION and RATE.
    lower, upper: fractions at which the mode has not ended, and has.
    mode, kept: the mode, and the permanent set (m).
    end: the margin at which it ends, zero or less.
    """
    before = _margin(code, p, curves, rest, time, power, lower, mode, kept) - end
    behind = _margin(code, p, curves, rest, time, power, upper, mode, kept) - end
    turn = 0
    side = 0
    halve = False
    wide = upper - lower
    while upper - lower > LOCATED:
        c = lower + (upper - lower) * before / (before - behind)
        if halve or not lower <= c <= upper:
            c = 0.5 * (lower + upper)
        c = min(max(c, lower + 0.5 * LOCATED), upper - 0.5 * LOCATED)
        value = _margin(code, p, curves, rest, time, power, c, mode, kept) - end
        if value < 0.0:
            upper = c
            behind = value
            before *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            lower = c
            before = value
            behind *= 0.5 if side > 0 else 1.0
            side = 1
        halve = False
        turn += 1
        if turn == 3:
            halve = upper - lower > 0.25 * wide
            wide = upper - lower
            turn = 0
    return upper


@part
def follow(code, p, curves, rest, time, mode, kept, node, power, pieces):
    """The modes that a member goes through in a step.

    In:
      code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
      time (2,): start and length of the step (s).
      mode, kept: those with which it begins.
      node (NODE_ROWS, NODES): ELONGATION and RATE of the member.
    Out:
      power (NODE_ROWS, NODES): coefficients of these, unless it stays in its mode.
      pieces (CHANGES + 1, PIECE): set.

    Returns the number of the last piece, at most CHANGES. A curve that would have more looks up its piece at each
    elongation from there on (`ANY_PIECE`); other laws stay in that mode.
    """
    pieces[0, BEGIN] = 0.0
    pieces[0, PIECE_MODE] = mode
    pieces[0, PIECE_SET] = kept
    over = -ROUNDING * (1.0 + rest + abs(node[ELONGATION, 0]))
    last = np.int64(0)
    while True:
        begin = pieces[last, BEGIN]
        mode = np.int64(pieces[last, PIECE_MODE])
        kept = pieces[last, PIECE_SET]
        ended = _first_over(code, p, curves, rest, time, node, begin, mode, kept, over)
        if ended == NODES:
            return last
        if last == CHANGES:
            if law_has_pieces(code):
                pieces[last, PIECE_MODE] = ANY_PIECE
            return last
        if last == 0:
            fill_power(node[ELONGATION], power[ELONGATION])
            fill_power(node[RATE], power[RATE])
        lower = max(begin, NODE[ended - 1])
        upper = NODE[ended]
        before = _margin(code, p, curves, rest, time, power, lower, mode, kept)
        if before >= 0.5 * over:
            # a margin that is below zero by rounding alone has not ended the mode
            end = 0.0 if before >= 0.0 else 0.5 * over
            upper = _located(code, p, curves, rest, time, power, lower, upper, mode, kept, end)
        else:
            upper = lower
        x = polynomial(power[ELONGATION], upper) - kept
        rate = polynomial(power[RATE], upper)
        second = _slope(power[RATE], upper) / time[1]
        new = law_next(code, p, x, rate, second, mode, time[0] + upper * time[1], curves, rest)
        if new == mode:
            return last
        last += 1
        pieces[last, BEGIN] = upper
        pieces[last, PIECE_MODE] = new
        pieces[last, PIECE_SET] = kept + law_set(code, p, x, mode, new)


@part
def over_pieces(code, p, curves, rest, time, level, weight, last, node, power, pieces):
    """The integral over the pieces of a step of the force of each mode times the member's part of the virtual change,
    and of its energy times the weight of that.

    In:
      code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
      time (2,): start and length of the step (s).
      level, weight (NODES,): coefficients of the law's tabulated force, and of the weight of the energy.
      last: number of the last piece.
      node (NODE_ROWS, NODES): ALONG of the member.
      pieces (CHANGES + 1, PIECE): of `follow`.
    In place:
      power (NODE_ROWS, NODES): of `follow`; that of ALONG is set.
    """
    fill_power(node[ALONG], power[ALONG])
    given = False
    stored = False
    for m in range(NODES):
        given = given or level[m] != 0.0
        stored = stored or weight[m] != 0.0
    total = 0.0
    for at in range(last + 1):
        mode = np.int64(pieces[at, PIECE_MODE])
        if law_is_idle(code, mode):
            continue
        begin = pieces[at, BEGIN]
        wide = (pieces[at + 1, BEGIN] if at < last else 1.0) - begin
        for g in range(GAUSS.shape[1]):
            c = begin + wide * GAUSS[0, g]
            value = polynomial(level, c) if given else 0.0
            f, _, _, energy, _ = law(
                code, p, polynomial(power[ELONGATION], c) - pieces[at, PIECE_SET], polynomial(power[RATE], c), mode,
                time[0] + c * time[1], value, curves, rest,
            )  # fmt: skip
            work = f * polynomial(power[ALONG], c)
            if stored:
                work += energy * polynomial(weight, c)
            total += wide * GAUSS[1, g] * work
    return total
