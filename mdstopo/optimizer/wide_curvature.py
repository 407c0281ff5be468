"""Curvature of very many variables that is learnt from a few steps, told by products of vectors alone."""

import numpy as np

from mdstopo.optimizer.problem import Floats

#: the least share of B that a step's curvature is bent to (M. J. D. Powell's damping)
DAMPING = 0.2


def known_curvature(products: Floats, m: int, floor: float) -> float:
    """The curvature of directions that nothing is known of: that of the last step along itself, at least the floor."""
    for j in range(m - 1, -1, -1):
        if products[j, m + j] > 0.0:
            return max(floor, float(products[j, m + j] / products[j, j]))
    return floor


def compact(products: Floats, m: int, sigma: float) -> Floats | None:
    """M (2 m, 2 m) of B = sigma - Z' M^-1 Z, all in ranges.

    products (2 m, 2 m): of Z: m steps, the oldest first, and the changes of the Lagrangian's gradient over them. BFGS
    in compact form (R. H. Byrd, J. Nocedal, R. B. Schnabel, 1994), the changes damped as in `curvature`: a vector is
    told by its components in Z. B is positive whatever the products, so they may be those of a sample. None where M is
    singular.
    """
    unit = np.eye(2 * m)
    S, Y = np.zeros((2 * m, 0)), np.zeros((2 * m, 0))
    M = np.zeros((0, 0))
    try:
        for j in range(m):
            Z = np.concatenate([sigma * S, Y], axis=1)
            Bs = sigma * unit[j] - Z @ np.linalg.solve(M, Z.T @ products[:, j])
            sBs, sy = float(products[j] @ Bs), float(products[j, m + j])
            share = 1.0 if sy >= DAMPING * sBs else (1.0 - DAMPING) * sBs / (sBs - sy)
            S = np.column_stack([S, unit[j]])
            Y = np.column_stack([Y, share * unit[m + j] + (1.0 - share) * Bs])
            SY = S.T @ products @ Y
            L, D = np.tril(SY, -1), np.diag(np.diag(SY))
            M = np.block([[sigma * (S.T @ products @ S), L], [L.T, -D]])
        back = np.linalg.inv(np.concatenate([sigma * S, Y], axis=1))
        found = back.T @ M @ back
    except np.linalg.LinAlgError:
        return None
    return 0.5 * (found + found.T) if np.isfinite(found).all() else None
