"""Ctrl-C, SIGTERM and SIGHUP: at once while nothing would be lost, after the iteration while a run is going."""

import contextlib
import os
import signal


class Interrupts:
    """Handles these signals of this process.

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
            with contextlib.suppress(OSError):  # the terminal is gone
                os.write(2, b"\nfinishing the iteration (once more to end at once)\n")
