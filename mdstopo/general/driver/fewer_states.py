"""Fewer states from which the same prices follow, for passes over many candidates.

Where a candidate stays in its mode through some steps, its price is a sum over all their stages. These lie near each
other on the motion, so that what any candidate does at one of them is a sum of what it does at a few, with shares that
are the same for all candidates: elongation, its rate, and how it changes with the pose are smooth in the pose, and so
are their products, of which forces are made. With the few states k, and their virtual changes

    u'_k = sum over stages s of  share_sk u_s ,

sums over stages are sums over the few, to rounding. Which states are taken, and the shares, follow from what some
candidates do (an interpolative decomposition, by Gram and Schmidt with pivots), for 2 steps, 4 and so on behind each
other. It does not hold for candidates that are shorter than these, and than the way that ends move in the steps.
"""

from typing import NamedTuple

import numpy as np

from mdstopo.general.model.priced_candidates import (
    BEHIND_FEW,
    FIRST_FEW,
    FIRST_STAGE,
    KIND,
    LAST_STAGE,
    TOGETHER_LEVELS,
    WHOLE,
)
from mdstopo.general.pricing.sampled_works import OF_CHANGES, OF_ELONGATION, OF_INVERSE, OF_RATE
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: how far what follows from a few states may be off, relative to the largest of its kind
EXACT = 5e-15
#: elongations are taken relative to how much they change in the steps, and to this part of the largest one at
#: least: of smaller changes rounding is left
LEAST_RANGE = 0.05
#: how many candidates are sampled, half of them short: from this part of all lengths on, which leaves out those whose
#: ends meet, to another one
SAMPLED, SHORT_FROM, SHORT_TO = 24, 0.02, 0.25
#: others have to be as long as the shortest of these behind so many of the longest ways of an end
FURTHER = 1.25


class FewerStates(NamedTuple):
    """The states of a run over which forces are summed.

    Behind the states of the run there are K further ones: state (K,) says of which of the run's states each is a copy,
    change (K, D) and energy (K,) are its virtual change and weight. few, nearest: as of
    `priced_candidates.PricedCandidates`, with numbers among all these.
    """

    few: IndexArray
    nearest: FloatArray
    state: IndexArray
    change: FloatArray
    energy: FloatArray


class _SummedStates(NamedTuple):
    """States over which some steps are summed: their numbers, virtual changes and weights."""

    state: IndexArray
    change: FloatArray
    energy: FloatArray


def all_stages(step: IndexArray) -> tuple[IndexArray, FloatArray]:
    """`few` and `nearest` where sums go over the stages themselves; step (n_step, 5): as of `PricedCandidates`."""
    few, nearest = np.zeros((len(step), TOGETHER_LEVELS, 2), dtype=np.int64), np.zeros((len(step), TOGETHER_LEVELS))
    few[:, 0, FIRST_FEW], few[:, 0, BEHIND_FEW] = step[:, FIRST_STAGE], step[:, LAST_STAGE]
    nearest[:, 0] = np.inf
    return few, nearest


def fewer_states(
    step: IndexArray, works: FloatArray, degree: int, change: FloatArray, energy: FloatArray
) -> FewerStates:
    """The fewer states of a run.

    step (n_step, 5): as of `PricedCandidates`, numbers among the run's states. works (T, 3 + D, M): what some
    candidates do there (`sampled_works.sample_works`). degree: of forces in elongations. change (T, D), energy (T,):
    virtual changes and weights.
    """
    few, nearest = all_stages(step)
    none = _SummedStates(np.zeros(0, dtype=np.int64), change[:0], energy[:0])
    if not len(works):
        return FewerStates(few, nearest, *none)
    sampled = _SampledWorks(works, degree)
    known: dict[int, _SummedStates] = {}
    for s in np.flatnonzero(step[:, KIND] == WHOLE).tolist():
        stages = np.arange(*step[s, [FIRST_STAGE, LAST_STAGE]])
        known[s] = _SummedStates(stages, change[stages], energy[stages])
    found: list[_SummedStates] = []
    count = len(works)
    for level in range(1, TOGETHER_LEVELS):
        long, half, before, known = 1 << level, 1 << (level - 1), known, {}
        for s in before:
            if s % long == 0 and s + half in before:
                own = _fewer_of(sampled, before[s], before[s + half])
                if own is not None:
                    known[s] = own
                    found.append(own)
                    few[s, level] = count, count + len(own.state)
                    stages = np.arange(step[s, FIRST_STAGE], step[s + long - 1, LAST_STAGE])
                    nearest[s, level] = sampled.nearest(stages, int(own.state[0]))
                    count += len(own.state)
    return FewerStates(few, nearest, *(np.concatenate(each) for each in zip(none, *found, strict=True)))


def _fewer_of(sampled: "_SampledWorks", one: _SummedStates, other: _SummedStates) -> _SummedStates | None:
    """The states of two parts of a motion behind each other, as few as will do; the first is in their middle."""
    state, change, energy = (np.concatenate(both) for both in zip(one, other, strict=True))
    if not len(state):
        return None
    chosen, share = _chosen(sampled.at(state))
    if not chosen:
        return None
    apart = np.abs(state[chosen] - 0.5 * (state.min() + state.max()))
    middle = int(np.argmin(apart))
    order = [middle, *(k for k in range(len(chosen)) if k != middle)]
    share = share[:, order]
    return _SummedStates(state[[chosen[k] for k in order]], _shared(share, change), _shared(share, energy))


class _SampledWorks:
    """What some candidates do at the states of a run, of which forces and energies are made.

    works, degree: as of `fewer_states`.
    """

    def __init__(self, works: FloatArray, degree: int) -> None:
        works = works[:, :, _sampled(works[:, OF_INVERSE])]
        largest = np.abs(works).max(axis=(0, 2), initial=np.finfo(float).tiny, keepdims=True)
        scaled = works / largest
        self._elongation, self._rate, self._along = scaled[:, OF_ELONGATION], scaled[:, OF_RATE], scaled[:, OF_CHANGES:]
        axes = 2 if works.shape[1] == OF_CHANGES + 3 else 3
        self._length = 1.0 / works[:, OF_INVERSE]
        self._apart = works[:, OF_CHANGES : OF_CHANGES + axes] * self._length[:, None]
        self._degree = degree

    def at(self, states: IndexArray) -> FloatArray:
        """Products of powers of elongations with changes and rates, and powers alone (states, any)."""
        own = self._elongation[states]
        off = own - own.mean(axis=0)
        off /= max(float(np.abs(off).max(initial=0.0)), LEAST_RANGE)
        powers = [off**power for power in range(self._degree + 2)]
        along = self._along[states]
        found = [along * power[:, None] for power in powers[: self._degree + 1]]
        found += [along * self._rate[states][:, None], np.stack(powers, axis=1)]
        return np.concatenate(found, axis=1).reshape(len(states), -1)

    def nearest(self, states: IndexArray, middle: int) -> float:
        """The largest inverse length (1/m) at a state with which candidates do what those that are known do, at the
        states of some steps."""
        way = np.linalg.norm(self._apart[states] - self._apart[middle], axis=1).max(initial=0.0)
        return float(1.0 / (FURTHER * way + self._length[states].min(initial=np.inf)))


def _sampled(inverse: FloatArray) -> IndexArray:
    """Numbers of the candidates that are sampled; inverse (T, M): inverse lengths (1/m) at states, 0 where none."""
    order = np.argsort(-np.where(inverse > 0.0, inverse, np.inf).max(axis=0), kind="stable")
    shares = (
        np.linspace(SHORT_FROM, SHORT_TO, SAMPLED // 2, endpoint=False),
        np.linspace(SHORT_TO, 1.0, SAMPLED // 2),
    )
    chosen = order[np.unique((np.concatenate(shares) * (len(order) - 1)).astype(np.int64))]
    found: IndexArray = chosen[(inverse[:, chosen] > 0.0).all(axis=0)]
    return found


def _shared(share: FloatArray, values: FloatArray) -> FloatArray:
    """What values (n, ...) at states become at the few; share (n, few)."""
    # sums that do not depend on how many threads a library takes
    found: FloatArray = (share.reshape(*share.shape, *(1,) * (values.ndim - 1)) * values[:, None]).sum(axis=0)
    return found


def _chosen(values: FloatArray) -> tuple[list[int], FloatArray]:
    """Of some states (n, any) those from which all others follow, and the shares (n, few); none where rounding leaves
    others off by more than is allowed."""
    left, allowed = values.copy(), EXACT * np.sqrt((values * values).sum(axis=1).max())
    chosen: list[int] = []
    count = np.zeros((len(values), 0))
    basis = np.zeros((0, 0))
    while len(chosen) < len(values):
        square = (left * left).sum(axis=1)
        own = int(square.argmax())
        size = np.sqrt(square[own])
        if size <= allowed:
            break
        direction = left[own] / size
        by_own = np.append(-(count[own][:, None] * basis).sum(axis=0), 1.0) / size
        more = (left * direction).sum(axis=1)
        left -= more[:, None] * direction
        left[own] = 0.0
        count = np.hstack([count, more[:, None]])
        basis = np.vstack([np.pad(basis, ((0, 0), (0, 1))), by_own])
        chosen.append(own)
    share = (count[:, :, None] * basis).sum(axis=1)
    share[chosen] = np.eye(len(chosen))
    off = values.copy()
    for k, own in enumerate(chosen):
        off -= share[:, k, None] * values[own]
    if not (off * off).sum(axis=1).max() <= (4.0 * allowed) ** 2:
        return [], share
    return chosen, share
