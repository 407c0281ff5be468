"""May this file be written? The rules for a place where there is a file already."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from mdstopo.case.model import Case
from mdstopo.store.result_reader import ResultView, read_result
from mdstopo.store.same_case import differences
from mdstopo.store.store_errors import DamagedError, DifferentCaseError, StoreError, UnfinishedError

Notify = Callable[[str], None]

_NAMES = {"run": "run", "pareto": "front", "sweep": "sweep", "fit": "fit"}
_SHOWN = 6  # differing keys that a message lists


def prepare_place(path: Path) -> Path:
    """The file that will be written: symbolic links followed, the directory made where it is missing.

    Raises StoreError where that is impossible.
    """
    try:
        place = path.resolve()
    except (OSError, RuntimeError) as error:  # the folder that this process is in is gone; links that lead in a circle
        raise StoreError(f"{path}: there is no such place: {getattr(error, 'strerror', None) or error}") from error
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        there = place.is_dir()
    except OSError as error:
        raise StoreError(f"{path}: its directory cannot be made: {error.strerror}") from error
    if there:
        raise StoreError(f"{path}: a directory, not a file")
    return place


def made_from(view: ResultView, place: Path) -> Path:
    """The file that something made from a result will be written to, made ready as by `prepare_place`.

    Raises StoreError where it is the result itself, its case, or a file that the case includes.
    """
    case = Path(view.case_path) if view.case_path else None
    included = [path.removeprefix("files/") for path in view.texts if path.startswith("files/")]
    kept = {view.path: "the result itself"}
    if case is not None:
        kept |= {case: "the case that the result was made from"}
        kept |= {case.parent / name: "a file that its case includes" for name in included}
    for path, what in kept.items():
        with suppress(OSError):
            if path.samefile(place):
                raise StoreError(f"{place}: this is {what}; choose another place with --out")
    return prepare_place(place)


def admit(path: Path, case: Case, kind: str, overwrite: bool, notify: Notify) -> None:
    """Refuse to replace what should not be lost; notify of what will be replaced.

    Raises
    ------
    UnfinishedError
        if an unfinished run is there and `overwrite` is false.
    StoreError
        if what is there is the case itself, no result, or another command's result, and `overwrite` is false.
    """
    if not path.exists():
        return
    if case.path is not None and case.path.exists() and path.samefile(case.path):
        raise StoreError(f"{path}: this is the case file; choose another place with --out")
    if overwrite:
        notify(f"{path} is overwritten")
        return
    try:
        view = read_result(path, leave_out=("trajectories", "sensitivities", "optimizer", "members"))
    except DamagedError as error:
        raise DamagedError(f"{error}; --overwrite replaces it") from error
    if view.kind != kind:
        raise StoreError(
            f"{path} holds a result of `{view.kind}`; --overwrite replaces it, --out chooses another place"
        )
    if not view.finished:
        raise UnfinishedError(
            f"{path} holds an unfinished run ({view.status}); --resume continues it, --overwrite starts anew"
        )
    notify(f"the finished result in {path} is replaced")


def admit_resume(path: Path, case: Case, notify: Notify, kind: str = "run") -> ResultView | None:
    """The run (front, sweep) to be continued; None, with a notice, where there is none yet.

    Raises
    ------
    DifferentCaseError
        if it was made from a case that differs in more than max_iterations, tolerance or starts.
    StoreError
        if the file is no run's result or damaged.
    """
    if not path.exists():
        notify(f"there is no {path} to resume: the {_NAMES[kind]} starts from the beginning")
        return None
    view = read_result(path, leave_out=("trajectories", "sensitivities", "members"))
    if view.kind != kind:
        raise StoreError(f"{path} holds a result of `{view.kind}`, which cannot be resumed")
    keys = differences(view.text("resume/case"), case)
    if keys:
        more = f" and {len(keys) - _SHOWN} more" if len(keys) > _SHOWN else ""
        raise DifferentCaseError(
            f"{path} cannot be resumed with this case: it differs in {', '.join(keys[:_SHOWN])}{more} "
            "(only optimizer.max_iterations, tolerance and starts may change)",
            keys,
        )
    return view
