"""Which rows of the joints are solved, and where every unknown stands in the banded matrix of the balance.

A row that others imply (a parallelogram's extra link) would make the matrix singular; it is left out, and `projection`
watches that it stays fulfilled. Unknowns are ordered so that bodies that are tied stand together (reverse
Cuthill-McKee where there are many).
"""

import numpy as np

from mdstopo.case.model import Case
from mdstopo.scene.model import FloatArray, IndexArray

#: part of a row that must be its own, relative to the row, or others imply it
INDEPENDENT = 1e-9
#: unknowns up to which their natural order is good enough
FEW = 30


def arrange(
    case: Case,
    joint: IndexArray,
    joint_par: FloatArray,
    free: IndexArray,
    mass: FloatArray,
    q0: FloatArray,
    pair: IndexArray,
) -> tuple[IndexArray, IndexArray, tuple[int, int], tuple[str, ...]]:
    """row (n_joint, 3), place (n + n_row,), (n_row, half width), and the names of joints with rows left out."""
    row = np.full((len(joint), 3), -1, dtype=np.int64)
    redundant: list[str] = []
    columns: list[list[int]] = []
    if len(joint):
        jac = _slopes(joint, joint_par, q0)
        kept: list[FloatArray] = []
        for j, (_, a, b, _, rows) in enumerate(joint.tolist()):
            coordinates = [*range(3 * a, 3 * a + 3), *range(3 * b, 3 * b + 3)]
            for r in range(rows):
                dense = np.zeros(len(free))
                np.add.at(dense, coordinates, jac[j, r])
                dense *= np.where(free == 1, 1.0 / np.sqrt(mass), 0.0)
                size = float(np.linalg.norm(dense))
                for _ in range(2):  # twice is enough
                    for other in kept:
                        dense -= (other @ dense) * other
                own = float(np.linalg.norm(dense))
                if size == 0.0 or own <= INDEPENDENT * size:
                    redundant.append(case.joints[j].name)
                    continue
                kept.append(dense / own)
                row[j, r] = len(columns)
                columns.append([d for d in coordinates if free[d]])
    place, half = _order(len(free), free, pair, columns)
    return row, place, (len(columns), half), tuple(dict.fromkeys(redundant))


def _slopes(joint: IndexArray, joint_par: FloatArray, q0: FloatArray) -> FloatArray:
    from mdstopo.general.start_entry import slopes_of

    jac = np.zeros((len(joint), 3, 6))
    slopes_of(joint, joint_par, q0, np.zeros((len(joint), 3)), jac)
    return jac


def _order(n: int, free: IndexArray, pair: IndexArray, columns: list[list[int]]) -> tuple[IndexArray, int]:
    """Place of each coordinate and row, and the distance from the diagonal to the farthest entry."""
    total = n + len(columns)
    links: set[tuple[int, int]] = set()
    for a, b in pair.tolist():
        both = [d for body in (a, b) for d in range(3 * body, 3 * body + 3) if free[d]]
        links.update((i, j) for i in both for j in both)
    for body in range(n // 3):
        own = [d for d in range(3 * body, 3 * body + 3) if free[d]]
        links.update((i, j) for i in own for j in own)
    for r, coordinates in enumerate(columns):
        links.update((n + r, d) for d in coordinates)
    place = np.arange(total, dtype=np.int64)
    if total > FEW:
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        rows, cols = (np.array(side) for side in zip(*(links | {(j, i) for i, j in links}), strict=True))
        graph = coo_array((np.ones(len(rows)), (rows, cols)), shape=(total, total)).tocsr()
        place[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(total)
    half = max((abs(int(place[i] - place[j])) for i, j in links), default=0)
    return place, half
