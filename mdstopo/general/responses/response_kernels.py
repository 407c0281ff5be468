"""How a response is computed: one record of kernels, which `general_responses` makes the dispatch by code of.

A kernel takes what it needs of the following, in any order, by these names:

    model, j          the scene's arrays (`general.model.general_model`), and which of its responses it is;
                      `model.response_par[j]` has the point in body coordinates, where there is one, then
                      `Response.numbers`, four at most; in space always three numbers for the point, then the others,
                      vectors among them in the axes of arrays (`spatial_scene`); of a displacement the others are what
                      it counts from (`since_settled`)
    member_state, segment (`general.dynamics.members`), the stretch of time between two breakpoints
    who               of a response of members the member that is meant
    t, q, v, a, lam   a state whose balance has just been made: time, coordinates, velocities, accelerations (n,),
                      multipliers (n_row,)
    workspace              what the balance has left (`general.dynamics.accelerations`)
    bars, row_bar     (3, n) slopes by q, v, a and (n_row,) by lam: zero before, added to
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mdstopo.compiler.kernel import Kernel

Function = Kernel | Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class VectorKernels:
    """The kernels of a response that is a component or the norm of a vector.

    In a plane there are two more. across: the component perpendicular to the vector, a quarter turn ahead, with its
    slopes added, its direction held; components (..., out): the vector itself into out (2,).
    is_turn: whether it is measured in radians, not in metres.
    """

    across: Function | None = None
    components: Function | None = None
    is_turn: bool = False


@dataclass(frozen=True, kw_only=True)
class ResponseKernels:
    """The kernels of a response g(q, v, a, lam), and what it can do.

    value: g_j, with its slopes added to bars and row_bar.
    vector: of a component or a norm. absolute: whether it is an absolute value, or a largest one, which has kinks.
    needs_accelerations: whether it needs a, lam or the workspace; where not, its order (`ResponseKind`) says of how
    many derivatives of the motion it is. by_state: whether its rate is g_q v + g_v a where the motion has the
    derivatives that its order asks for; else the rate is differenced along the motion.
    in_plane, in_space: whether there is such a response of bodies in a plane, and in space.
    """

    value: Function
    vector: VectorKernels | None = None
    absolute: bool = False
    needs_accelerations: bool = True
    by_state: bool = False
    in_plane: bool = True
    in_space: bool = True
