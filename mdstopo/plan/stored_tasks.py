"""Finished tasks and those in the making as parts of a result file, and back: `pareto/tasks/...`, a row each.

What a front has reached is in them, so that one that was stopped goes on without losing or repeating anything.
"""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.state import State
from mdstopo.plan.solve_task import Found
from mdstopo.status import RunStatus
from mdstopo.store.contents import Datasets
from mdstopo.store.result_reader import ResultView
from mdstopo.store.store_errors import DamagedError

Floats = NDArray[np.float64]

_NUMBERS = ("combined", "kkt", "violation", "seconds")
_COUNTS = ("point", "evaluations", "iterate")
_WORDS = ("key", "reason", "host")


def tasks_part(found: Iterable[Found], case: Case, place: str = "pareto/tasks") -> Datasets:
    """Every finished task that may be used again, at its place in the file; designs one behind the other."""
    rows = [each for each in found if each.key]
    m = len(case.objectives)
    part: Datasets = {
        "alpha": np.concatenate([each.alpha for each in rows]) if rows else np.zeros(0),
        "sizes": np.array([len(each.alpha) for each in rows], dtype=np.int64),
        "objectives": np.array([each.objectives for each in rows]).reshape(len(rows), m),
        "status": [each.status.value for each in rows],
        "visits": np.array([len(each.visited) for each in rows], dtype=np.int64),
        "visited": np.concatenate([each.visited for each in rows]) if rows else np.zeros((0, m)),
        "violations": np.concatenate([_violations(each) for each in rows]) if rows else np.zeros(0),
    }
    for name in _NUMBERS:
        part[name] = np.array([getattr(each, name) for each in rows], dtype=np.float64)
    for name in _COUNTS:
        part[name] = np.array([getattr(each, name) for each in rows], dtype=np.int64)
    for name in _WORDS:
        part[name] = [getattr(each, name) for each in rows]
    return {f"{place}/{name}": value for name, value in part.items()}


def _violations(found: Found) -> Floats:
    """The violation of every design that was visited; NaN where it is not known, as of the runs of a sweep."""
    if len(found.violations) == len(found.visited):
        return found.violations
    return np.full(len(found.visited), np.nan)


def read_tasks(view: ResultView, place: str = "pareto/tasks") -> dict[str, Found]:
    """The finished tasks of a file, by key. Raises DamagedError where they are not whole."""
    columns: Mapping[str, NDArray[np.generic]] = view.under(place)
    words = {name: view.lines(f"{place}/{name}") for name in (*_WORDS, "status")}
    found: dict[str, Found] = {}
    if "violations" not in columns:  # of a version before results were kept like this
        return found
    last, end = np.cumsum(columns["visits"]), np.cumsum(columns["sizes"])
    try:
        for i, key in enumerate(words["key"]):
            first = int(last[i] - columns["visits"][i])
            found[key] = Found(
                point=int(columns["point"][i]),
                key=key,
                alpha=np.array(columns["alpha"][int(end[i] - columns["sizes"][i]) : int(end[i])], dtype=np.float64),
                objectives=np.array(columns["objectives"][i], dtype=np.float64),
                combined=float(columns["combined"][i]),
                status=RunStatus(words["status"][i]),
                reason=words["reason"][i],
                evaluations=int(columns["evaluations"][i]),
                kkt=float(columns["kkt"][i]),
                violation=float(columns["violation"][i]),
                visited=np.array(columns["visited"][first : int(last[i])], dtype=np.float64),
                violations=np.array(columns["violations"][first : int(last[i])], dtype=np.float64),
                iterate=int(columns["iterate"][i]),
                seconds=float(columns["seconds"][i]),
                host=words["host"][i],
            )
    except (KeyError, IndexError, ValueError) as error:
        raise DamagedError(f"{view.path}: damaged: its finished points are not whole ({error})") from error
    return found


def begun_part(begun: Mapping[str, State], place: str = "pareto/tasks") -> Datasets:
    """The optimisers' states of tasks that are being worked on, by their keys."""
    part: Datasets = {}
    for k, (key, state) in enumerate(begun.items()):
        part[f"{place}/begun/{k}/key"] = key
        part |= {f"{place}/begun/{k}/{name}": array for name, array in state.to_arrays().items()}
    return part


def read_begun(view: ResultView, place: str = "pareto/tasks") -> dict[str, State]:
    """The states of tasks that were being worked on, by their keys. Raises DamagedError where they are not whole."""
    found: dict[str, dict[str, NDArray[np.generic]]] = {}
    for path, array in view.under(f"{place}/begun").items():
        index, _, name = path.partition("/")
        found.setdefault(index, {})[name] = array
    try:
        return {view.text(f"{place}/begun/{k}/key"): State.from_arrays(arrays) for k, arrays in found.items()}
    except (KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{view.path}: damaged: its unfinished points are not whole ({error})") from error
