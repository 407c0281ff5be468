"""The scenes on which all programs are compared, as cases of mdstopo.

The two bodies are in `benchmarks.scenes`; here is the closed loop.
"""

from math import cos, pi, sin

import numpy as np

#: links of the ring; points on each; how far on in the ring the partner of a link is
LINKS, POINTS, PARTNER = 10, 10, 3


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
