"""Numbers with units in quotes: `"40 mm"`, `"9.8 m/s^2"`, `"30 deg"`. What is kept is the number in SI units.

A unit is factors joined by blanks, `*` or `/`, each with a whole power: `N s/m`, `kg m^2`. `/` divides by the factor
behind it alone. Angles have no dimension, so that a stiffness in N m/rad may be written in N m. Factors are exact:
the international yard and pound, standard gravity (9.80665 m/s^2), a degree of pi/180.
"""

from __future__ import annotations

import functools
import math
import re
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from fractions import Fraction

#: exponents of kg, m and s
Dimension = tuple[int, int, int]

_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?)\s*(\D.*?)\s*")
_FACTOR = re.compile(r"([A-Za-zµ°]+|1)(?:(?:\^|\*\*)?([-+]?\d)|([²³]))?")
_SUPERSCRIPTS = {"²": 2, "³": 3}
_PREFIXES = {"n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9}


class Unit(NamedTuple):
    """A unit of measurement: its factor to SI units, a power of pi in it (degrees, turns), and its dimension."""

    factor: Fraction
    dimension: Dimension = (0, 0, 0)
    turns: int = 0


#: units that take prefixes, and those that do not: factor, dimension, power of pi
_PREFIXED: dict[str, tuple[str, Dimension, int]] = {
    "m": ("1", (0, 1, 0), 0),
    "s": ("1", (0, 0, 1), 0),
    "g": ("1/1000", (1, 0, 0), 0),
    "N": ("1", (1, 1, -2), 0),
    "J": ("1", (1, 2, -2), 0),
    "W": ("1", (1, 2, -3), 0),
    "Pa": ("1", (1, -1, -2), 0),
    "Hz": ("1", (0, 0, -1), 0),
    "rad": ("1", (0, 0, 0), 0),
}
_ALONE: dict[str, tuple[str, Dimension, int]] = {
    "1": ("1", (0, 0, 0), 0),
    "t": ("1000", (1, 0, 0), 0),
    "lb": ("0.45359237", (1, 0, 0), 0),
    "min": ("60", (0, 0, 1), 0),
    "h": ("3600", (0, 0, 1), 0),
    "in": ("0.0254", (0, 1, 0), 0),
    "ft": ("0.3048", (0, 1, 0), 0),
    "mi": ("1609.344", (0, 1, 0), 0),
    "lbf": ("4.4482216152605", (1, 1, -2), 0),
    "kgf": ("9.80665", (1, 1, -2), 0),
    "bar": ("100000", (1, -1, -2), 0),
    "deg": ("1/180", (0, 0, 0), 1),
    "°": ("1/180", (0, 0, 0), 1),
    "rev": ("2", (0, 0, 0), 1),
    "rpm": ("1/30", (0, 0, -1), 1),
}
#: the longest text that is read, so that the exact arithmetic stays short
_LONGEST = 100
#: as a regular expression of JSON Schema: a number, then what begins like a unit
PATTERN = r"^\s*[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?\s*[A-Za-zµ°1/].*$"
#: units of keys whose numbers can be anything: their users choose it, or it is that of another number
UNSTATED = ("", "yours", "the number's unit")


class QuantityError(ValueError):
    """Why a text is no number in the unit that is needed: a sentence."""


def is_quantity(text: str) -> bool:
    """Whether a text begins with a number and goes on with something else."""
    found = _NUMBER.fullmatch(text)
    return found is not None and not re.fullmatch(r"[-+.0-9eExX]+", text)


def in_si(text: str, needed: str) -> float:
    """The number that a text like `40 mm` means in the SI unit `needed`. Raises QuantityError."""
    if needed in UNSTATED:
        raise QuantityError("allowed is a number: units are read where a key has one of its own")
    number, name = _parts(text)
    unit = unit_of(name)
    if unit.dimension != unit_of(needed).dimension:
        raise QuantityError(f"allowed is a number in {needed}, or in a unit that measures the same")
    if needed.startswith("rad/s") and "Hz" in name:
        # 1 Hz is a turn a second, 2 pi rad/s; as 1/s it would be taken for 1 rad/s
        raise QuantityError(f"allowed is a number in {needed}; turns are counted in rev/s or rpm, not in Hz")
    return _value(number, unit)


def as_si(text: str) -> float | None:
    """The number that a text like `40 mm` means in SI units, whatever it measures; None where it is no such text."""
    try:
        number, name = _parts(text)
        return _value(number, unit_of(name))
    except QuantityError:
        return None


def _parts(text: str) -> tuple[str, str]:
    """The number and the unit of a text, as they are written. Raises QuantityError."""
    found = _NUMBER.fullmatch(text) if len(text) <= _LONGEST else None
    if found is None:
        raise QuantityError("allowed is a number and its unit, such as '40 mm'")
    return found[1], found[2]


def _value(number: str, unit: Unit) -> float:
    """A number as it is written, in SI units. Raises QuantityError where it is too large for them."""
    from fractions import Fraction

    try:
        return float(Fraction(number) * unit.factor) * math.pi**unit.turns
    except OverflowError:
        raise QuantityError("allowed is a number that is finite in SI units") from None


@functools.cache
def unit_of(text: str) -> Unit:
    """The unit that a text means. Raises QuantityError, which names what is not known."""
    from fractions import Fraction

    factor, dimension, turns, at = Fraction(1), (0, 0, 0), 0, 0
    while at < len(text):
        joint = re.match(r"\s*([*·/]?)\s*", text[at:])
        assert joint is not None
        sign, at = -1 if joint[1] == "/" else 1, at + joint.end()
        found = _FACTOR.match(text, at)
        if found is None:
            raise QuantityError(f"{text!r} is no unit; one is written like 'N s/m' or 'kg m^2'")
        one = _named(found[1])
        power = sign * int(found[2] or _SUPERSCRIPTS.get(found[3], 1))
        factor *= one.factor**power
        a, b, c = (x + power * y for x, y in zip(dimension, one.dimension, strict=True))
        dimension, turns, at = (a, b, c), turns + power * one.turns, found.end()
    return Unit(factor, dimension, turns)


def _named(name: str) -> Unit:
    """One factor of a unit."""
    from fractions import Fraction

    found, prefix = {**_PREFIXED, **_ALONE}.get(name), 0
    if found is None and name[0] in _PREFIXES:
        found, prefix = _PREFIXED.get(name[1:]), _PREFIXES[name[0]]
    if found is None:
        alone = ", ".join(each for each in _ALONE if each != "1")
        raise QuantityError(
            f"no unit is called {name!r}; there are {', '.join(_PREFIXED)}, each also with a prefix of "
            f"{', '.join(_PREFIXES)}, and {alone}"
        )
    factor, dimension, turns = found
    return Unit(Fraction(factor) * Fraction(10) ** prefix, dimension, turns)


def unit_at(stated: str, path: str) -> str:
    """The unit of the number at a key path, where its key states several units for several numbers. stated: these.

    `N/m, N/m, N m/rad` and `m and N` go by the place in a list, `m or rad` by whether an angle is meant.
    """
    if " or " in stated:
        length, angle = stated.split(" or ")
        return angle if re.search(r"\b(angle|rotation)\b", path) else length
    several = re.split(r", | and ", stated)
    if len(several) == 1:
        return stated
    place = re.search(r"\[(\d+)\]$", path)
    return several[min(int(place[1]), len(several) - 1)] if place is not None else ""
