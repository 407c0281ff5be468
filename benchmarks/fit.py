"""Fits of synthetic measurements: how often intervals hold the truth, and how much work it is beside differences."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from mdstopo.bench.tables import Table, verdict
from mdstopo.case.reader import read_case
from mdstopo.case.sections.measurements import Measured
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.least_squares import COST, SLOPE, STEP, Minimum, fitted, minimum
from mdstopo.fit.statistics import statistics

Floats = NDArray[np.float64]

#: fits of each scene, and which share of them should hold the truth, in percent
REPEATS, FEWEST, MOST = 400, 92.0, 98.0
#: how far the share of what happens with 95 % is off in 19 of 20 counts, in percent
REACH = 196.0 * (0.95 * 0.05 / REPEATS) ** 0.5

_DROP = """
format: 1
gravity: [0, -9.81]
time: {end: 0.5}
bodies:
  block: {mass: 5, inertia: 0.1, position: [0, 0], velocity: [0, -1]}
members:
  foam:
    {from: {body: ground, at: [0, -1]}, to: {body: block, at: [0, 0]}, design: false,
     law: {type: gap, stiffness: 8000, damping: 20, gap: 0.05, side: compression}}
fit:
  estimate:
    members.foam.law.stiffness: {lower: 1000, upper: 50000, initial: 6000}
    members.foam.law.damping: {lower: 0, upper: 200, initial: 40}
    members.foam.law.gap: {lower: 0.02, upper: 0.08, initial: 0.045}
  measured:
    height: {file: none, response: {displacement: {body: block, component: y}}, deviation: 0.001}
"""
_LINKED = """
format: 1
define: {v: 0.3, spin: 0.5}
gravity: [0, -9.81]
time: {end: 1}
bodies:
  block: {mass: 2, inertia: 0.1, position: [0, 0], velocity: ["=v", 0], angular_velocity: 0}
  arm: {mass: 1, inertia: 0.2, position: [0.5, 0], velocity: ["=v", "=0.25 * spin"], angular_velocity: "=spin"}
joints:
  - {name: pin, type: revolute, bodies: [block, arm], at: [0.25, 0]}
members:
  spring:
    {from: {body: ground, at: [0, 1]}, to: {body: block, at: [0, 0.1]}, design: false,
     law: {type: spring, stiffness: 400, damping: 3}}
  stop:
    {from: {body: ground, at: [0.6, -1]}, to: {body: arm, at: [0.6, 0]}, design: false,
     law: {type: gap, stiffness: 3000, damping: 5, gap: 0.005, side: compression}}
fit:
  estimate:
    members.spring.law.stiffness: {lower: 200, upper: 800, initial: 430}
    members.spring.law.damping: {lower: 0, upper: 10, initial: 2}
    members.stop.law.stiffness: {lower: 1000, upper: 9000, initial: 2800}
    members.stop.law.damping: {lower: 0, upper: 50, initial: 7}
    members.stop.law.gap: {lower: 0.001, upper: 0.05, initial: 0.006}
    bodies.block.mass: {lower: 1, upper: 4, initial: 2.1}
    bodies.arm.mass: {lower: 0.5, upper: 2, initial: 1.05}
    bodies.arm.inertia: {lower: 0.1, upper: 0.4, initial: 0.19}
    define.v: {lower: 0, upper: 1, initial: 0.28}
    define.spin: {lower: 0, upper: 1, initial: 0.45}
  measured:
    lift: {file: none, response: {displacement: {body: block, component: y}}, offset: {lower: -0.1, upper: 0.1}}
    swing: {file: none, response: {angle: {body: arm}}, deviation: 0.003}
    speed:
      {file: none, response: {velocity: {body: arm, component: y, at: [0.6, 0]}}, deviation: 0.02,
       delay: {lower: -0.01, upper: 0.01}}
"""


@dataclass(frozen=True)
class Scene:
    """A scene that is measured: its case, the truth by name where that is not the case, times, deviation not stated."""

    name: str
    text: str
    truth: dict[str, float]
    times: Floats
    deviation: float = 1.0


SCENES = (
    Scene(
        "a block that falls on foam, two impacts",
        _DROP,
        {"members.foam.law.stiffness": 8000.0, "members.foam.law.damping": 20.0, "members.foam.law.gap": 0.05},
        np.linspace(0.01, 0.5, 50),
    ),
    Scene(
        "two linked bodies, three instruments",
        _LINKED,
        {
            "members.spring.law.stiffness": 400.0, "members.spring.law.damping": 3.0,
            "members.stop.law.stiffness": 3000.0, "members.stop.law.damping": 5.0, "members.stop.law.gap": 0.005,
            "bodies.block.mass": 2.0, "bodies.arm.mass": 1.0, "bodies.arm.inertia": 0.2, "define.v": 0.3,
            "define.spin": 0.5, "offset of lift": 0.01, "delay of speed": 0.002,
        },
        np.linspace(0.02, 0.98, 60),
        0.001,
    ),
)  # fmt: skip


def fit() -> Iterator[Table]:
    """Both tables."""
    counted, compared = [], []
    for scene in SCENES:
        problem, truth = _problem(scene)
        rows, first, seconds = _repeats(scene, problem, truth)
        counted += rows
        compared.append(_beside(scene, first, seconds))
    held = sum(int(row[3]) for row in counted)
    share = f"{held} of {REPEATS * len(counted)}, {100.0 * held / (REPEATS * len(counted)):.1f} %"
    yield Table(
        f"How often intervals of 95 % hold the truth, of {REPEATS} fits",
        ("scene", "estimate", "truth", "held", "share", "between"),
        counted,
        (
            f"One motion, with new random noise for each fit. Together {share}. Between: {FEWEST:g} to {MOST:g} %. "
            f"Where intervals hold the truth as often as they say, shares of {REPEATS} fits are within {REACH:.1f} of "
            "95 % in 19 of 20 counts; of 100 fits one row of ten would not be between by chance.",
        ),
    )
    yield Table(
        "A fit beside SciPy's least_squares with differences",
        ("scene", "estimates", "motions", "with differences", "ratio", "minima differ by", "time of a fit"),
        compared,
        (
            "Both with the same deviations, from the same place, to the same tolerances; differences are forward ones. "
            "Minima differ by the largest difference of any estimate, relative to it. The time is that of a whole fit, "
            "with deviations that are estimated and statistics. Motions are counted: one with derivatives takes longer "
            "than one without.",
        ),
    )


def _problem(scene: Scene) -> tuple[FitProblem, Floats]:
    """The fit of what is predicted at the truth, without noise, and the truth (p,)."""
    case = read_case(scene.text)
    assert case.fit is not None
    zero = [
        Measured(each, scene.times, np.zeros(len(scene.times)),
                 None if each.deviation is None else np.full(len(scene.times), each.deviation))
        for each in case.fit.series
    ]  # fmt: skip
    problem = FitProblem(case, zero)
    truth = np.array([scene.truth[name] for name in problem.names])
    return problem.with_values(problem.predicted(truth)), truth


def _noisy(scene: Scene, problem: FitProblem, seed: int) -> FitProblem:
    random = np.random.default_rng(seed)
    size = [np.full(len(each.y), scene.deviation) if each.deviation is None else each.deviation
            for each in problem.measured]  # fmt: skip
    values = [each.y + random.normal(size=len(each.y)) * own for each, own in zip(problem.measured, size, strict=True)]
    return problem.with_values(values)


def _repeats(
    scene: Scene, problem: FitProblem, truth: Floats
) -> tuple[list[tuple[str, ...]], tuple[FitProblem, Minimum], float]:
    """Rows of the first table; the first fit; seconds of a fit."""
    held = np.zeros(len(truth), dtype=np.int64)
    first = None
    began = time.perf_counter()
    for seed in range(REPEATS):
        noisy = _noisy(scene, problem, seed)
        found = fitted(noisy, noisy.initial)
        told = statistics(noisy, found)
        held += (told.low <= truth) & (truth <= told.high)
        if first is None:
            first = noisy, found
    seconds = (time.perf_counter() - began) / REPEATS
    assert first is not None
    rows = [
        (scene.name, name, f"{value:g}", str(count), f"{100.0 * count / REPEATS:.1f} %",
         verdict(FEWEST <= 100.0 * count / REPEATS <= MOST))
        for name, value, count in zip(problem.names, truth.tolist(), held.tolist(), strict=True)
    ]  # fmt: skip
    return rows, first, seconds


def _beside(scene: Scene, first: tuple[FitProblem, Minimum], seconds: float) -> tuple[str, ...]:
    """A row of the second table: the first fit again, with differences."""
    problem, found = first
    width = problem.upper - problem.lower
    before = problem.simulations
    own = minimum(problem, problem.initial, found.deviation)
    motions = problem.simulations - before
    before = problem.simulations

    def residuals(u: Floats) -> Floats:
        trouble, misfit = problem.misfit(problem.lower + width * u)
        assert not trouble, trouble
        return misfit / found.deviation

    other = least_squares(
        residuals, (problem.initial - problem.lower) / width, bounds=(0.0, 1.0), x_scale="jac", ftol=COST,
        xtol=STEP, gtol=SLOPE,
    )  # fmt: skip
    theirs = problem.simulations - before
    x = problem.lower + width * other.x
    apart = float(np.max(np.abs(x - own.x) / np.abs(own.x)))
    return (
        scene.name, str(len(problem.names)), str(motions), str(theirs), f"{theirs / motions:.1f}", f"{apart:.1e}",
        f"{1e3 * seconds:.0f} ms",
    )  # fmt: skip
