"""The passes over members that join every point of one grid with every point of another, tile by tile.

A tile has some rows and some columns, few enough that its numbers stay in the first-level cache while several poses
pass over them. Sums are added tile by tile, in order.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes
from mdstopo.mechanics.laws.spring import is_near
from mdstopo.mechanics.laws.spring_grid import grid_design, grid_force, grid_tangent
from mdstopo.mechanics.laws.sums import add_forces, add_tangent
from mdstopo.scene.springs_model import DESIGN, EXCESS, L0, PAIR, PX, PY, QX, QY, ROWS, STIFFNESS, TILE, WIDTH

#: places of a tile: of each it reads two numbers, where `passes` reads six
PLACES = 4 * TILE


@kernel
def tile_of(rows, width):
    """Rows and columns of a tile, of a grid with so many rows, each of so many places."""
    tall = rows if rows * width <= PLACES else min(rows, ROWS)
    return tall, min(width, PLACES // tall // lanes() * lanes())


@part
def sum_grid(k, start, stop, block, near, member, stiffness, rel, m, tangent, sums, column):
    """Add the sums over the members in places start to stop of block k, which is a grid.

    In:
      k: number of the block.
      start, stop: places in the padded arrays, beginning with a row of the grid; what is behind the last whole row is
        left out.
      block (n_block, BLOCK), member (MEMBER, M_padded): as of `Model`.
      near (2,): the block's row of `Model.near`.
      stiffness (M_padded,): times alpha^mu (N/m).
      rel (m or more, n_pair, POSE): relative poses.
      m: how many of them.
      tangent: whether K is wanted.
      column: where in the second axis of sums the block's pair is.
    Out:
      sums (m or more, columns, SUMS): added to.
    """
    p = block[k, PAIR]
    width = block[k, WIDTH]
    counted = block[k, DESIGN] >= 0
    rows = (stop - start) // width
    tall, wide = tile_of(rows, width)
    room = np.empty((tall, 2))
    for row in range(0, rows, tall):
        lo = start + row * width
        hi = start + min(row + tall, rows) * width
        px = member[PX, lo:hi]
        py = member[PY, lo:hi]
        qx = member[QX, lo:hi]
        qy = member[QY, lo:hi]
        l0 = member[L0, lo:hi]
        excess = member[EXCESS, lo:hi]
        ks = stiffness[lo:hi]
        own = room[: (hi - lo) // width]
        for first in range(0, width, wide):
            last = min(first + wide, width)
            for j in range(m):
                r = rel[j, p]
                o = sums[j, column]
                close = is_near(r, near)
                if tangent:
                    found = grid_tangent(px, py, qx, qy, l0, excess, ks, width, first, last, r, close, own)
                    add_forces(found[:4], counted, o)
                    add_tangent(found[4:], o)
                else:
                    found_force = grid_force(px, py, qx, qy, l0, excess, ks, width, first, last, r, close, own)
                    add_forces(found_force, counted, o)


@part
def design_grid(start, stop, width, near, member, pose, u, weight, out):
    """Add f (b . u) at the first poses and weight V at the others for the members in places start to stop of a grid.

    In:
      start, stop: places in the padded arrays, beginning with a row of the grid; what is behind the last whole row is
        left out.
      width: places in a row.
      near (2,): the block's row of `Model.near`.
      member (MEMBER, M_padded): as of `Model`, of which stiffness counts at alpha = 1 (N/m).
      pose (S + E, POSE): relative poses of the block's pair.
      u (S, 3): virtual changes of the first ones.
      weight (E,): of the stored energies V at the others.
    Out:
      out (M_padded,): added to.
    """
    rows = (stop - start) // width
    tall, wide = tile_of(rows, width)
    room = np.empty((tall, pose.shape[0], 4))
    turned = np.empty((pose.shape[0], 5, lanes()))
    close = np.empty(pose.shape[0], np.bool_)
    for j in range(pose.shape[0]):
        close[j] = is_near(pose[j], near)
    for row in range(0, rows, tall):
        lo = start + row * width
        hi = start + min(row + tall, rows) * width
        own = room[: (hi - lo) // width]
        for first in range(0, width, wide):
            grid_design(
                member[PX, lo:hi], member[PY, lo:hi], member[QX, lo:hi], member[QY, lo:hi], member[L0, lo:hi],
                member[EXCESS, lo:hi], member[STIFFNESS, lo:hi], width, first, min(first + wide, width),
                pose, close, u, weight, own, turned, out[lo:hi],
            )  # fmt: skip
