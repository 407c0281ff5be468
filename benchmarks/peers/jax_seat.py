"""JAX: the seated occupant by fixed steps in a scan, with reverse mode; contacts and slack switch.

The unknowns are the root's place and the bodies' angles, so joints need no multipliers. What reverse mode gives is the
derivative of the steps as they were: at a stop with damping, whose force jumps, it lacks what the jump's time does,
however short the steps are. With `smooth` dampers set in within so many metres, which mends that, at a price.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers.seat_problem import GAP, SeatProblem
from benchmarks.peers.table import Objective
from benchmarks.peers.tableau import order_eight

Array = Any

jax.config.update("jax_enable_x64", True)

#: samples about the highest one through which a polynomial tells the peak, and Newton's corrections to its place
SAMPLES, CORRECTIONS = 5, 4


def make(problem: SeatProblem, steps: int = 500, order: int = 4, smooth: float = 0.0, again: bool = True) -> Objective:
    """G = (largest acceleration of the chest x largest displacement of the head)^(1/2).

    steps: how many; times at which the cabin's pulse bends or an actuator begins or ends must be ends of steps.
    order: of the Runge-Kutta method, 4 or 8. smooth: within how many metres of a stop its damper sets in; 0: at once.
    again: whether steps are computed again on the way back (`jax.checkpoint`), which is faster than reading them.
    """
    advance = _stepper(problem, order, smooth)
    step = jax.checkpoint(advance) if again else advance
    h = problem.end / steps
    along = _along(problem, steps, _tableau(order)[2])
    spread, fixed = _strengths(problem)
    start = jnp.concatenate([jnp.asarray(problem.place), jnp.zeros(2 + 2 * len(problem.mass))])

    def of_design(alpha: Array) -> Array:
        strength = spread @ alpha + fixed
        _, (chest, head) = jax.lax.scan(lambda y, each: step(y, each, h, strength), start, along)
        return jnp.sqrt(_peak(chest) * _peak(head))

    both, alone = jax.jit(jax.value_and_grad(of_design)), jax.jit(of_design)

    def objective(alpha: Any, gradient: bool) -> tuple[float, Any]:
        if not gradient:
            return float(alone(alpha)), None
        value, slopes = both(alpha)
        return float(value), np.asarray(slopes)

    return objective


def _along(problem: SeatProblem, steps: int, nodes: Any) -> tuple[Array, Array]:
    """Of each step the cabin's acceleration at its stages (steps, s), and whether actuators act in it (steps,)."""
    h = problem.end / steps
    begins = h * np.arange(steps)
    times, sizes = problem.pulse.T
    middle = begins + 0.5 * h
    acts = (middle > problem.active[0]) & (middle < problem.active[1])
    return jnp.asarray(np.interp(begins[:, None] + h * np.asarray(nodes), times, sizes)), jnp.asarray(1.0 * acts)


def _strengths(problem: SeatProblem) -> tuple[Array, Array]:
    """Matrix (N, M) and vector (N,): the strengths of all members are matrix alpha + vector."""
    spread = np.zeros((len(problem.design), problem.members))
    designed = np.flatnonzero(problem.design >= 0)
    spread[designed, problem.design[designed]] = 1.0
    return jnp.asarray(spread), jnp.asarray(1.0 * (problem.design < 0))


def _tableau(order: int) -> tuple[Any, Any, Any]:
    """a, b, c of the method."""
    if order == 4:
        a = np.array([[0.0] * 4, [0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 1.0, 0]])
        return a, np.array([1.0, 2.0, 2.0, 1.0]) / 6.0, a.sum(axis=1)
    a, b = order_eight()
    return a, b, a.sum(axis=1)


def _stepper(problem: SeatProblem, order: int, smooth: float) -> Any:
    a, b, _ = _tableau(order)
    rate = _rate(problem, smooth)

    def advance(y: Array, each: tuple[Array, Array], h: float, strength: Array) -> tuple[Array, tuple[Array, Array]]:
        pulse, acts = each
        stages: list[Array] = []
        seen: Any = None
        for i, row in enumerate(a):
            moved = [h * float(c) * k for c, k in zip(row, stages, strict=False) if c != 0.0]
            slope, looked = rate(y + sum(moved) if moved else y, pulse[i], acts, strength)
            stages.append(slope)
            seen = looked if i == 0 else seen
        return y + sum(h * float(c) * k for c, k in zip(b, stages, strict=True) if c != 0.0), seen

    return advance


def _rate(problem: SeatProblem, smooth: float) -> Any:
    """Of a state (place, angles, and their rates) its rate; the chest's acceleration and the head's displacement."""
    count = len(problem.mass)
    mass, whole = jnp.asarray(problem.mass), float(problem.mass.sum())
    rx, ry = jnp.asarray(problem.reach[:, :, 0]), jnp.asarray(problem.reach[:, :, 1])
    difference = np.zeros((len(problem.hinges), count))
    for j, (one, two) in enumerate(problem.hinges):
        difference[j, one], difference[j, two] = -1.0, 1.0
    apart = jnp.asarray(difference)
    hinge_k, hinge_c = jnp.asarray(problem.spring), jnp.asarray(problem.damper)
    pull = _pull(problem, smooth)
    chest, head = problem.chest, problem.head
    head_start = problem.place + problem.reach[chest].sum(axis=0) + head

    def rate(y: Array, pulse: Array, acts: Array, strength: Array) -> tuple[Array, tuple[Array, Array]]:
        angle, v, w = y[2 : 2 + count], y[2 + count : 4 + count], y[4 + count :]
        c, s = jnp.cos(angle), jnp.sin(angle)
        # vectors of the chain, turned; turned further by a right angle they are the slopes of places by angles
        tx, ty = rx * c - ry * s, rx * s + ry * c
        com = y[0] + tx.sum(axis=1), y[1] + ty.sum(axis=1)
        speed = v[0] - ty @ w, v[1] + tx @ w
        drawn = tx @ (w * w), ty @ (w * w)
        fx, fy, moment = pull(c, s, com, speed, w, acts, strength)
        fx = fx - mass * pulse + mass * drawn[0]
        fy = fy - mass * problem.gravity + mass * drawn[1]
        moment = moment - apart.T @ (hinge_k * (apart @ angle) + hinge_c * (apart @ w))
        total_x, total_y = fx.sum(), fy.sum()
        mx, my = mass @ tx, mass @ ty
        # the place is eliminated: what is left is a matrix of the angles
        inertia = (tx.T * mass) @ tx + (ty.T * mass) @ ty - (jnp.outer(mx, mx) + jnp.outer(my, my)) / whole
        inertia = inertia + jnp.diag(jnp.asarray(problem.inertia))
        right = fy @ tx - fx @ ty + moment - (total_y * mx - total_x * my) / whole
        turning = jnp.stack(_solved(inertia, right, count))
        ahead = (total_x + my @ turning) / whole, (total_y - mx @ turning) / whole
        chest_x = ahead[0] - ty[chest] @ turning - drawn[0][chest] + pulse
        chest_y = ahead[1] + tx[chest] @ turning - drawn[1][chest]
        head_x = com[0][chest] + c[chest] * head[0] - s[chest] * head[1] - head_start[0]
        head_y = com[1][chest] + s[chest] * head[0] + c[chest] * head[1] - head_start[1]
        # the head is at home at the start, where a root has no slope
        moved = head_x * head_x + head_y * head_y
        away = jnp.where(moved > 0.0, jnp.sqrt(jnp.where(moved > 0.0, moved, 1.0)), 0.0)
        slope = jnp.concatenate([v, w, jnp.stack(ahead), turning])
        return slope, (jnp.sqrt(chest_x * chest_x + chest_y * chest_y), away)

    return rate


def _solved(matrix: Array, right: Array, count: int) -> list[Array]:
    """Solve a small symmetric system, written out: a call of LAPACK takes longer."""
    rows = [[matrix[i, j] for j in range(count)] for i in range(count)]
    x = [right[i] for i in range(count)]
    for k in range(count):
        inverse = 1.0 / rows[k][k]
        for i in range(k + 1, count):
            factor = rows[i][k] * inverse
            rows[i] = [rows[i][j] - factor * rows[k][j] if j > k else rows[i][j] for j in range(count)]
            x[i] = x[i] - factor * x[k]
    for k in reversed(range(count)):
        x[k] = (x[k] - sum(rows[k][j] * x[j] for j in range(k + 1, count))) / rows[k][k]
    return x


def _pull(problem: SeatProblem, smooth: float) -> Any:
    """Forces (B,) along x and y, and moments about centres of mass, of all members on the bodies."""
    on = np.zeros((len(problem.body), len(problem.mass)))
    on[np.arange(len(problem.body)), problem.body] = 1.0
    of = jnp.asarray(on)  # products with it, because XLA has no fast way back from indices
    gaps = int(np.sum(problem.law == GAP))
    qx, qy, px, py = (jnp.asarray(each) for each in (*problem.at.T, *problem.anchor.T))
    start = problem.place + problem.reach.sum(axis=1)
    free = jnp.asarray(np.linalg.norm(start[problem.body] + problem.at - problem.anchor, axis=1))
    k, d, offset, side, limit = (
        jnp.asarray(each)
        for each in (problem.stiffness, problem.damping, problem.offset, problem.side, problem.limit[gaps:])
    )

    def acting(depth: Array) -> Array:
        """The share of a stop's damper that acts at a depth."""
        if smooth == 0.0:
            return 1.0 * (depth > 0.0)
        part = jnp.clip(depth / smooth, 0.0, 1.0)
        return part * part * (3.0 - 2.0 * part)

    def pull(c: Array, s: Array, com: Any, speed: Any, w: Array, acts: Array, strength: Array) -> Any:
        """Forces (B,) along x and y, and moments (B,), at one state.

        c, s (B,): cosines and sines of the bodies' angles.
        com, speed: of the centres of mass, x (B,) and y (B,) (m), and their rates (m/s).
        w (B,): angular velocities (rad/s).
        acts: 1 while actuators act, else 0.
        strength (N,): what each member's force is multiplied by.
        """
        cm, sm, wm = of @ c, of @ s, of @ w
        ax, ay = cm * qx - sm * qy, sm * qx + cm * qy
        dx, dy = of @ com[0] + ax - px, of @ com[1] + ay - py
        ux, uy = of @ speed[0] - wm * ay, of @ speed[1] + wm * ax
        length = jnp.sqrt(dx * dx + dy * dy)
        ex, ey = dx / length, dy / length
        x, xd = length - free, ex * ux + ey * uy
        depth = side[:gaps] * x[:gaps] - offset[:gaps]
        damped = acting(depth) * d[:gaps] * side[:gaps] * xd[:gaps]
        pressed = jnp.maximum(k[:gaps] * jnp.maximum(depth, 0.0) + damped, 0.0)
        steered = jnp.clip(k[gaps:] * (x[gaps:] - offset[gaps:]) + d[gaps:] * xd[gaps:], -limit, limit)
        force = strength * jnp.concatenate([side[:gaps] * pressed, acts * steered])
        fx, fy = -force * ex, -force * ey
        return fx @ of, fy @ of, (ax * fy - ay * fx) @ of

    return pull


def _peak(seen: Array) -> Array:
    """The highest value of the polynomial through the samples about the highest one; its place is held."""
    half = SAMPLES // 2
    places = np.arange(SAMPLES) - half
    # values at the places -> coefficients of the powers
    powers = jnp.asarray(np.linalg.inv(np.vander(places.astype(float), SAMPLES, increasing=True)))
    k = jnp.clip(jnp.argmax(jax.lax.stop_gradient(seen)), half, len(seen) - 1 - half)
    near = jax.lax.dynamic_slice(seen, (k - half,), (SAMPLES,))
    held = jax.lax.stop_gradient(powers @ near)
    rising = held[1:] * jnp.arange(1, SAMPLES)
    bending = rising[1:] * jnp.arange(1, SAMPLES - 1)
    at = jnp.asarray(1.0 * (jnp.argmax(jax.lax.stop_gradient(near)) - half))
    for _ in range(CORRECTIONS):
        slope, bend = jnp.polyval(rising[::-1], at), jnp.polyval(bending[::-1], at)
        at = jnp.clip(at - jnp.where(bend < 0.0, slope / bend, 0.0), -half, half)
    return (at ** jnp.arange(SAMPLES)) @ (powers @ near)
