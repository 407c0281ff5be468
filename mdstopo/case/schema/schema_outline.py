"""Format 1 of the case file: what bodies look like in pictures. See `schema_case`."""

from __future__ import annotations

from mdstopo.case.geometry.mesh_files import MeshFaces
from mdstopo.case.geometry.svg_path import SvgPath
from mdstopo.case.keys.common_keys import FRAME, PAIR, TRIPLE
from mdstopo.case.keys.kinds import POSITIVE, Kind
from mdstopo.case.keys.number_rows import Rows
from mdstopo.case.keys.records import ByShape, Key, ListOf, Record, Vector

_MIDDLE = "the centre of mass"
_RADIUS = Key("radius", POSITIVE, "radius", required=True, unit="m")
_CENTER = Key("center", PAIR, "centre, [x, y]", unit="m", otherwise=_MIDDLE)
_CENTER_IN_SPACE = Key("center", TRIPLE, "centre", unit="m", otherwise=_MIDDLE)


def _record(shapes: dict[str, tuple[Kind, str]], space: bool) -> Record:
    where, here = ("in the plane", "in space") if space else ("with `dimension: 3`", "in the plane")
    other = f"it is for a case {where}; {here} it is {', '.join(f'`{word}`' for word in shapes)}"
    return Record(
        "an outline",
        (*(Key(name, kind, doc, unit="m" if name == "polygon" else "") for name, (kind, doc) in shapes.items()), FRAME),
        one_of=(tuple(shapes),),
        doc="What is drawn of a body: one shape. It has no effect on the motion.",
        elsewhere=tuple((word, other) for word in (("rectangle", "circle", "path") if space else _ONLY_IN_SPACE)),
    )


_ONLY_IN_SPACE = ("box", "sphere", "cylinder", "file")
_PLANAR: dict[str, tuple[Kind, str]] = {
    "polygon": (Rows(("x", "y"), "free", 3), "corners in order; the last one is joined with the first"),
    "rectangle": (
        Record(
            "a drawn rectangle",
            (_CENTER, Key("size", Vector(2, POSITIVE), "[width, height]", required=True, unit="m")),
            doc="A rectangle along the axes of its frame.",
        ),
        "a rectangle",
    ),
    "circle": (Record("a drawn circle", (_CENTER, _RADIUS), doc="A circle."), "a circle"),
    "path": (
        Record(
            "a drawn path",
            (
                Key(
                    "d", SvgPath(), "the text of the attribute `d` of a path in SVG; areas within areas are holes", True
                ),
                Key("scale", POSITIVE, "metres in a unit of the path", default=1.0),
                Key("at", PAIR, "where the path's origin is, [x, y]", unit="m", otherwise=_MIDDLE),
            ),
            doc="A path from a drawing, as the drawing shows it: its y axis points down.",
        ),
        "a path from a drawing in SVG",
    ),
}
_SPATIAL: dict[str, tuple[Kind, str]] = {
    "polygon": (Rows(("x", "y", "z"), "free", 3), "corners of a flat area in order"),
    "box": (
        Record(
            "a drawn box",
            (_CENTER_IN_SPACE, Key("size", Vector(3, POSITIVE), "along x, y and z of its frame", True, unit="m")),
            doc="A box along the axes of its frame.",
        ),
        "a box",
    ),
    "sphere": (Record("a drawn sphere", (_CENTER_IN_SPACE, _RADIUS), doc="A sphere."), "a sphere"),
    "cylinder": (
        Record(
            "a drawn cylinder",
            (
                Key("from", TRIPLE, "one end of its axis", required=True, unit="m"),
                Key("to", TRIPLE, "the other end", required=True, unit="m"),
                _RADIUS,
            ),
            doc="A cylinder with flat ends.",
        ),
        "a cylinder",
    ),
    "file": (MeshFaces(), "path of an STL or OBJ file, relative to the case file: its faces, in m"),
}


def _key(record: Record) -> Key:
    kind = ByShape("an outline or a list of outlines", sequence=ListOf(record, 1, "outlines"), mapping=record)
    doc = "what pictures show of the body: one shape, or a list of shapes. It has no effect on the motion"
    return Key("outline", kind, doc, otherwise="a shape from its points")


OUTLINE = _key(_record(_PLANAR, space=False))
OUTLINE_IN_SPACE = _key(_record(_SPATIAL, space=True))
