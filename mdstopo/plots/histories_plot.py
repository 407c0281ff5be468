"""The responses of objectives, over time; on demand sensitivities over time."""

from textwrap import fill
from typing import Any

import numpy as np

from mdstopo.case.responses.response_units import unit_of, words
from mdstopo.plots.objectives_over_time import response_history
from mdstopo.plots.source import SAMPLES, Floats, Source
from mdstopo.plots.style import DASHES, colour, new_figure
from mdstopo.store.store_errors import StoreError

#: letters of a title that a column is wide enough for
LETTERS = 48


def draw(module: Any, source: Source, load_case: str | None = None) -> Any:
    """g(t) of every objective for the design of the file, one panel each. load_case: of this one only."""
    case = source.case
    chosen = [each for each in case.objectives if load_case in (None, each.load_case)]
    if not chosen:
        raise StoreError(f"{source.view.path}: no objective looks at load case {load_case}")
    times: dict[str, Floats] = {}
    series: dict[str, Floats] = {}
    for name in {each.load_case: None for each in chosen}:
        span = case.load_case(name)
        times[name] = np.linspace(span.start, span.end, SAMPLES)
        try:
            series |= response_history(source.engine, source.design, name, times[name])
        except ValueError as error:
            raise StoreError(str(error)) from error
    figure, axes = new_figure(module, len(chosen))
    for k, (axis, objective) in enumerate(zip(axes, chosen, strict=True)):
        t, g = times[objective.load_case], series[objective.name]
        axis.plot(t, g, color=colour(k))
        axis.set_ylabel(f"{objective.name}, {unit_of(objective.response)}")
        where = "" if len(source.load_cases) == 1 else f", load case {objective.load_case}"
        axis.set_title(fill(words(objective.response) + where, LETTERS), loc="left")
    axes[-1].set_xlabel("time, s")
    return figure


def draw_sensitivities(module: Any, source: Source, members: int = 8) -> Any:
    """dg(t)/dalpha of the first members, as `mdstopo gradient --history` stored it."""
    stored = source.view.under("sensitivities").items()
    found = {path: a for path, a in stored if "/history/" in path and "variables" not in path.split("/")[:-1]}
    lines = {path: array for path, array in found.items() if not path.endswith("/t")}
    if not lines:
        raise StoreError(f"{source.view.path}: has no sensitivities over time; `mdstopo gradient --history` makes them")
    figure, axes = new_figure(module, len(lines))
    for axis, (path, array) in zip(axes, lines.items(), strict=True):
        method, _, name = path.split("/")
        objective = next(each for each in source.case.objectives if each.name == name)
        t = source.view.under(f"trajectories/{objective.load_case}").get("t")
        if t is None or len(t) != len(array):
            t = source.view.arrays.get(f"sensitivities/{method}/history/t")
        if t is None or len(t) != len(array):
            raise StoreError(f"{source.view.path}: the times of the sensitivities of {name} are missing")
        for i in range(min(members, array.shape[1])):
            axis.plot(t, array[:, i], linestyle=DASHES[i % len(DASHES)], color=colour(i), label=f"{i}")
        axis.set_ylabel(f"d{name}/dalpha, {unit_of(objective.response)}")
        axis.set_title(f"{method}, members", loc="left")
        axis.legend(ncols=4)
    axes[-1].set_xlabel("time, s")
    return figure
