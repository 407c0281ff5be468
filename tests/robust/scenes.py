"""An uncertain scene of two bodies and forty springs, as case text; JSON is YAML, so a dictionary is enough."""

import json
from typing import Any

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case

PARAMETERS = {
    "bodies.torso.mass": {"normal": {"deviation": 6}},
    "members.belts.law.stiffness": {"lognormal": {"deviation": 400}},
    "loads[0].angular_acceleration": {"uniform": {"from": 15, "to": 25}},
}
SCENARIOS = {
    "turn": {"probability": 0.75},
    "slide": {"probability": 0.25, "set": {"loads[0].acceleration": [14, 1], "time.end": 0.18}},
}


def scene(**changes: Any) -> dict[str, Any]:
    """The scene without anything uncertain."""
    return {
        "format": 1,
        "gravity": [0, -9.8],
        "time": {"end": 0.2},
        "bodies": {
            "torso": {"mass": 60, "inertia": 10, "position": [0, 0]},
            "vehicle": {"mass": 2000, "inertia": 6000, "position": [0, -1]},
        },
        "points": {
            "edge": {
                "body": "torso",
                "grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], "count": 8}},
            },
            "deck": {"body": "vehicle", "grid": {"line": {"from": [-0.8, -1], "to": [0.8, -1], "count": 5}}},
        },
        "members": {"belts": {"from": "edge", "to": "deck", "law": {"type": "spring", "stiffness": 4000}}},
        "loads": [{"body": "vehicle", "acceleration": [9.8, 0], "angular_acceleration": 20}],
        "objectives": {"G": {"response": "energy", "over_time": "max"}},
        "constraints": [{"volume": "all", "equals": 6}],
        **changes,
    }


def uncertain(measure: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """The section with all three kinds of distributions; a measure for the objective G."""
    section: dict[str, Any] = {"parameters": PARAMETERS, "sample": 8, "validation": 60}
    if measure is not None:
        section["objectives"] = {"G": measure}
    return {key: value for key, value in {**section, **changes}.items() if value is not None}


def read(section: dict[str, Any], overrides: dict[str, Any] | None = None, **changes: Any) -> Case:
    """The case of the scene with a section."""
    return read_case(text(section, **changes), overrides=overrides)


def text(section: dict[str, Any], **changes: Any) -> str:
    """The same as text."""
    return json.dumps({**scene(**changes), "uncertainty": section})
