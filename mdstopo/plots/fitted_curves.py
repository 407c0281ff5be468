"""Curves of a fit: each series between the measured times, with the instrument's offset and delay, and profiles."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mdstopo.plots.objectives_over_time import response_history
from mdstopo.plots.source import SAMPLES, Floats, Source

#: points of a profile's curves
FINE = 81


class ProfileCurves(NamedTuple):
    """A profile as it is drawn.

    values, rise (k,): where the estimate was held, and by how much the squares rise there. fine (FINE,): values between
    the ends; between, parabola (FINE,): the rise there, by the profile and as the interval has it. end: the rise at
    which the interval ends.
    """

    values: Floats
    rise: Floats
    fine: Floats
    between: Floats
    parabola: Floats
    end: float


def profile_curves(estimate: Mapping[str, Any], profile: Mapping[str, Any]) -> ProfileCurves:
    """The curves of an estimate's profile. estimate, profile: of `fit.fit_record.content`."""
    values, t = (np.array([np.nan if x is None else x for x in profile[key]]) for key in ("values", "t"))
    known = np.isfinite(t)
    fine = np.linspace(values[0], values[-1], FINE)
    factor, straight = ((x - estimate["value"]) / estimate["deviation"] for x in (estimate["high"], fine))
    between = np.interp(fine, values[known], t[known])

    def rise(at: Floats, seen: Floats) -> Floats:
        """How much the squares rise; where t has the other side's sign they fall."""
        return np.asarray(np.sign(at - estimate["value"]) * seen * np.abs(seen))

    return ProfileCurves(
        values[known], rise(values[known], t[known]), fine, rise(fine, between), straight**2, float(factor**2)
    )


def fitted_curves(source: Source, content: Mapping[str, Any]) -> dict[str, tuple[Floats, Floats]]:
    """(time, value) of each series, from its first to its last measurement; none of a case without a fit.

    source: of a result of `mdstopo fit`. content: of `fit.fit_record.content`.
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
