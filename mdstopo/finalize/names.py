"""Defined names that were design variables, at the values of a design: numbers, from which expressions still follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.design.named_variables import what_follows
from mdstopo.case.keys.definitions import MARK, SECTION
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import Case, Law, VolumeRow
from mdstopo.case.reader import read_case
from mdstopo.case.text.nodes import Node

Plain = dict[str, Any]


def with_names_fixed(case: Case, design: FloatArray) -> tuple[Case, FloatArray]:
    """The case with defined names where a design (N + P,) has them, none of them a variable any more; the design
    without them. What they cost is taken off the bounds of volume rows."""
    if case.follows is None:
        return case, design
    named = case.defined_variables
    parts = case.space.parts
    own = np.array([parts[each.name].start for each in named])
    values = [min(max(float(design[i]), each.lower), each.upper) for i, each in zip(own, named, strict=True)]
    fixed: dict[str, Any] = {}
    for each, value in zip(named, values, strict=True):
        fixed |= {f"{SECTION}.{each.defined}": value, f"design.variables.{each.name}.initial": value}
    there = read_case(case.text, path=case.path, overrides={**case.overrides, **fixed})
    gone = own - case.n_design

    def without(row: Any) -> Any:
        if not isinstance(row, VolumeRow) or not len(row.prices):
            return row
        spent = float(row.prices[gone] @ np.array(values))
        return replace(row, bound=row.bound - spent, prices=np.delete(row.prices, gone))

    return replace(
        there,
        variables=tuple(each for each in there.variables if not each.defined),
        constraints=tuple(without(row) for row in there.constraints),
        follows=None,
    ), np.delete(design, own)


def kept_expressions(root: Node, case: Case) -> tuple[frozenset[str], Plain]:
    """The key paths of expressions that a final case keeps, and its section `define`: of names that were variables.

    root: the case as it is written. None are kept where ends of members follow from them, or members have values of
    their own: these ends, and groups of these members, are written as numbers.
    """
    keys, defined = what_follows(root)
    if any(key.startswith("points.") for key in keys) or any(each.each == "member" for each in case.variables):
        return frozenset(), {}
    return frozenset(keys), defined


def following_law(stated: Any, place: int, law: Law, written: Plain, factor: float) -> Plain:
    """A law of a sized member in which numbers that follow from names are expressions again.

    stated: the law, or the laws, of its group in the document. place: which of these it is. law: the same as read.
    written: the law with the member's size in it. factor: that size to its power.
    """
    own = stated[place] if isinstance(stated, list) else stated
    scaled = with_role(type(law), "scales")
    found = dict(written)
    for key, value in own.items():
        if isinstance(value, str) and value.startswith(MARK) and key != "type":
            expression = value.removeprefix(MARK).strip()
            sized = key in scaled and factor != 1.0
            found[key] = f"={factor!r} * ({expression})" if sized else f"={expression}"
        elif key == "parameters" and isinstance(value, Mapping):
            texts = {word: each for word, each in value.items() if isinstance(each, str)}
            found[key] = {**found.get(key, {}), **texts}
    return found
