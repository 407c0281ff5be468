"""The spring law f = k Delta + c dDelta/dt + preload (Eq. 2), over a tile of members at one relative pose.

A member's vector in the first body's frame is r = d + R q - p, with the relative pose (d, R) of its two bodies, so
its length L = |r|, direction e = r/L and

    b = dL/dxi = (e_x, e_y, tau),   tau = (R q x r)/L,      xi = (d_x, d_y, theta)
    B2 = d2L/dxi2 = (g^T g - b b^T)/L + e . d2r,            g = dr/dxi = [I, J R q],   e . d2r = -(e . R q) on theta

All kernels return sums over the tile, which is all that anything at body level ever needs:

    Q = -sum f b,   K = -dQ/dxi = sum b (f_D b + f_Dd B2 xi')^T + f B2,   C = -dQ/dxi' = sum f_Dd b b^T
    E = sum k Delta^2 / 2 (the stored energy; preload and damping store none),   E_xi = sum k Delta b

with k, c and preload already multiplied by alpha^mu. A member of zero length has no direction and adds no force.

Delta is no difference of lengths (`elongation`). Member arrays (6, n) are P, Q, l0 and its excess: L0^2 - l0^2 of the
length L0 at home.

Kernels come in two kinds, elastic (no damping, no preload: E_xi = -Q, K symmetric, C absent) and viscous.
Arguments: member arrays (n,), then the pose r (POSE,).
"""

import math

import numpy as np

from mdstopo.compiler.jit import inline, kernel, member_kernel, part
from mdstopo.compiler.vector import inverse_root, lanes, larger, largest, load, store, total, where_larger, zero
from mdstopo.mechanics.laws.sums import upper_triangle

ELASTIC = 0
VISCOUS = 1

#: where in a spring's parameters in a general scene its row of `Model.near` begins; zeros mean: elongations always come
#: from displacements
NEAR_AT = 6

#: below this squared length (m^2) a member counts as having no direction
ZERO_LENGTH_SQUARED = 1e-30


@inline
def _inverse_length(r2):
    return 1.0 / math.sqrt(r2) if r2 > ZERO_LENGTH_SQUARED else 0.0


@inline
def _elongation(rx, ry, r2, y, ux, uy, free, excess):
    """`elongation` of one member, in numbers and without a branch (m).

    rx, ry, r2: r and its square (m, m^2).
    y: 1/L, 0 for no length (1/m).
    ux, uy: what r has changed by since home (m).
    free: l0 (m).
    excess: L0^2 - l0^2 (m^2).
    """
    x = r2 * y - free
    squares = excess + (ux * (rx + rx - ux) + uy * (ry + ry - uy))
    off = 0.5 * y * (x * (r2 * y + free) - squares)
    return x - (off if ux * ux + uy * uy < r2 else 0.0)


@part
def is_near(r, near):
    """Whether a pose r (POSE,) is so near home that members would lose digits in a difference of lengths.

    near (2,): a row of `scene.springs_model.Model.near`. Beyond it, elongations from displacements are no better.
    """
    return r[10] * r[10] + r[11] * r[11] < near[0] and r[12] * r[12] + r[13] * r[13] < near[1]


@part
def by_displacements(r, p):
    """Whether elongations come from displacements at a pose r (POSE,), by the parameters p (8,) of a spring."""
    return p[NEAR_AT] == 0.0 or is_near(r, p[NEAR_AT : NEAR_AT + 2])


@part
def elongation(rx, ry, r2, y, ux, uy, free, excess):
    """Delta = L - l0 of members, in vectors (m).

    L^2 - l0^2 = excess + u . (2 r - u) has all digits of u, and one step of Newton's method for
    Delta (Delta + 2 l0) = L^2 - l0^2 leaves of what L - l0 has lost the square. Where u is longer than r, L itself is
    the more accurate.

    rx, ry, r2: r and its square (m, m^2).
    y: 1/L, 0 for no length (1/m).
    ux, uy: what r has changed by since home (m).
    free: l0 (m).
    excess: L0^2 - l0^2 (m^2).
    """
    x = r2 * y - free
    squares = excess + (ux * (rx + rx - ux) + uy * (ry + ry - uy))
    off = 0.5 * y * (x * (r2 * y + free) - squares)
    return x - where_larger(r2 - (ux * ux + uy * uy), 0.0, off)


@inline
def elongation_of(rx, ry, length, ux, uy, free, excess):
    """`elongation` of one member (m).

    rx, ry: r (m).
    length: L = |r| (m).
    ux, uy: what r has changed by since home (m).
    free: l0 (m).
    excess: L0^2 - l0^2 (m^2).
    """
    u2 = ux * ux + uy * uy
    if u2 < length * length:
        return (excess + (ux * (rx + rx - ux) + uy * (ry + ry - uy))) / (length + free)
    return length - free


@part
def elastic_force(member, width, scale, start, stop, r, close):
    """Sum undamped springs to force and energy at one relative pose.

    member (6 width or more,): rows of `Model.member` behind each other.
    width: of a row.
    scale (stop or more,): k times alpha^mu (N/m).
    start, stop: places of the members, a multiple of the vector's width.
    r (POSE,): relative pose.
    close: whether elongations come from displacements (`is_near`).

    Returns Q (3 numbers; N, N, N m) and E (J).
    """
    sum_x = zero()
    sum_y = zero()
    sum_t = zero()
    energy = zero()
    for i in range(start, stop, lanes()):
        ax, ay, rx, ry, _, y, stretch = seen_members(member, width, i, r, close)
        w = load(scale, i) * stretch
        energy += w * stretch
        w *= y
        sum_x += w * rx
        sum_y += w * ry
        sum_t += w * (ax * ry - ay * rx)
    return -total(sum_x), -total(sum_y), -total(sum_t), 0.5 * total(energy)


@part
def seen_members(member, width, i, r, close):
    """R q, vectors r between the ends, |r|^2, 1/L and elongations Delta of the members from i on, at one pose."""
    u = load(member, 2 * width + i)
    v = load(member, 3 * width + i)
    ax = r[2] * u - r[3] * v
    ay = r[3] * u + r[2] * v
    rx = ax - (load(member, i) - r[0])
    ry = ay - (load(member, width + i) - r[1])
    r2 = rx * rx + ry * ry
    y = inverse_root(r2, ZERO_LENGTH_SQUARED)
    free = load(member, 4 * width + i)
    if close:
        ux = r[10] + (r[12] * u - r[13] * v)
        uy = r[11] + (r[13] * u + r[12] * v)
        stretch = elongation(rx, ry, r2, y, ux, uy, free, load(member, 5 * width + i))
    else:
        stretch = r2 * y - free
    return ax, ay, rx, ry, r2, y, stretch


@part
def elastic_tangent(member, width, scale, start, stop, r, close):
    """Sum undamped springs to force, energy and tangent at one relative pose.

    The lengths of the next members are found while these are summed: one chain of operations from coordinates to sums
    would be longer than a processor looks ahead.

    member (6 width or more,): rows of `Model.member` behind each other.
    width: of a row.
    scale (stop or more,): k times alpha^mu (N/m).
    start, stop: places of the members, a multiple of the vector's width.
    r (POSE,): relative pose.
    close: whether elongations come from displacements (`is_near`).

    Returns Q (3 numbers; N, N, N m), E (J) and the upper triangle xx, xy, yy, xt, yt, tt of K.
    """
    sum_x = zero()
    sum_y = zero()
    sum_t = zero()
    energy = zero()
    sum_w = zero()
    sum_wx = zero()
    sum_wy = zero()
    kxx = zero()
    kxy = zero()
    kyy = zero()
    kxt = zero()
    kyt = zero()
    ktt = zero()
    last = stop - lanes()
    ax, ay, rx, ry, _, y, stretch = seen_members(member, width, start, r, close)
    for i in range(start, stop, lanes()):
        following = seen_members(member, width, min(i + lanes(), last), r, close)
        stiffness = load(scale, i)
        w = stiffness * stretch
        energy += w * stretch
        w *= y
        t = ax * ry - ay * rx
        sum_x += w * rx
        sum_y += w * ry
        sum_t += w * t
        g = (stiffness - w) * (y * y)
        gx = g * rx
        gy = g * ry
        kxx += gx * rx
        kxy += gx * ry
        kyy += gy * ry
        kxt += gx * t
        kyt += gy * t
        sum_w += w
        sum_wx += w * ax
        sum_wy += w * ay
        ktt += g * (t * t) - w * (ax * (rx - ax) + ay * (ry - ay))
        ax, ay, rx, ry, _, y, stretch = following
    return (
        -total(sum_x),
        -total(sum_y),
        -total(sum_t),
        0.5 * total(energy),
        *upper_triangle(kxx, kxy, kyy, kxt, kyt, ktt, sum_w, sum_wx, sum_wy),
    )


@member_kernel
def viscous_force(px, py, qx, qy, l0, excess, k, damping, preload, r):
    """Sum a tile of springs with damping or preload to force and energy at one relative pose.

    px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
    l0 (n,): free lengths (m).
    excess (n,): L0^2 - l0^2 (m^2).
    k, damping, preload (n,): times alpha^mu (N/m, N s/m, N).
    r (POSE,): relative pose.

    Returns Q (3 numbers; N, N, N m), E (J) and E_xi (3 numbers).
    """
    sum_x = 0.0
    sum_y = 0.0
    sum_t = 0.0
    energy = 0.0
    ex = 0.0
    ey = 0.0
    et = 0.0
    for i in range(k.shape[0]):
        ax = r[2] * qx[i] - r[3] * qy[i]
        ay = r[3] * qx[i] + r[2] * qy[i]
        rx = r[0] + ax - px[i]
        ry = r[1] + ay - py[i]
        r2 = rx * rx + ry * ry
        y = _inverse_length(r2)
        ux = r[10] + (r[12] * qx[i] - r[13] * qy[i])
        uy = r[11] + (r[13] * qx[i] + r[12] * qy[i])
        stretch = _elongation(rx, ry, r2, y, ux, uy, l0[i], excess[i])
        t = ax * ry - ay * rx
        rate = y * (rx * r[4] + ry * r[5] + t * r[6])
        w = k[i] * stretch
        energy += w * stretch
        f = y * (w + damping[i] * rate + preload[i])
        w *= y
        sum_x += f * rx
        sum_y += f * ry
        sum_t += f * t
        ex += w * rx
        ey += w * ry
        et += w * t
    return -sum_x, -sum_y, -sum_t, 0.5 * energy, ex, ey, et


@member_kernel
def viscous_tangent(px, py, qx, qy, l0, excess, k, damping, preload, r):
    """Sum a tile of springs with damping or preload to force, energy and tangents at one relative pose.

    px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
    l0 (n,): free lengths (m).
    excess (n,): L0^2 - l0^2 (m^2).
    k, damping, preload (n,): times alpha^mu (N/m, N s/m, N).
    r (POSE,): relative pose.

    Returns Q (3 numbers; N, N, N m), E (J), E_xi (3), K (9, by rows) and the upper triangle xx, xy, yy, xt, yt, tt
    of C.
    """
    vx = r[4]
    vy = r[5]
    vt = r[6]
    sum_x = 0.0
    sum_y = 0.0
    sum_t = 0.0
    energy = 0.0
    ex = 0.0
    ey = 0.0
    et = 0.0
    kxx = 0.0
    kxy = 0.0
    kxt = 0.0
    kyx = 0.0
    kyy = 0.0
    kyt = 0.0
    ktx = 0.0
    kty = 0.0
    ktt = 0.0
    cxx = 0.0
    cxy = 0.0
    cyy = 0.0
    cxt = 0.0
    cyt = 0.0
    ctt = 0.0
    for i in range(k.shape[0]):
        ax = r[2] * qx[i] - r[3] * qy[i]
        ay = r[3] * qx[i] + r[2] * qy[i]
        rx = r[0] + ax - px[i]
        ry = r[1] + ay - py[i]
        r2 = rx * rx + ry * ry
        y = _inverse_length(r2)
        ux = r[10] + (r[12] * qx[i] - r[13] * qy[i])
        uy = r[11] + (r[13] * qx[i] + r[12] * qy[i])
        stretch = _elongation(rx, ry, r2, y, ux, uy, l0[i], excess[i])
        bx = y * rx
        by = y * ry
        bt = ax * by - ay * bx
        rate = bx * vx + by * vy + bt * vt
        elastic = k[i] * stretch
        energy += elastic * stretch
        f = elastic + damping[i] * rate + preload[i]
        sum_x += f * bx
        sum_y += f * by
        sum_t += f * bt
        ex += elastic * bx
        ey += elastic * by
        et += elastic * bt
        hxx = y * (1.0 - bx * bx)
        hxy = -y * bx * by
        hyy = y * (1.0 - by * by)
        hxt = -y * (ay + bx * bt)
        hyt = y * (ax - by * bt)
        htt = y * (ax * ax + ay * ay - bt * bt) - (bx * ax + by * ay)
        # the row that multiplies delta xi in delta f
        fx = k[i] * bx + damping[i] * (hxx * vx + hxy * vy + hxt * vt)
        fy = k[i] * by + damping[i] * (hxy * vx + hyy * vy + hyt * vt)
        ft = k[i] * bt + damping[i] * (hxt * vx + hyt * vy + htt * vt)
        kxx += bx * fx + f * hxx
        kxy += bx * fy + f * hxy
        kxt += bx * ft + f * hxt
        kyx += by * fx + f * hxy
        kyy += by * fy + f * hyy
        kyt += by * ft + f * hyt
        ktx += bt * fx + f * hxt
        kty += bt * fy + f * hyt
        ktt += bt * ft + f * htt
        cx = damping[i] * bx
        cy = damping[i] * by
        cxx += cx * bx
        cxy += cx * by
        cyy += cy * by
        cxt += cx * bt
        cyt += cy * bt
        ctt += damping[i] * bt * bt
    return (
        -sum_x,
        -sum_y,
        -sum_t,
        0.5 * energy,
        ex,
        ey,
        et,
        kxx,
        kxy,
        kxt,
        kyx,
        kyy,
        kyt,
        ktx,
        kty,
        ktt,
        cxx,
        cxy,
        cyy,
        cxt,
        cyt,
        ctt,
    )


@kernel
def elastic_design(px, py, qx, qy, l0, excess, k, pose, u, out):
    """Add sum_j f (b . u_j) over m relative poses to each undamped spring.

    In:
      px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
      l0 (n,): free lengths (m).
      excess (n,): L0^2 - l0^2 (m^2).
      k (n,): stiffness at alpha = 1 (N/m).
      pose (m, POSE): relative poses.
      u (m, 3): virtual changes of these.
    Out:
      out (n,): added to.
    """
    for i in range(0, k.shape[0], lanes()):
        x = load(px, i)
        y = load(py, i)
        v = load(qx, i)
        w = load(qy, i)
        free = load(l0, i)
        more = load(excess, i)
        work = zero()
        for j in range(pose.shape[0]):
            work += elastic_work(x, y, v, w, free, more, pose[j], u[j])
        store(out, i, load(out, i) + load(k, i) * work)


@kernel
def elastic_work(x, y, v, w, free, excess, pose, u):
    """Delta (b . u) of some members at one pose, in vectors: the work of their forces at k = 1.

    x, y, v, w: points P = (x, y) and Q = (v, w) (m).
    free, excess: l0 (m) and L0^2 - l0^2 (m^2).
    pose (POSE,): relative pose.
    u (3,): virtual change of it.
    """
    force, rx, ry, moment = elastic_parts(x, y, v, w, free, excess, pose)
    return force * (rx * u[0] + ry * u[1] + moment * u[2])


@kernel
def elastic_parts(x, y, v, w, free, excess, pose):
    """What `elastic_work` is made of: Delta/L and L b, with which it is Delta/L (L b . u), in vectors.

    x, y, v, w: points P = (x, y) and Q = (v, w) (m).
    free, excess: l0 (m) and L0^2 - l0^2 (m^2).
    pose (POSE,): relative pose.

    Returns Delta/L and the three entries of L b.
    """
    c = pose[2]
    s = pose[3]
    ax = c * v - s * w
    ay = s * v + c * w
    rx = ax - (x - pose[0])
    ry = ay - (y - pose[1])
    r2 = rx * rx + ry * ry
    z = inverse_root(r2, ZERO_LENGTH_SQUARED)
    ux = pose[10] + (pose[12] * v - pose[13] * w)
    uy = pose[11] + (pose[13] * v + pose[12] * w)
    return elongation(rx, ry, r2, z, ux, uy, free, excess) * z, rx, ry, ax * ry - ay * rx


@member_kernel
def viscous_design(px, py, qx, qy, l0, excess, k, damping, preload, r, u, out):
    """Add f (b . u) at one relative pose to each spring with damping or preload.

    In:
      px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
      l0 (n,): free lengths (m).
      excess (n,): L0^2 - l0^2 (m^2).
      k, damping, preload (n,): at alpha = 1 (N/m, N s/m, N).
      r (POSE,): relative pose.
      u (3,): virtual change of it.
    Out:
      out (n,): added to.
    """
    dx = r[0]
    dy = r[1]
    c = r[2]
    s = r[3]
    sx = r[10]
    sy = r[11]
    sc = r[12]
    ss = r[13]
    vx = r[4]
    vy = r[5]
    vt = r[6]
    zx = u[0]
    zy = u[1]
    zt = u[2]
    for i in range(k.shape[0]):
        ax = c * qx[i] - s * qy[i]
        ay = s * qx[i] + c * qy[i]
        rx = dx + ax - px[i]
        ry = dy + ay - py[i]
        r2 = rx * rx + ry * ry
        y = _inverse_length(r2)
        ux = sx + (sc * qx[i] - ss * qy[i])
        uy = sy + (ss * qx[i] + sc * qy[i])
        stretch = _elongation(rx, ry, r2, y, ux, uy, l0[i], excess[i])
        t = ax * ry - ay * rx
        rate = y * (rx * vx + ry * vy + t * vt)
        f = k[i] * stretch + damping[i] * rate + preload[i]
        out[i] += f * y * (rx * zx + ry * zy + t * zt)


@member_kernel
def stored_energy(px, py, qx, qy, l0, excess, k, r, weight, out):
    """Add weight V, V = k Delta^2/2, at one relative pose to each spring.

    In:
      px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
      l0 (n,): free lengths (m).
      excess (n,): L0^2 - l0^2 (m^2).
      k (n,): stiffness at alpha = 1 (N/m).
      r (POSE,): relative pose.
      weight: of the energy.
    Out:
      out (n,): added to.
    """
    dx = r[0]
    dy = r[1]
    c = r[2]
    s = r[3]
    sx = r[10]
    sy = r[11]
    sc = r[12]
    ss = r[13]
    for i in range(k.shape[0]):
        rx = dx + c * qx[i] - s * qy[i] - px[i]
        ry = dy + s * qx[i] + c * qy[i] - py[i]
        r2 = rx * rx + ry * ry
        y = _inverse_length(r2)
        ux = sx + (sc * qx[i] - ss * qy[i])
        uy = sy + (ss * qx[i] + sc * qy[i])
        stretch = _elongation(rx, ry, r2, y, ux, uy, l0[i], excess[i])
        out[i] += weight * 0.5 * k[i] * stretch * stretch


@kernel
def shortest_in(px, py, qx, qy, dx, dy, c, s):
    """Smallest length in the tile (m).

    px, py, qx, qy (n,): points P and Q in the frames of their bodies (m), n a multiple of the vector's width.
    dx, dy: d of the relative pose (m).
    c, s: cosine and sine of theta.
    """
    found = zero() - np.inf
    for i in range(0, px.shape[0], lanes()):
        u = load(qx, i)
        v = load(qy, i)
        rx = c * u - s * v - (load(px, i) - dx)
        ry = s * u + c * v - (load(py, i) - dy)
        found = larger(zero() - (rx * rx + ry * ry), found)
    return math.sqrt(-largest(found))


@kernel
def meeting_in(px, py, qx, qy, l0, k, preload, before, after):
    """First member that carries a force and whose ends meet between two relative poses; else -1.

    px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
    l0 (n,): free lengths (m).
    k, preload (n,): times alpha^mu (N/m, N).
    before, after (POSE,): relative poses, between which ends move along straight lines.
    """
    for i in range(px.shape[0]):
        if k[i] * l0[i] == preload[i]:
            continue  # at zero length it carries nothing
        rx = before[0] + before[2] * qx[i] - before[3] * qy[i] - px[i]
        ry = before[1] + before[3] * qx[i] + before[2] * qy[i] - py[i]
        ux = after[0] + after[2] * qx[i] - after[3] * qy[i] - px[i] - rx
        uy = after[1] + after[3] * qx[i] + after[2] * qy[i] - py[i] - ry
        u2 = ux * ux + uy * uy
        along = -(rx * ux + ry * uy)
        across = rx * uy - ry * ux
        if rx * rx + ry * ry <= ZERO_LENGTH_SQUARED:
            return i
        if u2 > 0.0 and 0.0 <= along <= u2 and across * across <= 1e-18 * u2 * u2:
            return i
    return -1


@kernel
def passing_in(px, py, qx, qy, l0, k, preload, before, after, least):
    """The first member whose two ends pass by each other between two relative poses, at a distance much smaller than
    the one that they move, while it carries a force; -1 where there is none.

    px, py, qx, qy (n,): points P and Q in the frames of their bodies (m).
    l0 (n,): free lengths (m).
    k, preload (n,): times alpha^mu (N/m, N).
    before, after (POSE,): relative poses, between which ends move along straight lines.
    least: what the force at no length has to exceed, for each metre that the ends move (N/m).
    """
    for i in range(px.shape[0]):
        rx = before[0] + before[2] * qx[i] - before[3] * qy[i] - px[i]
        ry = before[1] + before[3] * qx[i] + before[2] * qy[i] - py[i]
        ux = after[0] + after[2] * qx[i] - after[3] * qy[i] - px[i] - rx
        uy = after[1] + after[3] * qx[i] + after[2] * qy[i] - py[i] - ry
        u2 = ux * ux + uy * uy
        along = -(rx * ux + ry * uy)
        across = rx * uy - ry * ux
        passes = u2 > 0.0 and 0.0 <= along <= u2 and across * across <= 0.01 * u2 * u2
        if passes and abs(k[i] * l0[i] - preload[i]) > least * math.sqrt(u2):
            return i
    return -1
