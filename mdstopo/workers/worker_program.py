"""What runs in a worker process: `python -m mdstopo.workers.worker_program`, spoken to over its standard streams.

It is sent pickled messages, each as bytes within a pickle, so that one thread can listen for the end of the input while
another one imports what a message needs.
"""

import os
import pickle
import queue
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from typing import IO, Any

from mdstopo.store.checkpoint import Checkpointer
from mdstopo.workers.worker_pool import Perform, StoppedError, WorkerError


def main() -> None:
    """Read the setup, then do one task after the other, until the input is closed."""
    source, output = _streams()
    inbox: queue.Queue[bytes] = queue.Queue()
    stopped = threading.Event()
    threading.Thread(target=_listen, args=(source, inbox, stopped), daemon=True).start()
    parent = ToParent(output, stopped)
    perform: Perform | None = None
    while True:
        message = inbox.get()
        try:
            if perform is None:
                setup, common = pickle.loads(message)
                perform = setup(common)
                continue
            parent.begin()
            parent.send("done", perform(pickle.loads(message)[1], parent))
        except StoppedError:
            parent.flush()
            parent.send("stopped", None)
        except BrokenPipeError:
            raise
        except Exception as error:
            parent.send("raised", _told(error))
            if perform is None:
                return


class ToParent:
    """The way back: results, and now and then how far a task has come."""

    def __init__(self, output: IO[bytes], stopped: threading.Event, timer: Callable[..., Checkpointer] = Checkpointer):
        self._output = output
        self._latest: Callable[[], object] | None = None
        self._timer = timer
        self.stopped = stopped.is_set
        self.begin()

    def begin(self) -> None:
        """Begin a task: nothing is kept of the one before."""
        self._latest = None
        self._saver = self._timer(self.flush)

    def keep(self, state: Callable[[], object]) -> None:
        """Take how far a task has come; it is sent as often as a checkpoint would be written."""
        self._latest = state
        self._saver.offer()

    def flush(self) -> None:
        """Send what has been taken last, if that is not sent yet."""
        latest, self._latest = self._latest, None
        if latest is not None:
            self.send("kept", latest())

    def send(self, kind: str, what: Any) -> None:
        """Send a message of some kind to the parent process."""
        self._output.write(pickle.dumps((kind, what)))
        self._output.flush()


def _streams() -> tuple[IO[bytes], IO[bytes]]:
    """Where messages come from and where answers go. Signals are for the parent to act on."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    # Whatever prints by mistake must not disturb the messages.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return sys.stdin.buffer, answers


def _listen(source: IO[bytes], inbox: "queue.Queue[bytes]", stopped: threading.Event) -> None:
    """Pass messages on; end this process where there are no more: the parent is done, or gone."""
    try:
        while True:
            message = pickle.load(source)
            if message == _STOP:
                stopped.set()
            else:
                inbox.put(message)
    except (EOFError, OSError, pickle.UnpicklingError):
        os._exit(0)


_STOP = pickle.dumps(("stop", None))


def _told(error: Exception) -> Exception:
    """An exception as it can be sent: itself, with where it was raised, or a sentence where it cannot."""
    error.add_note("".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return WorkerError(f"{type(error).__name__} in a worker process: {error}")
    return error


if __name__ == "__main__":
    try:
        main()
    except BrokenPipeError:
        os._exit(1)
