"""The duties of an integrator, resolved by the type of its steps when a kernel is compiled.

An integrator is a NamedTuple of steps and these compiled functions; `implement` enters them in the table below.

1. `simulate(ints, floats, tables, alpha, damped, tangent, settings, limits, room, room_ints, strength, work) ->
   (code, count, time reached)`, the entry that fills the steps (see `driver`). It lands on every entry of
   `model.times`, solves the equations of each fixed step to rounding (of an adaptive one to the tolerance), and keeps
   at each stage what the force balance saw (see `steps`).
2. `point_of(model, tables, strength, steps, count, k, c, damped, q, v, work) -> (w, c_w)`: the state at fraction c of
   step k, to the order of the method, and where the reverse sweep has to start for it: step w at its fraction c_w (-1:
   at its end). `reach`, with the same arguments, also leaves what the reverse sweep needs: a method whose
   interpolation is a partial step keeps that step behind the others. May be left out where `point_of` does it all.
3. `parent_of(steps, w)`: the step before step w, -1 where w begins at the start.
4. `stage_weights(tables, steps, w, out)`: weights (s,) of the stages in the integral over step w.
5. `reverse_step(pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped,
   turning, accuracy, work)`: pulls cotangents back through step w, from its end (lam) and from its point (mu, zero
   where c_point < 0), explicit ones of the stage positions added (no rows: none); leaves z (s, n), the virtual
   displacement of each stage's force balance. lam_x (n_carried, n) belongs to whatever else the method carries from
   step to step. accuracy: relative, to which an iteration has to go; 0: to rounding.
6. `tangent_step(pair, inv_mass, tables, steps, w, c_point, dq, dv, dx, force, dq_stage, damped, turning)`: pushes
   changes forward through step w (in place) to its end or its point; dx (n_carried, n) as lam_x.
7. `carried(steps) -> int`: rows of lam_x and dx; none for one-step methods.
8. `steps_of(tag, arrays)`: the steps' tuple from the arrays of `steps.carve`, because what Python hands over are flat
   arrays. The tag is a tuple of zeros; its length, which is part of its type, says which method is meant.
9. `sample(steps, count, damped, t, g, d) -> m`: times, energies and their rates (NaN where unknown) by rising time,
   without the first and the last state. May be left out where the stages are ordered and exact.
"""

from typing import Any

from mdstopo.compiler.jit import by_type, kernel

Implementation = Any  # a compiled function

_DUTIES: dict[str, dict[type, Implementation]] = {"reach": {}, "sample": {}}
_MAKERS: dict[int, Implementation] = {}


def point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """Duty 2."""
    raise NotImplementedError


def reach(model, tables, strength, steps, count, k, c, damped, q, v, work):
    """Duty 2, for a reverse sweep."""
    raise NotImplementedError


def sample(steps, count, damped, t, g, d):
    """Duty 9."""
    raise NotImplementedError


def parent_of(steps, w):
    """Duty 3."""
    raise NotImplementedError


def stage_weights(tables, steps, w, out):
    """Duty 4."""
    raise NotImplementedError


def reverse_step(
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning,
    accuracy, work,
):  # fmt: skip
    """Duty 5."""
    raise NotImplementedError


def tangent_step(pair, inv_mass, tables, steps, w, c_point, dq, dv, dx, force, dq_stage, damped, turning):
    """Duty 6."""
    raise NotImplementedError


def carried(steps):
    """Duty 7."""
    raise NotImplementedError


def steps_of(tag, arrays):
    """Duty 8."""
    raise NotImplementedError


def implement(steps_type: type, tag: tuple[int, ...], steps_of: Implementation, **duties: Implementation) -> None:
    """Enter an integrator's compiled functions for its type of steps, and the one that makes them for its tag."""
    _MAKERS[len(tag)] = steps_of
    for name, function in duties.items():
        _DUTIES.setdefault(name, {})[steps_type] = function


def _implementation(name: str, steps: Any) -> Implementation | None:
    """The kernel for this type of steps."""
    kind = getattr(steps, "instance_class", None)  # of a named tuple's type
    if kind is None:
        return None
    chosen = _DUTIES[name].get(kind)
    if chosen is None and name == "reach":
        chosen = _DUTIES["point_of"].get(kind)
    if chosen is None and name == "sample":
        chosen = sample_stages
    return chosen


@kernel
def sample_stages(steps, count, damped, t, g, d):
    """Every stage of a step."""
    first = steps.index[0, 0]
    m = steps.index[count, 0] - first
    for i in range(m):
        t[i] = steps.scalar[first + i, 0]
        g[i] = steps.scalar[first + i, 1]
        d[i] = steps.scalar[first + i, 2]
    return m


@by_type(point_of)
def _point_of(model, tables, strength, steps, count, k, c, damped, q, v, work):
    return _implementation("point_of", steps)


@by_type(parent_of)
def _parent_of(steps, w):
    return _implementation("parent_of", steps)


@by_type(stage_weights)
def _stage_weights(tables, steps, w, out):
    return _implementation("stage_weights", steps)


@by_type(reverse_step)
def _reverse_step(
    pair, inv_mass, tables, steps, w, c_point, mu_q, mu_v, stage_q_bar, lam_q, lam_v, lam_x, z, damped, turning,
    accuracy, work,
):  # fmt: skip
    return _implementation("reverse_step", steps)


@by_type(tangent_step)
def _tangent_step(pair, inv_mass, tables, steps, w, c_point, dq, dv, dx, force, dq_stage, damped, turning):
    return _implementation("tangent_step", steps)


@by_type(carried)
def _carried(steps):
    return _implementation("carried", steps)


@by_type(reach)
def _reach(model, tables, strength, steps, count, k, c, damped, q, v, work):
    return _implementation("reach", steps)


@by_type(sample)
def _sample(steps, count, damped, t, g, d):
    return _implementation("sample", steps)


@by_type(steps_of)
def _steps_of(tag, arrays):
    return _MAKERS[len(tag)]
