"""Member laws as the user states them: coefficients only, no mechanics.

Each class is one row of the format's table of laws; its fields carry the names of the YAML keys. Delta is the
elongation |Q - P| - l0, tension is positive (Eq. 5, 34). ``free_length`` is l0 where it is given; None means
the initial length of each member. Every law acts in [active_from, active_until); None leaves that side open.
"""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import FloatArray, Table, read_only
from mdstopo.case.value import Value, frozen


@frozen(kw_only=True)
class Law(Value):
    """What all laws have in common.

    type: the word of the YAML key ``type``; kind: passive | reactive | active.
    active_from, active_until: times t_i^0 in s, or None where absent.
    """

    type: ClassVar[str]
    kind: ClassVar[str]

    active_from: float | None = None
    active_until: float | None = None


@frozen(kw_only=True)
class SpringLaw(Law):
    """f = stiffness Delta + damping dDelta/dt + preload (Eq. 2); V = stiffness Delta^2 / 2."""

    type: ClassVar[str] = "spring"
    kind: ClassVar[str] = "passive"

    stiffness: float
    damping: float = 0.0
    free_length: float | None = None
    preload: float = 0.0


@frozen(kw_only=True)
class GapLaw(Law):
    """f = 0 until Delta >= gap, then stiffness (Delta - gap) + damping dDelta/dt (Eq. 3).

    side: tension | compression; compression mirrors the law. clip: damping cannot reverse the force.
    """

    type: ClassVar[str] = "gap"
    kind: ClassVar[str] = "reactive"

    stiffness: float
    damping: float = 0.0
    gap: float = 0.0
    free_length: float | None = None
    side: str = "tension"
    clip: bool = False


@frozen(kw_only=True)
class CubicLaw(Law):
    """f = stiffness Delta + cubic Delta^3; V = stiffness Delta^2 / 2 + cubic Delta^4 / 4."""

    type: ClassVar[str] = "cubic"
    kind: ClassVar[str] = "passive"

    stiffness: float
    cubic: float
    free_length: float | None = None


@frozen(kw_only=True)
class CurveLaw(Law):
    """f: monotone cubic (PCHIP) through ``curve`` (n, 2), rows [Delta, f] of rising Delta, linear outside."""

    type: ClassVar[str] = "curve"
    kind: ClassVar[str] = "passive"

    curve: FloatArray
    free_length: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "curve", read_only(self.curve))


@frozen(kw_only=True)
class PulseLaw(Law):
    """f = peak exp(-rate (t - time)^2) (Eq. 4)."""

    type: ClassVar[str] = "pulse"
    kind: ClassVar[str] = "active"

    peak: float
    rate: float
    time: float


@frozen(kw_only=True)
class TableLaw(Law):
    """f: a table of time with one value a row."""

    type: ClassVar[str] = "table"
    kind: ClassVar[str] = "active"

    table: Table


@frozen(kw_only=True)
class ActuatorLaw(Law):
    """f = clip(proportional (Delta - target) + derivative dDelta/dt, -limit, limit); limit None: no clip."""

    type: ClassVar[str] = "actuator"
    kind: ClassVar[str] = "active"

    proportional: float
    derivative: float = 0.0
    target: float = 0.0
    limit: float | None = None


@frozen(kw_only=True)
class CrushLaw(Law):
    """f = stiffness (Delta - set - gap) between 0 and force; beyond it the set grows. V = f^2 / (2 stiffness).

    side: compression | tension, the way in which it is crushed; compression mirrors the law.
    """

    type: ClassVar[str] = "crush"
    kind: ClassVar[str] = "reactive"

    stiffness: float
    force: float
    gap: float = 0.0
    free_length: float | None = None
    side: str = "compression"


@frozen(kw_only=True)
class InerterLaw(Law):
    """f = inertance d2Delta/dt2 (the acceleration of Eq. 1)."""

    type: ClassVar[str] = "inerter"
    kind: ClassVar[str] = "passive"

    inertance: float


LAWS: dict[str, type[Law]] = {
    law.type: law
    for law in (SpringLaw, GapLaw, CubicLaw, CurveLaw, PulseLaw, TableLaw, ActuatorLaw, CrushLaw, InerterLaw)
}
