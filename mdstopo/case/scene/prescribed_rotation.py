"""Prescribed rotations in space: what the file says of them, and the angular velocity that they start with."""

from __future__ import annotations

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.geometry.start_rotations import unit
from mdstopo.case.model import Prescribed, PrescribedRotation
from mdstopo.case.scene.load_case_times import TimeSpan
from mdstopo.case.scene.prescribed import (
    AGREE,
    KINDS,
    agree,
    position_at_start,
    prescribed,
    rate_at_start,
    size_of,
    value_at,
)
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, listed, number_text

ANGLES = ("roll", "pitch", "yaw")


def prescribed_rotation(fields: Fields) -> PrescribedRotation | None:
    """The rotation that the keys of a motion prescribe; None where they do not go together, which has been noted."""
    if fields["angular_velocity"] is not None:
        return PrescribedRotation(angular_velocity=fields["angular_velocity"])
    if fields["axis"] is not None:
        axis = _axis(fields)
        angle = prescribed(fields) if any(kind in fields.stated for kind in KINDS) else None
        return None if angle is None else PrescribedRotation((angle,), (axis[0], axis[1], axis[2]))
    angles = tuple(each for each in (prescribed(fields[name]) for name in ANGLES) if each is not None)
    return PrescribedRotation(angles) if len(angles) == len(ANGLES) else None


def _axis(fields: Fields) -> list[float]:
    axis: list[float] = unit(fields["axis"]).tolist()
    return axis


def turning_rate_at_start(fields: Fields, body: Fields, span: TimeSpan, reading: Reading) -> tuple[float, ...] | None:
    """The global angular velocity at the start; notes what does not agree with the body.

    None where the keys say nothing that could be used, which has been noted.

    fields: keys of the rotation.
    body: keys of the body.
    span: when the load case runs.
    reading: takes the mistakes.
    """
    if fields["axis"] not in (None, BAD):
        kinds = [kind for kind in KINDS if kind in fields.stated]
        if len(kinds) != 1:
            found = f"found {' and '.join(kinds)}" if kinds else "found none"
            reading.mistake(fields.path, f"{found}, needed beside axis is exactly one of {listed(KINDS)}")
            return None
    if not fields.good():
        return None
    rotation = prescribed_rotation(fields)
    if rotation is None:
        return None
    stated = np.array(body["angular_velocity"], dtype=np.float64)
    if rotation.angular_velocity:
        rates = np.array([value_at(signal, span.start) for signal in rotation.angular_velocity])
        scale = max(size_of(signal) for signal in rotation.angular_velocity)
        _compare(rates, scale, body, inside(fields.path, "angular_velocity"), reading)
        return tuple(rates.tolist())
    if rotation.axis is not None:
        (angle,) = rotation.angles
        path = inside(fields.path, angle.kind)
        along = np.array(rotation.axis)
        start = _angle(angle, float(along @ stated), path, span, reading)
        if start is None:
            return None
        _compare(along * start[0], start[1], body, path, reading)
        return tuple((along * start[0]).tolist())
    found_rates = []
    for k, (name, angle) in enumerate(zip(ANGLES, rotation.angles, strict=True)):
        path = inside(inside(fields.path, name), angle.kind)
        start = _angle(angle, float(stated[k]), path, span, reading)
        if start is None:
            return None
        if "angular_velocity" in body.stated:
            agree(start[0], body["angular_velocity"][k], start[1], _words(body, k), path, reading)
        found_rates.append(start[0])
    return tuple(found_rates)


def _angle(angle: Prescribed, own: float, path: str, span: TimeSpan, reading: Reading) -> tuple[float, float] | None:
    """Rate of an angle at the start, and its size; None where it cannot start, which is noted. own: the body's rate."""
    if angle.kind == "acceleration":
        return own, abs(own)
    if angle.kind == "velocity":
        return rate_at_start(angle.signal, span, path, reading)
    start = position_at_start(angle.signal, span, path, reading)
    if start is None:
        return None
    value, rate, per_second = start
    if not abs(value) <= AGREE * size_of(angle.signal):
        reading.mistake(path, f"found {number_text(value)} at the start, needed is 0: it counts from there")
        return None
    return rate, per_second


def _compare(rates: FloatArray, scale: float, body: Fields, path: str, reading: Reading) -> None:
    """Note the components (3,) that the body states otherwise."""
    if "angular_velocity" in body.stated:
        for k in range(3):
            size = max(scale, float(np.abs(rates).max()))
            agree(float(rates[k]), body["angular_velocity"][k], size, _words(body, k), path, reading)


def _words(body: Fields, k: int) -> str:
    return f"{body.path}.angular_velocity's {'xyz'[k]}"
