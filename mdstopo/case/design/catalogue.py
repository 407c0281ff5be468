"""Sizes that members can be bought in: `design.catalogue`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from mdstopo.case.design.stages import without_stages
from mdstopo.case.model import Case, MemberGroup
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text, shown

#: sizes of a group's members, and their prices
Sizes = tuple[tuple[float, ...], tuple[float, ...]]


def with_catalogue(top: Fields, groups: dict[str, MemberGroup], reading: Reading) -> dict[str, Sizes] | None:
    """By group: sizes that members may have, and their prices. None where something is wrong, which is noted.

    groups: with the design's bounds and powers.
    """
    design = top["design"]
    stated = design["catalogue"] if isinstance(design, Fields) else None
    if stated is BAD:
        return None
    found: dict[str, Sizes] = {}
    good = True
    path = inside(design.path, "catalogue") if stated else ""
    for key, what in without_stages(top) if stated else ():
        reading.mistake(path, f"found a catalogue, allowed is none where there {what} ({key})")
        good = False
    for name, entry in (stated or {}).items():
        place = inside(path, name)
        if entry is BAD or name not in groups:
            good = False
            continue
        group = groups[name]
        if not group.design:
            reading.mistake(place, f"{shown(name)} has `design: false`: its alpha is 1 and no variable")
            good = False
            continue
        if group.candidates is not None:
            reading.mistake(
                place, f"the candidates of {shown(name)} are priced; sizes are chosen of members that are built"
            )
            good = False
            continue
        pair = _sizes(entry, group, place, reading)
        good &= pair is not None
        if pair is not None:
            found[name] = pair
    tied = [*((design["mirrored"] or ()) if stated and design.good("mirrored") else ())]
    for i, names in enumerate(tied):
        if len({found.get(name) for name in names}) > 1:
            message = "member k of each has the same alpha, so each needs the same catalogue, or none"
            reading.mistake(inside(design.path, f"mirrored[{i}]"), message)
            good = False
    return found if good else None


def _sizes(entry: Any, group: MemberGroup, path: str, reading: Reading) -> Sizes | None:
    """Sizes and prices of one group; None where something is wrong, which is noted."""
    is_record = isinstance(entry, Fields)
    if is_record and not entry.good():
        return None
    where = inside(path, "sizes") if is_record else path
    sizes = entry["sizes"] if is_record else entry
    prices = (entry["prices"] if is_record else None) or sizes
    if any(each is BAD for each in (*sizes, *prices)):
        return None
    good = _within(sizes, group, where, reading)
    if len(prices) != len(sizes):
        reading.mistake(
            inside(path, "prices"), f"found {len(prices)} prices, needed is one for each of {len(sizes)} sizes"
        )
        return None
    for k, (before, price) in enumerate(pairwise(prices), start=1):
        if price < before:
            words = f"found {number_text(price)}, allowed is at least {number_text(before)}, the price before it"
            reading.mistake(f"{inside(path, 'prices')}[{k}]", words)
            good = False
    return (tuple(sizes), tuple(prices)) if good else None


def _within(sizes: Sequence[float], group: MemberGroup, path: str, reading: Reading) -> bool:
    """Whether sizes rise, and alpha of a group's members may be each of them; notes which may not."""
    good = True
    for k, (before, size) in enumerate(pairwise(sizes), start=1):
        if not size > before:
            words = f"found {number_text(size)}, allowed is > {number_text(before)}, the size before it"
            reading.mistake(f"{path}[{k}]", words)
            good = False
    lowest = min((group.power, *group.powers))
    for k, size in enumerate(sizes):
        if size > group.upper or 0.0 < size < group.lower:
            allowed = (
                f"0, or {number_text(group.lower)} to {number_text(group.upper)}, the bounds of {shown(group.name)}"
            )
            reading.mistake(f"{path}[{k}]", f"found {number_text(size)}, allowed is {allowed}")
            good = False
        elif size == 0.0 and lowest < 1.0:
            reading.mistake(
                f"{path}[{k}]", f"found 0, allowed is > 0 where power is below 1 (here {number_text(lowest)})"
            )
            good = False
    return good


def has_catalogue(case: Case) -> bool:
    """Whether members of some group have sizes to choose from."""
    return any(group.sizes for group in case.design_groups)
