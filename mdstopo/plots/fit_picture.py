"""Measured series beside what was fitted, and what is left: a picture of a result of `mdstopo fit`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mdstopo.plots.style import colour, ink, save, styled
from mdstopo.store.store_errors import StoreError

#: inches: width of a picture, height of a series with its residuals
WIDTH, HEIGHT = 6.8, 2.3


def draw(module: Any, content: Mapping[str, Any]) -> Any:
    """A row for each series: values over time, and residuals in standard deviations. Raises StoreError without a fit.

    module: matplotlib's figure module. content: of a file of `fit.record`.
    """
    series = [each for each in content["series"] if "predicted" in each]
    if not series:
        raise StoreError(f"{content['case']}: nothing has been fitted: {content['reason'] or content['status']}")
    figure = module.Figure(figsize=(WIDTH, HEIGHT * len(series)))
    axes = figure.subplots(len(series), 2, squeeze=False)
    for k, (each, (values, rest)) in enumerate(zip(series, axes, strict=True)):
        t, y, found = (np.array(each[key], dtype=np.float64) for key in ("t", "measured", "predicted"))
        order = np.argsort(t, kind="stable")
        values.plot(t[order], found[order], color=colour(k), label="fitted")
        values.plot(
            t[order],
            y[order],
            "o",
            color=ink(),
            markersize=2.5,
            fillstyle="none",
            markeredgewidth=0.6,
            label="measured",
        )
        values.set_title(each["name"], loc="left")
        values.set_ylabel(f"{each['response']}, {each['unit']}")
        values.legend()
        residual = (found - y) / np.array(each["deviation"], dtype=np.float64)
        for level in (-2.0, 2.0):
            rest.axhline(level, color=ink("faint"), linewidth=0.6, linestyle="--")
        rest.axhline(0.0, color=ink("faint"), linewidth=0.6)
        rest.plot(t[order], residual[order], ".", color=colour(k), markersize=3.0)
        rest.set_ylabel("fitted - measured, deviations")
    for axis in axes[-1]:
        axis.set_xlabel("t, s")
    return figure


def picture(content: Mapping[str, Any], path: Path) -> None:
    """Write the picture. Raises StoreError."""
    with styled() as module:
        save(draw(module, content), path)
