"""Objectives without peaks: how soon curvature leads to the optimum, beside the way that peaks ask for.

Two scenes with an rms over time: a hexapod on a shaken base with 144 candidate struts, and a leg whose hip and knee are
driven, with 162 springs beside them.
"""

import json
from collections.abc import Iterator

from benchmarks.optimum.motions import Document
from mdstopo.bench.tables import Table
from mdstopo.case.reader import read_case
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.start_families import random_feasible
from mdstopo.optimizer.state import State
from mdstopo.settings.optimizer_presets import settings

#: designs that runs begin at: the stated one, then random ones; evaluations that each may take
STARTS, MOST = 5, 150


def _circle(radius: float, height: float) -> Document:
    """Twelve points on a horizontal circle around the vertical axis."""
    circle = {"center": [0, 0, height], "radius": radius, "normal": [0, 0, 1], "start": [1, 0, 0], "count": 12}
    return {"grid": {"circle": circle}}


HEXAPOD: Document = {
    "format": 1,
    "dimension": 3,
    "title": "hexapod",
    "gravity": [0, 0, -9.81],
    "time": {"end": 0.6},
    "bodies": {
        "base": {"mass": 500, "inertia": [100, 100, 150], "position": [0, 0, 0]},
        "plate": {"mass": 120, "inertia": [20, 20, 35], "position": [0, 0, 1.2]},
    },
    "motions": [
        {
            "body": "base",
            "x": {"position": "0.01*sin(2*pi*6*t)"},
            "y": {"position": "0.006*sin(2*pi*4*t)"},
            "z": {"position": "0.004*sin(2*pi*9*t)"},
            "rotation": {"axis": [0, 0, 1], "velocity": 0},
        }
    ],
    "points": {"below": {"body": "base", **_circle(1.0, 0.1)}, "above": {"body": "plate", **_circle(0.7, 1.1)}},
    "members": {
        "struts": {"from": "below", "to": "above", "law": {"type": "spring", "stiffness": 4e5, "damping": 800}}
    },
    "design": {"initial": 0.1, "lower": 0, "upper": 1},
    "objectives": {"shake": {"response": {"acceleration": {"body": "plate"}}, "over_time": "rms"}},
    "constraints": [{"volume": "all", "fraction": 0.15}],
    "solver": {"settle": True},
}

_SPRING = {"type": "spring", "stiffness": 2000}

LEG: Document = {
    "format": 1,
    "title": "leg",
    "gravity": [0, -9.81],
    "time": {"end": 1.2},
    "bodies": {
        "hub_hip": {"mass": 0.5, "inertia": 0.01, "position": [0, 1.0]},
        "hub_knee": {"mass": 0.5, "inertia": 0.01, "position": [0, 0.55]},
        "thigh": {"mass": 8, "inertia": 0.12, "position": [0, 0.8]},
        "shank": {"mass": 4, "inertia": 0.08, "position": [0, 0.33]},
    },
    "joints": [
        {"name": "hip", "type": "revolute", "bodies": ["ground", "hub_hip"], "at": [0, 1.0]},
        {"name": "hip_drive", "type": "fixed", "bodies": ["hub_hip", "thigh"], "at": [0, 1.0]},
        {"name": "knee", "type": "revolute", "bodies": ["thigh", "hub_knee"], "at": [0, 0.55]},
        {"name": "knee_drive", "type": "fixed", "bodies": ["hub_knee", "shank"], "at": [0, 0.55]},
    ],
    "motions": [
        {"body": "hub_hip", "angle": {"position": "0.45*sin(2*pi*t/1.2)"}},
        {"body": "hub_knee", "angle": {"position": "0.45*sin(2*pi*t/1.2) - 0.5*(1-cos(2*pi*t/1.2))"}},
    ],
    "points": {
        "pelvis": {"body": "ground", "grid": {"rectangle": {"center": [0, 1.1], "size": [0.3, 0.2], "count": 12}}},
        "on_thigh": {"body": "thigh", "grid": {"line": {"from": [0.05, 0.95], "to": [0.05, 0.6], "count": 6}}},
        "on_shank": {"body": "shank", "grid": {"line": {"from": [0.05, 0.5], "to": [0.05, 0.2], "count": 5}}},
    },
    "members": {
        "hip_springs": {"from": "pelvis", "to": "on_thigh", "law": _SPRING},
        "knee_springs": {"from": "on_thigh", "to": "on_shank", "law": _SPRING},
        "both": {"from": "pelvis", "to": "on_shank", "law": _SPRING},
    },
    "design": {"initial": 0.02, "lower": 0, "upper": 1},
    "objectives": {"hip": {"response": {"joint_moment": {"joint": "hip_drive"}}, "over_time": "rms"}},
    "constraints": [{"response": {"joint_moment": {"joint": "knee_drive"}}, "over_time": "rms", "limit": 8}],
    "solver": {"assemble": True},
}


def smooth() -> Iterator[Table]:
    """Each scene from each start, led by curvature, and as objectives with peaks are."""
    rows = []
    for document in (HEXAPOD, LEG):
        problem = make_engine(read_case(json.dumps(document))).problem()
        for start in range(STARTS):
            ends = []
            for by_curvature in (True, False):
                problem.smooth = by_curvature
                optimizer = Gsao(problem, settings(max_iterations=MOST - 1))
                state: State = optimizer.start(random_feasible(problem, 0, start) if start else None)
                while state.running:
                    state = optimizer.step(state)
                word = state.status.value.replace("_", " ")
                ends += [f"{state.best_objective:.7g}", str(state.evaluations), word]
            rows.append([str(document["title"]), "stated" if start == 0 else f"random {start}", *ends])
    yield Table(
        "An rms over time, by curvature, and as if it had peaks",
        ("problem", "start", "found", "evaluations", "last word", "as peaks", "evaluations", "last word"),
        rows,
        (f"At most {MOST} evaluations each. Random: of `random_feasible`, with few thick members.",),
    )
