"""Which programs there are. Their modules, and with them their packages, are imported only in their own processes."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from benchmarks.peers.problem import Floats

#: (alpha, whether the gradient is wanted) -> G and dG/dalpha (N,), or None where it is not wanted or cannot be had
Objective = Callable[[Floats, bool], tuple[float, Floats | None]]

OURS = "mdstopo"


@dataclass(frozen=True)
class Peer:
    """A program. module: has `make(problem, **setting) -> Objective`; packages: what it needs.

    gradient: whether it has one; hinges: whether it can have them.
    """

    module: str
    packages: tuple[str, ...]
    gradient: bool = True
    hinges: bool = True

    def missing(self) -> list[str]:
        """Those of its packages that are not installed."""
        return [name for name in self.packages if find_spec(name) is None]


PEERS = {
    OURS: Peer("benchmarks.peers.ours", ("numba",)),
    "jax": Peer("benchmarks.peers.jax_steps", ("jax", "scipy")),
    "diffrax": Peer("benchmarks.peers.diffrax_dopri", ("diffrax", "jax", "scipy"), hinges=False),
    "casadi": Peer("benchmarks.peers.casadi_sundials", ("casadi",)),
    "scipy": Peer("benchmarks.peers.scipy_adjoint", ("scipy", "numba"), hinges=False),
    "exudyn": Peer("benchmarks.peers.exudyn_forward", ("exudyn",), gradient=False),
    "mujoco": Peer("benchmarks.peers.mujoco_forward", ("mujoco",), gradient=False),
}

#: the same for the seated occupant
PEERS_OF_SEAT = {
    OURS: Peer("benchmarks.peers.ours_seat", ("numba",)),
    "jax": Peer("benchmarks.peers.jax_seat", ("jax", "scipy")),
}

#: the same for scenes in space
PEERS_IN_SPACE = {
    OURS: Peer("benchmarks.peers.ours_space", ("numba",)),
    "jax": Peer("benchmarks.peers.jax_space", ("jax", "scipy")),
    "casadi": Peer("benchmarks.peers.casadi_space", ("casadi",)),
    "exudyn": Peer("benchmarks.peers.exudyn_space", ("exudyn",), gradient=False),
    "mujoco": Peer("benchmarks.peers.mujoco_space", ("mujoco",), gradient=False),
}
