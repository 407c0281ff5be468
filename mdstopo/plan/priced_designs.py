"""Designs of a case whose candidates are priced, each with the members that it has, as arrays of numbers.

Such designs travel between tasks of a front: each task builds the members that it needs. An array has, group by group
in the case's order, alpha of a group that is built; of a priced one how many members there are, the points at their
ends, and alpha.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case, MemberGroup
from mdstopo.case.scene.candidates import Pairs, with_members

Floats = NDArray[np.float64]


class _Part(NamedTuple):
    """A group's members in a design: the points at their ends, none of a group that is built; alpha."""

    group: MemberGroup
    pairs: Pairs | None
    alpha: Floats


def packed(case: Case, x: Floats) -> Floats:
    """A design as one array, from the optimiser's x (n,); of priced groups it has the members with alpha > 0."""
    pieces: list[Floats] = []
    alpha = case.space.expand(x)
    for group in case.design_groups:
        own = alpha[case.group_slices[group.name]]
        if group.candidates is not None:
            kept = own > 0.0
            kept[:1] |= not kept.any()  # no group is empty
            own = own[kept]
            ends = np.concatenate([group.from_index[kept], group.to_index[kept]])
            pieces += [np.array([float(len(own))]), ends.astype(np.float64)]
        pieces.append(own)
    return np.concatenate(pieces)


def unpacked(case: Case, design: Floats) -> tuple[Case, Floats]:
    """The case with a design's members and those it has itself, and x (n,), 0 of the latter."""
    pairs = {part.group.name: part.pairs for part in _parts(case, design) if part.pairs is not None}
    built = with_members(case, {name: _united([own, _ends(case, name)]) for name, own in pairs.items()})
    return built, in_case(built, design)


def with_all(case: Case, designs: Iterable[Floats]) -> Case:
    """The case with all the members that designs have, and no others; as it is where there are no designs."""
    found: dict[str, list[Pairs]] = {}
    for design in designs:
        for part in _parts(case, design):
            if part.pairs is not None:
                found.setdefault(part.group.name, []).append(part.pairs)
    return with_members(case, {name: _united(pairs) for name, pairs in found.items()}) if found else case


def in_case(built: Case, design: Floats) -> Floats:
    """(n,) the x of a design in a case that has all of the design's members, and perhaps more."""
    alpha = np.zeros(built.n_design)
    for part in _parts(built, design):
        own = alpha[built.group_slices[part.group.name]]
        if part.pairs is None:
            own[:] = part.alpha
        else:
            width = len(part.group.to_local)
            known = part.group.from_index * width + part.group.to_index
            own[np.searchsorted(known, part.pairs[0] * width + part.pairs[1])] = part.alpha
    return built.space.reduce(alpha)


def _ends(case: Case, name: str) -> Pairs:
    group = next(each for each in case.members if each.name == name)
    return group.from_index, group.to_index


def _united(several: list[Pairs]) -> Pairs:
    """All pairs, each once, in the order of the product."""
    i, j = np.unique(np.concatenate([np.stack(pairs) for pairs in several], axis=1), axis=1)
    return i, j


def _parts(case: Case, design: Floats) -> Iterator[_Part]:
    """A design group by group."""
    place = 0
    for group in case.design_groups:
        if group.candidates is None:
            count = len(group)
            pairs = None
        else:
            count = int(design[place])
            ends = design[place + 1 : place + 1 + 2 * count].astype(np.intp).reshape(2, count)
            pairs = ends[0], ends[1]
            place += 1 + 2 * count
        yield _Part(group, pairs, design[place : place + count])
        place += count
