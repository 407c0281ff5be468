"""Values as JSON can have them. NumPy is not imported here: commands that compute nothing are to start at once."""

import math
from collections.abc import Mapping
from typing import Any


def json_value(value: Any) -> Any:
    """A value as JSON can have it: arrays and tuples as lists, NaN and infinities as null, other objects as text."""
    if isinstance(value, Mapping):
        return {str(key): json_value(each) for key, each in value.items()}
    if value is None or isinstance(value, (str, bool, int)):
        return value
    if hasattr(value, "tolist"):
        return json_value(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (list, tuple)):
        return [json_value(each) for each in value]
    return str(value)
