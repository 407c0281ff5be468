"""Load cases: common part and own part merged; loads and motions in their normal form."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from mdstopo.case.arrays import Signal, Table, TimeFormula, VectorSignal
from mdstopo.case.model import GROUND, AnyBody, Components, Load, LoadCase, Motion
from mdstopo.case.objects.frames import Frames
from mdstopo.case.scene.load_case_times import DEFAULT, TimeSpan
from mdstopo.case.scene.motions import Start
from mdstopo.case.scene.prescribed import size_of
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text


def build_load_cases(
    top: Fields,
    times: dict[str, TimeSpan],
    motions: dict[str, tuple[Motion, ...]],
    starts: dict[tuple[str, str], Start],
    frames: Frames,
    reading: Reading,
) -> tuple[LoadCase, ...]:
    """The load cases of the case, without those that cannot be made; mistakes are noted.

    top: the whole file.
    times: when each load case runs, by its name.
    motions: prescribed motions, by load case.
    starts: what these prescribe at the start, by load case and body.
    frames: the bodies.
    reading: takes the mistakes.
    """
    common = build_loads(top["loads"], frames, reading)
    cases = top["load_cases"] or {DEFAULT: None}
    built = []
    for name, span in times.items():
        fields = cases.get(name)
        own = build_loads(fields["loads"], frames, reading) if isinstance(fields, Fields) else ()
        gravity, path = top["gravity"], "gravity"
        if isinstance(fields, Fields) and "gravity" in fields.stated:
            gravity, path = fields["gravity"], inside(fields.path, "gravity")
        if gravity is BAD or not span.good or fields is BAD:
            continue
        _check_weights(gravity, frames, path, reading)
        moving = [body for body in frames.bodies.values() if body.name != GROUND]
        bodies = tuple(_started(body, starts.get((name, body.name))) for body in moving)
        built.append(LoadCase(name, gravity, span.start, span.end, common + own, motions.get(name, ()), bodies))
    return tuple(built)


def _started(body: AnyBody, start: Start | None) -> AnyBody:
    """The body with the start velocities that a motion prescribes and the body does not state."""
    if start is None:
        return body
    velocity = tuple(own if given is None else given for own, given in zip(body.velocity, start.velocity, strict=True))
    rate = body.angular_velocity if start.angular_velocity is None else start.angular_velocity
    return replace(body, velocity=velocity, angular_velocity=rate)


def _check_weights(gravity: Components, frames: Frames, path: str, reading: Reading) -> None:
    for body in frames.bodies.values():
        if body.name != GROUND and not all(math.isfinite(body.mass * g) for g in gravity):
            reading.mistake(path, f"the weight of {body.name!r} is too large for a number")


def build_loads(entries: Any, frames: Frames, reading: Reading) -> tuple[Load, ...]:
    """The loads of a section, without those that cannot be made; mistakes are noted."""
    built = []
    for fields in entries if isinstance(entries, list) else ():
        load = None if fields is BAD else _build_load(fields, frames, reading)
        if load is not None:
            built.append(load)
    return tuple(built)


def _build_load(fields: Fields, frames: Frames, reading: Reading) -> Load | None:
    name = fields["body"]
    if name == GROUND:
        reading.mistake(inside(fields.path, "body"), "ground does not move: a load on it does nothing")
        return None
    if name not in frames.bodies or not fields.good():
        return None
    body = frames.bodies[name]
    at = frames.local_point(name, fields["at"], fields["frame"], inside(fields.path, "at"), reading)
    return frames.geometry.build_load(fields, body, at, reading)


def scaled(signals: VectorSignal, factor: float, path: str, reading: Reading) -> Any:
    """Accelerations as forces or moments, BAD where they overflow."""
    if not all(math.isfinite(size_of(signal) * factor) for signal in signals):
        reading.mistake(path, f"times {number_text(factor)} it is too large for a number")
        return BAD
    return tuple(times_of(signal, factor) for signal in signals)


def times_of(signal: Signal, factor: float) -> Signal:
    """A signal with all its values multiplied by a factor."""
    if isinstance(signal, TimeFormula):
        return signal.times(factor)
    return Table(signal.times, signal.values * factor) if isinstance(signal, Table) else signal * factor
