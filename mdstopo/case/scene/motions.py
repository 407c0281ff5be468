"""Prescribed motions: merged by load case, and what they say of the start.

A position or velocity is absolute. What the body itself states must agree with it; what it does not state is
taken from it. The scene is drawn once, so all load cases must start a body at one angle.
"""

from __future__ import annotations

from typing import Any

from mdstopo.case.model import GROUND, Motion
from mdstopo.case.objects.plane_or_space import Geometry
from mdstopo.case.scene.load_case_times import TimeSpan
from mdstopo.case.scene.prescribed import AGREE, agree, position_at_start, prescribed, rate_at_start, size_of
from mdstopo.case.scene.prescribed_rotation import prescribed_rotation, turning_rate_at_start
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, number_text, shown
from mdstopo.case.value import Value, frozen


@frozen
class Start(Value):
    """What a motion prescribes at the start: position and velocity, None where it does not. velocity: by coordinate.

    angular_velocity: a number in the plane, three in space.
    """

    angle: float | None = None
    velocity: tuple[float | None, ...] = (None, None)
    angular_velocity: float | tuple[float, ...] | None = None


def merged(top: Fields, reading: Reading) -> dict[str, dict[str, Fields]]:
    """By load case and body, the body's motion as read: the common one, or in its place the load case's own."""
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
    """The prescribed motions of a section, without those that cannot be made; mistakes are noted."""
    built = []
    for body, fields in by_body.items():
        if fields.good():
            parts: dict[str, Any] = {axis: prescribed(fields[axis]) for axis, _ in geometry.coordinates}
            if fields.get("rotation") is not None:
                parts["rotation"] = prescribed_rotation(fields["rotation"])
            built.append(Motion(body, **parts))
    return tuple(built)


def resolve_starts(
    top: Fields,
    times: dict[str, TimeSpan],
    by_case: dict[str, dict[str, Fields]],
    geometry: Geometry,
    reading: Reading,
) -> dict[tuple[str, str], Start]:
    """By (load case, body), what motions prescribe at the start; notes what does not agree with the body."""
    starts: dict[tuple[str, str], Start] = {}
    bodies = top["bodies"]
    if bodies is BAD:
        return starts
    for case, by_body in by_case.items():
        span = times.get(case)
        if span is None or not span.good:
            continue
        for name, motion in by_body.items():
            body = bodies.get(name)
            if isinstance(body, Fields) and body.good():
                starts[case, name] = _start(motion, body, span, geometry, reading)
    for name in bodies:
        _one_angle(name, bodies[name], by_case, starts, reading)
    return starts


def _start(motion: Fields, body: Fields, span: TimeSpan, geometry: Geometry, reading: Reading) -> Start:
    found: dict[str, Any] = {}
    velocity: list[float | None] = [None] * geometry.number
    for axis, index in geometry.coordinates:
        part = motion[axis]
        if not isinstance(part, Fields) or not part.good():
            continue
        given = prescribed(part)
        if given is None or given.kind == "acceleration":
            continue
        path = inside(part.path, given.kind)
        if given.kind == "velocity":
            moves = rate_at_start(given.signal, span, path, reading)
            if moves is None:
                continue
            rate, scale = moves
        else:
            start = position_at_start(given.signal, span, path, reading)
            if start is None:
                continue
            value, rate, per_second = start
            scale = size_of(given.signal)
            stated = body["angle"] if index is None else body["position"][index]
            if index is not None or "angle" in body.stated:
                what = "angle" if index is None else f"position's {axis}"
                agree(value, stated, scale, f"{body.path}'s {what}", path, reading)
            else:
                found["angle"] = value
            scale = per_second
        key = "angular_velocity" if index is None else "velocity"
        if key in body.stated:
            stated = body[key] if index is None else body[key][index]
            agree(rate, stated, scale, f"{body.path}.{key}", path, reading)
        elif index is None:
            found["angular_velocity"] = rate
        else:
            velocity[index] = rate
    turn = motion.get("rotation")
    if isinstance(turn, Fields):
        rates = turning_rate_at_start(turn, body, span, reading)
        if rates is not None and "angular_velocity" not in body.stated:
            found["angular_velocity"] = rates
    return Start(velocity=tuple(velocity), **found)


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
