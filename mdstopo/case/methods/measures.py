"""The measures over a sample that an uncertain case may name: what is declared of each, one record a measure.

What a record names is in `robust.robust_measures`, because reading a case computes nothing.
"""

from __future__ import annotations

from typing import NamedTuple


class MeasureKind(NamedTuple):
    """What is declared of a measure, which is one number of the values at all points of a sample.

    name: as case files have it; doc: a sentence for the case reference. made_by: module:class, derived from
    `robust.robust_measures.Statistic`; empty where the value of the case as it is written is taken instead, and no
    point of the sample is needed. in_words: with `{factor}` and `{level}` where these are part of it. keys: those of
    `factor` and `level` that are. for_equalities: whether it may be bounded from both sides. at_level_one: the name of
    the measure that it is at the level 1.
    """

    name: str
    doc: str
    made_by: str
    in_words: str
    keys: frozenset[str] = frozenset()
    for_equalities: bool = False
    at_level_one: str = ""


_HERE = "mdstopo.robust.robust_measures"

#: the measures by their name
MEASURES: dict[str, MeasureKind] = {
    kind.name: kind
    for kind in (
        MeasureKind("mean", "the mean of all values", f"{_HERE}:Mean", "mean", for_equalities=True),
        MeasureKind(
            "mean_deviation",
            "the mean and `factor` standard deviations towards the worse",
            f"{_HERE}:MeanAndDeviation",
            "mean and {factor:g} deviations",
            frozenset({"factor"}),
        ),
        MeasureKind("worst", "the worst of all values", f"{_HERE}:Worst", "worst"),
        MeasureKind(
            "quantile",
            "what the share `level` of all values reaches or betters",
            f"{_HERE}:Quantile",
            "{level:g} quantile",
            frozenset({"level"}),
            at_level_one="worst",
        ),
        MeasureKind(
            "nominal",
            "the value of the case as it is written, without anything uncertain",
            "",
            "nominal",
            for_equalities=True,
        ),
    )
}
#: the measures of objectives and equalities, and of other constraints, that name none
OF_OBJECTIVES, OF_LIMITS = "mean", "worst"


def names() -> dict[str, str]:
    """The measures by their names, with what they mean."""
    return {kind.name: kind.doc for kind in MEASURES.values()}


def having(key: str) -> list[str]:
    """The names of the measures to which a key belongs."""
    return [kind.name for kind in MEASURES.values() if key in kind.keys]
