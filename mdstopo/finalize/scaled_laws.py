"""A law with the size of a member in it: f* = alpha^mu f (Eq. 12) as a law of its own."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from mdstopo.case.arrays import Table
from mdstopo.case.laws.expression_law import OfFormulas
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import Law


def scaled_law(law: Law, factor: float) -> dict[str, Any]:
    """The law times a factor, as the mapping of the case file; keys that have their defaults are left out."""
    if isinstance(law, OfFormulas):
        return law.stated_times(factor)
    stated: dict[str, Any] = {"type": law.type}
    scaled = with_role(type(law), "scales")
    for each in fields(law):
        value = getattr(law, each.name)
        if each.default is not MISSING and value == each.default:
            continue
        stated[each.name] = _times(value, factor if each.name in scaled else 1.0)
    return stated


def _times(value: Any, factor: float) -> Any:
    """A number, or rows whose last column is a force, times a factor."""
    if isinstance(value, Table):
        value = np.column_stack([value.times, value.values])
    if isinstance(value, np.ndarray):
        return (value * np.array([1.0, factor])).tolist()
    return value * factor if isinstance(value, float) and factor != 1.0 else value
