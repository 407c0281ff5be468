"""The page on result files names every dataset that commands write, and no other."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import h5py
import pytest

from mdstopo.cli.group import run_group
from mdstopo.session.run_session import run_session
from tests.fakes import FakeEngineWithEvaluations, hand_made_case, limited

from .pages import DOCS, blocks

PAGE = (DOCS / "results.md").read_text(encoding="utf-8")
#: what only the program reads
OWN = ("catalogue/search/", "optimizer/", "combine/tasks/", "pareto/tasks/", "sweep/tasks/")
JOINTED = """\
format: 1
time: {end: 0.1}
bodies: {arm: {mass: 1, inertia: 1, position: [1, 0]}}
joints: [{name: pin, type: revolute, bodies: [ground, arm], at: [0, 0]}]
motions: [{body: arm, angle: {acceleration: {file: turn.csv}}}]
"""
VARIED = """\
format: 1
time: {end: 0.1}
bodies: {cart: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0]}}
members:
  spring: {from: {body: ground, at: [0, 0]}, to: {body: cart, at: [1, 0]}, law: {type: spring, stiffness: 9}}
design: {variables: {k: {group: spring, parameter: stiffness, lower: 1, upper: 20}}}
objectives:
  E: {response: energy, over_time: mean}
  X: {response: {displacement: {body: cart}}, over_time: mean}
combine: {weights: {E: 1, X: 1}, normalize: false}
optimizer: {starts: 2, max_iterations: 1}
"""
STAGED = VARIED.replace("  X: ", "#").replace("combine:", "#").replace("design: {", "design: {power: [1, 2], ")
SOLD = STAGED.replace("power: [1, 2]", "catalogue: {spring: [0, 0.5, 1]}")

PRICED = """\
format: 1
time: {end: 0.1}
bodies: {cart: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0]}}
points:
  wall: {body: ground, grid: {line: {from: [0, -1], to: [0, 1], count: 3}}}
  front: {body: cart, grid: {line: {from: [0.9, -0.1], to: [0.9, 0.1], count: 3}}}
members: {ties: {from: wall, to: front, law: {type: spring, stiffness: 9}, candidates: priced}}
design: {lower: 0}
objectives: {E: {response: energy, over_time: mean}}
constraints: [{volume: all, equals: 1}]
optimizer: {max_iterations: 1}
"""

FITTED = """\
format: 1
time: {end: 0.1}
bodies: {cart: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0]}}
fit:
  estimate:
    bodies.cart.velocity[0]: {lower: 0, upper: 3}
    bodies.cart.position[0]: {lower: 0.5, upper: 1.5}
  measured:
    way: {file: way.csv, response: {displacement: {body: cart, component: x}}, delay: {lower: -0.01, upper: 0.01}}
"""

UNCERTAIN = """\
uncertainty: {parameters: {bodies.cargo.mass: {normal: {deviation: 5}}}, sample: 4, validation: 30}
"""


def named() -> dict[str, str]:
    """The paths in the tables and in the sentence on scales, each with the pattern that it stands for."""
    cells = re.findall(r"^\| (`.*?`) \|", PAGE, re.MULTILINE)
    scales = re.search(r"scales of the axes:(.*?)\.\n", PAGE, re.DOTALL)
    assert scales is not None
    paths = [path for cell in [*cells, scales[1]] for path in re.findall(r"`([^`]+)`", cell)]
    attributes = ("format", "mdstopo", "kind", "status", "reason", "name", "title", "case_path", "case_sha256")
    found = {}
    for path in paths:
        if path not in attributes:
            parts = re.split(r"<[^>]+>|\.\.\.", path)
            found[path] = "[^/]+".join(re.escape(part) for part in parts)
    return found


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """The datasets in one file of each kind."""
    folder = tmp_path_factory.mktemp("results")
    (boat,) = [block for block in blocks(PAGE) if block.title == "boat.yaml"]
    (folder / boat.title).write_text(boat.text, encoding="utf-8")
    (folder / "windy.yaml").write_text(boat.text + UNCERTAIN, encoding="utf-8")
    (folder / "jointed.yaml").write_text(JOINTED, encoding="utf-8")
    (folder / "varied.yaml").write_text(VARIED, encoding="utf-8")
    (folder / "staged.yaml").write_text(STAGED, encoding="utf-8")
    (folder / "sold.yaml").write_text(SOLD, encoding="utf-8")
    (folder / "priced.yaml").write_text(PRICED, encoding="utf-8")
    (folder / "fitted.yaml").write_text(FITTED, encoding="utf-8")
    (folder / "way.csv").write_text("0.02, 0.03\n0.04, 0.07\n0.06, 0.1\n0.08, 0.14\n", encoding="utf-8")
    (folder / "turn.csv").write_text("0, 1\n1, 2\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as there:
        there.chdir(folder)
        for command in (
            "simulate jointed.yaml",
            "simulate boat.yaml",
            "run boat.yaml",
            "run windy.yaml",
            "run boat.yaml --alpha results/boat.simulate.h5 --out results/again.h5",
            "gradient boat.yaml --history --differences --members 2",
            "pareto boat.yaml --points 3 --starts 1",
            "run varied.yaml",
            "run staged.yaml",
            "run sold.yaml",
            "run priced.yaml",
            "sweep set priced.yaml members.ties.law.stiffness=8,9",
            "gradient varied.yaml --history --differences",
            "pareto varied.yaml --points 4 --starts 1",
            "sweep set varied.yaml members.spring.law.stiffness=8,9 optimizer.starts=1",
            "fit fitted.yaml --profile 1",
            "sweep set boat.yaml members.belts.law.stiffness=4000,5000 optimizer.max_iterations=1",
        ):
            assert run_group([*command.split(), "--quiet"]) == 0, command
    # designs that cannot be computed
    failing = partial(FakeEngineWithEvaluations, fail_from=5)
    case = replace(limited(hand_made_case(), 6), files={})
    run_session(case, path=folder / "results" / "failing.h5", engine=failing)
    found: set[str] = set()
    for path in sorted(Path(folder, "results").glob("*.h5")):
        with h5py.File(path) as file:
            file.visititems(lambda name, node: found.add(name) if isinstance(node, h5py.Dataset) else None)
    return {path for path in found if not path.startswith(OWN)}


def test_every_dataset_of_a_result_is_on_the_page(written: set[str]) -> None:
    patterns = list(named().values())
    assert sorted(path for path in written if not any(re.fullmatch(pattern, path) for pattern in patterns)) == []


def test_every_dataset_on_the_page_is_in_a_result(written: set[str]) -> None:
    told = named()
    assert len(told) > 50
    assert [path for path, pattern in told.items() if not any(re.fullmatch(pattern, found) for found in written)] == []


def test_every_attribute_on_the_page_is_in_a_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "case.yaml").write_text(JOINTED.replace("motions", "# motions"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert run_group(["simulate", "case.yaml", "--quiet"]) == 0
    with h5py.File(tmp_path / "results" / "case.simulate.h5") as file:
        there = set(file.attrs)
    section = PAGE.partition("Attributes of the file itself:")[2].partition("| path |")[0]
    cells = re.findall(r"^\| (`.*?`) \|", section, re.MULTILINE)
    assert {name for cell in cells for name in re.findall(r"`(\w+)`", cell)} == there
