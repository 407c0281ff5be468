"""Cost of a step in a hanging chain of bodies: linear in their number where the matrix of the balance is banded."""

import time
from collections.abc import Iterator

import numpy as np

from mdstopo import Case, simulate
from mdstopo.bench.tables import Table
from mdstopo.case.reader import read_case

BODIES = (10, 30, 100, 300, 1000)
STEPS = 20


def chain() -> Iterator[Table]:
    """One table."""
    rows, times = [], []
    for n in BODIES:
        own = []
        for integrator in ("runge_kutta", "generalized_alpha"):
            case = read_case(_case(n), overrides={"solver.integrator": integrator, "solver.step": "0.0005"})
            own.append(min(_seconds(case) for _ in range(3)) / STEPS)
        times.append(own)
        rows.append([str(n), *(f"{1e3 * each:.3g}" for each in own)])
    fitted = np.polyfit(np.log(BODIES[2:]), np.log(times[2:]), 1)[0]
    rows.append(["exponent, from 100 on", *(f"{each:.2f}" for each in fitted)])
    yield Table(
        "A hanging chain: time of a step, ms",
        ["bodies", "runge_kutta (12 stages)", "generalized_alpha"],
        rows,
        [f"{STEPS} fixed steps; revolute joints, 2 rows each; with what the trajectory needs beside the steps."],
    )


def _case(n: int) -> str:
    bodies = "".join(f"  b{i}: {{mass: 1, inertia: 0.01, position: [{i + 0.5}, 0]}}\n" for i in range(n))
    ends = ["ground", *(f"b{i}" for i in range(n))]
    joints = "".join(f"  - {{type: revolute, bodies: [{ends[i]}, {ends[i + 1]}], at: [{i}, 0]}}\n" for i in range(n))
    return f"format: 1\ngravity: [0, -9.81]\ntime: {{end: {STEPS * 0.0005}}}\nbodies:\n{bodies}joints:\n{joints}"


def _seconds(case: Case) -> float:
    began = time.perf_counter()
    motion = simulate(case)
    assert motion.status.ok, motion.message
    return time.perf_counter() - began
