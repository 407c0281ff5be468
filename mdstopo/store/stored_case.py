"""The case in a result file, read again."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.scene.candidates import with_members
from mdstopo.store.contents import CANDIDATES
from mdstopo.store.result_reader import ResultView
from mdstopo.store.set_keys import read_set_keys
from mdstopo.store.store_errors import DamagedError


def case_of(view: ResultView, changes: Mapping[str, str] | None = None) -> Case:
    """The case in a result file as it was read, with what --set changed. Raises CaseError where files are gone.

    changes: further keys to set, key path -> value in YAML.
    """
    path = Path(view.case_path) if view.case_path else None
    case = read_case(view.case_text, path=path, overrides=read_set_keys(view.settings) | dict(changes or {}))
    return built_case(view, case) if view.kind in ("run", "pareto") else case


def built_case(view: ResultView, case: Case) -> Case:
    """The case with the members that the file of a run holds, where candidates are priced. Raises DamagedError."""
    pairs = {}
    for group in case.priced_groups:
        ends = []
        for side, points in (("from", group.from_local), ("to", group.to_local)):
            kept = view.array(f"{CANDIDATES}/members/{group.name}/{side}")
            index = np.asarray(kept, dtype=np.intp) if kept.ndim == 1 and kept.dtype.kind == "i" else np.array([-1])
            if not np.all((index >= 0) & (index < len(points))):
                raise DamagedError(f"{view.path}: damaged: members of {group.name} have no such points")
            ends.append(index)
        if len(ends[0]) != len(ends[1]):
            raise DamagedError(f"{view.path}: damaged: members of {group.name} lack points")
        pairs[group.name] = (ends[0], ends[1])
    return with_members(case, pairs) if pairs else case
