"""The equations of motion for JAX: all members of a group as two products with its moments.

What a member has goes in as arguments: as constants of the program XLA would compute with them while it compiles.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.problem import GROUND, Problem, coefficients, moments

Array = Any
#: stiffness (N,), length (N,), moments: of each group, or (K, 8, N / K) where the groups are of one size
Springs = tuple[Array, Array, Any]
Function = Callable[[Array, Springs], Array]

jax.config.update("jax_enable_x64", True)


def model_of(problem: Problem) -> tuple[Function, Function]:
    """rate and energy, functions of the state y (6 B: coordinates, then velocities) and of the springs."""
    n = 3 * problem.bodies
    inverse, force = jnp.asarray(1.0 / problem.mass.ravel()), jnp.asarray(problem.force.ravel())

    def lengths(shape: Array, rows: Any) -> Array:
        if len(rows) == 1:
            return jnp.sqrt(shape[0] @ rows[0])
        if isinstance(rows, tuple):
            return jnp.sqrt(jnp.concatenate([shape[k] @ each for k, each in enumerate(rows)]))
        return jnp.sqrt(jnp.einsum("kc,kcm->km", shape, rows).ravel())

    def sums(share: Array, rows: Any) -> Array:
        if isinstance(rows, tuple):
            return jnp.stack([each @ share[part] for each, part in zip(rows, problem.slices(), strict=True)])
        return jnp.einsum("kcm,km->kc", rows, share.reshape(len(rows), -1))

    def poses(x: Array, bodies: list[int]) -> Array:
        # slices, because XLA has no fast way back from indices
        return jnp.stack([jnp.zeros(3) if body == GROUND else x[3 * body : 3 * body + 3] for body in bodies])

    def shapes(x: Array) -> Array:
        if len(problem.groups) == 1 and GROUND not in problem.groups[0]:
            # scalars, which XLA does not have to put in and out of arrays
            one, two = (x[3 * body : 3 * body + 3] for body in problem.groups[0].tolist())
            return jnp.stack([*coefficients(one, two, jnp.cos, jnp.sin)[:-1], jnp.ones(())])[None]
        one, two = (poses(x, problem.groups[:, side].tolist()).T for side in (0, 1))
        found = coefficients(one, two, jnp.cos, jnp.sin)
        found[-1] = jnp.ones(len(problem.groups))
        return jnp.stack(found, axis=1)

    def accelerations(x: Array, v: Array, springs: Springs) -> Array:
        stiffness, length, rows = springs
        shape, back = jax.vjp(shapes, x)
        share = 0.5 * stiffness * (1.0 - length / lengths(shape, rows))
        applied = force - back(sums(share, rows))[0]
        return inverse * applied if not len(problem.hinges) else held(x, v, applied)

    def held(x: Array, v: Array, applied: Array) -> Array:
        slope = jax.jacfwd(gaps)(x)
        wanted = -jax.jvp(lambda u: jax.jvp(gaps, (u,), (v,))[1], (x,), (v,))[1]
        scaled = slope * inverse
        factor = jax.scipy.linalg.cho_factor(scaled @ slope.T)
        return inverse * (applied - slope.T @ jax.scipy.linalg.cho_solve(factor, scaled @ applied - wanted))

    def gaps(x: Array) -> Array:
        ends = []
        for side in (0, 1):
            body, at = poses(x, problem.hinges[:, side].tolist()), problem.at[:, side]
            c, s = jnp.cos(body[:, 2]), jnp.sin(body[:, 2])
            turned = jnp.stack([c * at[:, 0] - s * at[:, 1], s * at[:, 0] + c * at[:, 1]], axis=1)
            ends.append(body[:, :2] + turned)
        return (ends[1] - ends[0]).ravel()

    def rate(y: Array, springs: Springs) -> Array:
        return jnp.concatenate([y[n:], accelerations(y[:n], y[n:], springs)])

    def energy(y: Array, springs: Springs) -> Array:
        stiffness, length, rows = springs
        return 0.5 * jnp.sum(stiffness * (lengths(shapes(y[:n]), rows) - length) ** 2)

    return rate, energy


def start_of(problem: Problem) -> Array:
    """The state at the start."""
    return jnp.concatenate([jnp.asarray(problem.start.ravel()), jnp.zeros(3 * problem.bodies)])


def power_of(rate: Function, energy: Function) -> Function:
    """The time derivative of the energy."""

    def power(y: Array, springs: Springs) -> Array:
        return jax.jvp(lambda u: energy(u, springs), (y,), (rate(y, springs),))[1]

    return power


def objective_of(problem: Problem, function: Callable[[Springs], Array]) -> Any:
    """The benchmark's objective from a function of the springs that JAX can differentiate."""
    rows = [np.ascontiguousarray(moments(problem.p[part], problem.q[part]).T) for part in problem.slices()]
    alike = len({each.shape for each in rows}) == 1 and len(rows) > 1
    fixed = jax.device_put((problem.stiffness, problem.length, np.stack(rows) if alike else tuple(rows)))

    def of_design(alpha: Array, whole: Springs) -> Array:
        return function((whole[0] * alpha, *whole[1:]))

    both, alone = jax.jit(jax.value_and_grad(of_design)), jax.jit(of_design)

    def objective(alpha: Any, gradient: bool) -> tuple[float, Any]:
        if not gradient:
            return float(alone(alpha, fixed)), None
        value, slopes = both(alpha, fixed)
        return float(value), np.asarray(slopes)

    return objective
