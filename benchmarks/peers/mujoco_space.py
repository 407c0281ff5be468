"""MuJoCo in space, forward runs: free bodies, a tendon for each spring, equality constraints as spherical joints.

Its constraints are soft by design: joints give way by what their time constant allows, set here as stiff as two steps.
"""

from typing import Any

import mujoco
import numpy as np

from benchmarks.peers.problem import GROUND, Floats
from benchmarks.peers.space_problem import SpatialProblem
from benchmarks.peers.table import Objective


def make(problem: SpatialProblem, step: float = 1e-3, integrator: str = "RK4") -> Objective:
    """As the table says. integrator: RK4, implicitfast or Euler."""
    count = max(1, round(problem.end / step))
    model = mujoco.MjModel.from_xml_string(_scene(problem, problem.end / count, integrator))
    data = mujoco.MjData(model)
    bodies = [model.body(f"b{k}").id for k in range(problem.bodies)]

    def objective(alpha: Floats, _: bool) -> tuple[float, None]:
        mujoco.mj_resetData(model, data)
        stiffness: Any = model.tendon_stiffness
        # MuJoCo 4 keeps a polynomial of the elongation
        (stiffness if stiffness.ndim == 1 else stiffness[:, 0])[:] = problem.stiffness * alpha
        data.xfrc_applied[bodies] = problem.force
        mujoco.mj_step(model, data, nstep=count)
        mujoco.mj_fwdPosition(model, data)
        energy = 0.5 * np.sum(problem.stiffness * alpha * (data.ten_length - problem.length) ** 2)
        return float(energy), None

    return objective


def _scene(problem: SpatialProblem, step: float, integrator: str) -> str:
    sites: dict[tuple[int, ...], str] = {}
    inside: list[list[str]] = [[] for _ in range(problem.bodies + 1)]  # the ground is the last
    assert GROUND == -1

    def numbers(values: Any) -> str:
        return " ".join(repr(float(value)) for value in np.ravel(values))

    def site(body: int, at: Floats) -> str:
        key = body, *at.tolist()
        if key not in sites:
            sites[key] = f"s{len(sites)}"
            inside[body].append(f'<site name="{sites[key]}" pos="{numbers(at)}"/>')
        return sites[key]

    tendons, joints, bodies = [], [], []
    for (one, two), part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        for i in range(part.start, part.stop):
            ends = "".join(f'<site site="{site(*end)}"/>' for end in ((one, problem.p[i]), (two, problem.q[i])))
            natural = float(problem.length[i])
            tendons.append(f'<spatial stiffness="1" springlength="{natural!r} {natural!r}">{ends}</spatial>')
    for (one, two), at in zip(problem.hinges.tolist(), problem.at, strict=True):
        names = f'site1="{site(one, at[0])}" site2="{site(two, at[1])}"'
        joints.append(f'<connect {names} solref="{2.0 * step!r} 1" solimp="0.9999 0.9999 0.001 0.5 2"/>')
    for k, inertia in enumerate(problem.inertia):
        full = numbers(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])
        bodies.append(
            f'<body name="b{k}" pos="{numbers(problem.start[k])}" quat="{numbers(problem.turn[k])}"><freejoint/>'
            f'<inertial pos="0 0 0" mass="{float(problem.mass[k])!r}" fullinertia="{full}"/>{"".join(inside[k])}</body>'
        )
    off = '<flag contact="disable"/>' if joints else '<flag contact="disable" constraint="disable"/>'
    option = f'<option timestep="{step!r}" integrator="{integrator}" gravity="0 0 0">{off}</option>'
    return (
        f"<mujoco>{option}<worldbody>{''.join(inside[-1])}{''.join(bodies)}</worldbody>"
        f"<tendon>{''.join(tendons)}</tendon><equality>{''.join(joints)}</equality></mujoco>"
    )
