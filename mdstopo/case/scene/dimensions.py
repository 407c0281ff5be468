"""Which dimension a case has, and what the reader of cases and others need to know of it."""

from __future__ import annotations

from mdstopo.case.model import GROUND, Case
from mdstopo.case.objects.frames import Frames
from mdstopo.case.objects.plane_or_space import Geometry
from mdstopo.case.text.nodes import SCALAR, Node
from mdstopo.case.text.reading import Reading
from mdstopo.case.text.words import listed

#: what may stand above `dimension`: nothing of it depends on the dimension
_BEFORE = ("format", "dimension", "title", "extends", "define", "time", "design", "combine", "optimizer")


def geometry_of(dimension: int) -> Geometry:
    """What a case reader has to know of a plane (2) or of space (3)."""
    if dimension == 3:
        from mdstopo.case.scene.space import SPACE  # most cases are planar

        return SPACE
    from mdstopo.case.scene.plane import PLANE  # those in space need none of it

    return PLANE


def geometry_in(root: Node, reading: Reading) -> Geometry:
    """The dimension that a case states; the plane where it states none or a mistake. Notes where it is stated too
    late."""
    entry = root.entries.get("dimension")
    if entry is None:
        return geometry_of(2)
    key, value = entry
    names = list(root.entries)
    late = [name for name in names[: names.index("dimension")] if name not in _BEFORE]
    if late and not value.origin:
        reading.mistake("dimension", f"stands below {listed(late)}; it stands above all that depends on it", key)
    number = value.scalar() if value.kind == SCALAR else None
    return geometry_of(3 if not isinstance(number, bool) and number == 3 else 2)


def frames_of(case: Case) -> Frames:
    """Where the bodies of a case stand at the start."""
    geometry = geometry_of(case.dimension)
    return Frames({GROUND: geometry.ground, **{body.name: body for body in case.bodies}}, geometry)
