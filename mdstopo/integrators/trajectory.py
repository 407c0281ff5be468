"""The motion of a scene as the user sees it: steps, and any time between them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from mdstopo.integrators.scene_driver import Steps
from mdstopo.integrators.steps import Q, V
from mdstopo.scene.model import FloatArray
from mdstopo.status import Status


@dataclass(frozen=True)
class States:
    """States at T times: q, v, a (T, n) in m, rad and their time derivatives; lam (T, n_rows) in N, N m."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    lam: FloatArray


@dataclass(frozen=True)
class Trajectory:
    """One simulated load case.

    t (T,): times of the accepted steps, start and end included; q, v, a (T, n): x, y, psi of each body as declared and
    their derivatives, a by the equations of motion, right-continuous where a load jumps; lam (T, n_rows): Lagrange
    multipliers (no rows without joints and motions). status: anything but OK means that it ends early, at t[-1], or
    goes on without being right (ZERO_LENGTH, STEP_TOO_LARGE); message says why. work: counts by name. reactions: Fx,
    Fy, M (T, 3) of each joint on its first body, at the joint, global axes. home (n,): where the bodies are by the case
    when those of `steps` have not moved.
    """

    load_case: str
    status: Status
    message: str
    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    lam: FloatArray
    work: dict[str, int]
    steps: Steps = field(repr=False)
    reactions: Mapping[str, FloatArray] = field(default_factory=dict)
    home: FloatArray = field(default_factory=lambda: np.zeros(0), repr=False)

    @classmethod
    def of(
        cls,
        load_case: str,
        steps: Steps,
        status: Status,
        message: str,
        work: dict[str, int],
        home: FloatArray,
    ) -> "Trajectory":
        """The trajectory of steps, which tell what bodies have moved since home.

        load_case: its name.
        steps: what the driver gave, with its dense output.
        status, message: how the simulation ended, and why.
        work: counts by name.
        home (n,): places and angles (m, rad) of the coordinates that the trajectory has; it leaves out further ones of
          the steps.
        """
        t, n = steps.t.copy(), len(home)
        q, v = steps.state[:, Q, :n].copy(), steps.state[:, V, :n].copy()
        q += home
        a, lam = np.zeros_like(q), np.zeros((len(t), 0))
        reactions: Mapping[str, FloatArray] = {}
        if steps.count:
            out, lam = steps.balanced(t)
            a = out[2][:, :n].copy()
            reactions = steps.reactions(out[0], lam)
        return cls(load_case, status, message, t, q, v, a, lam, work, steps, reactions, home)

    def at(self, times: ArrayLike) -> States:
        """States at times (T,), from the integrator's own dense output.

        Raises ValueError where a time lies outside what was simulated.
        """
        asked = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if asked.ndim != 1 or not np.all((asked >= self.t[0]) & (asked <= self.t[-1])):
            raise ValueError(f"times must be one-dimensional and lie within {self.t[0]:g} .. {self.t[-1]:g} s")
        n = self.q.shape[1]
        out, lam = self.steps.balanced(asked)
        q, v, a = out[:, :, :n]
        q += self.home
        return States(q, v, a, lam)
