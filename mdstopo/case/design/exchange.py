"""Designs whose members have exchanged their ends on one body: far from a design, and yet alike.

A good design ties two bodies by a few bundles of members. Where such a bundle begins on the one body is kept, where it
ends on the other is drawn anew: alpha of the member from P to Q becomes that of the member from P to R, where R takes
Q's place. From such designs the optimiser comes to other optima. It seldom does from values that are exchanged at
random: a few exchanges it mostly undoes, and many leave nothing of the design (docs/theory/optimiser.md).
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.objects.parts import MemberGroup

#: on which end of the members points take each other's places
Side = Literal["from", "to"]
#: share of a group's members that have to find another in their new place; else its values are exchanged at random
FOUND = 0.5


def exchange_ends(groups: Sequence[MemberGroup], alpha: FloatArray, side: Side, rng: np.random.Generator) -> FloatArray:
    """The design alpha (N,) of these groups, the design's own, with the points of one side exchanged at random."""
    parts, first = [], 0
    for group in groups:
        own = alpha[first : first + len(group)]
        parts.append(own[_places(group, side, rng)])
        first += len(group)
    return np.concatenate([np.zeros(0), *parts])


def _places(group: MemberGroup, side: Side, rng: np.random.Generator) -> IndexArray:
    """For each member (M,), the one whose value it takes: that between its points after the exchange, else itself."""
    n_from, n_to = len(group.from_local), len(group.to_local)
    of_from, of_to = np.arange(n_from), np.arange(n_to)
    if side == "from":
        of_from = rng.permutation(n_from)
    else:
        of_to = rng.permutation(n_to)
    pair = group.from_index * n_to + group.to_index
    wanted = of_from[group.from_index] * n_to + of_to[group.to_index]
    order = np.argsort(pair, kind="stable")
    place = order[np.searchsorted(pair[order], wanted).clip(max=len(pair) - 1)]
    found = pair[place] == wanted
    if found.mean() < FOUND:  # every point has one member, or few: no bundles to be kept
        return np.asarray(rng.permutation(len(pair)))
    return np.asarray(np.where(found, place, np.arange(len(pair))))
