"""Where within a step a margin falls through zero: the next place to look at, and what it has shown.

First it has to be known that one does: members that come and go within a step show it at neither end. Looking at the
cubic through both ends tells where they might; there the step is cut, and both pieces are looked at in the same way,
until nothing is doubtful. Then the root is bracketed and closed in on.
"""

from mdstopo.compiler.jit import kernel
from mdstopo.general.events import block_of
from mdstopo.general.members import stretch_of
from mdstopo.mechanics.contact import contact_grazes
from mdstopo.mechanics.laws.table import law_grazes

#: trials of the moment of one event
TRIALS = 100
#: cuts of one step, and how near to the ends of a piece none is worth making
CUTS, EDGE = 24, 1e-7
#: margins (times rounding) at which a place behind the switch is near enough, and which is aimed at
NEAR, AIM = 50.0, 5.0


@kernel
def next_trial(low, high, at_low, at_high, rounding, resolution, tries):
    """Where within a step to try next for the moment at which a margin vanishes; -1 where `high` is near enough.

    It is the secant through both ends, aimed behind the switch by more than rounding; after many trials every other one
    is a bisection.

    low, high: lengths of the step between which it happens (s).
    at_low, at_high: the smallest margins there; at_high is negative.
    rounding: what rounding leaves of a margin.
    resolution: lengths that differ by no more than this are the same (s).
    tries: how many trials there have been.
    """
    if high - low <= resolution or at_high >= -NEAR * rounding:
        return -1.0
    aim = AIM * rounding
    middle = (low * (at_high + aim) - high * (at_low + aim)) / (at_high - at_low)
    if (tries > 15 and tries % 2 == 0) or middle <= low or middle >= high:
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            return -1.0
    return middle


@kernel
def narrowed(low, high, at_low, at_high, middle, value, rounding, side):
    """The bracket after another look: low, high, at_low, at_high, side, by Illinois' rule.

    low, high: lengths of the step between which the margin vanishes (s).
    at_low, at_high: the smallest margins there; the one that stays a second time running is halved.
    middle, value: where the look was (s), and the margin there.
    rounding: what rounding leaves of a margin.
    side: which end the last look has moved: 1 `high`, -1 `low`, 0 none yet.
    """
    if value < -rounding:
        return low, middle, (0.5 * at_low if side == 1 else at_low), value, 1
    return middle, high, max(value, rounding), (0.5 * at_high if side == -1 else at_high), -1


@kernel
def cut_at(dip, near, low, high):
    """Where to cut the piece of a step between low and high (s), or -1: nowhere.

    dip, near: the fractions of the piece that `events.first_sign` has found.
    """
    c = dip if dip < 1.0 else near
    if not (c > EDGE and c < 1.0 - EDGE):
        return -1.0
    return low + c * (high - low)


@kernel
def matters(model, member_state, rel, i):
    """Whether derivatives depend on it that member or contact i only just does not leave its mode.

    rel (n_pair, POSE): relative poses at that moment. Members with a permanent set are left out: where no energy is
    lost they come back to the very place at which the set was made, which is no touch to warn of.
    """
    if i >= model.member.shape[1]:
        return contact_grazes(model.contact[i - model.member.shape[1]], int(member_state[1, i])) == 2
    if i < 0 or member_state[0, i] == 0.0 or member_state[2, i] != 0.0:
        return False
    k = block_of(model, i)
    x, _ = stretch_of(model.member, i, rel[model.block[k, 0]])
    return law_grazes(model.block[k, 3], model.law[k], x, int(member_state[1, i])) == 2
