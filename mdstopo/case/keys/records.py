"""Kinds of lists and mappings, made of other kinds. See `mdstopo.case.keys.kinds`."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from typing import Any

from mdstopo.case.keys.brought_records import Brought, BroughtError
from mdstopo.case.keys.kinds import Kind, Name, Schema, Word, check_name
from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node
from mdstopo.case.text.reading import BAD, Fields, Reading, Reference, found
from mdstopo.case.text.words import DECIMAL_SIGN, inside, listed, nearest, shown
from mdstopo.case.value import Value, frozen


@frozen
class Vector(Value):
    """A list of a fixed number of values of one kind. elsewhere: a wrong length -> where it would be right."""

    length: int
    item: Kind
    elsewhere: tuple[tuple[int, str], ...] = ()

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The components at a node of the file, or BAD with a mistake noted."""
        if node.kind != SEQUENCE or len(node.items) != self.length:
            where = dict(self.elsewhere).get(len(node.items)) if node.kind == SEQUENCE else None
            hint = f"; {where}" if where else ""
            reading.mistake(path, f"found {found(node)}, allowed is a list of {self.length}{hint}", node)
            return BAD
        values = tuple(self.item.read(child, f"{path}[{index}]", reading) for index, child in enumerate(node.items))
        return BAD if any(value is BAD for value in values) else values

    def schema(self) -> Schema:
        """The JSON Schema: a list of a fixed number of components."""
        return {
            "type": "array", "items": self.item.schema(), "minItems": self.length, "maxItems": self.length,
        }  # fmt: skip


@frozen
class Direction(Value):
    """A vector, in the plane or in space, that is not zero."""

    pair: Vector

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The components of a vector that is not zero, or BAD with a mistake noted."""
        vector = self.pair.read(node, path, reading)
        if vector is not BAD and not any(vector):
            reading.mistake(path, "found a zero vector, allowed is a direction")
            return BAD
        return vector

    def schema(self) -> Schema:
        """The JSON Schema of a vector."""
        return self.pair.schema()


@frozen
class ListOf(Value):
    """The kind of a list whose values are all of one kind."""

    item: Kind
    at_least: int = 0
    what: str = "entries"

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The list at a node of the file, BAD in the place of what cannot be read; BAD where it is no list."""
        if node.kind != SEQUENCE:
            reading.mistake(path, f"found {found(node)}, allowed is a list of {self.what}", node)
            return BAD
        if len(node.items) < self.at_least:
            message = f"found {found(node)}, needed are at least {self.at_least} {self.what}"
            reading.mistake(path, message, node)
            return BAD
        values = []
        for index, child in enumerate(node.items):
            here = f"{path}[{index}]"
            reading.mark(here, child)
            values.append(self.item.read(child, here, reading))
        return values

    def schema(self) -> Schema:
        """The JSON Schema of a list of such values."""
        schema: Schema = {"type": "array", "items": self.item.schema()}
        return {**schema, "minItems": self.at_least} if self.at_least else schema


@frozen
class Named(Value):
    """A mapping from new names to values of one kind. declares: what they name (see `Reading.declared`)."""

    item: Kind
    declares: str
    at_least: int = 0

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The values at a node by their names, BAD in the place of what cannot be read; BAD where it is no mapping."""
        if node.kind != MAPPING:
            reading.mistake(path, f"found {found(node)}, allowed is a mapping from names to values", node)
            return BAD
        if len(node.entries) < self.at_least:
            reading.mistake(path, f"found {found(node)}, needed is at least one {self.declares}", node)
            return BAD
        values = {}
        for text, (key, value) in node.entries.items():
            here = inside(path, text)
            reading.mark(here, value, key)
            read = self.item.read(value, here, reading)
            good = check_name(key, here, reading)
            if isinstance(key.scalar(), str):
                reading.declare(self.declares, text)
            if good:
                values[text] = read
        return values

    def schema(self) -> Schema:
        """The JSON Schema: a mapping from names to such values."""
        schema: Schema = {
            "type": "object", "propertyNames": Name().schema(), "additionalProperties": self.item.schema(),
        }  # fmt: skip
        return {**schema, "minProperties": self.at_least} if self.at_least else schema


@frozen
class ByName(Value):
    """A mapping from names that are declared elsewhere to values of one kind."""

    kind: str
    item: Kind
    what: str

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The values at a node by their names, BAD in the place of what cannot be read; BAD where it is no mapping."""
        if node.kind != MAPPING:
            allowed = f"{{{self.kind}: {self.what}, ...}}"
            reading.mistake(path, f"found {found(node)}, allowed is {allowed}", node)
            return BAD
        values = {}
        for text, (key, value) in node.entries.items():
            here = inside(path, text)
            reading.mark(here, value, key)
            if not isinstance(key.scalar(), str):
                reading.mistake(here, f"found {found(key)}, allowed is the name of a {self.kind}", key)
                continue
            reading.references.append(Reference(here, self.kind, text))
            values[text] = self.item.read(value, here, reading)
        return values

    def schema(self) -> Schema:
        """The JSON Schema: a mapping from names to such values."""
        return {"type": "object", "additionalProperties": self.item.schema()}


@frozen
class ByShape(Value):
    """The kind of a value that is read as one kind where it is a scalar, and as others where it is a list or a
    mapping. what: all of them in words."""

    what: str
    scalar: Kind | None = None
    sequence: Kind | None = None
    mapping: Kind | None = None

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The value at a node, as read by the kind for its shape (scalar, list or mapping), or BAD."""
        kind = {SCALAR: self.scalar, SEQUENCE: self.sequence, MAPPING: self.mapping}[node.kind]
        if kind is None:
            reading.mistake(path, f"found {found(node)}, allowed is {self.what}", node)
            return BAD
        return kind.read(node, path, reading)

    def schema(self) -> Schema:
        """The JSON Schema of all forms that the value may have."""
        kinds = [kind for kind in (self.scalar, self.sequence, self.mapping) if kind is not None]
        return {"anyOf": [kind.schema() for kind in kinds]}


@frozen
class ByDepth(Value):
    """The kind of a list, which is read as one kind if it holds single values, and as another if it holds lists. what:
    both in words."""

    what: str
    flat: Kind
    nested: Kind

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The value at a node, read as a list or as a list of lists by its depth, or BAD."""
        if node.kind != SEQUENCE or not node.items:
            reading.mistake(path, f"found {found(node)}, allowed is {self.what}", node)
            return BAD
        kind = self.nested if node.items[0].kind == SEQUENCE else self.flat
        return kind.read(node, path, reading)

    def schema(self) -> Schema:
        """The JSON Schema of both forms that the value may have."""
        return {"anyOf": [self.flat.schema(), self.nested.schema()]}


@frozen
class Tagged(Value):
    """The kind of a mapping whose key `tag` says which keys it has besides. elsewhere: a word -> where it would be
    right."""

    what: str
    tag: str
    variants: Mapping[str, Record]
    more: Brought[Record] | None = None
    elsewhere: tuple[tuple[str, str], ...] = ()

    @property
    def known(self) -> dict[str, Record]:
        """The variants by their tags, with those of other distributions that have been asked for."""
        return {**self.variants, **(self.more.records if self.more is not None else {})}

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The values at a node by the keys that its tag allows, BAD in the place of what cannot be read."""
        if node.kind != MAPPING:
            words = " | ".join(self.known)
            message = f"found {found(node)}, allowed is {self.what}: a mapping with `{self.tag}: {words}`"
            reading.mistake(path, message, node)
            return BAD
        entry = node.entries.get(self.tag)
        if entry is None:
            best = nearest(self.tag, node.entries)
            known = {key.name for record in self.known.values() for key in record.keys}
            if best is not None and best not in known:
                message = f"unknown key {shown(best)}, did you mean {self.tag!r}?"
                reading.mistake(inside(path, best), message, node.entries[best][0])
            else:
                words = " | ".join(self.known)
                reading.mistake(path, f"the key {self.tag!r} is missing, allowed is {words}")
            return BAD
        place = inside(path, self.tag)
        if entry[1].kind == SCALAR and not _brought(self.more, entry[1].scalar(), self.known, place, reading):
            return BAD
        text = entry[1].scalar() if entry[1].kind == SCALAR else None
        where = dict(self.elsewhere).get(text) if isinstance(text, str) and text not in self.known else None
        if where is not None:
            reading.mistake(place, f"found {found(entry[1])}; {where}", entry[1])
            return BAD
        word = self._word().read(entry[1], place, reading)
        return BAD if word is BAD else self.known[word].read(node, path, reading)

    def _word(self) -> Word:
        """The tag's value."""
        return Word(tuple(self.known), meanings=tuple(record.doc for record in self.known.values()))

    def schema(self) -> Schema:
        """The JSON Schema: a mapping whose further keys depend on the tag."""
        return {
            "type": "object",
            "required": [self.tag],
            "properties": {self.tag: self._word().schema()},
            "allOf": [
                {
                    "if": {"properties": {self.tag: {"const": word}}, "required": [self.tag]},
                    "then": record.schema(),
                }
                for word, record in self.known.items()
            ],
        }


@frozen
class Key(Value):
    """One key of a mapping.

    doc: what it means; unit: what its numbers are in. default: the value where the key is left out (None: nothing);
    otherwise: what is taken then, in words, where no constant is.
    """

    name: str
    kind: Kind
    doc: str = ""
    required: bool = False
    default: Any = None
    unit: str = ""
    otherwise: str = ""

    @property
    def text(self) -> str:
        """The description of a key: meaning, unit, and what is taken where it is left out."""
        unit = f"in {self.unit}" if self.unit else ""
        otherwise = f"default {self.otherwise}" if self.otherwise else ""
        parts = [self.doc, unit, otherwise]
        return ", ".join(part for part in parts if part)

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """What the kind reads, with this key's unit for its numbers, or the unit of the key around it."""
        around, reading.unit = reading.unit, self.unit or reading.unit
        try:
            return self.kind.read(node, path, reading)
        finally:
            reading.unit = around

    def schema(self) -> Schema:
        """The value's schema with the key's description and default."""
        schema = dict(self.kind.schema())
        if self.text:
            schema["description"] = self.text
        if self.default is not None:
            schema["default"] = list(self.default) if isinstance(self.default, tuple) else self.default
        return schema


@frozen
class Record(Value):
    """A mapping with known keys.

    doc: what it stands for, a sentence. one_of: of each of these sets exactly one key is needed; any_of: at least
    one of these; never_both: pairs; needs: a key -> the one that must stand beside it. more: keys of other
    distributions, each of which stands for one of the first set of `one_of`. elsewhere: an unknown key -> where it
    would be right, or what stands in its place here. unit_of: the unit of keys that state none, by what else the
    mapping has. alone: words that may stand in the place of the whole mapping, for messages.
    """

    what: str
    keys: tuple[Key, ...]
    one_of: tuple[tuple[str, ...], ...] = ()
    any_of: tuple[str, ...] = ()
    never_both: tuple[tuple[str, str], ...] = ()
    needs: tuple[tuple[str, str], ...] = ()
    doc: str = ""
    more: Brought[Key] | None = None
    elsewhere: tuple[tuple[str, str], ...] = ()
    unit_of: Callable[[Node], str] | None = None
    alone: tuple[str, ...] = ()

    @property
    def all_keys(self) -> tuple[Key, ...]:
        """The keys, with those of other distributions that have been asked for."""
        return (*self.keys, *(self.more.records.values() if self.more is not None else ()))

    @property
    def sets(self) -> tuple[tuple[str, ...], ...]:
        """Which keys exclude each other (`one_of`), with those that other distributions have brought."""
        if self.more is None or not self.more.records:
            return self.one_of
        return ((*self.one_of[0], *self.more.records), *self.one_of[1:])

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The values at a node by their keys, BAD in the place of what cannot be read; BAD where it is no mapping."""
        if node.kind != MAPPING:
            words = listed(key.name for key in self.all_keys)
            message = f"found {found(node)}, allowed is {self.what}, a mapping with the keys {words}"
            reading.mistake(path, message, node)
            return BAD
        known = {key.name: key for key in self.all_keys}
        for text in node.entries if self.more is not None else ():
            if not _brought(self.more, text, known, inside(path, text), reading):
                return BAD
        known = {key.name: key for key in self.all_keys}
        fields = Fields(path, (name for name in node.entries if name in known))
        meant = self._unknown(node, path, reading, known)
        around = reading.unit
        if self.unit_of is not None:
            reading.unit = self.unit_of(node)
        for name, key in known.items():
            entry = node.entries.get(name)
            if entry is not None:
                here = inside(path, name)
                reading.mark(here, entry[1], entry[0])
                fields[name] = key.read(entry[1], here, reading)
            elif key.required:
                fields[name] = BAD
                if name not in meant:
                    explained = f" ({key.text})" if key.text else ""
                    reading.mistake(path, f"the key {name!r} is missing{explained}")
            else:
                fields[name] = key.default
        reading.unit = around
        self._together(fields, meant, path, reading)
        return fields

    def _unknown(self, node: Node, path: str, reading: Reading, known: Mapping[str, Key]) -> set[str]:
        """Notes unknown keys; returns the right words they were probably meant to be."""
        meant: set[str] = set()
        elsewhere = dict(self.elsewhere)
        for text, (key, value) in node.entries.items():
            if text in known:
                continue
            if text in elsewhere:
                reading.mistake(inside(path, text), f"unknown key {shown(text)}: {elsewhere[text]}", key)
                meant.update(names for names in known if f"`{names}`" in elsewhere[text])
                continue
            best = nearest(text, [name for name in known if name not in node.entries])
            hint = ""
            if best is not None:
                meant.add(best)
                hint = f", did you mean {best!r}?"
            elif text.isdigit() and value.kind == SCALAR and not value.text:  # {mass: 1,5}
                hint = f" ({DECIMAL_SIGN}),"
            message = f"unknown key {shown(text)}{hint or ','} allowed are {listed(known)}{self._or_alone()}"
            reading.mistake(inside(path, text), message, key)
        return meant

    def _or_alone(self) -> str:
        """That words may stand in the place of the mapping, for the end of a message."""
        return f", or in the place of the mapping {listed(self.alone)}" if self.alone else ""

    def _together(self, fields: Fields, meant: set[str], path: str, reading: Reading) -> None:
        """Which keys go with which."""
        given = fields.stated
        for names in self.sets:
            here = [name for name in names if name in given]
            if len(here) == 1:
                continue
            if here or not meant & set(names):
                what = f"found {' and '.join(here)}" if here else "found none"
                reading.mistake(path, f"{what}, needed is exactly one of {listed(names)}{self._or_alone()}")
            fields.update(dict.fromkeys(names, BAD))
        if self.any_of and not given & set(self.any_of):
            if not meant & set(self.any_of):
                reading.mistake(path, f"needed is at least one of {listed(self.any_of)}")
            fields.update(dict.fromkeys(self.any_of, BAD))
        for first, second in self.never_both:
            if first in given and second in given:
                reading.mistake(path, f"found {first} and {second}, allowed is one of them")
                fields[second] = BAD
        for name, other in self.needs:
            if name in given and other not in given and other not in meant:
                message = f"the key {name!r} goes with {other!r}, which is not given"
                reading.mistake(inside(path, name), message)

    def schema(self) -> Schema:
        """The JSON Schema: a mapping with these keys and no others."""
        schema: Schema = {
            "type": "object",
            "properties": {key.name: key.schema() for key in self.all_keys},
            "additionalProperties": False,
        }
        if self.doc:
            schema["description"] = self.doc
        required = [key.name for key in self.keys if key.required]
        if required:
            schema["required"] = required
        rules: list[Schema] = [{"oneOf": [{"required": [name]} for name in names]} for names in self.sets]
        if self.any_of:
            rules.append({"anyOf": [{"required": [name]} for name in self.any_of]})
        rules += [{"not": {"required": list(pair)}} for pair in self.never_both]
        if rules:
            schema["allOf"] = rules
        if self.needs:
            schema["dependentRequired"] = {name: [other] for name, other in self.needs}
        return schema


def _brought(more: Brought[Any] | None, word: Any, known: Container[str], path: str, reading: Reading) -> bool:
    """Look for an unknown word in other distributions; False where one has it that cannot be used, which is noted."""
    if more is None or not isinstance(word, str) or word in known:
        return True
    try:
        more.find(word)
    except BroughtError as error:
        reading.mistake(path, str(error))
        return False
    return True
