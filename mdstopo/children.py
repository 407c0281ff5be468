"""Processes that this one starts: fresh interpreters of modules of this package, which end when it does."""

import os
import sys
import threading
from pathlib import Path
from typing import IO

#: where this package is; absolute, for a process may change its folder
_PLACE = Path(__file__).absolute().parent.parent

#: what a process begins with: this package is taken from where the parent has it, though another copy is installed
_BEGIN = """\
import importlib.util, os, runpy, sys
place, module = sys.argv[1:3]
del sys.argv[1:3]
found = importlib.util.find_spec("mdstopo")
folder = os.path.dirname(found.origin) if found and found.origin else ""
if os.path.realpath(folder) != os.path.realpath(os.path.join(place, "mdstopo")):
    sys.path.insert(0, place)
runpy.run_module(module, run_name="__main__", alter_sys=True)
"""


def command(module: str, *words: str) -> list[str]:
    """The command line that runs a module of this package, of the same copy as here.

    A process that is started afresh may find another copy: where this one was found through the first entry of
    sys.path, as in a checkout, and that is not the current folder any more. Its results would be those of other
    sources.

    The current folder is not searched for modules: it may hold anybody's files. But for where this package itself was
    found there.
    """
    try:
        found_here = _PLACE.resolve() == Path.cwd().resolve()
    except OSError:  # the current folder is gone
        found_here = False
    return [sys.executable, *([] if found_here else ["-P"]), "-c", _BEGIN, str(_PLACE), module, *words]


def end_with_parent(source: IO[bytes]) -> None:
    """End this process as soon as its input is closed, whatever it is doing.

    source: the reading end of a pipe that only the parent holds; the system closes it however the parent ends.
    """

    number = source.fileno()

    def wait() -> None:
        while os.read(number, 1):  # not through `source`, whose lock would be missed when Python ends
            pass
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
