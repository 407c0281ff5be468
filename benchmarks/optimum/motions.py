"""Scenes whose motion depends on the design, as case documents: belts with slack, isolators, wires, arms, restraints.

Every one is evaluated within some 50 ms. Numbers are those of a seated occupant, a machine on a floor, a load on
wires: no standard's, and round.
"""

from collections.abc import Mapping, Sequence
from typing import Any

Document = dict[str, Any]


def most(response: Document | str, **more: Any) -> Document:
    """The largest value of a response over time, which `energy` is, too."""
    return {"response": response, "over_time": "max", **more}


def limit(response: Document, value: float, **more: Any) -> Document:
    """A response that may not exceed a value in size."""
    return {"response": response, "over_time": "max_abs", "limit": value, **more}


def acceleration(body: str, **more: Any) -> Document:
    """Of a body's centre of mass."""
    return {"acceleration": {"body": body, **more}}


def displacement(body: str, relative_to: str = "ground", **more: Any) -> Document:
    """Of a body's centre of mass, as another body sees it."""
    return {"displacement": {"body": body, "relative_to": relative_to, **more}}


def angle(body: str, relative_to: str = "ground") -> Document:
    """Of a body against another."""
    return {"angle": {"body": body, "relative_to": relative_to}}


def force(group: str) -> Document:
    """The largest force in a group."""
    return {"member_force": {"group": group}}


def _case(title: str, end: float, **sections: Any) -> Document:
    settings = {"optimizer": {"max_iterations": 200}, "solver": {"tolerance": 1e-7}}
    return {"format": 1, "title": title, "time": {"end": end}, **sections, **settings}


#: a half-sine-like pulse of acceleration, its highest value 1, 80 ms long
PULSE = (
    (0, 0),
    (0.01, 0.38),
    (0.02, 0.71),
    (0.03, 0.92),
    (0.04, 1),
    (0.05, 0.92),
    (0.06, 0.71),
    (0.07, 0.38),
    (0.08, 0),
)


def pulse(peak: float) -> Document:
    """That pulse as a table of time."""
    return {"table": [[t, round(peak * share, 9)] for t, share in PULSE]}


# Isolators.


def isolator(more: Document | None = None) -> Document:
    """One mass that moves at 4 m/s, a spring and a damper, 0.1 m of travel: the best peak is 0.5205986 V^2/D."""
    return _case(
        "A velocity step isolated",
        0.12,
        bodies={"mass": {"mass": 1, "inertia": 1, "position": [0, 0], "velocity": [4, 0]}},
        members={
            "isolator": {
                "from": {"body": "ground", "at": [-10, 0]},
                "to": {"body": "mass", "at": [0, 0]},
                "law": {"type": "spring", "stiffness": 400, "damping": 5},
                "design": False,
            }
        },
        design={
            "variables": {
                "stiffness": {"group": "isolator", "parameter": "stiffness", "lower": 50, "upper": 4000},
                "damping": {"group": "isolator", "parameter": "damping", "lower": 0, "upper": 100},
            }
        },
        objectives={"a": most(acceleration("mass"))},
        constraints=[limit(displacement("mass"), 0.1)],
        **(more or {}),
    )


def machine(limits: Sequence[Document], loads: Document, each: str = "member", **more: Any) -> Document:
    """A machine on six isolators, upright ones and slanting ones, whose dampings vary beside their sizes."""
    feet = [[-0.5, 0], [-0.2, 0], [0.2, 0], [0.5, 0], [-0.5, 0.1], [0.5, 0.1]]
    floor = [[-0.5, -0.4], [-0.2, -0.4], [0.2, -0.4], [0.5, -0.4], [-0.9, -0.4], [0.9, -0.4]]
    return _case(
        "A machine on isolators",
        0.35,
        bodies={
            "machine": {"mass": 200, "inertia": 25, "position": [0.05, 0.3]},
            "floor": {"mass": 1000, "inertia": 1000, "position": [0, -0.6]},
        },
        points={
            "feet": {"body": "machine", "grid": {"list": feet}},
            "floor_points": {"body": "floor", "grid": {"list": floor}},
        },
        members={
            "isolators": {
                "from": "feet",
                "to": "floor_points",
                "connect": "pairs",
                "law": {"type": "spring", "stiffness": 60000, "damping": 400},
            }
        },
        load_cases=loads,
        design={
            "initial": 0.5,
            "lower": 0.01,
            "variables": {
                "damping": {"group": "isolators", "parameter": "damping", "each": each, "lower": 0, "upper": 4000,
                            "cost": 2e-4}
            },
        },
        constraints=[{"volume": "all", "limit": 5}, *limits],
        **more,
    )  # fmt: skip


def shaken(x: float, y: float, turn: float = 0.0) -> Document:
    """A load case in which the floor is shaken."""
    return {
        "motions": [
            {
                "body": "floor",
                "x": {"acceleration": pulse(x)},
                "y": {"acceleration": pulse(y)},
                "angle": {"acceleration": pulse(turn)},
            }
        ]
    }


# Belts with slack.


def belts(
    objectives: Document,
    limits: Sequence[Document],
    cases: Document | None = None,
    count: int = 5,
    slack: float = 0.015,
    fraction: float = 0.3,
    **more: Any,
) -> Document:
    """An occupant tied into a vehicle that stops within 80 ms, by belts that only pull, after a slack."""
    edge = {"rectangle": {"center": [0, 0], "size": [0.4, 0.5], "count": count}}
    frame = {"rectangle": {"center": [0, 0], "size": [1.6, 1.4], "count": count}}
    return _case(
        "Belts with slack",
        0.14,
        bodies={
            "occupant": {"mass": 60, "inertia": 4, "position": [0.02, 0.05], "velocity": [0, 0]},
            "vehicle": {"mass": 2000, "inertia": 2000, "position": [0, -0.1]},
        },
        points={"edge": {"body": "occupant", "grid": edge}, "frame": {"body": "vehicle", "grid": frame}},
        members={
            "belts": {
                "from": "edge",
                "to": "frame",
                "law": {"type": "gap", "stiffness": 40000, "damping": 250, "gap": slack, "clip": True},
            }
        },
        **({"load_cases": cases} if cases else {"motions": stopped(-100)["motions"]}),
        design={"initial": 0.3, "lower": 1e-3},
        objectives=objectives,
        constraints=[{"volume": "all", "fraction": fraction}, *limits],
        **more,
    )


def stopped(x: float, y: float = 0.0, turn: float = 0.0) -> Document:
    """A load case in which the vehicle is stopped."""
    motion = {"x": {"acceleration": pulse(x)}, "y": {"acceleration": pulse(y)}, "angle": {"acceleration": pulse(turn)}}
    return {"motions": [{"body": "vehicle", **motion}]}


# Wires, all of which pull, and compete for the largest force.


def wires(objectives: Document, rows: Sequence[Document], count: int = 6, groups: int = 1, **more: Any) -> Document:
    """A block held by wires under tension from all around, pulled and turned by a load."""
    own = {"circle": {"center": [0, 0], "radius": 0.3, "count": count}}
    members = {}
    points: Document = {"rim": {"body": "block", "grid": own}}
    for g in range(groups):
        ring = {"circle": {"center": [0.1 * g, 0.25 * g], "radius": 1.0 + 0.3 * g, "count": count}}
        points[f"ring{g}"] = {"body": "ground", "grid": ring}
        members[f"wires{g}"] = {
            "from": "rim",
            "to": f"ring{g}",
            "connect": "pairs" if count < 7 else "all",
            "max_length": 1.0 + 0.3 * g,
            "law": {"type": "spring", "stiffness": 20000, "damping": 60, "preload": 100},
        }
    return _case(
        "A block on wires",
        0.3,
        gravity=[0, -9.81],
        bodies={"block": {"mass": 50, "inertia": 2, "position": [0, 0]}},
        points=points,
        members=members,
        loads=[
            {"body": "block", "force": [2000, 600], "at": [0.1, 0.2], "moment": 50},
            {"body": "block", "force": {"table": [[0, 0, 0], [0.1, -1500, 900], [0.2, 0, 0]]}},
        ],
        design={"initial": 0.5, "lower": 0.01},
        objectives=objectives,
        constraints=list(rows),
        **more,
    )


# Arms: jointed bodies that swing.


def _damped(stiffness: float) -> Document:
    return {"type": "spring", "stiffness": stiffness, "damping": 0.01 * stiffness}


def arm(objectives: Document, limits: Sequence[Document], **more: Any) -> Document:
    """Two jointed links on a base that jerks, with springs and dampers to the base and to each other."""
    return _case(
        "An arm on a base that jerks",
        0.4,
        gravity=[0, -9.81],
        bodies={
            "upper": {"mass": 8, "inertia": 0.25, "position": [0, 0.3]},
            "lower": {"mass": 5, "inertia": 0.15, "position": [0, 0.85]},
            "base": {"mass": 500, "inertia": 100, "position": [0, -0.2]},
        },
        joints=[
            {"name": "root", "type": "revolute", "bodies": ["base", "upper"], "at": [0, 0]},
            {"name": "elbow", "type": "revolute", "bodies": ["upper", "lower"], "at": [0, 0.6]},
        ],
        points={
            "upper_points": {"body": "upper", "grid": {"line": {"from": [0, 0.2], "to": [0, 0.5], "count": 3}}},
            "lower_points": {"body": "lower", "grid": {"line": {"from": [0, 0.7], "to": [0, 1.1], "count": 4}}},
            "base_points": {
                "body": "base",
                "grid": {"lattice": {"from": [-0.7, -0.1], "to": [0.7, 0.3], "count": [4, 2]}},
            },
        },
        members={
            "stays": {"from": "base_points", "to": "upper_points", "law": _damped(3000)},
            "guys": {"from": "base_points", "to": "lower_points", "law": _damped(1500)},
            "ties": {"from": "upper_points", "to": "lower_points", "law": _damped(4000)},
        },
        design={"initial": 0.3, "lower": 1e-3},
        objectives=objectives,
        constraints=[{"volume": "all", "fraction": 0.3}, *limits],
        **more,
    )  # fmt: skip


def jerked(x: float, y: float) -> Document:
    """A load case in which the base jerks."""
    motion = {"x": {"acceleration": pulse(x)}, "y": {"acceleration": pulse(y)}, "angle": {"velocity": 0}}
    return {"motions": [{"body": "base", **motion}]}


def restraint(
    objectives: Document, limits: Sequence[Document], count: int = 20, gaps: bool = False, **more: Any
) -> Document:
    """The paper's two bodies (Section IV.A): with 20 points 1020 members. gaps: they only pull, after a slack."""
    lines = [
        {"line": {"from": [-1, -0.8], "to": [-1, 0.8], "count": 17}},
        {"line": {"from": [-0.8, -1], "to": [0.8, -1], "count": 17}},
        {"line": {"from": [1, -0.8], "to": [1, 0.8], "count": 17}},
    ]
    if count < 20:
        for line in lines:
            line["line"]["count"] = 3
    per_member = 1020.0 / (count * 3 * (17 if count == 20 else 3))
    law: Document = {"type": "spring", "stiffness": round(225 * per_member, 6)}
    if gaps:
        law = {"type": "gap", "stiffness": round(1000 * per_member, 6), "damping": 5, "gap": 0.005}
    return _case(
        "Two rigid bodies",
        0.3,
        gravity=[0, -9.8],
        bodies={
            "torso": {"mass": 60, "inertia": 10, "position": [0, 0]},
            "vehicle": {"mass": 2000, "inertia": 6000, "position": [0, -1]},
        },
        points={
            "edge": {"body": "torso", "grid": {"rectangle": {"center": [0, 0], "size": [0.5, 0.5], "count": count}}},
            "frame": {"body": "vehicle", "grid": lines},
        },
        members={"belts": {"from": "edge", "to": "frame", "law": law}},
        loads=[{"body": "vehicle", "acceleration": [20, 0], "angular_acceleration": 20}],
        design={"initial": 0.1, "lower": 0.001},
        objectives=objectives,
        constraints=[{"volume": "all", "fraction": 0.1}, *limits],
        **more,
    )


def product(weights: Mapping[str, float]) -> Document:
    """Several objectives as a weighted product of their values."""
    return {"combine": {"method": "weighted_product", "weights": dict(weights)}}


def larger(weights: Mapping[str, float]) -> Document:
    """The largest of several objectives, each times its weight."""
    return {"combine": {"method": "weighted_min_max", "weights": dict(weights), "normalize": False}}
