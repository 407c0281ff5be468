"""Springs in space from every point of one grid to every point of another: `spatial_springs` in fewer operations.

Members lie in rows: those of one row begin at one point P, and those of one column end at one point Q. With c = p - d
of a row, r = a - c, and a change of length sees a - r = c: Delta' = n . (d' + w x c). In a column a stays, so

    b = (n, a x n),   sum w a = W a,   M = a (sum w r - W a)^T,

with w, W, g and M of `spatial_springs`: of a column's members only W, sum w r = sum f n and the six numbers of
G = sum g n n^T are summed, of which the trace, sum g, spares one; and a with what it has changed by since home is found
once. A vector of columns stays at hand over all rows of a tile, which stays in the first-level cache while many poses
pass over it. All is summed in units of the stiffness k, which is not zero.

Where rows are shorter than two vectors or so, a vector has members of several rows; after `period` vectors, when their
members are whole rows, columns come again in the same lanes. Then such a vector of columns stays at hand
(`short_sums`).

Arguments: member (8 M,), the rows of `GeneralModel.member` behind each other, width M of each; start, count: the first
member, and how many there are, without padding; length: members of a row, at least as many as a vector has; r (POSE,):
the relative pose. The last vector of a row begins early enough to end with it, and its lanes that the vector before
has summed count as 0.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.threads import shared, taken
from mdstopo.compiler.vector import (
    inverse_root,
    lanes,
    larger,
    largest,
    load,
    store,
    total,
    unmarked,
    where_larger,
    zero,
)
from mdstopo.mechanics.grid_passes import PLACES
from mdstopo.mechanics.kinematics.spatial_forces import K
from mdstopo.mechanics.kinematics.spatial_poses import D_RATE, D_SINCE, FREEDOMS, S_SINCE, D, S, W
from mdstopo.mechanics.kinematics.spatial_springs import (
    ENERGY,
    EXCESS,
    L0,
    PULL,
    P,
    Q,
    add_coupling,
    add_symmetric,
    add_totals,
)
from mdstopo.mechanics.kinematics.vectors import cross, dot, minus, plus, put, times, turned, vector_at
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.scene.springs_model import MANY

#: rows of a tile, where a grid has so many
ROWS = 32
#: numbers kept of a column at a pose: a, 2 u and u^2, where u is what a + d has changed by since home
SEEN = 7
#: the place of the threads that may share a pass in `GeneralModel.size`
THREADS = 6
#: members times poses from which on threads are worth making
WORTH_THREADS = 200_000


@part
def _rows(x, width, first, i):
    """Three numbers of each column, `width` apart, from column i on."""
    return load(x, first * width + i), load(x, (first + 1) * width + i), load(x, (first + 2) * width + i)


@kernel
def grid_sums(member, width, scale, start, count, length, p, rel, pair, poses, counted, tangent, threads, sums):
    """Add forces, energy and on demand the tangent K, but for what damping does to it, to the sums of a pair at poses.

    In:
      member, width, start, count, length: as above.
      scale (M or more,): alpha^mu of each member.
      p (3 or more,): k, c, preload; k is not zero.
      rel (poses or more, n_pair, POSE): relative poses.
      pair: number of the pair.
      poses: how many of them.
      counted: whether E and E_xi are wanted.
      tangent: whether K is wanted.
      threads: that may share the tiles; no result depends on it.
    Out:
      sums (poses or more, n_pair, SUMS): Q, and on demand E, E_xi and K, added to.
    """
    rows = count // length
    if count < MANY:
        _sum_rows(
            member, width, scale, start, length, p, rel, pair, poses, counted, tangent, np.int64(0), rows,
            _tile(rows, length), sums, pair,
        )  # fmt: skip
        return
    tall, _ = _tile(rows, length)
    parts = np.zeros(((rows + tall - 1) // tall, poses, 1, sums.shape[2]))
    counter = np.zeros(1, np.int64)
    job = (counter, member, width, scale, start, count, length, p, rel, pair, poses, counted, tangent, parts)
    shared(_sum_tiles, threads if count * poses >= WORTH_THREADS else np.int64(1), job)
    for i in range(parts.shape[0]):
        for j in range(poses):
            for s in range(sums.shape[2]):
                sums[j, pair, s] += parts[i, j, 0, s]


@part
def _tile(rows, length):
    """Rows and columns of a tile of a grid with so many rows, each of so many members: high, because what a column
    adds is as much work as some three of its members."""
    tall = rows if rows * length <= PLACES else min(rows, ROWS)
    return tall, min(length, PLACES // tall // lanes() * lanes())


@kernel
def _sum_tiles(counter, member, width, scale, start, count, length, p, rel, pair, poses, counted, tangent, parts):
    """Sum row of tiles after row of tiles, each by itself, until none is left: what each thread does.

    In:
      counter (1,): how many some thread has taken so far; counted on.
      member, width, scale, start, count, length, p, rel, pair, poses, counted, tangent: as of `grid_sums`.
    Out:
      parts (tiles, poses, 1, SUMS): sums of each.
    """
    rows = count // length
    tile = _tile(rows, length)
    i = taken(counter)
    while i < parts.shape[0]:
        _sum_rows(
            member, width, scale, start, length, p, rel, pair, poses, counted, tangent, i * tile[0],
            min((i + 1) * tile[0], rows), tile, parts[i], np.int64(0),
        )  # fmt: skip
        i = taken(counter)


@kernel
def _sum_rows(
    member, width, scale, start, length, p, rel, pair, poses, counted, tangent, first_row, last_row, tile, sums, column
):
    """`grid_sums` of the rows from first_row to before last_row, tile by tile.

    In:
      member, width, scale, start, length, p, rel, pair, poses, counted, tangent: as of `grid_sums`.
      first_row, last_row: numbers of rows.
      tile: of `_tile`.
      column: where in the second axis of sums the pair is.
    Out:
      sums (poses or more, columns, SUMS): added to.
    """
    tall, wide = tile
    room = np.empty((tall, 6))
    for row in range(first_row, last_row, tall):
        own = room[: min(tall, last_row - row)]
        for first in range(0, length, wide):
            last = min(first + wide, length)
            for j in range(poses):
                _sum_tile(
                    member, width, scale, start, row, first, last, length, p, rel[j, pair], counted, tangent, own,
                    sums[j, column],
                )  # fmt: skip


@part
def _begin_rows(member, width, start, row, length, r, moving, room):
    """Find c of rows (m) and on demand d' + w x c (m/s).

    member, width, start, length, r: as above. row: number of the first row.
    moving: whether the second is wanted.
    room (rows, 6): out.
    """
    origin = vector_at(r, D)
    for j in range(room.shape[0]):
        at = start + (row + j) * length
        c = minus((member[P * width + at], member[(P + 1) * width + at], member[(P + 2) * width + at]), origin)
        put(room[j], 0, c)
        if moving:
            put(room[j], 3, plus(vector_at(r, D_RATE), cross(vector_at(r, W), c)))


@part
def _sum_tile(member, width, scale, start, row, first, last, length, p, r, counted, tangent, room, o):
    """`grid_sums` of a tile at one pose.

    In:
      member, width, scale, start, length, p, r, counted, tangent: as of `grid_sums`.
      row: number of the tile's first row.
      first, last: its columns.
    Out:
      o (SUMS,): added to.
      room (rows, 6): scratch.
    """
    elastic_alone = p[1] == 0.0 and p[2] == 0.0
    _begin_rows(member, width, start, row, length, r, not elastic_alone, room)
    damping = p[1] / p[0]
    preload = p[2] / p[0]
    none = zero(), zero(), zero()
    energy = zero()
    force = none, none
    slope = none, none
    stiffness = none, none, (none, none, none), force
    for begin in range(first, last, lanes()):
        i = min(begin, length - lanes())
        done = (1 << (begin - i)) - 1
        q = _rows(member, width, Q, start + i)
        a = turned(r, S, q)
        u = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, q))
        moved = plus(u, u), dot(u, u)
        push = none
        pull = none
        weight = zero()
        trace = zero()
        two = zero(), zero()
        others = none
        at = start + row * length + i
        for j in range(room.shape[0]):
            x = minus(a, vector_at(room[j], 0))
            square = dot(x, x)
            y = inverse_root(square, ZERO_LENGTH_SQUARED)
            stretch = _stretch(moved, x, square, y, load(member, L0 * width + at), load(member, EXCESS * width + at))
            s = where_larger(square, ZERO_LENGTH_SQUARED, unmarked(load(scale, at), done))
            elastic = s * stretch
            w = elastic * y
            if counted:
                energy = energy + elastic * stretch
            if not elastic_alone:
                pull = plus(pull, times(w, x))
                w = w + s * (preload + damping * (y * dot(x, vector_at(room[j], 3)))) * y
            push = plus(push, times(w, x))
            if tangent:
                weight, trace, two, others = _add_slope((weight, trace, two, others), x, y, s, w)
            at += length
        force = plus(force[0], push), plus(force[1], cross(a, push))
        if not elastic_alone:
            slope = plus(slope[0], pull), plus(slope[1], cross(a, pull))
        if tangent:
            diagonal = two[0], two[1], trace - two[0] - two[1]
            stiffness = _add_column(stiffness, a, weight, push, diagonal, others)
    if elastic_alone:
        slope = force
    _add_sums(p[0], energy, force, slope, counted, o)
    if tangent:
        _add_stiffness(stiffness, force[1], p[0], o)


@part
def _add_slope(sums, x, y, s, w):
    """Sums over the members of columns, and those of members more: of w, g, and of G xx, yy and yz, zx, xy.

    sums: so far. x, y: r and 1/L (m, 1/m). s, w: alpha^mu and f/L, 0 without length (1, 1/m).
    """
    weight, trace, two, others = sums
    g = s - w
    along = times(g * (y * y), x)
    return (
        weight + w,
        trace + g,
        (two[0] + along[0] * x[0], two[1] + along[1] * x[1]),
        (others[0] + along[1] * x[2], others[1] + along[2] * x[0], others[2] + along[0] * x[1]),
    )


@kernel
def short_sums(member, width, scale, start, stop, length, p, r, counted, tangent, o):
    """`grid_sums` of undamped springs without preload at one pose, whatever the length of rows.

    In:
      member, width, scale, length: as above.
      start, stop: the members meant in whole vectors, padding included, where scale is 0.
      p (3 or more,): k, which is not zero, and two zeros.
      r (POSE,): the relative pose.
      counted: whether E and E_xi are wanted.
      tangent: whether K is wanted.
    Out:
      o (SUMS,): Q, and on demand E, E_xi and K, added to.
    """
    origin = vector_at(r, D)
    none = zero(), zero(), zero()
    energy = zero()
    force = none, none
    stiffness = none, none, (none, none, none), force
    step = period(length, lanes()) * lanes()
    for first in range(start, min(start + step, stop), lanes()):
        q = _rows(member, width, Q, first)
        a = turned(r, S, q)
        end = plus(a, origin)
        u = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, q))
        moved = plus(u, u), dot(u, u)
        push = none
        weight = zero()
        trace = zero()
        two = zero(), zero()
        others = none
        for at in range(first, stop, step):
            x = minus(end, _rows(member, width, P, at))
            square = dot(x, x)
            y = inverse_root(square, ZERO_LENGTH_SQUARED)
            stretch = _stretch(moved, x, square, y, load(member, L0 * width + at), load(member, EXCESS * width + at))
            s = where_larger(square, ZERO_LENGTH_SQUARED, load(scale, at))
            elastic = s * stretch
            w = elastic * y
            if counted:
                energy = energy + elastic * stretch
            push = plus(push, times(w, x))
            if tangent:
                weight, trace, two, others = _add_slope((weight, trace, two, others), x, y, s, w)
        force = plus(force[0], push), plus(force[1], cross(a, push))
        if tangent:
            diagonal = two[0], two[1], trace - two[0] - two[1]
            stiffness = _add_column(stiffness, a, weight, push, diagonal, others)
    _add_sums(p[0], energy, force, force, counted, o)
    if tangent:
        _add_stiffness(stiffness, force[1], p[0], o)


@part
def _add_sums(k, energy, force, slope, counted, o):
    """Add k times sums over columns to o (SUMS,).

    energy: of the energy. force: of forces and moments; slope: of elastic ones. counted: whether E and E_xi are wanted.
    """
    add_totals(o, 0, force[0], -k)
    add_totals(o, 3, force[1], -k)
    if counted:
        o[ENERGY] += 0.5 * k * total(energy)
        add_totals(o, PULL, slope[0], k)
        add_totals(o, PULL + 3, slope[1], k)


@part
def period(length, count):
    """After how many vectors of `count` members those of whole rows of so many are through."""
    vectors = 1
    left = count  # of the members so far, behind whole rows; by subtraction, for divisions take as long as members do
    while left >= length:
        left -= length
    while left > 0:
        left += count
        while left >= length:
            left -= length
        vectors += 1
    return vectors


@part
def _stretch(moved, x, square, y, free, excess):
    """Delta = L - l0 of members of one row (m), as `spatial_springs` has it.

    moved: 2 u and u^2 of their columns, where u is what a + d has changed by since home (m, m^2).
    x, square, y: r, its square and 1/L (m, m^2, 1/m). free, excess: l0 (m) and L0^2 - l0^2 (m^2).
    """
    long = square * y
    stretch = long - free
    twice = moved[0]
    squares = (((excess - moved[1]) + twice[0] * x[0]) + twice[1] * x[1]) + twice[2] * x[2]
    off = 0.5 * y * (stretch * (long + free) - squares)
    return stretch - where_larger(square, moved[1], off)


@part
def _add_column(sums, a, w, push, diagonal, others):
    """Sums of K with those of columns more: shifts by shifts (xx, yy, zz and yz, zx, xy), by turns, turns by turns.

    Of turns by turns the symmetric part; the rest is half the moment (`_add_stiffness`).

    sums: so far, rows of the third. a: the arms (m). w, push: W (N/m) and sum w r (N).
    diagonal, others: of G (N/m) xx, yy, zz, and yz, zx, xy.
    """
    by_shift, across, by_turn, (turns, turns_across) = sums
    yz, zx, xy = others
    # rows of sum g n (a x n)^T, from which sum g (a x n)(a x n)^T follows
    b0 = cross(a, (diagonal[0], xy, zx))
    b1 = cross(a, (xy, diagonal[1], yz))
    b2 = cross(a, (zx, yz, diagonal[2]))
    h = times(w, a)
    c = minus(h, push)
    trace = dot(a, c)
    half = times(0.5, c)
    return (
        (by_shift[0] + (diagonal[0] + w), by_shift[1] + (diagonal[1] + w), by_shift[2] + (diagonal[2] + w)),
        plus(across, others),
        (
            plus(by_turn[0], (b0[0], b0[1] + h[2], b0[2] - h[1])),
            plus(by_turn[1], (b1[0] - h[2], b1[1], b1[2] + h[0])),
            plus(by_turn[2], (b2[0] + h[1], b2[1] - h[0], b2[2])),
        ),
        (
            (
                turns[0] + (trace - a[0] * c[0] + a[1] * b2[0] - a[2] * b1[0]),
                turns[1] + (trace - a[1] * c[1] + a[2] * b0[1] - a[0] * b2[1]),
                turns[2] + (trace - a[2] * c[2] + a[0] * b1[2] - a[1] * b0[2]),
            ),
            (
                turns_across[0] + (a[2] * b0[2] - a[0] * b2[2] - a[1] * half[2] - a[2] * half[1]),
                turns_across[1] + (a[0] * b1[0] - a[1] * b0[0] - a[2] * half[0] - a[0] * half[2]),
                turns_across[2] + (a[1] * b2[1] - a[2] * b1[1] - a[0] * half[1] - a[1] * half[0]),
            ),
        ),
    )


@part
def _add_stiffness(sums, moment, k, o):
    """Add k times the sums of K, vectors as of `_add_column`, to o (SUMS,).

    moment: sum a x w r of all columns. The antisymmetric part of turns by turns, sum (a (w r)^T - (w r) a^T)/2, is it.
    """
    diagonal, others, by_turn, (turns, turns_across) = sums
    add_symmetric(o, 0, times(k, diagonal), times(k, others))
    add_symmetric(o, 3, times(k, turns), times(k, turns_across))
    for i in range(3):
        add_coupling(o, i, times(k, by_turn[i]))
        half = 0.5 * k * total(moment[i])
        row = (i + 1) % 3
        column = (i + 2) % 3
        o[K + FREEDOMS * (3 + row) + 3 + column] += half
        o[K + FREEDOMS * (3 + column) + 3 + row] -= half


@kernel
def grid_designs(member, width, start, count, length, k, rel, u, pair, threads, out):
    """Add sum_j f (b . u_j) over S poses of each spring, without damping and preload, at alpha^mu = 1.

    In:
      member, width, start, count, length: as above.
      k: stiffness (N/m).
      rel (S, n_pair, POSE): relative poses.
      u (S, n_pair, D): virtual changes of these.
      pair: number of the pair.
      threads: that may share the tiles.
    Out:
      out (M or more,): added to.
    """
    counter = np.zeros(1, np.int64)
    if count < MANY or count * rel.shape[0] < WORTH_THREADS:
        _design_tiles(counter, member, width, start, count, length, k, rel, u, pair, out)
        return
    shared(_design_tiles, threads, (counter, member, width, start, count, length, k, rel, u, pair, out))


@kernel
def _design_tiles(counter, member, width, start, count, length, k, rel, u, pair, out):
    """`grid_designs` of row of tiles after row of tiles, until none is left: what each thread does.

    In:
      counter (1,): how many some thread has taken so far; counted on.
      member, width, start, count, length, k, rel, u, pair: as of `grid_designs`.
    Out:
      out (M or more,): added to.
    """
    rows = count // length
    tall, _ = _tile(rows, length)
    poses = rel.shape[0]
    seen = np.empty((poses, SEEN, lanes()))
    room = np.empty((tall, poses, 6))
    i = taken(counter)
    while i * tall < rows:
        row = i * tall
        own = room[: min(tall, rows - row)]
        _begin_designs(member, width, start, row, length, rel, u, pair, own)
        for begin in range(0, length, lanes()):
            _design_columns(member, width, start, row, begin, length, k, rel, pair, own, seen, out)
        i = taken(counter)


@part
def _begin_designs(member, width, start, row, length, rel, u, pair, room):
    """Find of each row c = p - d, and u + u_theta x c, from which the work of a virtual change u follows (m).

    member, width, start, length, rel, u, pair: as of `grid_designs`. row: number of the first row.
    room (rows, S, 6): out.
    """
    for j in range(room.shape[0]):
        at = start + (row + j) * length
        p = member[P * width + at], member[(P + 1) * width + at], member[(P + 2) * width + at]
        for m in range(room.shape[1]):
            c = minus(p, vector_at(rel[m, pair], D))
            put(room[j, m], 0, c)
            put(room[j, m], 3, plus(vector_at(u[m, pair], 0), cross(vector_at(u[m, pair], 3), c)))


@part
def _design_columns(member, width, start, row, begin, length, k, rel, pair, room, seen, out):
    """`grid_designs` of a vector of columns of a tile.

    In:
      member, width, start, length, k, rel, pair: as of `grid_designs`.
      row: number of the tile's first row.
      begin: the first column.
      room (rows, S, 6): of `_begin_designs`.
    Out:
      out (M or more,): added to.
      seen (S, SEEN, lanes): scratch: a, 2 u and u^2 of the columns at the poses.
    """
    i = min(begin, length - lanes())
    done = (1 << (begin - i)) - 1
    q = _rows(member, width, Q, start + i)
    for m in range(seen.shape[0]):
        r = rel[m, pair]
        a = turned(r, S, q)
        moved = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, q))
        twice = plus(moved, moved)
        own = seen[m]
        for c in range(3):
            store(own[c], 0, a[c])
            store(own[3 + c], 0, twice[c])
        store(own[6], 0, dot(moved, moved))
    at = start + row * length + i
    for j in range(room.shape[0]):
        free = load(member, L0 * width + at)
        excess = load(member, EXCESS * width + at)
        work = zero()
        for m in range(seen.shape[0]):
            own = seen[m]
            x = minus((load(own[0], 0), load(own[1], 0), load(own[2], 0)), vector_at(room[j, m], 0))
            moved = (load(own[3], 0), load(own[4], 0), load(own[5], 0)), load(own[6], 0)
            square = dot(x, x)
            y = inverse_root(square, ZERO_LENGTH_SQUARED)
            stretch = _stretch(moved, x, square, y, free, excess)
            work = work + stretch * y * dot(x, vector_at(room[j, m], 3))
        store(out, at, load(out, at) + k * unmarked(work, done))
        at += length


@kernel
def short_designs(member, width, start, stop, length, k, rel, u, pair, out):
    """`grid_designs` whatever the length of rows.

    In:
      member, width, length, k, rel, u, pair: as of `grid_designs`.
      start, stop: the members meant in whole vectors; padding becomes something that nobody reads.
    Out:
      out (M or more,): added to.
    """
    step = period(length, lanes()) * lanes()
    for first in range(start, min(start + step, stop), lanes()):
        q = _rows(member, width, Q, first)
        for m in range(rel.shape[0]):
            r = rel[m, pair]
            a = turned(r, S, q)
            end = plus(a, vector_at(r, D))
            since = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, q))
            moved = plus(since, since), dot(since, since)
            change = plus(vector_at(u[m, pair], 0), cross(vector_at(u[m, pair], 3), a))
            for at in range(first, stop, step):
                x = minus(end, _rows(member, width, P, at))
                square = dot(x, x)
                y = inverse_root(square, ZERO_LENGTH_SQUARED)
                free = load(member, L0 * width + at)
                stretch = _stretch(moved, x, square, y, free, load(member, EXCESS * width + at))
                store(out, at, load(out, at) + (k * stretch) * (y * dot(x, change)))


@kernel
def grid_far(member, width, start, count, length, before, after):
    """`spatial_springs.far` of a grid: an end moves against the other as all those of its column do.

    member, width, start, count, length: as above. before, after (POSE,): the relative poses.
    """
    rows = count // length
    room = np.empty((rows, 6))
    _begin_rows(member, width, start, np.int64(0), length, before, np.bool_(False), room)
    shift = minus(vector_at(after, D), vector_at(before, D))
    near = zero() - np.inf
    for begin in range(0, length, lanes()):
        q = _rows(member, width, Q, start + min(begin, length - lanes()))
        a = turned(before, S, q)
        moved = plus(minus(turned(after, S, q), a), shift)
        most = 1.001 * dot(moved, moved)
        for j in range(rows):
            x = minus(a, vector_at(room[j], 0))
            near = larger(most - dot(x, x), near)
    return largest(near) < -ZERO_LENGTH_SQUARED
