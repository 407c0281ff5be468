"""Cases from text and from dictionaries, which are read as a user's file is."""

import json
from collections.abc import Mapping
from typing import Any

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case


def case_of(text: str, **solver: object) -> Case:
    """A case from its text, with solver settings."""
    return read_case(text, overrides={f"solver.{key}": str(value) for key, value in solver.items()})


def case_from(scene: Mapping[str, Any], **sections: Any) -> Case:
    """A case from its sections, of which some are replaced or added; JSON is YAML."""
    return read_case(json.dumps({"format": 1, **scene, **sections}))
