"""Prices of the candidates of a tile from those of a few of them.

The price of a candidate is smooth in where its two ends are, as long as neither its length nor a kink of its law comes
into it. On a dense grid the ends of a tile's candidates are near each other, so that prices are all but polynomials of
low degree in the numbers of the two points. So a part of a tile is priced at ROW_NODES by COLUMN_NODES candidates near
the extremes of Chebyshev polynomials, its corners among them. Where the last coefficient of the series through these is
below the error that is allowed, and the one before it not far above, in either direction, all others are what the
polynomial says. Where those by the columns are larger, the part is halved; where those by the rows are, more rows are
tried, and then every row is priced at the nodes of the columns. What remains is priced one by one.

A kernel that prices members is told here which candidates to price next (`next_candidates`), and gives their prices
back (`take_prices`).
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import WIDE, inverse_root, lanes, load, store, zero
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: rows and columns of a tile, and its places
TALL, BROAD = 16, 128
PLACES = TALL * BROAD
#: candidates of a part of a tile that are priced, by columns and by rows: of these so many are tried, then so many,
#: then all
COLUMN_NODES = 8
ROW_NODES: IndexArray = np.array([6, 9], dtype=np.int64)
MOST_ROW_NODES = 9
ALL_ROWS = 2
#: how often a tile is halved, and one more; columns of the smallest parts, and how many there are in a tile
LEVELS = 4
SHORT = BROAD >> (LEVELS - 1)
PARTS = BROAD // SHORT
#: from how many members others may follow; members that the model holds for a tile: all of it twice, and these
MOST_FEW = TALL * COLUMN_NODES
ROOM = 2 * PLACES + MOST_FEW
#: by so much the last coefficient falls where a part is halved
FALLS = 2.0 ** (COLUMN_NODES - 1)
#: the last coefficient but one may be so many times what is allowed: the next ones fall at least as fast as that
BEFORE_LAST = 64.0
#: of a plan: the level; the first column of the part, how many columns it has; which number of rows is tried (of
#: ROW_NODES, or ALL_ROWS); rows and columns of the next candidates; how many prices have been computed; which number of
#: rows is tried first, as fewer have not been enough in the tile; the part whose columns' shares are in the buffer
LEVEL, BEGIN, SIZE, TRIED_ROWS, ROWS, COLUMNS, PRICED, FIRST_ROWS, SHARES = range(9)
PLAN = 9
#: the level of a part that has its prices
DONE = -1


def _extremes(size: int, count: int) -> list[int]:
    """Of so many numbers those nearest to the extremes of a Chebyshev polynomial, the first and the last among them."""
    return [round((size - 1) * 0.5 * (1.0 - math.cos(math.pi * k / (count - 1)))) for k in range(count)]


#: the nodes of a tile's rows, and of its columns at each level
ROW_NODE: IndexArray = np.zeros((ALL_ROWS, MOST_ROW_NODES), dtype=np.int64)
for _k, _count in enumerate(ROW_NODES.tolist()):
    ROW_NODE[_k, :_count] = _extremes(TALL, _count)
COLUMN_NODE: IndexArray = np.array([_extremes(BROAD >> level, COLUMN_NODES) for level in range(LEVELS)], dtype=np.int64)


def smooth_parts(points: FloatArray, numbers: FloatArray, size: int, nodes: IndexArray) -> IndexArray:
    """Of every part of a grid of so many points whether their places are polynomials of their numbers, to rounding.

    points (n, d): the grid. numbers (n,): of the points, increasing. size: of a part. nodes: of a part.

    Returns (n // size,): 1 where they are, else 0.
    """
    count = len(points) // size
    found = np.zeros(count, dtype=np.int64)
    allowed = 1e-14 * float(np.abs(points).max(initial=0.0))
    chunk = max(1, 200_000 // size)
    for first in range(0, count, chunk):
        part = slice(first * size, min(first + chunk, count) * size)
        t = numbers[part].reshape(-1, size)
        t = (2.0 * t - t[:, :1] - t[:, -1:]) / (t[:, -1:] - t[:, :1])
        at = t[:, nodes]
        weight = np.ones((*t.shape, len(nodes)))
        for k in range(len(nodes)):
            for j in range(len(nodes)):
                if j != k:
                    weight[:, :, k] *= (t - at[:, j, None]) / (at[:, k] - at[:, j])[:, None]
        own = points[part].reshape(-1, size, points.shape[1])
        off = np.abs(np.einsum("isk,ikd->isd", weight, own[:, nodes]) - own)
        found[first : first + len(t)] = off.max(axis=(1, 2)) <= allowed
    return found


def smoothness(
    grids: tuple[FloatArray, FloatArray], chosen: tuple[IndexArray, IndexArray]
) -> tuple[FloatArray, FloatArray, IndexArray, IndexArray]:
    """What `next_candidates` and `take_prices` know of two grids.

    grids: the points that are priced, (n_A, d) and (n_B, d). chosen: their numbers among all of the grid.

    Returns the numbers (n_A,), (n_B,), and whether parts are smooth: (n_A // TALL,) of rows, (LEVELS, n_B // SHORT) of
    columns, of each level for a part that begins there.
    """
    first, second = (np.asarray(each, dtype=np.float64) for each in chosen)
    by_rows = smooth_parts(grids[0], first, TALL, ROW_NODE[0, : ROW_NODES[0]])
    by_columns = np.zeros((LEVELS, len(second) // SHORT), dtype=np.int64)
    for level in range(LEVELS):
        size = BROAD >> level
        own = smooth_parts(grids[1], second, size, COLUMN_NODE[level])
        by_columns[level, : len(own) * (size // SHORT) : size // SHORT] = own
    return first, second, by_rows, by_columns


@part
def extent(grids, i, j):
    """Rows and columns that the tile j of strip i has."""
    return min(TALL, grids[0].shape[0] - i * TALL), min(BROAD, grids[1].shape[0] - j * BROAD)


@part
def make_scratch():
    """What pricing of a tile needs: plan, level, rows, columns, index (2, PLACES), found (PLACES,), buffer."""
    return (
        np.zeros(PLAN, np.int64),
        np.zeros(PARTS, np.int64),
        np.zeros(TALL, np.int64),
        np.zeros(BROAD, np.int64),
        np.zeros((2, PLACES), np.int64),
        np.zeros(PLACES),
        np.zeros((COLUMN_NODES + TALL, BROAD)),
    )


@part
def found_prices(scratch):
    """Where the prices are put of the candidates that `next_candidates` has told: found (PLACES,) of `make_scratch`."""
    _, _, _, _, _, found, _ = scratch
    return found


@kernel
def begin_tile(error, scratch):
    """Begin a tile.

    error: that a price may have; 0: all are computed. scratch: of `make_scratch`; plan and level are set.
    """
    plan, level = scratch[:2]
    plan[:] = 0
    level[:] = 0 if error > 0.0 else LEVELS


@kernel
def begin_part(level, at, scratch):
    """Begin a part of a tile, which has so many columns as the level says: the others have their prices.

    level, at: its level, and the number of its first column. scratch: of `make_scratch`; plan and level are set,
      but for what the plan knows of parts before.
    """
    plan, own = scratch[:2]
    plan[:FIRST_ROWS] = 0
    plan[TRIED_ROWS] = plan[FIRST_ROWS]
    plan[LEVEL] = level
    own[:] = DONE
    _put_off(own, at // SHORT, BROAD >> level, level)


@kernel
def next_candidates(grids, i, j, scratch):
    """The next candidates of a tile whose prices are wanted, each of some rows with each of some columns.

    In:
      grids: as of `smoothness`.
      i, j: the tile.
    In and out:
      scratch: of `make_scratch`, of which are read and set
        plan (PLAN,): where the tile is, and how many rows and columns there are.
        level (PARTS,): of each of its smallest parts at which it is tried; LEVELS: not at all; DONE: it has its prices.
        rows (TALL,), columns (BROAD,): the candidates, by their places in the tile; columns are whole vectors, of which
          the last may be there several times.

    Returns whether there are any.
    """
    plan, level, rows, columns, _, _, _ = scratch
    height, width = extent(grids, i, j)
    while plan[LEVEL] < LEVELS:
        size = BROAD >> plan[LEVEL]
        at = plan[BEGIN]
        if at + size > width:
            for k in range(at // SHORT, PARTS):
                level[k] = max(level[k], plan[LEVEL] + 1) if level[k] != DONE else level[k]
            plan[LEVEL] += 1
            plan[BEGIN] = 0
            continue
        smallest = at // SHORT
        smooth = grids[3][plan[LEVEL], j * PARTS + smallest] != 0
        if level[smallest] != plan[LEVEL] or not smooth:
            if level[smallest] == plan[LEVEL]:
                _put_off(level, smallest, size, plan[LEVEL] + 1)
            plan[BEGIN] += size
            plan[TRIED_ROWS] = plan[FIRST_ROWS]
            continue
        plan[SIZE] = size
        plan[COLUMNS] = COLUMN_NODES
        for k in range(COLUMN_NODES):
            columns[k] = at + COLUMN_NODE[plan[LEVEL], k]
        if height != TALL or grids[2][i] == 0:
            plan[TRIED_ROWS] = ALL_ROWS
        tried = plan[TRIED_ROWS]
        plan[ROWS] = height if tried == ALL_ROWS else ROW_NODES[tried]
        for k in range(plan[ROWS]):
            rows[k] = k if tried == ALL_ROWS else ROW_NODE[tried, k]
        return True
    if plan[LEVEL] > LEVELS:
        return False
    plan[LEVEL] += 1
    count = np.int64(0)
    for b in range(width):
        if level[b // SHORT] != DONE:
            columns[count] = b
            count += 1
    if count == 0:
        return False
    while count % WIDE:
        columns[count] = columns[count - 1]
        count += 1
    plan[ROWS] = height
    plan[COLUMNS] = count
    for k in range(height):
        rows[k] = k
    return True


@kernel
def number_candidates(i, j, scratch):
    """The numbers of the points of the candidates that `next_candidates` has told.

    i, j: the tile.
    scratch: of `make_scratch`, of which index is set, row by row.

    Returns how many there are.
    """
    plan, _, rows, columns, index, _, _ = scratch
    wide = plan[COLUMNS]
    for a in range(plan[ROWS]):
        for b in range(wide):
            index[0, a * wide + b] = i * TALL + rows[a]
            index[1, a * wide + b] = j * BROAD + columns[b]
    return plan[ROWS] * wide


@kernel
def place_candidates(scratch, places):
    """The places in the tile of the candidates that `next_candidates` has told.

    scratch: of `make_scratch`. places (PLACES,): set, row by row.

    Returns how many there are.
    """
    plan, _, rows, columns, _, _, _ = scratch
    wide = plan[COLUMNS]
    for a in range(plan[ROWS]):
        for b in range(wide):
            places[a * wide + b] = rows[a] * BROAD + columns[b]
    return plan[ROWS] * wide


@part
def _put_off(level, smallest, size, to):
    """Have the parts of one of so many columns, whose first is the number `smallest`, tried at another level."""
    for k in range(smallest, smallest + size // SHORT):
        level[k] = to


@kernel
def take_prices(grids, i, j, error, scratch, price):
    """Take the prices of the candidates that `next_candidates` has told.

    In:
      grids, i, j: as of `next_candidates`.
      error: that a price may have.
    In and out:
      scratch: as of `next_candidates`; found (PLACES,) has the prices, row by row. buffer is overwritten.
    Out:
      price (PLACES,): of the tile, where it is known now.
    """
    plan, level, rows, columns, _, found, buffer = scratch
    height, wide = plan[ROWS], plan[COLUMNS]
    plan[PRICED] += height * wide
    if plan[LEVEL] > LEVELS:
        for a in range(height):
            for b in range(wide):
                price[rows[a] * BROAD + columns[b]] = found[a * wide + b]
        return
    smallest = plan[BEGIN] // SHORT
    size = plan[SIZE]
    node = np.empty(COLUMN_NODES)
    weight = np.empty(COLUMN_NODES)
    worst = 0.0
    fill_weights(grids[1], j * BROAD + plan[BEGIN], size, COLUMN_NODE[plan[LEVEL]], node, weight)
    for a in range(height):
        worst = worse(worst, tail(found, a * wide, 1, node, weight))
    if not worst <= error:
        more = 1.0
        if worst > error:  # not where it is no number
            more = max(1.0, min(math.log(worst / error) / math.log(FALLS), 1.0 * LEVELS))
        _put_off(level, smallest, size, min(plan[LEVEL] + math.ceil(more), LEVELS))
        return
    if plan[TRIED_ROWS] != ALL_ROWS:
        row_node = np.empty(height)
        row_weight = np.empty(height)
        fill_weights(grids[0], i * TALL, np.int64(TALL), ROW_NODE[plan[TRIED_ROWS]], row_node, row_weight)
        for b in range(wide):
            worst = worse(worst, tail(found, b, wide, row_node, row_weight))
        if not worst <= error:
            plan[TRIED_ROWS] += 1
            plan[FIRST_ROWS] = max(plan[FIRST_ROWS], plan[TRIED_ROWS])
            return
        _along_rows(grids[0], i, row_node, row_weight, found, buffer[COLUMN_NODES:])
    else:
        for a in range(height):
            for b in range(COLUMN_NODES):
                buffer[COLUMN_NODES + a, b] = found[a * wide + b]
    first = j * BROAD + plan[BEGIN]
    if plan[SHARES] != 1 + first * LEVELS + plan[LEVEL]:
        plan[SHARES] = 1 + first * LEVELS + plan[LEVEL]
        fill_column_shares(grids[1], first, size, node, weight, buffer)
    _spread(buffer, extent(grids, i, j)[0], plan[BEGIN], size, price)
    _put_off(level, smallest, size, DONE)


@kernel
def fill_weights(numbers, first, size, chosen, node, weight):
    """The nodes of a part of a grid, on the interval from -1 to 1, and their weights in the polynomial through all.

    In:
      numbers (n,): of the points of the grid.
      first, size: the part's first point, and how many it has.
      chosen: its nodes, and perhaps more behind them.
    Out:
      node, weight: of each.
    """
    low = numbers[first]
    high = numbers[first + size - 1]
    for k in range(node.shape[0]):
        node[k] = (2.0 * numbers[first + chosen[k]] - low - high) / (high - low)
    for k in range(node.shape[0]):
        product = 1.0
        for m in range(node.shape[0]):
            if m != k:
                product *= node[k] - node[m]
        weight[k] = 1.0 / product


@part
def tail(values, first, step, node, weight):
    """The last coefficient of the Chebyshev series through values at nodes, or a share of the one before, if larger.

    values: from `first` on, `step` apart. node, weight: of `fill_weights`.
    The one before the last is that of the series through all nodes but the last. It alone is there where a function is
    even or odd about the middle.
    """
    count = node.shape[0]
    last = 0.0
    before = 0.0
    for k in range(count):
        share = weight[k] * values[first + k * step]
        last += share
        before += share * (node[k] - node[count - 1])
    return max(abs(last), 2.0 * abs(before) / BEFORE_LAST) / 2.0 ** (count - 2)


@part
def worse(one, other):
    """The larger of two numbers; what is no number is infinite."""
    return max(one, other) if other == other else np.inf


@part
def _shares(numbers, place, low, high, node, weight, share):
    """By how much the values at nodes count in that of the polynomial at a point.

    numbers (n,), place: of the points of a grid, and which one it is.
    low, high: the numbers of the part's first and last point.
    node, weight: of `fill_weights`.
    share: as long as these, set.
    """
    t = (2.0 * numbers[place] - low - high) / (high - low)
    total = 0.0
    at = np.int64(-1)
    for k in range(node.shape[0]):
        apart = t - node[k]
        if apart == 0.0:
            at = k
            apart = 1.0
        share[k] = weight[k] / apart
        total += share[k]
    for k in range(node.shape[0]):
        if at >= 0:
            share[k] = 1.0 if k == at else 0.0
        else:
            share[k] /= total


@kernel
def _along_rows(numbers, i, node, weight, found, out):
    """Values of all rows of a tile at the nodes of the columns.

    numbers (n,), i: of the points of the first grid, and the strip.
    node, weight (nodes,): of `fill_weights`. found (nodes * COLUMN_NODES or more,): values at the nodes.
    out (TALL, COLUMN_NODES or more): set.
    """
    share = np.empty(node.shape[0])
    first = i * TALL
    for a in range(TALL):
        _shares(numbers, first + a, numbers[first], numbers[first + TALL - 1], node, weight, share)
        for b in range(COLUMN_NODES):
            value = 0.0
            for k in range(node.shape[0]):
                value += share[k] * found[k * COLUMN_NODES + b]
            out[a, b] = value


@kernel
def fill_row_shares(numbers, i, node, weight, out):
    """By how much values at nodes of rows count in each row of a tile: out (TALL, nodes or more).

    numbers (n,), i: of the points of the first grid, and the strip.
    node, weight (nodes,): of `fill_weights`.
    """
    first = i * TALL
    for a in range(TALL):
        share = out[a, : node.shape[0]]
        _shares(numbers, first + a, numbers[first], numbers[first + TALL - 1], node, weight, share)


@kernel
def fill_column_shares(numbers, first, size, node, weight, out):
    """By how much values at the nodes of columns count at each of these: out (COLUMN_NODES or more, size or more).

    numbers (n,), first, size: of the points of the second grid, and the part of it.
    node, weight (COLUMN_NODES,): of `fill_weights`.
    """
    share = np.empty(COLUMN_NODES)
    for b in range(size):
        _shares(numbers, first + b, numbers[first], numbers[first + size - 1], node, weight, share)
        for k in range(COLUMN_NODES):
            out[k, b] = share[k]


@kernel
def _spread(buffer, height, begin, size, price):
    """Write the prices of a part of a tile.

    In:
      buffer (COLUMN_NODES + TALL, BROAD): shares of the nodes by columns; then values of each row at these nodes.
      height, begin, size: rows of the part, its first column, and how many it has.
    Out:
      price (PLACES,): set there.
    """
    for a in range(height):
        own = buffer[COLUMN_NODES + a]
        for b in range(0, size, lanes()):
            value = zero()
            for k in range(COLUMN_NODES):
                value += own[k] * load(buffer[k], b)
            store(price, a * BROAD + begin + b, value)


@kernel
def fill_lengths(first, second, i, j, length):
    """The lengths of a tile's candidates (m).

    In:
      first (d, n_A), second (d, n_B): points of both grids (m).
      i, j: the tile.
    Out:
      length (PLACES,): set where there are candidates.
    """
    height = min(TALL, first.shape[1] - i * TALL)
    width = min(BROAD, second.shape[1] - j * BROAD)
    whole = width - width % lanes()
    for a in range(height):
        for b in range(0, whole, lanes()):
            square = zero()
            for d in range(first.shape[0]):
                apart = load(second[d], j * BROAD + b) - first[d, i * TALL + a]
                square += apart * apart
            store(length, a * BROAD + b, square * inverse_root(square, ZERO_LENGTH_SQUARED))
        for b in range(whole, width):
            total = 0.0
            for d in range(first.shape[0]):
                total += (second[d, j * BROAD + b] - first[d, i * TALL + a]) ** 2
            length[a * BROAD + b] = math.sqrt(total)
