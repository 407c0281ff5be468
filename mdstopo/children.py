"""Processes that this one starts: fresh interpreters of modules of this package, which end when it does."""

import os
import sys
import threading
from pathlib import Path
from typing import IO


def command(module: str, *words: str) -> list[str]:
    """The command line that runs a module of this package.

    The current folder is not searched for modules: it may hold anybody's files. But for where this package itself was
    found there.
    """
    here = Path(__file__).resolve().parent.parent
    try:
        found_here = here == Path.cwd().resolve()
    except OSError:  # the current folder is gone
        found_here = False
    return [sys.executable, *([] if found_here else ["-P"]), "-m", module, *words]


def end_with_parent(source: IO[bytes]) -> None:
    """End this process as soon as its input is closed, in whatever it is at.

    source: the reading end of a pipe that only the parent holds; the system closes it however the parent ends.
    """

    number = source.fileno()

    def wait() -> None:
        while os.read(number, 1):  # not through `source`, whose lock would be missed when Python ends
            pass
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
