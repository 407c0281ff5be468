"""What the engine cannot compute yet is refused by name, each at its place."""

from __future__ import annotations

from mdstopo.case.reader import read_case
from mdstopo.scene.refusals import refusals

from .scenes import EVERYTHING, SMALL, changed, place


def test_what_the_engine_computes_is_not_refused() -> None:
    assert refusals(read_case(SMALL), optimizing=True) == []


def test_every_part_that_is_not_computed_is_named_at_its_place() -> None:
    found = refusals(read_case(EVERYTHING), optimizing=True)
    assert [m.path_key for m in found] == [
        *(f"joints[{i}]" for i in range(5)),
        "bushings[0]",
        "motions",
        "members.single.law",
        "members.single.law[0].type",
        "members.single.law[0].active_from",
        "members.single.law[0].active_until",
        *(f"members.single.law[{i}].type" for i in range(1, 7)),
        "load_cases.translation.motions",
        *(f"objectives.G{i}.response" for i in range(2, 7)),
        "objectives.G6.over_time",
        "combine",
        "constraints[3]",
        "solver.assemble",
    ]
    by_key = {m.path_key: (m.line, m.column) for m in found}
    assert by_key["members.single.law[2].type"] == place(EVERYTHING, "type: curve", 6)
    assert by_key["solver.assemble"] == place(EVERYTHING, "assemble: true", 10)


def test_several_objectives_are_refused_only_where_one_is_needed() -> None:
    two = "  G: {response: energy}\n  H: {response: energy, over_time: mean}\ncombine: {weights: {G: 1, H: 1}}"
    case = read_case(changed(SMALL, ("  G: {response: energy}", two)))
    assert refusals(case) == []
    assert [m.path_key for m in refusals(case, optimizing=True)] == ["combine"]
