"""mdstopo itself, through its Python interface, from the same arrays as the others."""

import json
from typing import Any

from benchmarks.peers.problem import GROUND, Floats, Problem
from benchmarks.peers.table import Objective


def make(problem: Problem, tolerance: float = 1e-8, integrator: str = "auto", step: float | None = None) -> Objective:
    """As the table says; with a step, s, no tolerance counts. Raises RuntimeError where an evaluation fails."""
    return objective_of(case_of(problem), tolerance, integrator, step)


def objective_of(content: dict[str, Any], tolerance: float, integrator: str, step: float | None) -> Objective:
    """The objective G of a case's content."""
    from mdstopo.case.reader import read_case
    from mdstopo.evaluators import evaluator_of

    accuracy = {"tolerance": tolerance} if step is None else {"step": step}
    case = read_case(json.dumps(content | {"solver": {"integrator": integrator} | accuracy}))
    evaluator = evaluator_of(case)

    def objective(alpha: Floats, gradient: bool) -> tuple[float, Floats | None]:
        found = evaluator.evaluate(alpha, gradient)
        if not found.status.ok:
            raise RuntimeError(f"{found.status.value} {found.message}".rstrip())
        return found.objectives["G"], found.gradients["G"] if gradient else None

    return objective


def case_of(problem: Problem) -> dict[str, Any]:
    """The problem as a case file; JSON is YAML."""
    names = [f"b{k}" for k in range(problem.bodies)] + ["ground"]  # the index of the ground is that of the last
    assert GROUND == -1
    bodies = {
        names[k]: {"mass": mass[0], "inertia": mass[2], "position": start[:2], "angle": start[2]}
        for k, (mass, start) in enumerate(zip(problem.mass.tolist(), problem.start.tolist(), strict=True))
    }
    points, members = {}, {}
    for k, ((one, two), part) in enumerate(zip(problem.groups.tolist(), problem.slices(), strict=True)):
        (stiffness,) = set(problem.stiffness[part].tolist())
        (p, q), product = _ends(problem, part)
        for side, body, ends in (("p", one, p), ("q", two, q)):
            points[f"{side}{k}"] = {"body": names[body], "frame": "body", "grid": {"list": ends}}
        members[f"g{k}"] = {
            "from": f"p{k}",
            "to": f"q{k}",
            "connect": "all" if product else "pairs",
            "law": {"type": "spring", "stiffness": stiffness},
        }
    joints = [
        {
            "type": "revolute",
            "bodies": [names[body] for body in bodies_of],
            "at": {names[body]: _world(problem, body, at) for body, at in zip(bodies_of, places, strict=True)},
        }
        for bodies_of, places in zip(problem.hinges.tolist(), problem.at.tolist(), strict=True)
    ]
    loads = [
        {"body": names[k], "force": force[:2], "moment": force[2]} for k, force in enumerate(problem.force.tolist())
    ]
    return {
        "format": 1,
        "time": {"end": problem.end},
        "bodies": bodies,
        "joints": joints,
        "points": points,
        "members": members,
        "loads": loads,
        "objectives": {"G": {"response": "energy", "over_time": "max" if problem.peak else "final"}},
    }


def _ends(problem: Problem, part: slice) -> tuple[tuple[list[list[float]], list[list[float]]], bool]:
    """Points of both sides, and whether the members join every one with every other, the second side fast."""
    p, q = problem.p[part].tolist(), problem.q[part].tolist()
    many = next((k for k, end in enumerate(p) if end != p[0]), len(p))
    rows, columns = p[::many], q[:many]
    if len(rows) * many == len(p) and p == [end for end in rows for _ in columns] and q == columns * len(rows):
        return (rows, columns), True
    return (p, q), False


def _world(problem: Problem, body: int, at: list[float]) -> list[float]:
    import numpy as np

    from benchmarks.peers.problem import world

    return [float(value) for value in world(problem.start, body, np.array([at]))[0]]
