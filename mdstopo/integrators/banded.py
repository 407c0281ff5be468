"""Elimination of banded systems with partial pivoting: the effective matrix of an implicit step.

Bodies that members do not connect do not meet in the matrix: a chain of bodies, declared in its order, costs what
its length costs. For two bodies it is plain dense elimination. Row i holds column j at place j - i + half; pivoting
fills up to 2 half places right of the diagonal.
"""

from mdstopo.compiler.jit import kernel


@kernel
def half_width(pair, inv_mass):
    """Places between the diagonal and the farthest entry; bodies that are held (infinite mass) connect nothing."""
    gap = 0
    for p in range(pair.shape[0]):
        a = pair[p, 0]
        b = pair[p, 1]
        if inv_mass[3 * a] > 0.0 and inv_mass[3 * b] > 0.0:
            gap = max(gap, abs(a - b))
    return 3 * gap + 2


@kernel
def factorise(band, half, pivots):
    """Factorise in place: band (n, 3 half + 1), pivots (n,). Returns False where the matrix is singular."""
    n = band.shape[0]
    for k in range(n):
        last = min(k + half, n - 1)
        reach = min(k + 2 * half, n - 1)
        best = k
        for i in range(k + 1, last + 1):
            if abs(band[i, k - i + half]) > abs(band[best, k - best + half]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(k, reach + 1):
                kept = band[k, j - k + half]
                band[k, j - k + half] = band[best, j - best + half]
                band[best, j - best + half] = kept
        pivot = band[k, half]
        if pivot == 0.0:
            return False
        for i in range(k + 1, last + 1):
            factor = band[i, k - i + half] / pivot
            band[i, k - i + half] = factor
            if factor != 0.0:
                for j in range(k + 1, reach + 1):
                    band[i, j - i + half] -= factor * band[k, j - k + half]
    return True


@kernel
def solve(band, half, pivots, x):
    """Solve with the factors of `factorise`, in place: x (n,)."""
    n = band.shape[0]
    for k in range(n):
        best = pivots[k]
        value = x[best]
        x[best] = x[k]
        x[k] = value
        for i in range(k + 1, min(k + half, n - 1) + 1):
            x[i] -= band[i, k - i + half] * value
    for k in range(n - 1, -1, -1):
        value = x[k]
        for j in range(k + 1, min(k + 2 * half, n - 1) + 1):
            value -= band[k, j - k + half] * x[j]
        x[k] = value / band[k, half]
