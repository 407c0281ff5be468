"""The other end of `pool.Processes`: `python -m mdstopo.front.worker`, spoken to over its standard streams."""

import os
import pickle
import queue
import threading
from typing import IO, Any

from mdstopo.session.crew import streams


def main() -> None:
    """Read what all pieces have in common, then one piece after another, until the input is closed."""
    source, output = streams()
    from mdstopo.front.jobs import perform

    inbox: queue.Queue[Any] = queue.Queue()
    threading.Thread(target=_listen, args=(source, inbox), daemon=True).start()
    setting = inbox.get()
    try:
        while True:
            result = perform(setting, inbox.get())
            pickle.dump(result, output)
            output.flush()
    except BrokenPipeError:
        os._exit(0)


def _listen(source: IO[bytes], inbox: "queue.Queue[Any]") -> None:
    try:
        while True:
            inbox.put(pickle.load(source))
    except (EOFError, OSError, pickle.UnpicklingError):
        os._exit(0)  # the parent wants no more, or is gone: in the middle of a piece, or of a message, too


if __name__ == "__main__":
    main()
