"""The case in a result file, read again."""

from collections.abc import Mapping
from pathlib import Path

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.store.result_reader import ResultView


def case_of(view: ResultView, changes: Mapping[str, str] | None = None) -> Case:
    """The case in a result file as it was read, with what --set changed. Raises CaseError where files are gone.

    changes: further keys to set, key path -> value in YAML.
    """
    path = Path(view.case_path) if view.case_path else None
    settings = view.settings.items()
    overrides = {key.removeprefix("set "): str(value) for key, value in settings if key.startswith("set ")}
    return read_case(view.case_text, path=path, overrides=overrides | dict(changes or {}))
