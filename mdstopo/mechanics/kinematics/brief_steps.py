"""Steps so short that rounding of coordinates hides how far bodies move in them.

Two members that switch within rounding of each other leave such a step between them. A polynomial through both ends has
(q1 - q0) / h in its velocities, and so the rounding of q divided by h: more than the velocity where h is 1e-16 s.
In a brief step velocities are interpolated by themselves instead, and coordinates are their integral from the start.
"""

from mdstopo.compiler.jit import part

#: steps shorter than this part of the simulated time are brief: in longer ones rounding leaves some 1e-8 of velocities
BRIEF = 1e-8


@part
def is_brief(model, h):
    """Whether a step of length h (s) is brief. model: the compiled scene."""
    return h < BRIEF * (model.times[model.times.shape[0] - 1] - model.times[0])


@part
def shares_of_way(c, h):
    """What both ends' velocities contribute to the way up to fraction c of a step in which they change evenly, s."""
    return h * c * (1.0 - 0.5 * c), 0.5 * h * c * c


@part
def evenly_vjp(c, h, bar_q, bar_v, start_q, start_v, end_q, end_v):
    """`kinematics_interface.cubic_vjp` of a brief step.

    c, h: fraction of the step, and its length (s).
    bar_q, bar_v (n,): cotangents of the coordinates and velocities at c.
    start_q, start_v, end_q, end_v (n,): out, those of the start's and the end's.
    """
    first, last = shares_of_way(c, h)
    for d in range(bar_q.shape[0]):
        start_q[d] = bar_q[d]
        start_v[d] = first * bar_q[d] + (1.0 - c) * bar_v[d]
        end_q[d] = 0.0
        end_v[d] = last * bar_q[d] + c * bar_v[d]


@part
def evenly_jvp(c, h, dq, dv, end_dv):
    """`kinematics_interface.cubic_jvp` of a brief step.

    c, h: fraction of the step, and its length (s).
    dq, dv (n,): changes of the start's coordinates and velocities, then of those at c.
    end_dv (n,): of the end's velocities.
    """
    first, last = shares_of_way(c, h)
    for d in range(dq.shape[0]):
        dq[d] += first * dv[d] + last * end_dv[d]
        dv[d] += c * (end_dv[d] - dv[d])
