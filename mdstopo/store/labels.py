"""Dimension scales and units, so that notebooks open a finished result with its axes named.

HDF5's dimension scales are what netCDF-4 (and so xarray) takes for coordinates: with h5netcdf,
`xarray.open_dataset("results/fig6.h5", group="trajectories/default", engine="h5netcdf")` gives q over t and coordinate.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.responses.columns import reaction_columns, state_columns, state_units
from mdstopo.case.responses.response_units import unit_of_value
from mdstopo.store.image import Value

Datasets = dict[str, Value]


@dataclass
class Labels:
    """Labels of the datasets in a file. extra: datasets that only are scales; scales: by path, the scale of each
    dimension; units: by path."""

    extra: Datasets = field(default_factory=dict)
    scales: dict[str, tuple[str, ...]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)


#: what the second dimension of a dataset is, by the dataset's name
_SECOND = {
    "objectives": "objective",
    "peak_time": "objective",
    "weights": "objective",
    "utopia": "objective",
    "maxima": "objective",
    "constraints": "constraint",
    "alpha": "member",
    "lambda": "row",
    "q": "coordinate",
    "v": "coordinate",
    "a": "coordinate",
}

#: datasets below `pareto` that have no row for each point, however many rows they have
WITHOUT_POINTS = ("ends", "ends_alpha", "ideal", "nadir")


def labels(case: Case, datasets: Mapping[str, Value]) -> Labels:
    """What a result file's datasets are measured in and run over."""
    found = Labels()
    for load_case in case.load_cases:
        _trajectory(case, f"trajectories/{load_case.name}", datasets, found)
    _rows(case, "iterations", "iteration", "combined", datasets, found)
    _rows(case, "pareto", "point", "weights", datasets, found)
    _rows(case, "pareto/further", "number", "objectives", datasets, found)
    units = ", ".join(dict.fromkeys(unit_of_value(objective) for objective in case.objectives))
    raw = ("iterations/objectives", "pareto/objectives", "pareto/further/objectives", "pareto/utopia", "pareto/maxima")
    for path in raw:
        if path in datasets:
            found.units[path] = units
    for path in ("iterations/peak_time", "iterations/seconds", "pareto/seconds"):
        if path in datasets:
            found.units[path] = "s"
    for path in ("members/p", "members/q"):
        if path in datasets:
            found.units[path] = "m"
    return found


def _trajectory(case: Case, group: str, datasets: Mapping[str, Value], found: Labels) -> None:
    for name, unit in state_units(case).items():
        path = f"{group}/{name}"
        if path in datasets:
            found.units[path] = unit
            if name != "t":
                found.scales[path] = (f"{group}/t", _second(case, group, name, datasets[path], found))
    for path in datasets:
        if path.startswith(f"{group}/reactions/"):
            columns = reaction_columns(case)
            found.units[path] = ", ".join("N" if column[0] == "F" else "N m" for column in columns)
            found.extra[f"{group}/component"] = columns
            found.scales[path] = (f"{group}/t", f"{group}/component")


def _rows(case: Case, group: str, scale: str, first: str, datasets: Mapping[str, Value], found: Labels) -> None:
    """Label the columns of a group that all have one row for each iterate, or point.

    case: the design problem.
    group: the group's path.
    scale: the name of the rows' scale.
    first: the name of the dataset that has as many rows as there are.
    datasets: the file's, by path.
    found: takes the scales.
    """
    leader = datasets.get(f"{group}/{first}")
    if not isinstance(leader, np.ndarray):
        return
    found.extra[f"{group}/{scale}"] = np.arange(len(leader))
    for path, value in datasets.items():
        name = path.removeprefix(f"{group}/")
        if path == name or "/" in name or not isinstance(value, np.ndarray) or value.ndim not in (1, 2):
            continue
        if len(value) == len(leader) and name not in WITHOUT_POINTS:
            second = (_second(case, group, name, value, found),) if value.ndim == 2 else ()
            found.scales[path] = (f"{group}/{scale}", *second)


def _second(case: Case, group: str, name: str, value: Value, found: Labels) -> str:
    """The scale of a second dimension, made where it is first needed."""
    assert isinstance(value, np.ndarray)
    scale = _SECOND.get(name, f"{name}_column")
    if scale == "coordinate" and len(state_columns(case, name)) != len(state_columns(case, "q")):
        scale = "freedom"
    path = f"{group}/{scale}"
    if path not in found.extra:
        if scale in ("coordinate", "freedom"):
            found.extra[path] = state_columns(case, name)
        elif scale == "objective":
            found.extra[path] = [objective.name for objective in case.objectives]
        else:
            found.extra[path] = np.arange(value.shape[1])
    return path
