"""The section `fit`: keys that lead to numbers, bounds that make sense, what was measured."""

from __future__ import annotations

import math

from mdstopo.case.objects.fitting import Estimate, Fit, FitNumber, Series
from mdstopo.case.objects.frames import Frames
from mdstopo.case.sections.problem_sections import build_response, load_case_of
from mdstopo.case.text.key_paths import SECTIONS, led_to, number_at, why_fixed
from mdstopo.case.text.nodes import Node
from mdstopo.case.text.overrides import WrongPathError, steps_of
from mdstopo.case.text.reading import BAD, Fields, Reading, found, is_good
from mdstopo.case.text.words import inside, number_text


def build_fit(top: Fields, root: Node, frames: Frames, reading: Reading) -> Fit | None:
    """The section `fit`; None where it could not be read. root: the whole case."""
    fields = top["fit"]
    if not isinstance(fields, Fields):
        return None
    numbers = _numbers(fields, root, reading)
    series = _series(fields, top, frames, reading)
    if not is_good(fields):
        return None
    return Fit(tuple(numbers), tuple(series), fields["loss"], fields["starts"], fields["seed"], fields["confidence"])


def _numbers(fields: Fields, root: Node, reading: Reading) -> list[FitNumber]:
    """What is estimated of the case; mistakes are noted."""
    path = inside(fields.path, "estimate")
    stated = fields["estimate"]
    if stated == {}:
        reading.mistake(path, "found {}, needed is at least one key of the case with its bounds")
    built: dict[str, FitNumber] = {}
    for written, keys in stated.items() if isinstance(stated, dict) else ():
        here = inside(path, written)
        try:
            key, node = led_to(written, root)
            why = why_fixed([str(step) for step in steps_of(written)], root, SECTIONS)
            if why:
                raise WrongPathError(key, f"{key} cannot be estimated: {why}")
        except WrongPathError as error:
            reading.mistake(here, error.message)
            continue
        value = reading.measured.get(key, number_at(node))
        if not math.isfinite(value):
            reading.mistake(here, f"found {found(node)} at {key}; what is estimated is one number")
        elif key in built:
            reading.mistake(here, f"{key} is estimated already")
        elif key in reading.followed:
            owner = reading.followed[key]
            reading.mistake(here, f"{key} cannot be estimated: it follows from the design variable {owner}")
        elif keys is not BAD and keys.good():
            bounds = _estimate(keys, value, reading)
            if bounds is not None:
                built[key] = FitNumber(key, bounds)
    return list(built.values())


def _estimate(keys: Fields, stated: float | None, reading: Reading) -> Estimate | None:
    """Bounds and start; stated: the number of the case, None where there is none."""
    lower, upper, initial = keys["lower"], keys["upper"], keys["initial"]
    if not lower < upper:
        message = f"found {number_text(lower)}, allowed is a number below upper {number_text(upper)}"
        reading.mistake(inside(keys.path, "lower"), message)
        return None
    if initial is None:
        within = stated is not None and lower <= stated <= upper
        initial = stated if within else 0.5 * (lower + upper)
    elif not lower <= initial <= upper:
        message = f"found {number_text(initial)}, allowed is {number_text(lower)} to {number_text(upper)}"
        reading.mistake(inside(keys.path, "initial"), message)
        return None
    return Estimate(initial, lower, upper)


def _series(fields: Fields, top: Fields, frames: Frames, reading: Reading) -> list[Series]:
    """What was measured; mistakes are noted."""
    built = []
    stated = fields["measured"]
    for name, keys in stated.items() if isinstance(stated, dict) else ():
        if keys is BAD:
            continue
        response = build_response(keys, frames, reading)
        load_case = load_case_of(keys, top, reading)
        offset, delay = _shift(keys, "offset", reading), _shift(keys, "delay", reading)
        if keys["value_scale"] == 0.0:
            reading.mistake(inside(keys.path, "value_scale"), "found 0, allowed is any other number")
        begin, end = keys["from"], keys["to"]
        if begin not in (None, BAD) and end not in (None, BAD) and not begin < end:
            message = f"found {number_text(end)}, allowed is a number above from {number_text(begin)}"
            reading.mistake(inside(keys.path, "to"), message)
        if response is None or load_case is None or offset is None or delay is None or not keys.good():
            continue
        as_stated = {key: keys[key] for key in ("file", "time", "value", "deviation", "time_scale", "value_scale")}
        built.append(Series(name, response, load_case, **as_stated, offset=offset, delay=delay, begin=begin, end=end))
    return built


def _shift(keys: Fields, name: str, reading: Reading) -> Estimate | None:
    """An offset or a delay: known, or between bounds."""
    stated = keys[name]
    if isinstance(stated, Fields):
        return _estimate(stated, 0.0, reading) if stated.good() else None
    return None if stated is BAD else Estimate(stated, stated, stated)
