"""What the tests of variables share."""

import numpy as np

from mdstopo.engine import Evaluator
from mdstopo.session.run_session import run_session
from tests.reading import case_of

#: objectives and a constraint of a scene with the body `m` and the group of members `t`
OBJECTIVES = """\
objectives:
  E: {response: energy, over_time: max}
  M: {response: energy, over_time: mean}
  X: {response: {displacement: {body: m, at: [0.1, 0.1]}}, over_time: final}
  B: {response: {member_force: {group: t}}, over_time: max}
  A: {response: {acceleration: {body: m, component: x}}, over_time: rms}
combine: {weights: {E: 1, M: 1, X: 1, B: 1, A: 1}, normalize: false}
constraints:
  - {response: {angle: {body: m}}, over_time: max_abs, limit: 3}
"""
#: two bodies with points that members may join, for 0.3 s
FRAME_AND_LOAD = """\
format: 1
time: {end: 0.3}
bodies:
  frame: {mass: 20, inertia: 4, position: [0, 0]}
  load: {mass: 5, inertia: 0.5, position: [0, 1], velocity: [1.5, 0], angular_velocity: 1}
points:
  left: {body: frame, grid: {line: {from: [-1, 0], to: [-1, 1], count: 3}}}
  right: {body: frame, grid: {line: {from: [1, 0], to: [1, 1], count: 3}}}
  belt: {body: load, grid: {list: [[-0.2, 1], [0.2, 1]]}}
"""


def with_variables(text, group, parameters, **solver):
    """The case with parameters of a group as variables: by name their value, and bounds."""
    variables = ", ".join(
        f"{name}: {{group: {group}, parameter: {name}, initial: {value}, lower: {lower}, upper: {upper}}}"
        for name, (value, lower, upper) in parameters.items()
    )
    return case_of(text.replace("VARIABLES", variables), **solver)


def whole(found, name):
    """The derivative of an objective, or of a constraint (its number), by alpha and all values, as one vector."""
    if isinstance(name, int):
        own, named = found.constraint_gradients[name], found.constraint_variable_gradients
        return np.concatenate([own, *(named[each][name] for each in named)])
    return np.concatenate([found.gradients[name], *found.variable_gradients[name].values()])


def differences(case, design, direction, h):
    """Derivatives of objectives and constraints along a direction (N + P,), by sixth-order central differences."""
    evaluator = Evaluator(case)
    total = {}
    for m, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
        for sign in (1.0, -1.0):
            found = evaluator.evaluate(design + sign * m * h * direction, gradient=False)
            assert found.status.ok, found.message
            for name, value in (*found.objectives.items(), *enumerate(found.constraints)):
                total[name] = total.get(name, 0.0) + sign * weight * value / h
    return total


def widths(case):
    """How far each entry of a design can go: what derivatives are made comparable by."""
    return np.concatenate([np.ones(case.n_design), *(np.full(v.count, v.upper - v.lower) for v in case.variables)])


def whole_and_resumed(case, folder):
    """A run, and the same run stopped after its fourth iterate and resumed."""
    whole = run_session(case, path=folder / "whole.h5")
    reached: list[int] = []
    run_session(
        case,
        path=folder / "parts.h5",
        on_iteration=lambda progress: reached.append(progress.iteration),
        stop_requested=lambda: len(reached) > 3,
    )
    return whole, run_session(case, path=folder / "parts.h5", resume=True)
