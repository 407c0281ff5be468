"""The command line. `main` is the program; importing it costs nothing."""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import TextIO

#: set by the shell that asks for completions, as click has it
COMPLETE = "_MDSTOPO_COMPLETE"


class OutputError(Exception):
    """Standard output cannot be written: a sentence that says why. `exit_status` as of other errors."""

    exit_status = 1


def main() -> None:
    """Run `mdstopo` with the process's arguments and end the process with its exit status.

    0 done, 1 failed, 2 bad input, 3 interrupted.
    """
    import gc
    import os
    import signal

    # Matrices here are small: threads of a linear algebra library would only wait for each other.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    # Modules are made of cycles that last: looking for others among them takes 15 ms of an import.
    gc.set_threshold(100_000)
    _open_streams()
    # From the first moment on a polite request to end is treated like Ctrl-C, and so is a terminal that is closed.
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as `nohup` has it
        signal.signal(signal.SIGHUP, _interrupt)
    sys.unraisablehook = _say_nothing_of_interrupts
    try:
        status = _dispatch(sys.argv[1:])
    except KeyboardInterrupt:
        _complain(_interrupted())
        status = 3
    except BrokenPipeError:
        status = 0  # the reader has seen enough
    except OutputError as error:
        _complain(str(error))
        status = 1
    except RuntimeError as error:
        # an interrupt in the middle of a compilation makes the compiler stumble over what it left half done
        if not _began_with_interrupt(error):
            raise
        _complain(_interrupted())
        status = 3
    _end(status)


def _interrupted() -> str:
    """What is said of an interruption that leaves nothing to continue: the command begins anew."""
    if len(sys.argv) < 2:
        return "interrupted"
    import shlex

    return f"interrupted, nothing is saved; to begin again: {shlex.join(['mdstopo', *sys.argv[1:]])}"


def _end(status: int) -> None:
    """End the process without taking it apart, which would be an eighth of a warm run.

    Nor by sys.exit where an interrupt passed through an `exec`: Python would end itself by the signal.
    """
    import atexit
    import os

    atexit._run_exitfuncs()  # what others have asked for: temporary files, pools
    os._exit(_flushed(status))


def _dispatch(arguments: list[str]) -> int:
    import os

    if not arguments and COMPLETE in os.environ:  # a shell asks what could come next
        from mdstopo.cli.group import run_group

        return run_group(arguments)
    # Help and version come from a table: click alone would double the time they take.
    if not arguments or arguments in (["--help"], ["-h"], ["help"]):
        from mdstopo.cli.commands import help_text

        _print(help_text())
        return 0
    if arguments == ["--version"]:
        from mdstopo._version import __version__

        _print(f"mdstopo {__version__}")
        return 0
    from mdstopo.cli.group import run_group

    return run_group(arguments)


def _began_with_interrupt(error: BaseException) -> bool:
    seen: BaseException | None = error
    while seen is not None:
        if isinstance(seen, KeyboardInterrupt):
            return True
        seen = seen.__context__
    return False


def _interrupt(_number: int, _frame: object) -> None:
    raise KeyboardInterrupt


def _say_nothing_of_interrupts(unraisable: "sys.UnraisableHookArgs") -> None:
    """An interrupt that arrives in a finaliser is lost there: no reason for a traceback."""
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def _open_streams() -> None:
    """Have the three standard streams, whatever this process was started with, and none that stumbles over a letter.

    The number of a closed one would be given to the next file that is opened: what is said would end up in a result.
    """
    import os

    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # what is written to standard output is missed, so writing it shall fail; nobody reads the others
            os.open(os.devnull, os.O_RDWR if number == 2 else os.O_RDONLY)
    sys.stdin = sys.stdin or open(0, closefd=False)  # noqa: SIM115
    sys.stdout = sys.stdout or open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def _print(text: str) -> None:
    """A text on standard output. Raises OutputError."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise lost(sys.stdout, error) from None


def lost(stream: "TextIO", error: OSError) -> OutputError:
    """The error that says that a stream cannot be written, which from now on leads nowhere."""
    import os

    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return OutputError(f"the output could not be written: {error.strerror}")


def _complain(sentence: str) -> None:
    import contextlib

    with contextlib.suppress(OSError):
        print(sentence, file=sys.stderr, flush=True)


def _flushed(status: int) -> int:
    """Flush the output while a closed pipe can still be ignored."""
    import os

    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        except OSError as error:
            _complain(f"the output could not be written: {error.strerror}")
            status = status or 1
    return status
