"""The ways in which a response over time becomes one number (`over_time`): what is declared of each, one record a way.

Where kernels and formulas are needed, a record names them, because reading a case computes nothing.
"""

from __future__ import annotations

from typing import NamedTuple


class ReductionKind(NamedTuple):
    """A reduction of a response g(t) to one number.

    name: as case files have it; doc: a sentence for the case reference. unit: of the number, with `{unit}` for that
    of g. One of the following three says what it is of:
    signs: it is the highest peak of sign times g, times that sign: (1,) the largest value, (-1,) the smallest, (1, -1)
    the largest magnitude. power: it follows from the integral over time of this power of g, 1 or 2, by `formula`,
    module:function, called as `general.responses.integral_reductions.integral` is. at_end: it is the value at the end.
    springs: module:name of its code in the kernels of springs between free bodies; empty where only the kernels of
    general scenes have it.
    """

    name: str
    doc: str
    unit: str = "{unit}"
    signs: tuple[float, ...] = ()
    power: int = 0
    formula: str = ""
    at_end: bool = False
    springs: str = ""

    @property
    def is_integral(self) -> bool:
        """Whether it follows from an integral over time."""
        return self.power > 0

    @property
    def is_squared(self) -> bool:
        """Whether that is the integral of the square of the response."""
        return self.power == 2

    @property
    def is_largest(self) -> bool:
        """Whether no peak of the response is above it."""
        return 1.0 in self.signs

    @property
    def is_smallest(self) -> bool:
        """Whether it is the smallest value."""
        return self.signs == (-1.0,)

    @property
    def is_magnitude(self) -> bool:
        """Whether it is the largest magnitude."""
        return len(self.signs) > 1

    @property
    def ignores_sign(self) -> bool:
        """Whether g and -g have the same number."""
        return self.is_magnitude or self.is_squared

    def unit_from(self, unit: str) -> str:
        """The unit of the number, from that of the response."""
        return self.unit.format(unit=unit)


_SPRINGS, _FORMULAS = "mdstopo.sensitivity.reductions", "mdstopo.general.responses.integral_reductions"

#: the reductions by their name
REDUCTIONS: dict[str, ReductionKind] = {
    kind.name: kind
    for kind in (
        ReductionKind(
            "max",
            "its largest value, in continuous time; where it jumps, the larger one-sided limit",
            signs=(1.0,),
            springs=f"{_SPRINGS}:MAX",
        ),
        ReductionKind("min", "its smallest value, in continuous time", signs=(-1.0,), springs=f"{_SPRINGS}:MIN"),
        ReductionKind("max_abs", "the largest magnitude", signs=(1.0, -1.0)),
        ReductionKind(
            "mean", "the average over time", power=1, formula=f"{_FORMULAS}:mean", springs=f"{_SPRINGS}:MEAN"
        ),
        ReductionKind("rms", "the root of the mean square", power=2, formula=f"{_FORMULAS}:root_mean_square"),
        ReductionKind(
            "integral",
            "the integral over time",
            "{unit} s",
            power=1,
            formula=f"{_FORMULAS}:integral",
            springs=f"{_SPRINGS}:INTEGRAL",
        ),
        ReductionKind("final", "the value at the end", at_end=True, springs=f"{_SPRINGS}:FINAL"),
    )
}
#: the reduction of objectives and limits that name none
DEFAULT_REDUCTION = next(iter(REDUCTIONS))


def names() -> dict[str, str]:
    """The reductions by the words of `over_time`, with what they mean."""
    return {kind.name: kind.doc for kind in REDUCTIONS.values()}
