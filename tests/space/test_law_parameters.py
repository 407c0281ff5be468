"""Parameters of every law as variables in space: gradients against differences, and by both methods."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.reader import read_case
from tests.variables.support import differences, whole, widths

from .support import CASES

#: by group: its law, and of which parameters; every group is between the points of the first that is named
LAWS = {
    "one": ({"type": "spring", "stiffness": 80, "damping": 2, "preload": 3, "free_length": 0.5}, None),
    "gap": ({"type": "gap", "stiffness": 200, "gap": 0.02}, None),
    "gapc": ({"type": "gap", "stiffness": 150, "side": "compression", "gap": 0.015}, ("stiffness", "gap")),
    "act": ({"type": "actuator", "proportional": 30, "derivative": 1.5, "target": 0.1}, None),
    "tab": ({"type": "inerter", "inertance": 0.4}, None),
    "lim": (
        {"type": "spring", "stiffness": 40, "active_from": 0.1, "active_until": 0.35},
        ("stiffness", "active_from", "active_until"),
    ),
    "cubic": ({"type": "cubic", "stiffness": 20, "cubic": 300}, None),
    "pulse": ({"type": "pulse", "peak": 5, "rate": 90, "time": 0.3}, None),
    "crush": ({"type": "crush", "stiffness": 400, "force": 6, "gap": 0.01}, None),
}


def content() -> dict:
    scene = yaml.safe_load((CASES / "laws.yaml").read_text())
    scene["solver"] = {"tolerance": 1e-11}
    variables = {}
    for name, (law, varied) in LAWS.items():
        scene["members"].setdefault(name, {"from": "pg", "to": "pa" if name == "cubic" else "pb"})["law"] = law
        for parameter in varied or [key for key in law if key != "type"]:
            value = law[parameter]
            variables[f"{name}_{parameter}"] = {
                "group": name, "parameter": parameter, "initial": value, "lower": 0.1 * value, "upper": 3 * value,
            }  # fmt: skip
    variables["one_damping"]["each"] = "member"
    scene["design"]["variables"] = variables
    return scene


def test_gradients_by_parameters_of_all_laws_are_slopes() -> None:
    case = read_case(yaml.safe_dump(content(), sort_keys=False))
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, method="direct")
    start = np.concatenate([case.initial, *(np.full(each.count, each.initial) for each in case.variables)])
    assert len(start) > case.n_design + 20
    rng = np.random.default_rng(2)
    for only_parameters in (True, False):
        direction = 0.3 * rng.normal(size=len(start)) * widths(case)
        direction[: case.n_design] *= 1.0 - only_parameters
        for name, slope in differences(case, start, direction, 1e-3).items():
            if isinstance(name, str):
                gradient = whole(found, name)
                assert abs(slope - gradient @ direction) <= 1e-8 * np.abs(gradient * direction).max(), name
    for name in found.gradients:
        one, two = whole(found, name), whole(direct, name)
        assert two == pytest.approx(one, abs=1e-9 * np.abs(one).max()), name
