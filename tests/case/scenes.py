"""Case texts that the reader's tests start from."""

from __future__ import annotations

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError, Mistake

SMALL = """\
format: 1
time: {end: 0.2}
bodies:
  a: {mass: 2, inertia: 3, position: [0, 0]}
  b: {mass: 4, inertia: 5, position: [2, 0]}
points:
  p: {body: a, grid: {list: [[0, 0], [0, 1]]}}
  q: {body: b, grid: {list: [[2, 0], [2, 1], [2, 2]]}}
members:
  belts: {from: p, to: q, law: {type: spring, stiffness: 225}}
loads:
  - {body: b, force: [1, 0]}
objectives:
  G: {response: energy}
constraints:
  - {volume: all, equals: 3}
"""

EVERYTHING = """\
format: 1
title: everything
gravity: [0, -9.8]
time: {start: 0, end: 0.2}
bodies:
  a: {mass: 60, inertia: 10, position: [1, 2], angle: 0.5}
  b: &b {mass: 2000, inertia: 6000, position: [0, -1], velocity: [0, 0], angular_velocity: 0}
  c: {<<: *b, position: [5, 5]}
  d: {<<: [{inertia: 2}, {mass: 1, inertia: 5}], mass: 3, position: [6, 6]}
joints:
  - {name: hip, type: revolute, bodies: [a, ground], at: [0, 0.25]}
  - {type: prismatic, bodies: [a, b], at: [1, 0], axis: [2, 0]}
  - {type: fixed, bodies: [a, b]}
  - {type: distance, bodies: [a, b], at: [[0, 0], [1, 0]]}
  - {type: revolute, bodies: [a, ground], at: {a: [0, 0.25], ground: [0, 0.2501]}}
bushings:
  - {bodies: [a, b], at: [0, 0], stiffness: [1e5, 1e5, 200], damping: [50, 50, 1]}
motions:
  - {body: c, x: {acceleration: 9.8}, angle: {acceleration: {table: [[0, 0], [0.1, 20], [0.2, 0]]}}}
  - {body: d, y: {position: {table: [[0, 6], [0.1, 6.1], [0.15, 6.3], [0.2, 7]]}}, x: {velocity: 0}}
points:
  edge: {body: a, frame: body, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 20}}}
  many:
    body: b
    grid:
      - {list: [[0, 1], [2, 3]]}
      - {line: {from: [-1, -0.8], to: [-1, 0.8], count: 3}}
      - {arc: {center: [0, 0], radius: 1, from: 3.14, to: 0, count: 9}}
      - {circle: {center: [0, 0], radius: 1, count: 12}}
      - {lattice: {from: [0, 0], to: [1, 1], count: [5, 4]}}
members:
  belts: {from: edge, to: many, connect: all, min_length: 0, max_length: 10,
          law: {type: spring, stiffness: 225, damping: 0}, cost: length}
  single:
    from: {body: ground, at: [0, 1]}
    to: {body: a, at: [0.1, 0], frame: body}
    design: false
    law:
      - {type: gap, stiffness: 1, side: compression, clip: true, active_from: 0.1, active_until: 0.2}
      - {type: cubic, stiffness: 1, cubic: -1}
      - {type: curve, curve: [[-1, -1], [0, 0], [1, 2]]}
      - {type: pulse, peak: -3, rate: 0, time: 0.1}
      - {type: table, table: [[0, 1], [0, 2]]}
      - {type: actuator, proportional: 1}
      - {type: inerter, inertance: 1}
loads:
  - {body: a, force: [10, 0], at: [0, 0], moment: 3, frame: global}
  - {body: b, acceleration: [9.8, 0], angular_acceleration: 20}
  - {body: b, force: {table: [[0, 1, 2], [0.1, 3, 4]]}, moment: {table: [[0, 1], [1, 2]]}}
  - {body: b, force: [{table: [[0, 1], [1, 1]]}, 3], moment: [[0, 1], [1, 2]]}
load_cases:
  rotation: {loads: [{body: b, angular_acceleration: 20}], gravity: [0, 0], time: {end: 0.1}}
  translation: {loads: [{body: b, acceleration: [20, 0]}], motions: [{body: c, x: {velocity: 0}}]}
design:
  initial: {belts: 0.2}
  lower: 0.001
objectives:
  G1: {response: energy, over_time: max, load_case: rotation, sense: minimize}
  G2: {response: {displacement: {body: b, at: [0, 0], component: norm}}, load_case: translation}
  G3: {response: {angle: {body: a, relative_to: b}}, load_case: rotation}
  G4: {response: {member_force: {group: single}}, load_case: rotation}
  G5: {response: {joint_force: {joint: hip}}, load_case: rotation}
  G6: {response: {joint_moment: {joint: 1}}, load_case: rotation, sense: maximize, over_time: rms}
combine: {weights: {G1: 0.5, G2: 0.5, G3: 0, G4: 1, G5: 0, G6: 0}, method: weighted_sum}
constraints:
  - {volume: [belts], limit: 102}
  - {volume: all, fraction: 0.1}
  - {volume: all, at_least: 5}
  - {response: {angle: {body: a}}, over_time: max_abs, load_case: rotation, limit: 0.05}
optimizer: {name: gsao, preset: oc, max_iterations: 100, tolerance: 1.0e-6, starts: 1, seed: 0,
            move_limit: 0.3}
solver: {integrator: auto, tolerance: 1.0e-8, sensitivity: auto, assemble: true}
"""

SPACE = """\
format: 1
dimension: 3
gravity: [0, 0, -9.8]
time: {end: 0.2}
bodies:
  a: {mass: 2, inertia: [2, 3, 4], position: [1, 2, 3]}
  b: {mass: 4, inertia: [5, 5, 5], position: [2, 0, 0]}
joints: []
points:
  p: {body: a, grid: {list: [[0, 0, 0], [0, 1, 0]]}}
  q: {body: b, grid: {list: [[2, 0, 0], [2, 1, 0], [2, 2, 5]]}}
members:
  belts: {from: p, to: q, law: {type: spring, stiffness: 225}}
loads:
  - {body: b, force: [1, 0, 0]}
objectives:
  G: {response: energy}
constraints:
  - {volume: all, limit: 3}
"""

EVERYTHING_IN_SPACE = """\
format: 1
dimension: 3
title: everything in space
gravity: [0, 0, -9.8]
time: {start: 0, end: 0.2}
bodies:
  a: {mass: 60, inertia: [2, 3, 4], position: [1, 2, 3], orientation: {axis: [0, 0, 2], angle: 0.5}}
  b: {mass: 20, inertia: [[2, 0.1, 0], [0.1, 3, 0], [0, 0, 4]], position: [0, -1, 0], velocity: [0, 0, 1],
      angular_velocity: [1, 2, 3], orientation: {quaternion: [1, 0, 0, 0]}}
  c: {mass: 1, inertia: [1, 1, 1], position: [5, 5, 5], orientation: {matrix: [[0, -1, 0], [1, 0, 0], [0, 0, 1]]}}
  d: {mass: 3, inertia: [1, 1, 2], position: [6, 6, 6],
      orientation: [{axis: [1, 0, 0], angle: 0.1}, {axis: [0, 1, 0], angle: 0.2}]}
joints:
  - {name: ball, type: spherical, bodies: [a, ground], at: [0, 0.25, 0]}
  - {type: revolute, bodies: [a, b], at: [1, 0, 0], axis: [0, 0, 2]}
  - {type: universal, bodies: [a, b], at: [0, 0, 0], axes: [[1, 0, 0], [0, 1, 0]]}
  - {type: prismatic, bodies: [a, b], at: [1, 0, 0], axis: {a: [1, 0, 0], b: [1, 1e-3, 0]}}
  - {type: cylindrical, bodies: [a, b], at: {a: [1, 0, 0], b: [2, 0, 0]}, axis: [1, 0, 0]}
  - {type: planar, bodies: [a, b], at: [0, 0, 0], normal: [0, 0, 1]}
  - {type: fixed, bodies: [a, b]}
  - {type: distance, bodies: [a, b], at: [[0, 0, 0], [1, 0, 0]]}
motions:
  - {body: c, x: {acceleration: 9.8}, z: {acceleration: {table: [[0, 0], [0.1, 20], [0.2, 0]]}}}
  - {body: d, y: {position: {table: [[0, 6], [0.1, 6.1], [0.15, 6.3], [0.2, 7]]}}, x: {velocity: 0}}
points:
  edge:
    body: a
    frame: body
    grid: {rectangle: {center: [0, 0, 0], axes: [[1, 0, 0], [0, 1, 0]], size: [0.5, 0.5], count: 20}}
  many:
    body: b
    grid:
      - {list: [[0, 1, 2], [2, 3, 4]]}
      - {line: {from: [-1, -0.8, 0], to: [-1, 0.8, 1], count: 3}}
      - {arc: {center: [0, 0, 0], radius: 1, normal: [0, 0, 1], start: [1, 0, 0], from: 3.14, to: 0, count: 9}}
      - {circle: {center: [0, 0, 9], radius: 1, normal: [0, 1, 1], start: [1, 0, 0], count: 12}}
      - {plane: {corner: [0, 0, 7], edges: [[1, 0, 0], [1, 1, 0]], count: [3, 2]}}
      - {lattice: {from: [0, 0, 20], to: [1, 1, 21], count: [2, 3, 4]}}
      - {box: {from: [0, 0, 30], to: [1, 1, 31], count: [3, 3, 3]}}
      - {cylinder: {from: [0, 0, 40], to: [0, 0, 41], radius: 1, start: [1, 0, 0], count: [6, 2]}}
members:
  belts: {from: edge, to: many, min_length: 0, max_length: 100, law: {type: spring, stiffness: 225}, cost: length}
  single:
    from: {body: ground, at: [0, 1, 0]}
    to: {body: a, at: [0.1, 0, 0], frame: body}
    design: false
    law: {type: gap, stiffness: 1}
loads:
  - {body: a, force: [10, 0, 0], at: [0, 0, 0], moment: [0, 0, 3], frame: global}
  - {body: b, acceleration: [9.8, 0, 0], angular_acceleration: [0, 0, 20]}
  - {body: b, force: {table: [[0, 1, 2, 3], [0.1, 3, 4, 5]]}, moment: {table: [[0, 1, 0, 0], [1, 2, 0, 0]]}}
  - {body: b, force: [{table: [[0, 1], [1, 1]]}, 3, 0], frame: body}
load_cases:
  turning: {loads: [{body: b, angular_acceleration: [0, 20, 0]}], gravity: [0, 0, 0], time: {end: 0.1}}
  moving: {loads: [{body: b, acceleration: [20, 0, 0]}], motions: [{body: c, x: {velocity: 0}}]}
design: {initial: {belts: 0.2}, lower: 0.001}
objectives:
  G1: {response: energy, load_case: turning}
  G2: {response: {displacement: {body: b, at: [0, 0, 0], component: z}}, load_case: moving}
  G3: {response: {rotation: {body: a, relative_to: b, component: x}}, load_case: turning}
  G4: {response: {member_force: {group: single}}, load_case: turning}
  G5: {response: {joint_force: {joint: ball}}, load_case: turning}
  G6: {response: {joint_moment: {joint: 1}}, load_case: turning, sense: maximize, over_time: rms}
  G7: {response: {tilt: {body: a, axis: [0, 0, 1], frame: body, relative_to: b}}, load_case: turning}
  G8: {response: {angular_acceleration: {body: a}}, load_case: turning}
combine: {weights: {G1: 0.5, G2: 0.5, G3: 0, G4: 1, G5: 0, G6: 0, G7: 0, G8: 0}, method: weighted_sum}
constraints:
  - {volume: [belts], limit: 102}
  - {response: {angular_velocity: {body: a, component: y}}, over_time: max_abs, load_case: turning, limit: 0.05}
solver: {integrator: runge_kutta, tolerance: 1.0e-8, sensitivity: direct, assemble: false}
"""


def changed(text: str, *changes: tuple[str, str]) -> str:
    """`text` with the first occurrence of each old part replaced; the part must be there."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def small(*changes: tuple[str, str]) -> Case:
    """The small case with parts replaced."""
    return read_case(changed(SMALL, *changes))


def mistakes(text: str, overrides: dict[str, object] | None = None) -> tuple[Mistake, ...]:
    """The mistakes of a text that must be refused."""
    try:
        read_case(text, path="x.yaml", overrides=overrides)
    except CaseError as error:
        return error.mistakes
    raise AssertionError("the case was accepted")


def place(text: str, part: str, offset: int = 0) -> tuple[int, int]:
    """Line and column, from 1, of the first occurrence of `part` plus `offset` characters."""
    index = text.index(part) + offset
    before = text[:index]
    return before.count("\n") + 1, index - (before.rfind("\n") + 1) + 1
