"""What the tests of fronts share."""

CASE = """\
format: 1
title: Probe
gravity: [0, -9.8]
time: {end: 0.2}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0]}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: torso, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 8}}}
  frame:
    body: vehicle
    grid:
      - {line: {from: [-1, -0.8], to: [-1, 0.8], count: 3}}
      - {line: {from: [-0.8, -1], to: [0.8, -1], count: 3}}
      - {line: {from: [1, -0.8], to: [1, 0.8], count: 3}}
members:
  belts: {from: edge, to: frame, law: {type: spring, stiffness: 3000}}
load_cases:
  rotation: {loads: [{body: vehicle, angular_acceleration: 20}]}
  translation: {loads: [{body: vehicle, acceleration: [20, 0]}]}
objectives:
  G1: {response: energy, load_case: rotation}
  G2: {response: energy, load_case: translation}
combine: {weights: {G1: 1, G2: 3}}
constraints:
  - {volume: all, equals: 7.2}
optimizer: {max_iterations: 40}
"""

THREE = CASE.replace(
    "combine: {weights: {G1: 1, G2: 3}}",
    "  G3: {response: {angle: {body: torso, relative_to: vehicle}}, over_time: max_abs, load_case: translation}\n"
    "combine: {weights: {G1: 1, G2: 3, G3: 2}}",
)
