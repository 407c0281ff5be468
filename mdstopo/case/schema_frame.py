"""Format 1 of the case file: what coordinates are measured in. See `mdstopo.case.schema_case`."""

from __future__ import annotations

from mdstopo.case.kinds import explained
from mdstopo.case.records import Key

FRAMES = explained(
    {
        "global": "global coordinates in the configuration at the start",
        "body": "the body's own coordinates: from its centre of mass, along axes that turn with it",
    }
)
FRAME = Key("frame", FRAMES, "what the coordinates beside it are measured in", default="global")
