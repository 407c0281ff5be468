"""How long the first adaptive step of a general scene may be: a few balances instead of steps that are rejected.

A step that is far too long gives no estimate of how far. What the parabola through the start's accelerations neglects
does: theta(h), the change of the accelerations over it times h^2/2, relative to the motion as the error of a step is.
It grows as (h/tau)^2 (where the accelerations have a slope, as h/tau), which gives tau, the time in which the motion
bends; the error of a step is about first_error (h/tau)^order.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.members import SCALE
from mdstopo.general.model.general_model import CODE, COUNT, PAIR, START
from mdstopo.general.model.strides import first_freedom
from mdstopo.integrators.steps import FORCES, TURN
from mdstopo.mechanics.kinematics.kinematics_interface import (
    add_gross_force,
    advance_coordinates,
    arm_of,
    deflection,
    freedoms,
    gross_loads,
    largest_turn,
    motion_weights,
    noise_of,
    pose_size,
    relative_pose,
    retract,
    rounding_of_pairs,
)
from mdstopo.mechanics.laws.law_table import law_is_given, law_unstretched

#: balances at most; the theta that is small enough to tell tau, the one that is aimed at, and the one from which on it
#: tells nothing: it cannot be larger than 3, as the motion's size has the change of the accelerations in it
MOST_BALANCES, SMALL_THETA, AIMED_THETA, USELESS_THETA = 6, 0.5, 0.1, 2.0
#: what the size of a motion counts as at most (m). A step that is far too long may end at 1e200 m, whose square is no
#: number: relative to an infinite size every error would be zero, and the step would be kept
LARGEST_MOTION = 1e150


@kernel
def unstretched_force(model, k):
    """The largest force of a member of block k at unit strength that does not come from its elongation."""
    code = model.block[k, CODE]
    most = law_unstretched(code, model.law[k], model.curves)
    if law_is_given(code):
        for segment in range(model.level.shape[0]):
            start = model.level[segment, k, 0]
            end = start + (model.times[segment + 1] - model.times[segment]) * model.level[segment, k, 1]
            most = max(most, abs(start), abs(end))
    return most


@kernel
def rounding_at_start(model, member_state, rel, v, stiffness, strain, noise):
    """By how much the displacement of each pair is uncertain at the start because of rounding.

    That of the worst pair by `rounding_of_pairs` holds for all, since joints hand forces on and springs that hold
    against them may be elsewhere; but it is no more than rounding of the pair's size, and just that where a body is
    driven.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      rel (n_pair, POSE): relative poses at the start. v (n,): velocities (m/s, rad/s).
      stiffness (n_pair,): of a pair's members (N/m).
      strain (n_pair,): how far a pair is strained at the start (m).
    Out:
      noise (n_pair,): what is uncertain (m).
    """
    n = v.shape[0]
    inverse = np.empty(n)
    load = np.empty(n)
    gross_loads(model, load)
    for k in range(model.block.shape[0]):
        force = unstretched_force(model, k)
        if force > 0.0:
            total = 0.0
            for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
                total += member_state[SCALE, i]
            add_gross_force(model, rel, model.block[k, PAIR], force * total, load)
    for d in range(n):
        inverse[d] = 1.0 / model.mass[d] if model.free[d] != 0 else 0.0
    rounding_of_pairs(model, inverse, rel, v, load, stiffness, strain, noise)
    most = 0.0
    for p in range(noise.shape[0]):
        most = max(most, noise[p])
    for p in range(noise.shape[0]):
        arm = arm_of(model, rel, p)
        driven = False
        for side in range(2):
            body = model.pair[p, side]
            first = first_freedom(model, body)
            for d in range(first, first + freedoms(model)):
                driven = driven or (body + 1 < model.home.shape[0] and model.free[d] == 0)
        noise[p] = 1e-15 * arm if driven else min(max(noise[p], most), 1e-15 * arm + 1e-300)


@kernel
def motion_scale(model, q, rel, rel0, motion, noise, tolerance, scale):
    """The size of each pair's motion, to which errors are relative.

    Constant:
      model: the compiled scene.
      q (n_q,): coordinates. rel, rel0 (n_pair, POSE): relative poses now, and at the start.
      motion (n_pair,): how far each pair has moved so far (m).
      noise (n_pair,): what rounding leaves of that (m).
      tolerance: error that a step may have, relative.
    Out:
      scale (n_pair,): the lengths that errors are measured against (m).
    """
    widest = 0.0
    for p in range(model.pair.shape[0]):
        scale[p] = min(max(motion[p], deflection(model, rel, rel0, p)), LARGEST_MOTION)
        widest = max(widest, scale[p])
    for p in range(model.pair.shape[0]):
        lost = noise_of(model, noise, rel, q, p)
        scale[p] = min(max(scale[p], 0.01 * widest, lost / tolerance, 1e3 * lost), LARGEST_MOTION)


@kernel
def first_step(
    model, member_state, end, q0, v0, a0, rel0, motion, noise, tolerance, order, first_error, workspace, lam, q, v, a,
    work,
):  # fmt: skip
    """Length of the first step (s).

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      end: time beyond which it does not lead (s).
      q0 (n_q,), v0, a0 (n,): coordinates, velocities, accelerations at the start.
      rel0 (n_pair, POSE): relative poses at the start.
      motion, noise (n_pair,): how far each pair is strained at the start, and what rounding leaves of that (m).
      tolerance, order: error that a step may have, relative; order of the method.
      first_error: error of a step of the length tau, relative to the motion.
    Out:
      lam (n_row,), q (n_q,), v, a (n,): scratch.
      workspace: workspace of a balance, overwritten.
      work (WORK,): counts of work, added to.
    """
    n = v0.shape[0]
    n_pair = model.pair.shape[0]
    t = model.times[0]
    rel = np.empty((n_pair, pose_size(model)))
    scale = np.empty(n_pair)
    weight = np.empty(n)
    more = np.empty(n)
    h = end - t
    for _ in range(MOST_BALANCES):
        advance_coordinates(model, q0, v0, a0, h, q)
        for d in range(n):
            v[d] = v0[d] + h * a0[d]
        singular = solve_accelerations(
            model, member_state, np.int64(0), t + h, q, v, np.bool_(False), workspace, a, lam
        )
        work[FORCES] += 1
        finite = True
        for d in range(n):
            finite = finite and np.isfinite(a[d])
            # with the accelerations' slope: a motion that begins with none has a size, too
            more[d] = h * h / 6.0 * (a[d] - a0[d]) if model.free[d] != 0 else 0.0
        retract(model, q, more, q)
        if singular >= 0 or not finite:
            h *= 0.1
            continue
        relative_pose(model, q, v, rel)
        motion_scale(model, q, rel, rel0, motion, noise, tolerance, scale)
        motion_weights(model, rel, scale, weight)
        theta = 0.0
        for d in range(n):
            theta = max(theta, 0.5 * h * h * weight[d] * abs(a[d] - a0[d]))
        if theta <= SMALL_THETA:
            tau = h / np.sqrt(max(theta, 1e-30))
            turned = largest_turn(model, q0, q, h, v0, v) / h
            allowed = tau * (tolerance / first_error) ** (1.0 / order)
            return min(allowed, TURN / max(turned, 1e-300))
        h *= max(np.sqrt(AIMED_THETA / theta), 0.1) if theta < USELESS_THETA else 0.1
    return end - t  # no length was short enough to tell tau
