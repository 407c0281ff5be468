"""MuJoCo, forward runs: bodies on two slides and a hinge, a tendon for each spring, equality constraints as hinges.

Its constraints are soft by design: hinges give way by what their time constant allows, set here as stiff as two steps.
"""

from typing import Any

import mujoco
import numpy as np

from benchmarks.peers.problem import GROUND, Floats, Problem
from benchmarks.peers.table import Objective


def make(problem: Problem, step: float = 1e-3, integrator: str = "RK4") -> Objective:
    """As the table says. integrator: RK4, implicitfast or Euler."""
    count = max(1, round(problem.end / step))
    model = mujoco.MjModel.from_xml_string(_scene(problem, problem.end / count, integrator))
    data = mujoco.MjData(model)
    bodies = [model.body(f"b{k}").id for k in range(problem.bodies)]
    free = np.array([data.xfrc_applied[body] for body in bodies])
    free[:, :2], free[:, 5] = problem.force[:, :2], problem.force[:, 2]

    def objective(alpha: Floats, _: bool) -> tuple[float, None]:
        mujoco.mj_resetData(model, data)
        stiffness: Any = model.tendon_stiffness
        # MuJoCo 4 keeps a polynomial of the elongation
        (stiffness if stiffness.ndim == 1 else stiffness[:, 0])[:] = problem.stiffness * alpha
        data.xfrc_applied[bodies] = free
        mujoco.mj_step(model, data, nstep=count)
        mujoco.mj_fwdPosition(model, data)
        energy = 0.5 * np.sum(problem.stiffness * alpha * (data.ten_length - problem.length) ** 2)
        return float(energy), None

    return objective


def _scene(problem: Problem, step: float, integrator: str) -> str:
    sites: dict[tuple[int, float, float], str] = {}
    inside: list[list[str]] = [[] for _ in range(problem.bodies + 1)]  # the ground is the last

    def site(body: int, at: Floats) -> str:
        key = body, float(at[0]), float(at[1])
        if key not in sites:
            sites[key] = f"s{len(sites)}"
            inside[body].append(f'<site name="{sites[key]}" pos="{key[1]!r} {key[2]!r} 0"/>')
        return sites[key]

    tendons, hinges = [], []
    for (one, two), part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        for i in range(part.start, part.stop):
            ends = "".join(f'<site site="{site(*end)}"/>' for end in ((one, problem.p[i]), (two, problem.q[i])))
            natural = float(problem.length[i])
            tendons.append(f'<spatial stiffness="1" springlength="{natural!r} {natural!r}">{ends}</spatial>')
    for (one, two), ends in zip(problem.hinges.tolist(), problem.at, strict=True):
        names = f'site1="{site(one, ends[0])}" site2="{site(two, ends[1])}"'
        hinges.append(f'<connect {names} solref="{2.0 * step!r} 1" solimp="0.9999 0.9999 0.001 0.5 2"/>')
    assert GROUND == -1
    bodies = []
    for k, ((mass, _, inertia), (x, y, angle)) in enumerate(
        zip(problem.mass.tolist(), problem.start.tolist(), strict=True)
    ):
        bodies.append(
            f'<body name="b{k}" pos="{x!r} {y!r} 0" euler="0 0 {np.degrees(angle).item()!r}">'
            '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="hinge" axis="0 0 1"/>'
            f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
            f"{''.join(inside[k])}</body>"
        )
    off = '<flag contact="disable"/>' if hinges else '<flag contact="disable" constraint="disable"/>'
    option = f'<option timestep="{step!r}" integrator="{integrator}" gravity="0 0 0">{off}</option>'
    return (
        f"<mujoco>{option}<worldbody>{''.join(inside[-1])}{''.join(bodies)}</worldbody>"
        f"<tendon>{''.join(tendons)}</tendon><equality>{''.join(hinges)}</equality></mujoco>"
    )
