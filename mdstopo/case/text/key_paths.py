"""Numbers of a case by their key path: where a path leads, and what stands there."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence

from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node
from mdstopo.case.text.overrides import WrongPathError, steps_of
from mdstopo.case.text.scalars import to_float
from mdstopo.case.text.words import did_you_mean, inside, listed, shown

#: sections whose numbers say what the problem is
SECTIONS = {
    "format": "is the format's version",
    "dimension": "says which case it is",
    "title": "is a name",
    "time": "says when the motion is computed",
    "design": "says what is designed",
    "objectives": "says what is to be improved",
    "constraints": "says what is bounded",
    "combine": "says how objectives are weighted",
    "optimizer": "says how the design is improved",
    "solver": "says how motions are computed",
    "uncertainty": "says what is uncertain",
    "fit": "says what is fitted",
}
#: numbers of a group of members that say which problem it is
_OF_GROUPS = {"min_length": "which members there are", "max_length": "which members there are", "cost": "volumes"}


def led_to(stated: str, root: Node) -> tuple[str, Node]:
    """The key path as messages write it, and what stands there. Raises WrongPathError with the reason."""
    steps = steps_of(stated)
    node, path = root, ""
    for step in steps:
        before = path or "the case"
        if node.kind == MAPPING:
            name = str(step)
            entry = node.entries.get(name)
            if entry is None:
                hint = did_you_mean(name, node.entries)
                message = f"{before} states no {shown(name)}{hint or ';'} it states {listed(node.entries) or 'nothing'}"
                raise WrongPathError(path, message)
            node, path = entry[1], inside(path, name)
        elif node.kind == SEQUENCE:
            index = int(step) if isinstance(step, int) or (step.isascii() and step.isdigit()) else -1
            if not 0 <= index < len(node.items):
                message = f"{before} is a list of {len(node.items)}; {shown(str(step))} is none of its places"
                raise WrongPathError(path, message)
            node, path = node.items[index], f"{path}[{index}]"
        else:
            raise WrongPathError(path, f"{before} is a single value; {shown(str(step))} is not in it")
    return path, node


def number_at(node: Node) -> float:
    """The finite number at a node of the file; NaN where there is none."""
    value = node.scalar() if node.kind == SCALAR else None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return math.nan
    number = to_float(value)
    return number if math.isfinite(number) else math.nan


def stands(steps: Sequence[str], root: Node) -> bool:
    """Whether the case states anything at a key path."""
    node = root
    for step in steps:
        if node.kind == MAPPING and step in node.entries:
            node = node.entries[step][1]
        elif node.kind == SEQUENCE and step.isdigit() and int(step) < len(node.items):
            node = node.items[int(step)]
        else:
            return False
    return True


def varied_by(steps: list[str], root: Node) -> str:
    """That the number of a law at a key path is a design variable, and which one, in words; empty where it is none."""
    for name, node in _variables(root):
        stated = {key: value for key, (_, value) in node.entries.items()}
        if "group" not in stated or "parameter" not in stated or stated["parameter"].text != steps[-1]:
            continue
        groups = [each.text for each in stated["group"].items] or [stated["group"].text]
        place = stated["law"].text if "law" in stated else ""
        if steps[1] in groups and (len(steps) == 4 or place in ("", steps[3])):
            return f"it is the design variable {name}"
    return ""


def varied_as(word: str, root: Node) -> str:
    """That a defined name is a design variable, and which one, in words; empty where it is none."""
    for name, node in _variables(root):
        stated = node.entries.get("of")
        if stated is not None and stated[1].text == f"define.{word}":
            return f"it is the design variable {name}"
    return ""


def stated_variables(root: Node, key: str) -> list[Node]:
    """The design variables of a case that state a key."""
    return [node for _, node in _variables(root) if key in node.entries]


def _variables(root: Node) -> Iterator[tuple[str, Node]]:
    """The design variables of a case as they are stated, by name."""
    design = root.entries.get("design")
    variables = design[1].entries.get("variables") if design is not None else None
    for name, (_, node) in variables[1].entries.items() if variables is not None else ():
        yield name, node


def why_fixed(steps: list[str], root: Node, sections: Container[str]) -> str:
    """Why the number at a key path may not vary: it says what the problem is, not what the scene is like. Empty
    where it may.

    sections: those of `SECTIONS` in which all numbers are such.
    """
    section = steps[0]
    if section == "members" and len(steps) > 2 and steps[2] in _OF_GROUPS:
        return f"`{steps[2]}` decides {_OF_GROUPS[steps[2]]}"
    if section == "members" and len(steps) > 3 and steps[2] == "law":
        return varied_by(steps, root)
    if section == "define" and len(steps) == 2:
        return varied_as(steps[1], root)
    if section == "points" and "count" in steps:
        return "`count` decides which members there are"
    return f"`{section}` {SECTIONS[section]}" if section in sections else ""
