"""Which member of a group leads, that is carries the largest force, and from when to when.

In every step each member's force f*(t) is smooth. |f_a| = |f_b| where f_a - f_b or f_a + f_b vanishes: smooth functions
both, whose roots are looked for between samples so near together that a cubic through values and rates tells all but
the narrowest leads; where it does not tell, the motion itself is sampled (`lead_changes`). Only those members are
compared that a bound on their cubics lets lead between two samples. Forces that are the same at all samples of a step
(laws of time alone, actuators at their limit, symmetry) do not cross between them.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.model.general_model import KIND, MEMBER_FORCE
from mdstopo.general.over_time.competing_members import compare, members_behind
from mdstopo.general.over_time.lead_changes import MAY_LEAD, lead_changes
from mdstopo.general.over_time.piece import Piece, add_piece, distinct_cuts
from mdstopo.general.responses.extremes import FRACTIONS
from mdstopo.general.responses.general_responses import TIE
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: samples of a step in which several members may lead
FINE = np.linspace(0.0, 1.0, 17)
#: forces computed in one go, of all members at all samples
BATCH = 4_000_000
#: the largest value of the cubics h10 and h11 of Hermite, which go with the rates
BEND = 4.0 / 27.0


def pieces_by_member(driver: DriverWithRun, j: int, t: FloatArray) -> list[Piece]:
    """The pieces in which one member carries the largest force of response j, in order of time; t (m + 1,): the steps'
    times."""
    count, members = len(t) - 1, members_behind(driver, j)
    if members == 1:
        return [Piece(w, 0.0, 1.0, 0) for w in range(count)]
    pieces: list[Piece] = []
    batch = max(1, BATCH // (members * len(FINE)))
    for first in range(0, count, batch):
        steps = np.arange(first, min(first + batch, count))
        for piece in _in_steps(_Group(driver, j, t), steps, np.arange(members)):
            add_piece(pieces, piece)
    return pieces


def is_led(driver: DriverWithRun, j: int) -> bool:
    """Whether response j is the largest of the forces of several members."""
    return bool(driver.scene.model.response[j, KIND] == MEMBER_FORCE) and members_behind(driver, j) > 1


class _Group:
    """The forces of the members of a group along the last motion.

    driver: of the load case. j: the response, whose group it is. t (m + 1,): the steps' times (s).
    """

    def __init__(self, driver: DriverWithRun, j: int, t: FloatArray) -> None:
        self._driver, self._j, self._lengths = driver, j, np.diff(t)

    def sampled(self, steps: IndexArray, fractions: FloatArray, who: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Forces f* of some members and their rates, at the same fractions of several steps, on the quintics through
        the steps' ends.

        steps (W,): which steps. fractions (K,): at which parts of each step, 0 to 1, evenly spaced from 0 to 1.
        who (C,): numbers of the members within the group.

        Returns f* (N) and its rate per interval between two fractions (N), both (C, W, K).
        """
        places = np.stack(np.broadcast_arrays(steps[:, None], fractions[None, :]), axis=-1).astype(np.float64)
        _, seen = compare(self._driver, self._j, places.reshape(-1, 2), who, len(self._lengths))
        shaped = seen.reshape(len(who), len(steps), len(fractions), 2)
        interval = self._lengths[steps] / (len(fractions) - 1)
        return shaped[..., 0].copy(), shaped[..., 1] * interval[None, :, None]

    def exact(self, steps: IndexArray, fractions: FloatArray, who: IndexArray) -> tuple[FloatArray, FloatArray]:
        """Forces (C, K) (N) of some members `who` (C,) on the motion itself, and their rates per step (N), each at a
        fraction (K,) of a step (K,)."""
        order = np.lexsort([fractions, steps])  # the kernel goes from step to step
        places = np.column_stack([steps, fractions])[order]
        new = np.append(True, np.any(np.diff(places, axis=0) != 0.0, axis=1))[: len(places)]
        where = np.empty(len(order), dtype=np.int64)
        where[order] = np.cumsum(new) - 1
        seen = compare(self._driver, self._j, places[new], who, len(self._lengths), True)[1][:, where]
        return seen[..., 0], seen[..., 1] * self._lengths[steps]


def _in_steps(group: _Group, steps: IndexArray, everyone: IndexArray) -> Iterator[Piece]:
    """The pieces of some steps (W,), each with the member that leads in it, in order of time.

    everyone (M,): the numbers of all members of the group.
    """
    force, rate = group.sampled(steps, np.array(FRACTIONS), everyone)
    may = np.asarray(_may_lead(force, rate).any(axis=2))
    leader = np.abs(force[:, :, len(FRACTIONS) // 2]).argmax(axis=0)
    for i in np.flatnonzero(may.sum(axis=0) > 1).tolist():
        who = np.flatnonzero(may[:, i])
        may[:, i] = False
        may[who[_different(force[who, i])], i] = True
    shared = np.flatnonzero(may.sum(axis=0) > 1)
    cuts: dict[int, list[float]] = {int(w): [] for w in steps[shared]}
    who = np.flatnonzero(may[:, shared].any(axis=1))
    may = may[np.ix_(who, shared)]
    for w, fraction in _changes(group, steps[shared], who, may):
        cuts[w].append(fraction)
    parts = {w: np.array([*distinct_cuts([0.0, *own]), 1.0]) for w, own in cuts.items()}
    leads = _leading(group, parts, who, may)
    for w, alone in zip(steps.tolist(), leader.tolist(), strict=True):
        if w not in parts:
            yield Piece(w, 0.0, 1.0, alone)
            continue
        for low, high in zip(parts[w][:-1].tolist(), parts[w][1:].tolist(), strict=True):
            yield Piece(w, low, high, next(leads))


def _may_lead(force: FloatArray, rate: FloatArray) -> NDArray[np.bool_]:
    """(C, ..., K - 1) which members may lead between samples (C, ..., K); rates per interval between two samples."""
    size = np.abs(force)
    bend = BEND * (np.abs(rate[..., :-1]) + np.abs(rate[..., 1:]))
    highest = np.maximum(size[..., :-1], size[..., 1:]) + bend
    turns = force[..., :-1] * force[..., 1:] <= 0.0
    lowest = np.where(turns, 0.0, np.minimum(size[..., :-1], size[..., 1:]) - bend)
    found: NDArray[np.bool_] = highest >= (1.0 - MAY_LEAD) * np.maximum(lowest.max(axis=0), 0.0)
    return found


def _different(force: FloatArray) -> IndexArray:
    """Of members with samples force (C, K), one of each that have the same |f*| at all of them."""
    size = np.abs(force)
    same = TIE * float(size.max())
    if np.diff(np.sort(size[:, 0])).min(initial=np.inf) > same:
        return np.arange(len(force))
    kept = np.zeros(len(force), dtype=bool)
    for i in range(len(force)):
        kept[i] = not np.any(np.abs(size[kept] - size[i]).max(axis=1) <= same)
    return np.flatnonzero(kept)


def _changes(group: _Group, steps: IndexArray, who: IndexArray, may: NDArray[np.bool_]) -> Iterator[tuple[int, float]]:
    """Steps and fractions of them at which the lead may pass to another member, in order of time.

    steps (W,): in which several members may lead. who (C,): members. may (C, W): which of them may lead in which step.
    """
    if not len(steps):
        return
    force, rate = group.sampled(steps, FINE, who)

    def exact(step: IndexArray, fraction: FloatArray, members: IndexArray) -> tuple[FloatArray, FloatArray]:
        force, rate = np.empty(members.shape), np.empty(members.shape)
        at_once = max(1, BATCH // len(who))
        for first in range(0, len(step), at_once):
            part = slice(first, first + at_once)
            some, own = np.unique(members[:, part], return_inverse=True)
            seen = group.exact(steps[step[part]], fraction[part], who[some])
            own, at = own.reshape(members[:, part].shape), np.arange(members[:, part].shape[1])
            force[:, part], rate[:, part] = seen[0][own, at], seen[1][own, at]
        return force, rate

    step, fraction = lead_changes(force, rate, _may_lead(force, rate) & may[:, :, None], FINE, exact)
    yield from zip(steps[step].tolist(), fraction.tolist(), strict=True)


def _leading(group: _Group, parts: dict[int, FloatArray], who: IndexArray, may: NDArray[np.bool_]) -> Iterator[int]:
    """The member that leads in each part of each step, in order of time, by the exact forces in the middle of it:
    mostly the whole step is one part.

    parts: by step the fractions between which its parts are. who (C,): members. may (C, W): which may lead in a step.
    """
    if not parts:
        return
    row = np.repeat(np.arange(len(parts)), [len(ends) - 1 for ends in parts.values()])
    step = np.array(list(parts))[row]
    middle = np.concatenate([0.5 * (ends[:-1] + ends[1:]) for ends in parts.values()])
    at_once = max(1, BATCH // len(who))
    for first in range(0, len(middle), at_once):
        some = slice(first, first + at_once)
        size = np.where(may[:, row[some]], np.abs(group.exact(step[some], middle[some], who)[0]), -1.0)
        yield from who[(size >= (1.0 - TIE) * size.max(axis=0)).argmax(axis=0)].tolist()
