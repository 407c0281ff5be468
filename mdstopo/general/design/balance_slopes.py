"""Derivatives by numbers that masses, loads and velocities at the start follow from: what they add to every balance.

A number p of the scene on which neither places nor laws depend stands in the balance M a + Phi_q^T lam = F(q, v, t) as

    d(M a + Phi_q^T lam - F)/dp = M_p a - F_p,

and in the velocities at the start. With the virtual displacements z of the stages (`adjoint`) and the cotangents of the
velocities at the start lam_v, dG/dp = lam_v . v0_p - sum z . (M_p a - F_p). Positions, members and joints stay as they
are, and so do the margins of members that switch: no event varies but by the motion.

M_p, F_p and v0_p are central differences of two scenes, one with a larger and one with a smaller number: exact where
they are of second degree at most in it, as a mass times an acceleration is that both follow from it.
"""

import numpy as np

from mdstopo.compiler.jit import by_type, kernel
from mdstopo.general.model.general_model import planar_twin, spatial_twin
from mdstopo.mechanics.kinematics.kinematics_interface import add_loads

_TWINS = {"PlanarView": planar_twin, "SpatialView": spatial_twin}


def twin_of(model, b, side):
    """A scene that differs in number b alone, which is larger (side 0) or smaller (side 1): masses, loads and
    velocities."""
    raise NotImplementedError


by_type(twin_of, "model", lambda kind: _TWINS[type(kind).__name__.removesuffix("Structure")])


@kernel
def balance_slope(one, other, apart, segment, t, q, v, a, f, out):
    """Derivative of M a - F by a number of the scene that only masses and loads depend on, at fixed motion.

    Constant:
      one, other: the scene with a larger and with a smaller number.
      apart: by how much the numbers differ.
    In:
      segment, t: segment of the scene's times, and time in it (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      out (n,): the derivative (N, N m per unit of the number). f (n,): scratch.
    """
    f[:] = 0.0
    add_loads(other, segment, t, q, v, f)
    for d in range(out.shape[0]):
        out[d] = (one.mass[d] - other.mass[d]) * a[d] + f[d]
    f[:] = 0.0
    add_loads(one, segment, t, q, v, f)
    for d in range(out.shape[0]):
        out[d] = (out[d] - f[d]) / apart


@kernel
def number_slope(model, b, segment, t, q, v, a, f, out):
    """`balance_slope` by number b of a scene that is differentiated by it.

    Constant:
      model: the compiled scene. b: the number.
    In:
      segment, t: segment of `model.times`, and time in it (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      out (n,): the derivative (N, N m per unit of the number). f (n,): scratch.
    """
    balance_slope(twin_of(model, b, 0), twin_of(model, b, 1), model.apart[b], segment, t, q, v, a, f, out)


@kernel
def add_numbers(model, segment, t, q, v, a, z, out):
    """Add -z . (M_p a - F_p) to the derivatives by the numbers p of the scene, at one state.

    Constant:
      model: the compiled scene.
    In:
      segment, t: segment of `model.times`, and time in it (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      z (n,): virtual displacements at this state.
    Out:
      out (M_padded + P,): added to at its end.
    """
    n = model.mass.shape[0]
    f = np.empty(n)
    slope = np.empty(n)
    count = model.apart.shape[0]
    for b in range(count):
        number_slope(model, b, segment, t, q, v, a, f, slope)
        total = 0.0
        for d in range(n):
            total += slope[d] * z[d]
        out[out.shape[0] - count + b] -= total


@kernel
def add_numbers_of_rows(model, segment, history, at, z, j, out):
    """`add_numbers` for many rows at one stage.

    model: the compiled scene.
    segment: number of the stretch of time between two breakpoints.
    history, at: the history of steps (`StepHistory`), and the number of the stage.
    z (R, 17, n): virtual displacements of each row at each stage.
    j: the stage, counted from the first of the step.
    out (R, M_padded + P): added to at its end.
    """
    n = model.mass.shape[0]
    f = np.empty(n)
    slope = np.empty(n)
    count = model.apart.shape[0]
    for b in range(count):
        number_slope(
            model, b, segment, history.when[at], history.stage_q[at], history.stage_v[at], history.stage_a[at], f, slope
        )
        for m in range(out.shape[0]):
            total = 0.0
            for d in range(n):
                total += slope[d] * z[m, j, d]
            out[m, out.shape[1] - count + b] -= total


@kernel
def add_start_velocities(model, lam_v, out):
    """Add the derivatives by the velocities at the start, whose cotangents are lam_v (n,): out (M_padded + P,)."""
    count = model.apart.shape[0]
    for b in range(count):
        one = twin_of(model, b, 0)
        other = twin_of(model, b, 1)
        for d in range(lam_v.shape[0]):
            out[out.shape[0] - count + b] += lam_v[d] * (one.v0[d] - other.v0[d]) / model.apart[b]


@kernel
def begin_velocities(model, place, states):
    """Put the derivatives of the velocities at the start into states (W + 1, M_padded + P) of `direct`.

    place (F,): the free freedoms.
    """
    free = place.shape[0]
    count = model.apart.shape[0]
    for b in range(count):
        one = twin_of(model, b, 0)
        other = twin_of(model, b, 1)
        for k in range(free):
            slope = (one.v0[place[k]] - other.v0[place[k]]) / model.apart[b]
            states[free + k, states.shape[1] - count + b] = slope
