"""JAX in space: places, unit quaternions, velocities in global and turning in body axes; fixed steps as in a plane.

Members between two grids of points are arrays of differences, added up by rows and columns; joints are eliminated by
the Schur complement of their rows.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.jax_steps import steps_of
from benchmarks.peers.problem import GROUND
from benchmarks.peers.space_problem import SpatialProblem
from benchmarks.peers.table import Objective

Array = Any

jax.config.update("jax_enable_x64", True)


def make(problem: SpatialProblem, steps: int = 4, refine: bool = True, rolled: bool = True) -> Objective:
    """As the table says; refine and rolled as in a plane."""
    rate, energy = model_of(problem)
    zeros = jnp.zeros(6 * problem.bodies)
    start = jnp.concatenate([jnp.asarray(problem.start.ravel()), jnp.asarray(problem.turn.ravel()), zeros])
    function = steps_of(problem, (rate, energy), start, steps, refine, rolled)
    fixed = jax.device_put((problem.stiffness, problem.length))
    both = jax.jit(jax.value_and_grad(lambda alpha, whole: function((whole[0] * alpha, whole[1]))))
    alone = jax.jit(lambda alpha, whole: function((whole[0] * alpha, whole[1])))

    def objective(alpha: Any, gradient: bool) -> tuple[float, Any]:
        if not gradient:
            return float(alone(alpha, fixed)), None
        value, slopes = both(alpha, fixed)
        return float(value), np.asarray(slopes)

    return objective


def _rotations(e: Array) -> Array:
    """Matrices (B, 3, 3) of unit quaternions (B, 4)."""
    w, x, y, z = e.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(row, axis=1) for row in rows], axis=1)


def _grids(problem: SpatialProblem) -> tuple[Array, Array]:
    """Points of both sides of all groups (K, m, 3), (K, n, 3). Raises ValueError where groups are not alike."""
    found = [problem.grid(part) for part in problem.slices()]
    if any(grid is None for grid in found) or len({(len(p), len(q)) for p, q in filter(None, found)}) != 1:
        raise ValueError("only groups of one size, every point with every other")
    sides = [np.array([grid[side] for grid in found if grid is not None]) for side in (0, 1)]
    return sides[0], sides[1]


def model_of(problem: SpatialProblem) -> tuple[Any, Any]:
    """rate and energy, functions of the state y (13 B) and of the springs (stiffness, length)."""
    count = problem.bodies
    at_e, at_v, at_w = 3 * count, 7 * count, 10 * count
    inertia, inverse = jnp.asarray(problem.inertia), np.linalg.inv(problem.inertia)
    p, q = _grids(problem)
    shape = len(p), p.shape[1], q.shape[1]
    one, two = problem.groups.T  # the ground is number -1, the last place

    def frames(y: Array) -> tuple[Array, Array]:
        """Places (B + 1, 3) and rotations (B + 1, 3, 3), ground last."""
        places = jnp.concatenate([y[:at_e].reshape(count, 3), jnp.zeros((1, 3))])
        turns = _rotations(y[at_e:at_v].reshape(count, 4))
        return places, jnp.concatenate([turns, jnp.eye(3)[None]])

    def ends(places: Array, turns: Array) -> tuple[Array, Array, list[Array]]:
        """Arms of both sides (K, m, 3), (K, n, 3), and the differences of ends (K, m, n) by component."""
        arm_p, arm_q = (jnp.einsum("kij,kmj->kmi", turns[of], grid) for of, grid in ((one, p), (two, q)))
        near, far = places[one][:, None] + arm_p, places[two][:, None] + arm_q
        return arm_p, arm_q, [far[:, None, :, i] - near[:, :, None, i] for i in range(3)]

    def loads(places: Array, turns: Array, springs: Any) -> tuple[Array, Array]:
        """Forces and moments (B, 3) on all bodies, global."""
        arm_p, arm_q, d = ends(places, turns)
        stiffness, natural = springs[0].reshape(shape), springs[1].reshape(shape)
        share = stiffness * (1.0 - natural / jnp.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
        pulls = [share * each for each in d]
        force = jnp.concatenate([jnp.asarray(problem.force), jnp.zeros((1, 6))])
        for of, arm, axis, sign in ((one, arm_p, 2, 1.0), (two, arm_q, 1, -1.0)):
            pull = sign * jnp.stack([each.sum(axis=axis) for each in pulls], axis=2)
            force = force.at[of].add(jnp.concatenate([pull.sum(axis=1), jnp.cross(arm, pull).sum(axis=1)], axis=1))
        return force[:count, :3], force[:count, 3:]

    def rate(y: Array, springs: Any) -> Array:
        places, turns = frames(y)
        force, moment = loads(places, turns, springs)
        e, spin = y[at_e:at_v].reshape(count, 4), y[at_w:].reshape(count, 3)
        vector = -jnp.sum(e[:, 1:] * spin, axis=1, keepdims=True)
        e_rate = 0.5 * jnp.concatenate([vector, e[:, :1] * spin + jnp.cross(e[:, 1:], spin)], axis=1)
        own = jnp.einsum("bji,bj->bi", turns[:count], moment)
        own = own - jnp.cross(spin, jnp.einsum("bij,bj->bi", inertia, spin))
        ahead = accelerations(turns, spin, jnp.concatenate([force, own], axis=1))
        return jnp.concatenate([y[at_v:at_w], e_rate.ravel(), ahead[:, :3].ravel(), ahead[:, 3:].ravel()])

    blocks = np.zeros((6 * count, 6 * count))
    for b in range(count):
        blocks[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = np.eye(3) / problem.mass[b]
        blocks[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inverse[b]

    def accelerations(turns: Array, spins: Array, force: Array) -> Array:
        """(B, 6), along global axes and about body ones, from forces (B, 6) in the same."""
        if not len(problem.hinges):
            turned = jnp.einsum("bij,bj->bi", jnp.asarray(inverse), force[:, 3:])
            return jnp.concatenate([force[:, :3] / problem.mass[:, None], turned], axis=1)
        rows, wanted = held(turns, spins)
        yields = rows @ blocks
        factor = jax.scipy.linalg.cho_factor(yields @ rows.T)
        pulls = jax.scipy.linalg.cho_solve(factor, yields @ force.ravel() - wanted)
        return (blocks @ (force.ravel() - rows.T @ pulls)).reshape(count, 6)

    # where in the joints' matrix the blocks of each end stand, which do not change
    entries = [(j, int(body), side) for j, pair in enumerate(problem.hinges) for side, body in enumerate(pair)
               if body != GROUND]  # fmt: skip
    of = np.array([body for _, body, _ in entries], dtype=int)
    local = np.array([problem.at[j, side] for j, _, side in entries]).reshape(-1, 3)
    signs = np.array([1.0 if side else -1.0 for _, _, side in entries])
    down = np.array([3 * j for j, _, _ in entries], dtype=int)[:, None, None] + np.arange(3)[None, :, None]
    across = 6 * of[:, None, None] + np.arange(6)[None, None, :]
    skews = np.array([[[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]] for c in local]).reshape(-1, 3, 3)

    def held(turns: Array, spins: Array) -> tuple[Array, Array]:
        """Rows (3 J, 6 B) of the joints, and what they times the accelerations have to be."""
        turn, spin = turns[of], spins[of]
        turning = -jnp.einsum("eij,ejk->eik", turn, skews)
        ones = jnp.broadcast_to(jnp.eye(3), turning.shape)
        values = signs[:, None, None] * jnp.concatenate([ones, turning], axis=2)
        rows = jnp.zeros((3 * len(problem.hinges), 6 * count)).at[down, across].set(values)
        extra = jnp.einsum("eij,ej->ei", turn, jnp.cross(spin, jnp.cross(spin, local)))
        wanted = jnp.zeros(3 * len(problem.hinges)).at[down[:, :, 0]].add(-signs[:, None] * extra)
        return rows, wanted

    def energy(y: Array, springs: Any) -> Array:
        _, _, d = ends(*frames(y))
        stretch = jnp.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - springs[1].reshape(shape)
        return 0.5 * jnp.sum(springs[0].reshape(shape) * stretch**2)

    return rate, energy
