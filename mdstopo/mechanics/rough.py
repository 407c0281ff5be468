"""Forces and tangents in single precision, for a first correction that a second one follows.

Twice as many members fit in a vector, and a root needs fewer terms. What is lost is some 1e-7 of the members' lengths,
so it serves where bodies move by much more than that. Grids of undamped springs only, few enough for one thread.
"""

import numpy as np

from mdstopo.jit import kernel, member_kernel, part
from mdstopo.mechanics.assembly import place_bodies, sum_bodies
from mdstopo.mechanics.grids import tile_of
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.mechanics.laws.spring_grid import add_column, add_member, begin_rows, columns, no_columns, no_members
from mdstopo.mechanics.laws.sums import add_tangent
from mdstopo.mechanics.passes import springs_of
from mdstopo.native.vector import inverse_root, lanes_of, load, zero_of


@kernel
def may_be_rough(model):  # type: ignore[no-untyped-def]
    """Whether all members lie in grids, and there are few."""
    found = model.threads == 0
    for k in range(model.block.shape[0]):
        found = found and model.block[k, 6] > 0
    return found


@member_kernel
def shorten(source, target):  # type: ignore[no-untyped-def]
    """target = source in single precision, zeros behind it."""
    n = source.shape[0]
    for i in range(n):
        target[i] = source[i]
    for i in range(n, target.shape[0]):
        target[i] = 0.0


@kernel
def _seen(ax, ay, room, j):  # type: ignore[no-untyped-def]
    """r and 1/L of the members of row j."""
    rx = ax + room[j, 0]
    ry = ay + room[j, 1]
    return rx, ry, inverse_root(rx * rx + ry * ry, ZERO_LENGTH_SQUARED)


@part
def _tangent(px, py, qx, qy, kl, k, width, dx, dy, c, s, room):  # type: ignore[no-untyped-def]
    """As `spring_grid.grid_tangent`, of k and k l0, without E: with u = k l0/L they are w = k - u and g = u/L^2."""
    rows = room.shape[0]
    begin_rows(px, py, width, dx, dy, room)
    nothing = zero_of(k)
    sums = no_columns(nothing)
    for i in range(0, width, lanes_of(k)):
        p = load(qx, i)
        q = load(qy, i)
        ax = c * p - s * q
        ay = s * p + c * q
        own = no_members(nothing)
        at = i
        rx, ry, y = _seen(ax, ay, room, np.int64(0))
        for j in range(rows):
            following = _seen(ax, ay, room, min(j + 1, rows - 1))
            u = load(kl, at) * y
            w = load(k, at) - u
            own = add_member(own, rx, ry, w, u * (y * y))
            at += width
            rx, ry, y = following
        sums = add_column(sums, ax, ay, own)
    return columns(sums)


@part
def rough_sums(springs, strength, rel, m, sums):  # type: ignore[no-untyped-def]
    """As `passes.member_sums` with tangents, of grids alone; without energies and their slopes."""
    block = springs.block
    sums[:m] = 0.0
    for k in range(block.shape[0]):
        width = block[k, 6]
        tall, wide = tile_of((block[k, 2] - block[k, 1]) // width, width)
        room = np.empty((tall, 2), np.float32)
        some = lanes_of(room[0])
        own = np.empty((6, tall, (wide + some - 1) // some * some), np.float32)
        _sum_roughly(k, wide, block, springs.member, strength[0], rel, m, sums, room, own)


@part
def _sum_roughly(k, wide, block, member, stiffness, rel, m, sums, room, own):  # type: ignore[no-untyped-def]
    """Add block k to sums, tile by tile; own (6, rows, columns): the members of a tile."""
    p = block[k, 0]
    width = block[k, 6]
    tall = own.shape[1]
    places = own.shape[2]
    flat = own.reshape((6, tall * places))
    for start in range(block[k, 1], block[k, 2], tall * width):
        rows = min(tall, (block[k, 2] - start) // width)
        for first in range(0, width, wide):
            last = min(first + wide, width)
            for j in range(rows):
                at = start + j * width
                own[0, j, 0] = member[0, at]
                own[1, j, 0] = member[1, at]
                shorten(stiffness[at + first : at + last], own[5, j])
                shorten(member[4, at + first : at + last], own[4, j])
                for i in range(places):
                    own[4, j, i] *= own[5, j, i]
            shorten(member[2, start + first : start + last], own[2, 0])
            shorten(member[3, start + first : start + last], own[3, 0])
            for j in range(m):
                r = rel[j, p]
                force, tangent = _tangent(
                    flat[0], flat[1], flat[2], flat[3], flat[4], flat[5], places, r[0], r[1], r[2], r[3], room[:rows]
                )
                o = sums[j, p]
                for axis in range(3):
                    o[axis] += force[axis]
                add_tangent(tangent, o)


@part
def rough_forces(model, strength, segment, m, t, q, v, rel, sums, f, k_out, c_out, turn):  # type: ignore[no-untyped-def]
    """As `assembly.forces` with tangents, where `may_be_rough`; whether the forces are numbers."""
    place_bodies(model.pair, q, v, m, rel)
    rough_sums(springs_of(model), strength, rel, m, sums)
    sum_bodies(model, segment, m, t, q, np.bool_(True), np.bool_(False), rel, sums, f, k_out, c_out, turn)
    lost = 0.0
    for j in range(m):
        for d in range(q.shape[1]):
            lost += f[j, d] - f[j, d]
    return lost == 0.0
