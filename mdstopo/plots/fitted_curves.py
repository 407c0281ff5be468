"""What a fitted scene says between the measured times, as an instrument with its offset and delay would record it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mdstopo.plots.source import SAMPLES, Floats, Source
from mdstopo.plots.watch import response_history


def fitted_curves(source: Source, content: Mapping[str, Any]) -> dict[str, tuple[Floats, Floats]]:
    """(time, value) of each series, from its first to its last measurement; none of a case without a fit.

    source: of a result of `mdstopo fit`. content: of `fit.record.content`.
    """
    found: dict[str, tuple[Floats, Floats]] = {}
    for each in content["series"]:
        if "predicted" not in each:
            continue
        span = source.case.load_case(each["load_case"])
        measured = np.array(each["t"], dtype=np.float64)
        begin, end = np.clip(np.array([measured.min(), measured.max()]) - each["delay"], span.start, span.end)
        times = np.linspace(begin, end, SAMPLES)
        history = response_history(source.engine, source.design, each["load_case"], times)
        found[each["name"]] = times + each["delay"], history[each["name"]] + each["offset"]
    return found
