"""The command line. `main` is the program; importing it costs nothing."""

import sys

#: set by the shell that asks for completions, as click has it
COMPLETE = "_MDSTOPO_COMPLETE"


def main() -> None:
    """Run `mdstopo` with the process's arguments and end the process with its exit status.

    0 done, 1 failed, 2 bad input, 3 interrupted.
    """
    import gc
    import signal

    # Modules are made of cycles that last: looking for others among them takes 15 ms of an import.
    gc.set_threshold(100_000)
    # From the first moment on a polite request to end is treated like Ctrl-C.
    signal.signal(signal.SIGTERM, _interrupt)
    sys.unraisablehook = _say_nothing_of_interrupts
    try:
        status = _dispatch(sys.argv[1:])
    except KeyboardInterrupt:
        _complain("interrupted")
        status = 3
    except BrokenPipeError:
        status = 0  # the reader has seen enough
    except RuntimeError as error:
        # an interrupt in the middle of a compilation makes the compiler stumble over what it left half done
        if not _began_with_interrupt(error):
            raise
        _complain("interrupted")
        status = 3
    _end(status)


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

        print(help_text())
        return 0
    if arguments == ["--version"]:
        from mdstopo._version import __version__

        print(f"mdstopo {__version__}")
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


def _complain(sentence: str) -> None:
    import contextlib

    with contextlib.suppress(OSError):
        print(sentence, file=sys.stderr, flush=True)


def _flushed(status: int) -> int:
    """Flush while it can still be said quietly that nobody listens any more."""
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
