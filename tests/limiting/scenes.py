"""Small cases whose limiting performance is known."""

import json
from typing import Any

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case

Section = dict[str, Any]

SPRING: Section = {"type": "spring", "stiffness": 4000, "damping": 20}


def case_of(**sections: Any) -> Case:
    """A body `load` of 10 kg, free in the plane and tied to the ground by one spring; sections replace or add.

    load: further keys of the body; law: of the spring.
    """
    law = sections.pop("law", SPRING)
    load = {"mass": 10, "inertia": 1, "position": [0, 0], **sections.pop("load", {})}
    case: Section = {
        "format": 1,
        "time": {"end": 1},
        "bodies": {"load": load},
        "members": {
            "tie": {"from": {"body": "ground", "at": [-1, 0]}, "to": {"body": "load", "at": [0, 0]}, "law": law}
        },
        "objectives": {"G": peak("acceleration")},
    }
    case |= sections
    if len(case["objectives"]) > 1:
        case["combine"] = {"weights": dict.fromkeys(case["objectives"], 1)}
    return read_case(json.dumps(case))


def peak(kind: str, component: str = "norm", over: str = "max", body: str = "load", **more: Any) -> Section:
    """An objective, or the response of a limit."""
    seen = {"body": body, "component": component}
    seen |= {key: more.pop(key) for key in ("relative_to", "at") if key in more}
    return {"response": {kind: seen}, "over_time": over, **more}


def sled(table: list[list[float]], **more: Any) -> Section:
    """Sections of a load on a sled with a prescribed acceleration along x."""
    return {
        "bodies": {
            "load": {"mass": 10, "inertia": 1, "position": [0, 0]},
            "sled": {"mass": 100, "inertia": 10, "position": [0, 0], "velocity": [0, 0]},
        },
        "motions": [
            {"body": "sled", "x": {"acceleration": {"table": table}}, "y": {"velocity": 0}, "angle": {"velocity": 0}}
        ],
        "members": {
            "tie": {"from": {"body": "sled", "at": [-1, 0]}, "to": {"body": "load", "at": [0, 0]}, "law": SPRING}
        },
        **more,
    }
