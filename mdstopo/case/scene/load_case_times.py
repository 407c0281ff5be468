"""When load cases run."""

from __future__ import annotations

import math
from typing import Any

from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text

DEFAULT = "default"


class TimeSpan:
    """When a load case runs, and where the file says so. good: whether both times could be read."""

    def __init__(self, start: Any, end: Any, path: str) -> None:
        self.good = start is not BAD and end is not BAD and start is not None and end is not None
        self.start: float = start if self.good else 0.0
        self.end: float = end if self.good else 0.0
        self.path = path


def time_spans(top: Fields, reading: Reading) -> dict[str, TimeSpan]:
    """Start and end of every load case (of `default` where there are none); its own times come before common ones."""
    time = top["time"]
    common_start, common_end = (BAD, BAD) if time is BAD else (time["start"], time["end"])
    found: dict[str, TimeSpan] = {}
    common = TimeSpan(common_start, common_end, "time")
    cases = top["load_cases"]
    if cases is BAD:
        return {}
    for name, fields in (cases or {}).items():
        own = None if fields is BAD else fields["time"]
        if own is None or own is BAD:
            found[name] = TimeSpan(common_start, common_end, "time") if own is None else TimeSpan(BAD, BAD, "")
            continue
        start = own["start"] if "start" in own.stated else common_start
        end = own["end"] if "end" in own.stated else common_end
        found[name] = TimeSpan(start, end, own.path)
    for span in [common, *found.values()]:
        if span.good and not (span.end > span.start and math.isfinite(span.end - span.start)):
            path = inside(span.path, "end")
            now, start_text = number_text(span.end), number_text(span.start)
            message = f"found {now}, allowed is a time after start {start_text}"
            reading.mistake(path, message)
            span.good = False
    return found or {DEFAULT: common}
