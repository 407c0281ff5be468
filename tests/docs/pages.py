"""The fenced blocks of the documentation, and what is held of them.

A block's title is the file that it is written to, in a folder of the page's own; later blocks find it there. A comment
above a block says more: `<!-- part: KEY -->` (YAML that is the value of a key of a case, or has the key), `<!-- exit: 2
-->` (how the last command of a console block ends), `<!-- wrong -->` (a case that is refused), `<!-- needs:
pandas -->` (modules without which a Python block is left out), `<!-- example -->` (part of a worked example of how to
extend the program: `test_extending`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.nodes import MAPPING, SEQUENCE, Node, parse
from mdstopo.case.text.overrides import as_yaml

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))

_FENCE = re.compile(r"^(?P<indent> *)(?P<ticks>`{3,}|~{3,}) *(?P<language>[\w+-]*)(?P<rest>[^`]*)$")
_COMMENT = re.compile(r"^\s*<!-- (part|exit|wrong|needs|example)(?:: (\S.*?))? -->\s*$")
_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w])")
_ELSEWHERE = "..."


@dataclass(frozen=True)
class Block:
    """A fenced block: the line it begins on, its language, title, text and the comments above it."""

    line: int
    language: str
    title: str
    text: str
    part: str = ""
    exit: int = 0
    wrong: bool = False
    example: bool = False
    needs: tuple[str, ...] = ()


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page, in order."""
    found = []
    lines = text.splitlines()
    marks: dict[str, str] = {}
    at = 0
    while at < len(lines):
        fence = _FENCE.match(lines[at])
        if fence is None:
            mark = _COMMENT.match(lines[at])
            if mark is not None:
                marks[mark[1]] = mark[2] or ""
            elif lines[at].strip():
                marks = {}
            at += 1
            continue
        begun, indent = at, len(fence["indent"])
        end = re.compile(rf"^ *{re.escape(fence['ticks'])}\s*$")
        at += 1
        inside = []
        while at < len(lines) and not end.match(lines[at]):
            inside.append(lines[at][indent:] if not lines[at][:indent].strip() else lines[at])
            at += 1
        at += 1
        title = re.search(r'title="([^"]+)"', fence["rest"])
        found.append(
            Block(
                begun + 1,
                fence["language"],
                title[1] if title else "",
                "".join(f"{line}\n" for line in inside),
                marks.get("part", ""),
                int(marks.get("exit", "0")),
                "wrong" in marks,
                "example" in marks,
                tuple(marks["needs"].split(", ")) if "needs" in marks else (),
            )
        )
        marks = {}
    return found


def is_case(block: Block) -> bool:
    """Whether a block is a whole case."""
    if block.language not in ("yaml", "yml"):
        return False
    told = [line for line in block.text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return bool(told) and told[0].startswith("format:")


# Parts of a case.

#: what a part may refer to without declaring it
_HOST: dict[str, Any] = {
    "format": 1,
    "time": {"end": 1},
    "bodies": {"host-one": {"mass": 1, "inertia": 1, "position": [0, 0]}},
}
_UNDECLARED = re.compile(r"^no (.+) is called '([\w-]+)'")


def case_with(part: str, text: str) -> Case:
    """A small case that has the part. What the part names and does not declare is declared for it.

    Raises CaseError where anything else is wrong with it.
    """
    value = data(text)
    host: dict[str, Any] = {key: dict(found) if isinstance(found, dict) else found for key, found in _HOST.items()}
    if isinstance(value, dict) and part.split(".")[0] in value:
        host |= {key: host[key] | each if key == "bodies" else each for key, each in value.items()}
    else:
        _put(host, part.split("."), value)
    for _ in range(40):
        try:
            return read_case(as_yaml(host))
        except CaseError as error:
            found = [_UNDECLARED.match(mistake.message) for mistake in error.mistakes]
            missing = {(each[1], each[2]) for each in found if each is not None}
            if not missing:
                raise
            for kind, name in sorted(missing):
                _declare(host, kind, name)
    raise AssertionError(f"the part {part} asks for more and more")


def _put(host: dict[str, Any], steps: list[str], value: Any) -> None:
    for step in steps[:-1]:
        host = host.setdefault(step, {})
    host[steps[-1]] = value


def _declare(host: dict[str, Any], kind: str, name: str) -> None:
    bodies = host["bodies"]
    if kind == "body":
        bodies[name] = {"mass": 1, "inertia": 1, "position": [0, len(bodies)]}
    elif kind == "point grid":
        place = len(host.get("points", ()))
        body = f"host-{name}"
        _declare(host, "body", body)
        host.setdefault("points", {})[name] = {"body": body, "grid": {"list": [[place, 0], [place, 0.3]]}}
    elif kind == "member group":
        law = {"type": "spring", "stiffness": 1}
        ends = {"from": {"body": "ground", "at": [0, 3]}, "to": {"body": "host-one", "at": [0, 0]}}
        host.setdefault("members", {})[name] = {**ends, "law": law, "cost": 1000}
    elif kind == "joint":
        _declare(host, "body", f"host-{name}")
        joint = {"name": name, "type": "revolute", "bodies": [f"host-{name}", "ground"], "at": [0, 0]}
        host.setdefault("joints", []).append(joint)
    elif kind == "load case":
        host.setdefault("load_cases", {})[name] = {}
    else:
        host.setdefault("objectives", {})[name] = {"response": "energy"}


def data(text: str) -> Any:
    """YAML as Python values, read as the program reads it."""
    node = parse(text, lambda mistake: None)
    assert node is not None
    return _plain(node)


def _plain(node: Node) -> Any:
    if node.kind == MAPPING:
        return {key: _plain(value) for key, (_, value) in node.entries.items()}
    if node.kind == SEQUENCE:
        return [_plain(item) for item in node.items]
    return node.scalar()


# Commands and what they print.


def commands(text: str) -> list[tuple[str, list[str]]]:
    """The commands of a console block with the lines that are shown below each; `\\` at its end joins lines."""
    found: list[tuple[str, list[str]]] = []
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("$ "):
            command = line[2:]
            while command.endswith("\\"):
                command = command[:-1].rstrip() + " " + next(lines).removeprefix(">").strip()
            found.append((command, []))
        elif found and line.strip() and line.strip() != _ELSEWHERE:
            found[-1][1].append(line)
        elif not found:
            assert not line.strip(), f"a console block begins with output: {line!r}"
    return found


def occurs(shown: str, printed: str) -> bool:
    """Whether a line that a page shows is in what was printed.

    Blanks count as one; `...` stands for anything. Whole numbers must be equal where both are. Others agree in the
    digits shown, of which three count, but for one in the last of these: a value near the middle between two roundings
    is rounded up on one processor and down on another.
    """
    return any(_same(shown.strip(), line) for line in printed.splitlines())


def _same(shown: str, line: str) -> bool:
    pattern, numbers = [], []
    at = 0
    for found in _NUMBER.finditer(shown):
        pattern += [_words(shown[at : found.start()]), f"({_NUMBER.pattern})"]
        numbers.append(found[0])
        at = found.end()
    pattern.append(_words(shown[at:]))
    there = re.fullmatch(r"\s*" + "".join(pattern) + r"\s*", line)
    return there is not None and all(_agree(one, other) for one, other in zip(numbers, there.groups(), strict=True))


def _words(text: str) -> str:
    """Text as a pattern."""
    parts = re.split(r"(\.\.\.|\s+)", text)
    return "".join(".*" if part == _ELSEWHERE else r"\s+" if part.isspace() else re.escape(part) for part in parts)


def _agree(shown: str, printed: str) -> bool:
    if re.fullmatch(r"[-+]?\d+", shown) and re.fullmatch(r"[-+]?\d+", printed):
        return float(shown) == float(printed)
    digits = len(re.sub(r"[eE].*|\D", "", shown).lstrip("0")) or 1
    value, other = float(shown), float(printed)
    if value == 0.0:
        return abs(other) < 10.0 ** -len(shown.partition(".")[2])
    unit = 10.0 ** (int(f"{abs(value):e}".partition("e")[2]) - min(digits, 3) + 1)
    return abs(value - other) <= 1.001 * unit
