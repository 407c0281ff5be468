"""The curvature of a subproblem: B, positive semidefinite, as a matrix, or as a diagonal and a few directions.

What rows that are lines or norms leave out of the Lagrangian's curvature is learnt from its gradients: BFGS, damped as
by M. J. D. Powell (1978), of all steps where the variables are few, else of the last ones in compact form (R. H. Byrd,
J. Nocedal and R. B. Schnabel, 1994). Of few variables B is scaled down before an update where it is far too large along
the step (S. S. Oren and D. G. Luenberger, 1974): BFGS alone learns of one direction a step that it is as flat. To scale
at every step would delay the convergence of smooth functions (J. Nocedal and Y. Yuan, 1993); of a problem that is known
to be smooth B is never scaled down, because what was learnt of steep directions would be forgotten.
"""

from dataclasses import dataclass, replace

import numpy as np

from mdstopo.optimizer.problem import Bools, Floats

#: variables up to which B is a matrix, and the last steps that it is learnt from where it is none
FEW_VARIABLES, KEPT_STEPS = 250, 12
#: the least y's over s'B s, before y is damped
DAMPING = 0.2
#: the share of B's curvature along a step below which B is scaled down, by this factor
FAR_TOO_LARGE = 0.2


@dataclass(frozen=True, slots=True)
class Curvature:
    """A matrix B = diag(diagonal) + factor diag(weight) factor', or `matrix` where that is given.

    diagonal (N,); factor (N, m); weight (m,), none 0; matrix (N, N) or None.
    """

    diagonal: Floats
    factor: Floats
    weight: Floats
    matrix: Floats | None = None

    @classmethod
    def diagonal_of(cls, diagonal: Floats) -> "Curvature":
        """A matrix with this diagonal (N,) and nothing beside it."""
        return cls(diagonal, np.zeros((len(diagonal), 0)), np.zeros(0))

    def times(self, x: Floats) -> Floats:
        """The product B x (N,)."""
        if self.matrix is not None:
            return np.asarray(self.matrix @ x)
        return np.asarray(self.diagonal * x + self.factor @ (self.weight * (self.factor.T @ x)))

    def dense(self) -> Floats:
        """The matrix B (N, N), with all its entries."""
        if self.matrix is not None:
            return self.matrix
        return np.asarray(np.diag(self.diagonal) + (self.factor * self.weight) @ self.factor.T)

    def scaled(self, width: Floats, by: float) -> "Curvature":
        """This curvature in variables of another width (N,), divided by a number."""
        if self.matrix is not None:
            return replace(self, matrix=self.matrix * np.outer(width, width) / by)
        return Curvature(self.diagonal * width**2 / by, self.factor * width[:, None], self.weight / by)

    def restricted(self, some: Bools) -> "Curvature":
        """This curvature of some of the variables, chosen by a mask (N,)."""
        if self.matrix is not None:
            return replace(self, matrix=self.matrix[np.ix_(some, some)])
        return Curvature(self.diagonal[some], self.factor[some], self.weight)


def learnt(
    steps: Floats, changes: Floats, floor: float, scaled_down: bool = True, first: float | None = None
) -> Curvature:
    """B after steps (m, N), the oldest first, and the changes (m, N) of the Lagrangian's gradient over them.

    floor: the least curvature of B before anything is learnt. scaled_down: whether all of B is, where it is far too
    large along a step. first: the curvature before anything is learnt, in the place of that of the last step.
    """
    n = steps.shape[1]
    sigma = _first(steps, changes, floor) if first is None else first
    if n > FEW_VARIABLES:
        return _compact(steps[-KEPT_STEPS:], changes[-KEPT_STEPS:], sigma)
    B = sigma * np.eye(n)
    for s, y in zip(steps, changes, strict=True):
        Bs = B @ s
        sBs = float(s @ Bs)
        if not sBs > 0.0:
            continue
        if scaled_down and 0.0 < float(s @ y) < FAR_TOO_LARGE * sBs:
            B, Bs, sBs = FAR_TOO_LARGE * B, FAR_TOO_LARGE * Bs, FAR_TOO_LARGE * sBs
        damped = _damped(s, y, Bs, sBs)
        B = B - np.outer(Bs, Bs) / sBs + np.outer(damped, damped) / float(s @ damped)
    return Curvature(np.zeros(n), np.zeros((n, 0)), np.zeros(0), 0.5 * (B + B.T))


def _first(steps: Floats, changes: Floats, floor: float) -> float:
    """The curvature of all directions before anything is learnt: that of the last step along itself."""
    for s, y in zip(steps[::-1], changes[::-1], strict=True):
        curved = float(s @ y)
        if curved > 0.0:
            return max(floor, curved / float(s @ s))
    return floor


def _damped(s: Floats, y: Floats, Bs: Floats, sBs: float) -> Floats:
    """y (N,), mixed with B s where the function is concave along s (Powell's damping), so that B stays positive."""
    sy = float(s @ y)
    if sy >= DAMPING * sBs:
        return y
    share = (1.0 - DAMPING) * sBs / (sBs - sy)
    return np.asarray(share * y + (1.0 - share) * Bs)


def _compact(steps: Floats, changes: Floats, sigma: float) -> Curvature:
    """The same of the last steps in compact form, as weights of orthonormal directions."""
    n = steps.shape[1]
    S, Y = np.zeros((n, 0)), np.zeros((n, 0))
    inner = np.zeros((0, 0))
    for s, y in zip(steps, changes, strict=True):
        beside = _beside(S, Y, sigma)
        Bs = sigma * s - beside @ (inner @ (beside.T @ s))
        sBs = float(s @ Bs)
        if not sBs > 0.0:
            continue
        more_S, more_Y = np.column_stack([S, s]), np.column_stack([Y, _damped(s, y, Bs, sBs)])
        found = _inner(more_S, more_Y, sigma)
        if found is not None:
            S, Y, inner = more_S, more_Y, found
    if not S.shape[1]:
        return Curvature.diagonal_of(np.full(n, sigma))
    directions, R = np.linalg.qr(_beside(S, Y, sigma))
    turned = -R @ inner @ R.T
    weight, turn = np.linalg.eigh(0.5 * (turned + turned.T))
    weight = np.maximum(weight, -(1.0 - 1e-8) * sigma)
    used = np.abs(weight) > 1e-12 * max(1.0, float(np.abs(weight).max(initial=0.0)))
    return Curvature(np.full(n, sigma), directions @ turn[:, used], weight[used])


def _beside(S: Floats, Y: Floats, sigma: float) -> Floats:
    return np.concatenate([sigma * S, Y], axis=1)


def _inner(S: Floats, Y: Floats, sigma: float) -> Floats | None:
    """M^-1 of B = sigma I - [sigma S, Y] M^-1 [sigma S, Y]' with M = [[sigma S'S, L], [L', -D]]; None: singular."""
    SY = S.T @ Y
    L, D = np.tril(SY, -1), np.diag(np.diag(SY))
    try:
        return np.asarray(np.linalg.inv(np.block([[sigma * (S.T @ S), L], [L.T, -D]])))
    except np.linalg.LinAlgError:
        return None
