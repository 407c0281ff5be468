"""A distribution made on the spot brings a law and a response: read, run, differentiated, resumed and described."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.keys.brought_records import Brought, BroughtError
from mdstopo.cli.group import run_group
from mdstopo.store.result_reader import read_result

ROOT = Path(__file__).resolve().parents[2]

DECLARED = '''
from __future__ import annotations

from typing import ClassVar

from mdstopo.case.objects.problem_parts import Response
from mdstopo.case.keys.kinds import POSITIVE, Ref
from mdstopo.case.laws.law import Law, free_length_key
from mdstopo.case.keys.records import Key, Record
from mdstopo.case.responses.response_kinds import ResponseKind
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class SaturatingLaw(Law):
    """A spring whose force stays below a limit."""

    type: ClassVar[str] = "saturating"
    kind: ClassVar[str] = "passive"
    doc: ClassVar[str] = "Passive: f = F tanh(k Delta / F)."
    kernels: ClassVar[str] = "straps.kernels"

    stiffness: float = stated(POSITIVE, "k at Delta = 0", unit="N/m", scales=True, varies=True)
    most: float = stated(POSITIVE, "F", unit="N", scales=True, varies=True)
    free_length: float | None = free_length_key()


def made(word, keys, frames, reading):
    return Response(word, body=keys["body"], numbers=(keys["factor"],))


POWER = ResponseKind(
    word="kinetic",
    doc="a factor times the square of the speed of a body",
    unit="m^2/s^2",
    kernels="straps.kernels:KINETIC",
    keys=Record(
        "a square of a speed",
        (
            Key("body", Ref("body"), "whose centre of mass it is", required=True),
            Key("factor", POSITIVE, "that it is multiplied by", default=1.0),
        ),
    ),
    made=made,
    order=1,
)
'''

KERNELS = """
import math

from mdstopo.compiler.jit import inline, kernel
from mdstopo.general.responses.response_kernels import ResponseKernels
from mdstopo.mechanics.laws.law_kernels import LawKernels


@inline
def force(p, x):
    share = math.tanh(p[0] * x / p[1])
    log_cosh = math.log(math.cosh(p[0] * x / p[1]))
    return p[1] * share, p[0] * (1.0 - share * share), 0.0, p[1] * p[1] / p[0] * log_cosh, p[1] * share


@inline
def slopes(p, place, x):
    f, f_x, _, energy, _ = force(p, x)
    if place == 0:
        return x * f_x / p[0], (x * f - energy) / p[0]
    return (f - x * f_x) / p[1], (2.0 * energy - x * f) / p[1]


@kernel
def kinetic(model, j, v, bars):
    factor = model.response_par[j, 0]
    place = 3 * model.response[j, 1]
    total = 0.0
    for d in range(place, place + 2):
        total += factor * v[d] * v[d]
        bars[1, d] += 2.0 * factor * v[d]
    return total


KERNELS = LawKernels(force=force, slopes=slopes)
KINETIC = ResponseKernels(value=kinetic, needs_accelerations=False, by_state=True)
"""

POINTS = """
[mdstopo.laws]
saturating = straps.declared:SaturatingLaw

[mdstopo.responses]
kinetic = straps.declared:POWER
"""

CASE = """
format: 1
gravity: [0, -9.81]
time: {end: 0.3}
bodies:
  load: {mass: 20, inertia: 0.5, position: [0, 0], velocity: [1, 0]}
points:
  corners: {body: load, grid: {rectangle: {center: [0, 0], size: [0.4, 0.4], count: 4}}}
  hooks: {body: ground, grid: {list: [[-1, 1], [1, 1]]}}
members:
  straps: {from: corners, to: hooks, law: {type: saturating, stiffness: 8000, most: 150}}
design:
  initial: 0.5
  variables: {most: {group: straps, parameter: most, lower: 50, upper: 300}}
objectives:
  V: {response: {kinetic: {body: load, factor: 0.5}}, over_time: mean}
  G: {response: energy}
constraints: [{volume: all, fraction: 0.6}]
combine: {weights: {V: 1, G: 1}, method: weighted_sum, normalize: false}
optimizer: {preset: default, starts: 1, max_iterations: 4}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the distribution and a case."""
    place = tmp_path_factory.mktemp("straps")
    (place / "straps").mkdir()
    for name, text in (("__init__", ""), ("declared", DECLARED), ("kernels", KERNELS)):
        (place / "straps" / f"{name}.py").write_text(text)
    about = place / "straps-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: straps\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(POINTS)
    (place / "work").mkdir()
    (place / "work" / "case.yaml").write_text(CASE)
    return place


def mdstopo(folder: Path, *words: str, status: int = 0) -> str:
    """What the program says, run where the distribution is known."""
    path = [str(ROOT), str(folder), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-m", "mdstopo", *words],
        cwd=folder / "work", env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, path))}, capture_output=True,
        text=True, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout if status == 0 else done.stdout + done.stderr


def test_gradients_with_a_law_and_a_response_from_elsewhere_are_differences(folder: Path) -> None:
    for integrator in ("runge_kutta", "generalized_alpha"):
        step = ["--set", "solver.step=0.001"] if integrator == "generalized_alpha" else []
        said = mdstopo(
            folder,
            "gradient",
            "case.yaml",
            "--differences",
            "--json",
            "--set",
            f"solver.integrator={integrator}",
            *step,
        )
        methods = json.loads(said)["methods"]
        for method in ("adjoint", "direct"):
            assert set(methods[method]["differences"]) == {"V", "G"}
            assert max(methods[method]["differences"].values()) < 1e-6
            assert methods[method]["variables"]["G"]["most"] != [0.0]


def test_a_run_and_a_resumed_one_end_in_the_same_design(folder: Path) -> None:
    mdstopo(folder, "run", "case.yaml", "--out", "whole.h5", "-q")
    mdstopo(folder, "run", "case.yaml", "--out", "parts.h5", "-q", "--set", "optimizer.max_iterations=2")
    mdstopo(folder, "run", "case.yaml", "--out", "parts.h5", "-q", "--resume")
    whole, parts = (read_result(folder / "work" / name) for name in ("whole.h5", "parts.h5"))
    assert np.array_equal(whole.arrays["design/alpha"], parts.arrays["design/alpha"])


def test_the_schema_knows_them(folder: Path) -> None:
    text = mdstopo(folder, "schema")
    assert '"saturating"' in text
    assert "a factor times the square of the speed of a body, in m^2/s^2" in text


def test_a_case_that_names_what_nobody_brings_says_what_there_is(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """This process does not know the distribution."""
    assert run_group(["schema"]) == 0
    assert "saturating" not in capsys.readouterr().out
    assert run_group(["check", str(folder / "work" / "case.yaml")]) == 2
    said = capsys.readouterr().err
    assert "members.straps.law.type: found the text 'saturating', did you mean 'spring'?" in said
    assert "unknown key 'kinetic'" in said


def test_a_record_that_cannot_be_used_says_why(tmp_path: Path) -> None:
    (tmp_path / "lost-1.0.dist-info").mkdir()
    (tmp_path / "lost-1.0.dist-info" / "entry_points.txt").write_text("[mdstopo.laws]\nlost = nowhere:Nothing\n")
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "case.yaml").write_text(CASE.replace("saturating", "lost"))
    said = mdstopo(tmp_path, "check", "case.yaml", status=2)
    assert "'lost' of mdstopo.laws (nowhere:Nothing) cannot be used: ModuleNotFoundError" in said
    assert "cannot be used" in mdstopo(tmp_path, "schema", status=1)


def test_nothing_is_looked_for_where_all_is_known() -> None:
    program = (
        "import sys; from mdstopo.case.reader import load_case; load_case(sys.argv[1]); "
        "assert 'importlib.metadata' not in sys.modules"
    )
    case = next((ROOT / "cases").glob("*.yaml"))
    subprocess.run([sys.executable, "-c", program, str(case)], check=True, timeout=120)


def test_a_record_of_another_kind_is_refused() -> None:
    def enter(record: object) -> object:
        raise TypeError(f"found {record!r}")

    brought: Brought[object] = Brought("pytest11", enter)  # imported here anyway
    with pytest.raises(BroughtError, match="cannot be used: TypeError"):
        brought.find_all()
