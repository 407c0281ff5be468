"""diffrax: Dormand and Prince's order 8 with error control, differentiated through recursive checkpoints."""

from typing import Any

import diffrax
import jax
import jax.numpy as jnp

from benchmarks.peers.jax_model import Array, Springs, model_of, objective_of, power_of, start_of
from benchmarks.peers.problem import Problem
from benchmarks.peers.table import Objective

#: halvings of the step that holds the peak
HALVINGS = 30


def make(problem: Problem, tolerance: float = 1e-8, refine: bool = True, most: int = 64) -> Objective:
    """As the table says. refine: look for the peak between steps; else the highest step is taken. most: steps."""
    rate, energy = model_of(problem)
    start, power = start_of(problem), power_of(rate, energy)
    term, solver = diffrax.ODETerm(lambda _, y, springs: rate(y, springs)), diffrax.Dopri8()
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance)

    def solve(springs: Springs, end: Any, save: Any) -> Any:
        return diffrax.diffeqsolve(
            term, solver, 0.0, end, None, start, args=springs, saveat=save, stepsize_controller=control,
            adjoint=diffrax.RecursiveCheckpointAdjoint(), max_steps=most,
        )  # fmt: skip

    def objective(springs: Springs) -> Array:
        held = jax.lax.stop_gradient(springs)
        if not problem.peak:
            return energy(solve(springs, problem.end, diffrax.SaveAt(t1=True)).ys[0], springs)
        if not refine:
            states = solve(springs, problem.end, diffrax.SaveAt(steps=True)).ys
            heights = jax.lax.map(lambda y: energy(y, held), jax.lax.stop_gradient(states))
            return energy(states[jnp.argmax(jnp.where(jnp.isfinite(heights), heights, -jnp.inf))], springs)
        time = jax.lax.stop_gradient(_time_of_peak(held))
        return energy(solve(springs, time, diffrax.SaveAt(t1=True)).ys[0], springs)

    def _time_of_peak(springs: Springs) -> Array:
        motion = solve(springs, problem.end, diffrax.SaveAt(dense=True, steps=True, t0=True))
        heights = jax.lax.map(lambda y: energy(y, springs), motion.ys)
        highest = jnp.argmax(jnp.where(jnp.isfinite(heights), heights, -jnp.inf))

        def rising(time: Array) -> Array:
            return power(motion.evaluate(time), springs) > 0.0

        time = motion.ts[highest]
        after = power(motion.ys[highest], springs) > 0.0
        low = jnp.where(after, time, motion.ts[jnp.maximum(highest - 1, 0)])
        high = jnp.minimum(jnp.where(after, motion.ts[jnp.minimum(highest + 1, most)], time), problem.end)

        def halve(_: int, bounds: tuple[Array, Array]) -> tuple[Array, Array]:
            middle = 0.5 * (bounds[0] + bounds[1])
            up = rising(middle)
            return jnp.where(up, middle, bounds[0]), jnp.where(up, bounds[1], middle)

        low, high = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
        return jnp.where(after & (time >= problem.end), problem.end, 0.5 * (low + high))

    made: Objective = objective_of(problem, objective)
    return made
