"""Undamped springs from every point of one grid to every point of another: the sums of `spring`, in fewer operations.

Members lie in rows: those of one row begin at one point P, and those of one column end at one point Q. With
a = R q of a column and e = d - p of a row, r = a + e; so in a column, where a stays,

    tau L = a x r,   Q = -(sum w r, a x sum w r),   w = f/L,   g = (k - w)/L^2,
    K = sum g c c^T + w B2',   c = (r, a x r):   sums of w, w r and g r r^T are all that a member adds to.

Rows are padded by members of no stiffness at the row's last point, so that vectors take whole columns.
Arguments: member arrays (n,) of whole rows, beginning at the first of them; the length of a row; the columns from
`first` to `last`; the pose; room (rows, 2) for what belongs to rows.
"""

import numpy as np

from mdstopo.jit import kernel, part
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.mechanics.laws.sums import upper_triangle
from mdstopo.native.vector import inverse_root, lanes, load, store, total, zero


@kernel
def _seen(ax, ay, room, j):  # type: ignore[no-untyped-def]
    """r, L^2 and 1/L of the members of row j."""
    rx = ax + room[j, 0]
    ry = ay + room[j, 1]
    r2 = rx * rx + ry * ry
    return rx, ry, r2, inverse_root(r2, ZERO_LENGTH_SQUARED)


@kernel
def begin_rows(px, py, width, dx, dy, room):  # type: ignore[no-untyped-def]
    """e of each row."""
    for j in range(room.shape[0]):
        room[j, 0] = dx - px[j * width]
        room[j, 1] = dy - py[j * width]


@kernel
def grid_force(px, py, qx, qy, l0, k, width, first, last, dx, dy, c, s, room):  # type: ignore[no-untyped-def]
    """Return Q (3 numbers) and E."""
    begin_rows(px, py, width, dx, dy, room)
    sum_x = zero()
    sum_y = zero()
    sum_t = zero()
    energy = zero()
    for i in range(first, last, lanes()):
        u = load(qx, i)
        v = load(qy, i)
        ax = c * u - s * v
        ay = s * u + c * v
        own_x = zero()
        own_y = zero()
        at = i
        for j in range(room.shape[0]):
            rx, ry, r2, y = _seen(ax, ay, room, j)
            stretch = r2 * y - load(l0, at)
            w = load(k, at) * stretch
            energy += w * stretch
            w *= y
            own_x += w * rx
            own_y += w * ry
            at += width
        sum_x += own_x
        sum_y += own_y
        sum_t += ax * own_y - ay * own_x
    return -total(sum_x), -total(sum_y), -total(sum_t), 0.5 * total(energy)


@part
def no_members(nothing):  # type: ignore[no-untyped-def]
    """Sums over the members of a column: w, w r, and the upper triangle of g r r^T; of none."""
    return nothing, nothing, nothing, nothing, nothing, nothing


@part
def add_member(own, rx, ry, w, g):  # type: ignore[no-untyped-def]
    """The sums with a member more."""
    own_w, own_x, own_y, gxx, gxy, gyy = own
    gx = g * rx
    gy = g * ry
    return own_w + w, own_x + w * rx, own_y + w * ry, gxx + gx * rx, gxy + gx * ry, gyy + gy * ry


@part
def no_columns(nothing):  # type: ignore[no-untyped-def]
    """Sums over columns: -Q, w and w a, and xx, xy, yy, xt, yt, tt of what K has besides these; of none."""
    return (nothing, nothing, nothing), (nothing, nothing, nothing), no_members(nothing)


@part
def add_column(sums, ax, ay, own):  # type: ignore[no-untyped-def]
    """The sums with a column more, whose members are summed in `own`."""
    (sum_x, sum_y, sum_t), (sum_w, sum_wx, sum_wy), (kxx, kxy, kyy, kxt, kyt, ktt) = sums
    w, x, y, gxx, gxy, gyy = own
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
def columns(sums):  # type: ignore[no-untyped-def]
    """Q and the upper triangle of K."""
    (sum_x, sum_y, sum_t), weights, tangent = sums
    return (-total(sum_x), -total(sum_y), -total(sum_t)), upper_triangle(*tangent, *weights)


@part
def grid_tangent(px, py, qx, qy, l0, k, width, first, last, dx, dy, c, s, room):  # type: ignore[no-untyped-def]
    """Return Q, E and the upper triangle xx, xy, yy, xt, yt, tt of K.

    The lengths of the next row are found while this one is summed, as in `spring.elastic_tangent`.
    """
    rows = room.shape[0]
    begin_rows(px, py, width, dx, dy, room)
    nothing = zero()
    sums = no_columns(nothing)
    energy = nothing
    for i in range(first, last, lanes()):
        u = load(qx, i)
        v = load(qy, i)
        ax = c * u - s * v
        ay = s * u + c * v
        own = no_members(nothing)
        at = i
        rx, ry, r2, y = _seen(ax, ay, room, np.int64(0))
        for j in range(rows):
            following = _seen(ax, ay, room, min(j + 1, rows - 1))
            stiffness = load(k, at)
            stretch = r2 * y - load(l0, at)
            w = stiffness * stretch
            energy += w * stretch
            w *= y
            g = (stiffness - w) * (y * y)
            own = add_member(own, rx, ry, w, g)
            at += width
            rx, ry, r2, y = following
        sums = add_column(sums, ax, ay, own)
    force, tangent = columns(sums)
    return (*force, 0.5 * total(energy), *tangent)


@kernel
def _seen_at(turned, room, j, m):  # type: ignore[no-untyped-def]
    """r, L^2 and 1/L of the members of row j at pose m."""
    rx = load(turned[m, 0], 0) + room[j, m, 0]
    ry = load(turned[m, 1], 0) + room[j, m, 1]
    r2 = rx * rx + ry * ry
    return rx, ry, r2, inverse_root(r2, ZERO_LENGTH_SQUARED)


@part
def grid_design(px, py, qx, qy, l0, k, width, first, last, pose, u, room, turned, out):  # type: ignore[no-untyped-def]
    """Add sum_j f_i (b_i . u_j) of each spring at pose (m, >= 4) j to out; u (m, 3), room (rows, m, 4).

    turned (m, 2, lanes) is room for a at the poses.
    """
    rows = room.shape[0]
    many = pose.shape[0]
    if many == 0:
        return
    for j in range(rows):
        for m in range(many):
            ex = pose[m, 0] - px[j * width]
            ey = pose[m, 1] - py[j * width]
            room[j, m, 0] = ex
            room[j, m, 1] = ey
            # L b . u = r . (u + e x u_theta)
            room[j, m, 2] = u[m, 0] + ey * u[m, 2]
            room[j, m, 3] = u[m, 1] - ex * u[m, 2]
    for i in range(first, last, lanes()):
        v = load(qx, i)
        w = load(qy, i)
        for m in range(many):
            store(turned[m, 0], 0, pose[m, 2] * v - pose[m, 3] * w)
            store(turned[m, 1], 0, pose[m, 3] * v + pose[m, 2] * w)
        at = i
        rx, ry, r2, z = _seen_at(turned, room, np.int64(0), np.int64(0))
        for j in range(rows):
            free = load(l0, at)
            work = zero()
            for m in range(1, many):
                following = _seen_at(turned, room, j, m)
                work += (r2 * z - free) * z * (rx * room[j, m - 1, 2] + ry * room[j, m - 1, 3])
                rx, ry, r2, z = following
            following = _seen_at(turned, room, min(j + 1, rows - 1), np.int64(0))
            work += (r2 * z - free) * z * (rx * room[j, many - 1, 2] + ry * room[j, many - 1, 3])
            rx, ry, r2, z = following
            store(out, at, load(out, at) + load(k, at) * work)
            at += width
