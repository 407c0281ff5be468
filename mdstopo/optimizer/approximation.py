"""The convex separable approximation of GSAO (Ma and Kikuchi 1995).

At an iterate x^k every row is replaced by

    f~(x) = f_k + sum_i (df/dx_i) (x_i^k - c_i)/xi * [ ((x_i - c_i)/(x_i^k - c_i))^xi - 1 ]

with the shift c_i = L_i below x where the row falls in x_i and c_i = U_i above where it rises; that choice
makes every term convex for xi <= 1. All rows share xi, L and U, so a design costs two powers a variable
however many rows there are. The objective also carries the convex term sum_i kappa_i/2 (x_i - x_i^k)^2.

With the stretches u = (x - L)/(x^k - L) and w = (U - x)/(U - x^k) the derivatives of the two kinds of term
are u^(xi-1) and w^(xi-1) times df/dx_i.
"""

from dataclasses import dataclass, replace

import numpy as np

from mdstopo.optimizer.problem import Bools, Floats


@dataclass(frozen=True, slots=True)
class Approximation:
    """Rows around x^k. Shapes: x, below, above, kappa (N,); values (R,); slopes (R, N).

    below = x^k - L and above = U - x^k, both > 0. The first `n_objective` rows compete for the objective, the
    others are constraints. `linear_above`: rising terms are linear (the sign rule of CONLIN and OC).
    """

    x: Floats
    below: Floats
    above: Floats
    values: Floats
    slopes: Floats
    n_objective: int
    power: float
    linear_above: bool
    kappa: Floats

    @property
    def linear(self) -> bool:
        """Whether every row is linear (SLP); the convex term is not a row."""
        return self.power == 1.0

    def rows(self, x: Floats) -> Floats:
        """f~(x) of every row, (R,), without the convex term."""
        step = x - self.x
        if self.linear:
            return np.asarray(self.values + np.einsum("ri,i->r", self.slopes, step))
        falling, rising = self._primitives(step)
        return self.values + _sided(self.slopes, falling, rising)

    def convex(self, x: Floats) -> float:
        """The value of the convex term at x."""
        step = x - self.x
        return 0.5 * float(np.einsum("i,i,i->", self.kappa, step, step))

    def model(self, x: Floats) -> tuple[float, Floats]:
        """What the model promises at x: the largest objective row with the convex term, and the constraint
        rows."""
        rows = self.rows(x)
        return float(rows[: self.n_objective].max()) + self.convex(x), rows[self.n_objective :]

    def restricted(self, some: Bools) -> "Approximation":
        """The same rows as functions of some of the variables, the others staying at the iterate."""
        return replace(
            self,
            x=self.x[some],
            below=self.below[some],
            above=self.above[some],
            slopes=self.slopes[:, some],
            kappa=self.kappa[some],
        )

    def _primitives(self, step: Floats) -> tuple[Floats, Floats]:
        u = 1.0 + step / self.below
        falling = self.below * _stretched(u, self.power)
        if self.linear_above:
            return falling, step
        w = 1.0 - step / self.above
        return falling, -self.above * _stretched(w, self.power)


def _stretched(t: Floats, power: float) -> Floats:
    """(t^power - 1)/power, and its limit log t at power 0."""
    if power == 0.0:
        return np.log(t)
    return (t**power - 1.0) / power


def _sided(slopes: Floats, falling: Floats, rising: Floats) -> Floats:
    """sum_i slope_i times the term of the side that belongs to the slope's sign, (R,)."""
    down = np.einsum("ri,i->r", np.minimum(slopes, 0.0), falling)
    return np.asarray(down + np.einsum("ri,i->r", np.maximum(slopes, 0.0), rising))
