"""Objectives and constraints over the iterations."""

from typing import Any

import numpy as np

from mdstopo.case.responses.response_units import unit_of_value
from mdstopo.plots.source import Source
from mdstopo.plots.style import colour, new_figure, use_log_scale
from mdstopo.store.store_errors import StoreError


def draw(module: Any, source: Source) -> Any:
    """One panel for each objective, and one for U where they are combined."""
    columns = source.view.under("iterations")
    if "combined" not in columns:
        raise StoreError(f"{source.view.path}: has no iterations; `mdstopo run` makes them")
    objectives = {each.name: each for each in source.case.objectives}
    values = np.asarray(columns["objectives"], dtype=np.float64)
    panels = [(f"{name}, {unit_of_value(objectives[name])}", values[:, i]) for i, name in enumerate(source.names)]
    if len(panels) > 1:
        panels.append(("U", np.asarray(columns["combined"], dtype=np.float64)))
    figure, axes = new_figure(module, len(panels))
    for k, (axis, (label, series)) in enumerate(zip(axes, panels, strict=True)):
        axis.plot(np.arange(len(series)), series, color=colour(k), marker=".", markersize=2)
        positive = series[np.isfinite(series)]
        if len(positive) and positive.min() > 0.0 and positive.max() > 20.0 * positive.min():
            use_log_scale(axis)
        axis.set_ylabel(label)
    axes[-1].set_xlabel("iteration")
    axes[-1].xaxis.get_major_locator().set_params(integer=True)
    return figure
