"""Which member of a group leads, that is carries the largest force, and from when to when.

In every step each member's force f*(t) is smooth. |f_a| = |f_b| where f_a - f_b or f_a + f_b vanishes: smooth functions
both, whose roots are looked for between samples so near together that a cubic through values and rates tells all but
the narrowest leads; where it does not tell, the motion itself is sampled. Only those members are compared that a bound
on their cubics lets lead between two samples. Forces that are the same at all samples of a step (laws of time
alone, actuators at their limit, symmetry) do not cross between them.
"""

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.general_model import KIND, MEMBER_FORCE
from mdstopo.general.over_time.competing_members import compare, members_behind
from mdstopo.general.over_time.piece import Piece, add_piece, distinct_cuts
from mdstopo.general.responses.extremes import FRACTIONS
from mdstopo.general.responses.general_responses import TIE
from mdstopo.general.responses.sampled_roots import roots_between
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: samples of a step in which several members may lead
FINE = np.linspace(0.0, 1.0, 17)
#: forces computed in one go, of all members at all samples
BATCH = 4_000_000
#: a member whose cubic stays below the largest force by less than this share of it may lead in truth
CLOSE = 1e-3
#: members that are compared between two samples at most, those with the largest forces
MOST = 12
#: the largest value of the cubics h10 and h11 of Hermite, which go with the rates
BEND = 4.0 / 27.0


def pieces_by_member(driver: DriverWithRun, j: int, t: FloatArray) -> list[Piece]:
    """The pieces in which one member carries the largest force of response j, in order of time; t (m + 1,): the steps'
    times."""
    count, members = len(t) - 1, members_behind(driver, j)
    pieces: list[Piece] = []
    if members == 1:
        return [Piece(w, 0.0, 1.0, 0) for w in range(count)]
    everyone = np.arange(members)
    batch = max(1, BATCH // (members * len(FRACTIONS)))
    for first in range(0, count, batch):
        steps = np.arange(first, min(first + batch, count))
        force, rate = _forces(driver, j, count, steps, np.array(FRACTIONS), everyone)
        rate *= (np.diff(t)[steps] / (len(FRACTIONS) - 1))[None, :, None]
        may = np.asarray(_may_lead(force, rate).any(axis=2))
        leader = np.abs(force[:, :, len(FRACTIONS) // 2]).argmax(axis=0)
        for i, w in enumerate(steps.tolist()):
            who = np.flatnonzero(may[:, i])
            who = who[_different(force[who, i])] if len(who) > 1 else who
            if len(who) < 2:
                pieces.append(Piece(w, 0.0, 1.0, int(leader[i])))
            else:
                pieces += _in_step(driver, j, count, w, float(t[w + 1] - t[w]), who)
    return pieces


def is_led(driver: DriverWithRun, j: int) -> bool:
    """Whether response j is the largest of the forces of several members."""
    return bool(driver.scene.model.response[j, KIND] == MEMBER_FORCE) and members_behind(driver, j) > 1


def _forces(
    driver: DriverWithRun, j: int, count: int, steps: IndexArray, fractions: FloatArray, who: IndexArray
) -> tuple[FloatArray, FloatArray]:
    """Forces f* of some members and their rates, at the same fractions of several steps.

    driver: of the load case; its last motion is sampled, on the quintics through the steps' ends.
    j: the response, whose group the members belong to.
    count: number of steps.
    steps (W,): which steps.
    fractions (K,): at which parts of each step, 0 to 1.
    who (C,): numbers of the members within the group.

    Returns f* (N) and its rate (N/s), both (C, W, K).
    """
    places = np.stack(np.broadcast_arrays(steps[:, None], fractions[None, :]), axis=-1).astype(np.float64)
    _, seen = compare(driver, j, places.reshape(-1, 2), who, count)
    shaped = seen.reshape(len(who), len(steps), len(fractions), 2)
    return shaped[..., 0].copy(), shaped[..., 1].copy()


def _may_lead(force: FloatArray, rate: FloatArray) -> FloatArray:
    """(C, ..., K - 1) which members may lead between samples (C, ..., K); rates per interval between two samples."""
    size = np.abs(force)
    bend = BEND * (np.abs(rate[..., :-1]) + np.abs(rate[..., 1:]))
    highest = np.maximum(size[..., :-1], size[..., 1:]) + bend
    turns = force[..., :-1] * force[..., 1:] <= 0.0
    lowest = np.where(turns, 0.0, np.minimum(size[..., :-1], size[..., 1:]) - bend)
    found: FloatArray = highest >= (1.0 - CLOSE) * np.maximum(lowest.max(axis=0), 0.0)
    return found


def _different(force: FloatArray) -> IndexArray:
    """Of members with samples force (C, K), one of each that have the same |f*| at all of them."""
    kept: list[int] = []
    size = np.abs(force)
    largest = float(size.max())
    for i in range(len(force)):
        if not any(np.abs(size[i] - size[k]).max() <= TIE * largest for k in kept):
            kept.append(i)
    return np.array(kept, dtype=np.int64)


def _in_step(driver: DriverWithRun, j: int, count: int, w: int, h: float, who: IndexArray) -> list[Piece]:
    """The pieces of one step, each with the member that leads in it, in order of time.

    driver: of the load case, with its last motion.
    j: the response, whose group the members belong to.
    count: number of steps.
    w, h: number of the step, its length (s).
    who (C,): numbers within the group of the members that may lead.
    """
    force, rate = (x[:, 0] for x in _forces(driver, j, count, np.array([w]), FINE, who))
    rate *= h / (len(FINE) - 1)

    def exact(fractions: FloatArray, members: IndexArray) -> FloatArray:
        places = np.column_stack([np.full(len(fractions), float(w)), fractions])
        seen: FloatArray = compare(driver, j, places, who[members], count, True)[1][:, :, 0]
        return seen

    may = _may_lead(force, rate)
    cuts = [0.0]
    for k in range(len(FINE) - 1):
        near = np.flatnonzero(may[:, k])
        if len(near) > MOST:
            near = near[np.argsort(-np.abs(force[near, k : k + 2]).max(axis=1), kind="stable")[:MOST]]
        for a, b in combinations(near.tolist(), 2):
            for sign in (1.0, -1.0):
                cuts += _roots(force, rate, k, a, b, sign, exact)
    ends = np.array([*distinct_cuts(sorted(cuts)), 1.0])
    middles = 0.5 * (ends[:-1] + ends[1:])
    # the exact forces in the middle of each piece say who leads there; mostly the whole step is one piece
    size = np.abs(exact(middles, np.arange(len(who))))
    first = (size >= (1.0 - TIE) * size.max(axis=0)).argmax(axis=0)
    pieces: list[Piece] = []
    for low, high, member in zip(ends[:-1].tolist(), ends[1:].tolist(), who[first].tolist(), strict=True):
        add_piece(pieces, Piece(w, low, high, member))
    return pieces


def _roots(
    force: FloatArray,
    rate: FloatArray,
    k: int,
    a: int,
    b: int,
    sign: float,
    exact: Callable[[FloatArray, IndexArray], FloatArray],
) -> Iterator[float]:
    """Fractions of the step at which f_a - sign f_b vanishes between the samples k and k + 1.

    force (C, K): forces at the samples FINE (N).
    rate (C, K): their rates, per interval between two samples (N).
    k: the first of the two samples.
    a, b: the two members, as rows of force and rate.
    sign: 1, or -1 where the forces are equal and opposite.
    exact: forces (members, fractions) on the motion itself (N), by fractions of the step and rows of force.
    """
    d, slope = force[a] - sign * force[b], rate[a] - sign * rate[b]
    largest = float(max(np.abs(force[a]).max(), np.abs(force[b]).max()))
    if float(np.abs(d).max()) <= TIE * largest:
        return
    d0, d1, s0, s1 = float(d[k]), float(d[k + 1]), float(slope[k]), float(slope[k + 1])
    low, high = float(FINE[k]), float(FINE[k + 1])
    pair = np.array([a, b])

    def differences(c: FloatArray) -> FloatArray:
        f = exact(c, pair)
        return np.asarray(f[0] - sign * f[1])

    yield from roots_between((low, high), (d0, d1), (s0, s1), differences)
