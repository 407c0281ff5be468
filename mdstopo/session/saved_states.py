"""The optimiser's states as parts of a result file, and back."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.start_families import best_run
from mdstopo.optimizer.state import State
from mdstopo.scene.design_map import as_designed
from mdstopo.session.start_in_stages import ROUND, STAGE, first_row, furthest, is_done
from mdstopo.starts.constraint_columns import constraint_values
from mdstopo.store.contents import Datasets, design_part, ends_part
from mdstopo.store.result_reader import ResultView
from mdstopo.store.store_errors import DamagedError

Array = NDArray[np.generic]
Floats = NDArray[np.float64]


def best_of(case: Case, states: Sequence[State | None]) -> int | None:
    """The index of the start whose result is that of the run; None where none has begun."""
    if all(state is None for state in states):
        return None
    return best_run(furthest(list(states)), case.optimizer.tolerance)


def iteration_columns(case: Case, state: State, before: int = 0, final: Floats | None = None) -> dict[str, Array]:
    """Columns of `iterations/...`, each (K + 1, ...), row 0 the start.

    before: evaluations that came earlier, for the individual optima. final (2, n_obj): raw values of the best design
    and of the last one, for what was not simulated on the way there because its weight is 0.
    """
    columns = state.history.to_arrays()
    rows = len(state.history)
    # Where even the first evaluation failed, the engine has reported nothing.
    unknown = np.full((rows, len(case.objectives)), np.nan)
    objectives = np.array(columns.get("info/objectives", unknown), dtype=np.float64).reshape(rows, -1)
    for row, values in zip((best_row(state), rows - 1), final if final is not None else (), strict=False):
        objectives[row] = np.where(np.isnan(objectives[row]), values, objectives[row])
    parts = (STAGE, ROUND)
    stages = {name: columns[f"info/{name}"].astype(np.int64) for name in parts if f"info/{name}" in columns}
    return stages | {
        "objectives": objectives,
        "peak_time": columns.get("info/peak_time", unknown).reshape(rows, -1),
        "constraints": constraint_values(case, columns),
        "combined": columns["objective"],
        "change": columns["change"],
        "evaluations": columns["evaluations"] + before,
        "seconds": columns["seconds"],
        "kkt": columns["kkt"],
        "accepted": columns["accepted"],
    }


def best_row(state: State) -> int:
    """The number of the iterate that is the best design."""
    first = first_row(state)
    objective = np.array(state.history.objective[first:])
    found = np.flatnonzero(objective == state.best_objective)
    return first + (int(found[0]) if len(found) else 0)


def run_part(case: Case, states: Sequence[State | None], before: int = 0, final: Floats | None = None) -> Datasets:
    """The datasets of a run: best design, its iterations, every start, every optimiser's state.

    before, final: as of `iteration_columns`.
    """
    best = best_of(case, states)
    if best is None:
        raise ValueError("no start has begun")
    state = states[best]
    assert state is not None
    design = case.space.expand(state.best_alpha)
    part: Datasets = design_part(case, design)
    if case.movable or any(each.moved for each in case.variables):
        part |= ends_part(as_designed(case, design))
    part |= {f"iterations/{name}": column for name, column in iteration_columns(case, state, before, final).items()}
    part |= _failures_part(state)
    if len(states) > 1:
        part |= _starts_part(case, states)
    for index, each in enumerate(states):
        if each is not None:
            part |= {f"optimizer/{index}/{name}": array for name, array in each.to_arrays().items()}
    return part


def _failures_part(state: State) -> Datasets:
    """The iterates whose evaluation failed, and why; nothing where none did."""
    failed = [k for k, words in enumerate(state.history.failure) if words]
    if not failed:
        return {}
    return {
        "failures/iterate": np.array(failed, dtype=np.int64),
        "failures/reason": [state.history.failure[k] for k in failed],
    }


def _starts_part(case: Case, states: Sequence[State | None]) -> Datasets:
    objectives = np.full((len(states), len(case.objectives)), np.nan)
    space = case.space
    designs = np.full((len(states), space.length), np.nan)
    residuals = np.full(len(states), np.nan)
    words, reasons = [], []
    for index, state in enumerate(states):
        words.append("not_begun" if state is None else str(state.status) if is_done(case, state) else "running")
        reasons.append("" if state is None else state.reason)
        if state is not None:
            objectives[index] = iteration_columns(case, state)["objectives"][best_row(state)]
            designs[index] = space.expand(state.best_alpha)
            residuals[index] = state.kkt
    part: Datasets = {"starts/objectives": objectives, "starts/status": words, "starts/kkt": residuals}
    part["starts/reason"] = reasons
    return part | design_part(case, designs, "starts")


def restore(view: ResultView, starts: int) -> list[State | None]:
    """The states in a file; None for starts that have not begun. States beyond `starts` are left out.

    Raises DamagedError where a state is not whole.
    """
    by_start: dict[int, dict[str, Array]] = {}
    for path, array in view.under("optimizer").items():
        index, _, name = path.partition("/")
        by_start.setdefault(int(index) if index.isdigit() else -1, {})[name] = array
    return [_state(view, by_start[index]) if index in by_start else None for index in range(starts)]


def _state(view: ResultView, arrays: Mapping[str, Array]) -> State:
    try:
        return State.from_arrays(arrays)
    except (KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{view.path}: damaged: the optimiser's state is not whole ({error})") from error
