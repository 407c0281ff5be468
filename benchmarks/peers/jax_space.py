"""JAX in space: places, unit quaternions, velocities in global and turning in body axes; fixed steps as in a plane.

Members between two grids of points are three arrays of differences, added up by rows and columns; joints are eliminated
by the Schur complement of their rows.
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


def make(problem: SpatialProblem, steps: int = 4, rolled: bool = False) -> Objective:
    """As the table says; the highest of the steps' ends is taken where the peak is looked for."""
    rate, energy = model_of(problem)
    zeros = jnp.zeros(6 * problem.bodies)
    start = jnp.concatenate([jnp.asarray(problem.start.ravel()), jnp.asarray(problem.turn.ravel()), zeros])
    function = steps_of(problem, rate, energy, start, steps, rolled)
    fixed = jax.device_put((problem.stiffness, problem.length))
    both = jax.jit(jax.value_and_grad(lambda alpha, whole: function((whole[0] * alpha, whole[1]))))
    alone = jax.jit(lambda alpha, whole: function((whole[0] * alpha, whole[1])))

    def objective(alpha: Any, gradient: bool) -> tuple[float, Any]:
        if not gradient:
            return float(alone(alpha, fixed)), None
        value, slopes = both(alpha, fixed)
        return float(value), np.asarray(slopes)

    return objective


def _rotation(e: Array) -> list[list[Array]]:
    """Rows of the matrix of a unit quaternion, as scalars."""
    w, x, y, z = e
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def _cross(a: Any, b: Any) -> tuple[Array, Array, Array]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def model_of(problem: SpatialProblem) -> tuple[Any, Any]:
    """rate and energy, functions of the state y (13 B) and of the springs (stiffness, length)."""
    count = problem.bodies
    at_e, at_v, at_w = 3 * count, 7 * count, 10 * count
    inverse = np.linalg.inv(problem.inertia)
    grids = [problem.grid(part) for part in problem.slices()]

    def frames(y: Array) -> list[tuple[Any, Any]]:
        """Place and rotation of each body, as scalars."""
        return [
            ([y[3 * b + i] for i in range(3)], _rotation([y[at_e + 4 * b + i] for i in range(4)])) for b in range(count)
        ]

    def arms(known: Any, body: int, points: Any) -> Any:
        """Points (n, 3) from the centre of mass, in global axes, by component."""
        if body == GROUND:
            return [points[:, i] for i in range(3)]
        turn = known[body][1]
        return [sum(turn[i][k] * points[:, k] for k in range(3)) for i in range(3)]

    def ends(known: Any, k: int) -> Any:
        """Of group k: arms of both sides, differences of their places, by component, and the shape of these."""
        (one, two), part = problem.groups[k].tolist(), problem.slices()[k]
        grid = grids[k]
        p, q = (problem.p[part], problem.q[part]) if grid is None else grid
        arm_p, arm_q = arms(known, one, p), arms(known, two, q)
        place_p, place_q = ([0.0] * 3 if body == GROUND else known[body][0] for body in (one, two))
        if grid is None:
            return arm_p, arm_q, [arm_q[i] + (place_q[i] - place_p[i]) - arm_p[i] for i in range(3)], (len(p),)
        between = [(arm_q[i] + (place_q[i] - place_p[i]))[None, :] - arm_p[i][:, None] for i in range(3)]
        return arm_p, arm_q, between, (len(p), len(q))

    def loads(y: Array, springs: Any) -> list[list[Array]]:
        """Forces and moments on every body, global, as scalars."""
        known, total = frames(y), [[problem.force[b, i] for i in range(6)] for b in range(count)]
        for k, part in enumerate(problem.slices()):
            arm_p, arm_q, d, shape = ends(known, k)
            natural, stiffness = springs[1][part].reshape(shape), springs[0][part].reshape(shape)
            share = stiffness * (1.0 - natural / jnp.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]))
            pulls = [share * each for each in d]
            sides = (pulls, pulls) if len(shape) == 1 else (
                [each.sum(axis=1) for each in pulls], [each.sum(axis=0) for each in pulls]
            )  # fmt: skip
            for body, arm, pull, sign in zip(
                problem.groups[k].tolist(), (arm_p, arm_q), sides, (1.0, -1.0), strict=True
            ):
                if body == GROUND:
                    continue
                for i in range(3):
                    total[body][i] += sign * pull[i].sum()
                for i, moment in enumerate(_cross(arm, pull)):
                    total[body][3 + i] += sign * moment.sum()
        return total

    def rate(y: Array, springs: Any) -> Array:
        known, total = frames(y), loads(y, springs)
        e_rates, forces = [], []
        for b in range(count):
            w0, x0, y0, z0 = (y[at_e + 4 * b + i] for i in range(4))
            spin = [y[at_w + 3 * b + i] for i in range(3)]
            a, c, d = spin
            e_rates += [-x0 * a - y0 * c - z0 * d, w0 * a + y0 * d - z0 * c, w0 * c + z0 * a - x0 * d,
                        w0 * d + x0 * c - y0 * a]  # fmt: skip
            turn, moment = known[b][1], total[b][3:]
            own = [sum(turn[k][i] * moment[k] for k in range(3)) for i in range(3)]
            momentum = [sum(problem.inertia[b, i, k] * spin[k] for k in range(3)) for i in range(3)]
            gyro = _cross(spin, momentum)
            forces += [*total[b][:3], *(own[i] - gyro[i] for i in range(3))]
        ahead = accelerations(y, known, jnp.stack(forces))
        return jnp.concatenate([y[at_v:at_w], 0.5 * jnp.stack(e_rates), ahead[:, :3].ravel(), ahead[:, 3:].ravel()])

    blocks = np.zeros((6 * count, 6 * count))
    for b in range(count):
        blocks[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = np.eye(3) / problem.mass[b]
        blocks[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inverse[b]

    def accelerations(y: Array, known: Any, force: Array) -> Array:
        """(B, 6), along global axes and about body ones."""
        if not len(problem.hinges):
            by_body = force.reshape(count, 6)
            turned = jnp.einsum("bij,bj->bi", jnp.asarray(inverse), by_body[:, 3:])
            return jnp.concatenate([by_body[:, :3] / problem.mass[:, None], turned], axis=1)
        turns = jnp.stack([jnp.stack([jnp.stack(row) for row in turn]) for _, turn in known])
        spins = y[at_w:].reshape(count, 3)
        rows, wanted = held(turns, spins)
        yields = rows @ blocks
        factor = jax.scipy.linalg.cho_factor(yields @ rows.T)
        pulls = jax.scipy.linalg.cho_solve(factor, yields @ force - wanted)
        return (blocks @ (force - rows.T @ pulls)).reshape(count, 6)

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
        known, whole = frames(y), 0.0
        for k, part in enumerate(problem.slices()):
            _, _, d, shape = ends(known, k)
            stretch = jnp.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) - springs[1][part].reshape(shape)
            whole = whole + 0.5 * jnp.sum(springs[0][part].reshape(shape) * stretch**2)
        return jnp.asarray(whole)

    return rate, energy
