"""Undamped springs from every point of one grid to every point of another: the sums of `spring`, in fewer operations.

Members lie in rows: those of one row begin at one point P, and those of one column end at one point Q. With
a = R q of a column and e = d - p of a row, r = a + e; so in a column, where a stays,

    tau L = a x r,   Q = -(sum w r, a x sum w r),   w = f/L,   g = k - w,   n = r/L,
    K = sum g c c^T + w B2',   c = (n, a x n):   sums of w, w r and g n n^T are all that a member adds to;
    of the last its first row and its trace, sum g.

Rows are padded by members of no stiffness at the row's last point, so that vectors take whole columns.
Arguments: member arrays (n,) of whole rows, beginning at the first of them; the places of a row; the columns from
`first` to `last`; the pose r (POSE,); close, whether it is near home
(`spring.is_near`); room (rows, 2) for what belongs to rows.
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import inverse_root, lanes, larger, largest, load, store, total, where_larger, zero
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.mechanics.laws.sums import upper_triangle


@kernel
def seen_in_row(ax, ay, room, j):
    """Vectors r, squares of lengths and 1/L of the members of row j of the grid."""
    rx = ax + room[j, 0]
    ry = ay + room[j, 1]
    r2 = rx * rx + ry * ry
    return rx, ry, r2, inverse_root(r2, ZERO_LENGTH_SQUARED)


@kernel
def begin_rows(px, py, width, dx, dy, room):
    """Find e = d - p of each row of a grid.

    In:
      px, py (rows width or more,): points P (m), alike in a row.
      width: places in a row.
      dx, dy: d of the relative pose (m).
    Out:
      room (rows, 2): e (m).
    """
    for j in range(room.shape[0]):
        room[j, 0] = dx - px[j * width]
        room[j, 1] = dy - py[j * width]


@part
def grid_force(px, py, qx, qy, l0, excess, k, width, first, last, r, close, room):
    """Sum the members of a grid to force and energy at one relative pose.

    As in `spring.elastic_tangent`, the lengths of the next row (after the last, of the next columns' first) are found
    while this one is summed.

    px, py, qx, qy (rows width,): points P and Q in the frames of their bodies (m).
    l0, excess (rows width,): free lengths (m) and L0^2 - l0^2 (m^2).
    k (rows width,): stiffness times alpha^mu (N/m).
    width: places in a row.
    first, last: the columns from first to before last are summed.
    r (POSE,): relative pose.
    close: whether elongations come from displacements (`spring.is_near`).
    room (rows, 2): room for e of the rows.

    Returns Q (3 numbers; N, N, N m) and E (J).
    """
    begin_rows(px, py, width, r[0], r[1], room)
    nothing_moved = zero(), zero(), zero()
    sum_x = zero()
    sum_y = zero()
    sum_t = zero()
    energy = zero()
    ax, ay = turned_columns(qx, qy, first, r[2], r[3])
    seen = seen_in_row(ax, ay, room, np.int64(0))
    for i in range(first, last, lanes()):
        bx, by = turned_columns(qx, qy, min(i + lanes(), last - lanes()), r[2], r[3])
        moved = moved_columns(qx, qy, i, r) if close else nothing_moved
        own_x = zero()
        own_y = zero()
        at = i
        for j in range(1, room.shape[0]):
            following = seen_in_row(ax, ay, room, j)
            w, energy = _weight(energy, seen, moved, load(k, at), load(l0, at), excess, at, close)
            own_x += w * seen[0]
            own_y += w * seen[1]
            at += width
            seen = following
        following = seen_in_row(bx, by, room, np.int64(0))
        w, energy = _weight(energy, seen, moved, load(k, at), load(l0, at), excess, at, close)
        own_x += w * seen[0]
        own_y += w * seen[1]
        seen = following
        sum_x += own_x
        sum_y += own_y
        sum_t += ax * own_y - ay * own_x
        ax = bx
        ay = by
    return -total(sum_x), -total(sum_y), -total(sum_t), 0.5 * total(energy)


@part
def turned_columns(qx, qy, i, c, s):
    """Points of the grid's columns from i on, turned with their body."""
    u = load(qx, i)
    v = load(qy, i)
    return c * u - s * v, s * u + c * v


@part
def moved_columns(qx, qy, i, r):
    """2 u and u^2 of the columns from i on: what r has changed by since home, alike in all rows."""
    x, y = turned_columns(qx, qy, i, r[12], r[13])
    x += r[10]
    y += r[11]
    return x + x, y + y, x * x + y * y


@part
def _stretch(seen, moved, l0, excess, at, close):
    """Delta of the members from one place on, as `spring.elongation` (m), in vectors.

    seen: r, L^2 and 1/L of the members.
    moved: 2 u and u^2 of their columns (`moved_columns`).
    l0: free lengths (m).
    excess (rows width,): L0^2 - l0^2 (m^2).
    at: the first place in `excess`.
    close: whether bodies have hardly moved, so that u < r and elongations come from displacements.
    """
    rx, ry, r2, y = seen
    x = r2 * y - l0
    if close:
        twice_x, twice_y, u2 = moved
        squares = (load(excess, at) - u2) + twice_x * rx + twice_y * ry
        x -= 0.5 * y * (x * (r2 * y + l0) - squares)
    return x


@part
def _weight(energy, seen, moved, k, l0, excess, at, close):
    """w = k Delta/L of the members from one place on, and twice the energy with theirs added, in vectors.

    energy: twice the energy so far (J).
    seen: r, L^2 and 1/L of the members.
    moved: 2 u and u^2 of their columns (`moved_columns`).
    k: stiffness times alpha^mu (N/m).
    l0: free lengths (m).
    excess (rows width,): L0^2 - l0^2 (m^2).
    at: the first place in `excess`.
    close: whether bodies have hardly moved, so that u < r and elongations come from displacements.

    Returns both.
    """
    stretch = _stretch(seen, moved, l0, excess, at, close)
    w = k * stretch
    return w * seen[3], energy + w * stretch


@part
def no_members():
    """Sums over the members of a column, all zero: w, w r, and of g n n^T xx, xy and the trace."""
    nothing = zero()
    return nothing, nothing, nothing, nothing, nothing, nothing


@part
def add_member(own, rx, ry, y, w, g):
    """Add one more member in each column to the sums over the members of columns, in vectors.

    own: the sums so far, as of `no_members`.
    rx, ry: r (m).
    y: 1/L (1/m).
    w: f/L (N/m).
    g: k - w (N/m).
    """
    own_w, own_x, own_y, gxx, gxy, trace = own
    nx = rx * y
    ny = ry * y
    gx = g * nx
    return own_w + w, own_x + w * rx, own_y + w * ry, gxx + gx * nx, gxy + gx * ny, trace + g


@part
def no_columns():
    """Sums over columns, all zero: -Q, w and w a, and xx, xy, yy, xt, yt, tt of what K has besides these."""
    nothing = zero()
    return (
        (nothing, nothing, nothing),
        (nothing, nothing, nothing),
        (nothing, nothing, nothing, nothing, nothing, nothing),
    )


@part
def add_column(sums, ax, ay, own):
    """Add the sums over one column, `own`, to the sums over columns."""
    (sum_x, sum_y, sum_t), (sum_w, sum_wx, sum_wy), (kxx, kxy, kyy, kxt, kyt, ktt) = sums
    w, x, y, gxx, gxy, trace = own
    gyy = trace - gxx
    gxt = ax * gxy - ay * gxx
    gyt = ax * gyy - ay * gxy
    return (
        (sum_x + x, sum_y + y, sum_t + (ax * y - ay * x)),
        (sum_w + w, sum_wx + w * ax, sum_wy + w * ay),
        (
            kxx + gxx,
            kxy + gxy,
            kyy + gyy,
            kxt + gxt,
            kyt + gyt,
            ktt + (ax * gyt - ay * gxt - (ax * x + ay * y - w * (ax * ax + ay * ay))),
        ),
    )


@part
def force_and_tangent(sums):
    """The force Q and the upper triangle of the tangent K, from sums over members."""
    (sum_x, sum_y, sum_t), weights, tangent = sums
    return (-total(sum_x), -total(sum_y), -total(sum_t)), upper_triangle(*tangent, *weights)


@part
def grid_tangent(px, py, qx, qy, l0, excess, k, width, first, last, r, close, room):
    """Sum the members of a grid to force, energy and tangent at one relative pose.

    The lengths of the next row are found while this one is summed, as in `grid_force`.

    px, py, qx, qy (rows width,): points P and Q in the frames of their bodies (m).
    l0, excess (rows width,): free lengths (m) and L0^2 - l0^2 (m^2).
    k (rows width,): stiffness times alpha^mu (N/m).
    width: places in a row.
    first, last: the columns from first to before last are summed.
    r (POSE,): relative pose.
    close: whether elongations come from displacements (`spring.is_near`).
    room (rows, 2): room for e of the rows.

    Returns Q (3 numbers; N, N, N m), E (J) and the upper triangle xx, xy, yy, xt, yt, tt of K.
    """
    begin_rows(px, py, width, r[0], r[1], room)
    nothing_moved = zero(), zero(), zero()
    sums = no_columns()
    energy = zero()
    ax, ay = turned_columns(qx, qy, first, r[2], r[3])
    seen = seen_in_row(ax, ay, room, np.int64(0))
    for i in range(first, last, lanes()):
        bx, by = turned_columns(qx, qy, min(i + lanes(), last - lanes()), r[2], r[3])
        moved = moved_columns(qx, qy, i, r) if close else nothing_moved
        own = no_members()
        at = i
        for j in range(1, room.shape[0]):
            following = seen_in_row(ax, ay, room, j)
            own, energy = _add(own, energy, seen, moved, load(k, at), load(l0, at), excess, at, close)
            at += width
            seen = following
        following = seen_in_row(bx, by, room, np.int64(0))
        own, energy = _add(own, energy, seen, moved, load(k, at), load(l0, at), excess, at, close)
        seen = following
        sums = add_column(sums, ax, ay, own)
        ax = bx
        ay = by
    force, tangent = force_and_tangent(sums)
    return (*force, 0.5 * total(energy), *tangent)


@part
def _add(own, energy, seen, moved, k, l0, excess, at, close):
    """The sums over the members of a column, and twice the energy, with one member more in each, in vectors.

    own: the sums so far, as of `no_members`.
    energy: twice the energy so far (J).
    seen: r, L^2 and 1/L of the members.
    moved: 2 u and u^2 of their columns (`moved_columns`).
    k: stiffness times alpha^mu (N/m).
    l0: free lengths (m).
    excess (rows width,): L0^2 - l0^2 (m^2).
    at: the first place in `excess`.
    close: whether bodies have hardly moved, so that u < r and elongations come from displacements.
    """
    rx, ry, r2, y = seen
    w, energy = _weight(energy, seen, moved, k, l0, excess, at, close)
    # a member without direction has no n: its k must not enter the trace
    return add_member(own, rx, ry, y, w, where_larger(r2, ZERO_LENGTH_SQUARED, k - w)), energy


@kernel
def seen_at(turned, room, j, m):
    """Vectors r, squares of lengths and 1/L of the members of row j at pose m."""
    rx = load(turned[m, 0], 0) + room[j, m, 0]
    ry = load(turned[m, 1], 0) + room[j, m, 1]
    r2 = rx * rx + ry * ry
    return rx, ry, r2, inverse_root(r2, ZERO_LENGTH_SQUARED)


@kernel
def moved_at(turned, m):
    """The columns of the grid at pose m, as `moved_columns` gave them."""
    return load(turned[m, 2], 0), load(turned[m, 3], 0), load(turned[m, 4], 0)


@part
def _work(seen, moved, along, l0, excess, at, close):
    """Delta (b . u) = Delta/L r . (u + e x u_theta) of the members from one place on, in vectors; 0 of no length.

    seen: r, L^2 and 1/L of the members.
    moved: 2 u and u^2 of their columns (`moved_columns`).
    along (4,): of a row, e and then u + e x u_theta.
    l0: free lengths (m).
    excess (rows width,): L0^2 - l0^2 (m^2).
    at: the first place in `excess`.
    close: whether bodies have hardly moved, so that u < r and elongations come from displacements.
    """
    return _stretch(seen, moved, l0, excess, at, close) * seen[3] * (seen[0] * along[2] + seen[1] * along[3])


@part
def grid_design(px, py, qx, qy, l0, excess, k, width, first, last, pose, close, u, weight, room, turned, out):
    """Add sum_j f (b . u_j) and sum_e weight_e V of each member of a grid: f, b at the first poses, V at the others.

    In:
      px, py, qx, qy (rows width,): points P and Q in the frames of their bodies (m).
      l0, excess (rows width,): free lengths (m) and L0^2 - l0^2 (m^2).
      k (rows width,): stiffness at alpha = 1 (N/m).
      width: places in a row.
      first, last: the columns from first to before last are meant.
      pose (poses, POSE): relative poses.
      close (poses,): whether elongations come from displacements there (`spring.is_near`).
      u (m, 3): virtual changes of the first poses.
      weight (poses - m,): of the energies at the others.
    Out:
      out (rows width,): added to.
    Room:
      room (rows, poses, 4): for e, and u + e x u_theta.
      turned (poses, 5, lanes): for a, 2 u and u^2 (`moved_columns`).
    """
    rows = room.shape[0]
    many = u.shape[0]
    poses = pose.shape[0]
    if poses == 0:
        return
    for j in range(rows):
        for m in range(poses):
            ex = pose[m, 0] - px[j * width]
            ey = pose[m, 1] - py[j * width]
            room[j, m, 0] = ex
            room[j, m, 1] = ey
            if m < many:  # L b . u = r . (u + e x u_theta)
                room[j, m, 2] = u[m, 0] + ey * u[m, 2]
                room[j, m, 3] = u[m, 1] - ex * u[m, 2]
    for i in range(first, last, lanes()):
        for m in range(poses):
            ax, ay = turned_columns(qx, qy, i, pose[m, 2], pose[m, 3])
            store(turned[m, 0], 0, ax)
            store(turned[m, 1], 0, ay)
            if close[m]:
                twice_x, twice_y, u2 = moved_columns(qx, qy, i, pose[m])
                store(turned[m, 2], 0, twice_x)
                store(turned[m, 3], 0, twice_y)
                store(turned[m, 4], 0, u2)
        at = i
        seen = seen_at(turned, room, np.int64(0), np.int64(0))
        for j in range(rows):
            free = load(l0, at)
            work = zero()
            for m in range(1, many):
                following = seen_at(turned, room, j, m)
                work += _work(seen, moved_at(turned, m - 1), room[j, m - 1], free, excess, at, close[m - 1])
                seen = following
            if many > 0:
                following = seen_at(turned, room, min(j + 1, rows - 1), np.int64(0))
                work += _work(seen, moved_at(turned, many - 1), room[j, many - 1], free, excess, at, close[many - 1])
                seen = following
            for m in range(many, poses):
                stretch = _stretch(seen_at(turned, room, j, m), moved_at(turned, m), free, excess, at, close[m])
                work += 0.5 * weight[m - many] * stretch * stretch
            store(out, at, load(out, at) + load(k, at) * work)
            at += width


@kernel
def grid_shortest(px, py, qx, qy, width, dx, dy, c, s):
    """Smallest length in whole rows of a grid (m).

    px, py (rows width,): points P in the frame of the first body (m).
    qx, qy (width or more,): points Q of the columns in that of the second (m).
    width: places in a row.
    dx, dy: d of the relative pose (m).
    c, s: cosine and sine of theta.
    """
    found = zero() - np.inf
    for i in range(0, width, lanes()):
        ax, ay = turned_columns(qx, qy, i, c, s)
        for at in range(0, px.shape[0], width):
            rx = ax + (dx - px[at])
            ry = ay + (dy - py[at])
            found = larger(zero() - (rx * rx + ry * ry), found)
    return math.sqrt(-largest(found))
