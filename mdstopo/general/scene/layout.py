"""Which rows of the joints are solved, and where every unknown stands in the banded matrix of the balance.

A row that others imply (a parallelogram's extra link) would make the matrix singular; it is left out, and `projection`
watches that it stays fulfilled. Unknowns are ordered so that bodies that are tied stand together (reverse
Cuthill-McKee where there are many); so are the rows alone, for the matrix that is left of them without the bodies.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from mdstopo.case.model import Case
from mdstopo.general.model.general_model import JOINT_FIRST
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: a row of which no larger share than this is independent of the others is implied by them
INDEPENDENT = 1e-9
#: of multipliers that hold each other in balance, of norm 1, a smaller force on a joint than this is rounding
SHARED_FORCE = 1e-7
#: unknowns up to which their natural order is good enough
FEW_UNKNOWNS = 30


class Layout(NamedTuple):
    """row, unknown_index, size[0:2], row_layout, skyline, schur_product, schur_constant of `GeneralModel`.

    redundant: names of joints with rows left out.
    """

    row: IndexArray
    unknown_index: IndexArray
    size: tuple[int, int]
    row_layout: IndexArray
    skyline: IndexArray
    schur_product: IndexArray
    schur_constant: FloatArray
    redundant: tuple[str, ...]

    def fields(self) -> dict[str, Any]:
        """The fields of `GeneralModel` that these are, but for `size`."""
        return {name: value for name, value in self._asdict().items() if name not in ("size", "redundant")}


def arrange(
    case: Case,
    joint: IndexArray,
    joint_par: FloatArray,
    unchanging: Sequence[tuple[tuple[int, ...], ...]],
    free: IndexArray,
    mass: FloatArray,
    home: FloatArray,
    pair: IndexArray,
    bodies: Kinematics,
) -> Layout:
    """Choose the rows of the joints that are solved, and order the unknowns and these rows.

    case: for the joints' names.
    joint (n_joint, 5), joint_par: the joints, as in `GeneralModel`.
    unchanging: of each joint and row the slopes that are the same wherever bodies are (`JointKernels.steady`).
    free (n,): 1 for freedoms that are unknowns, 0 for driven ones.
    mass (n,): mass (kg) or inertia (kg m^2) of each freedom.
    home (n_body, n_home): where the bodies stand by the case, as in `GeneralModel`; rows are compared there.
    pair (n_pair, 2): the two bodies of each pair.
    bodies: how they move.
    """
    each = bodies.freedoms
    row = np.full((len(joint), bodies.rows), -1, dtype=np.int64)
    redundant: list[str] = []
    columns: list[list[int]] = []
    if len(joint):
        jac = _slopes(joint, joint_par, home, bodies)
        kept: list[FloatArray] = []
        for j, r, coordinates, dense in _rows(joint, jac, len(free), each):
            dense *= np.where(free == 1, 1.0 / np.sqrt(mass), 0.0)
            size = float(np.linalg.norm(dense))
            for _ in range(2):  # the second time against rounding
                for other in kept:
                    dense -= (other @ dense) * other
            own = float(np.linalg.norm(dense))
            if size == 0.0 or own <= INDEPENDENT * size:
                redundant.append(case.joints[j].name)
                continue
            kept.append(dense / own)
            row[j, r] = len(columns)
            columns.append([d for d in coordinates if free[d]])
    place, half = _order(len(free), free, pair, columns, each)
    meet = _meetings(joint, free, each)
    order, envelope, entries = _order_rows(row, meet, len(columns), many=len(place) > FEW_UNKNOWNS)
    line = np.zeros((len(columns), 4), dtype=np.int64)

    def slopes_at(j: int, r: int) -> int:
        """Where the slopes of row r of joint j begin among those of all joints."""
        return 2 * each * (bodies.rows * j + r)

    for j, r in np.argwhere(row >= 0).tolist():
        line[row[j, r]] = slopes_at(j, r), each * joint[j, 1], each * joint[j, 2], order[row[j, r]]
    products, steady = [], np.zeros(entries)
    if len(joint):
        inverse = np.where(free == 1, 1.0 / mass, 0.0)
        for entry, a, b, axis in _products(row, meet, order, envelope, slopes_at, each):
            one, two = (divmod(place // (2 * each), bodies.rows) for place in (a, b))
            fixed = [axis in unchanging[j][r] for j, r in (one, two)]
            slopes = [float(jac.flat[place + axis]) for place in (a, b)]
            if all(fixed):
                body = int(joint[one[0], JOINT_FIRST + a % (2 * each) // each])
                steady[entry] += slopes[0] * slopes[1] * inverse[each * body + axis]
            elif not any(known and slope == 0.0 for known, slope in zip(fixed, slopes, strict=True)):
                products.append((entry, a + axis, b + axis))
    return Layout(
        row, place, (len(columns), half), line, envelope, _in_runs(products), steady, tuple(dict.fromkeys(redundant))
    )


def _in_runs(products: list[tuple[int, int, int]]) -> IndexArray:
    """(n_run, 4): products of slopes that stand behind each other and belong to one entry, as `schur_product`."""
    runs: list[list[int]] = []
    for entry, one, two in products:
        if runs and [entry, one, two] == [runs[-1][0], runs[-1][1] + runs[-1][3], runs[-1][2] + runs[-1][3]]:
            runs[-1][3] += 1
        else:
            runs.append([entry, one, two, 1])
    return np.array(runs, dtype=np.int64).reshape(-1, 4)


def undetermined(
    names: Sequence[str], joint: IndexArray, joint_par: FloatArray, free: IndexArray, home: FloatArray,
    bodies: Kinematics,
) -> tuple[str, ...]:  # fmt: skip
    """Names of the joints whose forces are not determined, because others may take what they carry.

    Multipliers that hold each other in balance, without any load, may be added to those of the motion: the left null
    space of Phi_q. What they put on a joint as a force is open. In space one direction is allowed: hinges of a linkage
    that moves in a plane have it across the plane, where the linkage carries nothing.

    names: of the joints. joint, joint_par, free, home, bodies: as of `arrange`.
    """
    each, across = bodies.freedoms, bodies.freedoms - bodies.rotations
    jac = _slopes(joint, joint_par, home, bodies)
    rows = list(_rows(joint, jac, len(free), each))
    left, values, _ = np.linalg.svd(np.array([dense * free for *_, dense in rows]))
    balanced = left[:, np.count_nonzero(values > INDEPENDENT * values[0]) :]
    forces = np.zeros((len(joint), across, balanced.shape[1]))
    for (j, r, *_), multipliers in zip(rows, balanced, strict=True):
        forces[j] += np.outer(jac[j, r, :across], multipliers)
    return tuple(
        name
        for name, force in zip(names, forces, strict=True)
        if np.count_nonzero(np.linalg.svd(force, compute_uv=False) > SHARED_FORCE) > across - 2
    )


def _rows(joint: IndexArray, jac: FloatArray, n: int, each: int) -> Iterator[tuple[int, int, list[int], FloatArray]]:
    """Every row of the joints: which joint and row of it, the coordinates (2 D) of its bodies, and its slopes by all
    (n,); jac: of `_slopes`, each: freedoms of a body."""
    for j, (_, a, b, _, rows) in enumerate(joint.tolist()):
        coordinates = [*range(each * a, each * (a + 1)), *range(each * b, each * (b + 1))]
        for r in range(rows):
            dense = np.zeros(n)
            np.add.at(dense, coordinates, jac[j, r])
            yield j, r, coordinates, dense


def _slopes(joint: IndexArray, joint_par: FloatArray, home: FloatArray, bodies: Kinematics) -> FloatArray:
    """(n_joint, rows, 2 D): Phi_q of the joints at home."""
    jac = np.zeros((len(joint), bodies.rows, 2 * bodies.freedoms))
    q = np.tile(bodies.at_home, len(home))
    bodies.of_python("slopes_of")(joint, joint_par, home, q, np.zeros((len(joint), bodies.rows)), jac)
    return jac


def _order(n: int, free: IndexArray, pair: IndexArray, columns: list[list[int]], each: int) -> tuple[IndexArray, int]:
    """Place of each coordinate and row in the banded matrix, and how far from the diagonal its farthest entry is.

    Driven coordinates are no unknowns: their places are behind those of the matrix.
    """
    total = n + len(columns)
    links: set[tuple[int, int]] = set()
    for a, b in pair.tolist():
        both = [d for body in (a, b) for d in range(each * body, each * (body + 1)) if free[d]]
        links.update((i, j) for i in both for j in both)
    for body in range(n // each):
        own = [d for d in range(each * body, each * (body + 1)) if free[d]]
        links.update((i, j) for i in own for j in own)
    for r, coordinates in enumerate(columns):
        links.update((n + r, d) for d in coordinates)
    place = _reordered(links, total) if total > FEW_UNKNOWNS else np.arange(total, dtype=np.int64)
    driven = np.concatenate([free == 0, np.zeros(len(columns), dtype=bool)])
    place[np.lexsort((place, driven))] = np.arange(total)
    return place, _width(links, place)


def _meetings(joint: IndexArray, free: IndexArray, each: int) -> IndexArray:
    """(n_meet, 4): a joint, its side, another joint or itself, its side, where both are on one body that can move.

    Sides are 0 for a joint's first body and 1 for its second.
    """
    on: dict[int, list[tuple[int, int]]] = {}
    for j, (_, a, b, *_) in enumerate(joint.tolist()):
        on.setdefault(a, []).append((j, 0))
        on.setdefault(b, []).append((j, 1))
    found = [
        (*one, *other)
        for body, sides in on.items()
        if free[each * body : each * (body + 1)].any()
        for i, one in enumerate(sides)
        for other in sides[: i + 1]
    ]
    return np.array(found, dtype=np.int64).reshape(-1, 4)


def _products(
    row: IndexArray,
    meet: IndexArray,
    order: IndexArray,
    envelope: IndexArray,
    slopes_at: Callable[[int, int], int],
    each: int,
) -> Iterator[tuple[int, int, int, int]]:
    """The products that the joints' own matrix is made of, one after the other.

    Of each: the entry that it is added to; where the slopes of two rows by the coordinates of one body begin among
    those of all joints; and which of its coordinates is meant.

    row (n_joint, rows): the number of each row among the solved ones, or -1.
    meet (n_meet, 4): of `_meetings`.
    order, envelope: of `_order_rows`.
    slopes_at: where the slopes of a row of a joint begin.
    each: freedoms of a body.
    """
    for j, side, k, other in meet.tolist():
        for r, s in product(range(row.shape[1]), repeat=2):
            if row[j, r] >= 0 and row[k, s] >= 0 and (j != k or s <= r):
                low, high = sorted((int(order[row[j, r]]), int(order[row[k, s]])))
                for axis in range(each):
                    entry = int(envelope[high, 1]) + low
                    yield entry, slopes_at(j, r) + each * side, slopes_at(k, s) + each * other, axis


def _order_rows(row: IndexArray, meet: IndexArray, count: int, many: bool) -> tuple[IndexArray, IndexArray, int]:
    """Place of each row among the rows, `GeneralModel.skyline`, and the number of entries.

    Where there are many unknowns two orders are compared, and the one that is cheaper to factorise is taken.
    """
    links = {
        (r, s) for j, _, k, _ in meet.tolist() for r in row[j].tolist() for s in row[k].tolist() if r >= 0 and s >= 0
    }
    orders = [np.arange(count, dtype=np.int64)]
    if many and links:
        orders.append(_reordered(links, count))
    line, first = min(((order, _first(links, order)) for order in orders), key=lambda pair: _cost(pair[1]))
    lengths = np.arange(count) - first + 1
    ends = np.cumsum(lengths)
    envelope = np.stack([first, ends - lengths - first], axis=1).astype(np.int64)
    return line, envelope.reshape(count, 2), int(lengths.sum())


def _first(links: set[tuple[int, int]], line: IndexArray) -> IndexArray:
    """For each place of a row in the matrix, the first place that it is linked to, at most its own: the skyline."""
    first = np.arange(len(line), dtype=np.int64)
    for r, s in links:
        low, high = sorted((int(line[r]), int(line[s])))
        first[high] = min(first[high], low)
    return first


def _cost(first: IndexArray) -> int:
    """How many products the factors of rows take that begin at these places."""
    places = np.arange(len(first))
    return sum(int((places[f:i] - np.maximum(first[f:i], f) + 2).sum()) for i, f in enumerate(first.tolist()))


def _reordered(links: set[tuple[int, int]], total: int) -> IndexArray:
    """Place of each of `total` unknowns so that those that are linked stand together."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    rows, cols = (np.array(side) for side in zip(*(links | {(j, i) for i, j in links}), strict=True))
    graph = coo_array((np.ones(len(rows)), (rows, cols)), shape=(total, total)).tocsr()
    place = np.empty(total, dtype=np.int64)
    place[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(total)
    return place


def _width(links: set[tuple[int, int]], place: IndexArray) -> int:
    """How far from the diagonal the farthest entry is when the unknowns stand at these places."""
    return max((abs(int(place[i] - place[j])) for i, j in links), default=0)
