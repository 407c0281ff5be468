"""Small scenes as arrays, and the paper's Figure 3, run through the compiled entries without a case file."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from mdstopo.integrators.driver import CLOSENESS, NEWTON_TOLERANCE, ROWS
from mdstopo.integrators.gauss_tables import gauss_tables
from mdstopo.integrators.runge_kutta_tables import runge_kutta_tables
from mdstopo.integrators.steps import NEEDS_ROOM, OK, WORK, carve, room_for
from mdstopo.scene.packing import pack
from mdstopo.scene.springs_model import MEMBER, STIFFNESS, VECTOR, Model
from mdstopo.sensitivity.energy_responses import dense, evaluate_responses
from mdstopo.sensitivity.reductions import MAX


@dataclass(frozen=True)
class Group:
    """Random members between two bodies: how many, k, c, preload, mu, whether they are design variables."""

    a: int
    b: int
    count: int
    stiffness: float = 300.0
    damping: float = 0.0
    preload: float = 0.0
    power: float = 1.0
    design: bool = True


@dataclass(frozen=True)
class Scene:
    """A model with what the entries ask beside it."""

    model: Model
    damped: bool
    n_design: int


def random_scene(
    groups, masses, seed=3, times=(0.0, 0.3), turning=0, jumps=False, ground=False, spin=0.0, load=1.0
) -> Scene:
    """Bodies 1.3 m apart, members between random points; loads linear in each segment, `turning` of them off-centre."""
    rng = np.random.default_rng(seed)
    n_bodies = len(masses) + ground
    n = 3 * n_bodies
    inv_mass = np.zeros(n)
    for i, (m, j) in enumerate(masses):
        inv_mass[3 * i : 3 * i + 3] = 1 / m, 1 / m, 1 / j
    q0 = np.zeros(n)
    centre = np.array([[1.3 * i, 0.4 * (-1) ** i] for i in range(n_bodies)])
    q0.reshape(-1, 3)[:, :2] = centre
    q0.reshape(-1, 3)[:, 2] = np.where(inv_mass[2::3] > 0.0, rng.uniform(-0.3, 0.3, n_bodies), 0.0)
    v0 = spin * rng.standard_normal(n) * (inv_mass > 0.0)
    pairs: list[tuple[int, int]] = []
    blocks, rows, powers, first, start = [], [], [], 0, 0
    reach = np.zeros(len({(g.a, g.b) for g in groups}))
    for g in groups:
        if (g.a, g.b) not in pairs:
            pairs.append((g.a, g.b))
        p = rng.uniform(-0.4, 0.4, (g.count, 2))
        q = rng.uniform(-0.4, 0.4, (g.count, 2))
        world = []
        for body, local in ((g.a, p), (g.b, q)):
            c, s = np.cos(q0[3 * body + 2]), np.sin(q0[3 * body + 2])
            world.append(centre[body] + local @ np.array([[c, s], [-s, c]]))
        stop = start + -(-g.count // VECTOR) * VECTOR
        member = np.zeros((MEMBER, stop - start))
        member[0:2, : g.count], member[2:4, : g.count] = p.T, q.T
        member[4, : g.count] = np.hypot(*(world[1] - world[0]).T)
        member[STIFFNESS:, : g.count] = np.array([[g.stiffness], [g.damping], [g.preload]]) * rng.uniform(
            0.5, 1.5, g.count
        )
        rows.append(member)
        pair = pairs.index((g.a, g.b))
        reach[pair] = max(reach[pair], 0.57)
        kind = int(g.damping > 0 or g.preload != 0)
        blocks.append([pair, start, stop, kind, first if g.design else -1, g.count, 0, 0])
        powers.append(g.power)
        first += g.count if g.design else 0
        start = stop
    times = np.array(times, dtype=float)
    n_segment = len(times) - 1
    values = rng.standard_normal((n_segment + 1, n)) * np.where(inv_mass > 0, 15.0 / np.maximum(inv_mass, 1e-9), 0.0)
    values *= load
    force = np.zeros((n_segment, n, 2))
    load_force = np.zeros((n_segment, turning, 2, 2))
    extra = rng.standard_normal((n_segment + 1, turning, 2)) * 20.0
    for i in range(n_segment):
        length = times[i + 1] - times[i]
        jump = 1.0 + 0.5 * i if jumps else 1.0
        force[i, :, 0], force[i, :, 1] = jump * values[i], (values[i + 1] - values[i]) / length
        load_force[i, :, :, 0], load_force[i, :, :, 1] = extra[i], (extra[i + 1] - extra[i]) / length
    model = Model(
        inv_mass=inv_mass, q0=np.zeros(n), v0=v0, home=home_at(q0), pair=np.array(pairs, dtype=np.int64), reach=reach,
        shortest=np.full(len(pairs), 1e-3), block=np.array(blocks, dtype=np.int64), power=np.array(powers),
        near=np.full((len(blocks), 2), 0.01),
        member=np.concatenate(rows, axis=1), times=times, force=force,
        load_body=np.arange(turning, dtype=np.int64) % len(masses),
        load_follows=np.arange(turning, dtype=np.int64) % 2,
        load_arm=rng.uniform(-0.3, 0.3, (turning, 2)), load_force=load_force,
    )  # fmt: skip
    return Scene(model, any(g.damping > 0 for g in groups), first)


def home_at(q):
    """(n / 3, HOME): home of bodies at q (n,)."""
    places = q.reshape(-1, 3)
    return np.column_stack([places, np.cos(places[:, 2]), np.sin(places[:, 2])])


def figure_3(acceleration=(9.8, 0.0), turn=20.0, end=0.2) -> Scene:
    """The paper's scene: 20 points on a square, 51 on a U, 1020 members."""
    side = np.linspace(0.0, 2.0, 20, endpoint=False)
    edge, r = (side // 0.5).astype(int), side % 0.5
    there, back, near, far = r - 0.25, 0.25 - r, 0 * r - 0.25, 0 * r + 0.25
    square = np.array([[there, far, back, near], [near, there, far, back]])
    P = square[:, edge, np.arange(20)].T
    t, one = np.linspace(-0.8, 0.8, 17), np.ones(17)
    Q = np.concatenate([np.c_[-one, t], np.c_[t, -one], np.c_[one, t]]) - (0.0, -1.0)
    p, q = np.repeat(P, 51, axis=0), np.tile(Q, (20, 1))
    member = np.zeros((MEMBER, 1024))
    member[0:2, :1020], member[2:4, :1020] = p.T, q.T
    member[4, :1020] = np.hypot(*(q - p - np.array([0.0, 1.0])).T)
    member[STIFFNESS, :1020] = 225.0
    inv_mass = 1 / np.array([60.0, 60.0, 10.0, 2000.0, 2000.0, 6000.0])
    force = np.zeros((1, 6, 2))
    force[0, :, 0] = np.array([0, -9.8, 0, acceleration[0], acceleration[1] - 9.8, turn]) / inv_mass
    q0 = np.array([0.0, 0, 0, 0, -1, 0])
    model = Model(
        inv_mass=inv_mass, q0=np.zeros(6), v0=np.zeros(6), home=home_at(q0), pair=np.array([[0, 1]]),
        reach=np.array([2.1]), shortest=np.array([0.1]), block=np.array([[0, 0, 1024, 0, 0, 1020, 0, 0]]),
        power=np.ones(1), near=np.full((1, 2), 0.01), member=member, times=np.array([0.0, end]), force=force,
        load_body=np.zeros(0, np.int64), load_follows=np.zeros(0, np.int64), load_arm=np.zeros((0, 2)),
        load_force=np.zeros((1, 0, 2, 2)),
    )  # fmt: skip
    return Scene(model, False, 1020)


class Bench:
    """One scene through one method's entries: evaluate, then whatever differentiates what that left in room."""

    def __init__(self, scene: Scene, method="generalized_alpha", radius=0.8, reductions=(MAX,)) -> None:
        self.scene, self.method = scene, method
        self.entry = import_module(f"mdstopo.integrators.springs_{method}_entry")
        self.tables: Any = {
            "generalized_alpha": lambda: np.array([radius]),
            "gauss": gauss_tables,
            "runge_kutta": runge_kutta_tables,
        }[method]()
        self.packed = pack(scene.model)
        self.reductions = np.array(reductions)
        self.size = 64

    def run(self, alpha, step=0.0, tolerance=1e-10, gradient=True, newton=NEWTON_TOLERANCE):
        """Status code, times of the steps; rows, found, gradients are kept."""
        m = self.scene.model
        n, pairs, turning = len(m.inv_mass), len(m.pair), len(m.load_body) > 0
        padded, count = m.member.shape[1], len(self.reductions)
        self.alpha = np.asarray(alpha, dtype=float)
        self.strength = np.zeros((3, padded))
        self.rows = np.zeros((count, ROWS, 4))
        self.row_counts = np.zeros(count, dtype=np.int64)
        self.gradients = np.zeros((count, ROWS, self.scene.n_design))
        while True:
            self.limits = np.array([200_000, self.size, 20 * self.size])
            floats, ints = room_for(n, pairs, self.size, 20 * self.size, self.scene.damped, turning)
            self.room, self.room_ints = np.zeros(floats), np.zeros(ints, dtype=np.int64)
            self.work = np.zeros(WORK, dtype=np.int64)
            settings = np.array([tolerance, newton, step, CLOSENESS])
            code, self.count, _ = self.entry.simulate(
                *self.packed, self.tables, self.alpha, self.scene.damped, True, settings, self.limits, self.room,
                self.room_ints, self.strength, self.work,
            )  # fmt: skip
            if code != NEEDS_ROOM:
                break
            self.size *= 2
        if code == OK:
            evaluate_responses(
                self.entry.TAG, *self.packed, self.tables, self.alpha, self.scene.damped, settings, self.limits,
                self.count, self.reductions, gradient, self.room, self.room_ints, self.strength,
                np.zeros((ROWS, padded)), self.rows, self.row_counts, self.gradients, np.zeros(3, dtype=np.int64),
                self.work,
            )  # fmt: skip
        arrays = carve.py_func(
            self.room, self.room_ints, n, pairs, self.size, 20 * self.size, self.scene.damped, turning
        )
        self.t, self.state = arrays[0][: self.count + 1], arrays[1][: self.count + 1]
        self.scalar = arrays[3]
        return code

    @property
    def value(self):
        return self.rows[0, 0, 1]

    @property
    def gradient(self):
        return self.gradients[0, 0]

    def at(self, times):
        """q, v, a (3, T, n) of the dense output."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        out = np.zeros((3, len(times), len(self.scene.model.inv_mass)))
        dense(
            self.entry.TAG, *self.packed, self.tables, self.scene.damped, self.limits, self.count, self.room,
            self.room_ints, self.strength, times, out, self.work,
        )  # fmt: skip
        return out


def energies(scene: Scene, q):
    """Stored energy of every design member (N,) at unit strength where the bodies have moved by q (n,), and mu (N,)."""
    m = scene.model
    out, power = np.zeros(scene.n_design), np.zeros(scene.n_design)
    for (pair, start, _, _, first, count, _, _), mu in zip(m.block.tolist(), m.power.tolist(), strict=True):
        if first < 0:
            continue
        ends = []
        for row, body in zip((0, 2), m.pair[pair], strict=True):
            x, y, psi = m.home[body, :3] + q[3 * body : 3 * body + 3]
            local = m.member[row : row + 2, start : start + count]
            ends.append(
                [
                    x + np.cos(psi) * local[0] - np.sin(psi) * local[1],
                    y + np.sin(psi) * local[0] + np.cos(psi) * local[1],
                ]
            )
        stretch = np.hypot(*np.subtract(ends[1], ends[0])) - m.member[4, start : start + count]
        out[first : first + count] = 0.5 * m.member[STIFFNESS, start : start + count] * stretch**2
        power[first : first + count] = mu
    return out, power


def energy_at(bench, time):
    """g at a time of the last run."""
    unit, power = energies(bench.scene, bench.at(time)[0, 0])
    return float(np.sum(bench.alpha**power * unit))


def solved(scene, alpha, **options) -> Bench:
    """A bench after a run that must succeed."""
    settings = {key: options.pop(key) for key in ("method", "radius", "reductions") if key in options}
    bench = Bench(scene, **settings)
    assert bench.run(alpha, **options) == OK
    return bench
