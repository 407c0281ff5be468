"""The motion of a scene as the user sees it: steps, and any time between them."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mdstopo.integrators.scene_driver import Steps
from mdstopo.scene.border import Border
from mdstopo.scene.springs_model import FloatArray
from mdstopo.shown import counted, html_of
from mdstopo.status import Status


@dataclass(frozen=True)
class States:
    """States at T times, with the columns of a `Trajectory`: q, v, a in m, rad and their time derivatives; lam
    (T, n_rows) in N, N m."""

    q: FloatArray
    v: FloatArray
    a: FloatArray
    lam: FloatArray


@dataclass(frozen=True, repr=False)
class Trajectory:
    """One simulated load case.

    t (T,): times of the accepted steps, start and end included; q, v, a (T, n): x, y, psi of each body as declared and
    their derivatives; in space q (T, 7 n_bodies): x, y, z and the unit quaternion w, x, y, z, and v, a (T, 6 n_bodies):
    of the centre of mass, then angular, global. a by the equations of motion, right-continuous where a load jumps; lam
    (T, n_rows): Lagrange multipliers (no rows without joints and motions). status: anything but OK means that it ends
    early, at t[-1], or goes on without being right (ZERO_LENGTH, STEP_TOO_LARGE); message says why. work: counts by
    name. reactions: Fx, Fy, M (T, 3), in space Fx, Fy, Fz, Mx, My, Mz (T, 6), of each joint on its first body, at the
    joint, global axes. border: what makes of states of `steps` those of the case. bodies: the names of the bodies.
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
    border: Border | None = field(default=None, repr=False)
    bodies: tuple[str, ...] = ()

    def __repr__(self) -> str:
        why = f" ({self.message})" if self.message else ""
        steps, end = counted(len(self.t) - 1, "step"), f"{self.t[0]:g} to {self.t[-1]:g} s"
        return f"<Trajectory of load case {self.load_case!r}: {self.status.value}{why}; {steps} from {end}>"

    def _repr_html_(self) -> str:
        return html_of(self)

    def __getstate__(self) -> dict[str, object]:
        """What is pickled: the states at the steps. What computes those between them is compiled for this process."""
        return {**self.__dict__, "steps": None, "border": None}

    def __copy__(self) -> "Trajectory":
        """A copy in this process, which has all there is."""
        return replace(self)

    def __deepcopy__(self, memo: dict[int, object]) -> "Trajectory":
        """The same with arrays of its own; it shares what computes states between the steps, which nothing changes."""
        shared = ("steps", "border")
        return replace(self, **{key: deepcopy(value, memo) for key, value in vars(self).items() if key not in shared})

    @classmethod
    def of(
        cls,
        load_case: str,
        steps: Steps,
        status: Status,
        message: str,
        work: dict[str, int],
        border: Border,
        bodies: tuple[str, ...],
    ) -> "Trajectory":
        """The trajectory of steps.

        load_case: its name.
        steps: what the driver gave, with its dense output.
        status, message: how the simulation ended, and why.
        work: counts by name.
        border: what makes of their states those of the case; it leaves out further bodies.
        bodies: the names of the bodies.
        """
        t, lam = steps.t.copy(), np.zeros((len(steps.t), 0))
        q, v = border.places(steps.q), border.rates(steps.q, steps.v)
        a = np.zeros_like(v)
        reactions: Mapping[str, FloatArray] = {}
        if steps.count:
            (own_q, _, own_a), lam = steps.balanced(t)
            a = border.rates(own_q, own_a)
            reactions = steps.reactions(own_q, lam)
        return cls(load_case, status, message, t, q, v, a, lam, work, steps, reactions, border, bodies)

    def at(self, times: ArrayLike) -> States:
        """States at times (T,), from the integrator's own dense output.

        Raises ValueError where a time lies outside what was simulated, and of a trajectory that was pickled, which has
        the states at its steps alone.
        """
        if self.border is None:
            raise ValueError("a pickled trajectory has the states at its steps (t, q, v, a), none between them")
        asked = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if asked.ndim != 1 or not np.all((asked >= self.t[0]) & (asked <= self.t[-1])):
            raise ValueError(f"times must be one-dimensional and lie within {self.t[0]:g} .. {self.t[-1]:g} s")
        (q, v, a), lam = self.steps.balanced(asked)
        return States(self.border.places(q), self.border.rates(q, v), self.border.rates(q, a), lam)
