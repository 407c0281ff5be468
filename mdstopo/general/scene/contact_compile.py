"""The contacts of a case as rows of a general scene, one for each point."""

import math

import numpy as np

from mdstopo.case.model import AnyContact, Case, Contact, SurfaceContact
from mdstopo.general.scene.dimension import Frames, Pairs, in_frame
from mdstopo.mechanics.contact import CONTACT
from mdstopo.mechanics.kinematics.spatial_contacts import CYLINDER, PLANE, RECTANGLE, SPHERE, WIDTH
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: the codes of surfaces by their words
SHAPES = {"plane": PLANE, "rectangle": RECTANGLE, "sphere": SPHERE, "cylinder": CYLINDER}
#: the pair (n_contact,) of edge or surface and point, the parameters (n_contact, width), and each contact in words
Rows = tuple[IndexArray, FloatArray, tuple[str, ...]]


def edge_rows(case: Case, index: dict[str, int], pairs: Pairs, frames: Frames) -> Rows:
    """The rows of contacts with edges, as `mechanics.contact` has them."""
    del frames
    where: list[int] = []
    rows: list[list[float]] = []
    words: list[str] = []
    for contact in case.contacts:
        pair = _pair(contact, index, pairs)
        (x, y), (end_x, end_y) = contact.edge_from, contact.edge_to
        length = math.hypot(end_x - x, end_y - y)
        for i, point in enumerate(contact.points.tolist()):
            where.append(pair)
            edge = [x, y, (end_x - x) / length, (end_y - y) / length, length]
            rows.append([*_law(contact), *point, *edge])
            words.append(_words(contact, i))
    return np.array(where, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(-1, CONTACT), tuple(words)


def surface_rows(case: Case, index: dict[str, int], pairs: Pairs, frames: Frames) -> Rows:
    """The rows of contacts with surfaces, as `spatial_contacts` has them: in the axes that arrays have."""
    where: list[int] = []
    rows: list[list[float]] = []
    words: list[str] = []
    for contact in case.contacts:
        pair = _pair(contact, index, pairs)
        surface, owner = contact.surface, contact.edge_body
        place = in_frame(frames, owner, np.array(surface.place, dtype=np.float64))
        shape = [SHAPES[surface.shape], *place, *in_frame(frames, owner, surface.axes).ravel(), *surface.sizes]
        for i, point in enumerate(in_frame(frames, contact.body, contact.points).tolist()):
            where.append(pair)
            rows.append([*_law(contact), *point, *shape, -1.0 if surface.hollow else 1.0])
            words.append(_words(contact, i))
    return np.array(where, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(-1, WIDTH), tuple(words)


def _pair(contact: AnyContact, index: dict[str, int], pairs: Pairs) -> int:
    return pairs.setdefault((index[contact.edge_body], index[contact.body]), len(pairs))


def _law(contact: Contact | SurfaceContact) -> list[float]:
    return [contact.stiffness, contact.damping, contact.friction, contact.slip]


def _words(contact: Contact | SurfaceContact, point: int) -> str:
    return f"point {point} of contact {contact.name}, of {contact.body} on {contact.edge_body}"
