"""The interface of an integrator, resolved by the type of its steps when a kernel is compiled.

An integrator is a NamedTuple of steps and these compiled functions; `implement` enters them in the table below.

1. `simulate`, the entry that fills the steps (see `runge_kutta.simulate` for its arguments). It lands on
   every entry of `model.times`, solves the equations of each fixed step to rounding (of an adaptive one to the
   tolerance), and keeps at each stage what the force balance saw (see `steps`).
2. `point_of`: the state at a fraction of a step, to the order of the method, and where the reverse sweep has to start
   for it. `reach`: with what that sweep needs; a method whose interpolation is a partial step keeps that step behind
   the others. May be left out where `point_of` does it all.
3. `parent_of`: the step before a step.
4. `stage_weights`: weights of the stages in the integral over a step.
5. `reverse_step`: a step of the reverse sweep.
6. `carried`: how much else the method carries from step to step; nothing for one-step methods.
7. `steps_of`: the steps' tuple from the arrays of `steps.carve`, because what Python hands over are flat arrays. The
   tag is a tuple of zeros; its length, which is part of its type, says which method is meant.
8. `sample`: energies and their rates along the motion, without its first and last state. May be left out where the
   stages are ordered and exact.
"""

from functools import partial
from typing import Any

from mdstopo.compiler.jit import by_type, kernel
from mdstopo.integrators.steps import ENERGY, ENERGY_RATE, FIRST, TIME

Implementation = Any  # a compiled function

_IMPLEMENTED: dict[str, dict[type, Implementation]] = {"reach": {}, "sample": {}}
_MAKERS: dict[int, Implementation] = {}


def point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """The state at a fraction of a step, by the method's own interpolation.

    Constant:
      model: the compiled scene.
      tables: constant arrays of the method.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      k: number of the step.
      c: fraction of it, 0 to 1.
      damped: whether any force depends on velocity.
    Out:
      q, v (n,): coordinates and velocities there (m, rad; m/s, rad/s).
      work (WORK,): counts of work, added to.

    Returns the step w and its fraction c_w (-1: its end) from which a reverse sweep starts for it.
    """
    raise NotImplementedError


def reach(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """The state at a fraction of a step, with all that a reverse sweep from there needs.

    Constant:
      model: the compiled scene.
      tables: constant arrays of the method.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      k: number of the step.
      c: fraction of it, 0 to 1.
      damped: whether any force depends on velocity.
    Out:
      q, v (n,): coordinates and velocities there (m, rad; m/s, rad/s).
      work (WORK,): counts of work, added to.
      steps: where the interpolation is a partial step, this is kept behind the others.

    Returns the step w and its fraction c_w (-1: its end) from which a reverse sweep starts for it.
    """
    raise NotImplementedError


def sample(steps, count, damped, t, g, d):
    """Times, stored energies and their rates along the motion, without its first and last state.

    In:
      steps: what the integrator kept.
      count: steps that were taken.
      damped: whether any force depends on velocity.
    Out:
      t (S or more,): times (s), rising; S is the number of stages.
      g (S or more,): energies then (J).
      d (S or more,): their rates (W); NaN where unknown.

    Returns how many samples there are.
    """
    raise NotImplementedError


def parent_of(steps, w):
    """The step before step w, -1 where w begins at the start of the motion."""
    raise NotImplementedError


def stage_weights(tables, steps, w, out):
    """out (s,) = weights of the stages in the integral over step w."""
    raise NotImplementedError


def reverse_step(
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning,
    accuracy, work,
):  # fmt: skip
    """Carry derivatives of a response back through a step: its transposed linearisation.

    In:
      pair (n_pair, 2): the bodies of each pair.
      inv_mass (n,): inverse masses and inertias (1/kg, 1/(kg m^2)).
      tables: constant arrays of the method.
      steps: what the integrator kept.
      w: number of the step.
      c_point: fraction of the step at which the response is evaluated; negative: none.
      mu_q, mu_v (n,): derivatives of the response by q and v there; zero where c_point < 0.
      stage_q_bar (s, n): explicit derivatives by the coordinates of the stages; no rows: none.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
      accuracy: relative, to which an iteration has to go; 0: to rounding.
    In and out:
      lam_q, lam_v (n,): derivatives by q and v at the end of the step; become those at its start.
      lam_x (n_carried, n): the same for what else the method carries from step to step.
    Out:
      z (s, n): virtual displacement of each stage's force balance.
      work (WORK,): counts of work, added to.
    """
    raise NotImplementedError


def carried(steps):
    """How many rows lam_x has: none for one-step methods."""
    raise NotImplementedError


def steps_of(tag, arrays):
    """The tuple of steps of the arrays of `steps.carve`; the tag says of which method."""
    raise NotImplementedError


def implement(steps_type: type, tag: tuple[int, ...], steps_of: Implementation, **functions: Implementation) -> None:
    """Enter an integrator's compiled functions for its type of steps, and the one that makes them for its tag."""
    _MAKERS[len(tag)] = steps_of
    for name, function in functions.items():
        _IMPLEMENTED.setdefault(name, {})[steps_type] = function


def _implementation(name: str, steps: Any) -> Implementation | None:
    """The kernel of the interface's function `name` for this type of steps; None where it is none of ours."""
    kind = getattr(steps, "instance_class", None)  # of a named tuple's type
    if kind is None:
        return None
    chosen = _IMPLEMENTED[name].get(kind)
    if chosen is None and name == "reach":
        chosen = _IMPLEMENTED["point_of"].get(kind)
    if chosen is None and name == "sample":
        chosen = sample_stages
    return chosen


@kernel
def sample_stages(steps, count, damped, t, g, d):
    """Every stage of the steps as a sample, for methods whose stages are ordered and exact.

    In:
      steps: what the integrator kept.
      count: steps that were taken.
      damped: whether any force depends on velocity.
    Out:
      t (S or more,): times (s), rising; S is the number of stages.
      g (S or more,): energies then (J).
      d (S or more,): their rates (W).

    Returns how many samples there are.
    """
    first = steps.index[0, FIRST]
    m = steps.index[count, FIRST] - first
    for i in range(m):
        t[i] = steps.scalar[first + i, TIME]
        g[i] = steps.scalar[first + i, ENERGY]
        d[i] = steps.scalar[first + i, ENERGY_RATE]
    return m


for _stub in (point_of, reach, sample, parent_of, stage_weights, reverse_step, carried):
    by_type(_stub, "steps", partial(_implementation, _stub.__name__))
by_type(steps_of, "tag", lambda tag: _MAKERS[len(tag)])
