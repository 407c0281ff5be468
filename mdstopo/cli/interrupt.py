"""Ctrl-C, SIGTERM and SIGHUP: at once while nothing would be lost, after the iteration while a run is going."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import click

from mdstopo.cli.output import Output


class Interrupts:
    """Handles SIGINT, SIGTERM and SIGHUP of this process: the first one asks for a stop.

    Before `stop_requested` is first asked, and at the second request, a signal raises KeyboardInterrupt; in
    between it is only noted, so that the iteration can be finished and saved.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.requested = False
        self._gentle = False
        self._quiet = quiet
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:  # as `nohup` has it
                signal.signal(number, self._handle)

    def stop_requested(self) -> bool:
        """Whether to stop; from now on a signal waits until this is asked again."""
        self._gentle = True
        return self.requested

    def _handle(self, _number: int, _frame: object) -> None:
        if not self._gentle or self.requested:
            self.requested = True
            raise KeyboardInterrupt
        self.requested = True
        if not self._quiet:
            # Not print: the signal may have come while the stream was being written.
            with suppress(OSError):  # the terminal is gone
                os.write(2, b"\nfinishing the iteration (once more to end at once)\n")


@contextmanager
def saying_how_to_go_on(
    output: Output, command: str, case: str, path: Path, resume: bool, again: str
) -> Iterator[None]:
    """Where what is done here is interrupted, say by which command it goes on; it begins again if nothing was saved.

    output: where it is said.
    command, case: their names.
    path: the result file.
    resume: whether one of before is continued.
    again: the command that goes on.

    Raises click's Exit with the status of an interruption then. What was not saved is left to who catches
    KeyboardInterrupt, which tells the command as it was typed.
    """
    before = _stamp(path)
    try:
        yield
    except KeyboardInterrupt:
        if not (resume or _stamp(path) != before) or not _is_unfinished(path):
            raise
        reason = "stopped on request; what was saved last can be continued"
        output.document(
            {"command": command, "case": case, "status": "interrupted", "reason": reason, "path": path, "resume": again}
        )
        output.notice(f"interrupted; to go on: {again}")
        raise click.exceptions.Exit(3) from None


def _stamp(path: Path) -> tuple[int, int] | None:
    """What changes whenever a file is replaced; None where there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


def _is_unfinished(path: Path) -> bool:
    """Whether a file holds a result that `--resume` continues."""
    from mdstopo.store.result_reader import read_result
    from mdstopo.store.store_errors import StoreError

    large = ("trajectories", "sensitivities", "optimizer", "iterations", "members", "pareto", "sweep", "combine")
    try:
        return not read_result(path, leave_out=large).finished
    except StoreError:
        return False
