"""Points that are design variables in space: gradients by both methods beside differences, with joints and events."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.design.movable import placed
from mdstopo.case.reader import read_case
from tests.tiers import examples
from tests.variables.support import differences, whole, widths

from .support import CASES

#: by grid of points: where they may be
WITHIN = {
    "pa": {"box": {"from": [0.2, -0.2, -0.5], "to": [0.7, 0.4, 0.1]}},
    "pb": {"line": {"from": [1.3, 0.75, 0.1], "to": [0.9, 0.15, 0.5]}},
    "pg": {"rectangle": {"center": [0.25, 0.35, 0.8], "axes": [[2.5, -1.9, 0.8], [0, 0.8, 1.9]], "size": [6, 4]}},
}


#: one objective of each kind; `direct` goes forward with every variable and looks at every sample with it
SOME = ("rotx", "wn", "dn", "mf", "En", "jfx")


def content(some: tuple[str, ...] = ()) -> dict:
    """The scene, with some of its objectives, or all."""
    scene = yaml.safe_load((CASES / "laws.yaml").read_text())
    scene["points"]["pb"]["grid"]["list"] = [[1.2, 0.6, 0.2], [1.0, 0.3, 0.4]]
    scene["points"]["pg"]["grid"]["list"] = [[1.5, -0.6, 1.2], [-1.0, 1.3, 0.4]]
    for name, within in WITHIN.items():
        scene["points"][name]["movable"] = {"within": within}
    scene["members"]["crush"] = {
        "from": "pg", "to": "pb", "law": {"type": "crush", "stiffness": 400, "force": 6, "gap": 0.01}, "cost": "length",
    }  # fmt: skip
    scene["solver"] = {"tolerance": 1e-11}
    scene["constraints"] = [{"volume": "all", "limit": 100}]
    if some:
        scene["objectives"] = {name: scene["objectives"][name] for name in some}
        scene["combine"]["weights"] = dict.fromkeys(some, 1)
    return scene


@pytest.mark.parametrize("some", [SOME, ()], ids=["some", "all"])
def test_gradients_by_points_are_slopes(some: tuple[str, ...]) -> None:
    case = read_case(yaml.safe_dump(content(some), sort_keys=False))
    assert [each.name for each in case.variables] == ["pa.x", "pa.y", "pa.z", "pb.along", "pg.u", "pg.v"]
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    rng = np.random.default_rng(3)
    for only_points in (True, False)[: examples(1, 2)]:
        direction = 0.05 * rng.normal(size=len(case.start)) * widths(case)
        direction[: case.n_design] *= 1.0 - only_points
        for name, slope in differences(case, case.start, direction, 1e-3).items():
            gradient = whole(found, name)
            assert abs(slope - gradient @ direction) <= 1e-7 * np.abs(gradient * direction).max(), name


@pytest.mark.parametrize("some", [("rotx", "En", "jfx"), SOME], ids=["few", "some"])
def test_direct_agrees_by_points(some: tuple[str, ...]) -> None:
    scene = content(some)
    scene["solver"] = {"tolerance": 1e-7}  # both are derivatives of the same steps, however long these are
    case = read_case(yaml.safe_dump(scene, sort_keys=False))
    found, direct = mdstopo.evaluate(case), mdstopo.evaluate(case, method="direct")
    assert found.status.ok, found.message
    for name in some:
        one, two = whole(found, name), whole(direct, name)
        assert two == pytest.approx(one, abs=1e-9 * np.abs(one).max()), name


def test_moved_points_are_those_of_a_case_that_states_them() -> None:
    case = read_case(yaml.safe_dump(content(), sort_keys=False))
    design = case.start.copy()
    rng = np.random.default_rng(5)
    for each in case.variables:
        part = case.space.parts[each.name]
        design[part] = rng.uniform(each.lower, each.upper, each.count) * 0.2 + 0.8 * design[part]
    stated = content()
    there = placed(case, design)
    for name in WITHIN:
        stated["points"][name] = {
            "body": stated["points"][name]["body"],
            "grid": {"list": there.points[name].world.tolist()},
        }
    alpha, variables = design[: case.n_design], case.space.named(design)
    moved = mdstopo.evaluate(case, alpha, variables=variables, gradient=False)
    fixed = mdstopo.evaluate(read_case(yaml.safe_dump(stated, sort_keys=False)), alpha, gradient=False)
    assert moved.status.ok, moved.message
    for name, value in fixed.objectives.items():
        assert moved.objectives[name] == pytest.approx(value, rel=1e-8, abs=1e-10), name
    assert moved.constraints == pytest.approx(fixed.constraints, rel=1e-12)
