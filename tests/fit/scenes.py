"""Scenes that tests of `mdstopo fit` measure, and what is measured of them at a truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.sections.measurements import Measured
from mdstopo.fit.fit_problem import FitProblem

#: a block on a spring, which it meets, leaves and meets again
DROP = """
format: 1
define: {v: 1}
gravity: [0, -9.81]
time: {end: 0.5}
bodies:
  block: {mass: 5, inertia: 0.1, position: [0, 0], velocity: [0, "=-v"]}
members:
  foam:
    from: {body: ground, at: [0, -1]}
    to: {body: block, at: [0, 0]}
    law: {type: gap, stiffness: 8000, damping: 20, gap: 0.05, side: compression}
    design: false
fit:
  estimate:
    members.foam.law.stiffness: {lower: 1000, upper: 50000, initial: 6000}
    members.foam.law.damping: {lower: 0, upper: 200, initial: 40}
    members.foam.law.gap: {lower: 0.02, upper: 0.08, initial: 0.045}
  measured:
    height:
      file: height.csv
      response: {displacement: {body: block, component: y}}
      deviation: 0.001
"""
#: two springs side by side, which nobody can tell apart, and a mass
PAIR = """
format: 1
time: {end: 1}
bodies:
  block: {mass: 2, inertia: 0.1, position: [0, 0], velocity: [1, 0]}
members:
  one:
    {from: {body: ground, at: [-1, 0]}, to: {body: block, at: [0, 0]}, design: false,
     law: {type: spring, stiffness: 60, damping: 0.5}}
  two:
    {from: {body: ground, at: [-1, 0]}, to: {body: block, at: [0, 0]}, design: false,
     law: {type: spring, stiffness: 40}}
fit:
  estimate:
    members.one.law.stiffness: {lower: 1, upper: 100}
    members.two.law.stiffness: {lower: 1, upper: 100}
    members.one.law.damping: {lower: 0, upper: 5}
  measured:
    travel: {file: travel.csv, response: {displacement: {body: block, component: x}}, deviation: 0.002}
"""


def problem_of(text: str, t: Mapping[str, FloatArray], **changes: Any) -> FitProblem:
    """A fit whose series have zeros at times t, to be asked for predictions. changes: of the section."""
    case = read_case(text)
    assert case.fit is not None
    case = replace(case, fit=replace(case.fit, **changes))
    return FitProblem(case, [_measured(case, name, t[name], np.zeros(len(t[name]))) for name in t])


def measured(problem: FitProblem, truth: FloatArray, seed: int | None, size: float = 1.0) -> FitProblem:
    """The same fit of what is predicted at the truth (p,), with noise of the stated deviations, or `size` without."""
    random = np.random.default_rng(seed)
    found = []
    for each, y in zip(problem.measured, problem.predicted(truth), strict=True):
        deviation = np.full(len(y), size) if each.deviation is None else each.deviation
        noise = random.normal(size=len(y)) * deviation if seed is not None else 0.0
        found.append(each._replace(y=y + noise))
    return FitProblem(problem.case, found)


def _measured(case: Case, name: str, t: FloatArray, y: FloatArray) -> Measured:
    assert case.fit is not None
    series = next(each for each in case.fit.series if each.name == name)
    deviation = None if series.deviation is None else np.full(len(t), series.deviation)
    return Measured(series, t, y, deviation)
