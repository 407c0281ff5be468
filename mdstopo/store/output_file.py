"""Files that are written once, at the end of a command."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from mdstopo.case.model import Case
from mdstopo.store.admit import admit, prepare_place
from mdstopo.store.atomic import remove_leftovers
from mdstopo.store.contents import Contents, Datasets, case_part
from mdstopo.store.image import Attribute
from mdstopo.store.lock import Lock
from mdstopo.store.writing import write_result


class OutputFile:
    """A place that may be written, held while the command computes."""

    def __init__(self, path: Path, case: Case, kind: str, command: str) -> None:
        self._path = path
        self._case = case
        self._kind = kind
        self._command = command

    def write(
        self,
        status: str,
        reason: str,
        datasets: Datasets,
        settings: Mapping[str, Attribute],
        warnings: tuple[str, ...] = (),
    ) -> None:
        """Write the result, with the case and what --set changed of it. Raises WriteError if the disk refuses."""
        contents = Contents.begun(self._case, self._kind, self._command, case_part(self._case), settings)
        write_result(self._path, contents.now(status, reason, datasets, warnings))


@contextmanager
def output_file(
    path: Path, case: Case, kind: str, *, overwrite: bool, notify: Callable[[str], None], command: str = ""
) -> Iterator[OutputFile]:
    """Claim a place for the result of a command, before the work is done.

    path: the file.
    case: the design problem.
    kind: the command.
    overwrite: whether another result there may be replaced.
    notify: is given sentences for the user.
    command: the command line, for the record.

    Raises StoreError where it must not or cannot be written or is in use.
    """
    place = prepare_place(path)
    with Lock(place):
        remove_leftovers(place)
        admit(place, case, kind, overwrite, notify)
        yield OutputFile(place, case, kind, command)
