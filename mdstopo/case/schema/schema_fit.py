"""Format 1 of the case file: the section `fit`. See `schema_case`."""

from __future__ import annotations

from typing import Any

from mdstopo.case.keys.kinds import NUMBER, POSITIVE, Kind, Number, Schema, explained
from mdstopo.case.keys.number_rows import FileName
from mdstopo.case.keys.records import ByShape, Key, Named, Record
from mdstopo.case.methods.losses import DEFAULT_LOSS
from mdstopo.case.methods.losses import names as losses
from mdstopo.case.schema.schema_uncertainty import ByKey
from mdstopo.case.text.nodes import SCALAR, Node
from mdstopo.case.text.reading import BAD, Reading, found
from mdstopo.case.value import Value, frozen


@frozen
class ColumnOf(Value):
    """The kind of a column of a file: its name in the header line, or its place from 0. number: allows a number
    instead."""

    number: Number | None = None

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The name or the place of a column (where allowed, a number instead), or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if self.number is not None and isinstance(value, (int, float)) and not isinstance(value, bool):
            return self.number.read(node, path, reading)
        if isinstance(value, str) and value:
            return value
        if self.number is None and isinstance(value, int) and not isinstance(value, bool) and value >= 0:
            return value
        other = "its place, from 0" if self.number is None else self.number.allowed()
        reading.mistake(path, f"found {found(node)}, allowed is the name of a column, or {other}", node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema of a column: its name, or a number."""
        place: Schema = {"type": "integer", "minimum": 0}
        return {"anyOf": [{"type": "string", "minLength": 1}, place if self.number is None else self.number.schema()]}


_ESTIMATE = Record(
    "an estimated number",
    (
        Key("lower", NUMBER, "lower bound", required=True, unit="the number's unit"),
        Key("upper", NUMBER, "upper bound", required=True, unit="the number's unit"),
        Key(
            "initial",
            NUMBER,
            "where the fit begins",
            unit="the number's unit",
            otherwise="the number in the case, where it is between the bounds, else their middle",
        ),
    ),
    doc="A number that the fit may choose between two bounds.",
)


def _shift(name: str, what: str, unit: str) -> Key:
    kind = ByShape("a number or {lower: number, upper: number}", scalar=NUMBER, mapping=_ESTIMATE)
    return Key(name, kind, f"{what}: a number that is known, or bounds between which it is estimated", unit=unit,
               default=0.0)  # fmt: skip


def fit_record(response: Kind, load_case: Key) -> Record:
    """The keys of the section `fit`, in a plane or in space.

    response: the kinds of responses. load_case: the key that says where.
    """
    series = Record(
        "a measured series",
        (
            Key("file", FileName(), "path, relative to the case file, of a table in text: CSV", required=True),
            Key("time", ColumnOf(), "its column of times: the name in the header line, or its place from 0", default=0),
            Key("value", ColumnOf(), "its column of measured values", default=1),
            Key("response", response, "what was measured", required=True),
            load_case,
            Key(
                "deviation",
                ColumnOf(Number(above=0)),
                "standard deviation of a measured value: a number in the response's unit, or the name of a column",
                otherwise="estimated from the residuals",
            ),
            Key("time_scale", POSITIVE, "times in the file are multiplied by this: 0.001 for ms", default=1.0),
            Key("value_scale", NUMBER, "values in the file, and deviations, are multiplied by this", default=1.0),
            _shift("offset", "what the instrument shows too much, in the response's unit", "the number's unit"),
            _shift("delay", "by how much later something is recorded than it happens", "s"),
            Key("from", NUMBER, "what was recorded earlier is left out", unit="s", otherwise="no limit"),
            Key("to", NUMBER, "what was recorded later is left out", unit="s", otherwise="no limit"),
        ),
        doc="Values over time, and what of the motion of one load case they are.",
    )
    return Record(
        "a fit",
        (
            Key(
                "estimate",
                ByKey("key paths to bounds", _ESTIMATE),
                "numbers of the case that are estimated, by key path: parameters of laws, masses, places, velocities, "
                "names of `define`",
                required=True,
            ),
            Key("measured", Named(series, "measured series", 1), "what was measured, by name", required=True),
            Key("loss", explained(losses()), "how residuals count", default=DEFAULT_LOSS),
            Key("starts", Number(minimum=1, maximum=10**4, whole=True), "how many starts; the further ones are random",
                default=1),
            Key("seed", Number(minimum=0, maximum=2**53, whole=True), "of the random starts", default=0),
            Key("confidence", Number(above=0, below=1), "of the intervals of estimates", default=0.95),
        ),
        doc="Numbers of the case that `mdstopo fit` estimates, and the measurements that it estimates them from. Other "
        "commands do not read the files.",
    )  # fmt: skip
