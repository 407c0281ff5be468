"""The equations of motion for JAX: all members of a group as two products with its moments."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.problem import GROUND, Problem, coefficients, moments

Array = Any
Function = Callable[[Array, Array], Array]

jax.config.update("jax_enable_x64", True)


def model_of(problem: Problem) -> tuple[Function, Function]:
    """rate and energy, functions of the state y (6 B: coordinates, then velocities) and of stiffness (N,)."""
    n = 3 * problem.bodies
    rows = [jnp.asarray(np.ascontiguousarray(moments(problem.p[s], problem.q[s]).T)) for s in problem.slices()]
    length = jnp.asarray(problem.length)
    inverse, force = jnp.asarray(1.0 / problem.mass.ravel()), jnp.asarray(problem.force.ravel())
    # groups of one size are one product for all of them
    counts = {each.shape[1] for each in rows}
    stacked = jnp.stack(rows) if len(counts) == 1 and len(rows) > 1 else None

    def lengths(shape: Array) -> Array:
        if stacked is not None:
            return jnp.sqrt(jnp.einsum("kc,kcm->km", shape, stacked).ravel())
        return jnp.sqrt(jnp.concatenate([shape[k] @ each for k, each in enumerate(rows)]))

    def sums(share: Array) -> Array:
        if stacked is not None:
            return jnp.einsum("kcm,km->kc", stacked, share.reshape(len(rows), -1))
        return jnp.stack([each @ share[part] for each, part in zip(rows, problem.slices(), strict=True)])

    def shapes(x: Array) -> Array:
        pose = jnp.concatenate([x, jnp.zeros(3)]).reshape(-1, 3)  # the ground is the last
        one, two = (pose[problem.groups[:, side]].T for side in (0, 1))
        found = coefficients(one, two, jnp.cos, jnp.sin)
        found[-1] = jnp.ones(len(problem.groups))
        return jnp.stack(found, axis=1)

    def accelerations(x: Array, v: Array, stiffness: Array) -> Array:
        shape, back = jax.vjp(shapes, x)
        share = 0.5 * stiffness * (1.0 - length / lengths(shape))
        applied = force - back(sums(share))[0]
        return inverse * applied if not len(problem.hinges) else held(x, v, applied)

    def held(x: Array, v: Array, applied: Array) -> Array:
        slope = jax.jacfwd(gaps)(x)
        wanted = -jax.jvp(lambda u: jax.jvp(gaps, (u,), (v,))[1], (x,), (v,))[1]
        scaled = slope * inverse
        factor = jax.scipy.linalg.cho_factor(scaled @ slope.T)
        return inverse * (applied - slope.T @ jax.scipy.linalg.cho_solve(factor, scaled @ applied - wanted))

    def gaps(x: Array) -> Array:
        pose = jnp.concatenate([x, jnp.zeros(3)]).reshape(-1, 3)
        ends = []
        for side in (0, 1):
            body, at = pose[problem.hinges[:, side]], problem.at[:, side]
            c, s = jnp.cos(body[:, 2]), jnp.sin(body[:, 2])
            turned = jnp.stack([c * at[:, 0] - s * at[:, 1], s * at[:, 0] + c * at[:, 1]], axis=1)
            ends.append(body[:, :2] + turned)
        return (ends[1] - ends[0]).ravel()

    def rate(y: Array, stiffness: Array) -> Array:
        return jnp.concatenate([y[n:], accelerations(y[:n], y[n:], stiffness)])

    def energy(y: Array, stiffness: Array) -> Array:
        return 0.5 * jnp.sum(stiffness * (lengths(shapes(y[:n])) - length) ** 2)

    assert GROUND == -1
    return rate, energy


def start_of(problem: Problem) -> Array:
    """The state at the start."""
    return jnp.concatenate([jnp.asarray(problem.start.ravel()), jnp.zeros(3 * problem.bodies)])


def power_of(rate: Function, energy: Function) -> Function:
    """The time derivative of the energy."""

    def power(y: Array, stiffness: Array) -> Array:
        return jax.jvp(lambda u: energy(u, stiffness), (y,), (rate(y, stiffness),))[1]

    return power


def objective_of(problem: Problem, function: Function) -> Any:
    """The benchmark's objective from a function of alpha that JAX can differentiate."""
    both, alone = jax.jit(jax.value_and_grad(function)), jax.jit(function)  # type: ignore[arg-type]

    def objective(alpha: Any, gradient: bool) -> tuple[float, Any]:
        if not gradient:
            return float(alone(alpha)), None
        value, slopes = both(alpha)
        return float(value), np.asarray(slopes)

    return objective
