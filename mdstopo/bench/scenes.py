"""Scenes of any size to measure with, as text of case files."""

STEP, STEPS = 0.0005, 20

_PLATE = """\
format: 1
gravity: [0, -9.8]
time: {{end: 0.2}}
bodies:
  torso: {{mass: 60, inertia: 10, position: [0, 0]}}
  vehicle: {{mass: 2000, inertia: 6000, position: [0, -1]}}
points:
  torso_edge: {{body: torso, grid: {{rectangle: {{center: [0, 0], size: [0.5, 0.5], count: {p}}}}}}}
  frame_edge:
    body: vehicle
    grid:
      - {{line: {{from: [-1, -0.8], to: [-1, 0.8], count: {side}}}}}
      - {{line: {{from: [-0.8, -1], to: [0.8, -1], count: {floor}}}}}
      - {{line: {{from: [1, -0.8], to: [1, 0.8], count: {side}}}}}
members:
  belts: {{from: torso_edge, to: frame_edge, law: {{type: spring, stiffness: {stiffness!r}}}}}
loads:
  - {{body: vehicle, acceleration: [9.8, 0], angular_acceleration: 20}}
design: {{initial: 0.1, lower: 0.001, upper: 1}}
objectives:
  G: {{response: energy, over_time: max}}
constraints:
  - {{volume: all, fraction: 0.1}}
"""


def plate(members: int) -> str:
    """The paper's two bodies (Section IV.A) with about so many members, as stiff together as its 1020."""
    p = max(4, round(members**0.5))
    q = max(3, round(members / p))
    side = q // 3
    return _PLATE.format(p=p, side=side, floor=q - 2 * side, stiffness=225.0 * 1020 / (p * q))


def chain(bodies: int) -> str:
    """A hanging chain of bodies, a spring from each to the ground; its energy after `STEPS` fixed steps."""
    ends = ["ground", *(f"b{i}" for i in range(bodies))]
    lines = ["format: 1", "gravity: [0, -9.81]", f"time: {{end: {STEPS * STEP!r}}}", "bodies:"]
    lines += [f"  b{i}: {{mass: 1, inertia: 0.01, position: [{i + 0.5}, 0]}}" for i in range(bodies)]
    lines += ["joints:"]
    lines += [f"  - {{type: revolute, bodies: [{ends[i]}, {ends[i + 1]}], at: [{i}, 0]}}" for i in range(bodies)]
    lines += ["members:"]
    law = "{type: spring, stiffness: 50}"
    for i in range(bodies):
        at = f"at: [{i + 0.5}"
        lines.append(f"  m{i}: {{from: {{body: ground, {at}, 1]}}, to: {{body: b{i}, {at}, 0]}}, law: {law}}}")
    lines += ["objectives:", "  G: {response: energy, over_time: final}"]
    lines += [f"solver: {{integrator: runge_kutta, step: {STEP!r}}}", ""]
    return "\n".join(lines)
