"""Prescribed motions: merged by load case, and what they say of the start.

A position or velocity is absolute. What the body itself states must agree with it; what it does not state is
taken from it. The scene is drawn once, so all load cases must start a body at one angle.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.case.arrays import Signal, Table
from mdstopo.case.geometry import Geometry
from mdstopo.case.model import GROUND, Motion, Prescribed
from mdstopo.case.reading import BAD, Fields, Reading
from mdstopo.case.spline import value_and_slope
from mdstopo.case.value import Value, frozen
from mdstopo.case.words import inside, number_text, shown

if TYPE_CHECKING:
    from mdstopo.case.loading import Window

AGREE = 1e-8
"""How far, relative to the values at hand, a stated start may lie from a prescribed one."""
KINDS = ("acceleration", "velocity", "position")


@frozen
class Start(Value):
    """What motions prescribe at the start; None where they do not. velocity: by coordinate."""

    angle: float | None = None
    velocity: tuple[float | None, ...] = (None, None)
    angular_velocity: float | None = None


def value_at(signal: Signal, time: float) -> float:
    """A scalar signal at `time`: linear between rows, constant outside, right-continuous."""
    if not isinstance(signal, Table):
        return signal
    t, x = signal.times, signal.values[:, 0]
    i = int(np.searchsorted(t, time, side="right")) - 1
    if i < 0:
        return float(x[0])
    if i == len(t) - 1:
        return float(x[-1])
    return float(x[i] + (x[i + 1] - x[i]) * ((time - t[i]) / (t[i + 1] - t[i])))


def merged(top: Fields, reading: Reading) -> dict[str, dict[str, Fields]]:
    """Load case -> body -> its motion as read: the common one, or the load case's own in its place, whole."""
    common = _by_body(top["motions"], reading)
    cases = top["load_cases"]
    if cases is BAD or not cases:
        return {} if cases is BAD else {"default": common}
    return {
        name: common | (_by_body(fields["motions"], reading) if isinstance(fields, Fields) else {})
        for name, fields in cases.items()
    }


def _by_body(entries: Any, reading: Reading) -> dict[str, Fields]:
    found: dict[str, Fields] = {}
    for fields in entries if isinstance(entries, list) else ():
        if fields is BAD or fields["body"] is BAD:
            continue
        body, path = fields["body"], inside(fields.path, "body")
        if body == GROUND:
            reading.mistake(path, "ground does not move: no motion can be prescribed to it")
        elif body in found:
            message = f"{shown(body)} is listed at {found[body].path} already; a body is listed once"
            reading.mistake(path, message)
        else:
            found[body] = fields
    return found


def build_motions(by_body: dict[str, Fields], geometry: Geometry) -> tuple[Motion, ...]:
    """The motions that can be made."""
    built = []
    for body, fields in by_body.items():
        if fields.good():
            parts = {axis: _prescribed(fields[axis]) for axis, _ in geometry.coordinates}
            built.append(Motion(body, **parts))
    return tuple(built)


def _prescribed(fields: Fields | None) -> Prescribed | None:
    if fields is None:
        return None
    kind = next(kind for kind in KINDS if kind in fields.stated)
    return Prescribed(kind, fields[kind][0])


def resolve_starts(
    top: Fields,
    times: dict[str, Window],
    by_case: dict[str, dict[str, Fields]],
    geometry: Geometry,
    reading: Reading,
) -> dict[tuple[str, str], Start]:
    """(load case, body) -> what is prescribed at the start; notes what does not agree with the body."""
    starts: dict[tuple[str, str], Start] = {}
    bodies = top["bodies"]
    if bodies is BAD:
        return starts
    for case, by_body in by_case.items():
        window = times.get(case)
        if window is None or not window.good:
            continue
        for name, motion in by_body.items():
            body = bodies.get(name)
            if isinstance(body, Fields) and body.good():
                starts[case, name] = _start(motion, body, window, geometry, reading)
    for name in bodies:
        _one_angle(name, bodies[name], by_case, starts, reading)
    return starts


def _start(motion: Fields, body: Fields, window: Window, geometry: Geometry, reading: Reading) -> Start:
    found: dict[str, float] = {}
    velocity: list[float | None] = [None] * geometry.number
    for axis, index in geometry.coordinates:
        part = motion[axis]
        if not isinstance(part, Fields) or not part.good():
            continue
        prescribed = _prescribed(part)
        if prescribed is None or prescribed.kind == "acceleration":
            continue
        signal, path = prescribed.signal, inside(part.path, prescribed.kind)
        rate = value_at(signal, window.start)
        scale = abs(rate)
        if isinstance(signal, Table):
            scale = float(np.abs(signal.values).max())
        if prescribed.kind == "position":
            assert isinstance(signal, Table)
            t, x = signal.times, signal.values[:, 0]
            if not (t[0] <= window.start and window.end <= t[-1]):
                runs = f"{number_text(float(t[0]))} to {number_text(float(t[-1]))} s"
                needed = f"start {number_text(window.start)} to end {number_text(window.end)} s"
                reading.mistake(path, f"the table runs from {runs}; it must cover {needed}")
                continue
            value, rate = value_and_slope(t, x, window.start)
            if not (math.isfinite(value) and math.isfinite(rate)):
                reading.mistake(path, "the spline through the table is too steep for a number")
                continue
            stated = body["angle"] if index is None else body["position"][index]
            if index is not None or "angle" in body.stated:
                what = "angle" if index is None else f"position's {axis}"
                _agree(value, stated, scale, f"{body.path}'s {what}", path, reading)
            else:
                found["angle"] = value
            scale = float(np.ptp(x) / (window.end - window.start))
        key = "angular_velocity" if index is None else "velocity"
        if key in body.stated:
            stated = body[key] if index is None else body[key][index]
            _agree(rate, stated, scale, f"{body.path}.{key}", path, reading)
        elif index is None:
            found["angular_velocity"] = rate
        else:
            velocity[index] = rate
    return Start(velocity=tuple(velocity), **found)


def _agree(value: float, stated: float, scale: float, what: str, path: str, reading: Reading) -> None:
    """Note a mistake where a body does not start as its prescribed motion does.

    value: of the motion at the start.
    stated: by the body.
    scale: what the difference may be relative to, beside these two.
    what: the body's key, in words.
    path: where the motion stands in the file.
    reading: takes the mistake.
    """
    if not abs(value - stated) <= AGREE * max(abs(value), abs(stated), scale):
        now, then = number_text(value), number_text(stated)
        reading.mistake(path, f"found {now} at the start, but {what} states {then}; they must agree")


def _one_angle(
    name: str,
    body: Any,
    by_case: dict[str, dict[str, Fields]],
    starts: dict[tuple[str, str], Start],
    reading: Reading,
) -> None:
    """Notes load cases that would start the body at different angles."""
    first: tuple[str, float] | None = None
    for case, by_body in by_case.items():
        start = starts.get((case, name), Start())
        if not isinstance(body, Fields) or "angle" in body.stated:
            continue
        angle = 0.0 if start.angle is None else start.angle
        if first is None:
            first = (case, angle)
        elif abs(angle - first[1]) > AGREE:
            path = by_body[name].path if name in by_body else body.path
            reading.mistake(
                path,
                f"load case {case!r} starts {name!r} at the angle {number_text(angle)}, {first[0]!r} at "
                f"{number_text(first[1])}; the scene is drawn once, so they must agree",
            )
            return


def start_angle(name: str, starts: dict[tuple[str, str], Start]) -> float | None:
    """The angle that motions prescribe for a body at the start, or None."""
    return next((s.angle for (_, body), s in starts.items() if body == name and s.angle is not None), None)
