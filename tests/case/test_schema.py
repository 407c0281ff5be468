"""The JSON Schema is valid, accepts what the reader accepts and refuses what one value alone makes wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from mdstopo.case.reader import load_case, read_case
from mdstopo.case.schema.json_schema import json_schema
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.nodes import MAPPING, SEQUENCE, Node, parse
from tests.tiers import examples

from .scenes import EVERYTHING, EVERYTHING_IN_SPACE, SMALL

CASES = sorted((Path(__file__).parents[2] / "cases").glob("*.yaml"))
VALIDATOR = Draft202012Validator(json_schema())


def data(node: Node) -> Any:
    if node.kind == MAPPING:
        return {key: data(value) for key, (_, value) in node.entries.items()}
    if node.kind == SEQUENCE:
        return [data(item) for item in node.items]
    return node.scalar()


def as_data(text: str) -> Any:
    node = parse(text, lambda mistake: None)
    assert node is not None
    return data(node)


def test_the_schema_is_a_schema() -> None:
    Draft202012Validator.check_schema(json_schema())


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_the_cases_of_the_project_pass(path: Path) -> None:
    assert load_case(path)
    assert not list(VALIDATOR.iter_errors(as_data(path.read_text())))


def test_a_case_with_every_key_passes() -> None:
    assert not list(VALIDATOR.iter_errors(as_data(EVERYTHING)))


def test_a_case_in_space_with_every_key_passes() -> None:
    assert read_case(EVERYTHING_IN_SPACE).dimension == 3
    assert not list(VALIDATOR.iter_errors(as_data(EVERYTHING_IN_SPACE)))


def test_every_key_of_the_format_has_its_words_limits_and_defaults_in_the_schema() -> None:
    solver = json_schema()["else"]["else"]["properties"]["solver"]["properties"]
    assert solver["integrator"]["enum"] == ["auto", "gauss", "runge_kutta", "generalized_alpha", "esdirk"]
    assert solver["integrator"]["default"] == "auto"
    assert solver["tolerance"]["exclusiveMinimum"] == 0
    assert solver["tolerance"]["description"]
    assert json_schema()["else"]["else"]["required"] == ["format", "time", "bodies"]


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths of all values below `value`."""
    found = []
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in pairs:
        found += [(*path, key), *places(part, (*path, key))]
    return found


def with_value(value: Any, path: tuple[Any, ...], new: Any) -> Any:
    """A copy of `value` with the part at `path` replaced, or left out where `new` is DROP."""
    if not path:
        return new
    copy: Any = dict(value) if isinstance(value, dict) else list(value)
    if len(path) == 1 and new is DROP:
        del copy[path[0]]
    else:
        part = None if len(path) == 1 else value[path[0]]
        copy[path[0]] = with_value(part, path[1:], new)
    return copy


DROP = object()
SOURCES = [as_data(SMALL), as_data(EVERYTHING), as_data(EVERYTHING_IN_SPACE)]
VALUES = [None, True, "text", "", "energy", "ground", 0, 1, -1, 2.5, 20.0, 1e9, [], [1], [1, 2], {}, {"x": 1}]
VALUES += [[[0, 1], [2, 3]], {"file": 3}, {"table": [[0, 1]]}, {"table": []}, ["belts"], [0.5, 0.5, 0.5]]
NEW = st.sampled_from([DROP, *VALUES])


@given(source=st.sampled_from(SOURCES), new=NEW, choose=st.randoms(use_true_random=False))
@settings(max_examples=examples(30, 400), deadline=None, derandomize=True)
def test_what_the_schema_refuses_the_reader_refuses(source: Any, new: Any, choose: Any) -> None:
    from mdstopo.case.text.overrides import as_yaml

    changed = with_value(source, choose.choice(places(source)), new)
    by_schema = not VALIDATOR.is_valid(changed)
    try:
        read_case(as_yaml(changed))
    except CaseError:
        return
    assert not by_schema


def test_what_a_single_value_makes_wrong_the_schema_refuses() -> None:
    source = SOURCES[1]
    for path, new in [
        (("bodies", "a", "mass"), 0),
        (("bodies", "a", "mas"), 1),
        (("bodies", "ground"), {"mass": 1, "inertia": 1, "position": [0, 0]}),
        (("bodies", "1a"), {"mass": 1, "inertia": 1, "position": [0, 0]}),
        (("members", "belts", "law"), {"type": "spring"}),
        (("members", "belts", "law"), {"type": "sprng", "stiffness": 1}),
        (("members", "belts", "law", "gap"), 1),
        (("members", "belts", "cost"), "size"),
        (("points", "edge", "grid"), {"line": {"from": [0, 0], "to": [1, 1], "count": 2.5}}),
        (("points", "edge", "grid", "circle"), {"center": [0, 0], "radius": 1, "count": 3}),
        (("constraints", 0, "equals"), 3),
        (("constraints", 0, "limit"), DROP),
        (("constraints", 0, "over_time"), "max"),
        (("objectives", "G1", "response"), "enrgy"),
        (("solver", "spectral_radius"), 2),
        (("loads", 1, "force"), [0, 0]),
        (("format",), 2),
        (("optimizer", "max_iterations"), -1),
        (("optimizer", "move_limt"), 1),
    ]:
        assert not VALIDATOR.is_valid(with_value(source, path, new)), path
