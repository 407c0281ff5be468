"""What a method of integration does for responses and sweeps, chosen by its tag when a kernel is compiled.

The tag is a tuple of zeros whose length says which method is meant. A method has these functions:

1. `point_of`: the state inside a step;
2. `step_back`: a step of the reverse sweep;
3. `step_forward`: changes pushed through a step; `carried`: how many vectors beside the state go with them;
4. `state_at_offset`: the motion a little later; `derivatives`: how many of its derivatives are those of the balance;
   `is_continuous`: whether states inside a step are at hand; `is_explicit`: whether stages follow from those before
   them, and the first is the start of the step; `ends_in_stage`: whether the last one is its end;
5. `weights_of`: weights of a step's stages in an integral.

A Runge-Kutta method that takes the steps of `adaptive_steps` has three more:

6. `make_stages`: the balances of its stages; `step_error`: what they tell of the step's error;
7. `scheme`: how many stages it has, and its order.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from mdstopo.compiler.jit import by_type

IMPLEMENTED: dict[str, dict[int, Any]] = {
    "point_of": {},
    "step_back": {},
    "step_forward": {},
    "state_at_offset": {},
    "carried": {},
    "derivatives": {},
    "is_continuous": {},
    "weights_of": {},
    "make_stages": {},
    "step_error": {},
    "scheme": {},
    "is_explicit": {},
    "ends_in_stage": {},
}
#: what `make_stages` returns of an implicit stage that is not found: no place of an unknown
UNSOLVED = 2**40


def point_of(tag, model, tables, member_state, history, count, k, c, keep, workspace, q, v, work):
    """The state inside a step.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      count: how many steps the run has.
      k, c: the step, and a fraction of it above 0 and below 1.
      keep: whether the state is to be an end from which the reverse sweep can start.
    In and out:
      history: the history of steps; with `keep` a partial step may come behind the others.
      member_state (3, columns): state of the members; where forces are summed, modes and sets are put to those of the
        step.
    Out:
      q (n_q,), v (n,): coordinates and velocities.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.

    Returns the step at whose end (or at whose fraction c, if it is k) the reverse sweep starts; k without `keep`.
    """
    raise NotImplementedError


def step_back(tag, model, tables, history, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, workspace, work):
    """Pull R cotangents of the end of a step back to its start, in place; what a stage needs is formed once for all R.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, w: the history of steps, and the step.
      c (R,): the fraction of the step to which each cotangent belongs; 1: its end.
      bars (s, 3, n), rows_bar (s, n_row): explicit cotangents of the stages' q, v, a and multipliers, the same for all
        R; no rows where there are none.
    In and out:
      lam_q, lam_v (R, n): cotangents of coordinates and velocities.
      lam_x (R, 2, n): those of what the method carries from step to step beside the state.
    Out:
      z (R, s or more, n): the virtual displacements of the stages' balances.
      y (n_row,): scratch.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.
    """
    raise NotImplementedError


def step_forward(tag, model, tables, history, w, c, iterations, dq, dv, dx, force, changes, rows, workspace):
    """Push R changes through a step; what a stage needs is formed once for all R.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, w, c: the history of steps, the step, and the fraction of it at which it is taken to end.
      iterations: above 0, implicit stages are solved by so many fixed-point iterations at most (`iterative`).
      force (R, s or more, n): changes of the force at each stage.
    In and out:
      dq, dv (R, n): changes of coordinates and velocities, of the start and then of the end.
      dx (R, 2, n): those of what the method carries from step to step beside the state.
    Out:
      changes (R, s or more, 3, n), rows (R, s or more, n_row): changes of the stages' q, v, a and multipliers.
      workspace: workspace of a balance, overwritten.

    Returns whether all iterations settled.
    """
    raise NotImplementedError


def carried(tag):
    """How many vectors (n,) a step hands to the next beside q and v: the first of the two of `step_forward`'s dx."""
    raise NotImplementedError


def state_at_offset(tag, model, history, k, c, e, q, v, a, q_out, v_out):
    """Coordinates and velocities a little later than at fraction c of step k.

    Constant:
      tag: the integrator.
      model: the compiled scene.
      history, k, c: the history of steps, the step, and a fraction of it.
      e: how much later (s); below 0: earlier.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations at c.
    Out:
      q_out (n_q,), v_out (n,): coordinates and velocities then.
    """
    raise NotImplementedError


def derivatives(tag):
    """How many derivatives of the method's motion are those of the equations of motion: 1, velocities; 2, accelerations
    too."""
    raise NotImplementedError


def is_continuous(tag):
    """Whether `point_of` computes no forces. Then samples are taken there; else on the quintic through a step's
    ends."""
    raise NotImplementedError


def weights_of(tag, model, tables, history, w, out):
    """Weights of the stages in the integral over a step.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, w: the history of steps, and the step.
    Out:
      out (s or more,): the weights (s).
    """
    raise NotImplementedError


def make_stages(
    tag, model, table, first, stop, member_state, segment, t, h, q0, v0, tangent, o, workspace, lam, q, v, a, history,
    work,
):  # fmt: skip
    """Make the balances of some stages of a step.

    Constant:
      tag: the integrator.
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method.
      first, stop: numbers of the first stage to be made, and of the one behind the last.
    In:
      member_state (3, columns): state of the members.
      segment: number of the stretch of time between two breakpoints.
      t, h: time at the start, and length of the step (s).
      q0 (n_q,), v0 (n,): coordinates and velocities at the start.
      tangent: whether the tangents of the stages are wanted.
      o: number in `history` of the step's stage 0; -1: stages are not kept.
    Out:
      workspace: workspace of a balance, overwritten.
      lam (n_row,): multipliers of the joints at the last stage.
      q (17, n_q), v, a (17, n): coordinates, velocities, accelerations of the stages; of implicit methods a has behind
        them what `step_error` reads.
      history: the history of steps, where stages are kept.
      work (WORK,): counts of work, added to.

    Returns -1, the place of an unknown at which the joints are singular, or UNSOLVED.
    """
    raise NotImplementedError


def step_error(tag, vectors, s, h, longest, a, weight):
    """Estimate the error of a step relative to the motion; NaN where one appears.

    Constant:
      tag: the integrator.
      vectors (17, 17): plane VECTORS of the method's table.
      s: number of stages.
    In:
      h, longest: lengths of the step, and of the longest so far (s).
      a (17, n): as `make_stages` leaves them.
      weight (n,): of `motion_weights`.
    """
    raise NotImplementedError


def scheme(tag, method):
    """Number of stages, order, and the error of a first step (`first_step`).

    tag: the integrator. method: 0 where nothing depends on velocity and nothing switches, else 1.
    """
    raise NotImplementedError


def is_explicit(tag):
    """Whether stages follow from those before them, and the first is the start of the step."""
    raise NotImplementedError


def ends_in_stage(tag):
    """Whether the last stage of a step is its end, but for what joints move this by."""
    raise NotImplementedError


def implement(tag: tuple[int, ...], **functions: Callable[..., Any]) -> None:
    """Register the compiled functions of a method of integration under its tag."""
    for name, function in functions.items():
        IMPLEMENTED[name][len(tag)] = function


def _of(name: str, tag: Any) -> Any:
    return IMPLEMENTED[name][len(tag)]


for _stub in (
    point_of, step_back, step_forward, carried, state_at_offset, derivatives, is_continuous, weights_of, make_stages,
    step_error, scheme, is_explicit, ends_in_stage,
):  # fmt: skip
    by_type(_stub, "tag", partial(_of, _stub.__name__))
