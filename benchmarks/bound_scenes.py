"""Random scenes with a peak acceleration and a travel: what bounds over all members are tried on."""

import json
from typing import Any

import numpy as np

from mdstopo.case.model import Case, VolumeRow
from mdstopo.case.reader import read_case

Scene = dict[str, Any]


def scene(rng: np.random.Generator, kind: str) -> Scene:
    """One scene as the mapping of a case file, with objectives `acceleration` and `travel`, both to be minimised."""
    made: Scene = KINDS[kind](rng)
    made.setdefault("format", 1)
    made.setdefault("design", {"initial": 0.5, "lower": 1e-3, "upper": 1})
    made.setdefault("solver", {"tolerance": 1e-7})
    return made


def with_limit(made: Scene, objective: str, other: str, limit: float) -> Case:
    """The case with one of the two as its objective, and the other one below a limit."""
    bounded = {key: value for key, value in made["objectives"][other].items() if key != "sense"}
    changed = {
        **made,
        "objectives": {objective: made["objectives"][objective]},
        "constraints": [*made.get("constraints", []), {**bounded, "limit": limit}],
    }
    return case_of(changed)


def case_of(made: Scene) -> Case:
    """A mapping as a case; JSON is YAML."""
    made = {**made}
    if len(made["objectives"]) > 1:
        made["combine"] = {
            "method": "weighted_sum",
            "weights": dict.fromkeys(made["objectives"], 1),
            "normalize": False,
        }
    return read_case(json.dumps(made))


def designs(rng: np.random.Generator, case: Case, count: int) -> np.ndarray:
    """(count, N + P) random designs within bounds and volume limits, sparse and dense ones."""
    low, high = case.lower, case.upper
    share = rng.uniform(0.0, 1.0, (count, len(low))) ** rng.uniform(0.3, 4.0, (count, 1))
    found = low + (high - low) * share
    for row in case.constraints:
        if isinstance(row, VolumeRow):
            least = float(row.coefficients @ low)
            room = (row.bound - least) / (found @ row.coefficients - least)
            found = low + (found - low) * np.clip(room, 0.0, 1.0)[:, None]
    for each in case.variables:
        found = np.hstack([found, rng.uniform(each.lower, each.upper, (count, each.count))])
    return found


# -- the kinds


def _body(rng: np.random.Generator, **more: Any) -> Scene:
    return {"mass": _r(rng, 5, 100), "inertia": _r(rng, 0.5, 10), "position": [0, 0], **more}


def _r(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _aims(body: str = "load", other: str = "ground", component: str = "norm", peak: str = "max") -> Scene:
    seen = {"body": body, "component": component}
    return {
        "acceleration": {"response": {"acceleration": seen}, "over_time": peak},
        "travel": {"response": {"displacement": {**seen, "relative_to": other}}, "over_time": peak},
    }


def _anchors(rng: np.random.Generator, count: int, radius: float = 3.0) -> list[list[float]]:
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    return [[float(radius * np.cos(a)), float(radius * np.sin(a))] for a in angles]


def _grid(body: str, points: list[list[float]]) -> Scene:
    return {"body": body, "grid": {"list": points}}


def _shell(rng: np.random.Generator, body: str, at: tuple[float, float] = (0.0, 0.0)) -> Scene:
    size = _r(rng, 0.1, 0.8)
    return {"body": body, "grid": {"rectangle": {"center": list(at), "size": [size, size], "count": 4}}}


def free(rng: np.random.Generator) -> Scene:
    """A body thrown among springs and dampers on the ground."""
    speed, turn = _r(rng, 1, 8), _r(rng, 0, 6.28)
    body = _body(
        rng,
        velocity=[speed * np.cos(turn), speed * np.sin(turn)],
        angular_velocity=_r(rng, -3, 3),
        angle=_r(rng, -1, 1),
    )
    return {
        "gravity": [0, -9.81] if rng.random() < 0.5 else [0, 0],
        "time": {"end": _r(rng, 0.2, 1.2)},
        "bodies": {"load": body},
        "points": {"shell": _shell(rng, "load"), "ring": _grid("ground", _anchors(rng, 5))},
        "members": {"ties": {"from": "shell", "to": "ring", "law": _spring(rng)}},
        "objectives": _aims(),
    }


def _spring(rng: np.random.Generator) -> Scene:
    return {"type": "spring", "stiffness": _r(rng, 50, 3000), "damping": _r(rng, 0, 120)}


def wires(rng: np.random.Generator) -> Scene:
    """A body hung on wires that only pull, most of them slack; loads push it about."""
    made = free(rng)
    made["gravity"] = [0, -9.81]
    law = {
        "type": "gap",
        "stiffness": _r(rng, 500, 20000),
        "damping": _r(rng, 0, 200),
        "gap": _r(rng, 0.0, 0.15),
        "clip": True,
    }
    above = [[float(x), 4.0 + _r(rng, 0, 1)] for x in np.linspace(-1.5, 1.5, 4)]
    made["points"]["ring"] = _grid("ground", above if rng.random() < 0.7 else _anchors(rng, 5))
    made["members"]["ties"]["law"] = law
    made["bodies"]["load"]["angular_velocity"] = 0 if rng.random() < 0.5 else _r(rng, -1, 1)
    end = made["time"]["end"]
    table = [[0, _r(rng, -300, 300), 0], [0.5 * end, 0, _r(rng, -300, 300)], [end, 0, 0]]
    made["loads"] = [{"body": "load", "force": {"table": table}, "moment": _r(rng, -3, 3)}]
    if rng.random() < 0.5:
        made["constraints"] = [{"response": {"angle": {"body": "load"}}, "over_time": "max_abs", "limit": 3.0}]
    return made


def limited(rng: np.random.Generator) -> Scene:
    """A body thrown among reels, crushed legs and pulses: forces have limits, loads may exceed them."""
    made = free(rng)
    laws = [
        {
            "type": "actuator",
            "proportional": _r(rng, 100, 5000),
            "derivative": _r(rng, 0, 300),
            "limit": _r(rng, 20, 300),
        },
        {"type": "crush", "stiffness": _r(rng, 1e4, 1e5), "force": _r(rng, 50, 500), "gap": _r(rng, 0, 0.05)},
        {"type": "pulse", "peak": _r(rng, -300, 300), "rate": _r(rng, 20, 400), "time": _r(rng, 0, 0.4)},
    ]
    made["members"]["ties"]["law"] = laws[int(rng.integers(3))]
    made["members"]["reels"] = {"from": "shell", "to": "ring", "law": laws[int(rng.integers(3))]}
    made["loads"] = [{"body": "load", "force": [_r(rng, -400, 400), _r(rng, -400, 400)]}]
    if rng.random() < 0.5:
        made["constraints"] = [{"volume": "all", "limit": _r(rng, 2, 12)}]
    made["design"] = {"initial": 0.05, "lower": 1e-3, "upper": 1, "power": 1 if rng.random() < 0.6 else 2}
    return made


def rail(rng: np.random.Generator) -> Scene:
    """A carriage on a slanting rail, stopped by slack belts or springs."""
    angle, speed = _r(rng, -0.7, 0.7), _r(rng, 1, 6)
    axis = [float(np.cos(angle)), float(np.sin(angle))]
    body = _body(rng, velocity=[speed * axis[0], speed * axis[1]])
    law = (
        _spring(rng)
        if rng.random() < 0.4
        else {
            "type": "gap",
            "stiffness": _r(rng, 1e3, 2e4),
            "gap": _r(rng, 0.01, 0.2),
            "damping": _r(rng, 0, 100),
            "clip": True,
        }
    )
    behind = [[-3.0 * axis[0] + _r(rng, -0.5, 0.5), -3.0 * axis[1] + _r(rng, -0.5, 0.5)] for _ in range(3)]
    component = ["norm", "x"][int(rng.integers(2))]
    return {
        "gravity": [0, -9.81],
        "time": {"end": _r(rng, 0.3, 1.2)},
        "bodies": {"load": body},
        "joints": [{"type": "prismatic", "bodies": ["ground", "load"], "at": [0, 0], "axis": axis}],
        "points": {"shell": _shell(rng, "load"), "posts": _grid("ground", behind)},
        "members": {"belts": {"from": "shell", "to": "posts", "law": law}},
        "objectives": _aims(component=component, peak="max" if component == "norm" else "max_abs"),
    }


def base(rng: np.random.Generator) -> Scene:
    """A body tied to a sled that is stopped: the isolation of an acceleration pulse."""
    start, peak = _r(rng, 0.0, 0.05), _r(rng, 20, 150)
    width = _r(rng, 0.04, 0.15)
    table = [[start, 0], [start + 0.5 * width, -peak], [start + width, 0]]
    component = ["norm", "x"][int(rng.integers(2))]
    made: Scene = {
        "time": {"end": start + width + _r(rng, 0.05, 0.5)},
        "bodies": {"load": _body(rng, position=[0, 0.6]), "sled": {"mass": 500, "inertia": 100, "position": [0, 0]}},
        "motions": [
            {"body": "sled", "x": {"acceleration": {"table": table}}, "y": {"velocity": 0}, "angle": {"velocity": 0}}
        ],
        "points": {
            "shell": _shell(rng, "load", (0.0, 0.6)),
            "floor": {"body": "sled", "grid": {"line": {"from": [-1.5, 0], "to": [1.5, 0], "count": 5}}},
        },
        "members": {"struts": {"from": "shell", "to": "floor", "law": _spring(rng)}},
        "objectives": _aims(other="sled", component=component, peak="max" if component == "norm" else "max_abs"),
    }
    if rng.random() < 0.4:
        made["joints"] = [{"type": "prismatic", "bodies": ["sled", "load"], "at": [0, 0.6], "axis": [1, 0]}]
    return made


def pair(rng: np.random.Generator) -> Scene:
    """Two carriages on one rail that only push and pull each other: their common centre of mass cannot be helped."""
    bodies = {
        "load": _body(rng, velocity=[_r(rng, 1, 5), 0]),
        "sled": _body(rng, position=[1.5, 0]),
    }
    slides = [
        {"type": "prismatic", "bodies": ["ground", name], "at": body["position"], "axis": [1, 0]}
        for name, body in bodies.items()
    ]
    other = ["ground", "sled"][int(rng.integers(2))]
    return {
        "time": {"end": _r(rng, 0.2, 1.0)},
        "bodies": bodies,
        "joints": slides,
        "points": {"shell": _shell(rng, "load"), "edge": _shell(rng, "sled", (1.5, 0.0))},
        "members": {"buffers": {"from": "shell", "to": "edge", "law": _spring(rng)}},
        "loads": [{"body": "sled", "force": [_r(rng, -200, 200), 0]}],
        "objectives": _aims(other=other, component="x", peak="max_abs"),
    }


def chain(rng: np.random.Generator) -> Scene:
    """A body with another one hinged to it, thrown among springs; its limit is on a point off its centre."""
    made = free(rng)
    velocity = made["bodies"]["load"]["velocity"]
    made["bodies"]["load"]["angular_velocity"] = 0.0
    made["bodies"]["tail"] = _body(rng, position=[1.0, 0.0], velocity=velocity)
    made["joints"] = [{"type": "revolute", "bodies": ["load", "tail"], "at": [0.5, 0]}]
    made["bodies"]["load"]["angle"] = 0.0
    at = [_r(rng, -0.2, 0.2), _r(rng, -0.2, 0.2)]
    made["objectives"]["travel"]["response"]["displacement"]["at"] = at
    made["load_cases"] = {"first": {}, "second": {"gravity": [0, -3]}}
    for each in made["objectives"].values():
        each["load_case"] = "second"
    return made


KINDS = {each.__name__: each for each in (free, wires, limited, rail, base, pair, chain)}
