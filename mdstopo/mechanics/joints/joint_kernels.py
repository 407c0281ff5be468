"""What a joint does: one record of kernels; `joint_table` makes the branches by code from these records.

A kernel takes what it needs of the following, in any order, by these names:

    par (WIDTH,)     the joint's parameters: its point on either body (4), its own numbers (`Joint.row`), and from
                     place 8 on what Phi is at home (`at_home`)
    w (PLACES,)      where both bodies are (`revolute.place_joint`); angles are those since home
    wd, wdd (6,)     their derivatives by time
    lam (3,)         multipliers, one a row
    phi (3,), jac (3, 6), gamma (3,), out (3, 6), by_q, by_v (3, 6), k (6, 6), by_lam (3,)    what it writes
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from mdstopo.compiler.kernel import Kernel

Function = Kernel | Callable[..., Any]


#: misfit of a joint at home, relative to its coordinates, that only rounding has left
FITTED = 4e-15


class AtHome(NamedTuple):
    """A joint at home. x, y: from its point on the first body to that on the second, m; c, s: of the first body's
    angle; size: what rounding of the points is measured against, m.
    """

    x: float
    y: float
    c: float
    s: float
    size: float


@dataclass(frozen=True, kw_only=True)
class JointKernels:
    """The kernels of a joint with one to three constraint equations Phi = 0; the equations of motion are M a +
    Phi_q^T lam = F.

    steady: for each row the slopes that are the same wherever the bodies are, as columns (x 0, y 1, angle 2) of either
    body. Where a changing slope is among them motions are wrong; an empty tuple is always right and costs time.
    phi: Phi and Phi_q, into phi and jac.
    A joint whose rows are all linear in w has nothing of the following four; it has all of them otherwise.
    gamma: of Phi'' = Phi_q a + gamma. velocity_slope: d(Phi_q v)/dq into out. acceleration_slopes:
    d(Phi_q a + gamma)/dq into by_q, d(gamma)/dv into by_v. stiffness: adds d(Phi_q^T lam)/dq to k.
    force_rows: of how many of the first rows the multipliers are the components of the force that the joint transmits,
    along directions that are perpendicular: 2, 1 or none. moment (par, w, lam, by_lam, by_q): the moment that it
    transmits, with its slopes; None where it transmits none.
    at_home (joint, home): parameters by their place, 8 to 11, that say what Phi is at home; None where that is zero.
    is_point: whether its rows are those of the revolute joint, and linear ones behind them, which spares work.
    """

    steady: tuple[tuple[int, ...], ...]
    phi: Function
    gamma: Function | None = None
    velocity_slope: Function | None = None
    acceleration_slopes: Function | None = None
    stiffness: Function | None = None
    force_rows: int = 0
    moment: Function | None = None
    at_home: Callable[[Any, AtHome], dict[int, float]] | None = None
    is_point: bool = False

    @property
    def rows(self) -> int:
        """How many constraint equations the joint has."""
        return len(self.steady)
