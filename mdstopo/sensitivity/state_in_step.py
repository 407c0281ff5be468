"""The state at which a response is evaluated: at a fraction of a step, or at its ends."""

from mdstopo.compiler.jit import part
from mdstopo.integrators.steps import Q, V
from mdstopo.integrators.steps_interface import reach


@part
def state_in_step(motion, tables, strength, steps, count, k, c, damped, q, v, work):
    """The state at a fraction of a step, and where a reverse sweep begins for it: step and fraction, -1 its end.

    Constant:
      motion: the compiled scene with the members that the motion was computed with.
      tables: constant arrays of the integrator.
      strength (3, M_padded): of these members, times alpha^mu (N/m, N s/m, N).
    In:
      steps: what the integrator kept.
      count: steps that were taken.
      k: number of the step.
      c: fraction of it, 0 to 1.
      damped: whether any force depends on velocity.
    Out:
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
      work (WORK,): counts of work, added to.
    """
    w = k
    c_w = -1.0
    if c >= 1.0 or (k == 0 and c == 0.0):
        state = steps.state[k + 1 if c >= 1.0 else 0]
        for d in range(q.shape[0]):
            q[d] = state[Q, d]
            v[d] = state[V, d]
    else:
        w, c_w = reach(motion, tables, strength, steps, count, k, c, damped, q, v, work)
    return w, c_w
