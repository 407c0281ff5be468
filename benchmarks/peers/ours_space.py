"""mdstopo itself in space, through its Python interface, from the same arrays as the others."""

from typing import Any

from benchmarks.peers.ours import objective_of
from benchmarks.peers.problem import GROUND, Floats
from benchmarks.peers.space_problem import SpatialProblem, spatial_world
from benchmarks.peers.table import Objective


def make(
    problem: SpatialProblem, tolerance: float = 1e-8, integrator: str = "auto", step: float | None = None
) -> Objective:
    """As the table says; with a step, s, no tolerance counts. Raises RuntimeError where an evaluation fails."""
    return objective_of(case_of(problem), tolerance, integrator, step)


def case_of(problem: SpatialProblem) -> dict[str, Any]:
    """The problem as a case file; JSON is YAML."""
    names = [f"b{k}" for k in range(problem.bodies)] + ["ground"]  # the index of the ground is that of the last
    assert GROUND == -1
    bodies = {
        names[k]: {
            "mass": float(problem.mass[k]),
            "inertia": problem.inertia[k].tolist(),
            "position": problem.start[k].tolist(),
            "orientation": {"quaternion": problem.turn[k].tolist()},
        }
        for k in range(problem.bodies)
    }
    points, members = {}, {}
    for k, ((one, two), part) in enumerate(zip(problem.groups.tolist(), problem.slices(), strict=True)):
        (stiffness,) = set(problem.stiffness[part].tolist())
        grid = problem.grid(part)
        p, q = (problem.p[part], problem.q[part]) if grid is None else grid
        for side, body, ends in (("p", one, p), ("q", two, q)):
            points[f"{side}{k}"] = {"body": names[body], "frame": "body", "grid": {"list": ends.tolist()}}
        members[f"g{k}"] = {
            "from": f"p{k}",
            "to": f"q{k}",
            "connect": "pairs" if grid is None else "all",
            "law": {"type": "spring", "stiffness": stiffness},
        }
    joints = [
        {
            "type": "spherical",
            "bodies": [names[body] for body in of],
            "at": {names[body]: _world(problem, body, at) for body, at in zip(of, places, strict=True)},
        }
        for of, places in zip(problem.hinges.tolist(), problem.at, strict=True)
    ]
    loads = [
        {"body": names[k], "force": force[:3], "moment": force[3:]} for k, force in enumerate(problem.force.tolist())
    ]
    return {
        "format": 1,
        "dimension": 3,
        "time": {"end": problem.end},
        "bodies": bodies,
        "joints": joints,
        "points": points,
        "members": members,
        "loads": loads,
        "objectives": {"G": {"response": "energy", "over_time": "max" if problem.peak else "final"}},
    }


def _world(problem: SpatialProblem, body: int, at: Floats) -> list[float]:
    return [float(value) for value in spatial_world(problem.pose, body, at[None])[0]]
