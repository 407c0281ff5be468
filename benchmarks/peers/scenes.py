"""The scenes on which all programs are compared, as cases of mdstopo.

The two planar bodies are in `benchmarks.scenes`; here are the closed loops, and two bodies in space.
"""

import json
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np

#: links of the ring; points on each; how far on in the ring the partner of a link is
LINKS, POINTS, PARTNER = 10, 10, 3
#: the case of the seated occupant, and what is left out of it: limits on responses, and with them the second load case
SEAT, SEAT_CHANGES = Path(__file__).parents[2] / "cases" / "restraint.yaml", {"constraints": []}


def ring() -> str:
    """A loop of links of 1 m and 1 kg, hinged to one another and one of them to the ground, let go at rest.

    Each link is tied to the third one after it by every pair of their ten points.
    """
    radius = 0.5 / sin(pi / LINKS)
    corner = [(radius * sin(2 * pi * k / LINKS), radius * (cos(2 * pi * k / LINKS) - 1.0)) for k in range(LINKS + 1)]
    lines = ["format: 1", "title: A ring of ten links", "gravity: [0, -9.81]", "time: {end: 0.3}", "bodies:"]
    bodies, grids, groups = [], [], []
    joints = [f"  - {{type: revolute, bodies: [ground, b0], at: {list(corner[0])}}}"]
    for k in range(LINKS):
        one, two = np.array(corner[k]), np.array(corner[k + 1])
        bodies.append(f"  b{k}: {{mass: 1, inertia: 0.0833, position: {(0.5 * (one + two)).tolist()}}}")
        joints.append(f"  - {{type: revolute, bodies: [b{k}, b{(k + 1) % LINKS}], at: {two.tolist()}}}")
        ends = [(one + share * (two - one)).tolist() for share in (0.05, 0.95)]
        grids.append(f"  p{k}: {{body: b{k}, grid: {{line: {{from: {ends[0]}, to: {ends[1]}, count: {POINTS}}}}}}}")
        law = "{type: spring, stiffness: 50}"
        groups.append(f"  g{k}: {{from: p{k}, to: p{(k + PARTNER) % LINKS}, law: {law}}}")
    lines += [*bodies, "joints:", *joints, "points:", *grids, "members:", *groups]
    lines += ["loads:", "  - {body: b3, acceleration: [20, 0]}"]
    return "\n".join([*lines, "objectives:", "  G: {response: energy, over_time: final}", ""])


def spatial_pair(along: int = 20, line: int = 17, stiffness: float = 225.0, over_time: str = "max") -> str:
    """Two bodies as in the paper's Section IV.A, but with full inertia, in all three directions, 20 x 51 springs.

    along: points of the torso; line: points of each of the frame's three lines. The energy of a uniform design is
    highest at the end, that of a random one may be before.
    """
    lines = [([-1, -0.4, -0.8], [-1, 0.4, 0.8]), ([-0.8, 0.3, -1], [0.8, -0.3, -1]), ([1, 0.4, -0.8], [1, -0.4, 0.8])]
    return json.dumps(
        {
            "format": 1,
            "dimension": 3,
            "title": "Two bodies in space",
            "gravity": [0, 0, -9.8],
            "time": {"end": 0.2},
            "bodies": {
                "torso": {
                    "mass": 60,
                    "inertia": [[10, 1, 0], [1, 8, 0.5], [0, 0.5, 6]],
                    "position": [0, 0, 0],
                    "orientation": {"axis": [1, 2, 0], "angle": 0.3},
                },
                "vehicle": {"mass": 2000, "inertia": [6000, 5000, 7000], "position": [0, 0, -1]},
            },
            "points": {
                "torso_edge": {"body": "torso", "grid": {"rectangle": {
                    "center": [0, 0, 0], "axes": [[1, 0, 0.2], [0, 1, 0]], "size": [0.5, 0.5], "count": along}}},
                "frame_edge": {"body": "vehicle", "grid": [
                    {"line": {"from": a, "to": b, "count": line}} for a, b in lines]},
            },
            "members": {"belts": {
                "from": "torso_edge", "to": "frame_edge", "law": {"type": "spring", "stiffness": stiffness}}},
            "loads": [{"body": "vehicle", "acceleration": [9.8, 0, 0], "moment": [30000, 120000, -20000]}],
            "objectives": {"G": {"response": "energy", "over_time": over_time}},
        }
    )  # fmt: skip


def spatial_ring() -> str:
    """A loop of links on spherical joints, bent up and down, one of them on the ground, let go at rest.

    Each link is tied to the third one after it by every pair of their ten points, which lie beside its axis.
    """
    radius, bend = 0.5 / sin(pi / LINKS), 0.15
    corner = np.array([
        [radius * sin(2 * pi * k / LINKS), radius * (cos(2 * pi * k / LINKS) - 1.0), bend * (k % 2)]
        for k in range(LINKS + 1)
    ])  # fmt: skip
    content: dict[str, Any] = {"format": 1, "dimension": 3, "title": "A spatial ring of ten links"}
    content |= {"gravity": [0, -9.81, 0], "time": {"end": 0.3}, "bodies": {}, "points": {}, "members": {}}
    content["joints"] = [{"type": "spherical", "bodies": ["ground", "b0"], "at": corner[0].tolist()}]
    for k in range(LINKS):
        one, two = corner[k], corner[k + 1]
        axis = (two - one) / np.linalg.norm(two - one)
        beside = np.cross(axis, [0.0, 0.0, 1.0])
        beside /= np.linalg.norm(beside)
        matrix = np.column_stack([axis, beside, np.cross(axis, beside)])
        content["bodies"][f"b{k}"] = {
            "mass": 1,
            "inertia": [0.01, 0.0833, 0.08],
            "position": (0.5 * (one + two)).tolist(),
            "orientation": {"matrix": matrix.tolist()},
        }
        next_one = f"b{(k + 1) % LINKS}"
        content["joints"].append({"type": "spherical", "bodies": [f"b{k}", next_one], "at": two.tolist()})
        shares = np.linspace(0.05, 0.95, POINTS)
        places = [(one + s * (two - one) + 0.05 * (-1) ** i * beside).tolist() for i, s in enumerate(shares)]
        content["points"][f"p{k}"] = {"body": f"b{k}", "grid": {"list": places}}
        law = {"type": "spring", "stiffness": 50}
        content["members"][f"g{k}"] = {"from": f"p{k}", "to": f"p{(k + PARTNER) % LINKS}", "law": law}
    content["loads"] = [{"body": "b3", "acceleration": [20, 0, 5]}]
    content["objectives"] = {"G": {"response": "energy", "over_time": "final"}}
    return json.dumps(content)
