"""A front as a file holds it, in one table: the points that were asked for, and the designs visited on the way to them.

The former are the rows of `pareto/...`, the latter those of `pareto/further/...`, which are numbered behind them.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.status import RunStatus
from mdstopo.store.labels import WITHOUT_POINTS
from mdstopo.store.result_reader import ResultView

Array = NDArray[Any]

FURTHER = "further/"
#: what stands for a further point in columns that it has none of
_NOTHING: dict[str, float] = {"evaluations": 0, "dominated": 0}


def whole_front(view: ResultView) -> dict[str, Any]:
    """The columns of a front in a file, and `status` and `reason`, with those of its further points behind."""
    part: dict[str, Any] = dict(view.under("pareto"))
    part |= {name: list(view.lines(f"pareto/{name}")) for name in ("status", "reason")}
    return joined(part, view.lines("objectives"))


def joined(part: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """The columns of `part`, as `pareto/...` has them, with those of `part["further/..."]` behind.

    names: of the objectives. What further points have none of is NaN, of counts 0.
    """
    own = {name: value for name, value in part.items() if not name.startswith((FURTHER, "visited/", "tasks/"))}
    count = len(part.get(f"{FURTHER}objectives", ()))
    if not count:
        return own
    rows = len(part["weights"])
    for name, column in own.items():
        if name in ("status", "reason") or name in WITHOUT_POINTS or len(column) != rows:
            continue
        more = part.get(FURTHER + name)
        if more is None:
            shape = (count, *np.shape(column)[1:])
            more = np.full(shape, _NOTHING.get(name, np.nan), dtype=np.asarray(column).dtype)
        own[name] = np.concatenate([column, more])
    own["status"] = [*part["status"], *[RunStatus.VISITED.value] * count]
    points, iterates = part[f"{FURTHER}point"], part[f"{FURTHER}iterate"]
    reasons = [came_by(int(p), int(k), names) for p, k in zip(points, iterates, strict=True)]
    own["reason"] = [*part["reason"], *reasons]
    return own


def came_by(point: int, iterate: int, names: Sequence[str]) -> str:
    """How a further point was come by, in words; names: of the objectives."""
    goal = f"point {point}" if point >= 0 else f"the best {names[-1 - point]} alone"
    return f"iterate {iterate} on the way to {goal}" if iterate >= 0 else f"the end of another solve for {goal}"


def design_of(view: ResultView, point: int) -> tuple[Array, dict[str, Array]] | None:
    """The design of a point of a front: alpha (N,), and values of variables by name; None where the file has no such
    point."""
    prefix, row = "pareto", point
    count = len(view.arrays.get("pareto/alpha", ()))
    if point >= count:
        prefix, row = "pareto/further", point - count
    designs = view.arrays.get(f"{prefix}/alpha")
    if designs is None or not 0 <= row < len(designs):
        return None
    return designs[row], {name: values[row] for name, values in view.under(f"{prefix}/variables").items()}


def points_of(view: ResultView) -> int:
    """How many points a front has, further ones counted."""
    return sum(len(view.arrays.get(f"{prefix}/alpha", ())) for prefix in ("pareto", "pareto/further"))
