"""Format 1 of the case file: the section `uncertainty`. See `schema_case`."""

from __future__ import annotations

from typing import Any

from mdstopo.case.keys.kinds import NOT_NEGATIVE, Kind, Number, Schema, explained
from mdstopo.case.keys.records import ByName, Key, Named, Record
from mdstopo.case.methods.measures import having
from mdstopo.case.methods.measures import names as measures
from mdstopo.case.methods.number_distributions import DISTRIBUTIONS
from mdstopo.case.text.nodes import MAPPING, SEQUENCE, Node
from mdstopo.case.text.reading import BAD, Reading, found
from mdstopo.case.text.words import inside, listed
from mdstopo.case.value import Value, frozen


@frozen
class Anything(Value):
    """The kind of any value: what it may be is decided where it is put."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The value at a node in Python: numbers, texts, truth values, None, lists and dicts of them."""
        if node.kind == MAPPING:
            return {name: self.read(value, inside(path, name), reading) for name, (_, value) in node.entries.items()}
        if node.kind == SEQUENCE:
            return [self.read(item, f"{path}[{index}]", reading) for index, item in enumerate(node.items)]
        return node.scalar()

    def schema(self) -> Schema:
        """The JSON Schema: without limits."""
        return {}


@frozen
class ByKey(Value):
    """The kind of a mapping from key paths, or from places in a list, to values of one kind. what: both in words."""

    what: str
    item: Kind

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The values at a node by their keys, BAD in the place of what cannot be read; BAD where it is no mapping."""
        if node.kind != MAPPING:
            reading.mistake(path, f"found {found(node)}, allowed is a mapping from {self.what}", node)
            return BAD
        values = {}
        for text, (key, value) in node.entries.items():
            here = inside(path, text)
            reading.mark(here, value, key)
            values[text] = self.item.read(value, here, reading)
        return values

    def schema(self) -> Schema:
        """The JSON Schema: a mapping to such values."""
        return {"type": "object", "additionalProperties": self.item.schema()}


_DISTRIBUTION = Record(
    "a distribution",
    tuple(Key(kind.type, kind.keys, kind.doc) for kind in DISTRIBUTIONS.values()),
    one_of=(tuple(DISTRIBUTIONS),),
    doc="How a number varies. Numbers vary independently of each other; what varies together is a scenario.",
)
_SCENARIO = Record(
    "a scenario",
    (
        Key(
            "probability",
            Number(above=0, maximum=1),
            "how likely it is; stated in all scenarios or in none, of sum 1",
            otherwise="the same for all",
        ),
        Key("set", ByKey("keys of the case to values", Anything()), "keys of the case, and their values here"),
    ),
    doc="Values that occur together. Every scenario meets the whole sample of the numbers.",
)
_MEASURE = Record(
    "a measure",
    (
        Key("measure", explained(measures()), "what becomes of the values at all points of the sample", required=True),
        Key("factor", NOT_NEGATIVE, f"k of {listed(having('factor'))}", otherwise="1"),
        Key("level", Number(above=0, maximum=1), f"of {listed(having('level'))}; 1 is the worst", otherwise="0.9"),
    ),
    doc="One number of many. Worse is larger where an objective is minimised or a limit is kept, else smaller.",
)
UNCERTAINTY = Record(
    "uncertainty",
    (
        Key("parameters", ByKey("key paths to distributions", _DISTRIBUTION), "numbers that vary, by key path"),
        Key("scenarios", Named(_SCENARIO, "scenario", 1), "what varies together, by name"),
        Key("sample", Number(minimum=2, maximum=10**5, whole=True), "points for each scenario", default=64),
        Key("seed", Number(minimum=0, maximum=2**53, whole=True), "of both samples", default=0),
        Key(
            "validation",
            Number(minimum=0, maximum=10**6, whole=True),
            "points of the fresh random sample that the final design is tried on; 0, or at least 30",
            default=256,
        ),
        Key("objectives", ByName("objective", _MEASURE, "measure"), "what objectives become", otherwise="mean"),
        Key(
            "constraints",
            ByKey("places of constraints, from 0, to measures", _MEASURE),
            "what bounded responses become, by place in `constraints`",
            otherwise="worst; mean with `equals`",
        ),
    ),
    any_of=("parameters", "scenarios"),
    doc="What is not known for certain, and how it is taken into account.",
)
