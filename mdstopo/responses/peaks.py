"""The peaks of a response in continuous time.

Samples (stages of the steps, start and end) with values and rates bracket every change of sign of dg/dt; in each
bracket the root is found on the method's own interpolation, so the peak is where the discrete motion has it, never on
a grid. At a start from rest dg/dt = 0 without a peak. What competes with the highest is returned, highest first, the
earlier first where equal. For minima everything is done to -g.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.integrators.steps import ENERGY, ENERGY_RATE, FIRST, step_at
from mdstopo.integrators.steps_interface import point_of, sample
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from mdstopo.mechanics.passes import SUMS, member_sums, springs_of
from mdstopo.responses.energy import energy_at, energy_of

#: columns of a peak: time, value, step, fraction of it
TIME, VALUE, STEP, FRACTION = range(4)


@kernel
def cubic_peak(da, db, slope):
    """Where in (0, 1) the cubic with end rates da > 0 >= db and mean rate slope has its peak."""
    # its rate: da + 2 half s + square s^2
    half = 3.0 * slope - 2.0 * da - db
    square = 3.0 * (da + db - 2.0 * slope)
    root = np.sqrt(max(half * half - square * da, 0.0))
    s = da / (root - half) if root - half > 0.0 else 0.5
    return s if s > 0.0 and s < 1.0 else da / (da - db)


@kernel
def cubic_dip(da, db, slope):
    """Where the cubic has an extremum although its rates at both ends have one sign; -1 where it has none."""
    half = 3.0 * slope - 2.0 * da - db
    square = 3.0 * (da + db - 2.0 * slope)
    if square == 0.0 or half * half - square * da <= 0.0:
        return -1.0
    s = -half / square
    return s if s > 0.0 and s < 1.0 else -1.0


@kernel
def keep_peak(peaks, found, time, value):
    """Insert a peak, highest first and the earlier first where equal; return how many are kept."""
    rows = peaks.shape[0]
    place = found
    while place > 0 and (
        value > peaks[place - 1, VALUE] or (value == peaks[place - 1, VALUE] and time < peaks[place - 1, TIME])
    ):
        place -= 1
    if place >= rows:
        return found
    for i in range(min(found, rows - 1), place, -1):
        peaks[i, TIME] = peaks[i - 1, TIME]
        peaks[i, VALUE] = peaks[i - 1, VALUE]
    peaks[place, TIME] = time
    peaks[place, VALUE] = value
    return min(found + 1, rows)


@kernel
def brackets_of(t, g, d, closeness, bracket, peaks):
    """Find the stretches between samples in which there may be a peak, and peaks at the ends of time.

    Stretches that cannot hold a peak within `closeness` of the highest sample are dropped.

    In:
      t, g, d (S,): times (s), values and rates of the samples.
      closeness: relative.
    Out:
      bracket (S, 2): index of the sample at the left, and where in the stretch to look first (0 to 1).
      peaks (rows, 4): time and value of peaks at the ends of time.

    Returns the numbers of brackets and of peaks.
    """
    samples = t.shape[0]
    highest = -np.inf
    for i in range(samples):
        highest = max(highest, g[i])
    size = 0.0
    for i in range(samples):
        size = max(size, abs(g[i]))
    found = np.int64(0)
    falls = d[0] < 0.0
    if d[0] == 0.0:  # from rest: the first sample that differs by more than rounding tells
        i = 1
        while i < samples - 1 and abs(g[i] - g[0]) <= 1e-13 * size:
            i += 1
        falls = g[i] <= g[0]
    if falls:
        found = keep_peak(peaks, found, t[0], g[0])
    if d[samples - 1] > 0.0:
        found = keep_peak(peaks, found, t[samples - 1], g[samples - 1])
    count = 0
    for i in range(samples - 1):
        width = t[i + 1] - t[i]
        da = d[i]
        db = d[i + 1]
        # a bound on the value inside, from both tangents
        bound = max(g[i] + max(da, 0.0) * width, g[i + 1] + max(-db, 0.0) * width)
        if width <= 0.0 or bound < highest - closeness * abs(highest):
            continue
        slope = (g[i + 1] - g[i]) / width
        if da > 0.0 and db <= 0.0:
            bracket[count, 0] = i
            bracket[count, 1] = cubic_peak(da, db, slope)
            count += 1
        elif (da > 0.0 and db > 0.0) or (da < 0.0 and db < 0.0):
            s = cubic_dip(da, db, slope)
            if s > 0.0:
                bracket[count, 0] = i
                bracket[count, 1] = s
                count += 1
    return count, found


@part
def find_peaks(model, tables, strength, steps, count, damped, sign, closeness, peaks, pull, work):
    """Find the highest peaks of the stored energy g times a sign.

    Only peaks within `closeness` of the highest are refined and kept.

    Constant:
      model: the compiled scene.
      tables: constant arrays of the integrator.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      damped: whether any force depends on velocity.
      sign: 1 for maxima of g, -1 for minima.
      closeness: how near to the highest a peak competes, relative.
    Out:
      peaks (rows, 4): time (s), value of g (J), step, fraction of it; highest first.
      pull (2 or more, n_pair, 3): of which the first two, E_xi at the start and at the end, are written.
      work (WORK,): counts of work, added to.

    Returns how many peaks were kept.
    """
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    q = np.empty(n)
    v = np.empty(n)
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    springs = springs_of(model)
    room = steps.index[count, FIRST] + 2
    t = np.empty(room)
    g = np.empty(room)
    d = np.empty(room)
    samples = 2 + sample(steps, count, damped, t[1:], g[1:], d[1:])
    t = t[:samples]
    g = g[:samples]
    d = d[:samples]
    for i in range(1, samples - 1):
        g[i] *= sign
        d[i] *= sign
    # both ends in one pass: of very many members the pass costs what reading them does. The start may be a stage
    begun = np.int64(1 if steps.scalar[0, 0] == steps.t[0] else 0)
    ends = np.empty((2, n_pair, POSE))
    end_sums = np.empty((2, n_pair, SUMS))
    for end in range(begun, 2):
        state = steps.state[end * count]
        relative_pose(model.pair, model.home, state[0], state[1], ends[end])
    member_sums(springs, strength, ends[begun:], 2 - begun, np.bool_(False), end_sums[begun:])
    work[0] += 2 - begun
    for end in range(2):
        value = steps.scalar[0, ENERGY]
        rate = steps.scalar[0, ENERGY_RATE]
        if end >= begun:
            value, rate = energy_of(ends[end], end_sums[end])
        for p in range(n_pair):
            for j in range(3):
                pull[end, p, j] = end_sums[end, p, 4 + j] if end >= begun else steps.pull[0, p, j]
        i = end * (samples - 1)
        t[i] = steps.t[end * count]
        g[i] = sign * value
        d[i] = sign * rate
    guessed = np.empty(samples, np.bool_)
    for i in range(samples):
        guessed[i] = np.isnan(d[i])
    for i in range(1, samples - 1):
        if guessed[i]:  # the slope of the parabola through the neighbours
            left = (g[i] - g[i - 1]) / (t[i] - t[i - 1])
            right = (g[i + 1] - g[i]) / (t[i + 1] - t[i])
            d[i] = (left * (t[i + 1] - t[i]) + right * (t[i] - t[i - 1])) / (t[i + 1] - t[i - 1])
    bracket = np.empty((samples, 2))
    brackets, found = brackets_of(t, g, d, closeness, bracket, peaks)
    span = t[samples - 1] - t[0] + abs(t[0]) + abs(t[samples - 1])
    for j in range(brackets):
        i = int(bracket[j, 0])
        a = t[i]
        b = t[i + 1]
        crossing = d[i] > 0.0 and d[i + 1] <= 0.0
        time = a + bracket[j, 1] * (b - a)
        # a side is certain where the rate there is known; a guessed one is moved out until it is
        rises = not guessed[i]
        falls = not guessed[i + 1]
        left = i
        right = i + 1
        if not rises:
            left -= 1
            a = t[left]
            rises = not guessed[left] and d[left] > 0.0
        if not falls:
            right += 1
            b = t[right]
            falls = not guessed[right] and d[right] <= 0.0
        # the secant begins with the end that is nearer in rate
        nearer = i if abs(d[i]) < abs(d[i + 1]) else i + 1
        x0 = t[nearer]
        d0 = d[nearer]
        value = g[i]
        turns = False  # the last secant was one of true rates, falling, and its root is where we are
        for visit in range(60):
            k = step_at(steps.t, count, time)
            c = (time - steps.t[k]) / (steps.t[k + 1] - steps.t[k])
            point_of(model, tables, strength, steps, count, k, c, damped, q, v, work)
            work[0] += 1
            value, rate = energy_at(model.pair, model.home, springs, strength, q, v, rel, sums)
            value *= sign
            rate *= sign
            if not crossing and not (d[i] > 0.0 and rate < 0.0) and not (d[i] < 0.0 and rate > 0.0):
                break  # the cubic has an extremum here, the motion has none
            crossing = True
            if rate > 0.0:
                a = time
                rises = True
            else:
                b = time
                falls = True
            if rate == 0.0 or b - a <= 4e-16 * span:
                break
            step = -rate * (time - x0) / (rate - d0) if rate != d0 else 0.0
            turns = (visit > 0 or not guessed[nearer]) and (rate - d0) * (time - x0) < 0.0
            if turns and abs(step) <= 1e-14 * span:
                break  # before rounding says that the root lies outside the bracket
            x0 = time
            d0 = rate
            following = time + step
            if not rises and following <= a and left > 0:
                left -= 1
                a = t[left]
                rises = not guessed[left] and d[left] > 0.0
            if not falls and following >= b and right < samples - 1:
                right += 1
                b = t[right]
                falls = not guessed[right] and d[right] <= 0.0
            if step == 0.0 or not (following > a and following < b):
                following = 0.5 * (a + b)
                turns = False
            if abs(following - time) <= 1e-14 * span:
                break
            time = following
        if crossing and ((rises and falls) or turns):
            known = False  # brackets that were widened may share a peak
            for r in range(found):
                known = known or abs(peaks[r, TIME] - time) <= 1e-10 * span
            if not known:
                found = keep_peak(peaks, found, time, value)
    if found == 0:
        best = 0
        for i in range(samples):
            if g[i] > g[best]:
                best = i
        found = keep_peak(peaks, found, t[best], g[best])
    kept = 1
    while kept < found and peaks[kept, VALUE] >= peaks[0, VALUE] - closeness * abs(peaks[0, VALUE]):
        kept += 1
    for i in range(kept):
        k = step_at(steps.t, count, peaks[i, TIME])
        peaks[i, VALUE] *= sign
        peaks[i, STEP] = k
        peaks[i, FRACTION] = (peaks[i, TIME] - steps.t[k]) / (steps.t[k + 1] - steps.t[k])
    return kept
