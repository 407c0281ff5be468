"""A member between two bodies in a plane, and sums over the members of a block.

Geometry as in `mechanics.laws.spring`: with r = d + R q - p, L = |r|, e = r/L,

    b = dL/dxi = (e, (R q x r)/L),   B2 = d2L/dxi2,   Delta = L - l0,   dDelta/dt = b . xi'

and a law f(Delta, dDelta/dt, t) with its partials gives Q = -sum s f b, K = sum s (b (f_D b + f_Dd B2 xi')^T + f B2),
C = sum s f_Dd b b^T, E = sum s V, E_xi = sum s V' b, where s = alpha^mu.
"""

import math

import numpy as np

from mdstopo.compiler.jit import inline, kernel, part
from mdstopo.compiler.padding import whole_vectors
from mdstopo.mechanics.kinematics.planar_grids import grid_designs, grid_sums
from mdstopo.mechanics.kinematics.planar_poses import turned_body
from mdstopo.mechanics.laws.alike import (
    alike_damping,
    alike_design,
    alike_designs,
    alike_sums,
    alike_tangent,
    alike_works,
    elastic_designs,
    elastic_designs_of_rows,
    far,
)
from mdstopo.mechanics.laws.law_table import SPRING, law, law_is_idle
from mdstopo.mechanics.laws.spring import (
    ZERO_LENGTH_SQUARED,
    by_displacements,
    elastic_force,
    elastic_tangent,
    elongation_of,
)
from mdstopo.mechanics.laws.sums import add_forces, add_tangent
from mdstopo.scene.springs_model import EXCESS, HOME_X, HOME_Y, L0, PX, PY, QX, QY


@inline
def direction(member, i, dx, dy, c, s):
    """Length and direction of member i at a relative pose.

    member (6, M_padded): P, Q in body frames (m) and what else `GeneralModel.member` has.
    i: number of the member (padded).
    dx, dy: place of the second body as seen from the first (m).
    c, s: cos and sin of its angle.

    Returns L (m), b = dL/dxi (3 numbers), 1 / L (1/m; 0 where there is no length) and R q (2 numbers, m).
    """
    ax = c * member[QX, i] - s * member[QY, i]
    ay = s * member[QX, i] + c * member[QY, i]
    rx = dx + ax - member[PX, i]
    ry = dy + ay - member[PY, i]
    r2 = rx * rx + ry * ry
    y = 1.0 / math.sqrt(r2) if r2 > ZERO_LENGTH_SQUARED else 0.0
    return r2 * y, y * rx, y * ry, y * (ax * ry - ay * rx), y, ax, ay


@inline
def stretched(member, i, r, length):
    """Elongation Delta (m) of member i at the relative pose r (POSE,), where it has a length."""
    x = member[QX, i]
    y = member[QY, i]
    rx = r[0] + (r[2] * x - r[3] * y) - member[PX, i]
    ry = r[1] + (r[3] * x + r[2] * y) - member[PY, i]
    ux = r[10] + (r[12] * x - r[13] * y)
    uy = r[11] + (r[13] * x + r[12] * y)
    return elongation_of(rx, ry, length, ux, uy, member[L0, i], member[EXCESS, i])


@inline
def _stretch_of(member, i, r):
    """`stretch_of` from the members' rows."""
    length, bx, by, bt, _, _, _ = direction(member, i, r[0], r[1], r[2], r[3])
    return stretched(member, i, r, length), bx * r[4] + by * r[5] + bt * r[6]


@part
def stretch_of(model, i, r):
    """Elongation (m) and its rate (m/s) of member i; see `kinematics_interface.stretch_of`."""
    return _stretch_of(model.member, i, r)


@part
def member_motion(model, i, r):
    """Length, elongation and its rate of member i; see `kinematics_interface.member_motion`."""
    length, bx, by, bt, _, _, _ = direction(model.member, i, r[0], r[1], r[2], r[3])
    return length, stretched(model.member, i, r, length), bx * r[4] + by * r[5] + bt * r[6]


@part
def member_work(model, i, r, u):
    """Length, elongation and b . u of member i; see `kinematics_interface.member_work`."""
    length, bx, by, bt, _, _, _ = direction(model.member, i, r[0], r[1], r[2], r[3])
    return length, stretched(model.member, i, r, length), bx * u[0] + by * u[1] + bt * u[2]


@part
def motion_of_ends(model, i, r):
    """Elongation and its rate of member i from its ends; see `kinematics_interface.motion_of_ends`."""
    c = r[2]
    s = r[3]
    ax = c * model.member[QX, i] - s * model.member[QY, i]
    ay = s * model.member[QX, i] + c * model.member[QY, i]
    x = r[0] + ax - model.member[PX, i]
    y = r[1] + ay - model.member[PY, i]
    length = math.sqrt(x * x + y * y)
    rate = (x * r[4] + y * r[5] + (ax * y - ay * x) * r[6]) / length if length > 0.0 else 0.0
    return stretched(model.member, i, r, length), rate


@part
def second_rate(model, i, r, acc):
    """d2Delta/dt2 of member i; see `kinematics_interface.second_rate`."""
    return _second_rate(model.member, i, r, acc)


@inline
def _second_rate(member, i, r, acc):
    """d2Delta/dt2 = b . xi'' + xi' . B2 xi' of member i; acc (3,): xi''."""
    _, bx, by, bt, y, ax, ay = direction(member, i, r[0], r[1], r[2], r[3])
    hxx = y * (1.0 - bx * bx)
    hxy = -y * bx * by
    hyy = y * (1.0 - by * by)
    hxt = -y * (ay + bx * bt)
    hyt = y * (ax - by * bt)
    htt = y * (ax * ax + ay * ay - bt * bt) - (bx * ax + by * ay)
    vx = r[4]
    vy = r[5]
    vt = r[6]
    return (
        bx * acc[0]
        + by * acc[1]
        + bt * acc[2]
        + vx * (hxx * vx + 2.0 * (hxy * vy + hxt * vt))
        + vy * (hyy * vy + 2.0 * hyt * vt)
        + vt * htt * vt
    )


@kernel
def member_sums(model, code, p, lo, count, counted, t, value, member_state, r, tangent, o):
    """Forces, energy and tangents of members of one law; see `kinematics_interface.member_sums`."""
    member = model.member
    curves = model.curves
    vx = r[4]
    vy = r[5]
    vt = r[6]
    for i in range(lo, lo + count):
        if law_is_idle(code, int(member_state[1, i])):
            continue
        length, bx, by, bt, y, ax, ay = direction(member, i, r[0], r[1], r[2], r[3])
        if length == 0.0:  # not y == 0.0: that is so infinitely far away, too
            continue
        rate = bx * vx + by * vy + bt * vt
        scale = member_state[0, i]
        x = stretched(member, i, r, length) - member_state[2, i]
        f, fd, fr, energy, pull = law(code, p, x, rate, int(member_state[1, i]), t, value, curves, member[4, i])
        f *= scale
        o[0] -= f * bx
        o[1] -= f * by
        o[2] -= f * bt
        if counted:
            o[3] += scale * energy
            pull *= scale
            o[4] += pull * bx
            o[5] += pull * by
            o[6] += pull * bt
        if not tangent:
            continue
        fd *= scale
        fr *= scale
        hxx = y * (1.0 - bx * bx)
        hxy = -y * bx * by
        hyy = y * (1.0 - by * by)
        hxt = -y * (ay + bx * bt)
        hyt = y * (ax - by * bt)
        htt = y * (ax * ax + ay * ay - bt * bt) - (bx * ax + by * ay)
        fx = fd * bx + fr * (hxx * vx + hxy * vy + hxt * vt)
        fy = fd * by + fr * (hxy * vx + hyy * vy + hyt * vt)
        ft = fd * bt + fr * (hxt * vx + hyt * vy + htt * vt)
        o[7] += bx * fx + f * hxx
        o[8] += bx * fy + f * hxy
        o[9] += bx * ft + f * hxt
        o[10] += by * fx + f * hxy
        o[11] += by * fy + f * hyy
        o[12] += by * ft + f * hyt
        o[13] += bt * fx + f * hxt
        o[14] += bt * fy + f * hyt
        o[15] += bt * ft + f * htt
        o[16] += fr * bx * bx
        o[17] += fr * bx * by
        o[18] += fr * by * by
        o[19] += fr * bx * bt
        o[20] += fr * by * bt
        o[21] += fr * bt * bt


@part
def spring_sums(model, p, start, count, row, counted, member_state, r, tangent, o):
    """Forces, energy and tangents of springs; see `kinematics_interface.spring_sums`."""
    rel = r.reshape((1, 1, r.shape[0]))
    sums = o.reshape((1, 1, o.shape[0]))
    spring_sums_at_poses(
        model, p, start, count, row, counted, member_state, rel, np.int64(0), np.int64(1), np.bool_(tangent), sums
    )


@kernel
def spring_sums_at_poses(model, p, start, count, row, counted, member_state, rel, pair, poses, tangent, sums):
    """The same at many poses; see `kinematics_interface.spring_sums_at_poses`."""
    stop = start + whole_vectors(count)
    width = model.member.shape[1]
    rows = model.member.reshape(model.member.size)
    scale = member_state.reshape(member_state.size)
    grid = row > 0 and p[0] != 0.0
    if grid:
        grid_sums(rows, width, scale, start, count, row, p, rel, pair, poses, np.bool_(counted), tangent, sums)
    for j in range(poses):
        r = rel[j, pair]
        o = sums[j, pair]
        if not grid:
            _springs_of_no_grid(rows, width, scale, start, stop, p, r, counted, tangent, o)
        if tangent and p[1] != 0.0:
            alike_damping(rows, width, scale, start, stop, p, r, o)


@part
def _springs_of_no_grid(rows, width, scale, start, stop, p, r, counted, tangent, o):
    """`spring_sums`, but for what damping does to tangents, of members anywhere.

    In:
      rows (6 M,), width: of `GeneralModel.member`, its rows behind each other, and the width of each.
      scale (M or more,), start, stop, p, r: as of `laws.alike`.
      counted: whether energies are wanted. tangent: whether K is.
    Out:
      o (SUMS,): added to.
    """
    c = p[0]
    if p[1] != 0.0 or p[2] != 0.0:
        alike_sums(rows, width, scale, start, stop, p, r, counted, o)
        if tangent:
            alike_tangent(rows, width, scale, start, stop, p, r, o)
    elif tangent:
        close = by_displacements(r, p)
        x, y, t, e, kxx, kxy, kyy, kxt, kyt, ktt = elastic_tangent(rows, width, scale, start, stop, r, close)
        add_forces((c * x, c * y, c * t, c * e), counted, o)
        add_tangent((c * kxx, c * kxy, c * kyy, c * kxt, c * kyt, c * ktt), o)
    else:
        x, y, t, e = elastic_force(rows, width, scale, start, stop, r, by_displacements(r, p))
        add_forces((c * x, c * y, c * t, c * e), counted, o)


@part
def member_works(model, lo, count, r, u, out):
    """What many members do at a relative pose; see `kinematics_interface.member_works`."""
    m = model.member
    alike_works(m.reshape(m.size), m.shape[1], lo, lo + whole_vectors(count), r, u, out)


@kernel
def member_designs(model, code, p, lo, count, t, value, member_state, modes_of, r, u, weight, out):
    """What members of one law add to a derivative by alpha^mu; see `kinematics_interface.member_designs`."""
    member = model.member
    if code == SPRING:
        width = member.shape[1]
        stop = lo + whole_vectors(count)
        alike_design(member.reshape(member.size), width, lo, stop, p, r, u, weight, out)
        return
    curves = model.curves
    for i in range(lo, lo + count):
        if law_is_idle(code, int(modes_of[i])):
            continue
        length, bx, by, bt, _, _, _ = direction(member, i, r[0], r[1], r[2], r[3])
        if length == 0.0:
            continue
        rate = bx * r[4] + by * r[5] + bt * r[6]
        x = stretched(member, i, r, length) - member_state[2, i]
        f, _, _, energy, _ = law(code, p, x, rate, int(modes_of[i]), t, value, curves, member[4, i])
        out[i] += f * (bx * u[0] + by * u[1] + bt * u[2]) + weight * energy


@part
def spring_designs(model, p, lo, count, row, rel, u, pair, out):
    """`member_designs` of springs at many poses; see `kinematics_interface.spring_designs`."""
    width = model.member.shape[1]
    rows = model.member.reshape(model.member.size)
    if row > 0:
        grid_designs(rows, width, lo, count, row, p, rel, u, pair, out)
    else:
        elastic_designs(rows, width, lo, lo + whole_vectors(count), p[0], rel, u, pair, out)


@part
def has_spring_energies(model):
    """Whether `spring_energies` is implemented: no, in a plane energies are part of `member_designs`."""
    return False


@part
def spring_energies(model, p, lo, count, rel, pair, weight, out):
    """Not implemented and never called in a plane; see `kinematics_interface.spring_energies`."""


@part
def spring_designs_of_rows(model, p, lo, count, rel, u, pair, room, out):
    """`spring_designs` for many rows; see `kinematics_interface.spring_designs_of_rows`."""
    width = model.member.shape[1]
    rows = model.member.reshape(model.member.size)
    stop = lo + whole_vectors(count)
    if p[1] == 0.0 and p[2] == 0.0:
        elastic_designs_of_rows(rows, width, lo, stop, p[0], rel, u, pair, room, out)
    else:
        alike_designs(rows, width, lo, stop, p, rel, u, pair, room, out)


@part
def member_designs_of_rows(model, code, p, lo, count, t, value, member_state, r, u, j, pair, seen, out):
    """`member_designs` for many rows; see `kinematics_interface.member_designs_of_rows`."""
    acting = 0
    for i in range(lo, lo + count):
        if law_is_idle(code, int(member_state[1, i])):
            continue
        length, bx, by, bt, _, _, _ = direction(model.member, i, r[0], r[1], r[2], r[3])
        if not length > 0.0:
            continue
        rate = bx * r[4] + by * r[5] + bt * r[6]
        x = stretched(model.member, i, r, length) - member_state[2, i]
        f, _, _, _, _ = law(code, p, x, rate, int(member_state[1, i]), t, value, model.curves, model.member[4, i])
        seen[0, acting] = f
        seen[1, acting] = bx
        seen[2, acting] = by
        seen[3, acting] = bt
        seen[4, acting] = i
        acting += 1
    for m in range(out.shape[0]):
        x = u[m, j, pair, 0]
        y = u[m, j, pair, 1]
        angle = u[m, j, pair, 2]
        for e in range(acting):
            out[m, int(seen[4, e])] += seen[0, e] * (seen[1, e] * x + seen[2, e] * y + seen[3, e] * angle)


@part
def keep_apart(model, lo, count, row, before, after):
    """Whether no member's ends can meet between two poses; see `kinematics_interface.keep_apart`."""
    m = model.member
    return far(m.reshape(m.size), m.shape[1], lo, lo + whole_vectors(count), before, after)


@part
def ends_meet(model, i, r, w):
    """Whether the ends of member i meet between two poses; see `kinematics_interface.ends_meet`."""
    m = model.member
    x = r[0] + r[2] * m[2, i] - r[3] * m[3, i] - m[0, i]
    y = r[1] + r[3] * m[2, i] + r[2] * m[3, i] - m[1, i]
    ux = w[0] + w[2] * m[2, i] - w[3] * m[3, i] - m[0, i] - x
    uy = w[1] + w[3] * m[2, i] + w[2] * m[3, i] - m[1, i] - y
    u2 = ux * ux + uy * uy
    along = -(x * ux + y * uy)
    across = x * uy - y * ux
    met = u2 > 0.0 and along >= 0.0 and along <= u2 and across * across <= 1e-18 * u2 * u2
    return met or not x * x + y * y > ZERO_LENGTH_SQUARED


@part
def turn_of(model, body, q):
    """The turn of one body; see `kinematics_interface.turn_of`."""
    return turned_body(model.home, body, q[3 * body + 2])


@part
def stretch_between(model, p, i, turn_one, turn_two, q, v):
    """Elongation and its rate of member i from turned bodies; see `kinematics_interface.stretch_between`."""
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    a = 3 * one
    b = 3 * two
    px, py, qx, qy, ux, uy, length, stretch = member_between(model, i, one, two, q, turn_one, turn_two)
    wa = v[a + 2]
    wb = v[b + 2]
    y = 1.0 / length if length > 1e-15 else 0.0
    dx = v[b] - wb * qy - v[a] + wa * py
    dy = v[b + 1] + wb * qx - v[a + 1] - wa * px
    return stretch, ux * y * dx + uy * y * dy


@inline
def member_between(model, i, one, two, q, turn_one, turn_two):
    """Where a member lies between two bodies.

    Constant:
      model: the compiled scene.
      i: the member (padded).
      one, two: its bodies.
      q (n,): coordinates (m, rad).
      turn_one, turn_two: of `turned_body`, for each body.

    Returns its arms p and q (px, py, qx, qy) and its vector (x, y) in global axes, its length, and Delta (m).
    """
    m = model.member
    ca, sa, ca_since, sa_since = turn_one
    cb, sb, cb_since, sb_since = turn_two
    a = 3 * one
    b = 3 * two
    px = ca * m[0, i] - sa * m[1, i]
    py = sa * m[0, i] + ca * m[1, i]
    qx = cb * m[2, i] - sb * m[3, i]
    qy = sb * m[2, i] + cb * m[3, i]
    wx = q[b] - q[a]
    wy = q[b + 1] - q[a + 1]
    x = model.home[two, HOME_X] - model.home[one, HOME_X] + wx + qx - px
    y = model.home[two, HOME_Y] - model.home[one, HOME_Y] + wy + qy - py
    ux = wx + (cb_since * m[2, i] - sb_since * m[3, i]) - (ca_since * m[0, i] - sa_since * m[1, i])
    uy = wy + (sb_since * m[2, i] + cb_since * m[3, i]) - (sa_since * m[0, i] + ca_since * m[1, i])
    length = math.sqrt(x * x + y * y)
    return px, py, qx, qy, x, y, length, elongation_of(x, y, length, ux, uy, m[4, i], m[5, i])


@kernel
def member_rows(model, p, i, q, v, row, row_rate):
    """Elongation, its rate and the row B of a member; see `kinematics_interface.member_rows`."""
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    a = 3 * one
    b = 3 * two
    turn_one = turned_body(model.home, one, q[a + 2])
    turn_two = turned_body(model.home, two, q[b + 2])
    px, py, qx, qy, ux, uy, length, stretch = member_between(model, i, one, two, q, turn_one, turn_two)
    y = 1.0 / length if length > 1e-15 else 0.0
    ex = ux * y
    ey = uy * y
    wa = v[a + 2]
    wb = v[b + 2]
    dx = v[b] - wb * qy - v[a] + wa * py
    dy = v[b + 1] + wb * qx - v[a + 1] - wa * px
    rate = ex * dx + ey * dy
    fx = y * (dx - rate * ex)
    fy = y * (dy - rate * ey)
    row[0] = -ex
    row[1] = -ey
    row[2] = ex * py - ey * px
    row[3] = ex
    row[4] = ey
    row[5] = ey * qx - ex * qy
    row_rate[0] = -fx
    row_rate[1] = -fy
    row_rate[2] = fx * py - fy * px + wa * (ex * px + ey * py)
    row_rate[3] = fx
    row_rate[4] = fy
    row_rate[5] = fy * qx - fx * qy - wb * (ex * qx + ey * qy)
    return stretch, rate


@kernel
def end_slopes(model, p, i, side, along, q, v, a, row_slope):
    """What moving an end of a member does to its length and row; see `kinematics_interface.end_slopes`.

    With r, r', r'' from the first end to the second, and d, d', d'' what they change by as the end moves,

        dL = e . d,   de = (d - e dL)/L,   dL' = de . r' + e . d',
        L'' = e . r'' + (|r'|^2 - L'^2)/L,   dL'' = de . r'' + e . d'' + (2 r' . d' - 2 L' dL' - (L'' - e . r'') dL)/L.
    """
    one = model.pair[p, 0]
    two = model.pair[p, 1]
    first = 3 * one
    second = 3 * two
    turn_one = turned_body(model.home, one, q[first + 2])
    turn_two = turned_body(model.home, two, q[second + 2])
    px, py, qx, qy, rx, ry, length, _ = member_between(model, i, one, two, q, turn_one, turn_two)
    row_slope[:] = 0.0
    if not length > 1e-15:
        return 0.0, 0.0, 0.0, 0.0
    ex = rx / length
    ey = ry / length
    wa = v[first + 2]
    wb = v[second + 2]
    vx = v[second] - wb * qy - v[first] + wa * py
    vy = v[second + 1] + wb * qx - v[first + 1] - wa * px
    ta = a[first + 2]
    tb = a[second + 2]
    ax = a[second] - tb * qy - wb * wb * qx - a[first] + ta * py + wa * wa * px
    ay = a[second + 1] + tb * qx - wb * wb * qy - a[first + 1] - ta * px + wa * wa * py
    c, s, _, _ = turn_two if side == 1 else turn_one
    w = wb if side == 1 else wa
    t = tb if side == 1 else ta
    sign = 1.0 if side == 1 else -1.0
    dx = sign * (c * along[0] - s * along[1])
    dy = sign * (s * along[0] + c * along[1])
    by_length = ex * dx + ey * dy
    fx = (dx - ex * by_length) / length
    fy = (dy - ey * by_length) / length
    rate = ex * vx + ey * vy
    by_rate = fx * vx + fy * vy + w * (ey * dx - ex * dy)
    excess = (vx * vx + vy * vy - rate * rate) / length
    by_push = ex * (-t * dy - w * w * dx) + ey * (t * dx - w * w * dy)
    turning = w * (vy * dx - vx * dy)
    by_second = fx * ax + fy * ay + by_push + (2.0 * turning - 2.0 * rate * by_rate - excess * by_length) / length
    row_slope[0] = -fx
    row_slope[1] = -fy
    row_slope[2] = fx * py - fy * px
    row_slope[3] = fx
    row_slope[4] = fy
    row_slope[5] = fy * qx - fx * qy
    # the arm of the end that moves changes by the same vector, but for its sign
    row_slope[3 * side + 2] += ey * dx - ex * dy
    return by_length, by_rate, by_second, ex * ax + ey * ay + excess
