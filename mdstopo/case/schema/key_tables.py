"""The keys of a case as Markdown and as plain lines, from the definitions that reader and JSON Schema are made of."""

import html
import re
from collections.abc import Iterator
from dataclasses import dataclass

from mdstopo.case.geometry.mesh_files import MeshFaces, MeshFile
from mdstopo.case.geometry.svg_path import SvgPath
from mdstopo.case.keys.definitions import DefinedName, Definitions
from mdstopo.case.keys.formula_keys import FormulaNames, FormulaText
from mdstopo.case.keys.kinds import NUMBER, Flag, Kind, Name, Number, NumberOrWord, OneOf, Ref, Text, Version, Word
from mdstopo.case.keys.number_rows import FILE, FileName, Rows, Signals
from mdstopo.case.keys.records import ByDepth, ByName, ByShape, Direction, Key, ListOf, Named, Record, Tagged, Vector
from mdstopo.case.laws.expression_law import Parameters
from mdstopo.case.schema.schema_case import FORMAT
from mdstopo.case.schema.schema_fit import ColumnOf
from mdstopo.case.schema.schema_space import SPACE_FORMAT
from mdstopo.case.schema.schema_uncertainty import Anything, ByKey
from mdstopo.shown import plural

#: sections of a case in space that have a table on its page
IN_SPACE = ("bodies", "joints", "motions", "points", "contacts", "loads", "objectives")
#: where the page tells of tables of time and of rows from files
ROWS = "rows"
#: mappings that many keys share, told once
_SHARED: dict[str, Record] = {"file": FILE, "table": Signals(("value",)).table}


@dataclass(frozen=True)
class Place:
    """A mapping of the format: the key path at which it is first met, and its keys."""

    path: str
    record: Record
    depth: int


def places(case: Record = FORMAT) -> dict[str, list[Place]]:
    """Every mapping below a key of a case, each once, by that key; those of tables and files under `ROWS`."""
    seen: set[int] = set()
    found = {key.name: list(_below(key.kind, key.name, 0, seen)) for key in case.keys}
    return {"": [Place("", case, 0)], **found, ROWS: [Place(path, each, 0) for path, each in _SHARED.items()]}


def sections_with(word: str, case: Record = FORMAT) -> list[str]:
    """The keys of a case below which a word, or what it is the plural of, is a key or names one of several mappings,
    as a law or a joint."""
    names = {word, word.removesuffix("s")}
    return [
        section or "case"
        for section, part in places(case).items()
        if any(names & {*each.path.split("."), *(key.name for key in each.record.keys)} for each in part)
    ]


def keys_in_space(section: str) -> str:
    """The same of a case in space, for a page that has `IN_SPACE` alone; other links lead to the page of the case."""
    known = places(SPACE_FORMAT)
    here = {f"{each.path}-keys" for name in IN_SPACE for each in known[name]}
    link = re.compile(r"\]\(#([\w.-]+)\)")
    text = keys_of(section, SPACE_FORMAT)
    return link.sub(lambda found: found[0] if found[1] in here else f"](case.md#{found[1]})", text)


def keys_of(section: str, case: Record = FORMAT) -> str:
    """The mappings below one key of a case, each as a heading with a table; "" for the case itself."""
    known = places(case)
    if not known.get(section):
        raise ValueError(f"no mapping is below {section!r}; there are {', '.join(known)}")
    anchors = {id(each.record): each.path for part in known.values() for each in part}
    return "\n\n".join(_told(each, anchors) for each in known[section])


def lines_of(section: str, case: Record = FORMAT) -> list[str]:
    """The mappings below one key of a case as lines for a terminal; "" for the case itself."""
    lines: list[str] = []
    for place in places(case)[section]:
        record = place.record
        lines += ["", f"{place.path}: {record.what}" if place.path else "the case itself"]
        about = [_cell(record.doc)] if place.path else []
        lines += [f"  {_unmarked(text)}" for text in (*about, *_rules(record)) if text]
        for key in record.keys:
            unit = f", {key.unit}" if key.unit else ""
            default = "required" if key.required else f"default {_unmarked(_default(key))}"
            lines.append(f"  {key.name}: {_unmarked(_value(key.kind, {}, ''))}{unit}; {default}")
            lines += [f"      {_unmarked(part)}" for part in _meaning(key).split("<br>")]
    return lines[1:]


def _unmarked(cell: str) -> str:
    """A cell of a table without the marks of Markdown."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", cell).replace("`", "").replace("\\", "")
    return html.unescape(text)


def _below(kind: Kind, path: str, depth: int, seen: set[int]) -> Iterator[Place]:
    """The mappings that a value of this kind holds, outer ones first."""
    if isinstance(kind, Record):
        if id(kind) in seen:
            return
        seen.add(id(kind))
        yield Place(path, kind, depth)
        for key in kind.keys:
            yield from _below(key.kind, f"{path}.{key.name}", depth + 1, seen)
    elif isinstance(kind, Tagged):
        for word, record in kind.variants.items():
            yield from _below(record, f"{path}.{word}", depth, seen)
    else:
        for part in _parts(kind):
            yield from _below(part, path, depth, seen)


def _parts(kind: Kind) -> list[Kind]:
    """The kinds that a list, a mapping from names or a choice is made of."""
    if isinstance(kind, (Vector, ListOf, Named, ByName, ByKey)):
        return [kind.item]
    if isinstance(kind, ByDepth):
        return [kind.flat, kind.nested]
    if isinstance(kind, ByShape):
        return [part for part in (kind.scalar, kind.sequence, kind.mapping) if part is not None]
    return []


def _told(place: Place, anchors: dict[int, str]) -> str:
    record = place.record
    lines = []
    if place.path:
        heading = "#" * min(3 + place.depth, 4)
        title = record.what[:1].upper() + record.what[1:]
        lines += [f"{heading} {title} {{ #{place.path}-keys }}", "", _cell(record.doc), ""]
    lines += [*_rules(record), "| key | value | default | meaning |", "| --- | --- | --- | --- |"]
    for key in record.keys:
        path = f"{place.path}.{key.name}" if place.path else ""
        anchor = f'<a id="{path}"></a>' if path else ""
        linked = not place.path and next(_below(key.kind, key.name, 0, set()), None) is not None
        name = f"[`{key.name}`](#{key.name})" if linked else f"`{key.name}`"
        unit = f", {_cell(key.unit)}" if key.unit else ""
        cells = [anchor + name, _value(key.kind, anchors, path) + unit, _default(key), _meaning(key)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _rules(record: Record) -> list[str]:
    """Which keys go with which."""
    sentences = [f"Exactly one of {_names(names)} is needed." for names in record.one_of]
    if record.any_of:
        sentences.append(f"At least one of {_names(record.any_of)} is needed.")
    sentences += [f"`{one}` and `{other}` exclude each other." for one, other in record.never_both]
    sentences += [f"`{name}` needs `{other}` beside it." for name, other in record.needs]
    return [" ".join(sentences), ""] if sentences else []


def _names(names: tuple[str, ...]) -> str:
    quoted = [f"`{name}`" for name in names]
    return f"{', '.join(quoted[:-1])} and {quoted[-1]}"


def _default(key: Key) -> str:
    if key.required:
        return "**required**"
    if key.otherwise:
        return _cell(key.otherwise)
    if key.default is None or key.default == ():
        return "none"
    return f"`{_text(key.default)}`" if _text(key.default) else "empty"


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return f"[{', '.join(_text(part) for part in value)}]"
    return str(value)


def _meaning(key: Key) -> str:
    """What a key means, and each of its words where they are explained."""
    lines = [_cell(key.doc)]
    words = words_of(key.kind)
    if words is not None and any(words.meanings):
        lines += [f"`{word}`: {_cell(meaning)}" for word, meaning in zip(words.words, words.meanings, strict=True)]
    return "<br>".join(lines)


def words_of(kind: Kind) -> Word | None:
    if isinstance(kind, Word):
        return kind
    if isinstance(kind, NumberOrWord):
        return kind.word
    if isinstance(kind, ByShape) and isinstance(kind.scalar, Word):
        return kind.scalar
    return None


def _value(kind: Kind, anchors: dict[int, str], path: str) -> str:
    """What may stand there, in words; mappings are links to their tables."""
    if isinstance(kind, Record):
        return f"[{kind.what}](#{anchors.get(id(kind), path)}-keys)"
    if isinstance(kind, Tagged):
        links = [f"[`{word}`](#{anchors.get(id(each), f'{path}.{word}')}-keys)" for word, each in kind.variants.items()]
        return f"{kind.what}: {', '.join(links)}"
    if isinstance(kind, Direction):
        kind = kind.pair
    if isinstance(kind, Vector):
        return _several(kind)
    if isinstance(kind, ListOf):
        return f"list: {_value(kind.item, anchors, path)}"
    if isinstance(kind, Named):
        return f"mapping from names to {_value(kind.item, anchors, path)}"
    if isinstance(kind, ByName):
        return f"mapping from {plural(kind.kind)} to {_value(kind.item, anchors, path)}"
    if isinstance(kind, ByKey):
        return f"mapping from {kind.what}: {_value(kind.item, anchors, path)}"
    if isinstance(kind, ByDepth):
        return ", or ".join(_value(part, anchors, path) for part in _parts(kind))
    if isinstance(kind, ByShape):
        if isinstance(kind.sequence, ListOf) and kind.sequence.item is kind.mapping:
            return f"{_value(kind.mapping, anchors, path)}, or a list of such"
        return ", or ".join(_value(part, anchors, path) for part in _parts(kind))
    return _cell(_simple(kind))


def _several(kind: Vector) -> str:
    """A list of a fixed length."""
    item = kind.item.pair if isinstance(kind.item, Direction) else kind.item
    if isinstance(item, Vector):
        return f"list of {kind.length}, each a {_several(item)}"
    if isinstance(kind.item, Ref):
        return f"names of {kind.length} {plural(kind.item.kind)}"
    return f"list of {kind.length} {_cell(_simple(kind.item)).replace('number', 'numbers', 1)}"


def _simple(kind: Kind) -> str:
    """What a value that holds no mapping may be."""
    if isinstance(kind, Number):
        return kind.allowed().removeprefix("a ")
    if isinstance(kind, Word):
        return ", ".join(f"`{word}`" for word in kind.words)
    if isinstance(kind, ColumnOf):
        return f"name of a column, or {_simple(kind.number) if kind.number is not None else 'its place from 0'}"
    if isinstance(kind, NumberOrWord):
        return f"{_simple(kind.number)}, or {_simple(kind.word)}"
    if isinstance(kind, Ref):
        also = "".join(f", or `{word}`" for word in kind.also if word != "default")
        return f"name of a {kind.kind}{', or index' if kind.index else ''}{also}"
    if isinstance(kind, Rows):
        return f"[rows](#{ROWS}) `{kind.row_text}`"
    if isinstance(kind, Signals):
        table = f"[table](#{ROWS}) of rows `{kind.rows.row_text}`"
        constant = "number" if len(kind.names) == 1 else f"`[{', '.join(kind.names)}]`"
        formula = "[formula of time](expressions.md#loads)"
        ways = [*([constant] if kind.constant else []), *([formula] if kind.formula else []), table]
        return f"{', '.join(ways[:-1])}, or {table}" if len(ways) > 1 else table
    if isinstance(kind, FormulaNames):
        return f"`{{name: {'number' if kind.item is NUMBER else 'response'}, ...}}`"
    if isinstance(kind, Version):
        return f"`{kind.number}`"
    if isinstance(kind, OneOf):
        return ", ".join(f"`{number}`" for number in kind.numbers)
    texts: dict[type, str] = {
        Flag: "`true`, `false`", Text: "text", Name: "a new name", FileName: "path of a file",
        MeshFile: "path of an STL or OBJ file", MeshFaces: "path of an STL or OBJ file", Anything: "any value",
        Definitions: "`{name: number or expression, ...}`", SvgPath: "text of a path",
        DefinedName: "`define.name`",
        FormulaText: "an [expression](expressions.md)", Parameters: "`{name: number, ...}`",
    }  # fmt: skip
    return texts[type(kind)]


def _cell(text: str) -> str:
    """Text for a cell of a table."""
    return text.replace("<", "&lt;").replace(">", "&gt;").replace("|", "\\|").replace("*", "\\*")
