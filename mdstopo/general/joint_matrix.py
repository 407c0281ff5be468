"""The balance with its bodies eliminated first: what is left is a matrix of the joints alone.

    [M  Phi_q^T] [a  ]   [f]        (Phi_q M^-1 Phi_q^T) lam = Phi_q M^-1 f - g
    [Phi_q   0 ] [lam] = [g]        a = M^-1 (f - Phi_q^T lam)

As long as no inerters couple bodies, M is diagonal, and the joints' matrix is symmetric, positive definite where joints
are independent, and has as many rows as these: Cholesky's factors of it cost a small part of those of the whole
balance. It couples rows that meet at a body that can move (`GeneralModel.meet`) and is banded in an order of its own
(`GeneralModel.line`). Its rows are scaled to a diagonal of ones. Then the joints are as good as singular where its
smallest eigenvalue, the square of the smallest singular value of the scaled Phi_q, all but vanishes. A pivot need not
show that, as the row that is about to repeat the others may be one that has little part in it (`weakest`).
"""

import numpy as np

from mdstopo.general.model import INERTER
from mdstopo.jit import kernel

#: a pivot, or an eigenvalue, of a scaled matrix below this means that joints contradict or repeat each other here
SINGULAR = 1e-12


@kernel
def inverse_masses(model):  # type: ignore[no-untyped-def]
    """(n,): 1 over the mass of each coordinate; 0 for what is driven, which does not answer."""
    inverse = np.zeros(model.mass.shape[0])
    for d in range(inverse.shape[0]):
        if model.free[d] != 0:
            inverse[d] = 1.0 / model.mass[d]
    return inverse


@kernel
def is_diagonal(model):  # type: ignore[no-untyped-def]
    """Whether the mass is: nothing but inerters couples accelerations."""
    inertial = 0
    for k in range(model.block.shape[0]):
        inertial += model.block[k, 3] == INERTER
    return inertial == 0


@kernel
def factor_joints(model, inverse, jac, pull, gram, root, x):  # type: ignore[no-untyped-def]
    """Factors of the joints' matrix at slopes jac (n_joint, 3, 6); inverse: as of `inverse_masses`.

    Out: pull (n_joint, 3, 6) = Phi_q M^-1; gram (n_row, width + 1), the lower factor by rows, the diagonal last, as its
    inverse; root (n_row,), the scales of rows. x: scratch (n_row,). Returns the place (`GeneralModel.place`) of a row
    at which the matrix is singular, or -1.
    """
    joint = model.joint
    row = model.row
    line = model.line
    meet = model.meet
    width = gram.shape[1] - 1
    for j in range(joint.shape[0]):
        a = 3 * joint[j, 1]
        b = 3 * joint[j, 2]
        for r in range(3):
            for i in range(3):
                pull[j, r, i] = jac[j, r, i] * inverse[a + i]
                pull[j, r, 3 + i] = jac[j, r, 3 + i] * inverse[b + i]
    gram[:] = 0.0
    for m in range(meet.shape[0]):
        j = meet[m, 0]
        k = meet[m, 2]
        one = 3 * meet[m, 1]
        other = 3 * meet[m, 3]
        for r in range(3):
            if row[j, r] < 0:
                continue
            for s in range(r + 1 if j == k else 3):
                if row[k, s] < 0:
                    continue
                value = 0.0
                for i in range(3):
                    value += jac[j, r, one + i] * pull[k, s, other + i]
                at = line[row[j, r]]
                to = line[row[k, s]]
                gram[max(at, to), width - abs(at - to)] += value
    for i in range(gram.shape[0]):
        root[i] = 1.0 / np.sqrt(gram[i, width]) if gram[i, width] > 0.0 else 1.0
        for c in range(max(width - i, 0), width + 1):
            gram[i, c] *= root[i] * root[i - width + c]
    at = cholesky(gram)
    if at < 0:
        at = weakest(gram, x)
    if at < 0:
        return -1
    for r in range(line.shape[0]):
        if line[r] == at:
            return model.place[model.mass.shape[0] + r]
    return -1


@kernel
def cholesky(gram):  # type: ignore[no-untyped-def]
    """Factor a banded matrix with a diagonal of ones in place, as `factor_joints` describes; -1, or a singular row."""
    width = gram.shape[1] - 1
    for i in range(gram.shape[0]):
        first = max(0, i - width)
        for j in range(first, i):
            value = gram[i, j - i + width]
            for k in range(first, j):
                value -= gram[i, k - i + width] * gram[j, k - j + width]
            gram[i, j - i + width] = value * gram[j, width]
        value = gram[i, width]
        for k in range(first, i):
            value -= gram[i, k - i + width] ** 2
        if value < SINGULAR:  # not where it is NaN: that is no fault of the joints
            return i
        gram[i, width] = 1.0 / np.sqrt(value)
    return -1


@kernel
def weakest(gram, x):  # type: ignore[no-untyped-def]
    """The row, after those before it, at which an eigenvalue below SINGULAR shows in factors of `cholesky`; else -1.

    With signs e that make x = L^-1 e grow, x . x / n is at most the inverse of the eigenvalue, and hardly less than a
    few times that (the idea of LINPACK's estimate of condition numbers, A. K. Cline et al., 1979).
    """
    width = gram.shape[1] - 1
    size = 0.0
    worst = 0
    for i in range(gram.shape[0]):
        value = 0.0
        for k in range(max(0, i - width), i):
            value -= gram[i, k - i + width] * x[k]
        x[i] = (value + (1.0 if value >= 0.0 else -1.0)) * gram[i, width]
        size += x[i] * x[i]
        if abs(x[i]) > abs(x[worst]):
            worst = i
    return worst if size * SINGULAR > gram.shape[0] else -1


@kernel
def solve_joints(model, inverse, pull, gram, root, x, a, lam):  # type: ignore[no-untyped-def]
    """Solve with the factors for the right side a (n,), lam (n_row,), in place; driven parts become 0. x: (n_row,)."""
    joint = model.joint
    row = model.row
    line = model.line
    width = gram.shape[1] - 1
    count = gram.shape[0]
    for j in range(joint.shape[0]):
        one = 3 * joint[j, 1]
        two = 3 * joint[j, 2]
        for r in range(3):
            if row[j, r] >= 0:
                value = -lam[row[j, r]]
                for i in range(3):
                    value += pull[j, r, i] * a[one + i] + pull[j, r, 3 + i] * a[two + i]
                at = line[row[j, r]]
                x[at] = value * root[at]
    for i in range(count):
        value = x[i]
        for k in range(max(0, i - width), i):
            value -= gram[i, k - i + width] * x[k]
        x[i] = value * gram[i, width]
    for i in range(count - 1, -1, -1):
        x[i] *= gram[i, width]
        for k in range(max(0, i - width), i):
            x[k] -= gram[i, k - i + width] * x[i]
    for d in range(a.shape[0]):
        a[d] *= inverse[d]
    for j in range(joint.shape[0]):
        one = 3 * joint[j, 1]
        two = 3 * joint[j, 2]
        for r in range(3):
            if row[j, r] >= 0:
                at = line[row[j, r]]
                value = x[at] * root[at]
                lam[row[j, r]] = value
                for i in range(3):
                    a[one + i] -= pull[j, r, i] * value
                    a[two + i] -= pull[j, r, 3 + i] * value
