"""Responses that are expressions of others: the formula at given values of these, compiled.

Such a response has the kind EXPRESSION and no kernels of its own; the responses that it is of stand behind all others
in `GeneralModel.response`. Which of its kinks and jumps are on which side is the number `who`, in which other responses
have a member: bits of the switches, as long as which stay the formula is smooth; times MARGINS, in front, the number
from 1 of a switch whose margin is meant instead of the value, or, behind all switches, of a response that it is of;
below -1, the same for the bits of the state.
"""

import numpy as np

from mdstopo.compiler.formulas import call_formula
from mdstopo.compiler.jit import kernel
from mdstopo.formula.response_formulas import SLOPES, VALUE, WIDTH
from mdstopo.general.model.general_model import BODY, COMPONENT, REFERENCE, SUBJECT

#: code of an expression among the kinds of responses
EXPRESSION = -1
#: its columns of `GeneralModel.response` beside KIND and ORDER: the first of the responses that it is of, how many they
#: are, what is known of it, and how many switches it has
FIRST_PART, PARTS, KNOWN, SWITCHES = BODY, REFERENCE, COMPONENT, SUBJECT
#: what is known, as bits: it needs a balance; its rate is g_q v + g_v a; it is a root; stored energy, t, and forces of
#: members are in it
BALANCED, BY_STATE, ROOT, ENERGETIC, TIMED, FORCED = 1, 2, 4, 8, 16, 32
#: its data, from the place in `response_par`: where its formulas are, groups of slopes, parameters, and then these
ADDRESS, GROUPS, COUNT, NUMBERS = range(4)
#: above the bits of all switches
MARGINS = 2**40


@kernel
def knows(model, j, what):
    """Whether an expression has one of the properties that the bits above stand for."""
    return model.response[j, KNOWN] & what != 0


@kernel
def _at(model, j):
    """Where the data of an expression begin."""
    return int(model.response_par[j, 0])


@kernel
def numbers_of(model, j):
    """How many numbers a formula is of: responses and parameters."""
    return model.response[j, PARTS] + int(model.curves[_at(model, j) + COUNT])


@kernel
def put_parameters(model, j, p):
    """The parameters of an expression into p (numbers_of,), behind the responses."""
    at = _at(model, j) + NUMBERS
    first = model.response[j, PARTS]
    for m in range(p.shape[0] - first):
        p[first + m] = model.curves[at + m]


@kernel
def margin_group(model, j, switch):
    """The group of formulas that has the margin of a switch and then its slopes."""
    groups = int(model.curves[_at(model, j) + GROUPS])
    return SLOPES + groups + switch * (1 + groups)


@kernel
def formula_value(model, j, who, p, t, slopes):
    """An expression, or the margin of one of its switches, with its slopes.

    Constant:
      model, j: the compiled scene, and which response.
    In:
      who: bits of the switches, perhaps with a switch whose margin is meant, or a response; below 0: no bit is set.
      p (numbers_of,): values of the responses that it is of, then its parameters.
      t: time (s).
    Out:
      slopes (PARTS,): by these responses. Where a root is 0, slopes that are 0/0 are 0, as of a norm.

    Returns the value, and its slope by t.
    """
    address = model.curves[_at(model, j) + ADDRESS]
    mode = np.int64(0)
    group = np.int64(VALUE)
    behind = np.int64(SLOPES)
    if who > 0:
        mode = np.int64(who % MARGINS)
        switch = who // MARGINS
        if switch > model.response[j, SWITCHES]:
            slopes[:] = 0.0
            slopes[switch - 1 - model.response[j, SWITCHES]] = 1.0
            return p[switch - 1 - model.response[j, SWITCHES]], 0.0
        if switch > 0:
            group = np.int64(margin_group(model, j, switch - 1))
            behind = group + 1
    value, by_time, _, _, _ = call_formula(address, p, 0.0, 0.0, t, 0.0, mode, group)
    count = slopes.shape[0]
    for first in range(0, count, WIDTH):
        five = call_formula(address, p, 0.0, 0.0, t, 0.0, mode, behind)
        behind += 1
        for m in range(min(WIDTH, count - first)):
            slope = five[m]
            slopes[first + m] = 0.0 if np.isnan(slope) and not np.isnan(value) else slope
    return value, by_time


@kernel
def formula_mode(model, j, p, t):
    """Bits of the switches of an expression at values p of the responses that it is of; 0 of those not evaluated.

    model, j: the compiled scene, and which response.
    p (numbers_of,): values of the responses, then its parameters.
    t: time (s).
    """
    address = model.curves[_at(model, j) + ADDRESS]
    mode = np.int64(0)
    for switch in range(model.response[j, SWITCHES]):
        group = np.int64(margin_group(model, j, switch))
        g, _, _, _, _ = call_formula(address, p, 0.0, 0.0, t, 0.0, mode, group)
        if g >= 0.0:
            mode += np.int64(1) << np.int64(switch)
    seen = mode
    for switch in range(model.response[j, SWITCHES]):
        bit = np.int64(1) << np.int64(switch)
        group = np.int64(margin_group(model, j, switch))
        _, _, evaluated, _, _ = call_formula(address, p, 0.0, 0.0, t, 0.0, mode, group)
        if evaluated < 0.5 and mode & bit != 0:
            seen -= bit
    return seen
