"""dG/dalpha of every member, relative to the largest; methods beside each other where the file has several."""

from typing import Any

import numpy as np

from mdstopo.plots.source import Source
from mdstopo.plots.style import DASHES, MARKERS, colour, new_figure
from mdstopo.store.store_errors import StoreError


def draw(module: Any, source: Source, members: int | None = None) -> Any:
    """One panel for each objective. members: the first so many only."""
    found = {
        path: array
        for path, array in source.view.under("sensitivities").items()
        if "/history/" not in path and "variables" not in path.split("/")[:-1] and len(array)
    }
    if not found:
        raise StoreError(f"{source.view.path}: has no sensitivities; `mdstopo run` and `mdstopo gradient` make them")
    names = [name for name in source.names if any(path.split("/")[-1] == name for path in found)]
    figure, axes = new_figure(module, len(names))
    for axis, name in zip(axes, names, strict=True):
        lines = {path.rpartition("/")[0]: array for path, array in found.items() if path.split("/")[-1] == name}
        for k, (method, array) in enumerate(lines.items()):
            values = np.asarray(array, dtype=np.float64)
            values = (values / max(np.abs(values).max(), 1e-300))[: members or len(values)]
            few = len(values) <= 120
            axis.plot(
                np.arange(len(values)), values, linestyle=DASHES[k % len(DASHES)] if few else "none", color=colour(k),
                marker=MARKERS[k] if few else ".", markersize=(4.5 - k if few else 1.5), fillstyle="none",
                linewidth=0.7, label=method.replace("_", " "),
            )  # fmt: skip
        axis.set_ylabel(f"d{name}/dalpha, relative")
        if len(lines) > 1:
            axis.legend(ncols=2)
    axes[-1].set_xlabel("member")
    return figure
