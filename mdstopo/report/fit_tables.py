"""What the pages show of a fit: estimates, series with what was fitted and what is left, correlations, profiles."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mdstopo.fit.fit_record import content as content_of
from mdstopo.fit.sentences import correlated, improved, undetermined
from mdstopo.plots.fitted_curves import fitted_curves, profile_curves
from mdstopo.plots.source import Source


def fit_part(source: Source, curves: bool = True, rows: int = 0) -> dict[str, Any]:
    """All of a fit that is drawn, as plain data.

    source: the result.
    curves: with the motion between the measured times.
    rows: of what was tried, the last of them.
    """
    content = content_of(source.view)
    drawn = fitted_curves(source, content) if curves else {}
    profiles = {each["name"]: each.pop("profile") for each in content["estimates"] if "profile" in each}
    for each in content["estimates"]:
        own = profiles.get(each["name"])
        if own is not None:
            each |= {"profile_low": own["low"], "profile_high": own["high"]}
    trace = content["evaluations"][-rows:] if rows else []
    return {
        "confidence": content["confidence"],
        "estimates": content["estimates"],
        "sentences": [*improved(content), *undetermined(content), *correlated(content)],
        "series": [_series(each, drawn.get(each["name"])) for each in content["series"]],
        "correlation": content["correlation"],
        "profiles": [
            _profile(each, profiles[each["name"]]) for each in content["estimates"] if each["name"] in profiles
        ],
        "starts": len(content["starts"]),
        "left": np.array([each["root_mean_square"] for each in trace]).T.tolist() if trace else [],
        "simulations": content["simulations"],
    }


def _series(each: Mapping[str, Any], curve: Any) -> dict[str, Any]:
    """A series: measured, fitted, and what is left in deviations."""
    found = {key: each[key] for key in ("name", "load_case", "response", "unit", "t", "measured")}
    if "predicted" in each:
        y, fitted, deviation = (np.array(each[key]) for key in ("measured", "predicted", "deviation"))
        found |= {"predicted": each["predicted"], "residual": ((fitted - y) / deviation).tolist()}
        found |= {key: each[key] for key in ("root_mean_square", "chi_square", "deviation_estimated")}
        found["deviation"] = [float(deviation.min()), float(deviation.max())]
    if curve is not None:
        found["curve"] = [part.tolist() for part in curve]
    return found


def _profile(each: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """A profile as the rise of the squares, the parabola beside it, and the rise at which the interval ends."""
    curves = profile_curves(each, own)._asdict()
    return {"name": each["name"], **{key: np.asarray(value).tolist() for key, value in curves.items()}}
