"""The other end of `pool.Processes`: `python -m mdstopo.front.worker`, spoken to over its standard streams."""

import os
import pickle
import queue
import threading
from typing import IO, TYPE_CHECKING, Any

from mdstopo.session.crew import streams

if TYPE_CHECKING:
    from mdstopo.optimizer.state import State


def main() -> None:
    """Read what all pieces have in common, then one piece after another, until the input is closed."""
    source, output = streams()
    from mdstopo.front.jobs import perform

    inbox: queue.Queue[Any] = queue.Queue()
    threading.Thread(target=_listen, args=(source, inbox), daemon=True).start()
    setting = inbox.get()
    try:
        while True:
            result = perform(setting, inbox.get(), keep=_Sender(output).keep)
            pickle.dump(result, output)
            output.flush()
    except BrokenPipeError:
        os._exit(0)


class _Sender:
    """Sends the states of a task as often as a checkpoint would be written."""

    def __init__(self, output: IO[bytes]) -> None:
        from mdstopo.store.checkpoint import Checkpointer

        self._output = output
        self._latest: State | None = None
        self._timer = Checkpointer(self._send)

    def keep(self, state: "State") -> None:
        """Take a state, and send it if it is time."""
        self._latest = state
        self._timer.offer()

    def _send(self) -> None:
        from mdstopo.front.pool import Reached

        if self._latest is not None:
            pickle.dump(Reached(self._latest.to_arrays()), self._output)
            self._output.flush()


def _listen(source: IO[bytes], inbox: "queue.Queue[Any]") -> None:
    try:
        while True:
            inbox.put(pickle.load(source))
    except (EOFError, OSError, pickle.UnpicklingError):
        os._exit(0)  # the parent wants no more, or is gone: in the middle of a piece, or of a message, too


if __name__ == "__main__":
    main()
