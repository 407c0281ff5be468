"""What is packaged agrees with the project: the conda recipe, the Dockerfile, and the scenes of the wheel's kernels."""

import json
import re
import runpy
import tomllib
from pathlib import Path
from typing import Any

import yaml

from mdstopo import __version__, load_case
from mdstopo.case.integrators import INTEGRATORS
from mdstopo.case.shipped import names
from mdstopo.cli.new import templates
from mdstopo.scene.refusals import refusals

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


def test_kernels_are_shipped_for_every_case_template_gallery_problem_and_integrator(tmp_path: Path) -> None:
    commands = runpy.run_path(str(ROOT / "packaging/ship_kernels.py"))["commands"](tmp_path)
    run = {words[1] for words in commands if words[0] == "run"}
    assert set(names()) <= run
    assert {f"{name}.yaml" for name in templates()} <= run
    assert {str(path) for path in (ROOT / "gallery").glob("*.yaml")} <= run
    said = {word for words in commands for word in words}
    assert {f"solver.integrator={name}" for name in INTEGRATORS} <= said


def test_the_kinds_of_cases_that_kernels_are_shipped_for_can_be_computed() -> None:
    kinds = sorted((ROOT / "packaging/kinds").glob("*.yaml"))
    assert len(kinds) > 3
    for path in kinds:
        assert refusals(load_case(path)) == [], path


def test_an_entry_that_no_command_has_called_is_named(tmp_path: Path) -> None:
    without_code = runpy.run_path(str(ROOT / "packaging/ship_kernels.py"))["without_code"]
    entries = without_code(tmp_path)
    assert len(entries) > 40
    assert {"mdstopo.general.direct.push", "mdstopo.sensitivity.candidate_prices.price_candidates"} <= set(entries)
    (tmp_path / "mdstopo.general.direct.push-0123.code").touch()
    assert set(entries) - set(without_code(tmp_path)) == {"mdstopo.general.direct.push"}
