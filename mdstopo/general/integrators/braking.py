"""Friction in explicit steps: what velocities are off by, and how long a step that brakes may be.

Where a contact slides no faster than about its `slip`, friction brakes it within slip m / (mu N): a time in which
nothing moves far. Errors of displacements do not see whether such a contact creeps as it should, and an explicit
method is at the limit of its stability there.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.accelerations import solve_unknowns
from mdstopo.general.dynamics.members import MODE, rate_of_row
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.mechanics.contact import CLOSED, MU, SLIP, C, K, contact_force
from mdstopo.mechanics.kinematics.kinematics_interface import contact_directions, contact_drag
from mdstopo.mechanics.kinematics.vectors import cross, dot, minus, norm

#: a step this long, relative to the time in which friction brakes by `slip`, has no error but that of rounding
SETTLED = 0.1
#: what rounding leaves of a velocity, relative to its parts
ROUNDING = 1e-15
#: after HELD steps in a row that are held short by stability (`integrators.steps.STABLE`), a motion is given up if at
#: this length it needs more than HOPELESS times the steps that it may take
HELD, HOPELESS = 1000, 10.0


@kernel
def friction_error(model, member_state, vectors, s, h, q0, v0, q1, v1, a, noise, shaken, tolerance):
    """Estimated error of a step's sliding velocities relative to `slip`, the largest of all contacts that drag.

    What counts is the error of T / (mu N) = tanh(slide / slip), of which 1 / (slip (1 + (slide / slip)^2)) is the slope
    and more, taken where the step is slowest.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      vectors: the plane VECTORS of the method's table (`integrators.runge_kutta_tables`).
      s, h: number of stages; length of the step (s).
      q0, q1 (n_q,), v0, v1 (n,): coordinates and velocities at both ends of the step.
      a (s or more, n): accelerations of its stages.
      noise (n_pair,): what rounding leaves of relative positions (m).
      shaken: what it leaves of the members' forces (N).
      tolerance: error that a step may have, relative.

    Returns the error, 0 where no contact drags, NaN where one appears.
    """
    first = model.member.shape[1]
    last = contact_directions(model) - 1  # the normal; those before it slide
    rows = np.empty((last + 1, pair_freedoms(model)))
    worst = 0.0
    for j in range(model.contact_pair.shape[0]):
        c = model.contact[j]
        if int(member_state[MODE, first + j]) != CLOSED or c[MU] == 0.0:
            continue
        p = model.contact_pair[j]
        height, rise, before = contact_drag(model, j, q0, v0, rows)
        normal = -c[K] * height - c[C] * rise
        _, _, after = contact_drag(model, j, q1, v1, rows)
        slow = slowest_between(before, after)
        fine = 0.0
        coarse = 0.0
        parts = 0.0
        rising = 0.0
        mobility = 0.0
        for m in range(last):
            sum_fine = 0.0
            sum_coarse = 0.0
            for r in range(pair_freedoms(model)):
                d = place_in_pair(model, p, r)
                if model.free[d] != 0:
                    mobility += rows[m, r] * rows[m, r] / model.mass[d]
                parts += abs(rows[m, r] * v1[d])
                for i in range(s):
                    sum_fine += rows[m, r] * vectors[4, i] * a[i, d]
                    sum_coarse += rows[m, r] * vectors[6, i] * a[i, d]
            fine += sum_fine * sum_fine
            coarse += sum_coarse * sum_coarse
        for r in range(pair_freedoms(model)):
            rising += abs(rows[last, r] * v1[place_in_pair(model, p, r)])
        fine = np.sqrt(fine)
        coarse = np.sqrt(coarse)
        brake = c[MU] * mobility * h
        if not brake * abs(normal) > SETTLED * c[SLIP]:
            continue
        rounded = ROUNDING * parts + brake * (c[K] * noise[p] + c[C] * ROUNDING * rising) + mobility * h * shaken
        scale = max(c[SLIP] + slow * slow / c[SLIP], rounded / tolerance)
        fine = h * fine / scale
        coarse = h * coarse / scale
        if not np.isfinite(fine):
            return np.nan
        if fine > 0.0:
            fine = fine * fine / np.sqrt(fine * fine + 0.01 * coarse * coarse)
        worst = max(worst, fine)
    return worst


@part
def slowest_between(before, after):
    """The smallest speed (m/s) on the straight line between two sliding velocities (three numbers each)."""
    forward = dot(before, after)
    if forward >= dot(before, before):
        return norm(before)
    if forward >= dot(after, after):
        return norm(after)
    return norm(cross(before, after)) / norm(minus(after, before))


@kernel
def brake_rate(model, member_state, q, v, enough, workspace):
    """An upper bound of the rate (1/s) at which friction in closed contacts brakes bodies at a state, and the
    contact that brakes most.

    Friction has the slope D = mu N sech^2(slide / slip) / slip in the velocity, in space T / slide across that, damping
    has c; with rows B and the mobility
    G = B M^-1 B^T, in which joints hold what they hold, the rates are the eigenvalues of G D. Their sum is the trace;
    where that is more than `enough`, it is the largest row of |G| D.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v (n,): coordinates and velocities.
      enough: rate up to which the trace will do (1/s).
    In and out:
      workspace: the workspace, with the joints as factorised at the state.

    Returns the rate (1/s), and the column of `member_state` of the contact that brakes most, or -1.
    """
    n = v.shape[0]
    first = model.member.shape[1]
    count = model.contact_pair.shape[0]
    each = contact_directions(model)
    rows = np.empty((each, pair_freedoms(model)))
    kept = np.empty((each * count, pair_freedoms(model)))
    slope = np.zeros(each * count)
    total = 0.0
    largest = 0.0
    who = -1
    for j in range(count):
        c = model.contact[j]
        if int(member_state[MODE, first + j]) != CLOSED or (c[MU] == 0.0 and c[C] == 0.0):
            continue
        p = model.contact_pair[j]
        height, rise, sliding = contact_drag(model, j, q, v, rows)
        slide = sliding[0] if each == 2 else norm(sliding)
        _, _, by_rise, friction, _, _, by_slide = contact_force(c, height, rise, slide, CLOSED)
        slope[each * j] = abs(by_slide)
        if each == 3:
            slope[each * j + 1] = abs(friction) / slide if slide > 0.0 else abs(by_slide)
        slope[each * j + each - 1] = abs(by_rise)
        for i in range(each):
            mobility = 0.0
            for r in range(pair_freedoms(model)):
                kept[each * j + i, r] = rows[i, r]
                d = place_in_pair(model, p, r)
                if model.free[d] != 0:
                    mobility += rows[i, r] * rows[i, r] / model.mass[d]
            total += slope[each * j + i] * mobility
            if slope[each * j + i] * mobility > largest:
                largest = slope[each * j + i] * mobility
                who = first + j
    if not total > enough:
        return total, who
    found = 0.0
    push = np.empty(n)
    held = np.empty(model.size[0])
    for i in range(each * count):
        if slope[i] == 0.0:
            continue
        push[:] = 0.0
        p = model.contact_pair[i // each]
        for r in range(pair_freedoms(model)):
            push[place_in_pair(model, p, r)] = kept[i, r]
        if held.shape[0] > 0:
            held[:] = 0.0
            solve_unknowns(model, workspace, push, held)
        else:
            for d in range(n):
                push[d] = push[d] / model.mass[d] if model.free[d] != 0 else 0.0
        row = 0.0
        for k in range(each * count):
            if slope[k] != 0.0:
                row += abs(rate_of_row(model, model.contact_pair[k // each], kept[k], push)) * slope[k]
        found = max(found, row)
    return min(found, total), who
