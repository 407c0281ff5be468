"""What a fit's data cannot tell, in sentences."""

from collections.abc import Mapping
from typing import Any

#: estimates with a larger correlation are named
CORRELATED = 0.95


def undetermined(content: Mapping[str, Any]) -> list[str]:
    """What the data cannot tell, or hardly: a sentence for each combination of estimates. content: of `fit_record`."""
    found = []
    for each in content["directions"] or ():
        parts = " ".join(f"{share:+.2g} {name}" for name, share in each["shares"].items())
        how = "not at all" if each["unknown"] else f"hardly: {each['change']:.2g} deviations from bound to bound"
        found.append(f"the data tell {how}: {parts} (shares of the way between bounds)")
    return found


def correlated(content: Mapping[str, Any]) -> list[str]:
    """Which estimates vary together: a sentence for each pair. content: of `fit_record`."""
    names = [each["name"] for each in content["estimates"]]
    return [
        f"{names[j]} and {names[i]} vary together: correlation {both:.4g}"
        for i, row in enumerate(content["correlation"] or ())
        for j, both in enumerate(row[:i])
        if both is not None and abs(both) > CORRELATED
    ]
