"""Members that compete for the largest force of their group: every one that comes near it has peaks of its own.

Following the largest member at each time would hide the others, and where they cross the maximum has a kink. Here each
one that competes is followed by itself, through its own peaks; the highest of all of them is the maximum over members
and time.
"""

import numpy as np

from mdstopo.case.methods.over_time import ReductionKind
from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.general_model import MEMBER_FORCE, SUBJECT
from mdstopo.general.peaks.peak_search import MEAN_ALIKE, RATES_ALIKE, RISE_MARGIN
from mdstopo.general.responses.extremes import FRACTIONS, row_of
from mdstopo.general.responses.general_responses import members_of
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: members that are followed at most, unless more rows than these are asked for
FOLLOWED = 12
#: members times places at which forces are computed in one pass over the motion, for the memory they take; more need a
#: second pass, with those alone that come near the largest
AT_ONCE = 2**21
#: error of the samples of a force, relative: they lie on the steps' quintic
SAMPLE_ERROR = 0.02
#: peaks are at most so many times the largest sample of a force
BETWEEN = 2.0


def compete(kind: int, reduction: ReductionKind) -> bool:
    """Whether the members behind a response of this kind compete for its extreme, with this reduction."""
    return kind == MEMBER_FORCE and (reduction.is_largest or reduction.at_end)


def members_peaks(
    driver: DriverWithRun, j: int, t: FloatArray, final: bool, window: float, most: int
) -> list[FloatArray]:
    """The peaks over time of the members' forces from which response j is the largest, as rows of `extremes`.

    driver: with a finished run. j: the response.
    t (m + 1,): the steps' times (s).
    final: whether the values at the end are meant instead of peaks.
    window: how far below the highest a peak may be, relative to it.
    most: how many peaks are wanted at most; it decides which members are followed, the rows may be more.
    """
    count = len(t) - 1
    ends = driver.steps_are_fine  # then samples inside steps are needed here and there only
    fractions = np.array([0.0, 1.0] if ends else FRACTIONS)
    places = np.array([[count - 1.0, 1.0]]) if final else _places(np.arange(count), fractions)
    members = np.arange(members_behind(driver, j))
    at_once = not final and len(members) * len(places) <= AT_ONCE
    nobody = np.zeros(0, dtype=np.int64)
    top, seen_all = compare(driver, j, places, members if at_once else nobody, count)
    least = (1.0 - window) * float(top.max())
    height = _heights(top, seen_all.reshape(-1, count, len(fractions), 2), t, fractions, least) if at_once else top
    near = np.flatnonzero(height >= least)
    who = np.sort(near[np.argsort(-height[near], kind="stable")[: max(FOLLOWED, most)]])
    if final:
        seen = [driver.evaluate_one(j, count, places[0], who=int(i)).copy() for i in who]
        return [row_of(t[-1], s[0], count - 1, 1.0, s[1], 1.0, i) for s, i in zip(seen, who.tolist(), strict=True)]
    seen_all = seen_all[who] if at_once else compare(driver, j, places, who, count)[1]
    seen_all = seen_all.reshape(len(who), count, len(fractions), 2)
    limit = _limit(top, least, most)
    plain = None
    if ends:
        seen_all, plain = _inside(driver, j, t, who, seen_all, limit)
    rows = []
    for i, seen_one in zip(who.tolist(), seen_all, strict=True):
        own = min(window, 1.0 - limit / height[i]) if height[i] > 0.0 else window
        force, rate = np.moveaxis(seen_one, 2, 0)
        sign = np.where(force >= 0.0, 1.0, -1.0)
        samples = np.stack([sign * force, sign * rate, np.full(force.shape, float(i))], axis=2)
        rows += list(driver.peaks_of_pieces(j, count, t, samples, 1.0, own, who=i, plain=plain))
    return rows


def _heights(top: FloatArray, seen: FloatArray, t: FloatArray, fractions: FloatArray, least: float) -> FloatArray:
    """How high the force of each member may be (N): its largest sample, or, where that is below `least`, what its
    tangents at samples allow. Where it rises at one sample and falls at the next they meet at or above what lies
    between, if that bends downwards throughout.

    top (M,): the largest sample of each member (N).
    seen (M, m, F, 2): forces (N) and rates (N/s) at these fractions of every step.
    t (m + 1,): the steps' times (s). fractions (F,): of steps.
    """
    height = top.copy()
    doubtful = np.flatnonzero((top < least) & (top >= least / BETWEEN))
    sign = np.where(seen[doubtful, ..., 0] >= 0.0, 1.0, -1.0)
    force, rate = (sign * seen[doubtful, ..., k] for k in range(2))
    before, after, rise, fall = force[..., :-1], force[..., 1:], rate[..., :-1], -rate[..., 1:]
    h = np.diff(t)[:, None] * np.diff(fractions)
    peaked = (rise > 0.0) & (fall > 0.0)
    both = np.where(peaked, rise + fall, 1.0)
    meeting = np.where(peaked, before + rise * np.clip((after - before + fall * h) / both, 0.0, h), 0.0)
    height[doubtful] = np.maximum(top[doubtful], meeting.max(axis=(1, 2), initial=0.0))
    return height


def _places(steps: IndexArray, fractions: FloatArray) -> FloatArray:
    """(K, 2): all these fractions of all these steps."""
    return np.column_stack([np.repeat(steps, len(fractions)), np.tile(fractions, len(steps))])


def _inside(
    driver: DriverWithRun, j: int, t: FloatArray, who: IndexArray, ends: FloatArray, limit: float
) -> tuple[FloatArray, IndexArray]:
    """Forces and rates at all FRACTIONS, from those at the ends of the steps.

    driver: with a finished run. j: the response.
    t (m + 1,): the steps' times (s).
    who (C,): the members.
    ends (C, m, 2, 2): their forces (N) and rates (N/s) at both ends of every step.
    limit: force below which no peak is wanted (N).

    Returns (C, m, FRACTIONS, 2), NaN inside steps that can have no peak; and (m,), 1 for these.
    """
    sign = np.where(ends[..., 0] >= 0.0, 1.0, -1.0)
    (a, b), (da, db) = (np.moveaxis(sign * ends[..., k], 2, 0) for k in range(2))
    h = np.diff(t)
    # as `peak_search.has_no_peak`
    uneven = np.abs(b - a - 0.5 * h * (da + db))
    least = np.minimum(np.abs(da), np.abs(db))
    low = RISE_MARGIN * (h * (np.abs(da) + np.abs(db)) + uneven) < limit - np.maximum(a, b)
    even = (da * db > 0.0) & (np.abs(db - da) <= RATES_ALIKE * least) & (uneven <= MEAN_ALIKE * h * least)
    plain = np.all(low | even, axis=0).astype(np.int64)
    steps, inner = np.flatnonzero(plain == 0), np.array(FRACTIONS[1:-1])
    found = np.full((len(who), len(h), len(FRACTIONS), 2), np.nan)
    found[:, :, 0], found[:, :, -1] = ends[:, :, 0], ends[:, :, 1]
    seen = compare(driver, j, _places(steps, inner), who, len(h))[1]
    found[:, steps, 1:-1] = seen.reshape(len(who), len(steps), len(inner), 2)
    return found, plain


def _limit(top: FloatArray, least: float, most: int) -> float:
    """The value below which no peak is among the `most` highest that are at least `least`, by the highest of each
    member (M,).

    So many members have a peak at least as high as the last of them. Samples lie beside the motion by what the steps'
    quintic is off.
    """
    if len(top) >= most:
        least = max(least, float(np.partition(top, -most)[-most]))
    return (1.0 - SAMPLE_ERROR) * least


def compare(
    driver: DriverWithRun, j: int, places: FloatArray, who: IndexArray, count: int, exact: bool = False
) -> tuple[FloatArray, FloatArray]:
    """The largest |f*| of every member (N), and f* with its rate of some (N, N/s).

    driver: with a finished run. j: the response, which names the group. count: how many steps the run has.
    places (K, 2): steps and fractions of them.
    who (C,): the members whose force and rate are asked for; none costs least.
    exact: whether states inside steps are the integrator's own, not those of the quintic through both ends.

    Returns (members of the group,) and (C, K, 2).
    """
    top, seen = np.zeros(members_behind(driver, j)), np.zeros((len(who), len(places), 2))
    driver.entry.compare(
        driver.entry.TAG, driver.ints, driver.floats, driver.method.tables, driver.limits, count, driver.room,
        driver.room_ints, driver.member_state, exact, j, places, who, top, seen, driver.work,
    )  # fmt: skip
    return top, seen


def members_behind(driver: DriverWithRun, j: int) -> int:
    """How many members the group has whose forces response j is."""
    model = driver.scene.model
    return int(members_of.py_func(model, model.response[j, SUBJECT]))  # type: ignore[attr-defined]
