"""Pictures of a result of `mdstopo fit`: measured and fitted series, correlations of estimates, profiles."""

import math
import re
from collections.abc import Mapping
from textwrap import fill
from typing import Any

import numpy as np

from mdstopo.fit.fit_record import content as content_of
from mdstopo.plots.fitted_curves import fitted_curves, profile_curves
from mdstopo.plots.source import Source
from mdstopo.plots.style import colour, ink
from mdstopo.store.store_errors import StoreError

#: inches: width of a picture, height of a series with its residuals
WIDTH, HEIGHT = 6.8, 2.3
#: estimates up to which correlations are written into their squares
WRITTEN = 14
#: letters that have room: beside a series, above a profile
BESIDE, ABOVE = 34, 30


def folded(text: str, letters: int) -> str:
    """Text in lines of so many letters, which may end within a name, behind `_` or a point."""
    ends = re.sub(r"(?<=[._])", "\t", text)
    return fill(ends, letters, expand_tabs=False, replace_whitespace=False).replace("\t", "")


def draw(module: Any, source: Source) -> Any:
    """A row for each series: values over time, and residuals in standard deviations. Raises StoreError without a fit.

    module: matplotlib's figure module. source: the result.
    """
    content = content_of(source.view)
    series = [each for each in content["series"] if "predicted" in each]
    if not series:
        raise StoreError(f"{source.view.path}: nothing has been fitted: {content['reason'] or content['status']}")
    curves = fitted_curves(source, content)
    figure = module.Figure(figsize=(WIDTH, HEIGHT * len(series)))
    axes = figure.subplots(len(series), 2, squeeze=False)
    for k, (each, (values, rest)) in enumerate(zip(series, axes, strict=True)):
        _values(values, each, curves[each["name"]], k)
        _residuals(rest, each, k)
    for axis in axes[-1]:
        axis.set_xlabel("t, s")
    return figure


def _values(axis: Any, each: Mapping[str, Any], curve: tuple[Any, Any], k: int) -> None:
    axis.plot(*curve, color=colour(k), label="fitted")
    axis.plot(
        each["t"], each["measured"], "o", color=ink(), markersize=2.5, fillstyle="none", markeredgewidth=0.6,
        label="measured",
    )  # fmt: skip
    axis.set_title(folded(each["name"], BESIDE), loc="left")
    axis.set_ylabel(folded(f"{each['response']}, {each['unit']}", BESIDE))
    axis.legend()


def _residuals(axis: Any, each: Mapping[str, Any], k: int) -> None:
    t, y, found, deviation = (np.array(each[key]) for key in ("t", "measured", "predicted", "deviation"))
    for level in (-2.0, 2.0):
        axis.axhline(level, color=ink("faint"), linewidth=0.6, linestyle="--")
    axis.axhline(0.0, color=ink("faint"), linewidth=0.6)
    axis.plot(t, (found - y) / deviation, ".", color=colour(k), markersize=3.0)
    axis.set_ylabel("fitted - measured, deviations")


def draw_correlation(module: Any, source: Source) -> Any:
    """How the errors of estimates go together: a square for each pair. Raises StoreError where that is not known.

    module: matplotlib's figure module. source: the result.
    """
    content = content_of(source.view)
    if not content["correlation"]:
        raise StoreError(f"{source.view.path}: nothing has been fitted: {content['reason'] or content['status']}")
    names = [each["name"] for each in content["estimates"]]
    values = np.array([[np.nan if x is None else x for x in row] for row in content["correlation"]])
    side = min(1.8 + 0.42 * len(names), WIDTH)
    figure = module.Figure(figsize=(side + 1.4, side + 0.4))
    axis = figure.subplots()
    shown = axis.imshow(values, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axis.set_xticks(range(len(names)), names, rotation=45, ha="right", rotation_mode="anchor")
    axis.set_yticks(range(len(names)), names)
    axis.grid(visible=False)
    for i, j in np.ndindex(values.shape) if len(names) <= WRITTEN else ():
        told = "-" if np.isnan(values[i, j]) else f"{values[i, j]:.2f}"
        strong = abs(values[i, j]) > 0.6
        axis.text(j, i, told, ha="center", va="center", fontsize=6.0, color="#ffffff" if strong else ink())
    figure.colorbar(shown, ax=axis, label="correlation of estimates", shrink=0.8)
    return figure


def draw_profiles(module: Any, source: Source) -> Any:
    """How the fit gets worse as one estimate is held elsewhere, beside the parabola that intervals come from.

    module: matplotlib's figure module. source: the result. Raises StoreError where there are no profiles.
    """
    content = content_of(source.view)
    profiled = [each for each in content["estimates"] if "profile" in each]
    if not profiled:
        raise StoreError(f"{source.view.path}: has no profiles; `mdstopo fit --profile K` makes them")
    columns = min(3, math.ceil(math.sqrt(len(profiled))))
    rows = -(-len(profiled) // columns)
    figure = module.Figure(figsize=(WIDTH * columns / 3.0 + 0.6 * (columns < 3), HEIGHT * rows))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis in axes[len(profiled) :]:
        axis.set_visible(False)
    for k, (axis, each) in enumerate(zip(axes, profiled, strict=False)):
        own = profile_curves(each, each["profile"])
        axis.axhline(own.end, color=ink("faint"), linewidth=0.6, linestyle="--")
        axis.plot(own.fine, own.parabola, color=ink("middle"), linewidth=0.8, linestyle=":", label="parabola")
        axis.plot(own.fine, own.between, color=colour(k), label="profile")
        axis.plot(own.values, own.rise, "o", color=colour(k))
        axis.locator_params(axis="x", nbins=4)
        axis.set_title(folded(each["name"], ABOVE), loc="left")
        axis.set_ylabel("rise of the squares" if k % columns == 0 else "")
        axis.legend()
    return figure
