"""The balance with its bodies eliminated first: what is left is a matrix of the joints alone.

    [M  Phi_q^T] [a  ]   [f]        (Phi_q M^-1 Phi_q^T) lam = Phi_q M^-1 f - g
    [Phi_q   0 ] [lam] = [g]        a = M^-1 (f - Phi_q^T lam)

As long as no inerters couple bodies, M is diagonal, and the joints' matrix is symmetric, positive definite where joints
are independent, and has as many rows as these: its factors cost a small part of those of the whole
balance. It couples rows that meet at a body that can move (`GeneralModel.meet`) and is banded in an order of its own
(`GeneralModel.line`). The factors are L D L^T, which scales of rows leave as they are. Seen with rows scaled to a
diagonal of ones, the joints are as good as singular where the smallest eigenvalue, the square of the smallest singular
value of the scaled Phi_q, all but vanishes. A pivot need not show that, as the row that is about to repeat the others
may be one that has little part in it (`weakest`).
"""

import numpy as np

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
def factor_joints(model, inverse, jac, pull, gram, diagonal, thorough, x):  # type: ignore[no-untyped-def]
    """Factors of the joints' matrix at slopes jac (n_joint, 3, 6); inverse: as of `inverse_masses`.

    Out: pull (n_joint, 3, 6) = Phi_q M^-1; gram (n_row, width + 1), L by rows, and last the inverse of D; diagonal
    (n_row,), that of the matrix. thorough: whether `weakest` is asked, too. x: scratch (n_row,). Returns the place
    (`GeneralModel.place`) of a row at which the matrix is singular, or -1.
    """
    joint = model.joint
    row = model.row
    line = model.line
    meet = model.meet
    width = gram.shape[1] - 1
    for j in range(joint.shape[0]):
        a = 3 * joint[j, 1]
        b = 3 * joint[j, 2]
        for r in range(joint[j, 4]):
            for i in range(3):
                pull[j, r, i] = jac[j, r, i] * inverse[a + i]
                pull[j, r, 3 + i] = jac[j, r, 3 + i] * inverse[b + i]
    gram[:] = 0.0
    for m in range(meet.shape[0]):
        j = meet[m, 0]
        k = meet[m, 2]
        one = 3 * meet[m, 1]
        other = 3 * meet[m, 3]
        for r in range(joint[j, 4]):
            if row[j, r] < 0:
                continue
            at = line[row[j, r]]
            x0 = jac[j, r, one]
            x1 = jac[j, r, one + 1]
            x2 = jac[j, r, one + 2]
            for s in range(r + 1 if j == k else joint[k, 4]):
                if row[k, s] < 0:
                    continue
                to = line[row[k, s]]
                value = x0 * pull[k, s, other] + x1 * pull[k, s, other + 1] + x2 * pull[k, s, other + 2]
                gram[max(at, to), width - abs(at - to)] += value
    at = decompose(gram, diagonal)
    if at < 0 and thorough:
        at = weakest(gram, diagonal, x)
    if at < 0:
        return -1
    for r in range(line.shape[0]):
        if line[r] == at:
            return model.place[model.mass.shape[0] + r]
    return -1


@kernel
def decompose(gram, diagonal):  # type: ignore[no-untyped-def]
    """Factor a banded matrix in place, as `factor_joints` describes; -1, or a singular row."""
    width = gram.shape[1] - 1
    for i in range(gram.shape[0]):
        own = gram[i]
        first = max(0, i - width)
        shift = width - i
        for j in range(first + 1, i):  # L D
            other = gram[j]
            value = own[j + shift]
            for k in range(max(first, j - width), j):
                value -= own[k + shift] * other[k - j + width]
            own[j + shift] = value
        whole = own[width]
        diagonal[i] = whole
        value = whole
        for k in range(first, i):
            scaled = own[k + shift] * gram[k, width]
            value -= own[k + shift] * scaled
            own[k + shift] = scaled
        if value <= SINGULAR * whole:  # not where it is NaN: that is no fault of the joints
            return i
        own[width] = 1.0 / value
    return -1


@kernel
def weakest(gram, diagonal, x):  # type: ignore[no-untyped-def]
    """The row, after those before it, at which an eigenvalue below SINGULAR shows in factors of `decompose`; else -1.

    C = R L D^1/2 are Cholesky's factors with rows scaled by R to a diagonal of ones. With signs e that make y = C^-1 e
    grow, y . y / n is at most the inverse of the eigenvalue, and hardly less than a few times that (the idea of
    LINPACK's estimate of condition numbers, A. K. Cline et al., 1979). x = D^1/2 y.
    """
    width = gram.shape[1] - 1
    size = 0.0
    most = 0.0
    worst = 0
    for i in range(gram.shape[0]):
        value = 0.0
        for k in range(max(0, i - width), i):
            value -= gram[i, k - i + width] * x[k]
        whole = np.sqrt(diagonal[i])
        x[i] = value + (whole if value >= 0.0 else -whole)
        square = x[i] * x[i] * gram[i, width]
        size += square
        if square > most:
            most = square
            worst = i
    return worst if size * SINGULAR > gram.shape[0] else -1


@kernel
def solve_joints(model, inverse, pull, gram, x, a, lam):  # type: ignore[no-untyped-def]
    """Solve with the factors for the right side a (n,), lam (n_row,), in place; driven parts become 0. x: (n_row,)."""
    joint = model.joint
    row = model.row
    line = model.line
    width = gram.shape[1] - 1
    count = gram.shape[0]
    for j in range(joint.shape[0]):
        one = 3 * joint[j, 1]
        two = 3 * joint[j, 2]
        for r in range(joint[j, 4]):
            if row[j, r] >= 0:
                first = pull[j, r, 0] * a[one] + pull[j, r, 1] * a[one + 1] + pull[j, r, 2] * a[one + 2]
                second = pull[j, r, 3] * a[two] + pull[j, r, 4] * a[two + 1] + pull[j, r, 5] * a[two + 2]
                x[line[row[j, r]]] = first + second - lam[row[j, r]]
    for i in range(count):
        value = x[i]
        for k in range(max(0, i - width), i):
            value -= gram[i, k - i + width] * x[k]
        x[i] = value
    for i in range(count):
        x[i] *= gram[i, width]
    for i in range(count - 1, -1, -1):
        value = x[i]
        for k in range(max(0, i - width), i):
            x[k] -= gram[i, k - i + width] * value
    for d in range(a.shape[0]):
        a[d] *= inverse[d]
    for j in range(joint.shape[0]):
        one = 3 * joint[j, 1]
        two = 3 * joint[j, 2]
        for r in range(joint[j, 4]):
            if row[j, r] >= 0:
                value = x[line[row[j, r]]]
                lam[row[j, r]] = value
                for i in range(3):
                    a[one + i] -= pull[j, r, i] * value
                    a[two + i] -= pull[j, r, 3 + i] * value
