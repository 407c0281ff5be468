"""The balance with its bodies eliminated first: what is left is a matrix of the joints alone.

    [M  Phi_q^T] [a  ]   [f]        (Phi_q M^-1 Phi_q^T) lam = Phi_q M^-1 f - g
    [Phi_q   0 ] [lam] = [g]        a = M^-1 (f - Phi_q^T lam)

As long as no inerters couple bodies, M is diagonal, and the joints' matrix is symmetric, positive definite where joints
are independent, and has as many rows as these: its factors cost a small part of those of the whole balance. It is the
Schur complement of M, and couples rows that meet at a body that can move (`GeneralModel.schur_product`). In an order of
its own (`GeneralModel.row_layout`) each row begins late (`GeneralModel.skyline`): before its first entry its factors
have none. A closed loop in its natural order has short rows, and long ones where it closes.

The factors are L D L^T, which scales of rows leave as they are. Seen with rows scaled to a diagonal of ones, the joints
are as good as singular where the smallest eigenvalue, the square of the smallest singular value of the scaled Phi_q,
all but vanishes. A pivot need not show that, as the row that is about to repeat the others may be one that has little
part in it (`weakest`).
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.model.strides import pair_freedoms, place_in_joint
from mdstopo.mechanics.kinematics.kinematics_interface import freedoms, most_rows

#: a pivot, or an eigenvalue, of a scaled matrix below this means that joints contradict or repeat each other here
SINGULAR = 1e-12


@kernel
def set_inverse_masses(model, inverse):
    """inverse (n,) = 1 over the mass (kg) or inertia (kg m^2) of each coordinate; 0, as it was before, where it is
    driven: no force moves it."""
    for d in range(inverse.shape[0]):
        if model.free[d] != 0:
            inverse[d] = 1.0 / model.mass[d]


@kernel
def spread_masses(model, inverse, spread):
    """spread (n_joint, rows, 2 D) = inverse masses (n,) of the coordinate that each slope of the joints is one by."""
    for j in range(spread.shape[0]):
        for r in range(most_rows(model)):
            for i in range(pair_freedoms(model)):
                spread[j, r, i] = inverse[place_in_joint(model, j, i)]


@kernel
def factor_joints(model, spread, jac, pull, gram, diagonal, thorough, x):
    """Factorise the joints' matrix Phi_q M^-1 Phi_q^T for given slopes Phi_q.

    Constant:
      model: the compiled scene.
      spread (n_joint, rows, 2 D): inverse mass of the coordinate of each slope (`spread_masses`).
    In:
      jac (n_joint, rows, 2 D): slopes Phi_q of the joints' rows by the coordinates of their two bodies.
      thorough: whether the factors are searched for a small eigenvalue, too (`weakest`).
    Out:
      pull (n_joint, rows, 2 D): Phi_q M^-1.
      gram (size[3],): L by rows, each from its first entry on; what stands on the diagonal is not used.
      diagonal (2, n_row): the diagonal of the matrix, and the inverse of D.
      x (n_row,): scratch.

    Returns the place (`GeneralModel.unknown_index`) of a row at which the matrix is singular, or -1.
    """
    line = model.row_layout
    product = model.schur_product
    envelope = model.skyline
    slope = jac.reshape(jac.size)
    weighed = pull.reshape(pull.size)
    whole = spread.reshape(spread.size)
    for r in range(line.shape[0]):  # joints have room for more rows than most have
        for e in range(line[r, 0], line[r, 0] + pull.shape[2]):
            weighed[e] = slope[e] * whole[e]
    constant = model.schur_constant
    for e in range(gram.shape[0]):
        gram[e] = constant[e]
    for m in range(product.shape[0]):
        entry = product[m, 0]
        one = product[m, 1]
        two = product[m, 2]
        value = gram[entry]
        if product[m, 3] == 3:  # as turns in space have components: a loop would take as long as what is in it
            value += slope[one] * weighed[two]
            value += slope[one + 1] * weighed[two + 1]
            value += slope[one + 2] * weighed[two + 2]
        else:
            for c in range(product[m, 3]):
                value += slope[one + c] * weighed[two + c]
        gram[entry] = value
    at = decompose(envelope, gram, diagonal)
    if at < 0 and thorough:
        at = weakest(envelope, gram, diagonal, x)
    if at < 0:
        return -1
    for r in range(line.shape[0]):
        if line[r, 3] == at:
            return model.unknown_index[model.mass.shape[0] + r]
    return -1


@kernel
def decompose(envelope, gram, diagonal):
    """Factorise a matrix into L D L^T in place; arguments of these names are described at `factor_joints`.

    Returns the place of a row at which the matrix is singular, or -1.
    """
    i = 0
    while i < envelope.shape[0]:
        together = rows_together(envelope, i)
        if together == 3:
            at = _decompose_three(envelope, gram, diagonal, i)
        elif together == 2:
            at = _decompose_two(envelope, gram, diagonal, i)
        else:
            at = _decompose_one(envelope, gram, diagonal, i)
        if at >= 0:
            return at
        i += together
    return -1


@part
def rows_together(envelope, i):
    """How many rows from row i on, three at most, have stored parts that begin at the same column, as those of one
    joint do.

    These are factorised at once, which is faster: the products of one do not wait for those of the others.
    """
    count = envelope.shape[0]
    if i + 1 >= count or envelope[i + 1, 0] != envelope[i, 0]:
        return 1
    return 3 if i + 2 < count and envelope[i + 2, 0] == envelope[i, 0] else 2


@part
def _decompose_one(envelope, gram, diagonal, i):
    """Row i of `decompose`. Returns i where the matrix is singular there, else -1."""
    inverse = diagonal[1]
    first = envelope[i, 0]
    own = envelope[i, 1]
    for j in range(first + 1, i):  # L D
        other = envelope[j, 1]
        value = gram[own + j]
        for k in range(max(first, envelope[j, 0]), j):
            value -= gram[own + k] * gram[other + k]
        gram[own + j] = value
    whole = gram[own + i]
    value = whole
    for k in range(first, i):
        scaled = gram[own + k] * inverse[k]
        value -= gram[own + k] * scaled
        gram[own + k] = scaled
    diagonal[0, i] = whole
    if value <= SINGULAR * whole:  # not where it is NaN: that is no fault of the joints
        return i
    inverse[i] = 1.0 / value
    return -1


@part
def _decompose_two(envelope, gram, diagonal, i):
    """Rows i and i + 1 of `decompose`. Returns the one at which the matrix is singular, or -1."""
    inverse = diagonal[1]
    first = envelope[i, 0]
    own = envelope[i, 1]
    following = envelope[i + 1, 1]
    for j in range(first + 1, i):
        other = envelope[j, 1]
        value = gram[own + j]
        second = gram[following + j]
        for k in range(max(first, envelope[j, 0]), j):
            factor = gram[other + k]
            value -= gram[own + k] * factor
            second -= gram[following + k] * factor
        gram[own + j] = value
        gram[following + j] = second
    whole = gram[own + i]
    whole_second = gram[following + i + 1]
    value = whole
    both = gram[following + i]
    second = whole_second
    for k in range(first, i):
        scaled = gram[own + k] * inverse[k]
        scaled_second = gram[following + k] * inverse[k]
        value -= gram[own + k] * scaled
        both -= gram[following + k] * scaled
        second -= gram[following + k] * scaled_second
        gram[own + k] = scaled
        gram[following + k] = scaled_second
    diagonal[0, i] = whole
    diagonal[0, i + 1] = whole_second
    if value <= SINGULAR * whole:
        return i
    inverse[i] = 1.0 / value
    scaled = both * inverse[i]
    gram[following + i] = scaled
    second -= both * scaled
    if second <= SINGULAR * whole_second:
        return i + 1
    inverse[i + 1] = 1.0 / second
    return -1


@part
def _decompose_three(envelope, gram, diagonal, i):
    """Rows i, i + 1 and i + 2 of `decompose`. Returns the one at which the matrix is singular, or -1."""
    inverse = diagonal[1]
    first = envelope[i, 0]
    one = envelope[i, 1]
    two = envelope[i + 1, 1]
    three = envelope[i + 2, 1]
    for j in range(first + 1, i):
        other = envelope[j, 1]
        value = gram[one + j]
        second = gram[two + j]
        third = gram[three + j]
        for k in range(max(first, envelope[j, 0]), j):
            factor = gram[other + k]
            value -= gram[one + k] * factor
            second -= gram[two + k] * factor
            third -= gram[three + k] * factor
        gram[one + j] = value
        gram[two + j] = second
        gram[three + j] = third
    whole = gram[one + i]
    whole_second = gram[two + i + 1]
    whole_third = gram[three + i + 2]
    value = whole
    by_first = gram[two + i]
    second = whole_second
    third_by_first = gram[three + i]
    third_by_second = gram[three + i + 1]
    third = whole_third
    for k in range(first, i):
        scaled = gram[one + k] * inverse[k]
        scaled_second = gram[two + k] * inverse[k]
        scaled_third = gram[three + k] * inverse[k]
        value -= gram[one + k] * scaled
        by_first -= gram[two + k] * scaled
        second -= gram[two + k] * scaled_second
        third_by_first -= gram[three + k] * scaled
        third_by_second -= gram[three + k] * scaled_second
        third -= gram[three + k] * scaled_third
        gram[one + k] = scaled
        gram[two + k] = scaled_second
        gram[three + k] = scaled_third
    diagonal[0, i] = whole
    diagonal[0, i + 1] = whole_second
    diagonal[0, i + 2] = whole_third
    if value <= SINGULAR * whole:
        return i
    inverse[i] = 1.0 / value
    scaled = by_first * inverse[i]
    gram[two + i] = scaled
    second -= by_first * scaled
    if second <= SINGULAR * whole_second:
        return i + 1
    inverse[i + 1] = 1.0 / second
    third_by_second -= third_by_first * scaled
    scaled = third_by_first * inverse[i]
    scaled_second = third_by_second * inverse[i + 1]
    gram[three + i] = scaled
    gram[three + i + 1] = scaled_second
    third -= third_by_first * scaled
    third -= third_by_second * scaled_second
    if third <= SINGULAR * whole_third:
        return i + 2
    inverse[i + 2] = 1.0 / third
    return -1


@kernel
def growth(envelope, gram, diagonal, x):
    """A sum of squares that is large where the smallest eigenvalue is small, and the row that has the largest part
    in it.

    envelope, gram and diagonal are the factors by `decompose`; x (n_row,) is scratch.

    C = R L D^1/2 are Cholesky's factors with rows scaled by R to a diagonal of ones. With signs e that make y = C^-1 e
    grow, y . y / n is at most the inverse of the eigenvalue, and hardly less than a few times that (the idea of
    LINPACK's estimate of condition numbers, A. K. Cline et al., 1979). x = D^1/2 y.
    """
    size = 0.0
    most = 0.0
    worst = 0
    for i in range(envelope.shape[0]):
        own = envelope[i, 1]
        value = 0.0
        for k in range(envelope[i, 0], i):
            value -= gram[own + k] * x[k]
        whole = np.sqrt(diagonal[0, i])
        x[i] = value + (whole if value >= 0.0 else -whole)
        square = x[i] * x[i] * diagonal[1, i]
        size += square
        if square > most:
            most = square
            worst = i
    return size, worst


@kernel
def weakest(envelope, gram, diagonal, x):
    """The row with the largest part in an eigenvalue below SINGULAR, or -1 where the factors show none.

    envelope, gram and diagonal are the factors by `decompose`; x (n_row,) is scratch.
    """
    size, worst = growth(envelope, gram, diagonal, x)
    return worst if size * SINGULAR > envelope.shape[0] else -1


@kernel
def solve_joints(model, inverse, pull, gram, diagonal, x, a, lam):
    """Solve M a + Phi_q^T lam = f, Phi_q a = g with the factors of the joints' matrix.

    Constant:
      model: the compiled scene.
      inverse (n,): inverse masses, 0 of driven coordinates (`inverse_masses`).
    In:
      pull (n_joint, rows, 2 D), gram (size[3],), diagonal (2, n_row): the factors, as `factor_joints` leaves them.
    In place:
      a (n,): f (N, N m), then the accelerations; 0 where they are driven.
      lam (n_row,): g, then the multipliers.
      x (n_row,): scratch.
    """
    line = model.row_layout
    weighed = pull.reshape(pull.size)
    count = line.shape[0]
    each = freedoms(model)
    for r in range(count):
        e = line[r, 0]
        one = line[r, 1]
        two = line[r, 2]
        first = 0.0
        second = 0.0
        for i in range(each):
            first += weighed[e + i] * a[one + i]
            second += weighed[e + each + i] * a[two + i]
        x[line[r, 3]] = first + second - lam[r]
    substitute(model.skyline, gram, diagonal, x)
    for d in range(a.shape[0]):
        a[d] *= inverse[d]
    for r in range(count):
        lam[r] = x[line[r, 3]]
    r = 0
    while r < count:  # three rows of the same bodies at once, as most joints have
        e = line[r, 0]
        one = line[r, 1]
        two = line[r, 2]
        value = lam[r]
        if r + 2 < count and line[r + 2, 0] == e + 4 * each and line[r + 2, 1] == one and line[r + 2, 2] == two:
            second = lam[r + 1]
            third = lam[r + 2]
            f = e + 2 * each
            g = f + 2 * each
            for i in range(each):
                a[one + i] = a[one + i] - weighed[e + i] * value - weighed[f + i] * second - weighed[g + i] * third
            for i in range(each, 2 * each):
                d = two + i - each
                a[d] = a[d] - weighed[e + i] * value - weighed[f + i] * second - weighed[g + i] * third
            r += 3
            continue
        for i in range(each):
            a[one + i] -= weighed[e + i] * value
            a[two + i] -= weighed[e + each + i] * value
        r += 1


@kernel
def substitute(envelope, gram, diagonal, x):
    """Solve with the factors of `decompose` for the right side x (n_row,), in place."""
    count = envelope.shape[0]
    i = 0
    while i < count:
        together = rows_together(envelope, i)
        one = envelope[i, 1]
        two = envelope[i + 1, 1] if together > 1 else one
        three = envelope[i + 2, 1] if together > 2 else two
        value = x[i]
        second = x[i + 1] if together > 1 else 0.0
        third = x[i + 2] if together > 2 else 0.0
        for k in range(envelope[i, 0], i):
            value -= gram[one + k] * x[k]
            second -= gram[two + k] * x[k]
            third -= gram[three + k] * x[k]
        x[i] = value
        if together > 1:
            second -= gram[two + i] * value
            x[i + 1] = second
        if together > 2:
            x[i + 2] = third - gram[three + i] * value - gram[three + i + 1] * second
        i += together
    for i in range(count):
        x[i] *= diagonal[1, i]
    i = count
    while i > 0:
        i = _substitute_back(envelope, gram, x, i)


@part
def _substitute_back(envelope, gram, x, end):
    """The last part of `substitute` for rows before `end` that begin at one column. Returns the first of these.

    Of more than three such rows the last two are taken. So sums have the order that they have where rows are taken by
    twos, and results keep their bits.
    """
    same = 1
    while same < 4 and same < end and envelope[end - 1 - same, 0] == envelope[end - 1, 0]:
        same += 1
    together = same if same < 4 else 2
    i = end - together
    one = envelope[i, 1]
    value = x[i]
    if together == 3:
        two = envelope[i + 1, 1]
        three = envelope[i + 2, 1]
        third = x[i + 2]
        second = x[i + 1] - gram[three + i + 1] * third
        value -= gram[two + i] * second + gram[three + i] * third
        x[i] = value
        x[i + 1] = second
        for k in range(envelope[i, 0], i):
            x[k] = (x[k] - (gram[two + k] * second + gram[three + k] * third)) - gram[one + k] * value
        return i
    two = one
    second = 0.0
    if together == 2:
        two = envelope[i + 1, 1]
        second = x[i + 1]
        value -= gram[two + i] * second
        x[i] = value
    for k in range(envelope[i, 0], i):
        x[k] -= gram[one + k] * value + gram[two + k] * second
    return i
