"""The front: its points, what is dominated, every design that was visited, and those of them on the front."""

from typing import Any

import numpy as np

from mdstopo.case.responses.response_units import unit_of_value
from mdstopo.plots.source import Source
from mdstopo.plots.style import WIDTH, colour, ink
from mdstopo.store.store_errors import StoreError
from mdstopo.store.whole_front import whole_front

#: points that a front may have to be numbered
MOST_NUMBERED = 15


def draw(module: Any, source: Source, visited: bool = True, marked: int | None = None) -> Any:
    """Two objectives in a plane; of more, every pair. marked: a point that gets a circle."""
    arrays = source.view.arrays
    if "pareto/objectives" not in arrays:
        raise StoreError(f"{source.view.path}: has no front; `mdstopo pareto` makes one")
    asked = len(arrays["pareto/objectives"])
    whole = whole_front(source.view)
    points = np.asarray(whole["objectives"], dtype=np.float64)
    dominated = np.asarray(whole["dominated"], dtype=bool)
    objectives = list(source.case.objectives)
    m = len(objectives)
    pairs = [(i, j) for i in range(m) for j in range(i + 1, m)]
    figure = module.Figure(figsize=(WIDTH, 2.9 * len(pairs)))
    axes = figure.subplots(len(pairs), 1, squeeze=False)[:, 0]
    good = points[~dominated & np.isfinite(points).all(axis=1)]
    low, high = good.min(axis=0), good.max(axis=0)
    for axis, (i, j) in zip(axes, pairs, strict=True):
        if visited:
            seen = [np.asarray(a, dtype=np.float64) for a in source.view.under("pareto/visited").values()]
            cloud = np.concatenate(seen) if seen else np.zeros((0, m))
            axis.plot(cloud[:, i], cloud[:, j], ".", color=ink("faint"), markersize=1.5, label="visited", zorder=1)
        if np.any(dominated):
            axis.plot(*points[dominated][:, [i, j]].T, "x", color=colour(1), markersize=4, label="dominated")
        order = np.argsort(good[:, i])
        axis.plot(*good[order][:, [i, j]].T, "o-" if m == 2 else "o", color=colour(0), linewidth=0.6, label="front")
        further = asked + np.flatnonzero(~dominated[asked:])
        if len(further):
            axis.plot(*points[further][:, [i, j]].T, "s", color=colour(2), markersize=4, label="visited, on the front")
        if len(points) <= MOST_NUMBERED:
            for number in np.flatnonzero(~dominated & np.isfinite(points).all(axis=1)).tolist():
                place = tuple(points[number, [i, j]])
                axis.annotate(str(number), place, xytext=(3, 3), textcoords="offset points", fontsize="small")
        if marked is not None:
            axis.plot(*points[marked, [i, j]], "o", color=ink(), fillstyle="none", markersize=9, label="marked")
        for k, limits in ((i, axis.set_xlim), (j, axis.set_ylim)):
            room = 0.12 * max(float(high[k] - low[k]), 1e-12 * abs(float(high[k])))
            limits(low[k] - room, high[k] + 2.0 * room)
        for k, label in ((i, axis.set_xlabel), (j, axis.set_ylabel)):
            label(f"{objectives[k].name}, {unit_of_value(objectives[k])}")
        axis.legend()
    return figure
