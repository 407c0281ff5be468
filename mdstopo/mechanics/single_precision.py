"""Forces and tangents in single precision, for a first correction that a second one follows.

Twice as many members fit in a vector, and a root needs fewer terms. What is lost is some 1e-7 of the members' lengths,
so it serves where bodies move by much more than that. Grids of undamped springs only, few enough for one thread.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import WIDE, inverse_root, lanes, lanes_of, load, store, zero, zero_of
from mdstopo.mechanics.assembly import place_bodies, sum_bodies
from mdstopo.mechanics.grids import tile_of
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.mechanics.laws.spring_grid import (
    add_column,
    add_member,
    begin_rows,
    force_and_tangent,
    no_columns,
    no_members,
    turned_columns,
)
from mdstopo.mechanics.laws.sums import add_tangent
from mdstopo.mechanics.passes import springs_of
from mdstopo.scene.model import L0, PX, PY, START, STOP, WIDTH


@kernel
def may_use_single_precision(model):
    """Whether all members lie in grids, and there are few."""
    found = model.threads == 0
    for k in range(model.block.shape[0]):
        found = found and model.block[k, WIDTH] > 0
    return found


@kernel
def _seen(ax, ay, room, j):
    """r and 1/L of the members of row j."""
    rx = ax + room[j, 0]
    ry = ay + room[j, 1]
    return rx, ry, inverse_root(rx * rx + ry * ry, ZERO_LENGTH_SQUARED)


@part
def _tangent(qx, qy, k, kl, room, c, s):
    """Q and the upper triangle of K of a tile in single precision, as in `spring_grid.grid_tangent`.

    With u = k l0/L they are sums of w = k - u and g = u.

    In:
      qx, qy (columns,): points Q of the columns (m).
      k, kl (rows, columns): stiffness times alpha^mu (N/m), and that times the free length (N).
      room (rows, 2): e of each row, d less its point P (m).
      c, s: cosine and sine of theta.
    """
    rows, width = k.shape
    k = k.reshape(rows * width)
    kl = kl.reshape(rows * width)
    some = lanes_of(k)
    nothing = zero_of(k)
    sums = no_columns(nothing)
    ax, ay = turned_columns(qx, qy, np.int64(0), c, s)
    seen = _seen(ax, ay, room, np.int64(0))
    for i in range(0, width, some):
        bx, by = turned_columns(qx, qy, min(i + some, width - some), c, s)
        own = no_members(nothing)
        at = i
        for j in range(1, rows):
            following = _seen(ax, ay, room, j)
            own = _add(own, seen, load(k, at), load(kl, at))
            at += width
            seen = following
        following = _seen(bx, by, room, np.int64(0))
        own = _add(own, seen, load(k, at), load(kl, at))
        seen = following
        sums = add_column(sums, ax, ay, own)
        ax = bx
        ay = by
    return force_and_tangent(sums)


@part
def _add(own, seen, k, kl):
    """The sums of a column with a member more."""
    rx, ry, y = seen
    u = kl * y
    return add_member(own, rx, ry, y, k - u, u)


@part
def single_precision_sums(springs, strength, rel, m, sums):
    """As `passes.member_sums` with tangents, of grids alone; without energies and their slopes."""
    block = springs.block
    sums[:m] = 0.0
    for k in range(block.shape[0]):
        width = block[k, WIDTH]
        tall, wide = tile_of((block[k, STOP] - block[k, START]) // width, width)
        room = np.empty((tall, 2), np.float32)
        own = _aligned_rows(2 * tall + 2, wide)
        _sum_in_single_precision(block[k], wide, springs.member, strength[0], rel, m, sums, room, own[2:], own[:2])


@part
def _aligned_rows(count, width):
    """Room for rows of whole vectors in single precision, each on a line of the cache."""
    some = 2 * WIDE
    width = (width + some - 1) // some * some
    room = np.empty(count * width + some, np.float32)
    first = -(room.ctypes.data // room.itemsize) % some
    return room[first : first + count * width].reshape((count, width))


@part
def _sum_in_single_precision(block, wide, member, stiffness, rel, m, sums, room, own, q):
    """Add the sums over a grid in single precision, tile by tile.

    In:
      block (BLOCK,): the block's row of `Model.block`.
      wide: columns of a tile.
      member (MEMBER, M_padded): as of `Model`.
      stiffness (M_padded,): times alpha^mu (N/m).
      rel (m or more, n_pair, POSE): relative poses.
      m: how many of them.
    Out:
      sums (m or more, n_pair, SUMS): added to.
    Room:
      room (tall, 2): e of the rows of a tile, of which there are at most `tall`.
      own (2 tall, wide or more): a tile's stiffness, then that times the free length.
      q (2, wide or more): points Q of a tile's columns.
    """
    p = block[0]
    width = block[6]
    tall = own.shape[0] // 2
    whole = (block[2] - block[1]) // width
    for row in range(0, whole, tall):
        start = block[1] + row * width
        rows = min(tall, whole - row)
        for first in range(0, width, wide):
            count = min(wide, width - first)
            for axis in range(2):
                at = start + first
                _shorten(member[2 + axis, at : at + count], q[axis])
            for j in range(rows):
                at = start + j * width + first
                _shorten_products(stiffness[at : at + count], member[L0, at : at + count], own[j], own[tall + j])
            for j in range(m):
                r = rel[j, p]
                begin_rows(member[PX, start:], member[PY, start:], width, r[0], r[1], room[:rows])
                force, tangent = _tangent(q[0], q[1], own[:rows], own[tall : tall + rows], room[:rows], r[2], r[3])
                o = sums[j, p]
                for axis in range(3):
                    o[axis] += force[axis]
                add_tangent(tangent, o)


@part
def _shorten(source, target):
    """target = source in single precision, zeros behind it."""
    for i in range(0, target.shape[0], lanes()):
        store(target, i, load(source, i) if i < source.shape[0] else zero())


@part
def _shorten_products(k, l0, own, product):
    """own, product = k, k l0 in single precision, zeros behind them."""
    for i in range(0, own.shape[0], lanes()):
        stiffness = load(k, i) if i < k.shape[0] else zero()
        store(own, i, stiffness)
        store(product, i, stiffness * load(l0, i) if i < k.shape[0] else stiffness)


@part
def single_precision_forces(model, strength, segment, m, t, q, v, rel, sums, f, k_out, c_out, turn):
    """Generalised forces on the bodies and their tangents at m states, in single precision, where
    `may_use_single_precision`.

    Constant:
      model: the compiled scene.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      segment: of the loads, for all m times.
      m: how many states.
      t (m or more,): times (s).
      q, v (m or more, n): coordinates and velocities (m, rad; m/s, rad/s).
    Out:
      rel (m or more, n_pair, POSE): relative poses.
      sums (m or more, n_pair, SUMS): of the members, without energies.
      f (m or more, n): forces and moments on the coordinates (N, N m).
      k_out (m or more, n_pair, 6, 6): -dF/dq of each pair.
      c_out (m or more, n_pair, 6, 6): left as it is: nothing is damped.
      turn (m or more, n): derivative of the loads by the angle of their body, if loads turn.

    Returns whether all forces are finite.
    """
    place_bodies(model.pair, model.home, q, v, m, rel)
    single_precision_sums(springs_of(model), strength, rel, m, sums)
    sum_bodies(model, segment, m, t, q, np.bool_(True), np.bool_(False), rel, sums, f, k_out, c_out, turn)
    lost = 0.0
    for j in range(m):
        for d in range(q.shape[1]):
            lost += f[j, d] - f[j, d]
    return lost == 0.0
