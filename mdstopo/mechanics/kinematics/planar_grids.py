"""Springs in a plane from every point of one grid to every point of another: `laws.alike` in fewer operations.

Members lie in rows, as in `spatial_grids`, and what a column adds is that of `laws.spring_grid`, here with damping and
preload, too: with e = d - p of a row and r = a + e, a change of length sees a - r = -e of the arm, so that
Delta' = n . (d' + theta' (e_y, -e_x)). All is summed in units of the stiffness k, which is not zero. The last vector of
a row begins early enough to end with it, and its lanes that the vector before has summed count as 0.

Where bodies have moved so far from home that displacements are no more accurate than lengths, elongations are
differences of lengths (`spring.by_displacements`).

Arguments: member (6 M,), the rows of `GeneralModel.member` behind each other, width M of each; start, count: the first
member, and how many there are, without padding; length: members of a row, at least as many as a vector has; r (POSE,):
the relative pose.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, load, store, total, unmarked, where_larger, zero
from mdstopo.mechanics.grid_passes import PLACES
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED, by_displacements
from mdstopo.mechanics.laws.spring_grid import (
    add_column,
    add_member,
    force_and_tangent,
    moved_at,
    moved_columns,
    no_columns,
    no_members,
    seen_at,
    seen_in_row,
    turned_columns,
)
from mdstopo.mechanics.laws.sums import add_forces, add_tangent
from mdstopo.scene.springs_model import EXCESS, L0, PX, PY, QX, QY

#: rows of a tile, where a grid has so many
ROWS = 32


@kernel
def grid_sums(member, width, scale, start, count, length, p, rel, pair, poses, counted, tangent, sums):
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
    Out:
      sums (poses or more, n_pair, SUMS): Q, and on demand E, E_xi and K, added to.
    """
    rows = count // length
    tall = _tall(rows, count)
    wide = min(length, PLACES // tall // lanes() * lanes())
    room = np.empty((tall, 4))
    for row in range(0, rows, tall):
        own = room[: min(tall, rows - row)]
        for first in range(0, length, wide):
            last = min(first + wide, length)
            for j in range(poses):
                _sum_tile(
                    member, width, scale, start + row * length, first, last, length, p, rel[j, pair], counted, tangent,
                    own, sums[j, pair],
                )  # fmt: skip


@part
def _tall(rows, count):
    """Rows of a tile of a grid with so many rows and members."""
    return rows if count <= PLACES else min(rows, ROWS)


@part
def _begin_rows(member, width, at, length, r, room):
    """Find e = d - p of rows (m), and d' + theta' x (-e) (m/s).

    member, width, length, r: as above. at: the first member of the first row.
    room (rows, 4): out.
    """
    for j in range(room.shape[0]):
        ex = r[0] - member[PX * width + at + j * length]
        ey = r[1] - member[PY * width + at + j * length]
        room[j, 0] = ex
        room[j, 1] = ey
        room[j, 2] = r[4] + r[6] * ey
        room[j, 3] = r[5] - r[6] * ex


@part
def _sum_tile(member, width, scale, start, first, last, length, p, r, counted, tangent, room, o):
    """`grid_sums` of a tile at one pose; the next row's lengths are found while a row is summed (`spring_grid`).

    In:
      member, width, scale, length, p, r, counted, tangent: as of `grid_sums`.
      start: the first member of the tile's first row, at the row's first column.
      first, last: the tile's columns.
    Out:
      o (SUMS,): added to.
      room (rows, 4): scratch.
    """
    elastic_alone = p[1] == 0.0 and p[2] == 0.0
    close = by_displacements(r, p)
    _begin_rows(member, width, start, length, r, room)
    damping = p[1] / p[0]
    preload = p[2] / p[0]
    nothing = zero()
    nothing_moved = nothing, nothing, nothing
    sums = no_columns()
    energy = nothing
    pulls = nothing, nothing, nothing
    qx = member[QX * width + start : QX * width + start + length]
    qy = member[QY * width + start : QY * width + start + length]
    for begin in range(first, last, lanes()):
        i = min(begin, length - lanes())
        done = (1 << (begin - i)) - 1
        ax, ay = turned_columns(qx, qy, i, r[2], r[3])
        moved = moved_columns(qx, qy, i, r) if close else nothing_moved
        own = no_members()
        pull_x = nothing
        pull_y = nothing
        seen = seen_in_row(ax, ay, room, np.int64(0))
        at = start + i
        for j in range(room.shape[0]):
            following = seen_in_row(ax, ay, room, min(j + 1, room.shape[0] - 1))
            rx, ry, r2, y = seen
            stretch = _stretch(moved, seen, load(member, L0 * width + at), member, EXCESS * width + at, close)
            s = unmarked(load(scale, at), done)
            elastic = s * stretch
            w = elastic * y
            energy = energy + elastic * stretch
            if not elastic_alone:
                pull_x = pull_x + w * rx
                pull_y = pull_y + w * ry
                w = w + s * (preload + damping * (y * (rx * room[j, 2] + ry * room[j, 3]))) * y
            if tangent:
                # a member without direction has no n: its k must not enter the trace
                own = add_member(own, rx, ry, y, w, where_larger(r2, ZERO_LENGTH_SQUARED, s - w))
            else:
                own = own[0], own[1] + w * rx, own[2] + w * ry, own[3], own[4], own[5]
            at += length
            seen = following
        sums = add_column(sums, ax, ay, own)
        if not elastic_alone:
            pulls = pulls[0] + pull_x, pulls[1] + pull_y, pulls[2] + (ax * pull_y - ay * pull_x)
    k = p[0]
    (x, y, t), (kxx, kxy, kyy, kxt, kyt, ktt) = force_and_tangent(sums)
    add_forces((k * x, k * y, k * t, 0.5 * k * total(energy)), counted and elastic_alone, o)
    if counted and not elastic_alone:
        o[3] += 0.5 * k * total(energy)
        o[4] += k * total(pulls[0])
        o[5] += k * total(pulls[1])
        o[6] += k * total(pulls[2])
    if tangent:
        add_tangent((k * kxx, k * kxy, k * kyy, k * kxt, k * kyt, k * ktt), o)


@part
def _stretch(moved, seen, free, member, excess, close):
    """Delta of members of one row (m), as `spring.elongation` has it, in vectors.

    moved: of their columns. seen: r, L^2 and 1/L (m, m^2, 1/m). free: l0 (m).
    member, excess: the rows of members, and where in it L0^2 - l0^2 (m^2) of these begins.
    close: whether elongations come from displacements.
    """
    rx, ry, r2, y = seen
    x = r2 * y - free
    if close:
        twice_x, twice_y, squared = moved
        along = twice_x * rx + twice_y * ry
        off = 0.5 * y * (x * (r2 * y + free) - ((load(member, excess) - squared) + along))
        x = x - where_larger(r2 - squared, 0.0, off)
    return x


@kernel
def grid_designs(member, width, start, count, length, p, rel, u, pair, out):
    """Add sum_j f (b . u_j) over S poses of each spring, without damping and preload, at alpha^mu = 1.

    In:
      member, width, start, count, length: as above.
      p (8,): parameters of the law, of which the stiffness (N/m) counts.
      rel (S, n_pair, POSE): relative poses.
      u (S, n_pair, 3): virtual changes of these.
      pair: number of the pair.
    Out:
      out (M or more,): added to.
    """
    rows = count // length
    tall = _tall(rows, count)
    room = np.empty((tall, rel.shape[0], 4))
    turned = np.empty((rel.shape[0], 5, lanes()))
    close = np.empty(rel.shape[0], np.bool_)
    for m in range(close.shape[0]):
        close[m] = by_displacements(rel[m, pair], p)
    for row in range(0, rows, tall):
        own = room[: min(tall, rows - row)]
        at = start + row * length
        _begin_designs(member, width, at, length, rel, u, pair, own)
        for begin in range(0, length, lanes()):
            _design_columns(member, width, at, begin, length, p[0], rel, pair, close, own, turned, out)


@part
def _begin_designs(member, width, at, length, rel, u, pair, room):
    """Find e of rows, and u + e x u_theta, by which u changes r of all their members (m).

    member, width, length, rel, u, pair: as of `grid_designs`. at: the first member of the first row.
    room (rows, S, 4): out.
    """
    for j in range(room.shape[0]):
        for m in range(room.shape[1]):
            ex = rel[m, pair, 0] - member[PX * width + at + j * length]
            ey = rel[m, pair, 1] - member[PY * width + at + j * length]
            room[j, m, 0] = ex
            room[j, m, 1] = ey
            room[j, m, 2] = u[m, pair, 0] + ey * u[m, pair, 2]
            room[j, m, 3] = u[m, pair, 1] - ex * u[m, pair, 2]


@part
def _design_columns(member, width, start, begin, length, k, rel, pair, close, room, turned, out):
    """`grid_designs` of a vector of columns of a tile.

    In:
      member, width, length, rel, pair: as of `grid_designs`. k: stiffness (N/m).
      close (S,): whether elongations come from displacements at the poses.
      start: the first member of the tile's first row. begin: the first column.
      room (rows, S, 4): of `_begin_designs`.
    Out:
      out (M or more,): added to.
      turned (S, 5, lanes): scratch: a, 2 x and x^2 of the columns at the poses (`spring_grid.moved_columns`).
    """
    i = min(begin, length - lanes())
    done = (1 << (begin - i)) - 1
    qx = member[QX * width + start : QX * width + start + length]
    qy = member[QY * width + start : QY * width + start + length]
    for m in range(turned.shape[0]):
        r = rel[m, pair]
        ax, ay = turned_columns(qx, qy, i, r[2], r[3])
        store(turned[m, 0], 0, ax)
        store(turned[m, 1], 0, ay)
        if close[m]:
            twice_x, twice_y, squared = moved_columns(qx, qy, i, r)
            store(turned[m, 2], 0, twice_x)
            store(turned[m, 3], 0, twice_y)
            store(turned[m, 4], 0, squared)
    at = start + i
    for j in range(room.shape[0]):
        free = load(member, L0 * width + at)
        work = zero()
        for m in range(turned.shape[0]):
            seen = seen_at(turned, room, j, m)
            stretch = _stretch(moved_at(turned, m), seen, free, member, EXCESS * width + at, close[m])
            work = work + stretch * seen[3] * (seen[0] * room[j, m, 2] + seen[1] * room[j, m, 3])
        store(out, at, load(out, at) + k * unmarked(work, done))
        at += length
