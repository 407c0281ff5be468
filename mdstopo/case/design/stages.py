"""Powers that an optimisation goes through, one stage each: `design.power` as a list."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

from mdstopo.case.model import Case
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text


def stage_count(case: Case) -> int:
    """The number of stages of a case, in each of which a run finds an optimum; 1 for most."""
    return max([1, *(len(group.powers) for group in case.design_groups)])


def stage_case(case: Case, stage: int) -> Case:
    """The case with the powers of one stage, from 0, and no other stages; lists that have ended stay at their last
    power."""
    return replace(
        case,
        members=tuple(
            replace(group, power=group.powers[min(stage, len(group.powers) - 1)], powers=()) if group.powers else group
            for group in case.members
        ),
    )


def powers_of(stated: Any) -> dict[str, Any]:
    """`power` and `powers` of a group, from a number or a list as read."""
    if not isinstance(stated, list):
        return {"power": stated, "powers": ()}
    return {"power": stated[-1], "powers": tuple(stated) if len(stated) > 1 else ()}


def lowest(values: dict[str, Any]) -> Any:
    """The lowest power that a group has in any stage, from what `powers_of` gives."""
    return values["powers"][0] if values["powers"] else values["power"]


def check_powers(design: Fields, top: Fields, reading: Reading) -> bool:
    """Whether lists of powers rise, in a case that can be solved in stages; notes what does not."""
    good = True
    for path, powers in _lists(design):
        if any(power is BAD for power in powers):
            good = False
            continue
        for k, (before, power) in enumerate(pairwise(powers), start=1):
            if not power > before:
                words = f"found {number_text(power)}, allowed is > {number_text(before)}, the power before it"
                reading.mistake(f"{path}[{k}]", words)
                good = False
        if len(powers) > 1:
            for key, what in without_stages(top):
                words = f"found a list of {len(powers)} powers, allowed is one power where there {what} ({key})"
                reading.mistake(path, words)
                good = False
    return good


def _lists(design: Fields) -> Iterator[tuple[str, list[Any]]]:
    """The lists of powers and their places."""
    stated, path = design["power"], inside(design.path, "power")
    if isinstance(stated, list):
        yield path, stated
    elif isinstance(stated, dict):
        for name, powers in stated.items():
            if isinstance(powers, list):
                yield inside(path, name), powers


def without_stages(top: Fields) -> Iterator[tuple[str, str]]:
    """What of a case rules out stages, of which the choice of sizes is one: the key, and what stands there in words."""
    if isinstance(top["objectives"], dict) and len(top["objectives"]) > 1:
        yield "objectives", "are several objectives"
    if top["uncertainty"] is not None:
        yield "uncertainty", "are uncertain values"
