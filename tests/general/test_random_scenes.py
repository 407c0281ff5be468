"""Random scenes that combine joints, laws, motions and responses: gradients against differences and each other."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import mdstopo
from mdstopo.case.reader import read_case
from tests.general.support import slopes
from tests.tiers import examples

LAWS = (
    "{{type: spring, stiffness: {a}, damping: {b}, preload: {c}}}",
    "{{type: cubic, stiffness: {a}, cubic: {d}}}",
    "{{type: curve, curve: [[-2, -{a}], [-0.5, -{b}], [0, 0], [0.6, {b}], [2, {d}]]}}",
    "[{{type: spring, stiffness: {a}, active_from: 0.11}}, {{type: inerter, inertance: {c}}}]",
    "{{type: actuator, proportional: {b}, derivative: {c}, target: 0.2}}",
    "{{type: pulse, peak: {d}, rate: 300, time: 0.15}}",
)
JOINTS = (
    "{{type: revolute, bodies: [{p}, {q}], at: [{x}, {y}]}}",
    "{{type: distance, bodies: [{p}, {q}], at: [[{x}, {z}], [{u}, {y}]]}}",
    "{{type: prismatic, bodies: [{p}, {q}], at: [{x}, {y}], axis: [1, {z}]}}",
    "{{type: fixed, bodies: [{p}, {q}], at: [{x}, {y}]}}",
)
RESPONSES = (
    "{displacement: {body: b2, at: [2.2, 0.3], relative_to: b0}}",
    "{acceleration: {body: b1}}",
    "{angular_velocity: {body: b2}}",
    "{joint_force: {joint: j1}}",
    "{member_force: {group: m0}}",
    "energy",
)
TIMES = ("final", "mean", "rms", "max")


def scene(seed):
    """Three bodies in a row, jointed to each other or to the ground, with groups of random laws; as text."""
    rng = np.random.default_rng(seed)
    number = lambda low, high: f"{rng.uniform(low, high):.4f}"  # noqa: E731
    lines = ["format: 1", "gravity: [0, -9.81]", "time: {end: 0.3}", "bodies:"]
    lines += [
        f"  b{i}: {{mass: {number(1, 5)}, inertia: {number(0.1, 1)}, position: [{i}, {number(-0.3, 0.3)}]}}"
        for i in range(3)
    ]
    ends = ["ground", "b0", "b1", "b2"]
    lines.append("joints:")
    for i, kind in enumerate(rng.integers(0, len(JOINTS), 2)):
        first, second = (ends[0], ends[1]) if i == 0 else (ends[2], ends[3])
        place = {"x": number(i, i + 0.5), "y": number(0.1, 0.4), "z": number(-0.9, -0.2), "u": number(i + 0.6, i + 1)}
        lines.append(f"  - {{name: j{i}, " + JOINTS[kind].format(p=first, q=second, **place)[1:])
    if rng.uniform() < 0.4:
        lines.append("motions: [{body: b1, x: {acceleration: {table: [[0, 0], [0.1, 5], [0.3, -2]]}}}]")
    lines.append("members:")
    for i in range(3):
        law = LAWS[rng.integers(0, len(LAWS))].format(
            a=number(20, 80), b=number(1, 9), c=number(0.3, 2), d=number(10, 30)
        )
        lines += [
            f"  m{i}:",
            f"    from: {{body: {ends[i]}, at: [{number(i - 1, i)}, {number(0.8, 1.5)}]}}",
            f"    to: {{body: {ends[i + 1]}, at: [{number(i, i + 0.3)}, {number(-0.3, 0.3)}]}}",
            f"    law: {law}",
        ]
    lines += ["design: {initial: 0.7, power: 1.5}", "objectives:"]
    chosen = rng.permutation(len(RESPONSES))[:3]
    lines += [
        f"  R{i}: {{response: {RESPONSES[r]}, over_time: {TIMES[rng.integers(0, len(TIMES))]}}}"
        for i, r in enumerate(chosen)
    ]
    lines += ["combine: {weights: {R0: 1, R1: 1, R2: 1}}", "solver: {tolerance: 1e-11}"]
    return "\n".join(lines) + "\n"


@settings(max_examples=examples(5, 40), derandomize=True, deadline=None)
@given(st.integers(0, 10**6))
def test_gradients_of_random_scenes_are_exact(seed):
    case = read_case(scene(seed))
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    alpha = np.array(case.initial)
    direction = np.random.default_rng(seed).normal(size=len(alpha))
    direct = mdstopo.evaluate(case, method="direct")
    apart = 1e-4
    for name, slope in slopes(case, alpha, direction, apart).items():
        gradient = found.gradients[name]
        if abs(found.objectives[name]) < 1e-9:
            continue  # of a body that is held: rounding
        size = max(float(np.abs(gradient).max()), 1e-6 * abs(found.objectives[name]), 1e-9)
        assert np.abs(direct.gradients[name] - gradient).max() <= 1e-9 * size, name
        rounding = 4.0 * np.finfo(float).eps * abs(found.objectives[name]) / apart  # of values that are subtracted
        assert abs(slope - gradient @ direction) <= 1e-7 * size * max(np.abs(direction).max(), 1.0) + rounding, name
