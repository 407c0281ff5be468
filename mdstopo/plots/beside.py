"""Members between the same two points: each is drawn a little beside the others, so that none hides another."""

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import GROUND, Case
from mdstopo.plots.scenery import Floats

#: of the size of the scene: points that are nearer to each other than that are the same
SAME_POINT = 1e-9
#: points (1/72 inch) that are free between two such members
FREE = 0.6


def side_places(case: Case, chosen: list[NDArray[np.int64]]) -> list[Floats]:
    """Of each group (K,): where its chosen members are drawn beside the line between their ends.

    0 is on the line, 1 is one step to the left of it on the way from the first end to the second. Members that alone
    are between their points are on the line; two of the same points (in either order) are half a step to each side,
    three at -1, 0 and 1. chosen: of each group which members are drawn.
    """
    names = {name: k for k, name in enumerate([*(body.name for body in case.bodies), GROUND])}
    both = list(zip(case.members, chosen, strict=True))
    first = [_ends(names[group.body_from], group.p_local[some]) for group, some in both]
    second = [_ends(names[group.body_to], group.q_local[some]) for group, some in both]
    if not any(len(some) for some in chosen):
        return [np.zeros(0) for _ in chosen]
    pairs = np.stack([np.concatenate(first), np.concatenate(second)], axis=1)
    size = SAME_POINT * max(float(np.abs(pairs[..., 1:]).max()), 1e-300)
    pairs[..., 1:] = np.round(pairs[..., 1:] / size)
    _, number = np.unique(pairs.reshape(-1, pairs.shape[2]), axis=0, return_inverse=True)
    ends = number.reshape(-1, 2)
    backwards = ends[:, 0] > ends[:, 1]
    _, pair, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    pair = pair.ravel()
    order = np.argsort(pair, kind="stable")
    place = np.empty(len(pair))
    place[order] = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count)
    side = (place - 0.5 * (count[pair] - 1)) * np.where(backwards, -1.0, 1.0)
    return np.split(side, np.cumsum([len(some) for some in chosen])[:-1])


def _ends(body: int, local: Floats) -> Floats:
    """(K, 1 + d) ends of members: the number of the body, and where they are on it."""
    return np.column_stack([np.full(len(local), float(body)), local])


def sideways(lines: Floats, side: Floats) -> Floats:
    """(K, 2) by which lines (K, n, 2) on the paper are shifted, in steps: to the left of the way from their first to
    their last corner; a line that is seen end on stays."""
    way = lines[:, -1] - lines[:, 0]
    length = np.hypot(way[:, 0], way[:, 1])
    unit = way / np.where(length > 0.0, length, 1.0)[:, None]
    return np.asarray(side[:, None] * np.stack([-unit[:, 1], unit[:, 0]], axis=1))
