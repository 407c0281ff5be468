"""Members of two cases are the same by their groups and ends, not by their numbers."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.plots.same_members import same_members
from mdstopo.report.difference import difference

HEAD = """
format: 1
time: {end: 1}
bodies: {box: {mass: 1, inertia: 1, position: [0, 0]}}
"""
TAIL = """design: {initial: 1, lower: 1, upper: 1}
objectives: {G: {response: energy}}
"""


def final(members: dict[str, tuple[float, float, float]]) -> str:
    """A final case: of each group of one the place on the box, that on ground, and its stiffness."""
    lines = [
        f"  {name}: {{from: {{body: box, at: [{a}, 0]}}, to: {{body: ground, at: [{b}, 1]}}, "
        f"law: {{type: spring, stiffness: {k}}}}}"
        for name, (a, b, k) in members.items()
    ]
    return f"{HEAD}members:\n" + "\n".join(lines) + f"\n{TAIL}"


def source_of(text: str) -> Any:
    case = read_case(text)
    view = SimpleNamespace(arrays={}, kind="simulate", status="done", settings={}, provenance={}, path="none")
    return SimpleNamespace(
        case=case, stated=case, alpha=np.ones(case.n_design), design=np.ones(case.n_design), view=view, names=()
    )


def pairs(first: str, second: str) -> list[tuple[str, str]]:
    cases = [read_case(text) for text in (first, second)]
    names = [[group.name for group in case.members for _ in range(len(group))] for case in cases]
    return [(names[0][i], names[1][k]) for i, k in same_members(*cases)]


def test_members_of_final_designs_are_the_same_by_group_and_ends_whatever_their_numbers() -> None:
    first = final({"belt_1": (0, 0, 5), "belt_2": (0, 1, 5), "rod_1": (0, 0, 5)})
    second = final({"belt_1": (0, 1, 5), "rod_4": (0, 0, 5), "belt_2": (0, 2, 5), "belt_7": (0, 0, 5)})
    assert pairs(first, second) == [("belt_1", "belt_7"), ("belt_2", "belt_1"), ("rod_1", "rod_4")]


def test_members_of_another_group_are_others_though_their_ends_are_the_same() -> None:
    first, second = final({"belt_1": (0, 0, 5), "rod_2": (0, 1, 5)}), final({"rod_1": (0, 0, 5), "belt_9": (1, 1, 5)})
    assert pairs(first, second) == []


def test_a_group_that_is_called_otherwise_is_compared_by_its_ends_alone_in_either_order() -> None:
    first = final({"belt": (0, 0, 5), "belt_1": (0, 1, 5)})
    second = final({"strap": (0, 0, 5), "strap_1": (0, 1, 5)})
    ends = "from: {body: box, at: [0, 0]}, to: {body: ground, at: [0, 1]}"
    turned = "from: {body: ground, at: [0, 1]}, to: {body: box, at: [-0.0, 1e-17]}"
    assert ends in second
    assert pairs(first, second.replace(ends, turned)) == [("belt", "strap"), ("belt_1", "strap_1")]


@pytest.mark.parametrize("swapped", [False, True])
def test_a_difference_of_final_designs_names_the_members_that_only_one_has(swapped: bool) -> None:
    first = final({"belt_1": (0, 0, 5), "belt_2": (0, 1, 5)})
    second = final({"belt_1": (0, 1, 6), "belt_2": (0, -2.5, 5)})
    one, other = (second, first) if swapped else (first, second)
    found = difference(source_of(one), source_of(other))
    stiff = "belt_1" if swapped else "belt_2"
    changed = {pair.name: (pair.first, pair.second) for pair in found.case}
    assert changed.pop(f"members.{stiff}.law.stiffness") == ((6, 5) if swapped else (5, 6))
    # the others are there in one alone, and no key tells the one from the other
    assert sorted((a is None, b is None) for a, b in changed.values()) == [(False, True), (True, False)]
    assert found.designs is not None
    told = (found.designs.members_first, found.designs.members_second)
    assert (told[::-1] if swapped else told) == (
        ["belt_1: box (0, 0) to ground (0, 1)"], ["belt_2: box (0, 0) to ground (-2.5, 1)"]
    )  # fmt: skip
    assert (found.designs.common, found.designs.changed) == (1, 0)
