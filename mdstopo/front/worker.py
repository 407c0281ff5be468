"""The other end of `pool.Processes`: `python -m mdstopo.front.worker`, spoken to over its standard streams."""

import os
import pickle
import signal
import sys

from mdstopo.front.jobs import perform


def main() -> None:
    """Read what all pieces have in common, then one piece after another, until the input is closed."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    # Whatever prints by mistake must not disturb the messages.
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    source = sys.stdin.buffer
    try:
        setting = pickle.load(source)
        while True:
            result = perform(setting, pickle.load(source))
            pickle.dump(result, output)
            output.flush()
    except (EOFError, BrokenPipeError):
        os._exit(0)  # the parent wants no more, or is gone


if __name__ == "__main__":
    main()
