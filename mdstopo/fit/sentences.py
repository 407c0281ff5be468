"""What a fit's data cannot tell, and where a profile has met a better fit, in sentences."""

from collections.abc import Mapping
from typing import Any

#: estimates with a larger correlation are named
CORRELATED = 0.95
#: a profile whose squares fall by less than this has met the same minimum, as exactly as fits find it
LEAST_FALL = 1e-3


def improved(content: Mapping[str, Any]) -> list[str]:
    """A sentence on the best fit that a profile has met, where it is better than the one that is told. content: of
    `fit_record`."""
    found = []
    for each in content["estimates"]:
        own = each.get("profile", {"values": (), "t": ()})
        for value, t in zip(own["values"], own["t"], strict=True):
            if t is not None and t * (value - each["value"]) < 0.0:
                found.append((float(t) ** 2, each["name"], float(value)))
    less, name, value = max(found, default=(0.0, "", 0.0))
    if not less > LEAST_FALL:
        return []
    return [
        f"there is a better fit: with {name} held at {value:.6g} and the others fitted anew the squares are {less:.3g} "
        "less; intervals and profiles here are not those of the best fit: begin with "
        f"`initial: {value:.6g}` of {name}, or try more starts (`fit.starts`)"
    ]


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
