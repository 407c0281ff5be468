"""Springs in space from every point of one grid to every point of another: `spatial_springs` in fewer operations.

Members lie in rows: those of one row begin at one point P, and those of one column end at one point Q. With c = p - d
of a row, r = a - c; a force along r has the lever a x n = c x n, and a change of length sees a - r = c as well:

    Delta' = n . (d' + w x c),   b = (n, c x n),   sum w a = sum w r + W c,   M = (sum w a) (-c)^T,

with w, W, g and M of `spatial_springs`. So of a row's members only W, sum w r = sum f n, and the six numbers of
G = sum g n n^T are summed; and a with what it has changed by since home is found once for each column.

Arguments: member (8 M,), the rows of `GeneralModel.member` behind each other, width M of each; start, count: the first
member, and how many there are, without padding; length: members of a row, at least as many as a vector has; r (POSE,):
the relative pose. The last vector of a row begins early enough to end with it, and its lanes that the vector before
has summed count as 0.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import inverse_root, lanes, load, store, total, unmarked, where_larger, zero
from mdstopo.mechanics.kinematics.spatial_forces import K
from mdstopo.mechanics.kinematics.spatial_poses import D_RATE, D_SINCE, FREEDOMS, S_SINCE, D, S, W
from mdstopo.mechanics.kinematics.spatial_springs import ENERGY, EXCESS, L0, PULL, P, Q
from mdstopo.mechanics.kinematics.vectors import add, cross, dot, minus, plus, times, turned, vector_at
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED

#: numbers kept of a column at a pose: a, 2 u and u^2, where u is what a + d has changed by since home
SEEN = 7


@part
def _vectors_of(length):
    """How many vectors a row has."""
    return (length + lanes() - 1) // lanes()


@part
def _place(v, length):
    """The first column of vector v of a row, and a bit for each of its lanes that belongs to the vector before."""
    first = v * lanes()
    at = min(first, length - lanes())
    return at, (1 << (first - at)) - 1


@part
def _rows(x, width, first, i):
    """Three numbers of each column, `width` apart, from column i on."""
    return load(x, first * width + i), load(x, (first + 1) * width + i), load(x, (first + 2) * width + i)


@kernel
def begin_columns(member, width, start, length, r, room):
    """Find a, 2 u and u^2 of each column at a pose.

    In:
      member, width, start, length, r: as above.
    Out:
      room (SEEN length,): what is found, one after the other.
    """
    for v in range(_vectors_of(length)):
        i, _ = _place(v, length)
        q = _rows(member, width, Q, start + i)
        a = turned(r, S, q)
        u = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, q))
        twice = plus(u, u)
        store(room, i, a[0])
        store(room, length + i, a[1])
        store(room, 2 * length + i, a[2])
        store(room, 3 * length + i, twice[0])
        store(room, 4 * length + i, twice[1])
        store(room, 5 * length + i, twice[2])
        store(room, 6 * length + i, dot(u, u))


@part
def _seen(room, length, i, c):
    """r, L^2 and 1/L of the members of a row from column i on."""
    x = minus(_rows(room, length, 0, i), c)
    square = dot(x, x)
    return x, square, inverse_root(square, ZERO_LENGTH_SQUARED)


@part
def _stretch(room, length, i, x, square, y, free, excess):
    """Delta = L - l0 of these members (m), as `spatial_springs` has it.

    room (SEEN length,), length, i: of `begin_columns`, the members of a row, and the column from which on.
    x, square, y: r, its square and 1/L (m, m^2, 1/m). free, excess: l0 (m) and L0^2 - l0^2 (m^2).
    """
    moved = load(room, 6 * length + i)
    stretch = square * y - free
    squares = (excess - moved) + dot(_rows(room, length, 3, i), x)
    off = 0.5 * y * (stretch * (square * y + free) - squares)
    return stretch - where_larger(square - moved, 0.0, off)


@kernel
def grid_sums(member, width, scale, start, count, length, p, r, counted, tangent, o):
    """Add forces, energy and on demand the tangent K, but for what damping does to it, to the sums of the pair.

    In:
      member, width, start, count, length, r: as above.
      scale (M or more,): alpha^mu of each member.
      p (3 or more,): k, c, preload.
      counted: whether E and E_xi are wanted.
      tangent: whether K is wanted.
    Out:
      o (SUMS,): Q, and on demand E, E_xi and K, added to.
    """
    room = np.empty(SEEN * length)
    begin_columns(member, width, start, length, r, room)
    elastic_alone = p[1] == 0.0 and p[2] == 0.0
    energy = zero()
    for row in range(start, start + count, length):
        p_row = member[P * width + row], member[(P + 1) * width + row], member[(P + 2) * width + row]
        c = minus(p_row, vector_at(r, D))
        speed = plus(vector_at(r, D_RATE), cross(vector_at(r, W), c))
        push = zero(), zero(), zero()
        pull = zero(), zero(), zero()
        weight = zero()
        diagonal = zero(), zero(), zero()
        others = zero(), zero(), zero()
        for v in range(_vectors_of(length)):
            i, done = _place(v, length)
            at = row + i
            x, square, y = _seen(room, length, i, c)
            stretch = _stretch(
                room, length, i, x, square, y, load(member, L0 * width + at), load(member, EXCESS * width + at)
            )
            s = unmarked(load(scale, at), done)
            elastic = p[0] * s * stretch
            force = elastic
            if not elastic_alone:
                force = elastic + s * (p[2] + p[1] * (y * dot(x, speed)))
                pull = plus(pull, times(elastic * y, x))
            w = force * y
            push = plus(push, times(w, x))
            energy = energy + where_larger(square, ZERO_LENGTH_SQUARED, elastic * stretch)
            if tangent:
                weight = weight + w
                n = times(y, x)
                g = times(p[0] * s - w, n)
                diagonal = diagonal[0] + g[0] * n[0], diagonal[1] + g[1] * n[1], diagonal[2] + g[2] * n[2]
                others = others[0] + g[1] * n[2], others[1] + g[2] * n[0], others[2] + g[0] * n[1]
        own = _total(push)
        add(o, 0, times(-1.0, own))
        add(o, 3, cross(own, c))
        if counted:
            elastic_own = own if elastic_alone else _total(pull)
            add(o, PULL, elastic_own)
            add(o, PULL + 3, cross(c, elastic_own))
        if tangent:
            _add_row(c, total(weight), own, _total(diagonal), _total(others), o)
    if counted:
        o[ENERGY] += 0.5 * total(energy)


@part
def _total(x):
    """The sums over the lanes of three vectors."""
    return total(x[0]), total(x[1]), total(x[2])


@part
def _add_row(c, w, push, diagonal, others, o):
    """Add K of a row to the sums of the pair.

    In:
      c: p - d (m).
      w, push: W (N/m) and sum w r (N).
      diagonal, others: of G (N/m) xx, yy, zz, and yz, zx, xy.
    Out:
      o (SUMS,): K added to.
    """
    xx, yy, zz = diagonal
    yz, zx, xy = others
    g0 = xx, xy, zx
    g1 = xy, yy, yz
    g2 = zx, yz, zz
    # rows of sum g n (c x n)^T, then of sum g (c x n)(c x n)^T
    b0 = cross(c, g0)
    b1 = cross(c, g1)
    b2 = cross(c, g2)
    t0 = minus(times(c[1], b2), times(c[2], b1))
    t1 = minus(times(c[2], b0), times(c[0], b2))
    t2 = minus(times(c[0], b1), times(c[1], b0))
    a = plus(push, times(w, c))
    trace = dot(a, c)
    _add_halves(o, 0, (g0[0] + w, g0[1], g0[2]), (b0[0], b0[1] + a[2], b0[2] - a[1]))
    _add_halves(o, 1, (g1[0], g1[1] + w, g1[2]), (b1[0] - a[2], b1[1], b1[2] + a[0]))
    _add_halves(o, 2, (g2[0], g2[1], g2[2] + w), (b2[0] + a[1], b2[1] - a[0], b2[2]))
    m0 = minus(t0, times(a[0], c))
    m1 = minus(t1, times(a[1], c))
    m2 = minus(t2, times(a[2], c))
    _add_halves(o, 3, (b0[0], b1[0] - a[2], b2[0] + a[1]), (m0[0] + trace, m0[1], m0[2]))
    _add_halves(o, 4, (b0[1] + a[2], b1[1], b2[1] - a[0]), (m1[0], m1[1] + trace, m1[2]))
    _add_halves(o, 5, (b0[2] - a[1], b1[2] + a[0], b2[2]), (m2[0], m2[1], m2[2] + trace))


@part
def _add_halves(o, i, by_shift, by_turn):
    """Add row i of K: its slopes by shifts and by turns."""
    add(o, K + FREEDOMS * i, by_shift)
    add(o, K + FREEDOMS * i + 3, by_turn)


@kernel
def grid_designs(member, width, start, count, length, k, rel, u, pair, out):
    """Add sum_j f (b . u_j) over S poses of each spring, without damping and preload, at alpha^mu = 1.

    In:
      member, width, start, count, length: as above.
      k: stiffness (N/m).
      rel (S, n_pair, POSE): relative poses.
      u (S, n_pair, D): virtual changes of these.
      pair: number of the pair.
    Out:
      out (M or more,): added to.
    """
    poses = rel.shape[0]
    room = np.empty((poses, SEEN * length))
    fixed = np.empty((poses, 6))  # c, and the change of d + a that the change of a pose makes along r
    for j in range(poses):
        begin_columns(member, width, start, length, rel[j, pair], room[j])
    for row in range(start, start + count, length):
        p = member[P * width + row], member[(P + 1) * width + row], member[(P + 2) * width + row]
        for j in range(poses):
            c = minus(p, vector_at(rel[j, pair], D))
            move = plus(vector_at(u[j, pair], 0), cross(vector_at(u[j, pair], 3), c))
            fixed[j, 0] = c[0]
            fixed[j, 1] = c[1]
            fixed[j, 2] = c[2]
            fixed[j, 3] = move[0]
            fixed[j, 4] = move[1]
            fixed[j, 5] = move[2]
        for v in range(_vectors_of(length)):
            i, done = _place(v, length)
            free = load(member, L0 * width + row + i)
            excess = load(member, EXCESS * width + row + i)
            work = zero()
            for j in range(poses):
                x, square, y = _seen(room[j], length, i, vector_at(fixed[j], 0))
                stretch = _stretch(room[j], length, i, x, square, y, free, excess)
                work = work + stretch * y * dot(x, vector_at(fixed[j], 3))
            store(out, row + i, load(out, row + i) + k * unmarked(work, done))
