"""The equations of the paper once more, in plain numpy, member by member in global axes, and scipy's integrator.

Nothing here comes from the package but the case: body coordinates are worked out anew from what the case says in
global axes. Equation numbers are the paper's.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from mdstopo.case.model import GROUND, Case, Table


def rotation(angle: float) -> np.ndarray:
    """Body axes to global axes."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


@dataclass(frozen=True)
class Plain:
    """A load case of a case with one design."""

    case: Case
    alpha: np.ndarray
    name: str = ""

    @cached_property
    def load_case(self):
        return self.case.load_case(self.name) if self.name else self.case.load_cases[0]

    @cached_property
    def mass(self) -> np.ndarray:
        return np.array([m for b in self.case.bodies for m in (b.mass, b.mass, b.inertia)])

    @cached_property
    def start(self) -> np.ndarray:
        q = np.array([c for b in self.load_case.bodies for c in (*b.position, b.angle)])
        v = np.array([c for b in self.load_case.bodies for c in (*b.velocity, b.angular_velocity)])
        return np.r_[q, v]

    def place(self, name: str) -> int:
        """First coordinate of a body; -1 for ground."""
        names = [b.name for b in self.case.bodies]
        return -1 if name == GROUND else 3 * names.index(name)

    def pose(self, q: np.ndarray, name: str) -> tuple[np.ndarray, float]:
        i = self.place(name)
        return (np.zeros(2), 0.0) if i < 0 else (q[i : i + 2], q[i + 2])

    def arm(self, name: str, world: np.ndarray) -> np.ndarray:
        """Points given in global axes at the start, in body coordinates (n, 2)."""
        x, angle = self.pose(self.start, name)
        return (np.atleast_2d(world) - x) @ rotation(angle)

    @cached_property
    def constants(self):
        """Per group: law, strength alpha^mu (Eq. 12), free lengths, places of the bodies, arms in body coordinates."""
        first, out = 0, []
        for group in self.case.members:
            (law,) = group.laws
            strength = np.ones(len(group))
            if group.design:
                strength = self.alpha[first : first + len(group)] ** group.power
                first += len(group)
            start = np.hypot(*(group.q_world - group.p_world).T)
            free = start if law.free_length is None else law.free_length
            arms = self.arm(group.body_from, group.p_world), self.arm(group.body_to, group.q_world)
            out.append((group, law, strength, free, self.place(group.body_from), self.place(group.body_to), *arms))
        return out

    def groups(self, q: np.ndarray, v: np.ndarray):
        """Per group: group, law, strength, B (M, n) (Eq. 32), elongation and its rate (Eq. 34, 36)."""
        for group, law, strength, free, i, j, arm_p, arm_q in self.constants:
            (xp, ap), (xq, aq) = self.pose(q, group.body_from), self.pose(q, group.body_to)
            rp, rq = arm_p @ rotation(ap).T, arm_q @ rotation(aq).T
            r = (xq + rq) - (xp + rp)
            length = np.hypot(r[:, 0], r[:, 1])
            e = r / length[:, None]
            B = np.zeros((len(group), len(q)))  # dDelta/dq = -B
            if i >= 0:
                B[:, i : i + 2] += e
                B[:, i + 2] += rp[:, 0] * e[:, 1] - rp[:, 1] * e[:, 0]
            if j >= 0:
                B[:, j : j + 2] -= e
                B[:, j + 2] -= rq[:, 0] * e[:, 1] - rq[:, 1] * e[:, 0]
            yield group, law, strength, B, length - free, -B @ v

    def member_force(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """F_g of all members, F = B^T f (Eq. 5, 10, 13)."""
        total = np.zeros(len(self.mass))
        for _, law, strength, B, delta, rate in self.groups(q, v):
            total += B.T @ (strength * (law.stiffness * delta + law.damping * rate + law.preload))
        return total

    def energies(self, q: np.ndarray) -> np.ndarray:
        """V_i at alpha = 1 of the design members (N,)."""
        parts = [
            0.5 * law.stiffness * delta**2
            for group, law, _, _, delta, _ in self.groups(q, np.zeros_like(q))
            if group.design
        ]
        return np.concatenate(parts)

    def energy(self, q: np.ndarray) -> float:
        """Stored energy of the design members (Eq. 21)."""
        return float(sum(
            0.5 * law.stiffness * strength @ delta**2
            for group, law, strength, _, delta, _ in self.groups(q, np.zeros_like(q))
            if group.design
        ))  # fmt: skip

    def value(self, signal, t: float, before: bool = False) -> float:
        """A signal of time; right-continuous unless the value just before is asked for."""
        if not isinstance(signal, Table):
            return float(signal)
        times, values = signal.times, signal.values.ravel()
        i = int(np.searchsorted(times, t, side="left" if before else "right"))
        if i == 0 or i == len(times):
            return float(values[0 if i == 0 else -1])
        return float(values[i - 1] + (values[i] - values[i - 1]) * (t - times[i - 1]) / (times[i] - times[i - 1]))

    def load_force(self, t: float, q: np.ndarray, before: bool = False) -> np.ndarray:
        total = np.zeros(len(self.mass))
        for body in self.case.bodies:
            i = self.place(body.name)
            total[i : i + 2] += body.mass * np.array(self.load_case.gravity)
        for load in self.load_case.loads:
            i = self.place(load.body)
            f = np.array([self.value(each, t, before) for each in load.force])
            turn = rotation(q[i + 2])
            if load.frame == "body":
                f = turn @ f
            x, y = turn @ np.array(load.at_local)
            total[i : i + 2] += f
            total[i + 2] += x * f[1] - y * f[0] + self.value(load.moment, t, before)
        return total

    def acceleration(self, t: float, q: np.ndarray, v: np.ndarray, before: bool = False) -> np.ndarray:
        return (self.load_force(t, q, before) + self.member_force(q, v)) / self.mass

    @property
    def kinks(self) -> np.ndarray:
        """Start, times of table rows inside, end."""
        case = self.load_case
        inside = {
            t
            for load in case.loads
            for signal in (*load.force, load.moment)
            if isinstance(signal, Table)
            for t in signal.times.tolist()
            if case.start < t < case.end
        }
        return np.array([case.start, *sorted(inside), case.end])

    def solve(self, times: np.ndarray, rtol: float = 1e-12) -> np.ndarray:
        """States (len(times), 2 n) at rising times, by DOP853, landing on every kink and on every asked time."""
        n = len(self.mass)

        def rate(t: float, y: np.ndarray) -> np.ndarray:
            inner = min(max(t, low), high)
            return np.r_[y[n:], self.acceleration(inner, y[:n], y[n:], before=inner == high)]

        stops = np.unique(np.r_[self.kinks, times])
        y = self.start
        found = {stops[0]: y}
        for low, high in pairwise(stops):
            y = solve_ivp(rate, (low, high), y, method="DOP853", rtol=rtol, atol=1e-14).y[:, -1]
            found[high] = y
        return np.array([found[t] for t in times])
