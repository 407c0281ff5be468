"""What kernels ask of the bodies' kinematics: how coordinates, velocities, poses and points belong together.

The functions here have no contents. A kernel that calls one is compiled with that of the model's kinematics, which
the model's type tells (`move_by`); `planar.PLANAR` has those of bodies in a plane. Sizes of a body are

    N  coordinates q           3 in a plane: x, y, psi            in space 7: x, y, z, unit quaternion
    D  velocities v            3: their derivatives               in space 6: velocity, angular velocity
    T  components of a turn    1                                  in space 3
    A  numbers of an attitude  2: cos - 1 and sin since home       18: a matrix, and its change since home

Velocities, accelerations, forces, cotangents, changes and virtual displacements have D numbers a body, n in all; only
coordinates have N, n_q in all. Of the D numbers the last T are about turning. A pair of bodies has 2 D: those of its
first body, then of its second. A relative pose xi has D components that change at rates xi'. Whoever adds to
coordinates calls `retract` (or what stands beside it), and whoever subtracts some calls `difference`.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from mdstopo.compiler.fields import FloatArray
from mdstopo.compiler.jit import by_type
from mdstopo.compiler.kernel import Kernel

#: what a joint transmits (`transmitted`)
FORCE, MOMENT, ACROSS_FORCE = range(3)
#: rows of `member_works`
ELONGATION, RATE, ALONG, INVERSE = range(4)
WORKS = 4

#: by the name of the model's type
_MOVED_BY: dict[str, "Kinematics"] = {}
#: what a structure's type is called beside its maker (`general.model.bundles`)
_ENDING = "Structure"


@dataclass(frozen=True, kw_only=True)
class Kinematics:
    """The functions by which the bodies of one kind of model, in a plane or in space, move.

    coordinates, freedoms, rotations, attitude: N, D, T, A of a body. rows: the most rows of a joint. at_home (N): the
    coordinates of a body that has not moved. kernels: a function for each of this module, without those that only
    bodies of another kind have (`OPTIONAL`). entries: the module of those that Python calls (`planar_entry`). ends: of
    relative poses (n, POSE) the places d (n, axes), turns S (n, axes, axes), and their rates by time d', S', with which
    the vector from a point p of the first body to a point q of the second is d + S q - p.
    """

    coordinates: int
    freedoms: int
    rotations: int
    attitude: int
    rows: int
    at_home: tuple[float, ...]
    kernels: Mapping[str, Kernel]
    entries: str
    ends: Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray, FloatArray]]

    @property
    def turns_couple(self) -> bool:
        """Whether rotations of a body about its axes act on each other: gyroscopic moments, which depend on
        velocity."""
        return self.load_slopes > self.rotations

    def of_python(self, name: str) -> Callable[..., Any]:
        """A compiled function that Python calls, `slopes_of` or `reactions`."""
        found: Callable[..., Any] = getattr(importlib.import_module(self.entries), name)
        return found

    @property
    def pose_size(self) -> int:
        """How many numbers a relative pose has; `pose_size`, called from Python."""
        return int(self.kernels["pose_size"].py_func(None))

    @property
    def load_slopes(self) -> int:
        """How many slopes of its loads a body has; `load_slopes`, called from Python."""
        return int(self.kernels["load_slopes"].py_func(None))

    def retract(self, q: FloatArray, shift: FloatArray) -> FloatArray:
        """`retract` in Python: coordinates (n_q,) from others and a shift (n,)."""
        out = np.empty_like(q)
        self.kernels["retract"].py_func(None, q, shift, out)
        return out

    def shifts_and_turns(self, change: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The parts of a change (n,) that move and that turn bodies: views (n_body, D - T) and (n_body, T)."""
        by_body = change.reshape(-1, self.freedoms)
        return by_body[:, : -self.rotations], by_body[:, -self.rotations :]

    def difference(self, after: FloatArray, before: FloatArray) -> FloatArray:
        """`difference` in Python: the shift (n,) between coordinates (n_q,)."""
        shift: FloatArray = self.differences(after[None], before)[0]
        return shift

    def differences(self, after: FloatArray, before: FloatArray) -> FloatArray:
        """The changes (T, n) that lead from coordinates (n_q,) to those of many states (T, n_q)."""
        return after - before

    def headings(self, home: FloatArray, vertical: FloatArray, q: FloatArray, stated: FloatArray) -> "Headings":
        """How far bodies at coordinates q (n_q,) have turned about the vertical since others.

        home: of the model. vertical: a direction of any length, of length zero where there is none, and then no body
        in space has a heading; in a plane it does not matter.
        """
        turned = self.shifts_and_turns(self.difference(q, stated))[1]
        return Headings(turned[:, 0], np.ones_like(turned), np.ones_like(turned))


class Headings(NamedTuple):
    """Of each body the angle (n_body,) that it has turned about a direction; the change of a turn (n_body, T) that
    turns it further; and the derivative (n_body, T) of the angle by a change of the turn."""

    angle: FloatArray
    axis: FloatArray
    slope: FloatArray


# Sizes, which are constants where a kernel is compiled


def coordinates(model):
    """How many coordinates a body has (N in the other docstrings)."""
    raise NotImplementedError


def freedoms(model):
    """How many freedoms a body has: components of its velocity (D in the other docstrings)."""
    raise NotImplementedError


def rotations(model):
    """How many of a body's freedoms, the last ones, are rotations (T in the other docstrings)."""
    raise NotImplementedError


def load_slopes(model):
    """How many slopes of its loads a body has: by the T components of its turn, then of its turning rate."""
    raise NotImplementedError


def attitude(model):
    """How many numbers describe the attitude of a body in `turn_bodies` (A)."""
    raise NotImplementedError


def most_rows(model):
    """The largest number of constraint equations that a joint has."""
    raise NotImplementedError


def pose_size(model):
    """How many numbers a relative pose has with its rates (POSE in the other docstrings)."""
    raise NotImplementedError


def joint_places(model):
    """How many numbers tell a joint where its bodies are (PLACES in the other docstrings)."""
    raise NotImplementedError


# Coordinates


def retract(model, q, shift, out):
    """Move bodies by a shift.

    In:
      q (n_q,): coordinates.
      shift (n,): by how much each body moves and turns (m, rad).
    Out:
      out (n_q,): coordinates behind it; may be q.
    """
    raise NotImplementedError


def difference(model, after, before, out):
    """out (n,): the shift by which `retract` leads from coordinates `before` to `after` (n_q,)."""
    raise NotImplementedError


def retract_vjp(model, q, moved, bar, bar_q, bar_shift):
    """Pull a cotangent of what `retract` gives back to what it is given.

    In:
      model: the compiled scene.
      q, moved (n_q,): coordinates before and behind the shift.
      bar (n,): cotangent of those behind it.
    Out:
      bar_q, bar_shift (n,): cotangents of those before it and of the shift.
    """
    raise NotImplementedError


def retract_jvp(model, q, moved, dq, dshift, out):
    """Push changes through `retract`.

    In:
      model: the compiled scene.
      q, moved (n_q,): coordinates before and behind the shift.
      dq, dshift (n,): changes of those before it and of the shift.
    Out:
      out (n,): change of those behind it.
    """
    raise NotImplementedError


def shift_size(model):
    """How many numbers a body has in `shift_tangents` (SHIFT)."""
    raise NotImplementedError


def shift_tangents(model, q, moved, out):
    """The derivatives of the rotations in `retract` by its shift, for `slope_by_shift` and others that take
    `tangents`.

    In:
      model: the compiled scene.
      q, moved (n_q,): coordinates before and behind a shift.
    Out:
      out (n_body, SHIFT): of each body.
    """
    raise NotImplementedError


def slope_by_shift(model, slopes, m, r, i, tangents, body):
    """The slope by one component of a shift, from the slopes by the coordinates behind the shift.

    model: the compiled scene.
    slopes (., ., 2 D), m, r: an array, and where in it the slopes by two bodies stand.
    i: the component, as a place among these.
    tangents (n_body, SHIFT), body: as of `shift_tangents`, and the body that the component belongs to.
    """
    raise NotImplementedError


def turn_slope_by_shift(model, slopes, d, r, tangents, body):
    """As `slope_by_shift`, by the turn of one body only.

    model: the compiled scene.
    slopes (., T or more), d: an array, and its row, with slopes by the turn.
    r: the component of the turn.
    tangents (n_body, SHIFT), body: as of `shift_tangents`, and the body.
    """
    raise NotImplementedError


def add_shift(model, tangents, w, shift, dq):
    """Add to changes of coordinates what a change of a shift makes.

    In:
      model: the compiled scene.
      tangents (n_body, SHIFT): as of `shift_tangents`.
      w, shift (n,): the change of the shift is their product.
    In and out:
      dq (n,): changes of the coordinates behind it.
    """
    raise NotImplementedError


def add_shift_curvature(model, shift, mass, body, first, k):
    """Add how the mass of a body times a shift changes with the coordinates that the shift begins at, less the mass.

    In:
      model: the compiled scene.
      shift, mass (n,): the shift, and the masses of all freedoms.
      body, first: the body, and the place of its first freedom in k.
    In and out:
      k (2 D, 2 D): added to.
    """
    raise NotImplementedError


def turn_back(model, shift, transposed, x):
    """From changes of coordinates behind a shift, the change of the shift that causes them, with the same beginning.

    In:
      model: the compiled scene.
      shift (n,): the shift.
      transposed: whether the transpose of that linear map is meant.
    In and out:
      x (n,): changes of coordinates, then of the shift.
    """
    raise NotImplementedError


def shift_further(model, start, shift, change, q):
    """Change a shift, and with it the coordinates to which it leads.

    In:
      model: the compiled scene.
      start (n_q,): coordinates before the shift.
      change (n,): by how much the shift changes.
    In and out:
      shift (n,): the shift; where coordinates are added to as numbers it is not needed and may stay.
      q (n_q,): coordinates behind it.
    """
    raise NotImplementedError


def advance_coordinates(model, q, v, a, e, out):
    """Where bodies are after some time at constant accelerations.

    In:
      model: the compiled scene.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      e: the time (s); below 0 it leads back.
    Out:
      out (n_q,): coordinates then.
    """
    raise NotImplementedError


def moved_most(model, q, size):
    """How far bodies have moved since home at most (m), a turn as its angle, 1 rad at most, times `size` (m)."""
    raise NotImplementedError


# Steps


def stage_state(model, table, h, i, q0, v0, q, v, a, slopes):
    """Coordinates and velocities of a stage of a Runge-Kutta step, from the stages before it.

    In:
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method (`integrators.runge_kutta_tables`).
      h: length of the step (s).
      i: number of the stage.
      q0 (n_q,), v0 (n,): coordinates and velocities at the start of the step.
      a (s, n): accelerations of the stages before it.
    In and out:
      q (s, n_q), v (s, n): of all stages; those before i are read, those of i written.
      slopes (s, n): what a kinematics keeps of each stage for those behind it; no rows where it keeps nothing.
    """
    raise NotImplementedError


def end_state(model, table, s, h, q0, v0, q, v, a, slopes, q_end, v_end):
    """Coordinates and velocities at the end of an explicit Runge-Kutta step.

    In:
      model: the compiled scene.
      table (3, 17, 17), s: coefficients of the method, and number of its stages.
      h: length of the step (s).
      q0 (n_q,), v0 (n,): coordinates and velocities at its start.
      q (s, n_q), v, a (s, n): those of its stages, and their accelerations.
      slopes (s, n): of `stage_state`.
    Out:
      q_end (n_q,), v_end (n,): coordinates and velocities at its end.
    """
    raise NotImplementedError


def stage_vjp(model, table, h, j, q, v, lam_q, lam_v, u, g, turns, z):
    """The cotangent of a stage's accelerations, from those of what depends on them.

    In:
      model: the compiled scene.
      table (3, 17, 17), h: coefficients of the method, and length of the step (s).
      j: number of the stage.
      q (s, n_q), v (s, n): coordinates and velocities of the stages.
    In and out:
      lam_q, lam_v (n,): cotangents of the end's coordinates and velocities, when the last stage comes.
      u, g (s, n): cotangents of the coordinates and velocities of later stages; stages come one after the other from
        the last on, and what is left of all these, of the one behind j and of lam_q and lam_v, `start_vjp` needs.
      turns (s, n): what a kinematics finds of all stages when the last one comes, and needs at the others.
    Out:
      z (n,): the cotangent.
    """
    raise NotImplementedError


def start_vjp(model, table, s, h, q, v, u, g, lam_q, lam_v):
    """Cotangents of a step's start, from those of its stages and its end.

    In:
      model: the compiled scene.
      table (3, 17, 17), s, h: coefficients of the method, number of stages, length of the step (s).
      q (s, n_q), v (s, n): coordinates and velocities of the stages.
      u, g (s, n): what `stage_vjp` has left of cotangents of these; overwritten.
    In and out:
      lam_q, lam_v (n,): what it has left of those of the end, then cotangents of the start's.
    """
    raise NotImplementedError


def stage_jvp(model, table, h, first, i, q, v, dq, dv, changes):
    """Changes of a stage's coordinates and velocities.

    In:
      model: the compiled scene.
      table (3, 17, 17), h: coefficients of the method, and length of the step (s).
      first, i: numbers of the first stage that changes, and of the stage.
      q (s, n_q), v (s, n): coordinates and velocities of the stages.
      dq, dv (n,): changes of the start's.
    In and out:
      changes (s, 3, n): of the stages' coordinates, velocities, accelerations; the first two of i are written.
    """
    raise NotImplementedError


def end_jvp(model, table, s, h, q, v, changes, dq, dv):
    """Changes of the end of a step.

    In:
      model: the compiled scene.
      table (3, 17, 17), s, h: coefficients of the method, number of stages, length of the step (s).
      q (s, n_q), v (s, n): coordinates and velocities of the stages.
      changes (s, 3, n): changes of the stages' coordinates, velocities, accelerations.
    In and out:
      dq, dv (n,): changes of the start's coordinates and velocities, then of the end's.
    """
    raise NotImplementedError


def cubic(model, c, h, q0, v0, q1, v1, q, v):
    """The cubic through both ends of a step, and its derivative; of a brief one what `brief_steps` tells.

    In:
      model: the compiled scene.
      c, h: fraction of the step, and its length (s).
      q0, q1 (n_q,), v0, v1 (n,): coordinates and velocities at its start and its end.
    Out:
      q (n_q,), v (n,): coordinates and velocities at c.
    """
    raise NotImplementedError


def cubic_vjp(model, c, h, q0, v0, q1, v1, bar_q, bar_v, start_q, start_v, end_q, end_v):
    """Pull cotangents of a cubic back to both ends of the step.

    In:
      model: the compiled scene.
      c, h, q0, v0, q1, v1: as of `cubic`.
      bar_q, bar_v (n,): cotangents of the coordinates and velocities at c.
    Out:
      start_q, start_v, end_q, end_v (n,): those of the start's and the end's.
    """
    raise NotImplementedError


def cubic_jvp(model, c, h, q0, v0, q1, v1, dq, dv, end_dq, end_dv):
    """Push changes of both ends of a step to its cubic.

    In:
      model: the compiled scene.
      c, h, q0, v0, q1, v1: as of `cubic`.
      end_dq, end_dv (n,): changes of the end's coordinates and velocities.
    In and out:
      dq, dv (n,): changes of the start's, then of those at c.
    """
    raise NotImplementedError


def quintic(model, c, h, q0, v0, a0, q1, v1, a1, q, v):
    """The quintic through both ends of a step with their accelerations, and its derivative; of a brief step the cubic.

    In:
      model: the compiled scene.
      c, h: fraction of the step, and its length (s).
      q0, q1 (n_q,), v0, v1, a0, a1 (n,): coordinates, velocities, accelerations at its start and its end.
    Out:
      q (n_q,), v (n,): coordinates and velocities at c.
    """
    raise NotImplementedError


# Windows of collocation: x (n,) is what coordinates have changed by since the start of a window, y and u are its first
# and second derivatives by time. All are of the bodies that are no ground; there may be more numbers behind them


def window_state(model, q0, x, y, q, v):
    """Coordinates and velocities inside a window.

    In:
      model: the compiled scene.
      q0 (n_q,): coordinates at the start of the window.
      x, y (n - D or more,): of the window.
    Out:
      q (n_q,), v (n,): of which those of ground stay.
    """
    raise NotImplementedError


def window_accelerations(model, x, y, u, a):
    """a (n,): accelerations inside a window at x, y, u (n - D or more,); those of ground stay."""
    raise NotImplementedError


def window_rates(model, x, y, a, u):
    """u (n - D or more,) that accelerations a (n,) at x, y correspond to."""
    raise NotImplementedError


def window_size(model):
    """How many numbers a body has in `window_maps` (MAPS)."""
    raise NotImplementedError


def window_maps(model, x, y, u, maps):
    """How coordinates, velocities and accelerations change with x, y and u, for the functions below.

    In:
      model: the compiled scene.
      x, y, u (n - D or more,): of the window.
    Out:
      maps (n_body, MAPS): of each body.
    """
    raise NotImplementedError


def window_rates_with_maps(model, x, y, a, u, maps):
    """`window_rates`, and `window_maps` of what comes out.

    In:
      model: the compiled scene.
      x, y (n - D or more,): of the window.
      a (n,): accelerations there.
    Out:
      u (n - D or more,): what these make of it.
      maps (n_body, MAPS): of each body.
    """
    raise NotImplementedError


def window_jvp(model, maps, dx, dy, dq, dv, da):
    """Push changes of x and y forward, at fixed u.

    In:
      model: the compiled scene.
      maps (n_body, MAPS): of `window_maps`.
      dx, dy (n - D or more,): the changes.
    Out:
      dq, dv, da (n,): those of coordinates, velocities and accelerations; those of ground stay.
    """
    raise NotImplementedError


def window_vjp(model, maps, bar_q, bar_v, bar_a, bar_x, bar_y):
    """The transpose of `window_jvp`.

    In:
      model: the compiled scene.
      maps (n_body, MAPS): of `window_maps`.
      bar_q, bar_v, bar_a (n,): cotangents of coordinates, velocities and accelerations.
    Out:
      bar_x, bar_y (n - D or more,): those of x and y.
    """
    raise NotImplementedError


def window_turn(model, maps, inverse, transposed, x):
    """Multiply by the derivative of coordinates by x, or of accelerations by u, or by its inverse or transpose.

    In:
      model: the compiled scene.
      maps (n_body, MAPS): of `window_maps`.
      inverse: whether by the inverse. transposed: whether by the transpose.
    In and out:
      x (n - D or more,): what is multiplied.
    """
    raise NotImplementedError


def window_start_jvp(model, x, dq0, dq):
    """Add to changes dq (n,) of coordinates at x what a change dq0 (n,) of the start of the window does at fixed x."""
    raise NotImplementedError


def window_start_vjp(model, x, bar_q, bar_q0):
    """The transpose of `window_start_jvp`: from cotangents bar_q (n,) at x to those of the start, added to."""
    raise NotImplementedError


def window_slopes(model, maps, coupled, by_x, by_y):
    """Slopes of u by x and y from those of the accelerations by coordinates and velocities.

    In:
      model: the compiled scene.
      maps (n_body, MAPS): of `window_maps`.
      coupled: whether accelerations depend on velocities of other bodies than their own.
    In and out:
      by_x, by_y (n - D or more, W): rows of slopes by coordinates and velocities, then by x and y; whole vectors
        (`integrators.rows`), zero behind n - D, and where not coupled zero but between numbers of one body.
    """
    raise NotImplementedError


# Prescribed motions


def drive_state(model, segment, t, q, v):
    """Put what is driven of coordinates q (n_q,) and velocities v (n,) where it has to be at time t of a segment."""
    raise NotImplementedError


def drive_acceleration(model, segment, t, a):
    """Put the accelerations of what is driven at time t of a segment into a (n,)."""
    raise NotImplementedError


# Poses


def turn_bodies(model, q, turned):
    """turned (n_body, A): the attitudes of all bodies at coordinates q (n_q,), which pairs and joints share."""
    raise NotImplementedError


def turn_of(model, body, q):
    """The attitude of one body at coordinates q (n_q,): numbers for `stretch_between`."""
    raise NotImplementedError


def relative_pose(model, q, v, rel):
    """rel (n_pair, POSE): relative poses of all pairs and their rates at coordinates q (n_q,) and velocities v (n,)."""
    raise NotImplementedError


def turned_pose(model, p, turned, q, v, rel):
    """`relative_pose` of one pair, of bodies whose attitudes are known.

    In:
      model: the compiled scene.
      p: the pair.
      turned (n_body, A): of `turn_bodies`.
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      rel (n_pair, POSE): relative poses, of which row p is set.
    """
    raise NotImplementedError


def pose_acceleration(model, rel, p, a, out):
    """The second derivative xi'' of the relative pose of pair p: out (D,), from rel (n_pair, POSE) and accelerations a
    (n,)."""
    raise NotImplementedError


def pair_displacement(model, rel, p, dq, out):
    """The change of the relative pose of pair p under a change dq (n,) of all bodies: out (D,)."""
    raise NotImplementedError


def add_pair_force(model, rel, p, force, first, out):
    """Add a force on the relative pose of a pair to the forces on its bodies.

    In:
      model: the compiled scene.
      rel (n_pair, POSE): relative poses.
      p: the pair.
      force, first: the force is force[first : first + D].
    Out:
      out (n,): forces and moments, added to.
    """
    raise NotImplementedError


def pair_tangent(model, p, rel, sums, damped, k_out, c_out):
    """The tangents of a pair in the freedoms of its bodies.

    In:
      model: the compiled scene.
      p: the pair.
      rel (n_pair, POSE): relative poses.
      sums (n_pair, SUMS): forces and tangents by relative poses (`strides.sums_size`).
      damped: whether any force depends on velocity.
    Out:
      k_out, c_out (n_pair, 2 D, 2 D): of which [p] = -dF/dq and, if damped, -dF/dv are written.
    """
    raise NotImplementedError


def pair_matrix_vjp(model, p, m, z, bar):
    """bar (n,) -= m^T z for the matrix m (2 D, 2 D) of pair p and z (n,)."""
    raise NotImplementedError


def pair_pose_vjp(model, p, rel, sums, z, bar):
    """bar (n,) -= K^T z of pair p for z (n,), where nothing is damped, without forming K.

    In:
      model: the compiled scene.
      p: the pair.
      rel (n_pair, POSE), sums (n_pair, SUMS): as `pair_tangent` takes them; of the sums those before C are read.
      z (n,): virtual displacements.
    Out:
      bar (n,): subtracted from.
    """
    raise NotImplementedError


def pair_stiffness(model, sums, p):
    """A measure of how stiff the members of a pair are against displacements (N/m), from its sums."""
    raise NotImplementedError


def turning_rate(model, rel, p):
    """How fast the bodies of a pair turn against each other (rad/s), from rel (n_pair, POSE)."""
    raise NotImplementedError


# Loads


def add_loads(model, segment, t, q, v, f):
    """Add the applied loads, and forces that inertia has at given velocities, to f (n,).

    model, segment, t: the compiled scene, a segment of its times, and the time (s). q (n_q,), v (n,): the state.
    """
    raise NotImplementedError


def load_tangent(model, segment, t, q, v, turn):
    """Slopes of what `add_loads` adds.

    model, segment, t, q, v: as of `add_loads`.
    turn (n, `load_slopes`): out, by the turn of the body that a freedom belongs to, then by its turning rate.
    """
    raise NotImplementedError


def loads_vjp(model, segment, t, q, v, z, bar_q, bar_v):
    """Pull cotangents of what `add_loads` adds back to coordinates and velocities, without forming the slopes.

    In:
      model, segment, t, q, v: as of `add_loads`.
      z (n,): the cotangents, as virtual displacements.
    Out:
      bar_q, bar_v (n,): added to.
    """
    raise NotImplementedError


# Sizes of motions


def home_extent(model):
    """The largest distance of a body from the origin at home (m), along an axis."""
    raise NotImplementedError


def deflection(model, rel, rel0, p):
    """How far the points of pair p have moved between two relative poses (n_pair, POSE), m, at most."""
    raise NotImplementedError


def largest_turn(model, before, after, h, v_before, v_after):
    """How far the bodies of a pair turn against each other between two states, rad, at most.

    model: the compiled scene; before, after (n_q,): coordinates; h: the time between (s); v_before, v_after (n,):
    velocities.
    """
    raise NotImplementedError


def motion_weights(model, rel, scale, weight):
    """weight (n,): what a change of each freedom has to be multiplied by to be a displacement relative to the scale.

    rel (n_pair, POSE): relative poses; scale (n_pair,): of the motion of each pair (m).
    """
    raise NotImplementedError


def noise_of(model, noise, rel, q, p):
    """By how much the displacement of a pair is uncertain because of rounding (m).

    noise (n_pair,): of `rounding_of_pairs`; rel (n_pair, POSE): relative poses; q (n_q,): coordinates; p: the pair.
    """
    raise NotImplementedError


def arm_of(model, rel, p):
    """The distance of the bodies of pair p, plus its reach (m)."""
    raise NotImplementedError


def gross_loads(model, out):
    """out (n,): the largest size of the applied loads on each freedom, without regard to their signs."""
    raise NotImplementedError


def add_gross_force(model, rel, p, force, out):
    """Add a force of any direction between the bodies of pair p (N), and its moments, to out (n,), all positive."""
    raise NotImplementedError


def rounding_of_pairs(model, inverse, rel, v, load, stiffness, strain, noise):
    """Estimate by how much the displacement of each pair is uncertain because of rounding.

    In:
      model: the compiled scene.
      inverse (n,): inverse masses and inertias.
      rel (n_pair, POSE), v (n,): relative poses and velocities at the start.
      load (n,): of `gross_loads`.
      stiffness, strain (n_pair,): of a pair's members (N/m), and how far it is strained at the start (m).
    Out:
      noise (n_pair,): what is uncertain (m).
    """
    raise NotImplementedError


# Members between the bodies of a pair; r (POSE,) is its relative pose, i the member (padded)


def stretch_of(model, i, r):
    """Elongation (m) of member i and its rate (m/s), at a relative pose r."""
    raise NotImplementedError


def member_motion(model, i, r):
    """Length (m), elongation (m) and its rate (m/s); strict floating point."""
    raise NotImplementedError


def motion_of_ends(model, i, r):
    """Elongation (m) and its rate (m/s), from the member's vector without its direction; strict floating point."""
    raise NotImplementedError


def member_work(model, i, r, u):
    """Length (m), elongation (m), and how fast it changes along a change u (D,) of the relative pose."""
    raise NotImplementedError


def second_rate(model, i, r, acc):
    """Second derivative of the elongation by time (m/s^2); acc (D,): xi''."""
    raise NotImplementedError


def stretch_between(model, p, i, turn_one, turn_two, q, v):
    """Elongation (m) and its rate (m/s), as `member_rows` has them, to the bit.

    model: the compiled scene.
    p, i: the pair, and the member (padded).
    turn_one, turn_two: `turn_of` its bodies.
    q (n_q,), v (n,): coordinates and velocities.
    """
    raise NotImplementedError


def member_rows(model, p, i, q, v, row, row_rate):
    """Elongation (m) and its rate (m/s), and the member's row B of the compatibility matrix.

    In:
      model: the compiled scene.
      model: the compiled scene.
      p, i: the pair, and the member (padded).
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      row, row_rate (2 D,): B and dB/dt over the freedoms of both bodies.
    """
    raise NotImplementedError


def end_slopes(model, p, i, side, along, q, v, a, row_slope):
    """Derivatives of the length and of the row B by moving an end of a member in its body, at fixed motion.

    In:
      model: the compiled scene.
      p, i: the pair, and the member (padded).
      side: whose end it is: 0 of the pair's first body, 1 of its second.
      along (D - T or more,): the direction it moves in, in the axes in which the model has the body's points.
      q (n_q,), v, a (n,): coordinates, velocities and accelerations.
    Out:
      row_slope (2 D,): slopes of B (1/m, without unit).

    Returns the slopes, per m that the end moves, of the length, of its rate (1/s) and of its second derivative in time
    (1/s^2), and that second derivative itself (m/s^2). Zeros where the member has no length.
    """
    raise NotImplementedError


def inerter_row(model, q, v, i, p, row, row_rate):
    """B of a member, and what accelerations do not change of the elongation's second derivative.

    In:
      model: the compiled scene.
      p, i: the pair, and the member (padded).
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      row (2 D,): B; zero where the member has no length.
      row_rate (1,): d(row)/dt . v (m/s^2).

    Returns the length (m).
    """
    raise NotImplementedError


def add_inerter_tangents(model, pair, lo, count, inertance, member_state, q, v, a, k_out, c_out):
    """Slopes by coordinates and velocities of what inerters take, sum s b B^T d2Delta/dt2, at fixed a.

    Constant:
      model: the compiled scene.
      pair, lo, count, inertance: the pair, the first of its inerters and how many they are, b of each (kg).
      member_state (3, columns): of which row 0 has s.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      k_out, c_out (n_pair, 2 D, 2 D): to which d/dq and d/dv are added.
    """
    raise NotImplementedError


def keep_apart(model, lo, count, row, before, after):
    """Whether no member's ends can meet on a straight way between two poses (POSE,): all are longer than they move.

    model: the compiled scene. lo, count, row: the members of a block, as of `spring_sums`.
    before, after (POSE,): the poses.
    """
    raise NotImplementedError


def ends_meet(model, i, r, w):
    """Whether the ends of a member meet on straight lines between the poses r and w (POSE,)."""
    raise NotImplementedError


def member_sums(model, code, p, lo, count, counted, t, value, member_state, r, tangent, o):
    """Add the forces, energy and tangents of members of one law to the sums of their pair.

    In:
      model: the compiled scene.
      code, p (PARAMETERS,): the law and its parameters.
      lo, count: the first member (padded), and how many there are.
      counted: whether theirs is part of the stored energy.
      t, value: time (s), and the tabulated force then (N).
      member_state (3, columns): scale, mode and permanent set of every member.
      r (POSE,): relative pose of the pair.
      tangent: whether K and C are wanted.
    Out:
      o (SUMS,): Q, E, E_xi and on demand K, C (`strides.sums_size`), added to.
    """
    raise NotImplementedError


def spring_sums(model, p, start, count, row, counted, member_state, r, tangent, o):
    """`member_sums` of springs.

    In:
      model: the compiled scene.
      p (3 or more,): k, c, preload of the law.
      start, count: the first spring (padded), and how many there are.
      row: of a grid, how many behind each other begin at one point, or minus that; else 0
      (`general.model.general_model.ROW`). counted, member_state, r, tangent: as of `member_sums`.
    Out:
      o (SUMS,): added to.
    """
    raise NotImplementedError


def spring_sums_at_poses(model, p, start, count, row, counted, member_state, rel, pair, poses, tangent, sums):
    """`spring_sums` at many relative poses of their pair, in one pass.

    In:
      model, p, start, count, row, counted, member_state, tangent: as of `spring_sums`.
      rel (poses or more, n_pair, POSE): relative poses.
      pair, poses: number of the pair, and how many poses.
    Out:
      sums (poses or more, n_pair, SUMS): added to.
    """
    raise NotImplementedError


def member_works(model, lo, count, r, u, out):
    """What `member_motion` and `member_work` say of many members, in vectors.

    In:
      model: the compiled scene.
      lo, count: the first member (padded), and how many there are.
      r (POSE,): relative pose of the pair.
      u (D,): change of the pose.
    Out:
      out (WORKS, count or more): elongations (m), their rates (m/s), how fast they change along u, and 1 / L (1/m),
        which is 0 where there is no length; whole vectors, of which what is behind the last member means nothing.
    """
    raise NotImplementedError


def member_designs(model, code, p, lo, count, t, value, member_state, modes_of, r, u, weight, out):
    """Add what members do to a derivative by alpha^mu at one state: f_i (b_i . u) + weight V_i, at unit strength.

    In:
      model: the compiled scene.
      code, p, lo, count, t, value, member_state, r: as of `member_sums`.
      modes_of (columns,): mode of every member.
      u (D,): virtual change of the relative pose.
      weight: factor of the stored energy.
    Out:
      out (M_padded or more,): added to.
    """
    raise NotImplementedError


def spring_designs(model, p, lo, count, row, rel, u, pair, out):
    """`member_designs` of springs without damping and preload, at S poses rel (S, n_pair, POSE) at once.

    model: the compiled scene.
    p (1 or more,): stiffness (N/m) and what else the law has. lo, count, row: the springs. pair: theirs.
    u (S, n_pair, D): virtual changes of the poses. out (M_padded or more,): added to.
    """
    raise NotImplementedError


def has_spring_energies(model):
    """Whether `spring_energies` is implemented."""
    raise NotImplementedError


def spring_energies(model, p, lo, count, rel, pair, weight, out):
    """What the energies of springs without damping and preload add to a derivative by alpha^mu, in vectors.

    model: the compiled scene.
    p (1 or more,), lo, count, pair: as of `spring_designs`. rel (S, n_pair, POSE): poses. weight: of all energies.
    out (M_padded or more,): added to.
    """
    raise NotImplementedError


def spring_designs_of_rows(model, p, lo, count, rel, u, pair, room, out):
    """`spring_designs` of any springs, for R rows.

    In:
      model: the compiled scene.
      model: the compiled scene.
      p (3 or more,): k, c, preload of the law.
      lo, count, pair: the first spring (padded), how many there are, and their pair.
      rel (S, n_pair, POSE): poses.
      u (R, S, n_pair, D): virtual changes of the poses, of each row.
    Out:
      out (R, M_padded or more): added to.
      room (4 S lanes,): scratch.
    """
    raise NotImplementedError


def member_designs_of_rows(model, code, p, lo, count, t, value, member_state, r, u, j, pair, seen, out):
    """`member_designs` without energy, at one pose of S, for R rows.

    In:
      model: the compiled scene.
      code, p, lo, count, t, value, member_state, r: as of `member_sums`.
      u (R, S, n_pair, D): virtual changes of the poses, of each row.
      j, pair: the pose, and the pair of the members.
    Out:
      out (R, M_padded or more): added to.
      seen (D + 2, count or more): scratch.
    """
    raise NotImplementedError


# Joints, bushings, contacts


def place_joint(model, j, q, turned, w):
    """Where the bodies of joint j are: w (PLACES,), at coordinates q (n_q,) and attitudes turned (n_body, A)."""
    raise NotImplementedError


def place_joint_alone(model, j, q, w):
    """Where both bodies of a joint are, as of `place_joint`, where attitudes of bodies are not at hand."""
    raise NotImplementedError


def joint_rows(model, j, w, phi, jac):
    """Phi (rows,) and jac (rows, 2 D) = Phi_q of joint j at w (PLACES,); rows that it has not are left as they are."""
    raise NotImplementedError


def joint_gamma(model, j, w, wd, gamma):
    """gamma (rows,) of Phi_q a + gamma = 0 of joint j at w (PLACES,) and velocities wd (2 D,) of its bodies."""
    raise NotImplementedError


def joint_velocity_slope(model, j, w, wd, out):
    """out (rows, 2 D) = d(Phi_q v)/dq of joint j at w (PLACES,) and velocities wd (2 D,) of its bodies."""
    raise NotImplementedError


def joint_acceleration_slopes(model, j, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma of a joint at fixed a.

    In:
      model: the compiled scene.
      j: the joint.
      w (PLACES,), wd, wdd (2 D,): where its bodies are, their velocities and accelerations.
    Out:
      by_q, by_v (rows, 2 D): d(Phi_q a + gamma)/dq and d(gamma)/dv, in the rows that it has.
    """
    raise NotImplementedError


def joint_stiffness(model, j, w, lam, k):
    """k (2 D, 2 D) += d(Phi_q^T lam)/dq of joint j at w (PLACES,), lam (rows,) its multipliers."""
    raise NotImplementedError


def joint_is_point(model, j):
    """Whether joint j only holds two points together, so that `point_joint_vjp` can be used."""
    raise NotImplementedError


def places_points(model):
    """Whether `point_joint_vjp` reads where the bodies of a joint are (`accelerations.place_joints`), or the state."""
    raise NotImplementedError


def point_joint_vjp(model, j, own, turned, v, a, lam, z, y, bar_q, bar_v):
    """`accelerations.joints_vjp` of a joint whose first rows put two points together and whose others are linear.

    In:
      model: the compiled scene.
      j: the joint.
      own (4, PLACES): if it `places_points` where its bodies are, their velocities and accelerations, its multipliers.
      turned (n_body, A), v, a (n,), lam (n_row,): attitudes, velocities, accelerations and multipliers of the state.
      z (n,), y (n_row,): adjoint variables of the equations of motion and of the joints' rows.
    Out:
      bar_q, bar_v (n,): cotangents of coordinates and velocities, added to.
    """
    raise NotImplementedError


def add_bushings(model, rel, q, tangent, sums):
    """sums (n_pair, SUMS) += forces of the bushings and on demand their tangents.

    rel (n_pair, POSE), q (n_q,): relative poses, and coordinates. tangent: whether K and C are wanted.
    """
    raise NotImplementedError


def contact_directions(model):
    """In how many directions a contact pushes: those in which its point slides, and the normal."""
    raise NotImplementedError


def contact_seen(model, j, r):
    """Where the point of a contact lies against the edge or surface.

    model: the compiled scene. j: the contact. r (POSE,): relative pose of its pair.

    Returns its height above it (m) with the rate (m/s), the room to its nearest end (m; infinite where there is none)
    with the rate (m/s), and which end that is.
    """
    raise NotImplementedError


def contact_second_rise(model, j, r, acc):
    """Second derivative of the height of contact j by time (m/s^2); r (POSE,): its pose; acc (D,): xi''."""
    raise NotImplementedError


def contact_distance(model, j, r):
    """The distance of the point of contact j from the centre or axis of its curved surface (m); infinite where it is
    flat."""
    raise NotImplementedError


def contact_ends(model, j, q, v, rows, rate):
    """Height of the point of a contact, and its room to the nearest end (m), with slopes.

    In:
      model: the compiled scene.
      j: the contact.
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      rows (2, 2 D): slopes of room and of height by the freedoms of both bodies.
      rate (2 D,): d(rows[1] v)/dq.
    """
    raise NotImplementedError


def contact_drag(model, j, q, v, rows):
    """The velocity at which the point of a contact slides, in the directions in which it is pushed.

    In:
      model: the compiled scene.
      j: the contact.
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      rows (directions, 2 D): slopes of its place by the freedoms of both bodies: along what it slides, in space across
        that, too, and last along the normal.

    Returns the height (m), its rate (m/s), and the sliding velocity as the edge's or surface's body sees it (m/s):
    three numbers, of which a plane uses the first.
    """
    raise NotImplementedError


def add_contact(model, j, r, q, v, tangent, f, k, d):
    """Add the normal force and the friction of a closed contact, and on demand their tangents.

    In:
      model: the compiled scene.
      j: the contact.
      r (POSE,): relative pose of its pair.
      q (n_q,), v (n,): coordinates and velocities.
      tangent: whether k and d are wanted.
    Out, added to:
      f (n,): forces and moments (N, N m).
      k, d (2 D, 2 D): -dF/dq and -dF/dv of its pair.
    """
    raise NotImplementedError


def transmitted(model, j, which, q, lam, by_lam, by_q):
    """Norm of the force or of the moment that a joint transmits, at the first body's joint point.

    In:
      model: the compiled scene.
      j: the joint.
      which: FORCE or MOMENT; in a plane ACROSS_FORCE: the norm of the force, with the slopes of the component
        perpendicular to it, a quarter turn ahead, in global axes; these are zero where the force has one direction.
      q (n_q,): coordinates.
      lam (rows,): its multipliers.
    Out:
      by_lam (rows,), by_q (2 D,): slopes; zero where the norm is zero.

    Returns it (N or N m).
    """
    raise NotImplementedError


# Motion of points


def point_motion(model, order, component, at, before, b, r, q, v, a, bars):
    """Displacement, velocity or acceleration of a point of body b as seen from body r: a component or the norm.

    In:
      model: the compiled scene.
      order: of the derivative by time, 0 to 2.
      component: `components.X`, Y, NORM or ACROSS; in space X, Y, Z or NORM.
      at (D - T or more,): the point in the frame of b (m).
      before (D - T or more,): the displacement from home that displacements count from, along the axes of r (m).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      bars (3, n): slopes by q, v, a, added to.
    """
    raise NotImplementedError


def angle_motion(model, order, b, r, q, v, a, bars):
    """In a plane: the angle of body b as seen from body r, or its first or second derivative.

    In:
      model: the compiled scene.
      order: of the derivative.
      b, r: the bodies.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      bars (3, n): slopes by q, v, a, added to.
    """
    raise NotImplementedError


def turn_motion(model, order, component, b, r, q, v, a, bars):
    """In space: how body b has turned since the start as seen from body r, or how fast it turns.

    Of order 0 it is the rotation vector of S(t) S(start)^T, S = R_r^T R_b; of order 1 the angular velocity
    omega_b - omega_r, of order 2 the derivatives of its components by time: all in the axes of r.

    In:
      model: the compiled scene.
      order: 0 to 2.
      component: `components.X`, Y, Z or NORM.
      b, r: the bodies.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      bars (3, n): slopes by q, v, a, added to.
    """
    raise NotImplementedError


def tilt_motion(model, at, b, r, q, v, a, bars):
    """In space: the angle between an axis of body b now and at the start, as seen from body r.

    In:
      model: the compiled scene.
      at (3 or more,): the axis, a unit vector in the frame of b.
      b, r: the bodies.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      bars (3, n): slopes by q, v, a, added to.
    """
    raise NotImplementedError


#: functions that only one kind of bodies has: an angle is a number in a plane, a turn has three components in space
OPTIONAL = frozenset({"angle_motion", "turn_motion", "tilt_motion"})

#: all of the functions above, by name
INTERFACE: dict[str, Callable[..., Any]] = {
    name: each for name, each in globals().items() if isinstance(each, FunctionType) and each.__module__ == __name__
}


def move_by(maker: type, kinematics: Kinematics) -> None:
    """Register the kinematics of the models that `maker` makes in kernels (`general.model.bundles`)."""
    _MOVED_BY[maker.__name__] = kinematics


def kinematics_of(model: Any) -> Kinematics:
    """How the bodies of a model move, from its type in a kernel that is compiled."""
    return _MOVED_BY[type(model).__name__.removesuffix(_ENDING)]


def _of(name: str, model: Any) -> Any:
    return kinematics_of(model).kernels[name]


for _name, _stub in INTERFACE.items():
    by_type(_stub, "model", partial(_of, _name))
