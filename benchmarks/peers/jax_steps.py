"""JAX: a fixed number of steps of order 8 in a scan, reverse mode, steps computed again on the way back."""

from typing import Any

import jax
import jax.numpy as jnp

from benchmarks.peers.jax_model import Array, Springs, model_of, objective_of, power_of, start_of
from benchmarks.peers.problem import Problem
from benchmarks.peers.table import Objective
from benchmarks.peers.tableau import order_eight

#: corrections of the time of the peak, each with a partial step of its own
CORRECTIONS = 3


def make(problem: Problem, steps: int = 4, refine: bool = True, rolled: bool = False) -> Objective:
    """As the table says. refine: look for the peak between steps; else the highest step is taken.

    rolled: whether the stages of a step are a loop, which compiles faster.
    """
    rate, energy = model_of(problem)
    made: Objective = objective_of(problem, steps_of(problem, (rate, energy), start_of(problem), steps, refine, rolled))
    return made


def steps_of(problem: Problem, model: Any, start: Array, steps: int, refine: bool, rolled: bool) -> Any:
    """The energy at the end, or its highest peak, as a function of the springs.

    problem: what is computed, of which only the end and whether a peak is wanted are looked at. model: rate and energy,
    functions of a state and the springs. start: the state at the start. steps, refine, rolled: as of `make`.
    """
    rate, energy = model
    h = problem.end / steps
    advance = jax.checkpoint(_stepper(rate, rolled))
    power = power_of(rate, energy)

    def states(springs: Springs) -> Array:
        def one(y: Array, _: None) -> tuple[Array, Array]:
            following = advance(y, h, springs)
            return following, following

        return jnp.concatenate([start[None], jax.lax.scan(one, start, None, length=steps)[1]])

    def objective(springs: Springs) -> Array:
        found = states(springs)
        if not problem.peak:
            return energy(found[-1], springs)
        held = jax.lax.stop_gradient((found, springs))
        if not refine:
            heights = jax.lax.map(lambda y: energy(y, held[1]), held[0])
            return energy(found[jnp.argmax(heights)], springs)
        inside, k, part = _peak(*held)
        # the time of an inner peak is held: there the energy does not change with it
        return jax.lax.cond(
            inside,
            lambda: energy(advance(found[k], part, springs), springs),
            lambda: energy(found[-1], springs),
        )

    def _peak(found: Array, springs: Springs) -> tuple[Array, Array, Array]:
        """Whether the highest peak is inside, in which step, and how far into it."""
        heights = jax.lax.map(lambda y: energy(y, springs), found)
        slopes = jax.lax.map(lambda y: power(y, springs), found)
        peaks, places = _hermite_peak(heights[:-1], heights[1:], h * slopes[:-1], h * slopes[1:])
        k = jnp.argmax(peaks)

        def correct(_: int, part: Array) -> Array:
            y = advance(found[k], part, springs)
            value, change = jax.jvp(lambda u: power(u, springs), (y,), (rate(y, springs),))
            return jnp.clip(part - value / change, 0.0, h)

        inside = peaks[k] > heights[-1]
        part = jax.lax.cond(
            inside,
            lambda: jax.lax.fori_loop(0, CORRECTIONS, correct, h * places[k]),
            lambda: jnp.zeros_like(h * places[k]),
        )
        return inside, k, part

    return objective


def _stepper(rate: Any, rolled: bool) -> Any:
    a, b = order_eight()
    if rolled:
        return _rolled(rate, jnp.asarray(a), jnp.asarray(b))

    def advance(y: Array, h: Any, springs: Springs) -> Array:
        stages: list[Array] = []
        for row in a:
            moved = sum(float(c) * k for c, k in zip(row, stages, strict=False) if c != 0.0)
            stages.append(rate(y + h * moved, springs))
        return y + h * sum(float(c) * k for c, k in zip(b, stages, strict=True) if c != 0.0)

    return advance


def _rolled(rate: Any, a: Array, b: Array) -> Any:
    """The stages in a loop: a twelfth of what there is to compile."""

    def advance(y: Array, h: Any, springs: Springs) -> Array:
        def stage(known: Array, each: tuple[Array, Array]) -> tuple[Array, None]:
            row, place = each
            return known.at[place].set(rate(y + h * (row @ known), springs)), None

        stages, _ = jax.lax.scan(stage, jnp.zeros((len(b), len(y))), (a, jnp.arange(len(b))))
        return y + h * (b @ stages)

    return advance


def _hermite_peak(g0: Array, g1: Array, d0: Array, d1: Array) -> tuple[Array, Array]:
    """Height and place in (0, 1) of the peak of the cubic in each step where the slope turns downwards, else -inf."""
    turns = (d0 >= 0.0) & (d1 < 0.0)
    # the cubic's slope is d0 + b s + a s^2
    a = 3.0 * (d0 + d1) - 6.0 * (g1 - g0)
    b = d1 - d0 - a
    root = jnp.sqrt(jnp.maximum(b * b - 4.0 * a * d0, 0.0))
    # of the two forms of the falling root the one without cancellation; a start from rest has d0 = 0
    falling = b <= 0.0
    one = 2.0 * d0 / jnp.where(turns & falling, root - b, 1.0)
    two = (-b - root) / jnp.where(falling, -1.0, 2.0 * a)
    s = jnp.where(falling, one, two)
    s = jnp.clip(s, 0.0, 1.0)
    height = g0 + s * (d0 + s * (0.5 * b + s * a / 3.0))
    return jnp.where(turns, height, -jnp.inf), s
