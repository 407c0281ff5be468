"""Paths of drawings in SVG, as corners of areas.

Commands and their meaning are those of SVG 2, chapter "Paths"; arcs are turned into centres and angles as its appendix
on implementation says (from two ends to a centre).
"""

from __future__ import annotations

import cmath
import itertools
import math
import re
from collections.abc import Iterator

import numpy as np

from mdstopo.case.arrays import FloatArray, read_only
from mdstopo.case.text.words import shown

PIECES = 16
"""Straight pieces that stand for a curve."""
STEP = math.pi / 24
"""Most that a piece of an arc turns, rad."""
_TOKEN = re.compile(r"([A-Za-z])|([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|([\s,]+)")
_FLAG = re.compile(r"[\s,]*([01])[\s,]*")
#: how many numbers a command takes at a time
_TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_WORDS = "M, L, H, V, C, S, Q, T, A, Z in either case"


class PathError(ValueError):
    """The text is no path; a sentence without a full stop."""


def areas(text: str) -> tuple[FloatArray, ...]:
    """The closed lines (n, 2) of a path, each by its corners, y as the path has it. Raises PathError."""
    loops = [loop for loop in _Pen().lines(text) if len(loop) >= 3]
    if not loops:
        raise PathError("the path has no area: needed are three corners at least")
    whole = [read_only(np.array([[z.real, z.imag] for z in loop])) for loop in loops]
    if not all(np.isfinite(loop).all() for loop in whole):
        raise PathError("a coordinate of the path is too large")
    return tuple(whole)


def _commands(text: str) -> Iterator[tuple[str, list[float]]]:
    """Each command with its numbers, repeated ones one by one."""
    place, command = 0, ""
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None or (match[2] and not command):
            raise PathError(
                f"found {shown(text[place : place + 12])} at character {place + 1} of the path, {_allowed(command)}"
            )
        if match[3]:
            place = match.end()
            continue
        if match[1]:
            if match[1].upper() not in _TAKES or (not command and match[1] not in "Mm"):
                raise PathError(f"found {shown(match[1])} at character {place + 1} of the path, {_allowed(command)}")
            command, place = match[1], match.end()
        count = _TAKES[command.upper()]
        numbers: list[float] = []
        while len(numbers) < count:
            pattern = _FLAG if command in "Aa" and len(numbers) in (3, 4) else _NUMBER
            number = pattern.match(text, place)
            if number is None:
                words = f"{command} needs {count} number{'' if count == 1 else 's'} at a time"
                raise PathError(
                    f"found {shown(text[place : place + 12])} at character {place + 1} of the path; {words}"
                )
            numbers.append(float(number[1]))
            place = number.end()
        yield command, numbers
        if command in "Mm":
            command = "L" if command == "M" else "l"
        elif command in "Zz":
            command = " "


_NUMBER = re.compile(r"[\s,]*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")


def _allowed(command: str) -> str:
    return f"allowed are {_WORDS} and numbers" if command else "a path begins with M"


class _Pen:
    """Follows a path; places are complex numbers."""

    def __init__(self) -> None:
        self.here = self.first = 0j
        self.line: list[complex] = []
        #: where the handle of the curve before ended, and which kind it was
        self.handle, self.kind = 0j, ""

    def lines(self, text: str) -> Iterator[list[complex]]:
        for command, numbers in _commands(text):
            kind, base = command.upper(), self.here if command.islower() else 0j
            if kind == "M":
                yield _clean(self.line)
                self.here = self.first = base + complex(*numbers)
                self.line = [self.here]
            elif kind == "Z":
                yield _clean(self.line)
                self.here, self.line = self.first, [self.first]
            else:
                self._draw(kind, base, numbers)
            self.kind = kind
        yield _clean(self.line)

    def _draw(self, kind: str, base: complex, numbers: list[float]) -> None:
        if kind == "A":
            end = base + complex(numbers[5], numbers[6])
            self.line += _arc(self.here, end, numbers)
        elif kind in "HV":
            x = numbers[0] + base.real if kind == "H" else self.here.real
            end = complex(x, numbers[0] + base.imag if kind == "V" else self.here.imag)
            self.line.append(end)
        else:
            places = [base + complex(*numbers[k : k + 2]) for k in range(0, len(numbers), 2)]
            end = places[-1]
            if kind in "ST":
                smooth = self.kind in ("CS" if kind == "S" else "QT")
                places.insert(0, 2 * self.here - self.handle if smooth else self.here)
            if len(places) > 1:
                self.handle = places[-2]
            self.line += _curve([self.here, *places])
        self.here = end


def _curve(control: list[complex]) -> list[complex]:
    """Places on a Bezier curve after its start, by de Casteljau's construction; of a line its end."""
    if len(control) == 2:
        return control[1:]
    found = []
    for k in range(1, PIECES + 1):
        t, level = k / PIECES, control
        while len(level) > 1:
            level = [(1 - t) * a + t * b for a, b in itertools.pairwise(level)]
        found.append(level[0])
    return [*found[:-1], control[-1]]


def _arc(start: complex, end: complex, numbers: list[float]) -> list[complex]:
    """Places on a part of an ellipse after its start; a line where a radius is zero."""
    rx, ry, turn = abs(numbers[0]), abs(numbers[1]), cmath.exp(1j * math.radians(numbers[2]))
    large, positive = numbers[3] == 1, numbers[4] == 1
    if start == end:
        return []
    if rx == 0.0 or ry == 0.0:
        return [end]

    def round_of(z: complex) -> complex:  # where the ellipse is the unit circle
        own = z / turn
        return complex(own.real / rx, own.imag / ry)

    a, b = round_of(start), round_of(end)
    half = abs(b - a) / 2
    grow = max(1.0, half)  # radii that are too small to reach grow until they do
    a, b = a / grow, b / grow
    rise = math.sqrt(max(0.0, 1.0 - (half / grow) ** 2))
    middle = (a + b) / 2 + (1j if large != positive else -1j) * rise * (b - a) / abs(b - a)
    first = cmath.phase(a - middle)
    way = (cmath.phase(b - middle) - first) % (2 * math.pi)
    way -= 0.0 if positive else 2 * math.pi
    count = max(2, math.ceil(abs(way) / STEP))
    places = [middle + cmath.exp(1j * (first + way * k / count)) for k in range(1, count)]
    return [*(turn * complex(z.real * rx * grow, z.imag * ry * grow) for z in places), end]


def _clean(line: list[complex]) -> list[complex]:
    """Without corners that repeat the one before, or the first at the end."""
    found = [z for k, z in enumerate(line) if k == 0 or z != line[k - 1]]
    while len(found) > 1 and found[-1] == found[0]:
        found.pop()
    return found
