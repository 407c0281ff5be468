"""What is packaged agrees with the project: the conda recipe, the Dockerfile, and the wheel's kernels."""

import json
import re
import runpy
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml

from mdstopo import __version__, load_case
from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.text.shipped import names
from mdstopo.cli.new import templates
from mdstopo.compiler import store
from mdstopo.compiler.entry import Entry, types_of
from mdstopo.scene import design
from mdstopo.scene.refusals import refusals
from tests.entries import held

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def recipe() -> dict[str, Any]:
    """The conda recipe, with its version filled in as conda does."""
    text = (ROOT / "packaging/conda/meta.yaml").read_text()
    (setting,) = re.findall(r"{% set version = load_file_regex\((.*)\).group\(1\) %}\n", text)
    file, pattern = re.findall(r"load_file=\"([^\"]+)\", regex_pattern='([^']+)'", setting)[0]
    found = re.search(pattern, (ROOT / file).read_text())
    assert found
    text = re.sub("{%.*%}", "", text).replace("{{ version }}", found.group(1)).replace("{{ PYTHON }}", "python")
    assert "{{" not in text
    parsed: dict[str, Any] = yaml.safe_load(text)
    return parsed


def test_the_conda_recipe_asks_for_what_the_project_depends_on() -> None:
    found = recipe()
    assert found["package"]["version"] == __version__
    wanted = {f"python {PROJECT['requires-python']}"}
    wanted |= {re.sub(r"([a-z0-9])([<>=])", r"\1 \2", each.lower(), count=1) for each in PROJECT["dependencies"]}
    assert set(found["requirements"]["run"]) == wanted
    assert found["build"]["entry_points"] == [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]
    license_file = ROOT / "packaging" / "conda" / found["source"]["path"] / found["about"]["license_file"]
    assert license_file.is_file()


def test_the_dockerfile_installs_the_wheel_and_runs_the_command_as_no_root() -> None:
    lines = (ROOT / "packaging/Dockerfile").read_text().replace("\\\n", " ").splitlines()
    steps = [tuple(line.split(maxsplit=1)) for line in lines if line and not line.startswith("#")]
    assert {name for name, _ in steps} <= {"FROM", "COPY", "RUN", "USER", "WORKDIR", "ENTRYPOINT", "CMD"}
    assert steps[0][0] == "FROM"
    by_name = dict(steps)  # the last of each
    assert by_name["USER"] != "root"
    assert json.loads(by_name["ENTRYPOINT"]) == list(PROJECT["scripts"])
    assert json.loads(by_name["CMD"]) == ["--help"]
    assert by_name["COPY"].startswith("dist/mdstopo-*.whl ")


def script(name: str) -> dict[str, Any]:
    """What a program of packaging/ defines."""
    return runpy.run_path(str(ROOT / "packaging" / f"{name}.py"))


@pytest.fixture(scope="module")
def ship() -> dict[str, Any]:
    """What compiles the wheel's kernels."""
    return script("ship_kernels")


def test_a_wheel_is_tried_with_every_case_template_gallery_problem_and_integrator() -> None:
    commands = script("try_wheel")["commands"]()
    run = {words[1] for words in commands if words[0] in ("run", "simulate")}
    assert set(names()) <= run
    assert {f"{name}.yaml" for name in templates()} <= run
    assert {str(path) for path in (ROOT / "gallery").glob("*.yaml")} <= run
    said = {word for words in commands for word in words}
    assert {f"solver.integrator={name}" for name in INTEGRATORS} <= said
    assert {"adjoint", "direct", "iterative", "constant_load"} <= said


def test_the_kinds_of_cases_that_kernels_are_shipped_for_can_be_computed() -> None:
    kinds = sorted((ROOT / "packaging/kinds").glob("*.yaml"))
    assert len(kinds) > 3
    for path in kinds:
        assert refusals(load_case(path)) == [], path


def test_the_table_of_entries_has_all_of_them_with_as_many_types_as_they_have_arguments(ship: dict[str, Any]) -> None:
    stated = ship["table"]()
    assert ship["mistakes"](stated) == []
    assert len(set(stated)) == len(stated) > len(ship["entries"]()) > 40
    for each in stated:
        assert types_of(ship["arguments_of"](each.types)) == each.types, each


def test_what_is_wrong_with_the_table_of_entries_is_named(ship: dict[str, Any]) -> None:
    first, second, *others = ship["table"]()
    gone = first._replace(module="mdstopo.gone")
    assert ship["mistakes"]([*others, first, second, gone]) == [
        f"entries.txt: there is no entry mdstopo.gone.{first.name}"
    ]
    without = [each for each in others if each[:2] != first[:2] and each.name != "weigh"]
    (missing,) = {line for line in ship["mistakes"]([first, second, *without]) if "weigh" in line}
    assert missing == "mdstopo.scene.design.weigh has no line in entries.txt"
    (wrong,) = ship["mistakes"]([first, second._replace(types="d1 q1"), *others])
    assert wrong.startswith(f"entries.txt: {second.module}.{second.name} takes ")
    assert wrong.endswith("arguments, not d1 q1")


def test_the_table_has_steps_of_every_integrator_for_the_scenes_that_it_computes(ship: dict[str, Any]) -> None:
    kinds = list(INTEGRATORS.values())
    scenes = len(kinds) + sum(not kind.planar for kind in kinds)
    count = Counter(each.module for each in ship["table"]() if each.name == "simulate")
    assert sum(number for module, number in count.items() if module.startswith("mdstopo.general.")) == scenes
    of_springs = sum(number for module, number in count.items() if module.startswith("mdstopo.integrators."))
    assert of_springs == sum(bool(kind.springs) for kind in kinds)
    assert sum(each.name == "rows_vjp" for each in ship["table"]()) == scenes


def test_an_entry_compiled_for_stated_types_is_found_with_all_that_it_calls(ship: dict[str, Any]) -> None:
    (stated,) = (each for each in ship["table"]() if each.name == "weigh")
    weigh = ship["entries"]()[stated.module, stated.name]
    weigh.compile(*ship["arguments_of"](stated.types))
    name = store.path_of(*stated).name
    code = store.read(store.path_of(*stated))
    assert code is not None
    assert set(ship["_files"](name)) >= {name, *code.needs}
    with pytest.raises(SystemExit, match=r"mdstopo.nothing-.*\.code was not written"):
        ship["_files"](store.path_of("mdstopo", "nothing", "d1").name)


def test_a_call_that_the_table_of_entries_does_not_have_is_told() -> None:
    known = Entry(design.weigh.py_func, frozenset())
    held(known, "d1 d1")  # no entry of the package: a test's own
    with pytest.raises(AssertionError, match=r"entries\.txt has no line for this call: mdstopo\..*\.weigh d1 d1$"):
        held(design.weigh, "d1 d1")
