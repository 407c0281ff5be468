"""Is this still the same case? Every key of a case as a short text, to be stored and compared on resuming.

The comparison is made on what the case means, not on how it is written: comments, order, spelt-out defaults
and included files that moved make no difference.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from mdstopo.case.model import Body, Case, LoadCase, MemberGroup

# Where the case comes from, how it is written and how long it runs does not change what is computed.
_IGNORED: dict[type, set[str]] = {
    Case: {"path", "name", "text", "sha256", "files", "marks", "overrides", "warnings", "fit"},
    Body: {"stated"},
    LoadCase: {"bodies"},  # follow from the case's bodies and the motions
    MemberGroup: {"from_points", "to_points", "cost_by_length"},  # its ends and its costs are compared
}
# What later versions added, and left out by most: files from before know nothing of it.
_ADDED = {"shared", "mirrored", "variables", "prices", "powers", "candidates", "movable", "points", "sizes",
          "defined", "reached", "moved", "follows"}  # fmt: skip
_DESIGN = {"initial", "lower", "upper", "power"}
_MAY_DIFFER = {"optimizer.max_iterations", "optimizer.tolerance", "optimizer.starts"}


def describe(case: Case) -> str:
    """The case as JSON: {key path: value}; long arrays by their hash."""
    return json.dumps(dict(_leaves("", case)), ensure_ascii=False)


def differences(stored: str, case: Case) -> tuple[str, ...]:
    """Paths of the keys in which `case` differs from a stored description, in the case's order.

    The iteration limit, the tolerance and the number of starts are left out: a run may be resumed with
    others.
    """
    before: dict[str, str] = json.loads(stored)
    now = dict(_leaves("", case))
    keys = [*now, *(key for key in before if key not in now)]
    return tuple(key for key in keys if key not in _MAY_DIFFER and before.get(key) != now.get(key))


def _leaves(path: str, value: Any) -> Iterator[tuple[str, str]]:
    if is_dataclass(value) and not isinstance(value, type):
        kind = getattr(value, "type", None)
        if isinstance(kind, str) and not any(f.name == "type" for f in fields(value)):
            yield _join(path, "type"), kind
        ignored = _IGNORED.get(type(value), set())
        if isinstance(value, Case) and value.uncertainty is None:
            ignored = ignored | {"uncertainty"}  # as before there was such a section
        for f in fields(value):
            if f.name in _ADDED and _is_nothing(getattr(value, f.name)):
                continue
            if f.name not in ignored and hasattr(value, f.name):
                yield from _leaves(_key(path, f.name, value), getattr(value, f.name))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(_join(path, str(key)), item)
    elif isinstance(value, (tuple, list)) and any(is_dataclass(item) for item in value):
        for index, item in enumerate(value):
            name = getattr(item, "name", None)
            if isinstance(name, str) and name:
                # A case without load cases has one called `default`, of which the file knows nothing.
                common = isinstance(item, LoadCase) and name == "default"
                yield from _leaves("" if common else _join(path, name), item)
            else:
                yield from _leaves(path if path.endswith(".law") else f"{path}[{index}]", item)
    else:
        yield path, _text(value)


def _is_nothing(value: Any) -> bool:
    return value is None or (not is_dataclass(value) and not len(value))


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        if array.size <= 8:
            return json.dumps(array.tolist())
        digest = hashlib.blake2b(array.tobytes(), digest_size=16).hexdigest()
        return f"{array.dtype.str}{list(array.shape)} {digest}"
    if isinstance(value, (frozenset, set)):
        return json.dumps(sorted(value))
    if isinstance(value, Enum):
        return str(value.value)
    return repr(value)  # exact for floats


def _key(path: str, field: str, owner: Any) -> str:
    """The file's key for a field, where the two differ."""
    if isinstance(owner, MemberGroup) and field == "powers":
        return f"design.power.{owner.name}"  # in the place of the last of them
    if isinstance(owner, MemberGroup) and field in _DESIGN:
        return f"design.{field}.{owner.name}"
    if isinstance(owner, MemberGroup) and field == "laws" and len(owner.laws) == 1:
        return _join(path, "law")
    if isinstance(owner, Case) and field == "movable":
        return "points.movable"
    if isinstance(owner, MemberGroup) and field in ("sizes", "prices"):
        return f"design.catalogue.{owner.name}.{field}"
    if isinstance(owner, Case) and field in _ADDED and field != "points":
        return f"design.{field}"
    if isinstance(owner, LoadCase) and field in ("start", "end"):
        return _join(path, f"time.{field}")
    return _join(path, field)


def _join(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name
