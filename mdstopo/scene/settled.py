"""The static equilibrium at which a motion starts (`general.at_rest.settle` finds it)."""

from dataclasses import dataclass

from mdstopo.scene.springs_model import FloatArray


@dataclass(frozen=True)
class Settled:
    """The static equilibrium from which the motion starts.

    q (n_q,): what the bodies have moved since home.
    inverse (n, n): dq = inverse dF. moved: how far the centre of a body has gone at most, m, and whose it is;
    turned: the same of angles, rad.
    """

    q: FloatArray
    inverse: FloatArray
    moved: float
    moved_body: str
    turned: float
    turned_body: str

    @property
    def moves(self) -> str:
        """How far bodies have moved, in words that follow `the start has`."""
        return (
            f"settled by {self.moved:.4g} m at most (body {self.moved_body}), "
            f"turned by {self.turned:.4g} rad (body {self.turned_body})"
        )

    def __str__(self) -> str:
        return f"the start has {self.moves}"
