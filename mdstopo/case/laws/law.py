"""What is declared of a member law, and what follows from it: keys, units, design variables, scaling, parameters.

A law is one class. Its fields are the keys of the case file in their order, each with `stated`: what it may be, its
description and unit, and what part it plays. Delta is the elongation |Q - P| - l0, tension is positive (Eq. 5, 34).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import MISSING, Field, fields
from typing import Any, ClassVar, cast

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.keys.kinds import NOT_NEGATIVE, NUMBER, POSITIVE, Number, Word, explained
from mdstopo.case.keys.records import Key, Record
from mdstopo.case.text.reading import Fields, Reading
from mdstopo.case.value import Value, frozen, stated

#: of a number of a law, by its name: the least and the largest value that it may take
Ranges = Callable[[str], tuple[float, float]]


@frozen(kw_only=True)
class Law(Value):
    """What all laws have in common.

    type: the word of the YAML key ``type``; kind: passive | reactive | active; doc: a sentence for the case reference.
    kernels: the module with the law's `KERNELS` (`mechanics.laws.law_kernels`). active_from, active_until: it acts in
    [active_from, active_until), times in s; None leaves that side open. A law with a free length l0 has the field
    ``free_length``, None for each member's initial length.
    """

    type: ClassVar[str]
    kind: ClassVar[str]
    doc: ClassVar[str]
    kernels: ClassVar[str]
    #: whether there may be places at which a slope of the force is infinite or has no value
    may_lack_slopes: ClassVar[bool] = False

    active_from: float | None = stated(
        NUMBER, "acts from this time on", unit="s", default=None, otherwise="always", varies=True, is_time=True
    )
    active_until: float | None = stated(
        NUMBER, "acts until this time, not at it", unit="s", default=None, otherwise="always", varies=True, is_time=True
    )

    @classmethod
    def made(cls, fields: Fields, values: dict[str, Any], reading: Reading) -> Law | None:
        """The law of the values that were read; None where they do not go together, which is noted."""
        del fields, reading
        return cls(**values)

    def row(self) -> list[float]:
        """Parameters for the kernels: the law's numbers in the order of `numbers`, then what a subclass adds."""
        return [getattr(self, name) for name in numbers(type(self))]

    def in_units(self, units: tuple[str, ...]) -> list[tuple[float, str]]:
        """Its numbers that are in one of some units, each with its unit."""
        keys = [(name, unit) for name, unit in _units(cast(Any, type(self))) if unit in units]
        return [(float(getattr(self, name)), unit) for name, unit in keys]

    @property
    def depends_on_rate(self) -> bool:
        """Whether the force depends on velocities or accelerations."""
        return any(getattr(self, name) != 0.0 for name in with_role(type(self), "of_rate"))

    @property
    def is_smooth(self) -> bool:
        """Whether its force has no kinks in elongation and rate, and needs neither accelerations nor a memory."""
        return False

    @property
    def holds(self) -> bool:
        """Whether its force may be other than zero in a static equilibrium."""
        return True

    def force_at(self, stretch: FloatArray, rate: FloatArray) -> FloatArray | None:
        """Force in N at alpha = 1 by elongation (m) and rate (m/s) alone, for drawings; None where more is in it."""
        del stretch, rate
        return None

    def strength(self, ranges: Ranges) -> float | None:
        """The largest force at alpha = 1 in N, whatever the motion; None where it has no limit.

        ranges: the least and the largest value that a number of the law may take.
        """
        del ranges
        return None

    def side_of_force(self, ranges: Ranges) -> int:
        """1 where members with the law only pull, -1 where they only push, 0 where neither is certain."""
        del ranges
        return 0

    def slack(self, ranges: Ranges, length: FloatArray) -> FloatArray | None:
        """By how much members of initial lengths (M,) have at least to change their length before it acts, (M,) m.

        None where it acts at once.
        """
        del ranges, length
        return None


def stiffness_key(doc: str = "k at alpha = 1", positive: bool = False) -> Any:
    """A field of a law: a stiffness, which grows with the size of the member."""
    return stated(POSITIVE if positive else NOT_NEGATIVE, doc, unit="N/m", scales=True, varies=True)


def damping_key() -> Any:
    """A field of a law: the damping c, which grows with the size of the member."""
    return stated(NOT_NEGATIVE, "c at alpha = 1", unit="N s/m", default=0.0, scales=True, varies=True, of_rate=True)


def free_length_key() -> Any:
    """A field of a law: the free length l0, None for each member's initial length."""
    return stated(
        NOT_NEGATIVE,
        "l0, the length at which Delta = 0; 0: the force is along the member and grows with its length",
        unit="m",
        default=None,
        otherwise="each member's initial length",
        varies=True,
    )


def side_key(tension: str, compression: str, doc: str, default: str) -> Any:
    """A field of a law: whether it acts in tension or in compression, with what either means; `sign_of` is its
    parameter."""
    words = {"tension": tension, "compression": compression}
    order = sorted(words, key=lambda word: word != default)
    return stated(explained({word: words[word] for word in order}), doc, default=default)


def sign_of(side: str) -> float:
    """1 for a law that acts in tension, -1 in compression."""
    return {"tension": 1.0, "compression": -1.0}[side]


def with_role(law: type[Law], role: str) -> tuple[str, ...]:
    """The fields of a law that have a role (`value.stated`): scales, varies, of_rate, is_time."""
    return _with_role(cast(Any, law), role)


def numbers(law: type[Law]) -> tuple[str, ...]:
    """The numbers of a law that are parameters of its kernels, in their order there.

    A free length shifts Delta and times say when a law acts: kernels have no use for either.
    """
    return _numbers(cast(Any, law))


# cached by the class, which mypy takes for no key
@functools.cache
def _own_fields(law: Any) -> tuple[Field[Any], ...]:
    """The law's fields as the case file has them: those of all laws come last."""
    common = {field.name for field in fields(Law)}
    return tuple(sorted(fields(law), key=lambda field: field.name in common))


@functools.cache
def _with_role(law: Any, role: str) -> tuple[str, ...]:
    return tuple(field.name for field in _own_fields(law) if field.metadata.get(role))


@functools.cache
def _units(law: Any) -> tuple[tuple[str, str], ...]:
    """The numbers of a law with their units."""
    units = {field.name: str(field.metadata["unit"]) for field in _own_fields(law)}
    return tuple((name, units[name]) for name in _numbers(law))


@functools.cache
def _numbers(law: Any) -> tuple[str, ...]:
    outside = {"free_length", *(field.name for field in fields(Law))}
    return tuple(
        field.name
        for field in _own_fields(law)
        if isinstance(field.metadata["kind"], Number) and field.name not in outside
    )


def largest(bounds: tuple[float, float]) -> float:
    """The largest magnitude between two bounds."""
    return max(map(abs, bounds))


def side_between(bounds: tuple[float, float]) -> int:
    """1 where no value between two bounds is negative, -1 where none is positive, else 0."""
    low, high = bounds
    return 1 if low >= 0.0 else (-1 if high <= 0.0 else 0)


def slack_before(side: str, free: float | None, ranges: Ranges, length: FloatArray) -> FloatArray:
    """`Law.slack` of a law that acts beyond a gap, on one side; free: its free length as stated."""
    least = ranges("gap")[0]
    if free is None:
        return np.full(len(length), least)
    low, high = ranges("free_length")
    return (low - length if side == "tension" else length - high) + least


def record_of(law: type[Law]) -> Record:
    """The keys of a law in the case file, from the fields of its class."""
    tag = Key("type", Word((law.type,)), "which law it is", required=True)
    article = "an" if law.type[0] in "aeiou" else "a"
    keys = [
        Key(
            field.name,
            field.metadata["kind"],
            field.metadata["doc"],
            required=field.default is MISSING,
            default=None if field.default is MISSING else field.default,
            unit=field.metadata["unit"],
            otherwise=field.metadata["otherwise"],
        )
        for field in _own_fields(cast(Any, law))
    ]
    return Record(f"{article} {law.type} law", (tag, *keys), doc=law.doc)
