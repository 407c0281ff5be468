"""The contacts of a case as rows of a general scene, one for each point."""

import math

import numpy as np

from mdstopo.case.model import Case
from mdstopo.mechanics.contact import CONTACT
from mdstopo.scene.model import FloatArray, IndexArray


def contact_rows(
    case: Case, index: dict[str, int], pairs: dict[tuple[int, int], int]
) -> tuple[IndexArray, FloatArray, tuple[str, ...]]:
    """The pair (n_contact,) of edge and point, the parameters (n_contact, CONTACT), and each contact in words."""
    where: list[int] = []
    rows: list[list[float]] = []
    words: list[str] = []
    for contact in case.contacts:
        pair = pairs.setdefault((index[contact.edge_body], index[contact.body]), len(pairs))
        (x, y), (end_x, end_y) = contact.edge_from, contact.edge_to
        length = math.hypot(end_x - x, end_y - y)
        for i, point in enumerate(contact.points.tolist()):
            where.append(pair)
            edge = [x, y, (end_x - x) / length, (end_y - y) / length, length]
            rows.append([contact.stiffness, contact.damping, contact.friction, contact.slip, *point, *edge])
            words.append(f"point {i} of contact {contact.name}, of {contact.body} on {contact.edge_body}")
    return np.array(where, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(-1, CONTACT), tuple(words)
