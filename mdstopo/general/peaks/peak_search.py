"""The extremes of a response over time, found on the steps of a finished motion: what `extremes` describes, compiled.

A motion is a sequence of steps, or of pieces of steps (`minima`), on each of which the response is smooth. Samples of a
piece lie at its start, its end and in between (`SAMPLES`); between two of them where the rate falls through zero a peak
is refined on the method's own motion. Where no step is as long as a vibration, as those of explicit methods and of one
without error control are, what lies between the ends of one is sampled only where a peak may be.
"""

import math

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.general.model.general_model import ENERGY, KIND, ORDER, unpack_general
from mdstopo.general.peaks.dense_output import (
    balance_at_end,
    evaluate_here,
    finished,
    go_to,
    goes_on,
    known_at,
    time_at,
)
from mdstopo.general.responses.extremes import (
    COLUMNS,
    FRACTION,
    LAST,
    NOBODY,
    OTHER,
    RATE,
    SAMPLES,
    SHARE,
    SIGN,
    STEP,
    TIME,
    VALUE,
    WHO,
)
from mdstopo.general.responses.general_responses import follows_state, kinked, needs_balance
from mdstopo.general.sensitivity.adjoint import at_stage
from mdstopo.general.steps.method_interface import ends_in_stage, is_continuous
from mdstopo.general.steps.step_history import EVENTS, FIRST, SEGMENT, carve_history, copy_vector, restore_modes
from mdstopo.integrators.steps import OF_POINTS, OF_SAMPLES
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, quintic

#: columns of a sample: value, rate, member
G, DG, MEMBER = range(3)
#: columns of a piece: the step, the fractions of it at which the piece begins and ends, the member meant
PIECE_STEP, PIECE_LOW, PIECE_HIGH, PIECE_MEMBER = range(4)
#: values or rates that differ by less than this, relative to the largest, differ by rounding
ROUNDING = 1e-13
#: a rate below this, relative to the largest, is that of a plateau, which only rounding tilts
FLAT = 1e-9
#: peaks nearer to each other than this in time (relative to what was simulated) and value are one
RIPPLE_TIME, RIPPLE = 1e-3, 1e-9
#: a response jumps where the sides of a boundary differ by more than this, relative to the largest value
JUMP = 1e-9
#: how often a bracket of a peak is narrowed at most
TRIALS = 60
#: in place of 1 where samples are left out at the ends of a step, too; stages of a step that say so, at least; and what
#: they may be off by beside what they differ by, relative to the largest value
LOW, MANY_STAGES, SAMPLES_OFF = 2, 12, 0.02
#: a change of the fraction at which a peak has settled: secants square it, or nearly
PEAK_SETTLED = 1e-8
#: a step has no peak inside if its ends stay below the limit by so many times what it may rise by; or if it rises (or
#: falls) at both ends, with rates that differ by at most one share, and a mean rate that is theirs to another
RISE_MARGIN, RATES_ALIKE, MEAN_ALIKE = 4.0, 0.5, 0.1


@kernel
def evaluate_exactly(tag, motion, j, k, c, who):
    """Response j at fraction c of step k, on the method's own motion; returns what `evaluate_here` does.

    tag: the method of integration (`method_interface`).
    motion: the finished motion, whose state becomes that one.
    j: the response. k, c: the step, and the fraction of it.
    who: the member whose force is meant; -1: the one with the largest.
    """
    go_to(tag, motion, k, c, np.bool_(True), -1)
    return evaluate_here(tag, motion, j, k, c, who, np.bool_(True), np.bool_(False), OF_POINTS)


@kernel
def stage_of_energy(tag, motion, k, e):
    """The number of the stage whose stored energy is that at the start (e = 0) or the end (e = 1) of step k; -1 where
    none is.

    The last stage of a step is at its end but for joints and for Newton's last correction. So it is taken only where
    the next step goes on with its sample: both sides are the same, and there is no peak between them.

    tag: the method of integration (`method_interface`). motion: the finished motion.
    """
    history, count = motion.history, motion.count
    if not ends_in_stage(tag):
        return known_at(tag, history, count, k, e)
    if e == 0 or k + 1 >= count or motion.model.size[0] > 0 or not goes_on(history, k + 1):
        return -1
    return history.index[k + 1, FIRST] - 1


@kernel
def sample_ends(tag, motion, j, plain, seen, accelerations):
    """Evaluate a response at both ends of every step that is not LOW, on the step's own side.

    tag: the method of integration (`method_interface`). motion: the finished motion. j: the response.
    plain (count,): which steps are LOW (`mark_low`).
    seen (count, SAMPLES, 3): the first and the last sample of each step are written.
    accelerations (count, 2, n): those at both ends of each step are written, NaN where the response needs no balance.

    What is behind a boundary is what is in front of it where no law, load or mode changes there.
    """
    history = motion.history
    shared = follows_state(tag, motion.model, j)
    stored = shared and motion.model.response[j, KIND] == ENERGY
    for k in range(motion.count):
        if plain[k] == LOW:
            seen[k] = np.nan
            continue
        restore_modes(history, history.index[k, EVENTS], motion.member_state)
        for e in range(2):
            if e == 0 and shared and k > 0 and plain[k - 1] != LOW and goes_on(history, k):
                copy_vector(seen[k - 1, LAST], seen[k, 0])
                copy_vector(accelerations[k - 1, 1], accelerations[k, 0])
                continue
            stage = stage_of_energy(tag, motion, k, e) if stored else -1
            if stage >= 0:
                seen[k, e * LAST, G] = history.energy[stage, 0]
                seen[k, e * LAST, DG] = history.energy[stage, 1]
                seen[k, e * LAST, MEMBER] = -1
                accelerations[k, e] = np.nan
                continue
            copy_vector(history.q[k + e], motion.q)
            copy_vector(history.v[k + e], motion.v)
            t = time_at(history, k, float(e))
            drive_state(motion.model, history.index[k, SEGMENT], t, motion.q, motion.v)
            motion.a[:] = np.nan
            value, rate, who = evaluate_here(
                tag, motion, j, k, float(e), -1, np.bool_(True), np.bool_(False), OF_SAMPLES
            )
            seen[k, e * LAST, G] = value
            seen[k, e * LAST, DG] = rate
            seen[k, e * LAST, MEMBER] = who
            copy_vector(motion.a, accelerations[k, e])


@kernel
def sample_inside(tag, motion, j, k, seen, accelerations):
    """Evaluate a response in step k between its ends, on the quintic through these or on the method's own motion.

    tag: the method of integration (`method_interface`). motion: the finished motion. j, k: the response, the step.
    seen (SAMPLES, 3): all samples but the first and the last are written.
    accelerations (2, n): at both ends of the step; made where they are NaN.
    """
    history = motion.history
    h = history.t[k + 1] - history.t[k]
    model, ends_q, ends = motion.model, motion.ends_q, motion.ends
    restore_modes(history, history.index[k, EVENTS], motion.member_state)
    if is_continuous(tag):
        for i in range(1, LAST):
            value, rate, who = evaluate_exactly(tag, motion, j, k, i / LAST, -1)
            seen[i, G] = value
            seen[i, DG] = rate
            seen[i, MEMBER] = who
        return
    for e in range(2):
        copy_vector(history.q[k + e], ends_q[e])
        copy_vector(history.v[k + e], ends[e, 0])
        if accelerations.shape[1] > 0 and np.isnan(accelerations[e, 0]):
            balance_at_end(tag, motion, k, e, ends_q[e], ends[e, 0], accelerations[e])
        copy_vector(accelerations[e], ends[e, 1])
        drive_state(model, history.index[k, SEGMENT], history.t[k + e], ends_q[e], ends[e, 0])
    for i in range(1, LAST):
        c = i / LAST
        quintic(model, c, h, ends_q[0], ends[0, 0], ends[0, 1], ends_q[1], ends[1, 0], ends[1, 1], motion.q, motion.v)
        drive_state(motion.model, history.index[k, SEGMENT], time_at(history, k, c), motion.q, motion.v)
        value, rate, who = evaluate_here(tag, motion, j, k, c, -1, np.bool_(True), np.bool_(False), OF_SAMPLES)
        seen[i, G] = value
        seen[i, DG] = rate
        seen[i, MEMBER] = who


@kernel
def has_no_peak(h, left, right, sign, limit):
    """Whether a step in which the motion is resolved can have no peak inside that comes up to the limit.

    h: its length (s). left, right (3,): samples at its ends.
    sign: 1 for peaks of g, -1 for those of -g. limit: below which none is wanted, of sign times g.
    """
    a, b = sign * left[G], sign * right[G]
    da, db = sign * left[DG], sign * right[DG]
    uneven = abs(b - a - 0.5 * h * (da + db))
    if RISE_MARGIN * (h * (abs(da) + abs(db)) + uneven) < limit - max(a, b):
        return True
    least = min(abs(da), abs(db))
    return da * db > 0.0 and abs(db - da) <= RATES_ALIKE * least and uneven <= MEAN_ALIKE * h * least


@kernel
def mark_low(motion, j, both, closeness, plain):
    """Set `plain` to LOW for steps in which the response, by its values at their stages, cannot come near its
    highest.

    These are at hand, and need no balance. They lie beside the motion by less than the response changes by within the
    step; stages beyond the end of a step that ends at a switch are left out. Nothing is set where steps have few
    stages, where these have no velocities of their own, and for responses that need no balance at the ends of steps.

    motion: the finished motion. j: the response. both: whether peaks of -g are wanted, too.
    closeness: how far below the highest a peak may be, relative to it.
    plain (count,): zeros before.
    """
    model, history = motion.model, motion.history
    if model.size[2] == 0 or (model.response[j, ORDER] == 0 and not needs_balance(model, j)):
        return
    most = np.empty(motion.count)
    least = np.empty(motion.count)
    top = -np.inf
    bottom = np.inf
    for k in range(motion.count):
        o = history.index[k, FIRST]
        stop = history.index[k + 1, FIRST]
        most[k] = -np.inf
        least[k] = np.inf
        if stop - o < MANY_STAGES:
            return
        restore_modes(history, history.index[k, EVENTS], motion.member_state)
        for at in range(o, stop):
            if history.when[at] > history.t[k + 1]:
                continue
            value, _ = at_stage(
                model, motion.member_state, history.index[k, SEGMENT], history, at, j, -1, motion.workspace,
                motion.bars, motion.row_bar,
            )  # fmt: skip
            if not np.isfinite(value):
                return
            most[k] = max(most[k], value)
            least[k] = min(least[k], value)
        top = max(top, most[k])
        bottom = min(bottom, least[k])
    size = max(abs(top), abs(bottom))
    for k in range(motion.count):
        change = most[k] - least[k] + SAMPLES_OFF * size
        up = most[k] + change < top - closeness * abs(top)
        down = not both or -least[k] + change < -bottom - closeness * abs(bottom)
        plain[k] = LOW if up and down else 0


@kernel
def sample_steps(tag, motion, j, both, fine, closeness, seen, plain):
    """Sample a response on every step of a motion.

    Constant:
      tag: the method of integration (`method_interface`).
      motion: the finished motion.
      j: the response.
      both: whether peaks of -g are wanted, too.
      fine: whether no step is as long as a vibration, so that not all have to be sampled inside.
      closeness: how far below the highest a peak may be, relative to it.
    Out:
      seen (count, SAMPLES, 3): values, rates, members; NaN inside steps that are plain, and all over low ones.
      plain (count,): 1 where the samples inside a step are left out, LOW where all of it is.
    """
    accelerations = np.empty((motion.count, 2, motion.v.shape[0]))
    # an absolute value or a norm turns round at its minima alone
    sparing = fine and not (both and kinked(motion.model, j))
    plain[:] = 0
    if sparing:
        mark_low(motion, j, both, closeness, plain)
    sample_ends(tag, motion, j, plain, seen, accelerations)
    top = -np.inf
    low = np.inf
    for k in range(motion.count):
        for e in range(2):
            if plain[k] != LOW:
                top = max(top, seen[k, e * LAST, G])
                low = min(low, seen[k, e * LAST, G])
    for k in range(motion.count):
        if plain[k] == LOW:
            continue
        h = motion.history.t[k + 1] - motion.history.t[k]
        plain[k] = 0
        if sparing:
            left, right = seen[k, 0], seen[k, LAST]
            up = has_no_peak(h, left, right, 1.0, top - closeness * abs(top))
            down = not both or has_no_peak(h, left, right, -1.0, -low - closeness * abs(low))
            plain[k] = 1 if up and down else 0
        if plain[k] == 0:
            sample_inside(tag, motion, j, k, seen[k], accelerations[k])
        else:
            seen[k, 1:LAST, :] = np.nan


@kernel
def add_row(rows, found, t, w, c, sample, sign):
    """Add a row of what was found at a place of a piece.

    rows (room, COLUMNS), found: row number `found` is written.
    t (P + 1,): ends of the pieces (s).
    w, c: the piece, and the fraction of it.
    sample (3,): value, rate and member there.
    sign: 1 for a peak of g, -1 for one of -g.

    Returns how many rows there are now.
    """
    row = rows[found]
    row[TIME] = t[w + 1] if c >= 1.0 else t[w] + c * (t[w + 1] - t[w])
    row[VALUE] = sample[G]
    row[STEP] = w
    row[FRACTION] = c
    row[RATE] = sample[DG]
    row[SIGN] = sign
    row[WHO] = sample[MEMBER]
    row[OTHER] = NOBODY
    row[SHARE] = 0.0
    return found + 1


@kernel
def evaluate_piece(tag, motion, j, who, pieces, w, c, sample):
    """Evaluate a response exactly at fraction c of piece w.

    Without pieces w is a step, and `who` the member whose force is meant (-1: the largest).

    tag: the method of integration (`method_interface`). motion: the finished motion. j: the response.
    pieces (P, 4): steps and fractions of them, or no rows. sample (3,): out, value, rate and member.
    """
    k = w
    if pieces.shape[0] > 0:
        k = int(pieces[w, PIECE_STEP])
        low, high = pieces[w, PIECE_LOW], pieces[w, PIECE_HIGH]
        c = high if c >= 1.0 else low + c * (high - low)
        who = int(pieces[w, PIECE_MEMBER])
    value, rate, member = evaluate_exactly(tag, motion, j, k, c, who)
    sample[G] = value
    sample[DG] = rate
    sample[MEMBER] = member


@kernel
def refine(tag, motion, j, who, pieces, w, low, high, rise, fall, sign, first, bend, sample):
    """The fraction of piece w at which the rate vanishes, on the method's own motion.

    By secants, from a first guess and its slope; where these lead out of the bracket by Illinois' rule.

    tag: the method of integration (`method_interface`). motion: the finished motion. j, who: response and member.
    pieces (P, 4), w: of `evaluate_piece`.
    low, high: fractions between which the rate falls through zero. rise, fall: sign times the rate at them.
    sign: 1, or -1 for peaks of -g. sample (3,): out, what is there.
    first, bend: the guess, and how the rate changes there with the fraction; NaN: none.
    """
    size = max(rise, -fall)
    side = 0
    c = np.nan
    last = np.nan
    at_last = np.nan
    foreseen = first
    for _ in range(TRIALS):
        c = foreseen
        if not low < c < high:
            c = (low * fall - high * rise) / (fall - rise)
        if not low < c < high:
            c = 0.5 * (low + high)
        evaluate_piece(tag, motion, j, who, pieces, w, c, sample)
        rate = sign * sample[DG]
        # the next secant would lead no farther than the square of this one
        if abs(rate) <= ROUNDING * size or high - low <= 1e-14 or abs(c - last) <= PEAK_SETTLED:
            break
        if c != last and not np.isnan(last):
            bend = (rate - at_last) / (c - last)
        foreseen = c - rate / bend if bend < 0.0 else np.nan
        last = c
        at_last = rate
        if rate > 0.0:
            low = c
            rise = rate
            if side == -1:
                fall *= 0.5
            side = -1
        else:
            high = c
            fall = rate
            if side == 1:
                rise *= 0.5
            side = 1
    return c


@part
def highest_between(one, two, rise, fall):
    """Where the cubic with these values and slopes (above 0, and below) at 0 and 1 is highest, and its bend there."""
    cube = rise + fall - 2.0 * (two - one)
    square = two - one - rise - cube
    root = math.sqrt(max(square * square - 3.0 * cube * rise, 0.0))
    c = rise / (root - square) if root > square else 0.5
    return c, 2.0 * square + 6.0 * cube * c


@kernel
def peaks_inside(tag, motion, j, who, pieces, t, seen, plain, sign, limit, rows, found):
    """Peaks within pieces: where the rate falls through zero between two samples.

    Constant:
      tag, motion, j, who, pieces: of `evaluate_piece`.
    In:
      t (P + 1,): ends of the pieces (s).
      seen (P, SAMPLES, 3), plain (P,): samples, and where there are none inside.
      sign: 1 for peaks of g, -1 for those of -g.
      limit: value of sign times g below which no peak is wanted.
      found: how many rows there are.
    Out:
      rows (room, COLUMNS): further ones are written.

    Returns how many rows there are now.
    """
    sample = np.empty(3)
    for w in range(seen.shape[0]):
        if plain[w] != 0:
            continue
        width = (t[w + 1] - t[w]) / LAST
        for i in range(LAST):
            ga, gb = sign * seen[w, i, G], sign * seen[w, i + 1, G]
            da, db = sign * seen[w, i, DG], sign * seen[w, i + 1, DG]
            if not max(ga + max(da, 0.0) * width, gb + max(-db, 0.0) * width) >= limit:
                continue
            low, high = i / LAST, (i + 1) / LAST
            first = bend = np.nan
            if da * db > 0.0:  # both rates of one sign: the cubic through them may yet turn twice
                slope = (gb - ga) / width
                half = 3.0 * slope - 2.0 * da - db
                square = 3.0 * (da + db - 2.0 * slope)
                if square == 0.0 or not half * half > square * da:
                    continue
                split = -half / square
                if not 0.0 < split < 1.0:
                    continue
                middle = low + split * (high - low)
                evaluate_piece(tag, motion, j, who, pieces, w, middle, sample)
                rate = sign * sample[DG]
                if da > 0.0 and rate < 0.0:
                    high = middle
                    db = rate
                elif rate > 0.0 and db < 0.0:
                    low = middle
                    da = rate
                else:
                    continue
            elif da > 0.0 and db == 0.0 and i + 2 < SAMPLES and sign * seen[w, i + 2, DG] < 0.0:
                high = (i + 2) / LAST
                db = sign * seen[w, i + 2, DG]
            elif not (da > 0.0 and db < 0.0):
                continue
            else:
                first, bend = highest_between(ga, gb, width * da, width * db)
                bend *= LAST / width
                first = low + first * (high - low)
            c = refine(tag, motion, j, who, pieces, w, low, high, da, db, sign, first, bend, sample)
            found = add_row(rows, found, t, w, c, sample, sign)
    return found


@kernel
def moves_off(seen, plain, sign, size):
    """Whether a response that starts from rest rises at first (1) or not (-1), by the first sample that differs by
    more than rounding.

    seen (P, SAMPLES, 3), plain (P,): samples, and where there are none inside.
    sign: 1 for peaks of g, -1 for those of -g. size: the largest |g|.
    """
    first = sign * seen[0, 0, G]
    for w in range(seen.shape[0]):
        for i in range(SAMPLES):
            if plain[w] == LOW or (plain[w] != 0 and 0 < i < LAST):
                continue
            g = sign * seen[w, i, G]
            if abs(g - first) > ROUNDING * size:
                return -1.0 if g < first else 1.0
    return -1.0


@kernel
def rises_last(seen, plain, sign, size):
    """Whether a response whose rate is 0 at the end of the motion rises into it (1) or not (0); one that has come to
    rest before has its peak there.

    seen (P, SAMPLES, 3), plain (P,), sign, size: of `moves_off`.
    """
    last = seen.shape[0] - 1
    rise = sign * (seen[last, LAST, G] - seen[last, 0 if plain[last] != 0 else LAST - 1, G])
    return 1.0 if rise > ROUNDING * size else 0.0


@kernel
def peaks_between(t, seen, plain, sign, limit, rows, found):
    """Peaks at the ends of pieces: a rise into one, or a fall out of it.

    t (P + 1,): ends of the pieces (s).
    seen (P, SAMPLES, 3), plain (P,): samples, and where there are none inside.
    sign: 1 for peaks of g, -1 for those of -g.
    limit: value of sign times g below which no peak is wanted.
    rows (room, COLUMNS), found: further rows are written; how many there are.

    Returns how many rows there are now.
    """
    m = seen.shape[0]
    size = 0.0
    steepest = 0.0
    for w in range(m):
        for i in range(SAMPLES):
            if plain[w] == 0 or (plain[w] != LOW and (i == 0 or i == LAST)):
                size = max(size, abs(seen[w, i, G]))
                steepest = max(steepest, abs(seen[w, i, DG]))
    flat = FLAT * steepest
    behind = np.zeros(m + 1, np.int8)  # 1: the peak is on the side behind the boundary
    for b in range(m + 1):
        before = b > 0 and plain[b - 1] != LOW
        after = b < m and plain[b] != LOW
        left = sign * seen[b - 1, LAST, G] if before else -np.inf
        d_left = sign * seen[b - 1, LAST, DG] if before else 1.0
        right = sign * seen[b, 0, G] if after else -np.inf
        d_right = sign * seen[b, 0, DG] if after else -1.0
        if b == 0 and d_right == 0.0:
            d_right = moves_off(seen, plain, sign, size)
        if before and after and d_left == 0.0 and d_right == 0.0:
            # as where something sticks: what the samples beside it rise and fall by tells
            d_left = sign * seen[b - 1, 0 if plain[b - 1] != 0 else LAST - 1, DG]
            d_right = sign * seen[b, LAST if plain[b] != 0 else 1, DG]
            if d_left <= 0.0 or d_right > 0.0:  # level behind it: a plateau, whose peak is where it begins
                d_left = d_right = 0.0
        if b == m and before and d_left == 0.0:
            d_left = rises_last(seen, plain, sign, size)
        jump = 0 < b < m and abs(left - right) > JUMP * size
        level_right = d_left > flat and d_right <= flat
        level_left = d_right < -flat and d_left >= -flat
        from_left = (
            before
            and left >= limit
            and d_left > 0.0
            and (b == m or d_right <= 0.0 or level_right or (jump and right < left))
        )
        from_right = (
            after
            and right >= limit
            and d_right < 0.0
            and (b == 0 or d_left >= 0.0 or level_left or (jump and left < right))
        )
        # where both sides have one peak in common, it is one
        if from_left and not (jump and right > left):
            from_right = False
        if from_right and jump:
            from_left = False
        behind[b] = 1 if from_right else 0
        if from_left:
            found = add_row(rows, found, t, b - 1, 1.0, seen[b - 1, LAST], sign)
    for b in range(m):
        if behind[b] != 0:
            found = add_row(rows, found, t, b, 0.0, seen[b, 0], sign)
    return found


@kernel
def search(tag, motion, j, who, pieces, t, seen, plain, sign, closeness, rows, found):
    """The peaks of sign times response j that come near the highest sample.

    Constant:
      tag, motion, j, who, pieces: of `evaluate_piece`.
    In:
      t (P + 1,): ends of the pieces (s).
      seen (P, SAMPLES, 3), plain (P,): samples, and where there are none inside.
      sign: 1 for peaks of g, -1 for those of -g.
      closeness: how far below the highest sample a peak may be, relative to it.
      found: how many rows there are.
    Out:
      rows (found + (LAST + 2) (P + 1) or more, COLUMNS): further ones are written.

    Returns how many rows there are now.
    """
    highest = -np.inf
    w = 0
    i = 0
    for k in range(seen.shape[0]):
        for s in range(SAMPLES):
            if plain[k] == 0 or (plain[k] != LOW and (s == 0 or s == LAST)):
                g = sign * seen[k, s, G]
                if g > highest or (np.isnan(g) and not np.isnan(highest)):
                    highest = g
                    w = k
                    i = s
    limit = highest - closeness * abs(highest)
    before = found
    found = peaks_inside(tag, motion, j, who, pieces, t, seen, plain, sign, limit, rows, found)
    found = peaks_between(t, seen, plain, sign, limit, rows, found)
    if found == before:  # constant
        found = add_row(rows, found, t, w, i / LAST, seen[w, i], sign)
        rows[before, RATE] = 0.0
    return found


@kernel
def is_higher(one, other):
    """Whether a row stands before another: the higher one, the earlier one where equal."""
    a, b = one[SIGN] * one[VALUE], other[SIGN] * other[VALUE]
    return a > b or (a == b and one[TIME] < other[TIME])


@kernel
def rank(rows, found, closeness, span, out):
    """The rows within `closeness` of the highest, highest first, the earlier first where equal.

    Peaks that are one in truth, and more only by what the method leaves of ripple over a small part of the simulated
    time, count as one.

    rows (found or more, COLUMNS): of which the first `found` are taken.
    closeness: relative. span: the simulated time (s).
    out (most, COLUMNS): the rows kept.

    Returns how many are kept.
    """
    waits = np.ones(found, np.bool_)
    kept = np.int64(0)
    best = 0.0
    for lap in range(found):
        row = -1
        for r in range(found):
            if waits[r] and (row < 0 or is_higher(rows[r], rows[row])):
                row = r
        waits[row] = False
        value = rows[row, SIGN] * rows[row, VALUE]
        if lap == 0:
            best = value
        if value < best - closeness * abs(best) or kept == out.shape[0]:
            break
        ripple = False
        for r in range(kept):
            if (
                out[r, WHO] == rows[row, WHO]
                and out[r, SIGN] == rows[row, SIGN]
                and abs(out[r, TIME] - rows[row, TIME]) <= RIPPLE_TIME * span
                and abs(out[r, VALUE] - rows[row, VALUE]) <= RIPPLE * abs(best)
            ):
                ripple = True
        if not ripple:
            for i in range(COLUMNS):
                out[kept, i] = rows[row, i]
            kept += 1
    return kept


@entry
def peaks_of_steps(
    tag, ints, floats, tables, limits, count, room, room_ints, member_state, j, both, fine, closeness, out, work
):
    """The highest peaks of a response over all steps of a motion, ranked.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      j: the response.
      both: whether its absolute value is meant: peaks of g, and of -g.
      fine: of `sample_steps`.
      closeness: how far below the highest a peak may be, relative to it.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      out (most, COLUMNS): the rows.
      work (WORK,): counts of work, added to.

    Returns how many rows there are.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    motion = finished(model, tables, member_state, history, count, work)
    return highest(tag, motion, j, both, fine, closeness, out)


@kernel
def highest(tag, motion, j, both, fine, closeness, out):
    """`peaks_of_steps` of a motion that has been unpacked.

    tag: the method of integration (`method_interface`).
    motion: the motion (`dense_output.Motion`).
    j, both, fine, closeness: as of `peaks_of_steps`.
    out (most, COLUMNS): the rows.

    Returns how many rows there are.
    """
    count = motion.count
    history = motion.history
    seen = np.empty((count, SAMPLES, 3))
    plain = np.empty(count, np.int64)
    sample_steps(tag, motion, j, both, fine, closeness, seen, plain)
    no_pieces = np.empty((0, 4))
    rows = np.empty((2 * (LAST + 2) * (count + 1), COLUMNS))
    found = np.int64(0)
    for side in range(2 if both else 1):
        sign = 1.0 if side == 0 else -1.0
        found = search(tag, motion, j, -1, no_pieces, history.t, seen, plain, sign, closeness, rows, found)
    return rank(rows, found, closeness, history.t[count] - history.t[0], out)


@entry
def peaks_of_pieces(
    tag, ints, floats, tables, limits, count, room, room_ints, member_state, j, who, pieces, t, seen, plain, sign,
    closeness, rows, work,
):  # fmt: skip
    """The peaks of a response on pieces of steps that have been sampled; not ranked.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      j: the response.
      who: without pieces the member whose force is meant; -1: at each place the one with the largest.
      pieces (P, 4): step, fractions at its start and its end, member; no rows: the steps as they are.
      t (P + 1,): ends of the pieces (s).
      seen (P, SAMPLES, 3): value, rate (per s) and member at the samples.
      plain (P,): 1 where the samples inside a piece are left out.
      sign: 1 for peaks of g, -1 for those of -g.
      closeness: how far below the highest sample a peak may be, relative to it.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      rows ((LAST + 2) (P + 1), COLUMNS): the peaks; columns STEP and FRACTION are of pieces.
      work (WORK,): counts of work, added to.

    Returns how many there are.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    motion = finished(model, tables, member_state, history, count, work)
    return search(tag, motion, j, who, pieces, t, seen, plain, sign, closeness, rows, np.int64(0))


@entry
def rank_rows(rows, closeness, span, out):
    """`rank` of all rows (K, COLUMNS); returns how many are written to out (most, COLUMNS)."""
    return rank(rows, np.int64(rows.shape[0]), closeness, span, out)
